//! Joint fit of both lane lines and the pitch to the marks.
//!
//! For a mark at `(x, y)` on the road, metres ahead of the camera and to its left, the residual is
//! `y - (o + ψ x + c x² / 2)`. The offset `o` is separate for each line; heading `ψ` and curvature `c` are shared;
//! `(x, y)` depends on the pitch. Tukey weights with a shrinking width (IRLS; Huber, "Robust Statistics", 1981).

use nalgebra::{Matrix3, Matrix5, SMatrix, Vector5};
use swerve_geom::math;

use super::line::{LaneLine, Lanes, Mark};
use super::settings::LaneSettings;

/// Lane relative to the camera.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Road {
    pub(super) pitch_rad: f64,
    pub(super) heading_rad: f64,
    pub(super) curvature_1pm: f64,
    /// Offsets of the left and right line at the camera, metres to its left.
    pub(super) offsets_m: [Option<f64>; 2],
}

/// Road fitted to the marks.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fitted {
    pub(super) road: Road,
    /// Covariance of pitch, heading, curvature and both offsets.
    covariance: Matrix5<f64>,
}

/// Number of marks above which they are subsampled.
const MARKS_MAX: usize = 2000;
/// Iterations, and gate of a mark's residual in the first and last of them, metres.
const ROUNDS: usize = 12;
const GATE_M: [f64; 2] = [0.45, 0.18];
/// Standard deviation of a mark: across the road, metres, and in the image, pixels.
const DEVIATION_M: f64 = 0.04;
const DEVIATION_PX: f64 = 0.7;
/// Marks that count as one, as errors of neighbouring rows are correlated.
const ALIKE: f64 = 4.0;
/// Prior standard deviations of heading and curvature, radians and 1/m.
const HEADING_RAD: f64 = 0.2;
const CURVATURE_1PM: f64 = 0.01;
/// Smallest length of a line, metres, and fewest marks on it.
const LENGTH_M: f64 = 6.0;
const MARKS: usize = 12;
/// Longest gap between two strokes of a broken line, metres.
const GAP_M: f64 = 14.0;
/// Start of a line: this many marks within this length, metres.
const TOGETHER: usize = 4;
const TOGETHER_M: f64 = 1.0;
/// Smallest ratio of mark density on a line to that beside it: on both lines of a lane, and on a line alone. On 14
/// photographs the ratio is 4.8 or more on painted lines; on unmarked roads and slabs it is mostly below 4.
const DENSER: [f64; 2] = [4.0, 6.0];
/// Lateral distance range that counts as beside a line, metres.
const BESIDE_M: [f64; 2] = [0.3, 0.75];

/// Marks of a line.
#[derive(Clone, Copy, Debug)]
struct Seen {
    /// Distances of the nearest and the farthest mark, metres ahead of the camera.
    range_m: [f64; 2],
    /// Number of marks, and the number expected by chance, from those beside the line.
    marks: f64,
    by_chance: f64,
}

/// Fitter with its buffers.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    settings: LaneSettings,
    /// Position of the camera in the ego frame, metres.
    camera_m: [f64; 3],
    /// Longitudinal distances of the marks on one line, metres.
    on_line: Vec<f64>,
}

/// Normal equations of pitch, heading, curvature and both offsets.
struct Equations {
    matrix: Matrix5<f64>,
    side: Vector5<f64>,
    /// Sum of the weighted squared residuals, and of the weights times variance.
    squares: f64,
    weights: f64,
}

impl Fit {
    pub(super) fn new(settings: LaneSettings, camera_m: [f64; 3]) -> Self {
        Self { settings, camera_m, on_line: Vec::new() }
    }

    /// Fits the road to the marks, starting from a guess.
    pub(super) fn refine(&self, guess: Road, marks: &[Mark], focal_px: f64) -> Fitted {
        let mut fitted = Fitted { road: guess, covariance: Matrix5::zeros() };
        for round in 0..ROUNDS {
            let share = (round as f64 / (ROUNDS as f64 - 3.0)).min(1.0);
            let gate_m = GATE_M[0] + (GATE_M[1] - GATE_M[0]) * share;
            let Fitted { road, .. } = &mut fitted;
            let equations = self.equations(road, marks, focal_px, gate_m);
            let Some(inverse) = equations.matrix.try_inverse() else { break };
            let step = inverse * equations.side;
            road.pitch_rad += step[0];
            road.heading_rad += step[1];
            road.curvature_1pm += step[2];
            for (offset, step) in road.offsets_m.iter_mut().zip([step[3], step[4]]) {
                *offset = offset.map(|offset_m| offset_m + step);
            }
            let spread = equations.squares / equations.weights.max(1.0);
            fitted.covariance = inverse * (ALIKE * spread.max(1.0));
        }
        fitted
    }

    fn equations(&self, road: &Road, marks: &[Mark], focal_px: f64, gate_m: f64) -> Equations {
        let height_m = self.camera_m[2];
        let turn: [f64; 2] = math::sin_cos(road.pitch_rad).into();
        let mut sums = self.before(road);
        for mark in marks.iter().step_by(1 + marks.len() / MARKS_MAX) {
            let Some([x, y]) = mark.on_road(height_m, turn).filter(|[x, _]| *x < self.settings.reach_m)
            else {
                continue;
            };
            let own_m = y - x * (road.heading_rad + 0.5 * road.curvature_1pm * x);
            let off = |k: usize| road.offsets_m[k].map_or(f64::INFINITY, |offset_m| own_m - offset_m);
            let line = usize::from(off(1).abs() < off(0).abs());
            let residual = off(line);
            let image_m = DEVIATION_PX * x / focal_px;
            let variance = DEVIATION_M * DEVIATION_M + image_m * image_m;
            let out = residual * residual / (gate_m * gate_m).max(9.0 * variance);
            if out >= 1.0 {
                continue;
            }
            let weight = mark.weight() * (1.0 - out) * (1.0 - out) / variance;
            // With pitch a mark moves on the road: x towards the camera, and y in proportion.
            let slope = height_m / x;
            let closer = -x * (slope + 1.0 / slope);
            let by_pitch = -y / slope - (road.heading_rad + road.curvature_1pm * x) * closer;
            let of_line = |k: usize| if k == line { 1.0 } else { 0.0 };
            let row = Vector5::new(-by_pitch, x, 0.5 * x * x, of_line(0), of_line(1));
            sums.matrix += row * row.transpose() * weight;
            sums.side += row * (residual * weight);
            sums.squares += weight * residual * residual;
            sums.weights += weight * variance;
        }
        sums
    }

    /// Prior; the offset of a missing line is held constant.
    fn before(&self, road: &Road) -> Equations {
        let information = |deviation: f64| ALIKE / (deviation * deviation);
        let free = |offset: Option<f64>| if offset.is_some() { 1e-6 } else { 1.0 };
        let diagonal = Vector5::new(
            information(self.settings.pitch_deviation_rad),
            information(HEADING_RAD),
            information(CURVATURE_1PM),
            free(road.offsets_m[0]),
            free(road.offsets_m[1]),
        );
        let at = Vector5::new(road.pitch_rad, road.heading_rad, road.curvature_1pm, 0.0, 0.0);
        let matrix = Matrix5::from_diagonal(&diagonal);
        Equations { matrix, side: -(matrix * at), squares: 0.0, weights: 0.0 }
    }

    /// Returns true if the road's width, pitch and heading are within limits.
    pub(super) fn is_plausible(&self, road: &Road) -> bool {
        let [narrow_m, wide_m] = self.settings.width_m;
        let is_lane = match road.offsets_m {
            [Some(left_m), Some(right_m)] => (narrow_m..=wide_m).contains(&(left_m - right_m)),
            _ => true,
        };
        let pitch_rad = road.pitch_rad.abs();
        is_lane
            && pitch_rad <= 3.0 * self.settings.pitch_deviation_rad
            && road.heading_rad.abs() <= HEADING_RAD
    }

    /// Lines of the road with enough marks, in the ego frame.
    pub(super) fn lanes(&mut self, fitted: &Fitted, marks: &[Mark]) -> Lanes {
        let seen = self.seen(&fitted.road, marks);
        let [left, right] = [0, 1].map(|k| self.line(fitted, k, seen[k]?.range_m));
        let pitch_rad = if left.is_some() || right.is_some() { fitted.road.pitch_rad } else { 0.0 };
        Lanes { left, right, pitch_rad }
    }

    /// Number of marks on each line of the road in excess of those expected by chance; zero without a line.
    pub(super) fn evidence(&mut self, road: &Road, marks: &[Mark]) -> [f64; 2] {
        self.seen(road, marks).map(|seen| seen.map_or(0.0, |seen| seen.marks - seen.by_chance))
    }

    /// Lines of the road with enough marks.
    fn seen(&mut self, road: &Road, marks: &[Mark]) -> [Option<Seen>; 2] {
        let seen = road.offsets_m.map(|offset| self.seen_line(road, offset?, marks));
        let is_alone = seen.iter().flatten().count() == 1;
        seen.map(|seen| seen.filter(|seen| !is_alone || seen.marks >= DENSER[1] * seen.by_chance))
    }

    fn line(&self, fitted: &Fitted, line: usize, seen_m: [f64; 2]) -> Option<LaneLine> {
        let road = &fitted.road;
        let offset_m = road.offsets_m[line]?;
        // From the camera's position to the ego's origin.
        let [ahead_m, aside_m, _] = self.camera_m;
        let (heading, bend) = (road.heading_rad, 0.5 * road.curvature_1pm);
        let coefficients = [
            aside_m + offset_m - ahead_m * heading + ahead_m * ahead_m * bend,
            heading - 2.0 * ahead_m * bend,
            bend,
        ];
        let moved = Matrix3::new(1.0, -ahead_m, ahead_m * ahead_m, 0.0, 1.0, -2.0 * ahead_m, 0.0, 0.0, 1.0);
        let mut pick = SMatrix::<f64, 3, 5>::zeros();
        (pick[(0, 3 + line)], pick[(1, 1)], pick[(2, 2)]) = (1.0, 1.0, 0.5);
        let of_these = moved * pick;
        let covariance = of_these * fitted.covariance * of_these.transpose();
        Some(LaneLine {
            coefficients,
            covariance: [0, 1, 2].map(|i| [0, 1, 2].map(|j| 0.5 * (covariance[(i, j)] + covariance[(j, i)]))),
            seen_m: seen_m.map(|x_m| x_m + ahead_m),
        })
    }

    /// Marks of a line; `None` if they do not form one.
    fn seen_line(&mut self, road: &Road, offset_m: f64, marks: &[Mark]) -> Option<Seen> {
        let turn: [f64; 2] = math::sin_cos(road.pitch_rad).into();
        let mut beside = 0;
        self.on_line.clear();
        for mark in marks {
            let Some([x, y]) = mark.on_road(self.camera_m[2], turn) else { continue };
            let off_m = (y - x * (road.heading_rad + 0.5 * road.curvature_1pm * x) - offset_m).abs();
            if x < self.settings.reach_m && off_m < GATE_M[1] {
                self.on_line.push(x);
            } else if x < self.settings.reach_m && (BESIDE_M[0]..BESIDE_M[1]).contains(&off_m) {
                beside += 1;
            }
        }
        self.on_line.sort_unstable_by(f64::total_cmp);
        // Isolated marks in front are on the ego's own bonnet.
        let nose = self.on_line.windows(TOGETHER).position(|few| few[TOGETHER - 1] - few[0] < TOGETHER_M)?;
        self.on_line.drain(..nose);
        let first = *self.on_line.first()?;
        let whole = self.on_line.windows(2).take_while(|pair| pair[1] - pair[0] < GAP_M).count() + 1;
        let last = self.on_line[whole - 1];
        let by_chance = f64::from(beside) * GATE_M[1] / (BESIDE_M[1] - BESIDE_M[0]);
        let is_line = whole >= MARKS && last - first >= LENGTH_M && whole as f64 >= DENSER[0] * by_chance;
        is_line.then_some(Seen { range_m: [first, last], marks: whole as f64, by_chance })
    }
}
