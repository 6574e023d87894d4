//! End states and sample instants.

use super::params::Params;
use super::poly::Quintic;

/// Slack when counting the end of a range, so that rounding does not drop its last value.
const SLACK: f64 = 1e-9;

/// All combinations of end offset, end time and end speed, with the sample instants of the cost sums.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Lattice {
    /// End offsets, metres, increasing.
    pub d_m: Vec<f64>,
    /// End times, seconds, increasing.
    pub t_s: Vec<f64>,
    /// End speeds, m/s, increasing.
    pub v_mps: Vec<f64>,
    /// Sample instants, seconds from the start, up to the latest end.
    pub samples_s: Vec<f64>,
    /// Number of samples of each end time.
    pub counts: Vec<usize>,
    /// Target place per end time, replacing the end speeds; empty if the end speeds are used.
    pub aims: Vec<Aim>,
}

/// A target place with a speed.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Aim {
    /// Arc length, metres.
    pub s_m: f64,
    /// Speed, m/s.
    pub v_mps: f64,
}

impl Aim {
    /// Motion to the place; if the place is too near to reach the speed before it, to the speed alone.
    pub(crate) fn motion(&self, start: [f64; 3], t_s: f64) -> Quintic {
        let to_speed = Quintic::to_velocity(start, [self.v_mps, 0.0], t_s);
        if to_speed.at(t_s).x >= self.s_m {
            return to_speed;
        }
        Quintic::new(start, [self.s_m, self.v_mps, 0.0], t_s)
    }
}

impl Lattice {
    /// Fills the lattice. Values are summed up step by step, as in the original, so that the number of samples for an
    /// end time (and with it the cost) is the same.
    pub fn set(&mut self, p: &Params, target_mps: f64) {
        self.aims.clear();
        fill(&mut self.d_m, -p.right_m, p.left_m + SLACK, p.lateral_step_m);
        fill(&mut self.t_s, p.horizon_min_s, p.horizon_max_s + SLACK, p.time_step_s);
        let spread_mps = p.speed_step_mps * f64::from(p.speed_steps);
        fill(&mut self.v_mps, target_mps - spread_mps, target_mps + spread_mps + SLACK, p.speed_step_mps);
        fill(&mut self.samples_s, 0.0, self.t_s[self.t_s.len() - 1], p.time_step_s);
        self.counts.clear();
        for &t in &self.t_s {
            self.counts.push(self.samples_s.partition_point(|&s| s <= t));
        }
    }

    /// Drops negative end speeds, but keeps at least the last one.
    pub fn drop_reverse(&mut self) {
        let negative = self.v_mps.partition_point(|&v| v < 0.0);
        self.v_mps.drain(..negative.min(self.v_mps.len() - 1));
    }

    /// Number of end speeds, or one target place, per end time.
    pub fn speeds(&self) -> usize {
        if self.aims.is_empty() { self.v_mps.len() } else { 1 }
    }

    /// As `of`, with all samples from the first on as end times and a target place for each instead of end speeds;
    /// times without one are omitted. The offset `now_m` is added to the end offsets: at standstill no other is
    /// possible.
    pub fn set_aims(&mut self, of: &Self, now_m: f64, aim: impl Fn(f64) -> Option<Aim>) {
        self.clone_from(of);
        self.d_m.insert(self.d_m.partition_point(|&d| d < now_m), now_m);
        self.t_s.clear();
        self.counts.clear();
        self.aims.clear();
        for (k, &t_s) in of.samples_s.iter().enumerate().skip(1) {
            if let Some(aim) = aim(t_s) {
                self.t_s.push(t_s);
                self.counts.push(k + 1);
                self.aims.push(aim);
            }
        }
    }

    /// A sparse subset of `of` that spans it: few offsets (including the one nearest to the line), few end times, the
    /// middle speed.
    pub fn set_coarse(&mut self, of: &Self) {
        let middle =
            (0..of.d_m.len()).min_by(|&a, &b| of.d_m[a].abs().total_cmp(&of.d_m[b].abs())).unwrap_or(0);
        let stride = of.d_m.len().div_ceil(6);
        self.d_m.clear();
        self.d_m.extend((middle % stride..of.d_m.len()).step_by(stride).map(|i| of.d_m[i]));
        self.t_s.clear();
        self.counts.clear();
        for i in (0..of.t_s.len()).step_by(of.t_s.len().div_ceil(3)) {
            self.t_s.push(of.t_s[i]);
            self.counts.push(of.counts[i]);
        }
        self.v_mps.clear();
        self.v_mps.push(of.v_mps[of.v_mps.len() / 2]);
        self.samples_s.clone_from(&of.samples_s);
        self.aims.clear();
    }

    /// As `of`, with end speeds between standstill and just below its slowest one.
    pub fn set_slower(&mut self, of: &Self, speeds: u32) {
        self.clone_from(of);
        let below_mps = of.v_mps[0];
        self.v_mps.clear();
        if below_mps > 0.0 {
            self.v_mps.extend((0..speeds).map(|k| below_mps * f64::from(k) / f64::from(speeds)));
        }
    }

    /// Keeps the offsets whose rank in the order of refinement is below `kept`; see `refinement`.
    pub fn keep_offsets(&mut self, kept: usize) {
        let n = self.d_m.len();
        let mut order: Vec<usize> = refinement(n).take(kept).collect();
        order.sort_unstable();
        self.d_m = order.into_iter().map(|i| self.d_m[i]).collect();
    }

    /// Number of candidates.
    #[cfg(test)]
    fn len(&self) -> usize {
        self.d_m.len() * self.t_s.len() * self.v_mps.len()
    }
}

/// The numbers below `n`, coarse first: every 2^k-th, then those half way between, and so on.
fn refinement(n: usize) -> impl Iterator<Item = usize> {
    let top = n.next_power_of_two().max(1);
    let levels = top.trailing_zeros();
    let first = core::iter::once(0);
    let rest = (1..=levels).flat_map(move |level| {
        let step = top >> level;
        (0..1_usize << (level - 1)).map(move |k| step * (2 * k + 1))
    });
    first.chain(rest).filter(move |&i| i < n)
}

fn fill(values: &mut Vec<f64>, from: f64, to: f64, step: f64) {
    values.clear();
    let mut x = from;
    while x <= to || values.is_empty() {
        values.push(x);
        if x + step <= x {
            break; // too large for the step to count
        }
        x += step;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lattices_of_the_paper_have_its_sizes() {
        let mut lattice = Lattice::default();
        lattice.set(&Params::fast(), 16.0);
        assert_eq!((lattice.len(), lattice.counts[0], lattice.samples_s.len()), (825, 7, 17));
        lattice.set(&Params::slow(), 16.0);
        assert_eq!(lattice.len(), 11_005);
        let mut coarse = Lattice::default();
        coarse.set_coarse(&lattice);
        assert!(coarse.len() < 40 && coarse.d_m.iter().any(|d| d.abs() < 1e-9), "{coarse:?}");
    }

    #[test]
    fn absurd_targets_give_small_lattices() {
        for target in [f64::INFINITY, f64::NAN, 1e300, -1e300] {
            let mut lattice = Lattice::default();
            lattice.set(&Params::default(), target);
            assert!(!lattice.v_mps.is_empty() && lattice.v_mps.len() < 10, "{target}");
        }
    }

    #[test]
    fn refinement_visits_everything_once_and_spreads() {
        for n in 1..40 {
            let mut seen: Vec<usize> = refinement(n).collect();
            assert_eq!(seen.len(), n);
            seen.sort_unstable();
            assert_eq!(seen, (0..n).collect::<Vec<_>>());
        }
        assert_eq!(refinement(15).take(4).collect::<Vec<_>>(), [0, 8, 4, 12]);
    }
}
