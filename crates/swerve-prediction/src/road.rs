//! Bends predictions of road users along the road that they follow.
//!
//! In a bend, straight extrapolation crosses the lanes beside a vehicle's own. For a road user that moves along the
//! road, in either direction, the same line is drawn in road coordinates (Frenet: arc length and offset, as Werling
//! et al. 2010, section II). The speed along the road is kept, and the lateral speed decays within a second, which
//! models both lane keeping and a change to the next lane. A vehicle whose side is then in the ego's lane continues
//! to its centre. An oncoming vehicle that crosses the line of the ego's lane steers back from there: lane changes
//! into oncoming traffic are not expected. Pedestrians are not affected.

use swerve_geom::{FrenetPoint, Point2, Pose2, Vector2, angle_between, math};
use swerve_msg::{ActorKind, PredictedPose, Prediction, Route};

/// Smallest speed of a motion along the road, m/s.
const SPEED_MIN_MPS: f64 = 1.0;
/// Largest angle between a motion along the road and the road's heading, radians.
const ALONG_RAD: f64 = 0.5;
/// Largest distance beside the road's ground for a motion along it, metres.
const BESIDE_M: f64 = 1.0;
/// Time constant with which the lateral speed decays, seconds.
pub(crate) const SETTLES_S: f64 = 1.0;
/// Lateral acceleration of an oncoming vehicle that steers back to its lane, m/s². Source: assumed; 2 m/s² is
/// regarded as firm.
const CORRECTS_MPS2: f64 = 3.0;

/// Smallest lateral speed of a lane change, m/s.
pub(crate) const MERGES_MPS: f64 = 0.3;
/// Distance of a vehicle's side beyond the line from which it changes lanes, metres.
pub(crate) const OVER_LINE_M: f64 = 0.2;

/// Bends predictions of any shape for road users that follow the route: motion along and across their initial
/// direction becomes motion along and across the road.
pub fn follow(predictions: &mut [Prediction], route: &Route) {
    for prediction in predictions.iter_mut().filter(|one| one.kind != ActorKind::Pedestrian) {
        let [first, second, ..] = prediction.path[..] else { continue };
        bend(prediction, route, mean_velocity_mps(&first, &second), |one| mean_velocity_mps(&first, one));
    }
}

fn mean_velocity_mps(from: &PredictedPose, to: &PredictedPose) -> Vector2 {
    (to.pose.point() - from.pose.point()) * (1.0 / (to.at - from.at).as_secs())
}

/// Position of a road user on the road; where the road crosses itself, on the stretch along which the road user
/// moves.
pub(crate) fn place_of(route: &Route, point: Point2, velocity_mps: Vector2) -> FrenetPoint {
    let nearest = route.project(point);
    if velocity_mps.norm() < SPEED_MIN_MPS || is_along(route, nearest, velocity_mps) {
        return nearest;
    }
    let half_m = 0.5 * route.line().length();
    let places = route.line().places_near(point, half_m, half_m);
    let along = places.filter(|place| is_on(route, *place) && is_along(route, *place, velocity_mps));
    along.min_by(|a, b| a.d_m.abs().total_cmp(&b.d_m.abs())).unwrap_or(nearest)
}

/// Returns true for a motion along the road at this position, in either direction.
fn is_along(route: &Route, place: FrenetPoint, velocity_mps: Vector2) -> bool {
    let off_rad = angle_between(route.line().at(place.s_m).pose.heading_rad, velocity_mps.heading());
    off_rad.abs().min(core::f64::consts::PI - off_rad.abs()) < ALONG_RAD
}

/// Returns true for a position on the ground of the road, or close beside it.
pub(crate) fn is_on(route: &Route, FrenetPoint { s_m, d_m }: FrenetPoint) -> bool {
    (-route.right_m(s_m) - BESIDE_M..=route.left_m(s_m) + BESIDE_M).contains(&d_m)
}

/// Length at this position's offset per metre of the road's line, `1 - curvature · d`, for a road user that moves along
/// the road; `None` for others.
pub(crate) fn share_along(route: &Route, place: FrenetPoint, velocity_mps: Vector2) -> Option<f64> {
    // Near the centre of a bend, motion along the road is undefined.
    let share = 1.0 - route.line().at(place.s_m).curvature_1pm * place.d_m;
    let moves = velocity_mps.norm() >= SPEED_MIN_MPS && is_along(route, place, velocity_mps);
    (moves && is_on(route, place) && share >= 0.1).then_some(share)
}

/// Bends one prediction; `mean_mps` is the mean velocity from the first pose to a later one.
fn bend(
    prediction: &mut Prediction,
    route: &Route,
    first_mps: Vector2,
    mean_mps: impl Fn(&PredictedPose) -> Vector2,
) {
    let [first, ..] = prediction.path[..] else { return };
    let place @ FrenetPoint { s_m, d_m } = place_of(route, first.pose.point(), first_mps);
    let beside = route.line().at(s_m);
    let Some(share) = share_along(route, place, first_mps) else { return };
    let forwards = beside.pose.direction();
    let turn_rad = if first_mps.dot(forwards) < 0.0 { core::f64::consts::PI } else { 0.0 };
    let who = (prediction.kind, prediction.extent.width_m);
    let settling = Settling::of(route, place, who, [first_mps.dot(forwards), first_mps.dot(forwards.left())]);
    for (k, predicted) in prediction.path.iter_mut().enumerate() {
        let ahead_s = (predicted.at - first.at).as_secs();
        let velocity_mps = if ahead_s > 0.0 { mean_mps(predicted) } else { first_mps };
        let (along_mps, across_mps) = (velocity_mps.dot(forwards) / share, velocity_mps.dot(forwards.left()));
        let moved_m = settling.moved_m(across_mps * ahead_s, ahead_s);
        let place = FrenetPoint { s_m: s_m + along_mps * ahead_s, d_m: d_m + moved_m };
        let on_line = route.line().at(place.s_m).pose;
        let at = on_line.point() + on_line.direction().left() * place.d_m;
        let heading_rad = on_line.heading_rad + turn_rad;
        if let Some(covariance_m2) = prediction.covariances_m2.get_mut(k) {
            *covariance_m2 = turned(*covariance_m2, heading_rad - predicted.pose.heading_rad);
        }
        predicted.pose = Pose2::new(at.x_m, at.y_m, heading_rad);
    }
}

/// Rotates a covariance xx, xy, yy by an angle.
pub(crate) fn turned([xx, xy, yy]: [f64; 3], by_rad: f64) -> [f64; 3] {
    let (sin, cos) = math::sin_cos(by_rad);
    [
        xx * cos * cos - 2.0 * xy * sin * cos + yy * sin * sin,
        (xx - yy) * sin * cos + xy * (cos * cos - sin * sin),
        xx * sin * sin + 2.0 * xy * sin * cos + yy * cos * cos,
    ]
}

/// Settling of a lateral motion.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Settling {
    /// Time constant with which the lateral speed decays, seconds; infinite if it is kept.
    time_s: f64,
    /// Largest displacement to the right and to the left, metres.
    most_m: [f64; 2],
}

impl Settling {
    /// Settling for a road user with the given speeds along the road and to its left, m/s.
    ///
    /// A lateral motion settles with [`SETTLES_S`]. An oncoming vehicle that drifts to the right, as seen along the
    /// route, steers back once its side is over the line of the ego's lane, which takes another v² / 2a. A vehicle
    /// that moves into the ego's lane, across that line or from the edge of the road, continues to its centre.
    pub(crate) fn of(
        route: &Route,
        place: FrenetPoint,
        (kind, width_m): (ActorKind, f64),
        speeds_mps: [f64; 2],
    ) -> Self {
        let merges = || Self::of_merge(route, place, width_m, speeds_mps).filter(|_| !kind.is_person());
        Self::of_stray(route, place, width_m, speeds_mps)
            .or_else(merges)
            .unwrap_or(Self { time_s: SETTLES_S, most_m: [f64::INFINITY; 2] })
    }

    /// Settling of an oncoming vehicle that drifts to the right; `None` for others.
    pub(crate) fn of_stray(
        route: &Route,
        FrenetPoint { s_m, d_m }: FrenetPoint,
        width_m: f64,
        [along_mps, left_mps]: [f64; 2],
    ) -> Option<Self> {
        let (lane_m, ground_m) = (route.lane().left_m(s_m), route.left_m(s_m));
        let strays = along_mps < 0.0 && left_mps < 0.0 && d_m > 0.0 && lane_m < ground_m;
        if !strays {
            return None;
        }
        let beside_m = (d_m - 0.5 * width_m - lane_m).max(0.0);
        let right_max_m = beside_m + left_mps * left_mps / (2.0 * CORRECTS_MPS2);
        Some(Self { time_s: SETTLES_S.min(right_max_m / -left_mps), most_m: [right_max_m, f64::INFINITY] })
    }

    /// Settling of a vehicle whose settled motion has its side in the ego's lane; `None` for others.
    fn of_merge(
        route: &Route,
        FrenetPoint { s_m, d_m }: FrenetPoint,
        width_m: f64,
        [along_mps, left_mps]: [f64; 2],
    ) -> Option<Self> {
        let (border_m, inwards_mps) = if d_m > 0.0 {
            (route.lane().left_m(s_m), -left_mps)
        } else {
            (route.lane().right_m(s_m), left_mps)
        };
        let side_m = d_m.abs() - 0.5 * width_m - inwards_mps * SETTLES_S;
        let merges = along_mps > 0.0
            && inwards_mps > MERGES_MPS
            && d_m.abs() > 0.5 * border_m
            && side_m < border_m - OVER_LINE_M;
        merges.then_some(Self { time_s: f64::INFINITY, most_m: [d_m.max(0.0), (-d_m).max(0.0)] })
    }

    /// Displacement to the left within `ahead_s`, metres; `free_m` is that of the unsettled motion.
    pub(crate) fn moved_m(&self, free_m: f64, ahead_s: f64) -> f64 {
        if ahead_s <= 0.0 {
            return free_m;
        }
        let settles = self.time_s.is_finite();
        let share =
            if settles { self.time_s / ahead_s * (1.0 - math::exp(-ahead_s / self.time_s)) } else { 1.0 };
        let [right_m, left_m] = self.most_m;
        (share * free_m).clamp(-right_m, left_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use swerve_core::{Span, Time};
    use swerve_geom::Polyline;
    use swerve_map::Borders;
    use swerve_msg::{ActorId, Extent};

    /// A bend to the left of 50 m radius about (0, 50).
    fn bend() -> Route {
        let at = |k: i32| {
            let (sin, cos) = math::sin_cos(0.02 * f64::from(k));
            Point2::new(50.0 * sin, 50.0 - 50.0 * cos)
        };
        Route::uniform(Polyline::new(&(0..=100).map(at).collect::<Vec<_>>()).unwrap(), 6.0, 2.0)
    }

    fn straight(kind: ActorKind, from: Point2, velocity_mps: Vector2) -> Prediction {
        let pose = |k: i64| {
            let at = from + velocity_mps * (0.1 * k as f64);
            let pose = Pose2::new(at.x_m, at.y_m, velocity_mps.heading());
            PredictedPose { at: Time::ZERO + Span::from_secs(0.1) * k, pose }
        };
        let extent = Extent { length_m: 4.5, width_m: 1.8, height_m: 1.5 };
        Prediction::single(ActorId(1), kind, extent, (0..=30).map(pose).collect())
    }

    #[test]
    fn vehicles_keep_their_lane_and_pedestrians_and_crossing_cars_their_line() {
        let route = bend();
        // In the oncoming lane, half way round, along the road and against it.
        let from = route.unproject(FrenetPoint { s_m: 50.0, d_m: 4.0 });
        let along = route.line().at(50.0).pose.direction();
        for (speed_mps, kind) in [(-9.2, ActorKind::Truck), (9.2, ActorKind::Car), (4.6, ActorKind::Cyclist)]
        {
            let mut bent = [straight(kind, from, along * speed_mps)];
            follow(&mut bent, &route);
            for (k, at) in bent[0].path.iter().enumerate() {
                let place = route.project(at.pose.point());
                assert!((place.d_m - 4.0).abs() < 0.02, "{kind:?} {k}: {place:?}");
                // The inner lane has a radius of 46 m: the distance along the line is longer.
                let s_m = 50.0 + speed_mps * 0.1 * k as f64 * 50.0 / 46.0;
                assert!((place.s_m - s_m).abs() < 0.1, "{kind:?} {k}: {place:?}");
                let heading = if speed_mps < 0.0 { along * -1.0 } else { along }.heading();
                assert!(k > 0 || angle_between(at.pose.heading_rad, heading).abs() < 0.01);
            }
        }
        let lines = [
            straight(ActorKind::Pedestrian, from, along * 2.0),
            straight(ActorKind::Car, from, along.left() * -5.0),
            straight(ActorKind::Car, from, along * 0.3),
            straight(ActorKind::Car, route.unproject(FrenetPoint { s_m: 50.0, d_m: -9.0 }), along * 9.0),
        ];
        let mut kept = lines.clone();
        follow(&mut kept, &route);
        assert_eq!(kept, lines);
    }

    /// East to (60, 0), three quarters of a circle to the left, and south across its start at (40, 0).
    #[test]
    fn position_at_a_self_crossing_is_on_the_stretch_of_the_motion() {
        let circle = (0..=47).map(|k| {
            let (sin, cos) = math::sin_cos(0.1 * f64::from(k));
            Point2::new(60.0 + 20.0 * sin, 20.0 - 20.0 * cos)
        });
        let ends = [Point2::new(40.0, 20.0), Point2::new(40.0, -60.0)];
        let points: Vec<Point2> = [Point2::new(0.0, 0.0)].into_iter().chain(circle).chain(ends).collect();
        let route = Route::uniform(Polyline::new(&points).unwrap(), 3.6, 1.8);
        // 1 m from the line of the eastbound stretch, 1.5 m from that of the southbound stretch; driven southbound
        // and northbound.
        let point = Point2::new(41.5, 1.0);
        assert!((route.project(point).s_m - 41.5).abs() < 1e-9);
        for south_mps in [6.0, -6.0] {
            let place = place_of(&route, point, Vector2::new(0.0, -south_mps));
            assert!(place.s_m > 160.0 && (place.d_m - 1.5).abs() < 0.01, "{place:?}");
        }
        // At an angle to both stretches, and at rest: the nearest.
        for velocity_mps in [Vector2::new(5.0, 5.0), Vector2::new(0.0, -0.1)] {
            assert_eq!(place_of(&route, point, velocity_mps), route.project(point));
        }
    }

    /// The distance along the road is that along the straight line, scaled by the arc length at the offset; the
    /// offset is kept.
    #[test]
    fn constant_speed_and_braking_are_bent_along_the_road() {
        let route = bend();
        let from = route.unproject(FrenetPoint { s_m: 50.0, d_m: 4.0 });
        let along = route.line().at(50.0).pose.direction();
        let mut line = [straight(ActorKind::Car, from, along * -9.2)];
        follow(&mut line, &route);
        let start = line[0].path[0].at;
        for one in &line[0].path {
            let place = route.project(one.pose.point());
            let way_m = 9.2 * (one.at - start).as_secs() * 50.0 / 46.0;
            assert!(
                (place.d_m - 4.0).abs() < 0.02 && (50.0 - place.s_m - way_m).abs() < 0.1,
                "{place:?} {way_m}"
            );
        }
        let mut braking = straight(ActorKind::Car, from, along * -9.2);
        for one in &mut braking.path {
            let ahead_s = (one.at - start).as_secs();
            let at = from - along * (9.2 * ahead_s - 1.5 * ahead_s * ahead_s);
            one.pose = Pose2::new(at.x_m, at.y_m, one.pose.heading_rad);
        }
        let mut bent = [braking];
        follow(&mut bent, &route);
        let mut places = bent[0].path.iter().map(|one| route.project(one.pose.point()));
        assert!(places.clone().all(|place| (place.d_m - 4.0).abs() < 0.02));
        let way_m = 50.0 - places.next_back().unwrap().s_m;
        assert!((way_m - (9.2 * 3.0 - 1.5 * 9.0) * 50.0 / 46.0).abs() < 0.1, "{way_m}");
    }

    /// An oncoming car of 2 m width drifts with 1.5 m/s towards the ego's lane of 4 m. Over the line it steers back
    /// with 3 m/s² and settles 1.5² / 6 = 0.375 m further. At 4.5 m its side is 1.5 m beside the line, the distance
    /// of a settling lane change.
    #[test]
    fn oncoming_vehicle_over_the_line_steers_back() {
        let line = Polyline::new(&[Point2::new(0.0, 0.0), Point2::new(200.0, 0.0)]).unwrap();
        let route = Route::uniform(line, 6.0, 2.0).in_lane(Borders::constant(2.0, 2.0));
        let ends = |d_m: f64, along_mps: f64| {
            let velocity_mps = Vector2::new(along_mps, -1.5);
            let mut bent = [straight(ActorKind::Car, Point2::new(100.0, d_m), velocity_mps)];
            bent[0].extent.width_m = 2.0;
            bent[0].path.extend_from_within(30..);
            let last = bent[0].path.last_mut().unwrap();
            last.at = Time::ZERO + Span::from_secs(20.0);
            last.pose = Pose2::new(100.0 + 20.0 * along_mps, d_m - 30.0, last.pose.heading_rad);
            follow(&mut bent, &route);
            bent[0].path[31].pose.y_m
        };
        for (from_m, to_m) in [(2.5, 2.5 - 0.375), (3.0, 3.0 - 0.375), (3.5, 3.0 - 0.375), (4.5, 3.0)] {
            assert!((ends(from_m, -4.0) - to_m).abs() < 1e-6, "{from_m}: {}", ends(from_m, -4.0));
        }
        // To the right of the centre of the ego's lane.
        assert!((ends(-0.5, -4.0) + 2.0).abs() < 1e-6);
        // Along the route: over the line it changes into the ego's lane, beside it (4.5 - 1 - 1.5 = 2 m) it settles.
        assert!(ends(3.0, 4.0).abs() < 1e-6 && (ends(4.5, 4.0) - 3.0).abs() < 1e-6);
    }

    /// From the edge, 2.6 m to the right of the line, with 0.5 m/s to the left: the side of a car of 2 m is in the
    /// lane.
    #[test]
    fn vehicle_that_pulls_out_continues_to_the_centre_of_the_lane() {
        let line = Polyline::new(&[Point2::new(0.0, 0.0), Point2::new(200.0, 0.0)]).unwrap();
        let route = Route::uniform(line, 6.0, 4.0).in_lane(Borders::constant(2.0, 2.0));
        let offset_m = |kind: ActorKind, left_mps: f64, k: usize| {
            let mut bent = [straight(kind, Point2::new(50.0, -2.6), Vector2::new(4.0, left_mps))];
            bent[0].extent.width_m = 2.0;
            follow(&mut bent, &route);
            bent[0].path[k].pose.y_m
        };
        for k in 0..=30 {
            assert!((offset_m(ActorKind::Car, 0.5, k) - (-2.6 + 0.05 * k as f64)).abs() < 1e-9, "{k}");
        }
        // It does not pass the centre; at a lower speed, and for a cyclist, the lateral motion settles.
        assert!(offset_m(ActorKind::Car, 1.0, 30).abs() < 1e-9);
        assert!(offset_m(ActorKind::Car, 0.25, 30) < -2.35 && offset_m(ActorKind::Cyclist, 0.5, 30) < -2.1);
    }

    #[test]
    fn lane_change_settles() {
        let route = bend();
        let at = route.line().at(10.0).pose;
        let mut bent =
            [straight(ActorKind::Car, at.point(), at.direction() * 10.0 + at.direction().left() * 2.0)];
        follow(&mut bent, &route);
        let last = route.project(bent[0].path[30].pose.point());
        assert!((1.8..2.0).contains(&last.d_m), "2 m/s that die away within a second: {last:?}");
    }
}
