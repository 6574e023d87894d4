//! How far the pose that the stack drives by is from the true one, and whether localization knows that.

use std::collections::VecDeque;

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};
use swerve_core::{Span, Time};
use swerve_geom::{math, wrap_angle};
use swerve_msg::{EgoState, PoseMode, PoseQuality};

/// Localization in figures.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct LocalizationMetrics {
    /// Root mean square of the distance on the ground, metres (`evo`'s absolute pose error in x and y, unaligned).
    pub rms_m: f64,
    /// Median of that distance, metres: the start, before much is known, does not weigh in it.
    pub median_m: f64,
    /// What it is below in 99 of 100 poses, metres.
    pub p99_m: f64,
    /// Root mean square across the true heading: what takes a car off its lane, metres.
    pub across_rms_m: f64,
    /// The largest distance, metres.
    pub max_m: f64,
    /// Its instant, seconds.
    pub max_at_s: f64,
    /// Root mean square of the heading's error, degrees.
    pub heading_rms_deg: f64,
    /// Longest time without a pose, seconds.
    pub silent_max_s: f64,
    /// What localization says of itself; null where it says nothing.
    pub quality: Option<QualityMetrics>,
}

impl LocalizationMetrics {
    /// For the terminal, in one line.
    pub fn text(&self) -> String {
        let Self { rms_m, median_m, max_m, heading_rms_deg, .. } = self;
        let known = self.quality.map_or_else(String::new, |q| format!(", NEES {:.1} (3 is right)", q.nees));
        format!(
            "{rms_m:.3} m rms, median {median_m:.3}, at most {max_m:.3}; heading {heading_rms_deg:.2}°{known}"
        )
    }
}

/// A time in which no new pose reached its readers, for longer than the controller waits for one.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct PoseGap {
    /// Stamp of the last pose before it, or the beginning of the drive, seconds.
    pub from_s: f64,
    /// Stamp of the first new pose after it, seconds; null where none came up to the end.
    pub until_s: Option<f64>,
}

/// What localization says of itself.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct QualityMetrics {
    /// Mean standard deviation of the place along its worst direction, metres.
    pub sigma_mean_m: f64,
    /// Mean square of the error of x, y and heading over its covariance; 3 where it knows how good it is.
    pub nees: f64,
    /// Longest time in which the mode was good although the place was off by more than five standard deviations, seconds.
    #[serde(default)]
    pub false_good_max_s: f64,
    /// Share of the time by inertia and wheels alone.
    pub coasting_share: f64,
    /// Share of the time without a pose to be driven by.
    pub lost_share: f64,
}

/// A place that is off by more standard deviations than this is wrong.
const FALSE_SIGMAS: f64 = 5.0;
/// Without a pose for longer than this at its end a drive had none any more: the controller's `stop.blind_after_s`.
const SILENT: Span = Span::from_ms(300);
/// True states that are kept: more than a pose takes to be published.
const KEPT: usize = 512;

/// Takes in poses and what they should have been.
#[derive(Clone, Debug, Default)]
pub struct Localization {
    truth: VecDeque<EgoState>,
    /// Stamp and error of the newest pose: forward, to the left, heading; and in the map.
    newest: Option<(Time, Vector3<f64>)>,
    /// The newest pose that reached its readers and said something new.
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
    /// Since when the mode is good and the place is wrong, and for how long that was at most, seconds.
    false_good_since: Option<Time>,
    false_good_max_s: f64,
    coasting: u64,
    lost: u64,
}

impl Localization {
    /// The true state after one step.
    pub fn truth(&mut self, ego: &EgoState) {
        self.first_truth.get_or_insert(ego.stamp);
        self.truth.push_back(*ego);
        if self.truth.len() > KEPT {
            self.truth.pop_front();
        }
    }

    /// The pose that the stack gets, and by how much it is off, metres; none counts that is older than what is kept.
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

    /// What localization says of itself, after the pose of its stamp.
    pub fn quality(&mut self, quality: &PoseQuality) {
        self.qualities += 1;
        match quality.mode {
            PoseMode::Good => {}
            PoseMode::Coasting => self.coasting += 1,
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

    /// The time in which the mode is `good` although the pose is wrong.
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

    /// A pose as it reaches its readers, after the faults of its stream.
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

    /// The gaps between poses as they reached their readers, in order of time.
    pub fn gaps(&self) -> Vec<PoseGap> {
        let last = self.silent_since().map(|since| PoseGap { from_s: crate::seconds(since), until_s: None });
        self.gaps.iter().copied().chain(last).collect()
    }

    /// Stamp of the last pose that reached its readers and said something new, or of the beginning, where none came any more up
    /// to the end.
    pub fn silent_since(&self) -> Option<Time> {
        let localizes = self.qualities > 0;
        let never = || self.first_truth.filter(|_| localizes);
        let since = self.heard.map(|pose| pose.stamp).or_else(never)?;
        self.truth.back().filter(|last| last.stamp - since > SILENT).map(|_| since)
    }

    /// The figures so far; none where every pose is the true one, as the simulator tells it.
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
    fn the_simulators_own_poses_are_no_localization() {
        let mut localization = Localization::default();
        localization.truth(&ego(0, 1.0, 2.0, 0.0));
        localization.pose(&ego(0, 1.0, 2.0, 0.0));
        assert!(localization.metrics().is_none());
    }

    #[test]
    fn good_modes_at_wrong_places_are_timed() {
        let mut localization = Localization::default();
        for k in 0..=300 {
            let stamp = Time::from_ms(10 * k);
            localization.truth(&ego(10 * k, 0.0, 0.0, 0.0));
            // Six deviations off from 1 to 1.5 s and from 2 to 3 s; in the second half of the latter it is coasting.
            let is_wrong = (100..=150).contains(&k) || k >= 200;
            localization.pose(&ego(10 * k, if is_wrong { 0.6 } else { 0.4 }, 0.0, 0.0));
            let mode = if k > 270 { PoseMode::Coasting } else { PoseMode::Good };
            localization.quality(&PoseQuality { stamp, mode, covariance: [0.01, 0.0, 0.01, 0.0, 0.0, 1e-4] });
        }
        let quality = localization.metrics().unwrap().quality.unwrap();
        assert!((quality.false_good_max_s - 0.7).abs() < 1e-12, "{}", quality.false_good_max_s);
    }

    #[test]
    fn silence_and_what_it_says_of_itself_count() {
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
        // 0.2 m and 0.1 m of 0.2 m and 0.1 m deviation: the square is 2.
        assert!(quality.false_good_max_s == 0.0);
        assert!((quality.lost_share - 100.0 / 301.0).abs() < 1e-12 && quality.coasting_share == 0.0);
    }
}
