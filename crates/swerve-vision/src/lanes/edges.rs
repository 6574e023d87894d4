//! Canny edges (PAMI 1986), and the two straight lines of a lane that contain most of them (Hough).
//!
//! An edge is shifted towards its bright side by half the width of a mark, so that both edges of a mark coincide at its
//! centre and vote for one line.

use swerve_geom::math;

use super::fit::Road;
use super::level::LevelView;
use super::line::Mark;
use super::settings::{Band, LaneSettings};
use crate::Plane;

/// Hysteresis thresholds of the gradient, Sobel sums (grey levels over 8 pixels): an edge reaches the higher one
/// somewhere along it and the lower one everywhere.
///
/// The higher threshold is raised on rough roads until at most this share of pixels exceeds it.
const GRADIENT: [i32; 2] = [40, 90];
const STEEP_SHARE: f64 = 0.03;
/// Smallest lateral share of an edge's gradient; lane lines run away from the camera.
const ACROSS_MIN: f64 = 0.25;
/// Number of line directions in the level view, symmetric about the vertical, and their step, radians.
const ANGLES: usize = 141;
const ANGLE_RAD: f64 = 0.0175;
/// Largest distance of a line from the point where the horizon crosses the centre column, to each side, and step;
/// slopes.
const DISTANCE_MAX: f64 = 0.5;
const DISTANCE: f64 = 0.004;
const DISTANCES: usize = (2.0 * DISTANCE_MAX / DISTANCE) as usize;
/// Fewest votes of a line, and most lines compared in pairs.
const VOTES_MIN: u32 = 20;
const LINES_MAX: usize = 24;
/// Relative penalty of a pair at a pitch of three standard deviations.
const PITCH_LOSS: f64 = 0.6;
/// Largest heading of a lane relative to the ego, radians.
const HEADING_MAX_RAD: f64 = 0.2;
/// Distance ahead at which a straight line is tangent to the curve it approximates, metres.
const TOUCH_M: f64 = 8.0;
/// Curvatures tried on each side, and their step, 1/m.
const CURVATURES: i32 = 2;
const CURVATURE_1PM: f64 = 0.003;
/// Number of line pairs refined.
const PAIRS: usize = 3;

/// Edge and line detector with its buffers.
#[derive(Clone, Debug)]
pub(super) struct Edges {
    settings: LaneSettings,
    smooth: Plane<i16>,
    /// Sobel sums to the right and downwards, and their Euclidean norm.
    gradients: Vec<[i32; 3]>,
    /// 1 for an edge above the lower threshold, 2 for an accepted edge.
    kinds: Vec<u8>,
    open: Vec<usize>,
    votes: Vec<u32>,
    lines: Vec<Line>,
    turns: Vec<[f64; 2]>,
}

/// Straight line in the level view: `left = slope * down + start`.
#[derive(Clone, Copy, Debug)]
struct Line {
    votes: u32,
    slope: f64,
    start: f64,
}

impl Edges {
    pub(super) fn new(settings: LaneSettings) -> Self {
        let middle = (ANGLES / 2) as f64;
        Self {
            settings,
            smooth: Plane::default(),
            gradients: Vec::new(),
            kinds: Vec::new(),
            open: Vec::new(),
            votes: Vec::new(),
            lines: Vec::new(),
            turns: (0..ANGLES).map(|k| math::sin_cos((k as f64 - middle) * ANGLE_RAD).into()).collect(),
        }
    }

    /// Detects the edges of the view.
    pub(super) fn detect(&mut self, view: &LevelView) {
        let (width, height) = (view.pixels().width(), view.pixels().height());
        self.kinds.clear();
        if width < 5 || height < 5 {
            return;
        }
        self.smoothed(view.pixels());
        self.gradients();
        let steep = self.steep();
        self.thin(view, steep);
        self.follow(width);
    }

    /// Mark centres of the detected edges, for a camera pitched down by `pitch_rad` relative to its mounting.
    pub(super) fn marks(&self, view: &LevelView, pitch_rad: f64, mark_m: f64, into: &mut Vec<Mark>) {
        into.clear();
        let width = view.pixels().width().max(1);
        for (row, kinds) in self.kinds.chunks_exact(width).enumerate() {
            let half_px = 0.5 * view.mark_px(row, pitch_rad, mark_m);
            let kept = kinds.iter().enumerate().filter(|(_, kind)| **kind == 2);
            for (column, gradient) in kept.map(|(column, _)| (column, self.gradients[row * width + column])) {
                let [across, _, size] = gradient.map(f64::from);
                if across.abs() > ACROSS_MIN * size {
                    let left = view.left(column as f64 + half_px * across.signum());
                    into.push(Mark { left, down: view.down(row as f64), contrast: size / 4.0 });
                }
            }
        }
    }

    /// Smooths with 1 4 6 4 1 along rows and columns; two columns at each border are zero, and two rows at each border
    /// are smoothed along the row only.
    fn smoothed(&mut self, pixels: &Plane<i16>) {
        let (width, height) = (pixels.width(), pixels.height());
        self.smooth.reset(width, height);
        let weigh = |v: [i16; 5]| {
            let [a, b, c, d, e] = v.map(i32::from);
            ((a + e + 4 * (b + d) + 6 * c) >> 4) as i16
        };
        for y in 0..height {
            let (from, into) = (pixels.row(y), self.smooth.row_mut(y));
            for x in 2..width - 2 {
                into[x] = weigh([from[x - 2], from[x - 1], from[x], from[x + 1], from[x + 2]]);
            }
        }
        // In-place vertical pass: `above` keeps the two unsmoothed rows above.
        let smooth = self.smooth.pixels_mut();
        for x in 0..width {
            let mut above = [smooth[x], smooth[width + x]];
            for y in 2..height - 2 {
                let at = |y: usize| smooth[y * width + x];
                let here = at(y);
                let value = weigh([above[0], above[1], here, at(y + 1), at(y + 2)]);
                smooth[y * width + x] = value;
                above = [above[1], here];
            }
        }
    }

    fn gradients(&mut self) {
        let (width, height) = (self.smooth.width(), self.smooth.height());
        self.gradients.clear();
        self.gradients.resize(width * height, [0; 3]);
        for y in 1..height - 1 {
            let [above, here, below] = [y - 1, y, y + 1].map(|row| self.smooth.row(row));
            for x in 1..width - 1 {
                let p = |row: &[i16], x: usize| i32::from(row[x]);
                let column = |x: usize| p(above, x) + 2 * p(here, x) + p(below, x);
                let line = |row: &[i16]| p(row, x - 1) + 2 * p(row, x) + p(row, x + 1);
                let [across, down] = [column(x + 1) - column(x - 1), line(below) - line(above)];
                let size = f64::from(across * across + down * down).sqrt() as i32;
                self.gradients[y * width + x] = [across, down, size];
            }
        }
    }

    /// Higher hysteresis threshold.
    fn steep(&self) -> i32 {
        let mut counts = [0_usize; 2048];
        self.gradients.iter().for_each(|[.., size]| counts[(*size as usize).min(2047)] += 1);
        let most = (STEEP_SHARE * self.gradients.len() as f64) as usize;
        let mut above = 0;
        let reached = (0..counts.len()).rev().find(|size| {
            above += counts[*size];
            above > most
        });
        reached.map_or(GRADIENT[1], |size| GRADIENT[1].max(size as i32))
    }

    /// Keeps local maxima across the edge (non-maximum suppression), within the camera's field of view.
    fn thin(&mut self, view: &LevelView, steep: i32) {
        let (width, height) = (self.smooth.width(), self.smooth.height());
        self.kinds.clear();
        self.kinds.resize(width * height, 0);
        self.open.clear();
        for y in 3..height - 3 {
            let seen = [y - 3, y, y + 3].map(|row| view.seen(row));
            let first = seen.iter().map(|s| s[0]).max().unwrap_or(0) + 4;
            let end = seen.iter().map(|s| s[1]).min().unwrap_or(0).saturating_sub(4);
            for x in first..end {
                let at = y * width + x;
                let [across, down, size] = self.gradients[at];
                if size < GRADIENT[0] {
                    continue;
                }
                // Neighbour in the direction of the gradient, of eight; tan 22.5 degrees is 0.414.
                let (a, d) = (across.abs() * 1000, down.abs() * 1000);
                let step = match () {
                    () if d * 1000 < a * 414 => 1,
                    () if a * 1000 < d * 414 => width,
                    () if (across > 0) == (down > 0) => width + 1,
                    () => width - 1,
                };
                if size > self.gradients[at - step][2] && size >= self.gradients[at + step][2] {
                    self.kinds[at] = 1 + u8::from(size >= steep);
                    if size >= steep {
                        self.open.push(at);
                    }
                }
            }
        }
    }

    /// Accepts weak edges connected to accepted ones.
    fn follow(&mut self, width: usize) {
        while let Some(at) = self.open.pop() {
            for around in [at - width, at, at + width].into_iter().flat_map(|row| [row - 1, row, row + 1]) {
                if self.kinds[around] == 1 {
                    self.kinds[around] = 2;
                    self.open.push(around);
                }
            }
        }
    }

    /// Candidate roads: pairs of straight lines that meet near the horizon a lane width apart, with the most votes, and
    /// the curves tangent to them.
    pub(super) fn guess(&mut self, marks: &[Mark], height_m: f64, band: Band, into: &mut Vec<Road>) {
        self.vote(marks);
        self.peaks();
        let mut best = [(0.0, None); PAIRS];
        for left in self.lines.iter().filter(|line| line.slope > 0.0) {
            for right in self.lines.iter().filter(|line| line.slope <= 0.0) {
                let Some((votes, road)) = self.between([left, right], height_m, band) else { continue };
                if votes > best[PAIRS - 1].0 {
                    best[PAIRS - 1] = (votes, Some(road));
                    best.sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
                }
            }
        }
        into.extend(best.into_iter().filter_map(|(_, road)| road).flat_map(bent));
    }

    /// Road between two lines and its votes; `None` if they do not form a lane.
    fn between(&self, [left, right]: [&Line; 2], height_m: f64, band: Band) -> Option<(f64, Road)> {
        let [narrow_m, wide_m] = self.settings.width_m;
        let width_m = (left.slope - right.slope) * height_m;
        let horizon = (right.start - left.start) / (left.slope - right.slope);
        let pitch_rad = -math::atan(horizon);
        let out = pitch_rad / (3.0 * self.settings.pitch_deviation_rad);
        let heading_rad = left.slope * horizon + left.start;
        let is_lane = narrow_m <= width_m && width_m <= wide_m;
        let votes = f64::from(left.votes + right.votes) * (1.0 - PITCH_LOSS * out * out);
        (is_lane && band.contains(pitch_rad) && heading_rad.abs() < HEADING_MAX_RAD).then(|| {
            let offsets_m = [left, right].map(|line| Some(line.slope * height_m));
            (votes, Road { pitch_rad, heading_rad, curvature_1pm: 0.0, offsets_m })
        })
    }

    /// Adds each mark's votes for all lines through it.
    fn vote(&mut self, marks: &[Mark]) {
        self.votes.clear();
        self.votes.resize(ANGLES * DISTANCES, 0);
        for mark in marks {
            for ([sin, cos], votes) in self.turns.iter().zip(self.votes.chunks_exact_mut(DISTANCES)) {
                let distance = (mark.left * cos - mark.down * sin + DISTANCE_MAX) * (1.0 / DISTANCE);
                if distance >= 0.0
                    && let Some(votes) = votes.get_mut(distance as usize)
                {
                    *votes += 1;
                }
            }
        }
    }

    /// Collects the local maxima of the votes, in falling order.
    fn peaks(&mut self) {
        self.lines.clear();
        for angle in 2..ANGLES - 2 {
            for distance in 2..DISTANCES - 2 {
                let here = self.votes[angle * DISTANCES + distance];
                let rows = (angle - 2..angle + 3).map(|k| &self.votes[k * DISTANCES + distance - 2..][..5]);
                if here < VOTES_MIN || rows.flatten().any(|other| *other > here) {
                    continue;
                }
                let [sin, cos] = self.turns[angle];
                let middle = (distance as f64 + 0.5) * DISTANCE - DISTANCE_MAX;
                self.lines.push(Line { votes: here, slope: sin / cos, start: middle / cos });
            }
        }
        let order = |a: &Line, b: &Line| b.votes.cmp(&a.votes).then(a.slope.total_cmp(&b.slope));
        self.lines.sort_unstable_by(|a, b| order(a, b).then(a.start.total_cmp(&b.start)));
        self.lines.truncate(LINES_MAX);
    }
}

/// Curved roads tangent to a straight road.
fn bent(straight: Road) -> impl Iterator<Item = Road> {
    (-CURVATURES..=CURVATURES).map(move |k| {
        let curvature_1pm = f64::from(k) * CURVATURE_1PM;
        let aside_m = 0.5 * curvature_1pm * TOUCH_M * TOUCH_M;
        Road {
            curvature_1pm,
            heading_rad: straight.heading_rad - curvature_1pm * TOUCH_M,
            offsets_m: straight.offsets_m.map(|offset| offset.map(|offset_m| offset_m + aside_m)),
            ..straight
        }
    })
}
