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
/// Error of odometry over a window, as a share of the distance.
const DRIFT: f64 = 0.02;
/// The same between two neighbouring fixes, which may be on both sides of a bend.
const STEP_DRIFT: f64 = 0.05;
/// Largest residual of a consistent window, in standard deviations.
const OUTLIER: f64 = 3.5;

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
    /// Adds a fix of a point at `lever_m` from the ego origin.
    pub(super) fn take(&mut self, stamp: Time, fix: ([f64; 2], f64), ways: &[Way; 2], lever_m: [f64; 2]) {
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
        fitted(&self.kept[..self.count], ways)
    }

    /// Pose of the ego by the refused fixes only.
    pub(super) fn aligned_since(&self, ways: &[Way; 2]) -> Option<(Aligned, usize)> {
        let since = self.since?;
        let kept = &self.kept[..self.count];
        let first = kept.iter().position(|kept| kept.stamp >= since)?;
        fitted(&kept[first..], ways)
    }

    /// Returns true if the window has at least two fixes from before the refusals.
    pub(super) fn reaches_back(&self) -> bool {
        let before = |since: Time| self.kept[..self.count].iter().filter(|kept| kept.stamp < since).count();
        self.since.is_some_and(|since| before(since) >= 2)
    }
}

/// Fits the first path that is consistent with the fixes; also returns its index.
fn fitted(kept: &[Kept], ways: &[Way; 2]) -> Option<(Aligned, usize)> {
    (0..2).find_map(|which| Some((fit(kept, which, &ways[which])?, which)))
}

/// Fits rotation and translation of one path to the fixes; `None` if they are inconsistent.
fn fit(kept: &[Kept], which: usize, way: &Way) -> Option<Aligned> {
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
    let worst_m = kept.iter().fold(0.0_f64, |worst, one| worst.max(one.sigma_m));
    let sigma_m = math::hypot(worst_m, DRIFT * way_m);
    if kept.windows(2).any(|pair| is_jump(pair, which, &turned)) {
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
fn is_jump(pair: &[Kept], which: usize, turned: &dyn Fn([f64; 2]) -> [f64; 2]) -> bool {
    let [before, after] = [&pair[0], &pair[1]];
    let went = |i: usize| after.antenna_m[which][i] - before.antenna_m[which][i];
    let there = turned(core::array::from_fn(went));
    let [x, y] = core::array::from_fn(|i| after.fix_m[i] - before.fix_m[i] - there[i]);
    let noise_m = math::hypot(before.sigma_m, after.sigma_m);
    math::hypot(x, y) > OUTLIER * math::hypot(noise_m, STEP_DRIFT * (after.length_m - before.length_m))
}
