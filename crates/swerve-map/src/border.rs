//! Borders beside a line, as functions of arc length.

mod serial;
mod stations;

use serde::{Deserialize, Serialize};
use swerve_geom::{FrenetPoint, Point2};

use stations::Stations;

/// A border beside a line: its distance from the line as a function of arc length.
///
/// Constant, or linear between stations and constant before the first and beyond the last. Two stations at the same
/// arc length form a step, at which the second applies. Its text form is a number, or a list of `[s_m, distance_m]`; its
/// binary form is the list, of which an empty one is a border on the line.
#[derive(Clone, PartialEq, Debug)]
pub struct Border(Form);

#[derive(Clone, PartialEq, Debug)]
enum Form {
    Constant(f64),
    /// At least two stations.
    Linear(Stations),
}

impl Form {
    fn linear(stations: Vec<Station>) -> Self {
        Self::Linear(Stations::new(stations))
    }
}

/// The distance of a border at one arc length.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Station {
    /// Arc length along the line, metres.
    pub s_m: f64,
    /// Distance of the border from the line, metres.
    pub distance_m: f64,
}

/// Error of constructing a border from stations.
#[derive(Clone, Copy, PartialEq, Debug, thiserror::Error)]
pub enum BorderError {
    /// The list of stations is empty.
    #[error("a border needs a distance at one station at least")]
    Empty,
    /// A number is infinite or NaN.
    #[error("station {0} of the border is not finite")]
    NotFinite(usize),
    /// A station is before its predecessor, or is the third at one arc length.
    #[error("station {0} of the border does not lie beyond the one before it")]
    Order(usize),
}

impl Border {
    /// Creates a border at the same distance everywhere, metres.
    pub const fn constant(distance_m: f64) -> Self {
        Self(Form::Constant(distance_m))
    }

    /// Creates a border that is linear between these stations; constant if there is only one, or all have the same
    /// distance.
    ///
    /// # Errors
    /// If there is no station, a number is not finite, or the stations are not in order.
    pub fn linear(stations: &[Station]) -> Result<Self, BorderError> {
        let Some(first) = stations.first() else { return Err(BorderError::Empty) };
        if let Some(bad) = stations.iter().position(|x| !(x.s_m.is_finite() && x.distance_m.is_finite())) {
            return Err(BorderError::NotFinite(bad));
        }
        let disorder = |k: usize| {
            let before = stations[k - 1].s_m;
            stations[k].s_m < before || (k > 1 && stations[k].s_m == stations[k - 2].s_m)
        };
        if let Some(bad) = (1..stations.len()).find(|&k| disorder(k)) {
            return Err(BorderError::Order(bad));
        }
        if stations.iter().all(|x| x.distance_m == first.distance_m) {
            return Ok(Self::constant(first.distance_m));
        }
        Ok(Self(Form::linear(stations.to_vec())))
    }

    /// Distance from the line at arc length `s_m`, metres.
    #[inline]
    pub fn at(&self, s_m: f64) -> f64 {
        match &self.0 {
            Form::Constant(distance_m) => *distance_m,
            Form::Linear(stations) => stations.at(s_m),
        }
    }

    /// Stations of a linear border; empty for a constant one.
    #[inline]
    pub fn stations(&self) -> &[Station] {
        match &self.0 {
            Form::Constant(_) => &[],
            Form::Linear(stations) => stations.as_slice(),
        }
    }

    /// Stations of a linear border in a range of arc lengths, metres.
    #[inline]
    fn stations_between(&self, ends_m: [f64; 2]) -> &[Station] {
        match &self.0 {
            Form::Constant(_) => &[],
            Form::Linear(stations) => stations.between(ends_m),
        }
    }

    /// Largest distance from the line, metres.
    pub fn max_m(&self) -> f64 {
        self.distances().fold(f64::NEG_INFINITY, f64::max)
    }

    /// Smallest distance from the line, metres.
    pub fn min_m(&self) -> f64 {
        self.distances().fold(f64::INFINITY, f64::min)
    }

    /// Smallest distance from the line over the given range of arc lengths, metres.
    pub fn min_between_m(&self, [from_m, to_m]: [f64; 2]) -> f64 {
        let within = self.stations_between([from_m, to_m]).iter().filter(|x| from_m < x.s_m);
        within.map(|x| x.distance_m).fold(self.at(from_m).min(self.at(to_m)), f64::min)
    }

    fn distances(&self) -> impl Iterator<Item = f64> + '_ {
        let constant = match &self.0 {
            Form::Constant(distance_m) => Some(*distance_m),
            Form::Linear(_) => None,
        };
        constant.into_iter().chain(self.stations().iter().map(|x| x.distance_m))
    }

    /// Sum of two borders: this one moved outwards by the distance of `other` at each arc length.
    #[must_use]
    pub fn plus(&self, other: &Self) -> Self {
        if let (Form::Constant(a), Form::Constant(b)) = (&self.0, &other.0) {
            return Self::constant(a + b);
        }
        let mut stations = Vec::new();
        let mut at: Vec<f64> = self.stations().iter().chain(other.stations()).map(|x| x.s_m).collect();
        at.sort_by(f64::total_cmp);
        at.dedup();
        for s_m in at {
            // At a step of either border: the sums just before it and from it on.
            let before = self.before(s_m) + other.before(s_m);
            let from = self.at(s_m) + other.at(s_m);
            if before != from {
                stations.push(Station { s_m, distance_m: before });
            }
            stations.push(Station { s_m, distance_m: from });
        }
        Self(Form::linear(stations))
    }

    /// The border with its distances times a factor.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        match &self.0 {
            Form::Constant(distance_m) => Self::constant(factor * distance_m),
            Form::Linear(stations) => {
                let scaled = |x: &Station| Station { distance_m: factor * x.distance_m, ..*x };
                Self(Form::linear(stations.as_slice().iter().map(scaled).collect()))
            }
        }
    }

    /// Distance just before `s_m`.
    fn before(&self, s_m: f64) -> f64 {
        let first = match &self.0 {
            Form::Constant(_) => None,
            Form::Linear(stations) => stations.from(s_m),
        };
        first.filter(|x| x.s_m == s_m).map_or_else(|| self.at(s_m), |x| x.distance_m)
    }

    /// The border relative to a line on which arc length `s` of this one is at `begin_m + scale * s`. A negative
    /// scale reverses it.
    #[must_use]
    pub(crate) fn along(&self, begin_m: f64, scale: f64) -> Self {
        match &self.0 {
            Form::Constant(_) => self.clone(),
            Form::Linear(stations) => {
                let moved = |x: &Station| Station { s_m: begin_m + scale * x.s_m, ..*x };
                let mut moved: Vec<Station> = stations.as_slice().iter().map(moved).collect();
                if scale < 0.0 {
                    moved.reverse();
                }
                Self(Form::linear(moved))
            }
        }
    }

    /// Concatenates borders, each from the arc length beside it to that of the next.
    pub(crate) fn joined(parts: &[(f64, Self)], end_m: f64) -> Self {
        let mut stations: Vec<Station> = Vec::new();
        for (k, (begin_m, border)) in parts.iter().enumerate() {
            let until_m = parts.get(k + 1).map_or(end_m, |(next_m, _)| *next_m);
            let first = Station { s_m: *begin_m, distance_m: border.at(*begin_m) };
            let last = Station { s_m: until_m, distance_m: border.before(until_m) };
            let within = border.stations().iter().filter(|x| *begin_m < x.s_m && x.s_m < until_m);
            let goes_on = stations.last().is_some_and(|x| *x == first);
            stations.extend((!goes_on).then_some(first));
            stations.extend(within);
            stations.push(last);
        }
        match stations.first() {
            Some(first) if stations.iter().any(|x| x.distance_m != first.distance_m) => {
                Self(Form::linear(stations))
            }
            first => Self::constant(first.map_or(0.0, |x| x.distance_m)),
        }
    }
}

/// The borders on both sides of a line.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Borders {
    /// Border to the left of the line: arc length and distance of its stations, metres.
    #[serde(rename = "left_m")]
    left: Border,
    /// Border to the right of the line, positive to the right.
    #[serde(rename = "right_m")]
    right: Border,
}

impl Default for Borders {
    fn default() -> Self {
        Self::constant(0.0, 0.0)
    }
}

impl Borders {
    /// Creates borders at these distances to the left and to the right.
    pub const fn new(left: Border, right: Border) -> Self {
        Self { left, right }
    }

    /// Creates borders at the same distances everywhere, metres.
    pub const fn constant(left_m: f64, right_m: f64) -> Self {
        Self::new(Border::constant(left_m), Border::constant(right_m))
    }

    /// Border to the left of the line.
    pub fn left(&self) -> &Border {
        &self.left
    }

    /// Border to the right of the line.
    pub fn right(&self) -> &Border {
        &self.right
    }

    /// Distance from the line to the left border at arc length `s_m`, metres.
    #[inline]
    pub fn left_m(&self, s_m: f64) -> f64 {
        self.left.at(s_m)
    }

    /// Distance from the line to the right border at arc length `s_m`, metres (positive).
    #[inline]
    pub fn right_m(&self, s_m: f64) -> f64 {
        self.right.at(s_m)
    }

    /// Largest distance of either border from the line, metres.
    pub fn farthest_m(&self) -> f64 {
        self.left.max_m().max(self.right.max_m())
    }

    /// Distance of a point from the nearer border, measured across the line, metres; negative outside.
    #[inline]
    pub fn room_m(&self, place: FrenetPoint) -> f64 {
        (self.left_m(place.s_m) - place.d_m).min(place.d_m + self.right_m(place.s_m))
    }

    /// Returns true if a point is between the borders or on one of them.
    pub fn contains(&self, place: FrenetPoint) -> bool {
        self.room_m(place) >= 0.0
    }

    /// Smallest distance of an outline from the nearer border, measured across the line, metres; negative outside.
    /// `project` projects a map point onto the line.
    ///
    /// Between borders of constant distance, the minimum is at a corner. Where a border approaches and recedes again,
    /// it can be on a side of the outline, beside a station of the border: these points are checked too.
    pub fn margin_m(&self, corners: [Point2; 4], project: impl Fn(Point2) -> FrenetPoint) -> f64 {
        self.margin_above_m(corners, f64::NEG_INFINITY, project)
    }

    /// Returns [`margin_m`](Self::margin_m) if that is at least `needed_m`, else some value below `needed_m`.
    fn margin_above_m(
        &self,
        corners: [Point2; 4],
        needed_m: f64,
        project: impl Fn(Point2) -> FrenetPoint,
    ) -> f64 {
        let places = corners.map(&project);
        let mut margin_m = places.into_iter().fold(f64::INFINITY, |m, place| m.min(self.room_m(place)));
        if margin_m < needed_m {
            return margin_m;
        }
        let ends = places.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low_m, high_m], place| {
            [low_m.min(place.s_m), high_m.max(place.s_m)]
        });
        for station in self.left.stations_between(ends).iter().chain(self.right.stations_between(ends)) {
            for (i, from) in places.into_iter().enumerate() {
                let next = (i + 1) % 4;
                let share = (station.s_m - from.s_m) / (places[next].s_m - from.s_m);
                if share > 0.0 && share < 1.0 {
                    let beside = project(corners[i] + (corners[next] - corners[i]) * share);
                    margin_m = margin_m.min(self.room_m(beside));
                }
            }
        }
        margin_m
    }

    /// Returns true if [`margin_m`](Self::margin_m) is at least `needed_m`; stops where a corner is too near.
    pub fn keeps(
        &self,
        corners: [Point2; 4],
        needed_m: f64,
        project: impl Fn(Point2) -> FrenetPoint,
    ) -> bool {
        if !(self.left.stations().is_empty() && self.right.stations().is_empty()) {
            return self.margin_above_m(corners, needed_m, project) >= needed_m;
        }
        corners.into_iter().all(|corner| f64::INFINITY.min(self.room_m(project(corner))) >= needed_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use swerve_geom::{Obb, Polyline, Pose2};

    fn border(pairs: &[(f64, f64)]) -> Border {
        let stations: Vec<_> = pairs.iter().map(|&(s_m, distance_m)| Station { s_m, distance_m }).collect();
        Border::linear(&stations).unwrap()
    }

    #[test]
    fn border_is_linear_between_stations_and_constant_beyond() {
        let b = border(&[(10.0, 2.0), (20.0, 4.0), (20.0, 3.0), (30.0, 1.0)]);
        for (s_m, distance_m) in [
            (-5.0, 2.0),
            (10.0, 2.0),
            (15.0, 3.0),
            (19.999_999_999, 4.0),
            (20.0, 3.0),
            (25.0, 2.0),
            (99.0, 1.0),
        ] {
            assert!((b.at(s_m) - distance_m).abs() < 1e-9, "{s_m}: {}", b.at(s_m));
        }
        assert_eq!((b.min_m(), b.max_m(), b.before(20.0)), (1.0, 4.0, 4.0));
        assert_eq!((b.min_between_m([12.0, 18.0]), b.min_between_m([5.0, 25.0])), (2.4, 2.0));
        assert_eq!((b.min_between_m([15.0, 20.0]), b.min_between_m([0.0, 40.0])), (3.0, 1.0));
        assert_eq!((Border::constant(2.5).min_m(), Border::constant(2.5).max_m()), (2.5, 2.5));
        assert_eq!(border(&[(0.0, 2.5), (9.0, 2.5)]), Border::constant(2.5));
    }

    #[test]
    fn invalid_stations_are_rejected() {
        let linear = |pairs: &[(f64, f64)]| {
            let stations: Vec<_> =
                pairs.iter().map(|&(s_m, distance_m)| Station { s_m, distance_m }).collect();
            Border::linear(&stations).unwrap_err()
        };
        assert_eq!(linear(&[]), BorderError::Empty);
        assert_eq!(linear(&[(0.0, 1.0), (1.0, f64::NAN)]), BorderError::NotFinite(1));
        assert_eq!(linear(&[(0.0, 1.0), (2.0, 2.0), (1.0, 1.0)]), BorderError::Order(2));
        assert_eq!(linear(&[(0.0, 1.0), (0.0, 2.0), (0.0, 3.0)]), BorderError::Order(2));
        let text = serde_json::from_str::<Border>("[[3.0, 1.0], [2.0, 1.5]]").unwrap_err();
        assert!(text.to_string().contains("station 1"), "{text}");
    }

    #[test]
    fn border_text_is_a_number_or_a_list_of_stations() {
        let text = |b: &Border| serde_json::to_string(b).unwrap();
        let varying = border(&[(0.0, 2.0), (50.0, 3.5)]);
        assert_eq!(text(&Border::constant(6.0)), "6.0");
        assert_eq!(text(&varying), "[[0.0,2.0],[50.0,3.5]]");
        for b in [Border::constant(6.0), varying] {
            assert_eq!(serde_json::from_str::<Border>(&text(&b)).unwrap(), b);
        }
        assert_eq!(serde_json::from_str::<Border>("6").unwrap(), Border::constant(6.0));
    }

    #[test]
    fn border_sums_joins_and_reversals_agree_with_the_functions() {
        let a = border(&[(0.0, 1.0), (10.0, 2.0), (10.0, 5.0), (20.0, 5.0)]);
        let b = border(&[(5.0, 0.5), (15.0, 1.5)]);
        let (sum, turned) = (a.plus(&b), a.along(20.0, -1.0));
        let joined = Border::joined(&[(0.0, a.clone()), (20.0, b.along(20.0, 1.0))], 40.0);
        for k in 0..200 {
            let s_m = f64::from(k) * 0.1 + 0.01;
            assert!((sum.at(s_m) - a.at(s_m) - b.at(s_m)).abs() < 1e-12, "{s_m}");
            assert!((turned.at(20.0 - s_m) - a.at(s_m)).abs() < 1e-12, "{s_m}");
            assert!((joined.at(s_m) - a.at(s_m)).abs() < 1e-12, "{s_m}");
            assert!((joined.at(20.0 + s_m) - b.at(s_m)).abs() < 1e-12, "{s_m}");
        }
        assert_eq!(Border::constant(2.0).plus(&Border::constant(4.0)), Border::constant(6.0));
        let same = [(0.0, Border::constant(3.0)), (7.0, Border::constant(3.0))];
        assert_eq!(Border::joined(&same, 9.0), Border::constant(3.0));
    }

    #[test]
    fn margin_detects_a_narrowing_between_the_corners() {
        // The right border is at 1 m at s = 20, and at 3 m from 1 m before and after.
        let line = Polyline::new(&[Point2::new(0.0, 0.0), Point2::new(40.0, 0.0)]).unwrap();
        let right = border(&[(19.0, 3.0), (20.0, 1.0), (21.0, 3.0)]);
        let borders = Borders::new(Border::constant(5.0), right);
        let margin = |x: f64, y: f64| {
            let outline = Obb::new(Pose2::new(x, y, 0.0), 4.0, 2.0);
            borders.margin_m(outline.corners(), |p| line.project(p))
        };
        assert!((margin(20.0, 0.5) - 0.5).abs() < 1e-12);
        assert!((margin(20.0, -0.5) + 0.5).abs() < 1e-12);
        assert!((margin(10.0, -0.5) - 1.5).abs() < 1e-12);
    }

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]
        #[test]
        fn margin_is_the_smallest_over_the_whole_outline(
            x in 5.0..55.0, y in -2.0..2.0, h in -3.0..3.0, narrow in 0.5..4.0, at in 15.0..45.0,
        ) {
            let line = Polyline::new(&[Point2::new(0.0, 0.0), Point2::new(60.0, 0.0)]).unwrap();
            let left = border(&[(0.0, 4.0), (at - 5.0, 4.0), (at, narrow), (at + 3.0, 5.0)]);
            let borders = Borders::new(left, border(&[(at, 3.0), (at + 1.0, narrow)]));
            let corners = Obb::new(Pose2::new(x, y, h), 4.9, 1.9).corners();
            let margin = borders.margin_m(corners, |p| line.project(p));
            let sampled = (0..4).flat_map(|i| (0..=500).map(move |k| (i, f64::from(k) / 500.0)));
            let smallest = sampled
                .map(|(i, t)| borders.room_m(line.project(corners[i] + (corners[(i + 1) % 4] - corners[i]) * t)))
                .fold(f64::INFINITY, f64::min);
            for needed in [margin - 0.1, margin, margin + 0.1] {
                prop_assert_eq!(borders.keeps(corners, needed, |p| line.project(p)), margin >= needed);
                let plain = Borders::constant(3.0, 2.0);
                let plain_m = plain.margin_m(corners, |p| line.project(p));
                prop_assert_eq!(plain.keeps(corners, needed, |p| line.project(p)), plain_m >= needed);
            }
            // The borders change by up to 2.5 m per metre; samples are 1 cm apart.
            prop_assert!(margin <= smallest + 1e-9 && margin >= smallest - 0.05, "{margin} {smallest}");
        }
    }
}
