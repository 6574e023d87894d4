//! Finds the cheapest valid candidate while evaluating only a few of them.
//!
//! The cost of a candidate has a lateral part of (end offset, end time), a longitudinal part of (end speed, end time),
//! both sums over time samples as in the original, and nearness to obstacles, which couples them. The first two are
//! tables (lateral motion is linear in the end offset, so each sample's contribution is computed for all offsets at
//! once). Nearness is bounded from below for whole ranges of offsets: at a sample, all motions of a range lie on a
//! segment across the line, and no point of a segment is further from a given point than the further of its two ends.
//! Ranges are taken from a heap by their bound and halved until single candidates come out in the order of their exact
//! cost; the first that satisfies all limits is the result, identical to that of an exhaustive search.
//!
//! If many candidates fail, they mostly fail at the same place, before a wall: that place is checked before a cost is
//! computed.

mod entry;
mod exhaustive;

use std::collections::BinaryHeap;

use entry::{Arena, Entry, Lon, NONE};
use swerve_geom::simd::widest;

use super::candidate::{Candidate, Judge, Outcome, TaskChecks};
use super::lateral::FrenetState;
use super::lattice::Lattice;
use super::motion::{Motion, OVERSPEED};
use super::nearness::{Beside, Corners, Points, sum_nearness};
use super::params::Params;
use super::poly::Quintic;
use crate::request::{Budget, Progress};

pub use super::task::Task;

/// Ranges of at most this many offsets are evaluated one by one.
const LEAVES: u32 = 3;

/// Bounds are lowered by this factor, so that rounding never raises a bound above the exact cost.
const BOUND_SLACK: f64 = 1e-9;

/// After this many failures all candidates are checked for failing at the same place.
const FAILURES: u32 = 32;

/// The search, with storage that is reused between calls.
#[derive(Clone, Debug, Default)]
pub struct Search {
    /// Lateral cost by row of lateral motions and end offset.
    lateral_cost: Vec<f64>,
    /// By row and sample: offset of the motion to end offset 0, and its derivative by the end offset.
    base_m: Vec<f64>,
    basis: Vec<f64>,
    /// True if lateral motions have a row for each pair of end time and speed; false if for each end time.
    rows_of_pairs: bool,
    /// Longitudinal motions by end time and end speed.
    lons: Vec<Lon>,
    /// Smallest lateral cost by row.
    least_lateral: Vec<f64>,
    arena: Arena,
    corners: Corners,
    heap: BinaryHeap<Entry>,
    /// Entries above the cost at which the search is expected to end.
    later: Vec<Entry>,
    /// Motions at the two ends of a range.
    ends: [Points; 2],
    /// By pair and end offset: number of earlier candidates that may be valid; empty until that is known.
    alive_before: Vec<u32>,
}

impl Search {
    /// The cheapest valid candidate of `lattice`, identical to the result of [`exhaustive`](Self::exhaustive).
    ///
    /// With a budget, each candidate whose total cost is computed counts as one unit.
    pub fn run(
        &mut self,
        task: &Task<'_>,
        lattice: &Lattice,
        budget: Option<&mut dyn Budget>,
        spent: &mut u64,
    ) -> Outcome {
        self.best_first(task, lattice, (budget, spent), f64::INFINITY, &mut TaskChecks::new(task))
    }

    /// As [`run`](Self::run), given the cost of a candidate known to be valid: more expensive ones are deferred.
    pub(super) fn run_below(
        &mut self,
        task: &Task<'_>,
        lattice: &Lattice,
        known_cost: f64,
        budget: &mut dyn Budget,
        spent: &mut u64,
    ) -> Outcome {
        self.best_first(task, lattice, (Some(budget), spent), known_cost, &mut TaskChecks::new(task))
    }

    /// The cheapest candidate that passes `judge` instead of the task's checks.
    pub fn run_where(
        &mut self,
        task: &Task<'_>,
        lattice: &Lattice,
        judge: &mut impl Judge,
    ) -> Option<Candidate> {
        self.best_first(task, lattice, (None, &mut 0), f64::INFINITY, judge).found()
    }

    fn best_first(
        &mut self,
        task: &Task<'_>,
        lattice: &Lattice,
        (mut budget, spent): (Option<&mut dyn Budget>, &mut u64),
        mut known_cost: f64,
        judge: &mut impl Judge,
    ) -> Outcome {
        self.prepare(task, lattice, known_cost);
        let mut failures = 0;
        loop {
            let Some(entry) = self.heap.pop() else {
                if self.later.is_empty() {
                    return Outcome::Nothing;
                }
                known_cost = f64::INFINITY;
                self.take_up_later(task, lattice);
                continue;
            };
            if entry.leaf {
                let candidate = self.candidate(task, lattice, &entry);
                if judge.holds(&candidate) {
                    return Outcome::Found(candidate);
                }
                failures += 1;
                if failures == FAILURES && budget.is_none() {
                    self.look_at_all(task, lattice, judge);
                }
                continue;
            }
            if !self.may_hold(lattice, &entry) {
                continue;
            }
            let width = entry.high - entry.low + 1;
            if !entry.refined && width > LEAVES {
                match self.bound(task, lattice, &entry, known_cost) {
                    Some(bound) => self.heap.push(Entry { bound, refined: true, ..entry }),
                    None => self.later.push(entry),
                }
            } else if width > LEAVES {
                self.halve(task, lattice, &entry, known_cost);
            } else {
                if let Some(budget) = budget.as_deref_mut() {
                    *spent += u64::from(width);
                    if budget.spend(u64::from(width)) == Progress::Stop {
                        return Outcome::Stopped;
                    }
                }
                self.evaluate(task, lattice, &entry, known_cost, judge);
            }
        }
    }

    /// Moves the deferred entries to the heap.
    fn take_up_later(&mut self, task: &Task<'_>, lattice: &Lattice) {
        let mut later = core::mem::take(&mut self.later);
        for entry in later.drain(..) {
            let bound = if entry.leaf { self.cost(task, lattice, &entry) } else { entry.bound };
            self.heap.push(Entry { bound, ..entry });
        }
        self.later = later;
    }

    /// Fills the tables and pushes one range for each valid pair onto the heap.
    fn prepare(&mut self, task: &Task<'_>, lattice: &Lattice, known_cost: f64) {
        self.corners.set(task.checks.obstacles, task.checks.at, task.params.clearance_m, &lattice.samples_s);
        self.longitudinal(task, lattice);
        self.lateral(task, lattice);
        self.alive_before.clear();
        self.later.clear();
        let mut entries = core::mem::take(&mut self.heap).into_vec();
        entries.clear();
        let high = lattice.d_m.len() as u32 - 1;
        for (index, lon) in self.lons.iter().enumerate() {
            if lon.count < 2 {
                continue;
            }
            let lateral = self.least_lateral[self.row(lattice, index)];
            let bound = smooth(task.params, lateral, lon.cost) * (1.0 - BOUND_SLACK);
            let entry = Entry { bound, leaf: false, refined: false, low: 0, high, lon: index as u32 };
            if bound > known_cost { self.later.push(entry) } else { entries.push(entry) }
        }
        self.heap = entries.into();
    }

    /// Computes the lateral cost of all rows and offsets (sums of absolute values over the samples).
    fn lateral(&mut self, task: &Task<'_>, lattice: &Lattice) {
        let (n, offsets, p) = (lattice.samples_s.len(), lattice.d_m.len(), task.params);
        self.rows_of_pairs = task.start.d_by_s.is_some();
        let rows = if self.rows_of_pairs { self.lons.len() } else { lattice.t_s.len() };
        for (table, size) in [
            (&mut self.lateral_cost, rows * offsets),
            (&mut self.base_m, rows * n),
            (&mut self.basis, rows * n),
        ] {
            table.clear();
            table.resize(size, 0.0);
        }
        self.least_lateral.clear();
        // Lateral motion is linear in the end offset, also as a function of arc length.
        let from_line =
            FrenetState { s: task.start.s, d: [0.0; 3], d_by_s: task.start.d_by_s.map(|_| [0.0; 3]) };
        for i in 0..rows {
            let time = if self.rows_of_pairs { i / lattice.speeds() } else { i };
            let along = if self.rows_of_pairs { self.lons[i].motion } else { Quintic::default() };
            let base = task.start.lateral(&along, 0.0, lattice.t_s[time]);
            let unit = from_line.lateral(&along, 1.0, lattice.t_s[time]);
            let costs = &mut self.lateral_cost[i * offsets..(i + 1) * offsets];
            let (base_m, basis) = (&mut self.base_m[i * n..], &mut self.basis[i * n..]);
            widest(
                #[inline(always)]
                || {
                    for (k, &sample_s) in lattice.samples_s[..lattice.counts[time]].iter().enumerate() {
                        let s = along.at(sample_s);
                        let (b, u) = (base.at(sample_s, &s), unit.at(sample_s, &s));
                        (base_m[k], basis[k]) = (b.x, u.x);
                        for (cost, d) in costs.iter_mut().zip(&lattice.d_m) {
                            *cost += p.weight_offset * (b.x + u.x * d).abs()
                                + p.weight_lateral_speed * (b.v + u.v * d).abs()
                                + p.weight_accel * (b.a + u.a * d).abs()
                                + p.weight_jerk * (b.j + u.j * d).abs();
                        }
                    }
                },
            );
            self.least_lateral.push(least(costs));
        }
    }

    /// Computes longitudinal motion, cost and limits of all pairs.
    fn longitudinal(&mut self, task: &Task<'_>, lattice: &Lattice) {
        self.lons.clear();
        self.arena.x.clear();
        self.arena.y.clear();
        self.arena.normal_x.clear();
        self.arena.normal_y.clear();
        for (time, &t_s) in lattice.t_s.iter().enumerate() {
            if let Some(aim) = lattice.aims.get(time) {
                let motion = aim.motion(task.start.s, t_s);
                let off_m = aim.s_m - motion.at(t_s).x;
                let lon = Lon { motion, v_mps: aim.v_mps, ..Lon::default() };
                self.push_lon(task, lattice, time, lon, |_| off_m);
                continue;
            }
            for &v_mps in &lattice.v_mps {
                let motion = Quintic::to_velocity(task.start.s, [v_mps, 0.0], t_s);
                let lon = Lon { motion, v_mps, ..Lon::default() };
                self.push_lon(task, lattice, time, lon, |last_mps| task.target_mps - last_mps);
            }
        }
    }

    /// Adds a pair with its cost; `off` returns the deviation from its target, given the speed at its last sample.
    fn push_lon(
        &mut self,
        task: &Task<'_>,
        lattice: &Lattice,
        time: usize,
        lon: Lon,
        off: impl Fn(f64) -> f64,
    ) {
        let p = task.params;
        // In driven plans, an ego that is too fast already slows down.
        let is_driven = task.checks.drivable.is_some();
        let fastest_mps = p.max_speed_mps.max(if is_driven { OVERSPEED * task.start.s[1] } else { 0.0 });
        let (mut accel, mut jerk, mut last_mps) = (0.0, 0.0, 0.0);
        let (mut count, mut valid) = (0, true);
        for (k, &sample_s) in lattice.samples_s[..lattice.counts[time]].iter().enumerate() {
            let jet = lon.motion.at(sample_s);
            accel += jet.a.abs();
            jerk += jet.j.abs();
            last_mps = jet.v;
            count += usize::from(count == k && jet.x < task.cut_m);
            let held = sample_s == 0.0 || jet.a.abs() <= p.max_accel_mps2;
            valid &= held && jet.v <= fastest_mps && jet.v >= -1e-3;
        }
        let cost = p.weight_accel * accel
            + p.weight_jerk * jerk
            + p.weight_time * lattice.t_s[time]
            + p.weight_offset * off(last_mps).abs();
        let count = if valid { count } else { 0 };
        self.lons.push(Lon { cost, count, places: NONE, ..lon });
    }

    fn time_index(&self, lattice: &Lattice, entry: &Entry) -> usize {
        entry.lon as usize / lattice.speeds()
    }

    /// Row of the lateral motions of a pair.
    fn row(&self, lattice: &Lattice, lon: usize) -> usize {
        if self.rows_of_pairs { lon } else { lon / lattice.speeds() }
    }

    /// Smallest lateral cost of the range plus the longitudinal cost: a bound without obstacles.
    fn smooth_cost(&self, task: &Task<'_>, lattice: &Lattice, entry: &Entry) -> f64 {
        let row = self.row(lattice, entry.lon as usize) * lattice.d_m.len();
        let costs = &self.lateral_cost[row + entry.low as usize..=row + entry.high as usize];
        smooth(task.params, least(costs), self.lons[entry.lon as usize].cost)
    }

    /// Exact cost of a single candidate; for a range, a lower bound of its candidates' costs.
    fn cost(&mut self, task: &Task<'_>, lattice: &Lattice, entry: &Entry) -> f64 {
        self.cost_until(task, lattice, entry, |_| false)
    }

    /// As [`cost`](Self::cost), or a partial sum once `is_enough` returns true for it.
    fn cost_until(
        &mut self,
        task: &Task<'_>,
        lattice: &Lattice,
        entry: &Entry,
        is_enough: impl Fn(f64) -> bool,
    ) -> f64 {
        let smooth = self.smooth_cost(task, lattice, entry);
        let weight = task.params.weight_obstacle;
        if weight == 0.0 || self.corners.is_empty() || is_enough(smooth) {
            return smooth;
        }
        // Sums of non-negative terms: even with rounding they never decrease.
        let until = |nearness: f64| is_enough(smooth + weight * nearness);
        smooth + weight * self.nearness(task, lattice, entry, until)
    }

    /// Lower bound of the costs in the range; `None` if all exceed `known_cost`.
    fn bound(&mut self, task: &Task<'_>, lattice: &Lattice, entry: &Entry, known_cost: f64) -> Option<f64> {
        let bound = |cost: f64| cost * (1.0 - BOUND_SLACK);
        let cost = self.cost_until(task, lattice, entry, |cost| bound(cost) > known_cost);
        let bound = bound(cost);
        if bound > known_cost { None } else { Some(bound) }
    }

    fn halve(&mut self, task: &Task<'_>, lattice: &Lattice, entry: &Entry, known_cost: f64) {
        let middle = entry.low + (entry.high - entry.low) / 2;
        for (low, high) in [(entry.low, middle), (middle + 1, entry.high)] {
            let half = Entry { low, high, ..*entry };
            // Ranges that will be evaluated one by one use their parent's bound.
            if high - low < LEAVES {
                self.heap.push(half);
                continue;
            }
            match self.bound(task, lattice, &half, known_cost) {
                Some(bound) => self.heap.push(Entry { bound, ..half }),
                None => self.later.push(Entry { refined: false, ..half }),
            }
        }
    }

    /// Records which candidates do not certainly fail.
    fn look_at_all(&mut self, task: &Task<'_>, lattice: &Lattice, judge: &mut impl Judge) {
        let mut alive = 0;
        self.alive_before.push(alive);
        for lon in 0..self.lons.len() as u32 {
            for low in 0..lattice.d_m.len() as u32 {
                let leaf = Entry { bound: 0.0, leaf: true, refined: true, low, high: low, lon };
                let is_valid = self.lons[lon as usize].count >= 2;
                alive += u32::from(is_valid && !judge.fails_too(&self.candidate(task, lattice, &leaf)));
                self.alive_before.push(alive);
            }
        }
    }

    /// Returns true if some candidate of the range does not certainly fail.
    fn may_hold(&self, lattice: &Lattice, entry: &Entry) -> bool {
        let first = entry.lon as usize * lattice.d_m.len();
        let [low, behind] =
            [entry.low as usize, entry.high as usize + 1].map(|d| self.alive_before.get(first + d));
        low.is_none() || low != behind
    }

    fn evaluate(
        &mut self,
        task: &Task<'_>,
        lattice: &Lattice,
        entry: &Entry,
        known_cost: f64,
        judge: &mut impl Judge,
    ) {
        for d in entry.low..=entry.high {
            let leaf = Entry { leaf: true, low: d, high: d, ..*entry };
            if !self.may_hold(lattice, &leaf) || judge.fails_too(&self.candidate(task, lattice, &leaf)) {
                continue;
            }
            let bound = self.cost_until(task, lattice, &leaf, |cost| cost > known_cost);
            let leaf = Entry { bound, ..leaf };
            if bound > known_cost { self.later.push(leaf) } else { self.heap.push(leaf) }
        }
    }

    fn candidate(&self, task: &Task<'_>, lattice: &Lattice, leaf: &Entry) -> Candidate {
        let time = self.time_index(lattice, leaf);
        let (t_s, d_m) = (lattice.t_s[time], lattice.d_m[leaf.low as usize]);
        let Lon { motion, v_mps, count, .. } = self.lons[leaf.lon as usize];
        Candidate {
            motion: Motion::new(&task.start, motion, d_m, t_s),
            cost: leaf.bound,
            d_m,
            v_mps,
            t_s,
            last_s: if task.cut_m.is_finite() { lattice.samples_s[count - 1] } else { t_s },
        }
    }

    /// Sum over samples and boxes of 1 / distance to the nearest corner: exact for a single candidate, a lower bound
    /// for a range; a partial sum once `is_enough` returns true for it.
    fn nearness(
        &mut self,
        task: &Task<'_>,
        lattice: &Lattice,
        entry: &Entry,
        is_enough: impl Fn(f64) -> bool,
    ) -> f64 {
        self.place(task, lattice, entry.lon as usize);
        let Lon { count: n, places, .. } = self.lons[entry.lon as usize];
        let row = self.row(lattice, entry.lon as usize) * lattice.samples_s.len();
        let beside = Beside {
            x: &self.arena.x[places..places + n],
            y: &self.arena.y[places..places + n],
            normal_x: &self.arena.normal_x[places..places + n],
            normal_y: &self.arena.normal_y[places..places + n],
            base_m: &self.base_m[row..row + n],
            basis: &self.basis[row..row + n],
        };
        let ends_m = [entry.low, entry.high].map(|d| lattice.d_m[d as usize]);
        sum_nearness(&self.corners, &beside, ends_m, &mut self.ends, is_enough)
    }

    /// Computes the line at the samples of a pair, once.
    fn place(&mut self, task: &Task<'_>, lattice: &Lattice, lon: usize) {
        if self.lons[lon].places != NONE {
            return;
        }
        self.lons[lon].places = self.arena.x.len();
        let Lon { motion, count, .. } = self.lons[lon];
        for &sample_s in &lattice.samples_s[..count] {
            let node = task.line.at(motion.at(sample_s).x);
            self.arena.x.push(node.x_m);
            self.arena.y.push(node.y_m);
            self.arena.normal_x.push(-node.sin);
            self.arena.normal_y.push(node.cos);
        }
    }
}

/// Cost without nearness to obstacles.
fn smooth(params: &Params, lateral: f64, longitudinal: f64) -> f64 {
    params.weight_lateral * lateral + params.weight_longitudinal * longitudinal
}

fn least(costs: &[f64]) -> f64 {
    costs.iter().fold(f64::INFINITY, |least, &cost| if cost < least { cost } else { least })
}
