use serde::{Deserialize, Serialize};
use swerve_msg::truth::Verdict;

/// A metric of a run for which a scenario can set bounds.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Metric {
    /// Smallest distance between the ego's outline and any actor, metres.
    MinDistanceM,
    /// Speed of the ego at the first collision, m/s.
    ImpactSpeedMps,
    /// Closing speed along the contact normal at the first collision, m/s.
    ClosingSpeedMps,
    /// Speed of the ego at the end, m/s.
    EndSpeedMps,
    /// Length of the run, seconds.
    DurationS,
    /// Largest lateral acceleration, m/s².
    LateralAccelMaxMps2,
    /// Largest lateral jerk, m/s³.
    LateralJerkMaxMps3,
    /// Largest deceleration, m/s².
    DecelerationMaxMps2,
    /// Share of the time within nuPlan's limits of comfort.
    ComfortShare,
    /// Smallest distance of the ego's outline to the edge of the drivable ground, metres.
    RoadMarginM,
    /// Number of stop lines that the ego's front crossed at a red light.
    RedLightsPassed,
    /// Least time to collision, seconds.
    MinTtcS,
    /// Least time headway to the lead in the own lane, seconds.
    MinHeadwayS,
    /// Distance driven with part of the outline outside the own lane, metres.
    DistanceOverLineM,
    /// Time with part of the outline to the left of the own lane, seconds.
    TimeInOncomingLaneS,
    /// Largest excess of the speed over the target speed, m/s.
    SpeedOverTargetMps,
}

impl Metric {
    /// All metrics.
    pub const ALL: [Self; 16] = [
        Self::MinDistanceM,
        Self::ImpactSpeedMps,
        Self::ClosingSpeedMps,
        Self::EndSpeedMps,
        Self::DurationS,
        Self::LateralAccelMaxMps2,
        Self::LateralJerkMaxMps3,
        Self::DecelerationMaxMps2,
        Self::ComfortShare,
        Self::RoadMarginM,
        Self::RedLightsPassed,
        Self::MinTtcS,
        Self::MinHeadwayS,
        Self::DistanceOverLineM,
        Self::TimeInOncomingLaneS,
        Self::SpeedOverTargetMps,
    ];

    /// Returns true if a run without this metric satisfies a bound: a run without a collision satisfies upper bounds
    /// on collision speeds; a run without a conflict, or without a lead, satisfies lower bounds on time to collision
    /// and headway.
    fn is_kept_without(self, bound: &Bound) -> bool {
        match self {
            Self::ImpactSpeedMps | Self::ClosingSpeedMps => bound.min.is_none_or(|min| min <= 0.0),
            Self::MinTtcS | Self::MinHeadwayS => bound.max.is_none(),
            _ => false,
        }
    }

    /// Name in scenario files.
    pub fn name(self) -> &'static str {
        match self {
            Self::MinDistanceM => "min_distance_m",
            Self::ImpactSpeedMps => "impact_speed_mps",
            Self::ClosingSpeedMps => "closing_speed_mps",
            Self::EndSpeedMps => "end_speed_mps",
            Self::DurationS => "duration_s",
            Self::LateralAccelMaxMps2 => "lateral_accel_max_mps2",
            Self::LateralJerkMaxMps3 => "lateral_jerk_max_mps3",
            Self::DecelerationMaxMps2 => "deceleration_max_mps2",
            Self::ComfortShare => "comfort_share",
            Self::RoadMarginM => "road_margin_m",
            Self::RedLightsPassed => "red_lights_passed",
            Self::MinTtcS => "min_ttc_s",
            Self::MinHeadwayS => "min_headway_s",
            Self::DistanceOverLineM => "distance_over_line_m",
            Self::TimeInOncomingLaneS => "time_in_oncoming_lane_s",
            Self::SpeedOverTargetMps => "speed_over_target_mps",
        }
    }
}

/// Lowest and highest value allowed for a metric.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Bound {
    /// The bounded metric.
    pub metric: Metric,
    /// Lowest value allowed.
    pub min: Option<f64>,
    /// Highest value allowed.
    pub max: Option<f64>,
}

/// Expected verdict of a run, and bounds on its metrics.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Expectation {
    /// Pipeline that this applies to; `None`: any that has no entry of its own.
    pub pipeline: Option<String>,
    /// Expected verdict.
    pub verdict: Verdict,
    /// Bounds on its metrics.
    pub bounds: Vec<Bound>,
}

impl Expectation {
    /// Note on a verdict that has been renamed: the present name of this run's verdict, if an outdated name for it is
    /// expected.
    pub fn renamed(&self, verdict: Verdict) -> Option<String> {
        let is_old = verdict != self.verdict && verdict.old_name() == self.verdict;
        is_old.then(|| format!("[expect] verdict `{}`: such a run is called `{verdict}` now", self.verdict))
    }

    /// The expectation for a run that the ego ended at standstill because its pose was too uncertain for the lane.
    /// Until then the run must be as safe and comfortable as expected; bounds on end speed and duration are dropped,
    /// and so are those on the speed of a collision.
    #[must_use]
    pub fn until_stop(&self) -> Self {
        let of_end = |bound: &Bound| matches!(bound.metric, Metric::EndSpeedMps | Metric::DurationS);
        let hits = |bound: &Bound| matches!(bound.metric, Metric::ImpactSpeedMps | Metric::ClosingSpeedMps);
        let bounds = self.bounds.iter().filter(|bound| !of_end(bound) && !hits(bound)).copied().collect();
        Self { verdict: Verdict::Stopped, bounds, ..self.clone() }
    }

    /// Deviations of a run from the expectation; empty if there are none. `value` returns a metric of the run, or
    /// `None` if the run does not have it, which violates its bound. Exceptions: a run without a collision satisfies
    /// upper bounds on collision speeds; a run that is never on a collision course, or has no lead, satisfies lower
    /// bounds on time to collision and headway. A passed red light violates any expectation without a bound on
    /// [`Metric::RedLightsPassed`].
    pub fn broken_by(&self, verdict: Verdict, value: impl Fn(Metric) -> Option<f64>) -> Vec<String> {
        let mut broken = Vec::new();
        if verdict != self.verdict && verdict.old_name() != self.verdict {
            broken.push(format!("expected the verdict {}, got {verdict}", self.verdict));
        }
        let passed = Metric::RedLightsPassed;
        let none_passed = Bound { metric: passed, min: None, max: Some(0.0) };
        let is_bounded = self.bounds.iter().any(|bound| bound.metric == passed) || value(passed).is_none();
        for bound in self.bounds.iter().chain((!is_bounded).then_some(&none_passed)) {
            let name = bound.metric.name();
            match value(bound.metric) {
                None if bound.metric.is_kept_without(bound) => {}
                None => broken.push(format!("{name} is bounded, but the run has none")),
                Some(value) => {
                    // Rounded to 1e-6, and -0 to 0.
                    let shown = (value * 1e6).round() / 1e6 + 0.0;
                    if let Some(min) = bound.min.filter(|&min| value.is_nan() || value < min) {
                        broken.push(format!("expected {name} of at least {min}, got {shown}"));
                    }
                    if let Some(max) = bound.max.filter(|&max| value.is_nan() || value > max) {
                        broken.push(format!("expected {name} of at most {max}, got {shown}"));
                    }
                }
            }
        }
        broken
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn broken_bounds_are_all_named() {
        let bound = |metric, min, max| Bound { metric, min, max };
        let expectation = Expectation {
            pipeline: None,
            verdict: Verdict::Avoided,
            bounds: vec![
                bound(Metric::MinDistanceM, Some(0.3), Some(3.0)),
                bound(Metric::DurationS, None, Some(12.0)),
                bound(Metric::ImpactSpeedMps, Some(1.0), None),
            ],
        };
        let metrics = |min_distance: f64| {
            move |metric| match metric {
                Metric::MinDistanceM => Some(min_distance),
                Metric::DurationS => Some(11.0),
                Metric::ImpactSpeedMps => Some(4.0),
                _ => None,
            }
        };
        assert_eq!(expectation.broken_by(Verdict::Avoided, metrics(0.3)), Vec::<String>::new());
        assert_eq!(expectation.broken_by(Verdict::Completed, metrics(0.3)), Vec::<String>::new());
        assert_eq!(expectation.renamed(Verdict::Avoided), None);
        assert!(expectation.renamed(Verdict::Completed).unwrap().contains("`completed`"));
        assert_eq!(
            expectation.broken_by(Verdict::Collision, metrics(0.2)),
            [
                "expected the verdict avoided, got collision",
                "expected min_distance_m of at least 0.3, got 0.2",
            ]
        );
        assert_eq!(
            expectation.broken_by(Verdict::Avoided, metrics(f64::NAN)).len(),
            2,
            "not-a-number breaks both sides"
        );
        assert_eq!(expectation.broken_by(Verdict::Avoided, |_| None).len(), 3);
        let at_most = Expectation {
            bounds: vec![bound(Metric::ImpactSpeedMps, None, Some(8.0))],
            ..expectation.clone()
        };
        assert_eq!(at_most.broken_by(Verdict::Avoided, |_| None), Vec::<String>::new());
        let hits = |metric| (metric == Metric::ImpactSpeedMps).then_some(9.0);
        assert_eq!(at_most.broken_by(Verdict::Avoided, hits).len(), 1);
        for metric in [Metric::MinTtcS, Metric::MinHeadwayS] {
            for (max, broken) in [(None, 0), (Some(5.0), 1)] {
                let bounds = vec![bound(metric, Some(1.5), max)];
                let near = Expectation { bounds, ..expectation.clone() };
                assert_eq!(near.broken_by(Verdict::Avoided, |_| None).len(), broken, "{}", metric.name());
                let nearer = |of| (of == metric).then_some(1.4);
                assert_eq!(near.broken_by(Verdict::Avoided, nearer).len(), 1, "{}", metric.name());
            }
        }
    }

    #[test]
    fn stop_for_an_uncertain_pose_keeps_bounds_except_those_on_the_end() {
        let bound = |metric, min, max| Bound { metric, min, max };
        let bounds = vec![
            bound(Metric::EndSpeedMps, Some(11.0), None),
            bound(Metric::DurationS, None, Some(30.0)),
            bound(Metric::RoadMarginM, Some(0.0), None),
        ];
        let stop = Expectation { pipeline: None, verdict: Verdict::Completed, bounds }.until_stop();
        let run = |margin_m: f64| {
            move |metric| match metric {
                Metric::EndSpeedMps => Some(0.0),
                Metric::DurationS => Some(90.0),
                Metric::RoadMarginM => Some(margin_m),
                _ => None,
            }
        };
        assert_eq!(stop.broken_by(Verdict::Stopped, run(0.1)), Vec::<String>::new());
        assert_eq!(
            stop.broken_by(Verdict::Stopped, run(-0.1)),
            ["expected road_margin_m of at least 0, got -0.1"]
        );
        assert_eq!(stop.broken_by(Verdict::LeftRoad, run(0.1)).len(), 1);
    }

    #[test]
    fn passed_red_light_breaks_an_expectation_unless_bounded() {
        let mut expectation = Expectation { pipeline: None, verdict: Verdict::Completed, bounds: Vec::new() };
        let passed = |n: f64| move |metric| (metric == Metric::RedLightsPassed).then_some(n);
        assert_eq!(expectation.broken_by(Verdict::Completed, passed(0.0)), Vec::<String>::new());
        assert_eq!(
            expectation.broken_by(Verdict::Completed, passed(1.0)),
            ["expected red_lights_passed of at most 0, got 1"]
        );
        let allowed = Bound { metric: Metric::RedLightsPassed, min: None, max: Some(1.0) };
        expectation.bounds.push(allowed);
        assert_eq!(expectation.broken_by(Verdict::Completed, passed(1.0)), Vec::<String>::new());
        assert_eq!(expectation.broken_by(Verdict::Completed, passed(2.0)).len(), 1);
    }
}
