//! Initial guesses of the road: pitch, heading and curvature for which the marks align.
//!
//! For the right values all marks of a line have the same lateral offset, so the histogram of offsets has a few sharp
//! peaks; for others it is flat. The score sums the excess of each bin over its surroundings to the power of 1.5; with
//! squares, one long line would outvote all broken ones.

use swerve_geom::math;

use super::fit::Road;
use super::line::Mark;
use super::settings::{Band, LaneSettings};

/// Pitch steps on each side of the middle of a band.
const PITCHES: i32 = 3;
/// Heading steps on each side, and their size, radians.
const HEADINGS: i32 = 8;
const HEADING_RAD: f64 = 0.0175;
/// Curvature steps on each side, and their size, 1/m.
const CURVATURES: i32 = 4;
const CURVATURE_1PM: f64 = 0.0025;
/// Number of refinements; each halves the step.
const HALVINGS: u32 = 4;
/// Largest offset in the histogram, to each side, and bin width, metres.
const OFFSET_MAX_M: f64 = 6.0;
const BIN_M: f64 = 0.2;
const BINS: usize = (2.0 * OFFSET_MAX_M / BIN_M) as usize;
/// Relative penalty at the end of the range of pitch, heading and curvature, each.
const LOSS: f64 = 0.4;
/// Smallest share of a line's votes relative to the other line's, and fewest votes.
const SHARE_MIN: f64 = 0.1;
const VOTES_MIN: f64 = 2.0;
/// Number of marks above which they are subsampled; more do not improve the search.
const MARKS_MAX: usize = 1500;

/// Search with its buffers.
#[derive(Clone, Debug)]
pub(super) struct Offsets {
    settings: LaneSettings,
    band: Band,
    /// Metres ahead, metres to the left, and weight of each mark for one pitch.
    places: Vec<[f64; 3]>,
    /// Lateral offsets of the marks with one curvature removed.
    straight: Vec<f64>,
    histogram: [f64; BINS],
}

/// Offset from the centre of the search, in the smallest steps.
type Steps = [i32; 3];

impl Offsets {
    pub(super) fn new(settings: LaneSettings) -> Self {
        Self {
            settings,
            band: Band::default(),
            places: Vec::new(),
            straight: Vec::new(),
            histogram: [0.0; BINS],
        }
    }

    /// Roads for which the marks align best at the pitches of a band: one per curvature.
    pub(super) fn guess(&mut self, marks: &[Mark], height_m: f64, band: Band, into: &mut Vec<Road>) {
        self.band = band;
        let whole = 1 << HALVINGS;
        let mut best = [(f64::NEG_INFINITY, [0; 3]); (2 * CURVATURES + 1) as usize];
        for pitch in (-PITCHES..=PITCHES).map(|k| k * whole) {
            self.places(marks, height_m, self.pitch_rad(pitch));
            for (best, curvature) in best.iter_mut().zip((-CURVATURES..=CURVATURES).map(|k| k * whole)) {
                self.straighten(curvature);
                for heading in (-HEADINGS..=HEADINGS).map(|k| k * whole) {
                    *best =
                        better(*best, (self.score([pitch, heading, curvature]), [pitch, heading, curvature]));
                }
            }
        }
        let highest = best.into_iter().reduce(better).unwrap_or_default();
        let finest = self.refine(highest, marks, height_m);
        for steps in [finest].into_iter().chain(best.map(|(_, steps)| steps)) {
            let [pitch, heading, curvature] = steps;
            self.places(marks, height_m, self.pitch_rad(pitch));
            self.straighten(curvature);
            self.score(steps);
            let offsets_m = self.lines();
            if offsets_m.iter().any(Option::is_some) {
                let [heading_rad, curvature_1pm] = [angle(heading), bend(curvature)];
                into.push(Road { pitch_rad: self.pitch_rad(pitch), heading_rad, curvature_1pm, offsets_m });
            }
        }
    }

    /// Best neighbour, searched with successively halved steps.
    fn refine(&mut self, mut best: (f64, Steps), marks: &[Mark], height_m: f64) -> Steps {
        for halving in 1..=HALVINGS {
            let (step, around) = ((1 << HALVINGS) >> halving, best.1);
            for pitch in [0, -step, step].map(|d| around[0] + d) {
                self.places(marks, height_m, self.pitch_rad(pitch));
                for curvature in [0, -step, step].map(|d| around[2] + d) {
                    self.straighten(curvature);
                    for heading in [0, -step, step].map(|d| around[1] + d) {
                        best = better(
                            best,
                            (self.score([pitch, heading, curvature]), [pitch, heading, curvature]),
                        );
                    }
                }
            }
        }
        best.1
    }

    fn pitch_rad(&self, steps: i32) -> f64 {
        self.band.middle_rad + self.band.half_rad * f64::from(steps) / f64::from(PITCHES << HALVINGS)
    }

    /// Projects the marks onto the road.
    fn places(&mut self, marks: &[Mark], height_m: f64, pitch_rad: f64) {
        let turn: [f64; 2] = math::sin_cos(pitch_rad).into();
        let reach_m = self.settings.reach_m;
        self.places.clear();
        for mark in marks.iter().step_by(1 + marks.len() / MARKS_MAX) {
            let Some([ahead_m, left_m]) = mark.on_road(height_m, turn) else { continue };
            if ahead_m < reach_m {
                self.places.push([ahead_m, left_m, mark.weight()]);
            }
        }
    }

    fn straighten(&mut self, curvature: i32) {
        let half_1pm = 0.5 * bend(curvature);
        self.straight.clear();
        self.straight.extend(self.places.iter().map(|[ahead, left, _]| left - half_1pm * ahead * ahead));
    }

    /// Score of the peaks of the offset histogram.
    fn score(&mut self, [pitch, heading, curvature]: Steps) -> f64 {
        let heading_rad = angle(heading);
        self.histogram = [0.0; BINS];
        for ([ahead_m, _, weight], straight_m) in self.places.iter().zip(&self.straight) {
            let bin = (straight_m - heading_rad * ahead_m + OFFSET_MAX_M) * (1.0 / BIN_M);
            if bin >= 0.0
                && let Some(count) = self.histogram.get_mut(bin as usize)
            {
                *count += weight;
            }
        }
        // Subtracts the surroundings: grass and cars are dense everywhere, and a camera pitched down further makes
        // everything denser.
        let over =
            |near: &[f64]| (near[2] + near[3] - 0.5 * (near[0] + near[1] + near[4] + near[5])).max(0.0);
        let peaks: f64 = self.histogram.windows(6).map(over).map(|over| over * over.sqrt()).sum();
        let [heading, curvature] = [(heading, HEADINGS), (curvature, CURVATURES)]
            .map(|(steps, most)| f64::from(steps) / f64::from(most << HALVINGS));
        let out = [self.pitch_rad(pitch) / (3.0 * self.settings.pitch_deviation_rad), heading, curvature];
        peaks * (1.0 - LOSS * out.iter().map(|out| out * out).sum::<f64>()).max(0.0)
    }

    /// Pair of peaks a lane width apart, one on each side, with the most votes; else the strongest single peak.
    fn lines(&self) -> [Option<f64>; 2] {
        let votes = |bin: usize| self.histogram[bin - 1] + self.histogram[bin];
        let is_peak = |bin: &usize| {
            let here = votes(*bin);
            let lower = |other: usize| votes(other) <= here;
            here >= VOTES_MIN && (*bin < 2 || lower(bin - 1)) && (*bin + 1 >= BINS || lower(bin + 1))
        };
        // Boundary between a bin and the one before it.
        let offset_m = |bin: usize| bin as f64 * BIN_M - OFFSET_MAX_M;
        let peaks = || (1..BINS).filter(is_peak);
        let [narrow_m, wide_m] = self.settings.width_m;
        let mut best = (0.0, [None, None]);
        for left in peaks().filter(|bin| offset_m(*bin) > 0.0) {
            for right in peaks().filter(|bin| offset_m(*bin) <= 0.0) {
                let width_m = offset_m(left) - offset_m(right);
                let (least, most) = (votes(left).min(votes(right)), votes(left).max(votes(right)));
                let is_lane = narrow_m <= width_m && width_m <= wide_m && least >= SHARE_MIN * most;
                if is_lane && least + most > best.0 {
                    best = (least + most, [Some(offset_m(left)), Some(offset_m(right))]);
                }
            }
        }
        if best.0 == 0.0
            && let Some(alone) =
                peaks().filter(|bin| offset_m(*bin).abs() < wide_m).max_by_key(|bin| votes(*bin) as u64)
        {
            let offset_m = offset_m(alone);
            best.1[usize::from(offset_m <= 0.0)] = Some(offset_m);
        }
        best.1
    }
}

fn angle(steps: i32) -> f64 {
    f64::from(steps) * HEADING_RAD / f64::from(1 << HALVINGS)
}

fn bend(steps: i32) -> f64 {
    f64::from(steps) * CURVATURE_1PM / f64::from(1 << HALVINGS)
}

fn better(best: (f64, Steps), other: (f64, Steps)) -> (f64, Steps) {
    if other.0 > best.0 { other } else { best }
}
