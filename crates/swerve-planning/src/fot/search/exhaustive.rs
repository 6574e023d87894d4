//! Exhaustive search: the reference for the search.

use super::super::candidate::{Candidate, Priced};
use super::super::lattice::Lattice;
use super::super::motion::Hints;
use super::entry::Entry;
use super::{Search, Task};

impl Search {
    /// Evaluates every candidate: the reference that the search is tested against.
    pub fn exhaustive(&mut self, task: &Task<'_>, lattice: &Lattice) -> Option<Candidate> {
        self.prepare(task, lattice, f64::INFINITY);
        self.heap.clear();
        let mut best: Option<Candidate> = None;
        for d in 0..lattice.d_m.len() as u32 {
            for lon in 0..self.lons.len() as u32 {
                if self.lons[lon as usize].count < 2 {
                    continue;
                }
                let entry = Entry { bound: 0.0, leaf: false, refined: false, low: d, high: d, lon };
                let cost = self.cost(task, lattice, &entry);
                let candidate = self.candidate(task, lattice, &Entry { bound: cost, ..entry });
                if best.is_none_or(|b| cost < b.cost)
                    && task.checks.hold(task.line, &candidate.motion, candidate.last_s, &mut Hints::default())
                {
                    best = Some(candidate);
                }
            }
        }
        best
    }

    /// Every candidate with its lateral and longitudinal cost.
    pub fn all(&mut self, task: &Task<'_>, lattice: &Lattice) -> Vec<Priced> {
        self.prepare(task, lattice, f64::INFINITY);
        let mut all = Vec::new();
        for low in 0..lattice.d_m.len() as u32 {
            for lon in 0..self.lons.len() as u32 {
                if self.lons[lon as usize].count >= 2 {
                    let entry = Entry { bound: 0.0, leaf: true, refined: false, low, high: low, lon };
                    let bound = self.cost(task, lattice, &entry);
                    let row = self.row(lattice, entry.lon as usize) * lattice.d_m.len();
                    let lateral = self.lateral_cost[row + low as usize];
                    let candidate = self.candidate(task, lattice, &Entry { bound, ..entry });
                    all.push(Priced { candidate, lateral, longitudinal: self.lons[lon as usize].cost });
                }
            }
        }
        all
    }
}
