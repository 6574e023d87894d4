//! Prediction in road coordinates, for predictors without road geometry.
//!
//! In a bend, a straight line crosses the lanes beside a car's own, and a filter that has observed the turning car
//! predicts that it leaves the bend on a tangent. Both are artefacts of map coordinates. In road coordinates (Frenet:
//! arc length and offset, as Werling et al. 2010, section II), a road user that keeps its lane moves straight, and
//! every predictor gives this the weight of straight motion.

use swerve_core::Time;
use swerve_geom::{FrenetPoint, Point2, Pose2, Vector2, angle_between, math};
use swerve_msg::{ActorKind, PredictedPose, Prediction, Route, Sighting, Track, TrackList};

use super::straight::VELOCITY_WINDOW_S;
use super::{Modes, Tracked, seen};
use crate::linear::{self, Braking};
use crate::road::{Settling, is_on, place_of, share_along, turned};

/// Smallest range along the road's line in which the previous sighting is searched for, metres.
const NEAR_M: f64 = 5.0;
/// Lower bound of the length at an offset per metre of the road's line: near the centre of a bend there is no motion
/// along it.
const SHARE_MIN: f64 = 0.1;

/// Modes of each road user by `predict`, made on the straightened road for road users that drive along `route`. With `keeps_speed`,
/// for constant-speed predictors, braking vehicles brake to a stop. The second result is true if all modes are kept.
pub(super) fn predictions(
    tracks: &TrackList,
    route: &Route,
    keeps_speed: bool,
    predict: impl Fn(&TrackList) -> Vec<Modes>,
) -> (Vec<Modes>, bool) {
    let drives: Vec<bool> = seen(tracks).iter().map(|seen| drives_along(seen, tracks.stamp, route)).collect();
    if !drives.contains(&true) {
        return (predict(tracks), true);
    }
    let straightened = TrackList {
        stamp: tracks.stamp,
        tracks: tracks
            .tracks
            .iter()
            .filter(|track| track.is_plausible())
            .map(|track| straightened(track, route))
            .collect(),
    };
    let mut along = predict(&straightened);
    // Positions far inside a bend can become implausible.
    if along.len() != drives.len() {
        return (predict(tracks), true);
    }
    let mut are_kept = true;
    let all = along.iter_mut().zip(&straightened.tracks).zip(&drives);
    for ((modes, track), _) in all.filter(|(_, drives)| **drives) {
        let braking = Braking::of(track, tracks.stamp, linear::Params::default().brake_window_s);
        if let Some(braking) = braking.filter(|_| keeps_speed) {
            modes.iter_mut().for_each(|mode| brake(mode, &braking));
        }
        are_kept &= !leave_out_off_road(modes, route);
        modes.iter_mut().for_each(|mode| bend(mode, route));
    }
    if drives.contains(&false) {
        let others = predict(tracks).into_iter().zip(&mut along).zip(&drives);
        others.filter(|(_, drives)| !**drives).for_each(|((other, modes), _)| *modes = other);
    }
    (along, are_kept)
}

/// Returns true for a vehicle that moves along the road, in either direction.
fn drives_along(seen: &Tracked, stamp: Time, route: &Route) -> bool {
    let velocity_mps = seen.past.velocity_mps(VELOCITY_WINDOW_S);
    let place = place_of(route, seen.past.now(stamp, velocity_mps), velocity_mps);
    seen.past.kind != ActorKind::Pedestrian && share_along(route, place, velocity_mps).is_some()
}

/// A track in road coordinates: arc length as x, offset as y.
fn straightened(track: &Track, route: &Route) -> Track {
    let place = place_of(route, track.pose.point(), track.velocity_mps);
    let beside = route.line().at(place.s_m);
    let velocity_mps: Vector2 = track.velocity_mps;
    let share = (1.0 - beside.curvature_1pm * place.d_m).max(SHARE_MIN);
    let forwards = beside.pose.direction();
    let mut near_m = place.s_m;
    let mut after = track.pose.point();
    let at = |sighting: &Sighting| {
        let reach_m = 2.0 * after.distance(sighting.point) + NEAR_M;
        let place = route.project_near(sighting.point, near_m, reach_m);
        (near_m, after) = (place.s_m, sighting.point);
        Sighting { at: sighting.at, point: Point2::new(place.s_m, place.d_m) }
    };
    let mut history: Vec<Sighting> = track.history.iter().rev().map(at).collect();
    history.reverse();
    Track {
        pose: Pose2::new(
            place.s_m,
            place.d_m,
            angle_between(beside.pose.heading_rad, track.pose.heading_rad),
        ),
        velocity_mps: Vector2::new(velocity_mps.dot(forwards) / share, velocity_mps.dot(forwards.left())),
        history,
        ..track.clone()
    }
}

/// Removes modes that leave the road's ground, unless all do; the others share their probability. Returns true if any
/// were removed.
fn leave_out_off_road(modes: &mut Modes, route: &Route) -> bool {
    let is_on = |one: &PredictedPose| {
        let Pose2 { x_m: s_m, y_m: d_m, .. } = one.pose;
        is_on(route, FrenetPoint { s_m, d_m })
    };
    let stays: Vec<bool> = modes.iter().map(|mode| mode.path.iter().all(is_on)).collect();
    let left: f64 =
        modes.iter().zip(&stays).filter(|(_, stays)| **stays).map(|(mode, _)| mode.probability).sum();
    if left <= 0.0 || !stays.contains(&false) {
        return false;
    }
    let mut stays = stays.into_iter();
    modes.retain(|_| stays.next() == Some(true));
    modes.iter_mut().for_each(|mode| mode.probability /= left);
    true
}

/// Limits a mode on the straightened road to the distance of continued braking.
fn brake(mode: &mut Prediction, braking: &Braking) {
    let [first, .., last] = &mode.path[..] else { return };
    let (from, backwards) = (first.at, last.pose.x_m < first.pose.x_m);
    for one in &mut mode.path {
        let braked_m = braking.at((one.at - from).as_secs()).x_m;
        one.pose.x_m = if backwards { one.pose.x_m.max(braked_m) } else { one.pose.x_m.min(braked_m) };
    }
}

/// Transforms a mode from the straightened road to the map. The lateral speed decays as in [`crate::road`].
fn bend(mode: &mut Prediction, route: &Route) {
    let [first, second, ..] = mode.path[..] else { return };
    let first_s = (second.at - first.at).as_secs();
    let moves = |from: f64, to: f64| (to - from) / first_s;
    let first_mps = [moves(first.pose.x_m, second.pose.x_m), moves(first.pose.y_m, second.pose.y_m)];
    let place = FrenetPoint { s_m: first.pose.x_m, d_m: first.pose.y_m };
    let settling = Settling::of(route, place, (mode.kind, mode.extent.width_m), first_mps);
    for (one, covariance_m2) in mode.path.iter_mut().zip(&mut mode.covariances_m2) {
        let ahead_s = (one.at - first.at).as_secs();
        let s_m = one.pose.x_m;
        let d_m = first.pose.y_m + settling.moved_m(one.pose.y_m - first.pose.y_m, ahead_s);
        let at = route.unproject(FrenetPoint { s_m, d_m });
        let road_rad = route.line().at(s_m).pose.heading_rad;
        let turned_rad = if math::cos(first.pose.heading_rad) < 0.0 { core::f64::consts::PI } else { 0.0 };
        one.pose = Pose2::new(at.x_m, at.y_m, road_rad + turned_rad);
        *covariance_m2 = turned(*covariance_m2, road_rad);
    }
}

#[cfg(test)]
mod tests;
