//! Closed-loop drives of the comfort layer alone among scripted vehicles: the ego follows its plans, each 50 ms late.

use swerve_core::{Span, Time};
use swerve_geom::{Point2, Polyline, Pose2, Vector2};
use swerve_map::Borders;
use swerve_msg::{ActorId, ActorKind, EgoState, Extent, Plan, PlanStatus, PredictedPose, Prediction, Route};
use swerve_vehicle::{Limits, Shape};

use super::{Comfort, Manner, Params};
use crate::collision::CollisionMode;
use crate::request::{Budget, Planner, Request, Unlimited};
use crate::testing::{braking_m, least_braking_mps2};

mod hidden;
mod overtaking;
mod tight;

/// Velocities are measured over this time, seconds; further beside the road than this nobody is seen, metres.
const MEASURED_S: f64 = 0.3;
const OUT_OF_SIGHT_M: f64 = 100.0;

/// Planning period, seconds.
const PERIOD_S: f64 = 0.05;

/// A scripted road user: position and velocity over time.
type Script<'a> = &'a dyn Fn(f64) -> [f64; 2];

/// Inner planner that never finds a plan, which shows where the layer has none.
struct None_;

impl Planner for None_ {
    fn plan(&mut self, request: &Request<'_>, _: &mut dyn Budget) -> Plan {
        Plan { stamp: request.stamp, status: PlanStatus::GaveUp, ..Plan::default() }
    }
}

/// One instant of a drive.
#[derive(Clone, Copy, Debug)]
struct Instant {
    t_s: f64,
    ego: EgoState,
    status: PlanStatus,
    /// Smallest distance to any road user, metres.
    distance_m: f64,
    /// Gap to the first road user ahead, metres.
    gap_m: f64,
}

/// Drives on a two-lane road along x with lanes 3.5 m wide; the ego starts from `x = 0` at `speed_mps`, among cars.
fn drive(speed_mps: f64, lanes: bool, manner: Manner, others: &[Script<'_>], until_s: f64) -> Vec<Instant> {
    drive_among(ActorKind::Car, speed_mps, lanes, manner, others, until_s)
}

/// As [`drive`], among road users of one kind.
fn drive_among(
    kind: ActorKind,
    speed_mps: f64,
    lanes: bool,
    manner: Manner,
    others: &[Script<'_>],
    until_s: f64,
) -> Vec<Instant> {
    let ego = EgoState { speed_mps, ..EgoState::default() };
    let ground_m = [if lanes { 5.25 } else { 1.75 }, 1.75];
    drive_from(ego, speed_mps, (ground_m, manner), (kind, others), until_s)
}

/// As [`drive_among`], from any state, towards a target speed, on ground with the given extent to the left and right.
fn drive_from(
    ego: EgoState,
    target_speed_mps: f64,
    ground: ([f64; 2], Manner),
    others: (ActorKind, &[Script<'_>]),
    until_s: f64,
) -> Vec<Instant> {
    drive_within(f64::INFINITY, ego, target_speed_mps, ground, others, until_s)
}

/// As [`drive_from`], with a limit on the overtaking distance over the line.
fn drive_within(
    overtake_max_m: f64,
    ego: EgoState,
    target_speed_mps: f64,
    (ground_m, manner): ([f64; 2], Manner),
    others: (ActorKind, &[Script<'_>]),
    until_s: f64,
) -> Vec<Instant> {
    drive_by(layer(manner), overtake_max_m, ego, target_speed_mps, ground_m, others, until_s)
}

/// The layer alone, with default parameters.
fn layer(manner: Manner) -> Comfort {
    Comfort::new(Params::default(), CollisionMode::MayStop, manner, Box::new(None_)).unwrap()
}

/// As [`drive_within`], by a given layer.
fn drive_by(
    mut comfort: Comfort,
    overtake_max_m: f64,
    mut ego: EgoState,
    target_speed_mps: f64,
    [left_m, right_m]: [f64; 2],
    (kind, others): (ActorKind, &[Script<'_>]),
    until_s: f64,
) -> Vec<Instant> {
    let line = Polyline::new(&[Point2::new(-50.0, 0.0), Point2::new(800.0, 0.0)]).unwrap();
    let route = Route::uniform(line, left_m, right_m).in_lane(Borders::constant(1.75, 1.75));
    let (shape, limits) = (Shape::default(), Limits::default());
    let mut previous: Option<Plan> = None;
    let mut drive = Vec::new();
    for k in 0..(until_s / PERIOD_S) as i64 {
        let now = Time::ZERO + Span::from_secs(PERIOD_S) * k;
        let t_s = now.as_secs();
        let place = |plan: &Plan, at: Time| plan.at(at).filter(|_| plan.points[0].at <= at);
        let moved = |ego: EgoState, at: Time| match previous.as_ref().and_then(|plan| place(plan, at)) {
            Some(p) => EgoState {
                stamp: at,
                pose: p.pose,
                speed_mps: p.speed_mps,
                accel_mps2: p.accel_mps2,
                yaw_rate_radps: p.speed_mps * p.curvature_1pm,
                ..ego
            },
            None => EgoState {
                stamp: at,
                pose: ego.pose.ahead((at - ego.stamp).as_secs() * ego.speed_mps),
                ..ego
            },
        };
        ego = moved(ego, now);
        let bodies: Vec<_> = others.iter().map(|script| extent(kind).footprint(pose(*script, t_s))).collect();
        let own = shape.footprint(ego.pose);
        let distance_m = bodies.iter().map(|body| own.distance(body)).fold(f64::INFINITY, f64::min);
        let gap_m = bodies
            .first()
            .map_or(f64::INFINITY, |b| b.center.x_m - b.half_length_m - own.center.x_m - own.half_length_m);
        let predictions: Vec<Prediction> = others
            .iter()
            .enumerate()
            .filter(|(_, script)| script(t_s - MEASURED_S)[1].abs() < OUT_OF_SIGHT_M)
            .map(|(id, script)| predicted((id as u32 + 1, kind), *script, t_s, now))
            .collect();
        let moves = |script: &Script<'_>, t_s: f64| {
            let (before, now) = (script((t_s - PERIOD_S).max(0.0)), script(t_s));
            (now[0] - before[0]).abs() + (now[1] - before[1]).abs() > PERIOD_S
        };
        let changes = |script: &Script<'_>| {
            let mut lately = (0..60).map(|k| t_s - f64::from(k) * PERIOD_S).take_while(|t_s| *t_s > 0.0);
            lately.any(|then_s| moves(script, then_s) != moves(script, t_s))
        };
        let changed_lately: Vec<ActorId> =
            (1..).zip(others).filter(|(_, script)| changes(script)).map(|(id, _)| ActorId(id)).collect();
        let start = moved(ego, now + Span::from_secs(PERIOD_S));
        let request = Request {
            stamp: now,
            start,
            along_m: None,
            route: &route,
            target_speed_mps,
            overtake_max_m,
            changed_lately: &changed_lately,
            predictions: &predictions,
            shape: &shape,
            limits: &limits,
            previous: previous.as_ref(),
            seed: 1,
        };
        let plan = comfort.plan(&request, &mut Unlimited::default());
        drive.push(Instant { t_s, ego, status: plan.status, distance_m, gap_m });
        if plan.points.is_empty() || distance_m <= 0.0 {
            break;
        }
        previous = Some(plan);
    }
    drive
}

fn extent(kind: ActorKind) -> Extent {
    let (length_m, width_m) = match kind {
        ActorKind::Pedestrian => (0.5, 0.5),
        ActorKind::Cyclist => (1.8, 0.6),
        // Across both lanes.
        ActorKind::Static => (0.5, 20.0),
        _ => (4.5, 1.8),
    };
    Extent { length_m, width_m, height_m: 1.5 }
}

fn pose(script: Script<'_>, t_s: f64) -> Pose2 {
    let ([x, y], [ahead_x, ahead_y]) = (script(t_s), script(t_s + 0.01));
    let way: Vector2 = Point2::new(ahead_x, ahead_y) - Point2::new(x, y);
    Pose2::new(x, y, if way.norm() > 1e-4 { way.heading() } else { 0.0 })
}

/// Prediction that continues with the mean velocity and deceleration of the last 0.3 s.
fn predicted((id, kind): (u32, ActorKind), script: Script<'_>, t_s: f64, now: Time) -> Prediction {
    let at = |t_s: f64| {
        let [x, y] = script(t_s);
        Point2::new(x, y)
    };
    let speed = |from: f64, to: f64| at(to).distance(at(from)) / (to - from);
    let (before, last) =
        (speed(t_s - MEASURED_S, t_s - 0.5 * MEASURED_S), speed(t_s - 0.5 * MEASURED_S, t_s));
    let accel_mps2 = ((last - before) / (0.5 * MEASURED_S)).min(0.0);
    let accel_mps2 = if accel_mps2 > -0.5 { 0.0 } else { accel_mps2 };
    let speed_mps = (last + 0.25 * MEASURED_S * accel_mps2).max(0.0);
    let stop_s = if accel_mps2 < 0.0 { -speed_mps / accel_mps2 } else { f64::INFINITY };
    let from = pose(script, t_s - 0.01);
    let (direction, at) = (from.direction(), at(t_s));
    let path = (0..=50).map(|k| {
        let ahead_s = (0.1 * f64::from(k)).min(stop_s);
        let point = at + direction * (speed_mps * ahead_s + 0.5 * accel_mps2 * ahead_s * ahead_s);
        PredictedPose {
            at: now + Span::from_secs(0.1 * f64::from(k)),
            pose: Pose2::new(point.x_m, point.y_m, from.heading_rad),
        }
    });
    Prediction::single(ActorId(id), kind, extent(kind), path.collect())
}

const MANNERS: [Manner; 3] =
    [Manner::Waits, Manner::GoesRound, Manner::KeepsAway { weight_obstacle: 100.0, time_step_s: 0.3 }];

/// Time to detect that a lead brakes, to plan, and to build up the deceleration, seconds.
const REACTION_S: f64 = 0.7;

/// Drives behind a lead vehicle that brakes to a stop: no collision, and the ego brakes little harder than the
/// necessary minimum.
fn lead_brakes(speeds_mps: &[f64], brakes_mps2: &[f64], gaps_s: &[f64]) {
    let mut wrong = Vec::new();
    for manner in MANNERS {
        for &speed_mps in speeds_mps {
            for (&brake_mps2, &gap_s) in brakes_mps2.iter().flat_map(|b| gaps_s.iter().map(move |g| (b, g))) {
                let gap_m = (gap_s * speed_mps).max(2.5);
                let shape = Shape::default();
                let from_m = gap_m + shape.length_m - shape.rear_overhang_m + 2.25;
                let lead = |t_s: f64| [from_m + braking_m(speed_mps, brake_mps2, 1.0, t_s), 0.0];
                let until_s = 1.0 + 2.0 * speed_mps / brake_mps2.min(1.3) + 5.0;
                let drive = drive(speed_mps, false, manner, &[&lead], until_s);
                let last = drive.last().unwrap();
                let hardest = drive.iter().map(|i| -i.ego.accel_mps2).fold(0.0, f64::max);
                let nearest = drive.iter().map(|i| i.gap_m).fold(f64::INFINITY, f64::min);
                // If the standstill gap requires more than comfort, it may be reduced to a metre.
                let [least, touching] = [2.0, 1.0]
                    .map(|rest_m| least_braking_mps2(speed_mps, brake_mps2, gap_m, REACTION_S, rest_m));
                let allowed = least.clamp(1.3, 8.0) + 1.0;
                let needed_m = if least <= 3.5 {
                    1.9
                } else if touching < 7.5 {
                    0.5
                } else {
                    0.0
                };
                if hardest > allowed || nearest < needed_m || last.ego.speed_mps > 0.01 || last.gap_m > 4.0 {
                    wrong.push(format!(
                        "{manner:?} {speed_mps} m/s, {brake_mps2} m/s2, {gap_s} s: brakes {hardest:.2} of {least:.2}, \
                         nearest {nearest:.2}, ends {:.2} at {:.2} m/s, {:?} at {:.1}",
                        last.gap_m, last.ego.speed_mps, last.status, last.t_s
                    ));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{} of them:\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn braking_leads_need_no_more_than_the_minimum_deceleration() {
    lead_brakes(&[5.0, 14.0, 30.0], &[1.0, 2.0, 5.0, 8.0], &[0.8, 1.5, 3.0]);
}

#[test]
#[ignore = "a minute: the whole table"]
fn braking_leads_need_no_more_than_the_minimum_deceleration_whole() {
    let brakes: Vec<f64> = (1..=8).map(f64::from).collect();
    lead_brakes(&[5.0, 8.0, 11.0, 14.0, 18.0, 22.0, 26.0, 30.0], &brakes, &[0.8, 1.2, 1.5, 2.0, 2.5, 3.0]);
}

/// Largest deceleration, m/s².
fn hardest_mps2(drive: &[Instant]) -> f64 {
    drive.iter().map(|i| -i.ego.accel_mps2).fold(0.0, f64::max)
}

/// Time during which the ego's left side is over the line, seconds, and largest overlap, metres.
fn over_line(drive: &[Instant]) -> (f64, f64) {
    let left_m = |i: &Instant| i.ego.pose.y_m + 0.5 * Shape::default().width_m - 1.75;
    let over = drive.iter().filter(|i| left_m(i) > 0.1).count();
    (over as f64 * PERIOD_S, drive.iter().map(left_m).fold(0.0, f64::max))
}

#[test]
fn a_lead_is_followed_with_the_time_gap() {
    for manner in MANNERS {
        // 2 m/s slower than the target speed: not enough to use the other lane.
        let lead = |t_s: f64| [20.0 + 12.0 * t_s, 0.0];
        let drive = drive(14.0, true, manner, &[&lead], 30.0);
        let last = drive.last().unwrap();
        assert!((last.gap_m - (2.0 + 1.5 * 12.0)).abs() < 1.0, "{manner:?} {last:?}");
        assert!(hardest_mps2(&drive) < 2.0 && over_line(&drive).0 == 0.0, "{manner:?}");
    }
}

#[test]
fn obstacle_that_closes_the_road_is_braked_for_steadily_from_first_sight() {
    // At first sight 23^2 / (2 * (D - 2)) suffices, and the deceleration takes 0.3 to 0.9 s to build up, a distance of
    // 3 to 10 m: one stop line within comfort, and two that need more. Never more than 0.8 m/s2 beyond that, and never
    // released on the way.
    for manner in MANNERS {
        for needed_mps2 in [3.0_f64, 4.0, 5.0] {
            let front_m = Shape::default().length_m - Shape::default().rear_overhang_m;
            let at_m = 23.0 * 23.0 / (2.0 * needed_mps2) + 2.0 + front_m + 0.25;
            let wall = |_: f64| [at_m, 0.0];
            let drive = drive_among(ActorKind::Static, 23.0, true, manner, &[&wall], 15.0);
            let last = drive.last().unwrap();
            let hardest = hardest_mps2(&drive);
            assert!(hardest < needed_mps2 + 0.8, "{manner:?} {needed_mps2}: {hardest}");
            let braking = drive.iter().filter(|i| (1.2..3.5).contains(&i.t_s));
            let weakest = braking.map(|i| -i.ego.accel_mps2).fold(f64::INFINITY, f64::min);
            assert!(weakest > needed_mps2 - 0.5, "{manner:?} {needed_mps2}: {weakest}");
            assert!(last.ego.speed_mps < 0.01 && (0.9..4.0).contains(&last.gap_m), "{manner:?} {last:?}");
        }
    }
}

#[test]
fn a_gap_behind_a_cut_in_opens_over_seconds() {
    // From the adjacent lane, 9 m ahead, at the ego's speed: no immediate reaction is needed.
    for manner in MANNERS {
        let cutter = |t_s: f64| [17.0 + 12.0 * t_s, (3.5 - 1.75 * (t_s - 1.0).max(0.0)).max(0.0)];
        let drive = drive(12.0, true, manner, &[&cutter], 20.0);
        assert!(hardest_mps2(&drive) < 1.5, "{manner:?} {}", hardest_mps2(&drive));
        assert!(drive.last().unwrap().gap_m > 17.0, "{manner:?} {:?}", drive.last());
    }
}

#[test]
fn road_user_approaching_from_behind_is_not_braked_for() {
    for manner in MANNERS {
        let behind = |t_s: f64| [-30.0 + 16.0 * t_s, 0.0];
        let drive = drive(14.0, false, manner, &[&behind], 25.0);
        assert!(hardest_mps2(&drive) < 0.1 && drive.iter().all(|i| i.distance_m > 1.0), "{manner:?}");
    }
}

#[test]
fn a_blocked_lane_is_passed_when_the_other_is_free() {
    let truck = |_: f64| [120.0, 0.0];
    let oncoming = |t_s: f64| [260.0 - 12.0 * t_s, 3.5];
    for manner in &MANNERS[1..] {
        let free = drive(14.0, true, *manner, &[&truck], 20.0);
        let (over_s, over_m) = over_line(&free);
        // Half the truck, the clearance and the ego's width: 0.9 + 0.5 + 1.86 m from the centre, 1.51 m over the line.
        assert!(over_s < 6.0 && over_m < 1.51 + 0.5, "{manner:?} {over_s} {over_m}");
        assert!(free.iter().all(|i| i.distance_m > 0.4 && i.ego.speed_mps > 13.0), "{manner:?}");
        assert!(free.last().unwrap().ego.pose.x_m > 200.0);

        // They would meet beside the truck: the ego waits where it can steer out until the other vehicle has passed.
        let busy = drive(14.0, true, *manner, &[&truck, &oncoming], 35.0);
        assert!(busy.iter().all(|i| i.distance_m > 0.4), "{manner:?}");
        let met = busy.iter().find(|i| oncoming(i.t_s)[0] < i.ego.pose.x_m + 4.0).unwrap();
        let waits = |i: &&Instant| i.t_s < met.t_s;
        assert!(busy.iter().filter(waits).all(|i| i.ego.pose.y_m < 0.82 && i.gap_m > 6.5), "{manner:?}");
        assert!(busy.last().unwrap().ego.pose.x_m > 200.0, "{manner:?}");
    }
}

#[test]
fn a_slow_lead_is_overtaken_only_while_the_other_lane_is_free() {
    let slow = |t_s: f64| [40.0 + 6.0 * t_s, 0.0];
    // A column of oncoming cars, 60 m apart, until 25 s.
    let column: Vec<_> =
        (0..12).map(|k| move |t_s: f64| [80.0 + 60.0 * f64::from(k) - 14.0 * t_s, 3.5]).collect();
    for manner in &MANNERS[1..] {
        let free = drive(14.0, true, *manner, &[&slow], 20.0);
        assert!(free.last().unwrap().gap_m < -20.0 && over_line(&free).0 < 9.0, "{manner:?}");
        let mut others: Vec<Script<'_>> = vec![&slow];
        others.extend(column.iter().map(|one| one as Script<'_>));
        let busy = drive(14.0, true, *manner, &others, 20.0);
        assert!(over_line(&busy).0 == 0.0 && hardest_mps2(&busy) < 3.0, "{manner:?} {:?}", over_line(&busy));
        assert!(busy.last().unwrap().gap_m > 9.0, "{manner:?}");
    }
}

#[test]
fn a_crossing_car_is_braked_for_in_the_lane() {
    for manner in MANNERS {
        // In the ego's path from 6 s to 7.5 s; an ego at 14 m/s would arrive after 7 s.
        let crosser = |t_s: f64| [100.0, 40.0 - 6.0 * t_s];
        let drive = drive(14.0, true, manner, &[&crosser], 15.0);
        assert!(drive.iter().all(|i| i.distance_m > 0.4), "{manner:?}");
        assert!(over_line(&drive).0 == 0.0 && hardest_mps2(&drive) < 3.7, "{manner:?}");
    }
}

/// Position along the road for speeds that change at `mps2` from one to the next, each held from its instant on,
/// metres.
fn at_speeds_m(speeds: &[(f64, f64)], mps2: f64, t_s: f64) -> f64 {
    let mut way_m = 0.0;
    for (k, &(from_s, speed_mps)) in speeds.iter().enumerate() {
        let until_s = speeds.get(k + 1).map_or(f64::INFINITY, |next| next.0).min(t_s);
        if until_s <= from_s {
            break;
        }
        let before_mps = if k == 0 { speed_mps } else { speeds[k - 1].1 };
        let changes_s = ((speed_mps - before_mps).abs() / mps2).min(until_s - from_s);
        let reached_mps = before_mps + (speed_mps - before_mps).signum() * mps2 * changes_s;
        way_m += 0.5 * (before_mps + reached_mps) * changes_s + speed_mps * (until_s - from_s - changes_s);
    }
    way_m
}

#[test]
fn pass_of_a_vehicle_that_speeds_up_is_aborted_gently() {
    // From 5 m/s to 16 m/s, which is more than the ego's target, before the two are level: the pass cannot be
    // completed. Falling back by both lengths and a gap, 12 m, at 2 to 3 m/s less takes 5 s: within comfort at all
    // times.
    let mut wrong = Vec::new();
    for manner in &MANNERS[1..] {
        for from_s in [2.0, 2.5, 3.0] {
            let lead = |t_s: f64| [40.0 + at_speeds_m(&[(0.0, 5.0), (from_s, 16.0)], 3.0, t_s), 0.0];
            let drive = drive(14.0, true, *manner, &[&lead], 25.0);
            let (hardest, last) = (hardest_mps2(&drive), drive.last().unwrap());
            let nearest = drive.iter().map(|i| i.distance_m).fold(f64::INFINITY, f64::min);
            if hardest > 3.6 || nearest < 0.4 || last.gap_m < 2.0 || last.ego.pose.y_m > 0.2 {
                wrong.push(format!(
                    "{manner:?} {from_s}: brakes {hardest:.2}, nearest {nearest:.2}, ends {last:?}"
                ));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn vehicle_that_brakes_is_not_passed_before_it_stands() {
    // It brakes at 2 m/s2 from 1 s to 7 s and stops 52 m further on; the ego, 30 m behind it, needs 12^2 / (2 * (30 +
    // 12 + 36 - 7)), 1 m/s2, and waits where it can steer out.
    let lead = |t_s: f64| [34.0 + braking_m(12.0, 2.0, 1.0, t_s), 0.0];
    for manner in &MANNERS[1..] {
        let drive = drive(12.0, true, *manner, &[&lead], 25.0);
        let braking = drive.iter().filter(|i| i.t_s < 6.8);
        assert!(braking.clone().all(|i| i.ego.pose.y_m < 0.82), "{manner:?} {:?}", over_line(&drive));
        assert!(hardest_mps2(&drive) < 2.6, "{manner:?} {}", hardest_mps2(&drive));
        assert!(drive.last().unwrap().gap_m < -10.0, "{manner:?} {:?}", drive.last());
    }
}

/// Speed of the ego beside the first road user, m/s, and smallest distance to any road user, metres.
fn passes(drive: &[Instant]) -> (f64, f64) {
    let beside = drive.iter().find(|i| i.gap_m < -2.0).map_or(f64::INFINITY, |i| i.ego.speed_mps);
    (beside, drive.iter().map(|i| i.distance_m).fold(f64::INFINITY, f64::min))
}

#[test]
fn cyclist_is_passed_at_a_metre_and_a_half_where_the_road_has_the_room() {
    for manner in &MANNERS[1..] {
        let cyclist = |t_s: f64| [40.0 + 5.0 * t_s, -1.2];
        let wide = drive_among(ActorKind::Cyclist, 13.0, true, *manner, &[&cyclist], 20.0);
        let (_, nearest_m) = passes(&wide);
        assert!(nearest_m > 1.4 && wide.last().unwrap().gap_m < -20.0, "{manner:?} {nearest_m}");
        // A single lane: 1.75 + 0.9 - 1.86 m leave 0.79 m of room. The ego stays behind.
        let narrow = drive_among(ActorKind::Cyclist, 13.0, false, *manner, &[&cyclist], 30.0);
        let end = narrow.last().unwrap();
        assert!(end.gap_m > 4.0 && end.gap_m < 15.0 && hardest_mps2(&narrow) < 3.6, "{manner:?} {end:?}");
        assert!((end.ego.speed_mps - 5.0).abs() < 0.3, "{manner:?} {end:?}");
        // With a sixth of it outside the lane, 1.29 m are left: the ego uses as much as it can, and slows down.
        let at_edge = |t_s: f64| [40.0 + 5.0 * t_s, -1.7];
        let narrow = drive_among(ActorKind::Cyclist, 13.0, false, *manner, &[&at_edge], 30.0);
        let (speed_mps, nearest_m) = passes(&narrow);
        assert!(nearest_m > 1.0 && speed_mps < 12.0, "{manner:?} {nearest_m} {speed_mps}");
        assert!(narrow.last().unwrap().gap_m < -10.0 && hardest_mps2(&narrow) < 2.6, "{manner:?}");
    }
}

#[test]
fn standing_pedestrian_in_the_lane_is_passed_slowly_and_with_a_step_to_spare() {
    for manner in &MANNERS[1..] {
        // She faces the side on which the ego passes, or the other one. The ego moves out to 4 m at most: 4 - 0.93 -
        // 0.45 m are 2.62 m, of which 0.3 m are reserved.
        for (faces, needed_m) in [(1.0, 2.2 - 0.1), (-1.0, 1.4)] {
            let person = |t_s: f64| [80.0, 0.2 + 0.011 * faces * t_s];
            let drive = drive_among(ActorKind::Pedestrian, 12.0, true, *manner, &[&person], 30.0);
            let (speed_mps, nearest_m) = passes(&drive);
            assert!(nearest_m > needed_m && speed_mps < 7.0, "{manner:?} {faces} {nearest_m} {speed_mps}");
            assert!(drive.last().unwrap().gap_m < -10.0, "{manner:?} {faces} {:?}", drive.last());
        }
    }
}

/// A pedestrian of half a metre faces the lane, whose border is at -1.75 m, 80 m ahead. On an otherwise empty road the
/// ego moves out to 0.75 m, its side to -0.18 m. With a fifth of her width in the lane, the speed drops by a fifth of
/// the way from 14 to 5.5 m/s.
#[test]
fn pedestrian_at_the_edge_of_the_lane_is_passed_more_slowly_the_more_she_is_inside() {
    for manner in &MANNERS[1..] {
        let cases = [
            (2.3, 1.4, 14.0),
            (2.0, 1.4, 14.0),
            (1.9, 1.3, 12.3),
            (1.8, 1.2, 10.6),
            (1.7, 1.1, 8.9),
            (1.5, 0.9, 5.5),
        ];
        for (right_m, distance_m, speed_mps) in cases {
            let person = |t_s: f64| [80.0, -right_m + 1e-4 * t_s];
            let drive = drive_among(ActorKind::Pedestrian, 14.0, false, *manner, &[&person], 25.0);
            let (beside_mps, nearest_m) = passes(&drive);
            assert!(nearest_m > distance_m, "{manner:?} {right_m} {nearest_m}");
            assert!((beside_mps - speed_mps).abs() < 0.8, "{manner:?} {right_m} {beside_mps}");
            let slowest_mps = drive.iter().map(|i| i.ego.speed_mps).fold(f64::INFINITY, f64::min);
            assert!(slowest_mps > speed_mps - 0.8, "{manner:?} {right_m} {slowest_mps}");
        }
    }
}

#[test]
fn oncoming_car_over_the_line_is_met_on_the_right_and_slower() {
    // It stays 1.7 m beside the ego's line: its side is at 0.8 m, the ego's at 0.93 m. Within the lane the ego can move
    // 1.75 - 0.93 = 0.82 m to the right, of which a decimetre is reserved: 0.6 m remain between the two.
    for manner in &MANNERS[1..] {
        let oncoming = |t_s: f64| [170.0 - 12.0 * t_s, 1.7];
        let drive = drive(13.0, true, *manner, &[&oncoming], 15.0);
        let met = drive.iter().find(|i| oncoming(i.t_s)[0] - 2.25 < i.ego.pose.x_m + 3.9).unwrap();
        assert!(met.ego.pose.y_m < -0.5 && met.ego.speed_mps < 13.0 - 2.0, "{manner:?} {met:?}");
        assert!(passes(&drive).1 > 0.5 && hardest_mps2(&drive) < 3.7, "{manner:?} {:?}", passes(&drive));
        assert!(over_line(&drive).0 == 0.0, "{manner:?}");
        // Then the ego continues.
        let last = drive.last().unwrap().ego;
        assert!(last.pose.y_m.abs() < 0.1 && last.speed_mps > 12.5, "{manner:?} {last:?}");
    }
}
