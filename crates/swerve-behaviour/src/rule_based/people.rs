//! People on crossings, or on the way to them.

use swerve_geom::{Point2, Vector2};
use swerve_map::Crossing;
use swerve_msg::{ActorId, ActorKind, Prediction};
use swerve_road_user::travel::time_s;

use super::block::RouteCrossing;
use super::others::speed_mps;
use super::{Own, RuleBasedParams};
use crate::{Roads, Situation};

/// Distance from a crossing within which somebody who walks towards it is about to use it, metres.
const NEAR_M: f64 = 1.5;
/// Distance beside the ego's flank that is kept clear, metres.
const CLEAR_M: f64 = 1.0;
/// Speed below which a person stands, m/s.
const STANDS_MPS: f64 = 0.2;
/// Additional reserve once the ego waits, seconds.
const HELD_S: f64 = 1.0;

/// Somebody for whom the ego stops before a crossing.
pub(super) fn in_way(
    at: &Situation<'_>,
    roads: Roads<'_>,
    (own, params): (Own, &RuleBasedParams),
    crossing: &RouteCrossing,
    is_held: bool,
) -> Option<ActorId> {
    let outline = roads.map.crossings().get(crossing.index)?;
    let to_m = crossing.at_m[1] - own.center_m + own.half_m;
    let v = own.speed_mps;
    let cruise_mps = own.cruise_mps.min(crossing.cruise_mps);
    let held_s = if is_held { HELD_S } else { 0.0 };
    let until_s =
        params.reaction_s + time_s(to_m, v, cruise_mps, params.gain_mps2) + params.margin_s + held_s;
    let half_width_m = 0.5 * at.shape.width_m + CLEAR_M;
    let is_in_way = |one: &&Prediction| {
        let [first, ..] = &one.path[..] else { return false };
        let point = first.pose.point();
        let velocity = velocity(one);
        let is_on = outline.contains(point);
        if !is_on && !comes(outline, point, velocity) {
            return false;
        }
        let place =
            at.route.project_near(point, crossing.at_m[0], crossing.at_m[1] - crossing.at_m[0] + 20.0);
        let left = at.route.line().at(place.s_m).pose.direction().left();
        // Speed towards the line of the route.
        let nears_mps = -velocity.dot(left) * place.d_m.signum();
        let away_m = (place.d_m.abs() - half_width_m).max(0.0);
        // Somebody who stands on a crossing may go on.
        away_m == 0.0
            || (nears_mps > STANDS_MPS && away_m / nears_mps < until_s)
            || (is_on && velocity.norm() < STANDS_MPS && away_m < NEAR_M)
    };
    let people = at.predictions.iter().filter(|one| one.kind == ActorKind::Pedestrian && one.is_plausible());
    people.filter(is_in_way).map(|one| one.id).next()
}

fn velocity(one: &Prediction) -> Vector2 {
    let [first, next, ..] = &one.path[..] else { return Vector2::new(0.0, 0.0) };
    let way = next.pose.point() - first.pose.point();
    let length_m = way.norm();
    if length_m > 0.0 { way * (speed_mps(one) / length_m) } else { way }
}

/// True if somebody beside a crossing walks onto it.
fn comes(crossing: &Crossing, point: Point2, velocity: Vector2) -> bool {
    let speed_mps = velocity.norm();
    let steps = [0.25, 0.5, 0.75, 1.0].map(|share| share * NEAR_M / speed_mps.max(STANDS_MPS));
    speed_mps > STANDS_MPS && steps.iter().any(|s| crossing.contains(point + velocity * *s))
}
