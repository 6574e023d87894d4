//! Oriented boxes of clusters, completed to the size of a class.

use core::f32::consts::FRAC_PI_2;

use swerve_msg::ActorKind;

/// Most points used for a fit: about the number of columns on the outline of a car at 10 m.
const FITTED_MAX: usize = 160;
/// Distance from a side within which points are on it, metres: about the range noise.
const ON_SIDE_M: f32 = 0.05;
/// Step and number of steps of the heading search, radians: over a quarter turn, then around the best.
const COARSE: (f32, i32) = (FRAC_PI_2 / 18.0, 18);
const FINE: (f32, i32) = (FRAC_PI_2 / 90.0, 4);
/// Largest difference of a heading from that of the road to be aligned with it, radians, and the closeness required
/// relative to the best fit.
const ALIGNED: (f32, f32) = (0.26, 0.75);

/// Width in view from which points show a side along an axis, metres.
const SIDE_M: f32 = 0.15;

/// Rectangle fitted to the points of a cluster.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(super) struct Fit {
    /// Heading of one of its axes, radians.
    pub(super) heading_rad: f32,
    /// Cosine and sine of the heading.
    pub(super) turn: [f32; 2],
    /// Limits along that axis, then along the axis to its left, metres from the origin.
    pub(super) ends: [[f32; 2]; 2],
    /// Mean inverse distance of points to the nearer of two sides, normalised and limited to 1 for points on a side: 0
    /// to 1.
    pub(super) closeness: f32,
}

/// Geometric properties of a class.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Class {
    pub(super) kind: ActorKind,
    /// Typical length and width, used where less is seen, metres.
    pub(super) usual_m: [f32; 2],
    /// Largest length and width, metres.
    pub(super) most_m: [f32; 2],
    /// Range of the height of the highest visible point, metres.
    pub(super) top_m: [f32; 2],
    /// Standard deviation of the centre, as a share of the unseen part of length or width.
    pub(super) hidden_share: f64,
}

/// Classes of clusters.
pub(super) const CLASSES: [Class; 4] = [
    Class {
        kind: ActorKind::Car,
        usual_m: [4.4, 1.8],
        most_m: [5.7, 2.4],
        top_m: [0.5, 2.6],
        hidden_share: 0.1,
    },
    Class {
        kind: ActorKind::Truck,
        usual_m: [6.0, 2.5],
        most_m: [12.5, 3.1],
        top_m: [1.2, 4.5],
        hidden_share: 0.15,
    },
    Class {
        kind: ActorKind::Cyclist,
        usual_m: [1.8, 0.6],
        most_m: [2.2, 1.1],
        top_m: [0.8, 2.2],
        hidden_share: 0.2,
    },
    Class {
        kind: ActorKind::Pedestrian,
        usual_m: [0.5, 0.5],
        most_m: [1.1, 1.1],
        top_m: [0.6, 2.2],
        hidden_share: 0.35,
    },
];

/// Rectangle on the ground.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Rectangle {
    pub(super) middle: [f32; 2],
    /// Cosine and sine of the heading.
    pub(super) turn: [f32; 2],
    pub(super) heading_rad: f32,
    /// Length and width, metres.
    pub(super) size_m: [f32; 2],
    /// Visible part of length and width, metres.
    pub(super) seen_m: [f32; 2],
}

/// Standard deviation of the centre of the visible part, metres: edges lie between two points, and people swing arms
/// and legs.
const SEEN_NOISE_M: f64 = 0.07;

impl Rectangle {
    /// Covariance of the centre: xx, xy, yy in m². The added part contributes a share of its size.
    pub(super) fn covariance_m2(&self, class: &Class) -> [f64; 3] {
        let [along, across] = [0, 1].map(|axis| {
            let added_m = class.hidden_share * f64::from(self.size_m[axis] - self.seen_m[axis]);
            SEEN_NOISE_M * SEEN_NOISE_M + added_m * added_m
        });
        let [cos, sin] = self.turn.map(f64::from);
        let part = |a: f64, b: f64, c: f64, d: f64| along * a * b + across * c * d;
        [part(cos, cos, sin, sin), part(cos, sin, -sin, cos), part(sin, sin, cos, cos)]
    }
}

/// Fits the rectangle whose sides are closest to the points (Zhang et al. 2017, algorithm 4: closeness), by a coarse
/// and a fine search; aligned with the road if that fits nearly as well.
pub(super) fn fit(points: &[[f32; 4]], road_rad: Option<f32>) -> Fit {
    let step = points.len().div_ceil(FITTED_MAX).max(1);
    let at = |heading_rad: f32| judge(points, step, heading_rad);
    let best = |of: &mut dyn Iterator<Item = f32>| {
        of.map(at).fold(Fit { closeness: -1.0, ..Fit::default() }, |best, fit| {
            if fit.closeness > best.closeness { fit } else { best }
        })
    };
    let rough = best(&mut (0..COARSE.1).map(|k| k as f32 * COARSE.0));
    let best = best(&mut (-FINE.1..=FINE.1).map(|k| rough.heading_rad + k as f32 * FINE.0));
    let Some(road_rad) = road_rad else { return best };
    let aligned = at(best.heading_rad + quarter(road_rad - best.heading_rad));
    let is_near = quarter(road_rad - best.heading_rad).abs() < ALIGNED.0;
    if is_near && aligned.closeness > ALIGNED.1 * best.closeness { aligned } else { best }
}

/// Angle modulo a quarter turn: within an eighth of a turn.
pub(super) fn quarter(angle_rad: f32) -> f32 {
    angle_rad - (angle_rad / FRAC_PI_2).round() * FRAC_PI_2
}

fn judge(points: &[[f32; 4]], step: usize, heading_rad: f32) -> Fit {
    let (sin, cos) = libm::sincosf(heading_rad);
    let turned = |[x, y, ..]: &[f32; 4]| [x * cos + y * sin, y * cos - x * sin];
    let mut ends = [[f32::INFINITY, f32::NEG_INFINITY]; 2];
    for point in points.iter().step_by(step) {
        for (ends, at) in ends.iter_mut().zip(turned(point)) {
            *ends = [ends[0].min(at), ends[1].max(at)];
        }
    }
    // For each axis, select the side that is closer to more points, by the sum of distances.
    let mut sums = [[0.0_f32; 2]; 2];
    for point in points.iter().step_by(step) {
        for ((sums, ends), at) in sums.iter_mut().zip(&ends).zip(turned(point)) {
            *sums = [sums[0] + (at - ends[0]), sums[1] + (ends[1] - at)];
        }
    }
    let side = [0, 1].map(|axis| ends[axis][usize::from(sums[axis][1] < sums[axis][0])]);
    let (mut closeness, mut count) = (0.0, 0.0);
    for point in points.iter().step_by(step) {
        let [along, across] = turned(point);
        let off = (along - side[0]).abs().min((across - side[1]).abs());
        closeness += ON_SIDE_M / off.max(ON_SIDE_M);
        count += 1.0;
    }
    Fit { heading_rad, turn: [cos, sin], ends, closeness: closeness / f32::max(count, 1.0) }
}

/// Rectangle of an object of a class, with its length along one axis of a fit; `None` if the cluster is too large for
/// the class.
///
/// The visible part is kept; the missing part is added on the side away from the sensor, or on both if the sensor faces
/// the middle. If a nearer object hides either the left or the right end, as seen from the sensor, the missing part of
/// a visible side is added there, unless the face at that end is visible.
pub(super) fn complete(
    fit: &Fit,
    class: &Class,
    is_across: bool,
    (sensor, hidden): ([f32; 2], [bool; 2]),
) -> Option<Rectangle> {
    let [cos, sin] = fit.turn;
    let from = [sensor[0] * cos + sensor[1] * sin, sensor[1] * cos - sensor[0] * sin];
    let (mut ends, mut seen_m, mut size_m) = (fit.ends, [0.0; 2], [0.0; 2]);
    for axis in [0, 1] {
        let which = usize::from((axis == 1) != is_across);
        let [low, high] = fit.ends[axis];
        seen_m[which] = high - low;
        if seen_m[which] > class.most_m[which] {
            return None;
        }
        let missing = (class.usual_m[which] - seen_m[which]).max(0.0);
        size_m[which] = seen_m[which] + missing;
        // For a sensor beyond the low end, all of the missing part is added at the high end.
        let share = ((low - from[axis]) / (high - low + 0.1) + 0.5).clamp(0.0, 1.0)
            - ((from[axis] - high) / (high - low + 0.1) + 0.5).clamp(0.0, 1.0);
        let [low_across, high_across] = fit.ends[1 - axis];
        let shows_face = high_across - low_across > FACE_SHARE * class.usual_m[1 - which];
        let faces = if low > from[axis] { -1.0 } else { f32::from(u8::from(high < from[axis])) };
        let is_hidden = |end: &f32| !(shows_face && *end == faces);
        let share = hidden_end(fit, axis, sensor, hidden).filter(is_hidden).unwrap_or(share);
        let beyond = missing * 0.5 * (1.0 + share);
        ends[axis] = [low - (missing - beyond), high + beyond];
    }
    let middle = middle(fit.turn, ends);
    let (heading_rad, turn) =
        if is_across { (fit.heading_rad + FRAC_PI_2, [-sin, cos]) } else { (fit.heading_rad, [cos, sin]) };
    Some(Rectangle { middle, turn, heading_rad, size_m, seen_m })
}

/// Share of a face's usual width that has to be visible for its end not to be hidden.
const FACE_SHARE: f32 = 0.5;

/// Middle of a rectangle with these limits along its axes; `turn` is the cosine and sine of its heading.
pub(super) fn middle([cos, sin]: [f32; 2], ends: [[f32; 2]; 2]) -> [f32; 2] {
    let [along, across] = ends.map(|[low, high]| 0.5 * (low + high));
    [along * cos - across * sin, along * sin + across * cos]
}

/// Hidden end of an axis of a fit: 1 for the high end, -1 for the low end; `None` if no side along it is in view, or if
/// both or none of the ends are hidden.
fn hidden_end(fit: &Fit, axis: usize, sensor: [f32; 2], [left, right]: [bool; 2]) -> Option<f32> {
    let ([cos, sin], [x, y]) = (fit.turn, middle(fit.turn, fit.ends));
    let [dx, dy] = [x - sensor[0], y - sensor[1]];
    // The axis against the direction to the left of the line of sight.
    let [x, y] = if axis == 0 { [cos, sin] } else { [-sin, cos] };
    let leftward = (y * dx - x * dy) / libm::hypotf(dx, dy).max(f32::MIN_POSITIVE);
    let in_view_m = leftward.abs() * (fit.ends[axis][1] - fit.ends[axis][0]);
    (left != right && in_view_m > SIDE_M).then(|| if left { leftward.signum() } else { -leftward.signum() })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points on the two near sides of a rectangle seen from the origin.
    fn sides(middle: [f32; 2], heading_rad: f32, [length, width]: [f32; 2]) -> Vec<[f32; 4]> {
        let (sin, cos) = libm::sincosf(heading_rad);
        let back = |sign: f32, x: f32, y: f32| sign * (x * middle[0] + y * middle[1]) > 0.0;
        let (rear, right) =
            (if back(1.0, cos, sin) { -0.5 } else { 0.5 }, if back(1.0, -sin, cos) { -0.5 } else { 0.5 });
        (0..60)
            .flat_map(|k| {
                let part = k as f32 / 59.0 - 0.5;
                [[part * length, right * width], [rear * length, part * width]]
            })
            .map(|[x, y]| [middle[0] + x * cos - y * sin, middle[1] + x * sin + y * cos, 0.5, 0.5])
            .collect()
    }

    #[test]
    fn fit_finds_the_heading_of_corners() {
        for k in 0..36_i32 {
            let heading = 0.087 * k as f32;
            let found = fit(&sides([12.0, 5.0], heading, [4.4, 1.8]), None);
            assert!(quarter(found.heading_rad - heading).abs() < 0.02, "{heading}: {found:?}");
            let aligned = fit(&sides([12.0, 5.0], heading, [4.4, 1.8]), Some(heading + 0.004));
            assert!(quarter(aligned.heading_rad - heading).abs() < 0.01, "{heading}: {aligned:?}");
        }
    }

    #[test]
    fn complete_adds_the_hidden_part_away_from_the_sensor() {
        for (middle, heading, size) in [
            ([15.0, 4.0], 0.0_f32, [4.4_f32, 1.8_f32]),
            ([15.0, -4.0], 3.1, [4.4, 1.8]),
            ([-12.0, 6.0], 1.2, [4.4, 1.8]),
            ([10.0, 0.0], 0.0, [4.4, 1.8]),
        ] {
            let points: Vec<[f32; 4]> = sides(middle, heading, size);
            // Only the near half of the points.
            let range = |p: &[f32; 4]| p[0] * p[0] + p[1] * p[1];
            let mut near = points.clone();
            near.sort_by(|a, b| range(a).total_cmp(&range(b)));
            near.truncate(90);
            let fit = fit(&near, Some(heading));
            let boxes = [false, true].map(|across| complete(&fit, &CLASSES[0], across, IN_VIEW));
            let off = |b: &Rectangle| libm::hypotf(b.middle[0] - middle[0], b.middle[1] - middle[1]);
            let best = boxes.iter().flatten().map(off).fold(9.0, f32::min);
            assert!(best < 0.25, "{middle:?} {heading}: {boxes:?}");
        }
    }

    /// A sensor at the origin, and no end hidden.
    const IN_VIEW: ([f32; 2], [bool; 2]) = ([0.0, 0.0], [false, false]);

    #[test]
    fn complete_adds_the_part_that_a_nearer_object_hides() {
        // The front half of the left side of a car in the right lane, whose rear half is hidden by a truck.
        let side: Vec<[f32; 4]> = (0..22).map(|k| [14.2 + 0.1 * k as f32, -2.5, 0.5, 0.5]).collect();
        let corner: Vec<[f32; 4]> =
            side.iter().copied().chain((0..18).map(|k| [14.2, -4.3 + 0.1 * k as f32, 0.5, 0.5])).collect();
        // The left half of a person straight ahead; the right half is hidden.
        let person: Vec<[f32; 4]> = (0..6).map(|k| [15.0, 0.05 * k as f32, 1.0, 1.0]).collect();
        for (points, class, hidden, [x, y]) in [
            (&side, &CLASSES[0], [false, true], [14.1, -3.4]),
            (&side, &CLASSES[0], [false, false], [16.4, -3.4]),
            (&side, &CLASSES[0], [true, true], [16.4, -3.4]),
            // With its rear in view, nothing hides the rear half.
            (&corner, &CLASSES[0], [false, true], [16.4, -3.4]),
            (&corner, &CLASSES[0], [true, false], [16.4, -3.4]),
            (&person, &CLASSES[3], [false, true], [15.25, 0.0]),
            (&person, &CLASSES[3], [true, false], [15.25, 0.25]),
        ] {
            let fit = fit(points, Some(0.0));
            let found = complete(&fit, class, false, ([1.4, 0.0], hidden)).unwrap();
            let [dx, dy] = [found.middle[0] - x, found.middle[1] - y];
            assert!(libm::hypotf(dx, dy) < 0.06, "{:?} {hidden:?} {found:?}", class.kind);
        }
    }

    #[test]
    fn covariance_grows_with_the_hidden_part_and_rotates_with_the_box() {
        let seen = |seen_m: [f32; 2], heading_rad: f32| {
            let (sin, cos) = libm::sincosf(heading_rad);
            let size_m = [4.4, 1.8];
            Rectangle { middle: [15.0, 4.0], turn: [cos, sin], heading_rad, size_m, seen_m }
                .covariance_m2(&CLASSES[0])
        };
        let is = |told: [f64; 3], expected: [f64; 3]| {
            assert!(told.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{told:?} {expected:?}");
        };
        let whole = SEEN_NOISE_M * SEEN_NOISE_M;
        is(seen([4.4, 1.8], 0.3), [whole, 0.0, whole]);
        let added = (CLASSES[0].hidden_share * 3.0).powi(2);
        is(seen([1.4, 1.8], 0.0), [whole + added, 0.0, whole]);
        is(seen([1.4, 1.8], core::f32::consts::FRAC_PI_2), [whole, 0.0, whole + added]);
        is(
            seen([1.4, 1.8], core::f32::consts::FRAC_PI_4),
            [whole + 0.5 * added, 0.5 * added, whole + 0.5 * added],
        );
    }

    #[test]
    fn complete_rejects_a_wall_as_a_car() {
        let points: Vec<[f32; 4]> = (0..100).map(|k| [10.0, 0.1 * k as f32, 0.5, 0.5]).collect();
        let fit = fit(&points, None);
        assert!(CLASSES.iter().all(|class| class.kind == ActorKind::Truck
            || [false, true].iter().all(|across| complete(&fit, class, *across, IN_VIEW).is_none())));
    }
}
