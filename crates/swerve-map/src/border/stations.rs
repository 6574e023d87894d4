//! Stations of a border, found by arc length.

use std::sync::Arc;

use super::Station;

/// Smallest length of a cell of the index, metres, and largest number of cells per station; above, cells grow. Bounds
/// the memory of borders that are long and have few stations.
const CELL_M: f64 = 1.0;
const PER_STATION: usize = 16;

/// Stations in order of arc length, with an index: the search is restricted to one cell. Clones share both.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Stations {
    stations: Arc<[Station]>,
    /// For each cell, and for the end of the last, the number of stations before it.
    before: Arc<[u32]>,
    /// Arc length at the start of the first cell, metres, and cells per metre.
    first_m: f64,
    per_m: f64,
}

impl Stations {
    /// Creates the index of stations in order.
    pub(super) fn new(stations: Vec<Station>) -> Self {
        let ends = stations.first().zip(stations.last());
        let (first_m, length_m) = ends.map_or((0.0, 0.0), |(first, last)| (first.s_m, last.s_m - first.s_m));
        let cells = match (length_m / CELL_M).ceil() {
            count if count.is_finite() => (count as usize).clamp(1, PER_STATION * stations.len().max(1)),
            _ => 1,
        };
        let per_m = if cells > 1 { cells as f64 / length_m } else { 0.0 };
        let mut before = Vec::with_capacity(cells + 1);
        let mut count = 0;
        for cell in 0..cells {
            while count < stations.len() && cell_of(stations[count].s_m, first_m, per_m, cells) < cell {
                count += 1;
            }
            before.push(count as u32);
        }
        before.push(stations.len() as u32);
        Self { stations: stations.into(), before: before.into(), first_m, per_m }
    }

    pub(super) fn as_slice(&self) -> &[Station] {
        &self.stations
    }

    /// Number of stations at the start for which `is_before` is true: those at arc lengths below `s_m`, and none
    /// above.
    #[inline]
    fn count(&self, s_m: f64, is_before: impl Fn(&Station) -> bool) -> usize {
        // The cell is a monotonic function of arc length, with its rounding errors too: stations of other cells are
        // on the same side of `s_m` as their cell.
        let cell = cell_of(s_m, self.first_m, self.per_m, self.before.len() - 1);
        let (begin, end) = (self.before[cell] as usize, self.before[cell + 1] as usize);
        begin + self.stations[begin..end].partition_point(is_before)
    }

    /// Distance at `s_m`, interpolated linearly between the stations, metres.
    #[inline]
    pub(super) fn at(&self, s_m: f64) -> f64 {
        let next = self.count(s_m, |x| x.s_m <= s_m);
        if next == 0 || next == self.stations.len() {
            return self.stations[next.max(1) - 1].distance_m;
        }
        let (a, b) = (self.stations[next - 1], self.stations[next]);
        a.distance_m + (b.distance_m - a.distance_m) * ((s_m - a.s_m) / (b.s_m - a.s_m))
    }

    /// The first station at or beyond `s_m`.
    pub(super) fn from(&self, s_m: f64) -> Option<&Station> {
        self.stations.get(self.count(s_m, |x| x.s_m < s_m))
    }

    /// Stations between arc lengths, ends included, metres.
    #[inline]
    pub(super) fn between(&self, [from_m, to_m]: [f64; 2]) -> &[Station] {
        let begin = self.count(from_m, |x| x.s_m < from_m);
        let end = self.count(to_m, |x| x.s_m <= to_m);
        &self.stations[begin..end.max(begin)]
    }
}

/// Cell of an arc length; the first or last beyond the ends.
#[inline]
fn cell_of(s_m: f64, first_m: f64, per_m: f64, cells: usize) -> usize {
    (((s_m - first_m) * per_m) as usize).min(cells - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Distance by a search through all stations.
    fn at(stations: &[Station], s_m: f64) -> f64 {
        let next = stations.iter().take_while(|x| x.s_m <= s_m).count();
        if next == 0 || next == stations.len() {
            return stations[next.max(1) - 1].distance_m;
        }
        let (a, b) = (stations[next - 1], stations[next]);
        a.distance_m + (b.distance_m - a.distance_m) * ((s_m - a.s_m) / (b.s_m - a.s_m))
    }

    fn check(stations: &[Station], places_m: &[f64]) {
        let indexed = Stations::new(stations.to_vec());
        assert!(indexed.before.len() <= PER_STATION * stations.len() + 1);
        for &s_m in places_m {
            let bits = |distance_m: f64| distance_m.to_bits();
            assert_eq!(bits(indexed.at(s_m)), bits(at(stations, s_m)), "{s_m}");
            assert_eq!(indexed.from(s_m), stations.iter().find(|x| x.s_m >= s_m), "{s_m}");
            for &to_m in places_m {
                let between: Vec<Station> =
                    stations.iter().filter(|x| s_m <= x.s_m && x.s_m <= to_m).copied().collect();
                assert_eq!(indexed.between([s_m, to_m]), between, "{s_m} {to_m}");
            }
        }
    }

    #[test]
    fn index_is_small_and_exact_for_extreme_stations() {
        let at = |pairs: &[f64]| -> Vec<Station> {
            let stations = pairs.iter().enumerate();
            stations.map(|(k, &s_m)| Station { s_m, distance_m: k as f64 }).collect()
        };
        let places_m = [f64::NEG_INFINITY, -1e308, -1.0, 0.0, 1e-320, 0.5, 1.0, 1e9, 1e308, f64::INFINITY];
        for stations in [
            at(&[0.0, 0.0]),
            at(&[0.0, 1e-320]),
            at(&[0.0, 0.25, 0.5, 1e15]),
            at(&[-1e308, 0.0, 1e308]),
            at(&[-3.0, -3.0, 0.5, 0.5, 1.0, 2e5]),
        ] {
            check(&stations, &places_m);
            assert_eq!(Stations::new(stations).at(f64::NAN), 0.0);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]
        #[test]
        fn index_finds_what_a_search_through_all_stations_finds(
            begin in -500.0..500.0,
            // Steps, dense and sparse stretches; multiples of a tenth are often on the borders of cells.
            gaps in prop::collection::vec(prop_oneof![Just(0.0), Just(0.1), Just(1.0), 0.0..3.0, 5.0..300.0], 1..40),
            distances in prop::collection::vec(-4.0..9.0, 40),
            shares in prop::collection::vec(-0.1..1.1, 12),
        ) {
            let mut s_m = begin;
            let mut stations: Vec<Station> = vec![Station { s_m, distance_m: distances[0] }];
            for (gap_m, distance_m) in gaps.iter().zip(&distances[1..]) {
                s_m += gap_m;
                stations.push(Station { s_m, distance_m: *distance_m });
            }
            let mut places_m: Vec<f64> = stations.iter().map(|x| x.s_m).collect();
            places_m.extend(shares.iter().map(|share| begin + (s_m - begin) * share));
            places_m.extend(shares.iter().map(|share: &f64| f64::round(begin + (s_m - begin) * share)));
            check(&stations, &places_m);
        }
    }
}
