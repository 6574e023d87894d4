use swerve_geom::{FrenetPoint, Map, Point2, Transform, Vector};
use swerve_msg::truth::{Collision, EgoTruth};
use swerve_msg::{EgoState, Extent};
use swerve_scenario::{Motion, Subject, Trigger};

use super::*;

const MAPS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/maps");
const LIGHT: &str = include_str!("../../../../scenarios/maps/light_red.toml");
const RURAL: &str = include_str!("../../../../scenarios/maps/parked_truck.toml");

fn scenario(text: &str) -> Scenario {
    Scenario::parse(&format!("{MAPS}/posed.toml"), text).unwrap_or_else(|problems| panic!("{problems:#?}"))
}

/// A drive that is stated, not driven: the ego follows its route as the functions below say.
struct Posed<'a> {
    scenario: &'a Scenario,
    /// Arc length from the start at an instant in seconds, metres.
    way_m: &'a dyn Fn(f64) -> f64,
    /// Distance to the left of the route at an arc length from the start, metres.
    left_m: &'a dyn Fn(f64) -> f64,
    actors: &'a dyn Fn(f64) -> Vec<Actor>,
    /// Instant of a contact in seconds, and its party.
    hit: Option<(f64, ActorId)>,
    duration_s: f64,
}

impl<'a> Posed<'a> {
    fn along(scenario: &'a Scenario, way_m: &'a dyn Fn(f64) -> f64) -> Self {
        Self { scenario, way_m, left_m: &|_| 0.0, actors: &|_| Vec::new(), hit: None, duration_s: 60.0 }
    }

    fn scores(&self) -> DrivingScores {
        let shape = Shape::default();
        let route = self.scenario.road.route();
        let mut scored = Scored::new(self.scenario, &route, shape).unwrap();
        let steps = (self.duration_s / 0.01).round() as i64;
        for k in 0..=steps {
            let stamp = Time::from_ms(10 * k);
            scored.take(&self.world(stamp, &route, &shape));
        }
        scored.scores()
    }

    fn world(&self, stamp: Time, route: &Route, shape: &Shape) -> WorldState {
        let at_s = stamp.as_secs();
        let way_m = (self.way_m)(at_s);
        let speed_mps = (way_m - (self.way_m)(at_s - 0.01)) / 0.01;
        let s_m = self.scenario.ego.s_m + way_m;
        let on_line = route.line().at(s_m).pose;
        let center = route.unproject(FrenetPoint { s_m, d_m: (self.left_m)(way_m) });
        let pose = Pose2::new(center.x_m, center.y_m, on_line.heading_rad).ahead(-shape.center_ahead_m());
        let velocity = pose.direction() * speed_mps;
        let hits = self.hit.filter(|(hit_s, _)| (at_s - hit_s).abs() < 1e-6);
        let collision = |(_, other): (f64, ActorId)| Collision {
            stamp,
            parties: [ActorId::EGO, other],
            impulse_n_s: 100.0,
            closing_speed_mps: speed_mps,
            speeds_mps: [speed_mps, 0.0],
        };
        WorldState {
            stamp,
            ego: EgoTruth {
                id: ActorId::EGO,
                map_from_ego: Transform::from_roll_pitch_yaw(
                    swerve_geom::Point::<Map>::new(pose.x_m, pose.y_m, 0.0),
                    0.0,
                    0.0,
                    pose.heading_rad,
                ),
                state: EgoState { stamp, pose, speed_mps, ..EgoState::default() },
                velocity_mps: Vector::new(velocity.x, velocity.y, 0.0),
                specific_force_mps2: Vector::new(0.0, 0.0, 9.81),
                angular_velocity_radps: Vector::new(0.0, 0.0, 0.0),
            },
            actors: (self.actors)(at_s),
            collisions: hits.map(collision).into_iter().collect(),
            infractions: Vec::new(),
            ended: None,
        }
    }
}

fn actor(id: u32, kind: ActorKind, at: Point2, speed_mps: f64) -> Actor {
    let extent = Extent { length_m: 1.0, width_m: 1.0, height_m: 1.8 };
    let velocity_mps = Vector2::new(speed_mps, 0.0);
    Actor { id: ActorId(id), kind, pose: Pose2::new(at.x_m, at.y_m, 0.0), z_m: 0.0, extent, velocity_mps }
}

fn counts(scores: &DrivingScores) -> [swerve_eval::score::leaderboard::Counts; 2] {
    ["1.0", "2.1"].map(|version| scores.leaderboard[version].infractions)
}

/// The stop line is 98 m from the start, and the light is red until 18 s.
#[test]
fn light_counts_once_if_it_is_red_when_the_tail_passes_its_line() {
    let scenario = scenario(LIGHT);
    for (speed_mps, red) in [(10.0, 1), (5.0, 0)] {
        let scores = Posed::along(&scenario, &|at_s| speed_mps * at_s).scores();
        assert_eq!(counts(&scores).map(|counts| counts.red_light), [red, red], "{speed_mps} m/s");
        let second = &scores.leaderboard["2.1"];
        assert_eq!((second.route_completion, second.outside_route_lanes_percent), (100.0, 0.0));
        let wanted = if red == 1 { 100.0 / 1.4 } else { 100.0 };
        assert!((scores.driving_score - wanted).abs() < 1e-4, "{}", scores.driving_score);
    }
}

#[test]
fn contact_counts_once_by_the_kind_of_its_party() {
    let scenario = scenario(RURAL);
    for (kind, wanted) in
        [(ActorKind::Pedestrian, [1, 0, 0]), (ActorKind::Cyclist, [0, 1, 0]), (ActorKind::Static, [0, 0, 1])]
    {
        let route = scenario.road.route();
        // Carried along on the bumper for 3 s.
        let place = |at_s: f64| route.line().at(scenario.ego.s_m + 10.0 * at_s.clamp(5.0, 8.0) + 2.9).pose;
        let actors = |at_s: f64| vec![actor(40, kind, place(at_s).point(), 0.0)];
        let posed = Posed {
            actors: &actors,
            hit: Some((5.0, ActorId(40))),
            ..Posed::along(&scenario, &|at_s| 10.0 * at_s)
        };
        let scores = posed.scores();
        for counts in counts(&scores) {
            let found = [counts.collisions_pedestrian, counts.collisions_vehicle, counts.collisions_layout];
            assert_eq!(found, wanted, "{kind:?}");
        }
        assert!(scores.emergency_s >= 2.0, "{}", scores.emergency_s);
        let nuplan = scores.nuplan.unwrap();
        let kept = if kind == ActorKind::Static { 0.5 } else { 0.0 };
        assert_eq!(nuplan.no_collisions, kept, "{kind:?}");
    }
}

#[test]
fn route_that_ends_half_way_is_half_complete_and_blocked_after_180_s() {
    let scenario = scenario(RURAL);
    let length_m = scenario.ego.end_m - scenario.ego.s_m;
    let way_m = |at_s: f64| (10.0 * at_s).min(0.5 * length_m);
    let scores = Posed { duration_s: 100.0, ..Posed::along(&scenario, &way_m) }.scores();
    let second = &scores.leaderboard["2.1"];
    assert_eq!((second.route_completion, second.status.as_str()), (50.0, "Failed"));
    assert!((scores.leaderboard["1.0"].route_completion - 50.0).abs() < 0.01);
    assert!((scores.route_length_m - length_m).abs() < 1e-9);
    let scores = Posed { duration_s: 220.0, ..Posed::along(&scenario, &way_m) }.scores();
    assert_eq!(scores.leaderboard["2.1"].status, "Failed - Agent got blocked");
}

/// The ego leaves the route to the right at 300 m and stays beside it.
#[test]
fn ego_that_leaves_the_route_by_30_m_has_deviated() {
    let scenario = scenario(RURAL);
    let left_m = |way_m: f64| -(0.5 * (way_m - 300.0)).clamp(0.0, 40.0);
    let scores = Posed { left_m: &left_m, ..Posed::along(&scenario, &|at_s| 10.0 * at_s) }.scores();
    for version in ["1.0", "2.1"] {
        let found = &scores.leaderboard[version];
        assert_eq!(found.status, "Failed - Agent deviated from the route");
        // 60 m after it has left the line, of 540 m.
        assert!((found.route_completion - 360.0 / 540.0 * 100.0).abs() < 2.0, "{}", found.route_completion);
    }
}

#[test]
fn opposite_lane_counts_as_outside_and_the_own_one_does_not() {
    let scenario = scenario(RURAL);
    let length_m = scenario.ego.end_m - scenario.ego.s_m;
    let share = |left_m: f64| {
        let left_m =
            move |way_m: f64| if (100.0..100.0 + 0.1 * length_m).contains(&way_m) { left_m } else { 0.0 };
        let scores = Posed { left_m: &left_m, ..Posed::along(&scenario, &|at_s| 10.0 * at_s) }.scores();
        ["1.0", "2.1"].map(|version| scores.leaderboard[version].outside_route_lanes_percent)
    };
    assert_eq!(share(1.0), [0.0, 0.0]);
    for percent in share(3.5) {
        assert!((percent - 10.0).abs() < 0.2, "{percent}");
    }
}

#[test]
fn speed_is_compared_with_that_of_the_vehicles_of_the_traffic() {
    let text = RURAL.replace("[end]", "[traffic]\nvehicles = 2\npedestrians = 1\n[end]");
    let scenario = scenario(&text);
    let first = scenario.traffic.unwrap().first_id.0;
    let far = Point2::new(0.0, 500.0);
    // The pedestrian and the actor of the scenario do not count.
    let actors = |_: f64| {
        let kinds = [(first - 1, ActorKind::Car, 90.0), (first, ActorKind::Car, 15.0)];
        let rest = [(first + 1, ActorKind::Cyclist, 25.0), (first + 2, ActorKind::Pedestrian, 1.0)];
        kinds.into_iter().chain(rest).map(|(id, kind, mps)| actor(id, kind, far, mps)).collect()
    };
    let scores = Posed { actors: &actors, ..Posed::along(&scenario, &|at_s| 10.0 * at_s) }.scores();
    let percent = &scores.leaderboard["2.1"].min_speed_checkpoints_percent;
    assert_eq!(percent.len(), 4);
    assert!(percent.iter().all(|percent| (percent - 50.0).abs() < 0.2), "{percent:?}");
    assert!(scores.leaderboard["1.0"].min_speed_checkpoints_percent.is_empty());
    assert!(scores.bench2drive.success && scores.bench2drive.driving_score == 100.0);
}

fn routes() -> impl Iterator<Item = (String, Scenario)> {
    (1..=10).map(|k| {
        let file = format!("{MAPS}/../routes/{k:02}.toml");
        (format!("{k:02}"), Scenario::read(std::path::Path::new(&file)).unwrap())
    })
}

/// The sign is on the way south, at the end of market lane.
#[test]
fn stop_sign_of_the_route_counts_without_a_stop() {
    let (_, mut scenario) = routes().next().unwrap();
    // Only the way to the sign's street, without those whom the posed ego would meet.
    (scenario.ego.end_m, scenario.traffic) = (1000.0, None);
    scenario.actors.clear();
    let sign = scenario.road.map().features().stop_lines.iter().find_map(|line| {
        let route = scenario.road.route();
        let stretch = route.stretches().iter().find(|stretch| stretch.lane == line.lane)?;
        (line.sign == Some(swerve_map::StopSign::Stop)).then_some(stretch.begin_m + line.s_m)
    });
    // The front stands 1 m before the line for a second, or drives on.
    let stop_m = sign.unwrap() - scenario.ego.s_m - 1.0 - 2.465;
    let stopping =
        |at_s: f64| if at_s < stop_m / 10.0 { 10.0 * at_s } else { stop_m.max(10.0 * (at_s - 1.0)) };
    for (way_m, wanted) in [(&(|at_s| 10.0 * at_s) as &dyn Fn(f64) -> f64, 1), (&stopping, 0)] {
        let scores = Posed { duration_s: 110.0, ..Posed::along(&scenario, way_m) }.scores();
        assert_eq!(counts(&scores).map(|counts| counts.stop_infraction), [wanted, wanted]);
        assert_eq!(scores.leaderboard["2.1"].route_completion, 100.0);
    }
}

/// When an actor reaches the ego's lane, an ego at the speed limit can stop after 1 s with 4 m/s².
#[test]
fn routes_have_fair_scenarios_that_the_ego_triggers() {
    for (name, scenario) in routes() {
        let triggered: Vec<_> = scenario.actors.iter().filter(|actor| actor.trigger.is_some()).collect();
        assert!(triggered.len() >= 8, "route {name}: {} scenarios", triggered.len());
        assert!(scenario.expectation("fot").is_some_and(|expected| !expected.bounds.is_empty()), "{name}");
        for actor in triggered {
            let Some(Trigger::Reaches { who: Subject::Ego, s_m }) = actor.trigger else {
                panic!("{name}: {}: not triggered by the ego", actor.name);
            };
            assert!(s_m > scenario.ego.s_m, "{name}: {}: begins before the ego does", actor.name);
            let (speed_mps, way_m) = match &actor.motion[0] {
                Motion::Walk { speed_mps, .. } => (*speed_mps, actor.d_m.abs() - 1.75),
                Motion::Drive { speeds, .. } => (speeds[0].speed_mps, actor.d_m.abs() - 1.75 - 0.9),
                _ => continue,
            };
            let is_after_turn = actor.name.starts_with("cyclist_after_turn");
            let limit_mps = scenario.road.route().stretch_at(actor.s_m).unwrap().speed_limit_mps.unwrap();
            let limit_mps = if is_after_turn { 20.0 / 3.6 } else { limit_mps };
            let stop_m = limit_mps * (way_m / speed_mps + 1.0) + limit_mps * limit_mps / 8.0;
            let front_m = actor.s_m - s_m - 2.465;
            assert!(front_m >= stop_m, "{name}: {}: {front_m} m, a stop needs {stop_m} m", actor.name);
        }
    }
}

/// A patch is slippery in a bend, and nobody makes the ego brake there: no scenario with a road user begins before its end
/// and is passed after its begin.
#[test]
fn routes_have_slippery_bends_between_the_road_users() {
    for (name, scenario) in routes() {
        let route = scenario.road.route();
        assert_eq!(scenario.slippery.len(), 1, "route {name}");
        for patch in &scenario.slippery {
            let ends = [0.0, patch.line.length()].map(|s_m| patch.line.at(s_m).pose);
            let [begin_m, end_m] = ends.map(|pose| place_on(&route, pose.point()));
            assert!((end_m - begin_m - 15.0).abs() < 0.5, "{name}: from {begin_m} m to {end_m} m");
            assert!(begin_m > scenario.ego.s_m && end_m < scenario.ego.end_m, "{name}: {begin_m} m");
            let turn_rad = swerve_geom::angle_between(ends[0].heading_rad, ends[1].heading_rad).abs();
            assert!(turn_rad > 0.14, "{name}: {}: a bend of {turn_rad} rad", patch.name);
            // 2 m/s² of lateral acceleration leave 2 m/s² for the brakes.
            assert!((9.81 * patch.friction).powi(2) > 2.0_f64.powi(2) + 2.0_f64.powi(2));
            for actor in scenario.actors.iter().filter(|actor| actor.line.is_none()) {
                let Some(Trigger::Reaches { s_m, .. }) = actor.trigger else { continue };
                let is_apart = end_m < s_m || actor.s_m + 5.0 < begin_m;
                assert!(is_apart, "{name}: {} is where {} acts", patch.name, actor.name);
            }
        }
    }
}

/// A patch is a scenario from the first contact of the ego's outline on: it is not passed in 240 s if the ego then moves
/// to and fro, with up to 0.2 m/s, so that it is not blocked.
#[test]
fn patch_is_a_scenario_from_the_first_contact_on() {
    let (_, mut scenario) = routes().next().unwrap();
    (scenario.ego.end_m, scenario.traffic) = (1000.0, None);
    scenario.actors.clear();
    let begin_m = place_on(&scenario.road.route(), scenario.slippery[0].line.points()[0]);
    for (front_m, wanted) in [(-0.5, 0), (0.5, 1)] {
        let there_m = begin_m + front_m - 2.465 - scenario.ego.s_m;
        let to_and_fro_m = |for_s: f64| 0.4 * (1.0 - swerve_geom::math::cos(0.5 * for_s));
        let way_m = |at_s: f64| (10.0 * at_s).min(there_m - to_and_fro_m((at_s - there_m / 10.0).max(0.0)));
        let scores = Posed { duration_s: 290.0, ..Posed::along(&scenario, &way_m) }.scores();
        assert_eq!(counts(&scores)[1].scenario_timeouts, wanted, "front {front_m} m beyond the begin");
    }
}

/// Routes turn back on themselves: some pass one place twice, and their first and last lanes, continued straight, come near
/// places far away from them.
#[test]
fn scenarios_of_the_routes_are_where_the_ego_meets_them() {
    for (name, scenario) in routes() {
        let found = scenarios_on(&scenario.road.route(), &scenario);
        for one in &found {
            let is_ahead = one.s_m > scenario.ego.s_m && one.s_m < scenario.ego.end_m + 10.0;
            assert!(is_ahead, "{name}: {:?} at {} m", one.cause, one.s_m);
            if let Cause::Actor(id) = one.cause {
                let actor = scenario.actor(id).unwrap();
                let Some(Trigger::Reaches { s_m, .. }) = actor.trigger else { unreachable!() };
                assert!(one.s_m > s_m, "{name}: {} at {} m begins at {s_m} m", actor.name, one.s_m);
            }
        }
    }
}

#[test]
fn road_without_a_map_has_no_scores() {
    let text = include_str!("../../../../scenarios/lane.toml");
    let lane = Scenario::parse("lane.toml", text).unwrap();
    assert!(Scored::new(&lane, &lane.road.route(), Shape::default()).is_none());
}
