//! Errors of the pose used for driving, and their consistency with the reported uncertainty.

use std::collections::VecDeque;

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};
use swerve_core::{Span, Time};
use swerve_geom::{math, wrap_angle};
use swerve_msg::{EgoState, PoseMode, PoseQuality};

/// Localization metrics.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct LocalizationMetrics {
    /// Root mean square of the horizontal position error, metres (`evo`'s absolute pose error in x and y, unaligned).
    pub rms_m: f64,
    /// Median of that error, metres; not affected by the initial convergence.
    pub median_m: f64,
    /// 99th percentile of that error, metres.
    pub p99_m: f64,
    /// Root mean square of the error across the true heading, metres, which moves a car off its lane.
    pub across_rms_m: f64,
    /// Maximum of the position error, metres.
    pub max_m: f64,
    /// Instant of the maximum, seconds.
    pub max_at_s: f64,
    /// Root mean square of the heading error, degrees.
    pub heading_rms_deg: f64,
    /// Longest time without a pose, seconds.
    pub silent_max_s: f64,
    /// Quality reported by localization; null if it reports none.
    pub quality: Option<QualityMetrics>,
}

impl LocalizationMetrics {
    /// Text for the terminal, in one line.
    pub fn text(&self) -> String {
        let Self { rms_m, median_m, max_m, heading_rms_deg, .. } = self;
        let known = self.quality.map_or_else(String::new, |q| format!(", NEES {:.1} (3 is right)", q.nees));
        format!(
            "{rms_m:.3} m rms, median {median_m:.3}, at most {max_m:.3}; heading {heading_rms_deg:.2}°{known}"
        )
    }
}

/// A period in which no new pose reached its readers, longer than the controller waits for one.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct PoseGap {
    /// Stamp of the last pose before it, or the start of the drive, seconds.
    pub from_s: f64,
    /// Stamp of the first new pose after it, seconds; null if none arrived up to the end.
    pub until_s: Option<f64>,
}

/// Evaluation of the reported pose quality.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct QualityMetrics {
    /// Mean standard deviation of the position along its worst direction, metres.
    pub sigma_mean_m: f64,
    /// Mean normalized squared error of x, y and heading (NEES); 3 for a consistent filter.
    pub nees: f64,
    /// Longest period of mode `good` with a position error of more than five standard deviations, seconds.
    #[serde(default)]
    pub false_good_max_s: f64,
    /// Share of the time in the modes `noisy` and `coasting`.
    pub coasting_share: f64,
    /// Share of the time without a usable pose.
    pub lost_share: f64,
}

/// Normalized position error above which a pose counts as wrong, standard deviations.
const FALSE_SIGMAS: f64 = 5.0;
/// Silence at the end beyond which a drive had lost its pose: the controller's `stop.blind_after_s`.
const SILENT: Span = Span::from_ms(300);
/// Number of true states kept: more than the latency of a pose.
const KEPT: usize = 512;

/// Accumulates poses and the true states.
#[derive(Clone, Debug, Default)]
pub struct Localization {
    truth: VecDeque<EgoState>,
    /// Stamp and error of the newest pose: forward, left, heading; and in the map frame.
    newest: Option<(Time, Vector3<f64>)>,
    /// The newest new pose that reached its readers.
    heard: Option<EgoState>,
    gaps: Vec<PoseGap>,
    first_truth: Option<Time>,
    distances_m: Vec<f32>,
    squares: f64,
    across_squares: f64,
    heading_squares: f64,
    max: (f64, f64),
    silent_max_s: f64,
    qualities: u64,
    told: u64,
    sigma_sum: f64,
    nees_sum: f64,
    /// Start of the current period of a good mode with a wrong position, and the longest such period, seconds.
    false_good_since: Option<Time>,
    false_good_max_s: f64,
    coasting: u64,
    lost: u64,
}

impl Localization {
    /// Adds the true state after one step.
    pub fn truth(&mut self, ego: &EgoState) {
        self.first_truth.get_or_insert(ego.stamp);
        self.truth.push_back(*ego);
        if self.truth.len() > KEPT {
            self.truth.pop_front();
        }
    }

    /// Adds a pose of the stack and returns its position error, metres; `None` if it is older than the states kept.
    pub fn pose(&mut self, found: &EgoState) -> Option<f64> {
        let until = self.truth.partition_point(|truth| truth.stamp <= found.stamp);
        let truth = self.truth.get(until.checked_sub(1)?)?;
        let since = self.newest.map(|(stamp, _)| stamp).or(self.first_truth).unwrap_or(found.stamp);
        self.silent_max_s = self.silent_max_s.max((found.stamp - since).as_secs());
        let was = truth.pose_after((found.stamp - truth.stamp).as_secs());
        let off = Vector3::new(
            found.pose.x_m - was.x_m,
            found.pose.y_m - was.y_m,
            wrap_angle(found.pose.heading_rad - was.heading_rad),
        );
        let (sin, cos) = math::sin_cos(was.heading_rad);
        let (distance_m, across_m) = (math::hypot(off.x, off.y), off.y * cos - off.x * sin);
        self.distances_m.push(distance_m as f32);
        self.squares += distance_m * distance_m;
        self.across_squares += across_m * across_m;
        self.heading_squares += off.z * off.z;
        if distance_m > self.max.0 {
            self.max = (distance_m, crate::seconds(found.stamp));
        }
        self.newest = Some((found.stamp, off));
        Some(distance_m)
    }

    /// Adds a reported quality, after the pose of its stamp.
    pub fn quality(&mut self, quality: &PoseQuality) {
        self.qualities += 1;
        match quality.mode {
            PoseMode::Good => {}
            PoseMode::Noisy | PoseMode::Coasting => self.coasting += 1,
            PoseMode::Lost => self.lost += 1,
        }
        let Some((_, off)) = self.newest.filter(|(stamp, _)| *stamp == quality.stamp) else { return };
        let [xx, xy, yy, xh, yh, hh] = quality.covariance;
        let covariance = Matrix3::new(xx, xy, xh, xy, yy, yh, xh, yh, hh);
        let Some(weighed) = covariance.cholesky().map(|factor| factor.solve(&off)) else { return };
        self.told += 1;
        self.sigma_sum += quality.sigma_m();
        self.nees_sum += off.dot(&weighed);
        self.false_good(quality, &off);
    }

    /// Accounts for the time of mode `good` with a wrong pose.
    fn false_good(&mut self, quality: &PoseQuality, off: &Vector3<f64>) {
        let [xx, xy, yy, ..] = quality.covariance;
        let determinant = xx * yy - xy * xy;
        let square = (off.x * off.x * yy - 2.0 * off.x * off.y * xy + off.y * off.y * xx) / determinant;
        if quality.mode == PoseMode::Good && square > FALSE_SIGMAS * FALSE_SIGMAS {
            let since = *self.false_good_since.get_or_insert(quality.stamp);
            self.false_good_max_s = self.false_good_max_s.max((quality.stamp - since).as_secs());
        } else {
            self.false_good_since = None;
        }
    }

    /// Adds a pose as it reaches its readers, after the faults of its stream.
    pub fn heard(&mut self, pose: &EgoState) {
        if !pose.is_plausible() || self.heard.is_some_and(|before| pose.repeats(&before)) {
            return;
        }
        let since = self.heard.map(|before| before.stamp).or(self.first_truth);
        if let Some(since) = since.filter(|since| pose.stamp - *since > SILENT) {
            let [from_s, until_s] = [since, pose.stamp].map(crate::seconds);
            self.gaps.push(PoseGap { from_s, until_s: Some(until_s) });
        }
        self.heard = Some(*pose);
    }

    /// Gaps between poses as they reached their readers, in order of time.
    pub fn gaps(&self) -> Vec<PoseGap> {
        let last = self.silent_since().map(|since| PoseGap { from_s: crate::seconds(since), until_s: None });
        self.gaps.iter().copied().chain(last).collect()
    }

    /// Stamp of the last new pose that reached its readers, or of the start, if none arrived up to the end.
    pub fn silent_since(&self) -> Option<Time> {
        let localizes = self.qualities > 0;
        let never = || self.first_truth.filter(|_| localizes);
        let since = self.heard.map(|pose| pose.stamp).or_else(never)?;
        self.truth.back().filter(|last| last.stamp - since > SILENT).map(|_| since)
    }

    /// Metrics so far; `None` if all poses are the simulator's.
    pub fn metrics(&self) -> Option<LocalizationMetrics> {
        if self.qualities == 0 && self.max.0 == 0.0 {
            return None;
        }
        let poses = self.distances_m.len();
        let rms = |squares: f64| (squares / poses.max(1) as f64).sqrt();
        let mut sorted = self.distances_m.clone();
        sorted.sort_by(f32::total_cmp);
        let below = |share: f64| sorted.get(((poses as f64 * share) as usize).min(poses.saturating_sub(1)));
        let below = |share: f64| below(share).map_or(0.0, |&distance_m| f64::from(distance_m));
        let share = |count: u64| count as f64 / self.qualities.max(1) as f64;
        let mean = |sum: f64| sum / self.told.max(1) as f64;
        // Silence lasts up to the end.
        let last = self.truth.back().map(|truth| truth.stamp);
        let since = self.newest.map(|(stamp, _)| stamp).or(self.first_truth);
        let at_end_s = last.zip(since).map_or(0.0, |(last, since)| (last - since).as_secs());
        Some(LocalizationMetrics {
            rms_m: rms(self.squares),
            median_m: below(0.5),
            p99_m: below(0.99),
            across_rms_m: rms(self.across_squares),
            max_m: self.max.0,
            max_at_s: self.max.1,
            heading_rms_deg: rms(self.heading_squares).to_degrees(),
            silent_max_s: self.silent_max_s.max(at_end_s),
            quality: (self.qualities > 0).then(|| QualityMetrics {
                sigma_mean_m: mean(self.sigma_sum),
                nees: mean(self.nees_sum),
                false_good_max_s: self.false_good_max_s,
                coasting_share: share(self.coasting),
                lost_share: share(self.lost),
            }),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use swerve_geom::Pose2;

    fn ego(ms: i64, x_m: f64, y_m: f64, heading_rad: f64) -> EgoState {
        let pose = Pose2::new(x_m, y_m, heading_rad);
        EgoState { stamp: Time::from_ms(ms), pose, ..EgoState::default() }
    }

    #[test]
    fn errors_are_along_and_across_the_true_heading() {
        let mut localization = Localization::default();
        assert!(localization.metrics().is_none());
        let north = core::f64::consts::FRAC_PI_2;
        for k in 0..10 {
            localization.truth(&ego(10 * k, 5.0, 0.1 * k as f64, north));
            let off_m = localization.pose(&ego(10 * k, 5.3, 0.1 * k as f64 + 0.4, north + 0.01));
            assert!((off_m.unwrap() - 0.5).abs() < 1e-12);
        }
        let metrics = localization.metrics().unwrap();
        assert!((metrics.rms_m - 0.5).abs() < 1e-12 && (metrics.max_m - 0.5).abs() < 1e-12);
        assert!((metrics.median_m - 0.5).abs() < 1e-6 && (metrics.p99_m - 0.5).abs() < 1e-6);
        assert!((metrics.across_rms_m - 0.3).abs() < 1e-12, "east is to the right of who goes north");
        assert!((metrics.heading_rms_deg - 0.01_f64.to_degrees()).abs() < 1e-9);
        assert!((metrics.silent_max_s - 0.01).abs() < 1e-12 && metrics.quality.is_none());
    }

    #[test]
    fn gaps_are_between_new_poses_that_reach_their_readers() {
        let mut localization = Localization::default();
        for k in 0..=300 {
            localization.truth(&ego(10 * k, 0.1 * k as f64, 0.0, 0.0));
            // Dropped from 0.5 to 0.9 s, for 0.2 s at 1.2 s, frozen at 1.5 s for 0.4 s, and dropped from 2.5 s on.
            let repeats = (150..190).contains(&k);
            let of = if repeats { 150 } else { k };
            let is_heard = !(51..90).contains(&k) && !(121..140).contains(&k) && k <= 250;
            if is_heard {
                localization.heard(&ego(10 * of, 0.1 * of as f64, 0.0, 0.0));
            }
        }
        let gaps: Vec<_> = localization.gaps().iter().map(|gap| (gap.from_s, gap.until_s)).collect();
        assert_eq!(gaps, [(0.5, Some(0.9)), (1.5, Some(1.9)), (2.5, None)]);
    }

    #[test]
    fn simulator_poses_are_not_evaluated_as_localization() {
        let mut localization = Localization::default();
        localization.truth(&ego(0, 1.0, 2.0, 0.0));
        localization.pose(&ego(0, 1.0, 2.0, 0.0));
        assert!(localization.metrics().is_none());
    }

    #[test]
    fn good_modes_at_wrong_positions_are_timed() {
        let mut localization = Localization::default();
        for k in 0..=300 {
            let stamp = Time::from_ms(10 * k);
            localization.truth(&ego(10 * k, 0.0, 0.0, 0.0));
            // Six standard deviations off from 1 to 1.5 s and from 2 to 3 s; in the second half of the latter the mode
            // is coasting.
            let is_wrong = (100..=150).contains(&k) || k >= 200;
            localization.pose(&ego(10 * k, if is_wrong { 0.6 } else { 0.4 }, 0.0, 0.0));
            let mode = if k > 270 { PoseMode::Coasting } else { PoseMode::Good };
            localization.quality(&PoseQuality { stamp, mode, covariance: [0.01, 0.0, 0.01, 0.0, 0.0, 1e-4] });
        }
        let quality = localization.metrics().unwrap().quality.unwrap();
        assert!((quality.false_good_max_s - 0.7).abs() < 1e-12, "{}", quality.false_good_max_s);
    }

    #[test]
    fn silence_and_reported_quality_are_counted() {
        let mut localization = Localization::default();
        for k in 0..=300 {
            localization.truth(&ego(10 * k, 0.0, 0.0, 0.0));
            let stamp = Time::from_ms(10 * k);
            let mode = if k < 100 { PoseMode::Lost } else { PoseMode::Good };
            let covariance = [0.04, 0.0, 0.01, 0.0, 0.0, 1e-4];
            if k >= 100 {
                localization.pose(&ego(10 * k, 0.2, 0.1, 0.01));
            }
            localization.quality(&PoseQuality { stamp, mode, covariance });
        }
        let metrics = localization.metrics().unwrap();
        let quality = metrics.quality.unwrap();
        assert!((metrics.silent_max_s - 1.0).abs() < 1e-12);
        assert!((quality.nees - 3.0).abs() < 1e-9 && (quality.sigma_mean_m - 0.2).abs() < 1e-12);
        // 0.2 m and 0.1 m at standard deviations of 0.2 m and 0.1 m: the square is 2.
        assert!(quality.false_good_max_s == 0.0);
        assert!((quality.lost_share - 100.0 / 301.0).abs() < 1e-12 && quality.coasting_share == 0.0);
    }
}
