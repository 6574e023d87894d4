//! Consistency of the latest fixes with each other and with odometry, which decides between filter and sensor when
//! they disagree.
//!
//! The fixes of the last seconds are aligned with the odometry path by the best rotation and translation (least
//! squares in the plane: Umeyama, "Least-squares estimation of transformation parameters", 1991, without scale). The
//! filter's position and heading are not used.

use swerve_core::{Span, Time};
use swerve_geom::math;

/// Number of stored fixes, and their largest age.
const KEPT: usize = 12;
const AGE: Span = Span::from_ms(4000);
/// Minimum time between stored fixes; a higher rate adds little information.
const APART: Span = Span::from_ms(95);
/// Error of odometry along its path, as a share of the distance.
const DRIFT: f64 = 0.02;
/// The same of the change from one step to the next.
const CHANGE_DRIFT: f64 = 0.01;
/// The same between two neighbouring fixes, which may be on both sides of a bend.
const STEP_DRIFT: f64 = 0.05;
/// Largest residual of a consistent window, in standard deviations.
const OUTLIER: f64 = 3.5;
/// Numbers of differences over which the noise of fixes is measured. Their median ignores one jump from 7 on, and a jump
/// and its end from 13 on.
const SHORT: [usize; 2] = [7, 13];
const LONG: usize = 23;
/// Noise counts as understated if it is this many times the reported one over a short and over a long window: less than
/// one window in a million exceeds either by chance. While the filter is inconsistent with the fixes, less suffices.
const UNDERSTATED: [f64; 2] = [3.5, 2.2];
const UNDERSTATED_IN_DOUBT: [f64; 2] = [2.5, 1.7];
/// Measured noise below which the reported deviation is used again, as a ratio to it.
const STATED: [f64; 2] = [1.5, 1.5];
/// Safety factor of a measured deviation, which few differences leave uncertain by a fifth.
const UNCERTAIN: f64 = 1.3;
/// Median of a sum of two squares of standard normal numbers.
const MEDIAN_SQUARES: f64 = 1.386;

/// Odometry path on the ground since the start: east, north, heading.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Way {
    at_m: [f64; 2],
    heading_rad: f64,
    length_m: f64,
}

impl Way {
    /// Advances along an arc.
    pub(super) fn go(&mut self, forward_m: f64, turned_rad: f64) {
        let (sin, cos) = math::sin_cos(self.heading_rad + 0.5 * turned_rad);
        self.at_m = [self.at_m[0] + forward_m * cos, self.at_m[1] + forward_m * sin];
        self.heading_rad += turned_rad;
        self.length_m += forward_m.abs();
    }

    /// Turn since the start, radians.
    pub(super) fn turned_rad(&self) -> f64 {
        self.heading_rad
    }

    /// Length of the path, metres.
    pub(super) fn length_m(&self) -> f64 {
        self.length_m
    }

    /// Position of a point at `lever_m` (forward, left) from the path's end, in the frame of the path.
    fn beside(&self, lever_m: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = math::sin_cos(self.heading_rad);
        let [x, y] = lever_m;
        [self.at_m[0] + x * cos - y * sin, self.at_m[1] + x * sin + y * cos]
    }
}

/// A fix of the window.
#[derive(Clone, Copy, Debug, Default)]
struct Kept {
    stamp: Time,
    fix_m: [f64; 2],
    sigma_m: f64,
    /// Position of the antenna in the frame of each path: by gyroscope, by steering angle.
    antenna_m: [[f64; 2]; 2],
    length_m: f64,
}

/// Latest fixes of one source, and the number of consecutive refusals by the filter.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Fixes {
    kept: [Kept; KEPT],
    count: usize,
    /// Number of consecutive refusals, and the time of the first.
    refused: u32,
    since: Option<Time>,
    /// Squares of the second differences of positions, less those of the path, m², newest last.
    squares_m2: [f64; LONG],
    compared: usize,
    /// Deviation of a coordinate as measured, and true while it is far above the reported one.
    noise_m: f64,
    is_understated: bool,
}

/// Position and heading that the fixes agree upon.
#[derive(Clone, Copy, Debug)]
pub(super) struct Aligned {
    /// Position of the ego origin.
    pub(super) at_m: [f64; 2],
    pub(super) sigma_m: f64,
    pub(super) heading_rad: f64,
    pub(super) heading_sigma_rad: f64,
}

impl Fixes {
    /// Adds a fix of a point at `lever_m` from the ego origin. `turn_rad` is the heading of the path's frame, as far as
    /// it is known; `in_doubt` is true while the filter is inconsistent with the fixes.
    pub(super) fn take(
        &mut self,
        stamp: Time,
        fix: ([f64; 2], f64),
        ways: &[Way; 2],
        lever_m: [f64; 2],
        (turn_rad, in_doubt): (f64, bool),
    ) {
        if self.count > 0 && stamp - self.kept[self.count - 1].stamp < APART {
            return;
        }
        let stale = self.kept[..self.count].iter().take_while(|kept| stamp - kept.stamp > AGE).count();
        let gone = stale.max(usize::from(self.count == KEPT));
        self.kept.copy_within(gone..self.count, 0);
        self.count -= gone;
        let antenna_m = ways.map(|way| way.beside(lever_m));
        let (fix_m, sigma_m) = fix;
        self.kept[self.count] = Kept { stamp, fix_m, sigma_m, antenna_m, length_m: ways[0].length_m };
        self.count += 1;
        self.measure(sigma_m, turn_rad, in_doubt);
    }

    /// An empty window, with the noise as measured before.
    pub(super) fn cleared(self) -> Self {
        Self { count: 0, refused: 0, since: None, ..self }
    }

    /// Measures the noise of the fixes in the second differences of their positions, in which the motion of the car
    /// cancels but for its acceleration, known from the path within the error of odometry. Their variance is six times
    /// that of a fix, and their median ignores jumps.
    fn measure(&mut self, stated_m: f64, turn_rad: f64, in_doubt: bool) {
        let [.., first, middle, last] = &self.kept[..self.count] else { return };
        let second = |of: fn(&Kept) -> [f64; 2]| -> [f64; 2] {
            let [first, middle, last] = [first, middle, last].map(of);
            core::array::from_fn(|i| first[i] - 2.0 * middle[i] + last[i])
        };
        let (fixes, [x, y]) = (second(|kept| kept.fix_m), second(|kept| kept.antenna_m[0]));
        let (sin, cos) = math::sin_cos(turn_rad);
        let [off_x, off_y] = [fixes[0] - (x * cos - y * sin), fixes[1] - (x * sin + y * cos)];
        self.squares_m2.rotate_left(1);
        let drift_m = CHANGE_DRIFT * (last.length_m - first.length_m);
        self.squares_m2[LONG - 1] = (off_x * off_x + off_y * off_y - drift_m * drift_m).max(0.0);
        self.compared = (self.compared + 1).min(LONG);
        let limits = match (self.is_understated, in_doubt) {
            (true, _) => STATED,
            (false, true) => UNDERSTATED_IN_DOUBT,
            (false, false) => UNDERSTATED,
        };
        let measured_m = [self.compared.clamp(SHORT[0], SHORT[1]), LONG].map(|count| self.deviation_m(count));
        self.noise_m = measured_m[0].max(measured_m[1]);
        self.is_understated =
            measured_m.iter().zip(limits).any(|(noise_m, ratio)| *noise_m > ratio * stated_m);
    }

    /// Deviation of a coordinate of the fixes by the latest differences, metres; 0 for too few.
    fn deviation_m(&self, count: usize) -> f64 {
        if self.compared < count {
            return 0.0;
        }
        let mut squares_m2 = self.squares_m2;
        let latest = &mut squares_m2[LONG - count..];
        latest.sort_by(f64::total_cmp);
        (latest[count / 2] / (6.0 * MEDIAN_SQUARES)).sqrt()
    }

    /// Returns true while the noise of the fixes is far above the reported deviation.
    pub(super) fn is_understated(&self) -> bool {
        self.is_understated
    }

    /// Deviation of a fix: as reported, or as measured where that is understated, metres.
    pub(super) fn sigma_m(&self, stated_m: f64) -> f64 {
        if self.is_understated { (UNCERTAIN * self.noise_m).max(stated_m) } else { stated_m }
    }

    /// Records whether the filter accepted the latest fix.
    pub(super) fn judge(&mut self, stamp: Time, accepted: bool) {
        match accepted {
            true => (self.refused, self.since) = (0, None),
            false => {
                self.refused = self.refused.saturating_add(1);
                self.since.get_or_insert(stamp);
            }
        }
    }

    /// Number of consecutive refusals, and their duration up to `now`.
    pub(super) fn refused(&self, now: Time) -> (u32, Span) {
        (self.refused, self.since.map_or(Span::ZERO, |since| now - since))
    }

    /// Pose of the ego by all fixes of the window, accepted or refused.
    pub(super) fn aligned(&self, ways: &[Way; 2]) -> Option<(Aligned, usize)> {
        self.fitted(&self.kept[..self.count], ways)
    }

    /// Pose of the ego by the refused fixes only.
    pub(super) fn aligned_since(&self, ways: &[Way; 2]) -> Option<(Aligned, usize)> {
        let since = self.since?;
        let kept = &self.kept[..self.count];
        let first = kept.iter().position(|kept| kept.stamp >= since)?;
        self.fitted(&kept[first..], ways)
    }

    /// Fits the first path that is consistent with the fixes; also returns its index.
    fn fitted(&self, kept: &[Kept], ways: &[Way; 2]) -> Option<(Aligned, usize)> {
        (0..2).find_map(|which| Some((fit(kept, self.noise_m, which, &ways[which])?, which)))
    }

    /// Returns true if the window has at least two fixes from before the refusals.
    pub(super) fn reaches_back(&self) -> bool {
        let before = |since: Time| self.kept[..self.count].iter().filter(|kept| kept.stamp < since).count();
        self.since.is_some_and(|since| before(since) >= 2)
    }
}

/// Fits rotation and translation of one path to fixes of at least this noise, metres; `None` if they are inconsistent.
fn fit(kept: &[Kept], noise_m: f64, which: usize, way: &Way) -> Option<Aligned> {
    let count = kept.len() as f64;
    if kept.len() < 3 {
        return None;
    }
    let mean = |of: &dyn Fn(&Kept) -> [f64; 2]| {
        let sum = kept.iter().map(of).fold([0.0; 2], |sum, x| [sum[0] + x[0], sum[1] + x[1]]);
        sum.map(|x| x / count)
    };
    let antenna = |kept: &Kept| kept.antenna_m[which];
    let (from, to) = (mean(&antenna), mean(&|kept: &Kept| kept.fix_m));
    let (mut cross, mut dot, mut arm) = (0.0, 0.0, 0.0);
    for one in kept {
        let [a, b] = core::array::from_fn(|i| antenna(one)[i] - from[i]);
        let [x, y] = core::array::from_fn(|i| one.fix_m[i] - to[i]);
        (cross, dot, arm) = (cross + a * y - b * x, dot + a * x + b * y, arm + a * a + b * b);
    }
    let turn_rad = math::atan2(cross, dot);
    let (sin, cos) = math::sin_cos(turn_rad);
    let turned = |[x, y]: [f64; 2]| [x * cos - y * sin, x * sin + y * cos];
    let way_m = kept[kept.len() - 1].length_m - kept[0].length_m;
    let worst_m = kept.iter().fold(noise_m, |worst, one| worst.max(one.sigma_m));
    let sigma_m = math::hypot(worst_m, DRIFT * way_m);
    if kept.windows(2).any(|pair| is_jump(pair, noise_m, which, &turned)) {
        return None;
    }
    let mut chi_square = 0.0;
    for one in kept {
        let there = turned(core::array::from_fn(|i| antenna(one)[i] - from[i]));
        let off: [f64; 2] = core::array::from_fn(|i| one.fix_m[i] - to[i] - there[i]);
        let off_m = math::hypot(off[0], off[1]);
        if off_m > OUTLIER * sigma_m {
            return None;
        }
        chi_square += off_m * off_m / (sigma_m * sigma_m);
    }
    // Mean plus 3.3 standard deviations: one in a thousand consistent windows exceeds it.
    let freedom = 2.0 * count - 3.0;
    if chi_square > freedom + 3.3 * (2.0 * freedom).sqrt() {
        return None;
    }
    let heading_rad = way.heading_rad + turn_rad;
    let there = turned(core::array::from_fn(|i| way.at_m[i] - from[i]));
    let arm_m = math::hypot(there[0], there[1]);
    let heading_sigma_rad = sigma_m / arm.sqrt().max(1e-6);
    Some(Aligned {
        at_m: [to[0] + there[0], to[1] + there[1]],
        sigma_m: math::hypot(sigma_m / count.sqrt(), heading_sigma_rad * arm_m),
        heading_rad,
        heading_sigma_rad,
    })
}

/// Returns true if two neighbouring fixes are farther apart than odometry and noise explain.
fn is_jump(pair: &[Kept], noise_m: f64, which: usize, turned: &dyn Fn([f64; 2]) -> [f64; 2]) -> bool {
    let [before, after] = [&pair[0], &pair[1]];
    let went = |i: usize| after.antenna_m[which][i] - before.antenna_m[which][i];
    let there = turned(core::array::from_fn(went));
    let [x, y] = core::array::from_fn(|i| after.fix_m[i] - before.fix_m[i] - there[i]);
    let noise_m = math::hypot(before.sigma_m.max(noise_m), after.sigma_m.max(noise_m));
    math::hypot(x, y) > OUTLIER * math::hypot(noise_m, STEP_DRIFT * (after.length_m - before.length_m))
}
