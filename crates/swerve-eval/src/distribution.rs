//! Exact percentiles of a stream of samples.

use serde::{Deserialize, Serialize};
use swerve_core::Span;

/// Median of values, the upper one of the two middle ones; `None` without values.
pub fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// Number of samples buffered unsorted before they are merged into the sorted ones.
const RECENT: usize = 4096;

/// Time spans, stored as sorted distinct values with their counts: exact, and small where values repeat.
///
/// Percentiles are **nearest-rank**: the smallest sample that at least the given share of all samples does not exceed.
/// Every percentile is thus a value that occurred.
#[derive(Clone, Debug, Default)]
pub struct Distribution {
    sorted: Vec<(i64, u64)>,
    recent: Vec<i64>,
    count: u64,
}

/// Summary of a distribution, milliseconds.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Summary {
    /// Number of samples.
    pub count: u64,
    /// Median.
    pub p50_ms: f64,
    /// Value that nine of ten samples do not exceed.
    pub p90_ms: f64,
    /// Value that 99 of a hundred samples do not exceed.
    pub p99_ms: f64,
    /// Largest sample.
    pub max_ms: f64,
}

impl Distribution {
    /// Adds one sample.
    pub fn take(&mut self, sample: Span) {
        self.count += 1;
        self.recent.push(sample.ns());
        // Buffering as many new samples as there are sorted values keeps the amortized merging cost low.
        if self.recent.len() >= RECENT.max(self.sorted.len()) {
            self.sorted = self.merged();
            self.recent.clear();
        }
    }

    /// Number of samples so far.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The nearest-rank percentile for a `share` in 0 to 1 (0 gives the smallest sample); `None` without samples.
    pub fn percentile(&self, share: f64) -> Option<Span> {
        rank_value(&self.merged(), self.count, share)
    }

    /// Summary; `None` without samples.
    pub fn summary(&self) -> Option<Summary> {
        let merged = self.merged();
        let ms = |share| rank_value(&merged, self.count, share).map(|span| span.ns() as f64 / 1e6);
        Some(Summary {
            count: self.count,
            p50_ms: ms(0.5)?,
            p90_ms: ms(0.9)?,
            p99_ms: ms(0.99)?,
            max_ms: ms(1.0)?,
        })
    }

    fn merged(&self) -> Vec<(i64, u64)> {
        let mut all = self.sorted.clone();
        all.extend(self.recent.iter().map(|&value| (value, 1)));
        all.sort_unstable_by_key(|&(value, _)| value);
        all.dedup_by(|next, kept| {
            let same = next.0 == kept.0;
            if same {
                kept.1 += next.1;
            }
            same
        });
        all
    }
}

fn rank_value(sorted: &[(i64, u64)], count: u64, share: f64) -> Option<Span> {
    let rank = ((share * count as f64).ceil() as u64).clamp(1, count.max(1));
    let mut seen = 0;
    sorted
        .iter()
        .find(|(_, n)| {
            seen += n;
            seen >= rank
        })
        .map(|&(value, _)| Span::from_ns(value))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn distribution(values: impl IntoIterator<Item = i64>) -> Distribution {
        let mut distribution = Distribution::default();
        values.into_iter().for_each(|ms| distribution.take(Span::from_ms(ms)));
        distribution
    }

    #[test]
    fn percentiles_are_nearest_rank() {
        // The textbook example: 15, 20, 35, 40, 50.
        let d = distribution([35, 15, 50, 20, 40]);
        for (share, ms) in [(0.0, 15), (0.05, 15), (0.3, 20), (0.4, 20), (0.5, 35), (1.0, 50)] {
            assert_eq!(d.percentile(share), Some(Span::from_ms(ms)), "{share}");
        }
    }

    #[test]
    fn percentile_of_one_to_a_hundred_is_its_number() {
        let s = distribution((1..=100).rev()).summary().unwrap();
        assert_eq!((s.count, s.p50_ms, s.p90_ms, s.p99_ms, s.max_ms), (100, 50.0, 90.0, 99.0, 100.0));
    }

    #[test]
    fn merging_changes_no_percentile() {
        let values: Vec<i64> = (0..20_000).map(|k| k * 7919 % 10_007).collect();
        let d = distribution(values.iter().copied());
        let mut sorted = values;
        sorted.sort_unstable();
        for (share, index) in [(0.5, 9_999), (0.9, 17_999), (0.99, 19_799), (1.0, 19_999)] {
            assert_eq!(d.percentile(share), Some(Span::from_ms(sorted[index])), "{share}");
        }
    }

    #[test]
    fn equal_values_take_no_memory() {
        let d = distribution(std::iter::repeat_n(5, 100_000));
        assert!(d.sorted.len() == 1 && d.recent.len() < RECENT);
        assert_eq!(d.percentile(0.5), Some(Span::from_ms(5)));
    }

    #[test]
    fn empty_distribution_has_no_percentile() {
        assert_eq!(Distribution::default().percentile(0.5), None);
        assert_eq!(Distribution::default().summary(), None);
    }
}
