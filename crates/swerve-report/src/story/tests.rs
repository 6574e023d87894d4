use swerve_core::{Span, Time};
use swerve_eval::{
    Evaluation, Metrics, Milestone, Norm, OthersImpact, Outline, Params, Verdict, Why, WhyStep,
};
use swerve_geom::{Map, Point, Point2, Polyline, Pose2, Transform, Vector, Vector2, math};
use swerve_msg::truth::{Actor, Collision, EgoTruth, EndReason, WorldState};
use swerve_msg::{
    ActorId, ActorKind, EgoState, Extent, Obstacle, ObstacleList, Plan, PlanPoint, PlanStatus, Route,
};

use super::*;

const NAMES: [&str; 2] = ["parked truck", "person"];
const OUTLINE: Outline = Outline { length_m: 4.93, width_m: 1.86, center_ahead_m: 1.425 };

/// A person steps out from behind a truck; the ego swerves by `swerve_m`, or hits the person if that is 0.
struct Drive {
    swerve_m: f64,
    bend_1pm: f64,
}

impl Drive {
    /// Converts arc length and lateral offset from the lane to a map pose.
    fn map(&self, s_m: f64, d_m: f64, turn_rad: f64) -> Pose2 {
        let heading = self.bend_1pm * s_m;
        let (sin, cos) = math::sin_cos(heading);
        let (x, y) = if self.bend_1pm == 0.0 {
            (s_m, 0.0)
        } else {
            (sin / self.bend_1pm, (1.0 - cos) / self.bend_1pm)
        };
        Pose2::new(x - sin * d_m, y + cos * d_m, heading + turn_rad)
    }

    fn route(&self) -> Route {
        let points: Vec<Point2> = (0..=100).map(|k| self.map(2.0 * f64::from(k), 0.0, 0.0).point()).collect();
        Route::uniform(Polyline::new(&points).unwrap(), 6.0, 2.0)
    }

    /// Lateral offset and its first two derivatives over distance.
    fn offset(&self, s_m: f64) -> [f64; 3] {
        let wave = |from: f64, to: f64| {
            let t = ((s_m - from) / (to - from)).clamp(0.0, 1.0);
            let l = to - from;
            [
                t * t * t * (t * (6.0 * t - 15.0) + 10.0),
                30.0 * t * t * (t - 1.0) * (t - 1.0) / l,
                60.0 * t * (t - 1.0) * (2.0 * t - 1.0) / (l * l),
            ]
        };
        let (out, back) = (wave(96.0, 114.0), wave(124.0, 148.0));
        core::array::from_fn(|k| self.swerve_m * (out[k] - back[k]))
    }

    fn ego(&self, at: Time) -> EgoState {
        let s_m = 20.0 * at.as_secs();
        let [d_m, slope, bend] = self.offset(s_m);
        EgoState {
            stamp: at,
            pose: self.map(s_m, d_m, math::atan2(slope, 1.0)),
            speed_mps: 20.0 - 30.0 * slope * slope,
            lateral_accel_mps2: 400.0 * bend,
            steering_rad: 2.85 * bend,
            ..EgoState::default()
        }
    }

    fn world(&self, at: Time) -> WorldState {
        let state = self.ego(at);
        let walked = (2.75 * (at.as_secs() - 4.0).max(0.0)).min(4.5);
        let actor = |id, kind, pose, [length_m, width_m, height_m]: [f64; 3]| Actor {
            id: ActorId(id),
            kind,
            pose,
            z_m: 0.0,
            extent: Extent { length_m, width_m, height_m },
            velocity_mps: Vector2::new(0.0, 0.0),
        };
        WorldState {
            stamp: at,
            ego: EgoTruth {
                id: ActorId::EGO,
                map_from_ego: Transform::from_roll_pitch_yaw(Point::<Map>::new(0.0, 0.0, 0.0), 0.0, 0.0, 0.0),
                state,
                velocity_mps: Vector::new(0.0, 0.0, 0.0),
                specific_force_mps2: Vector::new(0.0, 0.0, 9.81),
                angular_velocity_radps: Vector::new(0.0, 0.0, 0.0),
            },
            actors: vec![
                actor(1, ActorKind::Truck, self.map(110.0, 4.0, 0.0), [5.2, 2.6, 2.5]),
                actor(2, ActorKind::Pedestrian, self.map(117.0, 4.5 - walked, 0.0), [0.5, 0.5, 1.8]),
            ],
            collisions: Vec::new(),
            infractions: Vec::new(),
            ended: None,
        }
    }

    fn plan(&self, at: Time, status: PlanStatus) -> Plan {
        let points = (0..40).map(|k| {
            let t = at + Span::from_ms(50 * k);
            let pose = if status == PlanStatus::Found {
                self.ego(t).pose
            } else {
                self.map(20.0 * t.as_secs(), 0.0, 0.0)
            };
            PlanPoint { at: t, pose, speed_mps: 20.0, ..PlanPoint::default() }
        });
        Plan { stamp: at, status, points: points.collect(), work: 1 }
    }

    fn story(&self) -> Story {
        let mut story =
            Story::new("Person behind truck · FOT fast · 20 m/s · seed 3", self.route(), Some(4.0), OUTLINE);
        let params = Params {
            ego: OUTLINE,
            dead_time: Span::ZERO,
            operators: Vec::new(),
            actors: (1..).map(ActorId).zip(NAMES.map(str::to_owned)).collect(),
            route: None,
            lights: Vec::new(),
            norm: Norm::default(),
            tracks_boxes: false,
        };
        let mut evaluation = Evaluation::new(params);
        let mut hit = false;
        for k in 0..=1700_i64 {
            let at = Time::from_ms(5 * k);
            let mut world = self.world(at);
            let person = self.map(117.0, world.actors[1].pose.y_m, 0.0);
            let near =
                OUTLINE.footprint(world.ego.state.pose).distance_to_point(world.actors[1].pose.point())
                    < 0.25;
            if near && !hit && person.is_finite() {
                hit = true;
                world.collisions = vec![Collision {
                    stamp: at,
                    parties: [ActorId::EGO, ActorId(2)],
                    impulse_n_s: 1500.0,
                    closing_speed_mps: 19.8,
                    speeds_mps: [19.9, 2.75],
                }];
            }
            world.ended = match hit {
                true => (k > 1320).then_some(EndReason::Collision),
                false => (k == 1700).then_some(EndReason::Goal),
            };
            evaluation.world(&world);
            story.world(&world);
            if k % 10 == 0 {
                evaluation.seen(&seen(at));
                let status = match at.as_secs() {
                    t if t < 4.9 => PlanStatus::Route,
                    t if t < 5.0 => PlanStatus::GaveUp,
                    t if t < 7.0 && self.swerve_m > 0.0 => PlanStatus::Found,
                    t if t < 7.0 => PlanStatus::GaveUp,
                    _ => PlanStatus::Route,
                };
                let plan = self.plan(at, status);
                evaluation.plan(&plan);
                story.plan(at + Span::from_ms(40), &plan);
            }
            if world.ended.is_some() {
                break;
            }
        }
        story.conclude(&evaluation.metrics(), None);
        story
    }
}

fn seen(at: Time) -> ObstacleList {
    let obstacle = |id, kind, share| Obstacle {
        id: ActorId(id),
        kind,
        pose: Pose2::default(),
        extent: Extent::default(),
        velocity_mps: Vector2::new(0.0, 0.0),
        visible_share: share,
    };
    let person = if at.as_secs() < 4.78 { 0.0 } else { 0.3 };
    ObstacleList {
        stamp: at,
        obstacles: vec![obstacle(1, ActorKind::Truck, 1.0), obstacle(2, ActorKind::Pedestrian, person)],
    }
}

/// Disc behind the number of a plan with status `found`.
const BADGE: &str = "r=\"7\" fill=\"#007D5A\"";

/// Writes a figure to the folder `SWERVE_STORY_DIR`, if set.
fn show(name: &str, svg: &str) {
    if let Some(dir) = std::env::var_os("SWERVE_STORY_DIR") {
        std::fs::write(std::path::Path::new(&dir).join(name), svg).unwrap();
    }
}

#[test]
fn story_shows_a_swerve() {
    let story = Drive { swerve_m: 1.4, bend_1pm: 0.0 }.story();
    let svg = draw(&story).svg();
    show("avoided.svg", &svg);
    for part in
        ["AVOIDED", "person first visible 4.80 s", "closest to person 5.", "changed plan", "parked truck"]
    {
        assert!(svg.contains(part), "{part}");
    }
    assert!(!svg.contains("NaN") && !svg.contains("inf"));
}

#[test]
fn story_shows_a_collision() {
    let svg = draw(&Drive { swerve_m: 0.0, bend_1pm: 0.0 }.story()).svg();
    show("collision.svg", &svg);
    for part in ["COLLISION", "collision with person 5.", "impact at 19.9 m/s", "no path found"] {
        assert!(svg.contains(part), "{part}");
    }
}

#[test]
fn story_names_both_parties_of_a_collision_of_others() {
    let mut story = Drive { swerve_m: 1.4, bend_1pm: 0.0 }.story();
    let without = draw(&story).svg();
    let names = ["van", "cyclist"].map(str::to_owned);
    let first = OthersImpact { names, at_s: 3.2, closing_speed_mps: 5.0 };
    story.metrics.as_mut().unwrap().first_collision_of_others = Some(first);
    let svg = draw(&story).svg();
    assert!(svg.contains("AVOIDED") && svg.contains("van and cyclist collided at 3.20 s"), "{svg}");
    assert!(!without.contains("collided"));
}

/// Text elements of a figure, including axis numbers.
fn texts(svg: &str) -> Vec<&str> {
    svg.lines().filter(|line| line.starts_with("<text")).collect()
}

#[test]
fn collision_jolt_does_not_change_the_axes() {
    let mut story = Drive { swerve_m: 0.0, bend_1pm: 0.0 }.story();
    let impact_s = story.metrics.as_ref().unwrap().impact.unwrap().at_s;
    let without = draw(&story).svg();
    for ego in story.ego.iter_mut().filter(|e| e.stamp.as_secs() >= impact_s - 1e-6) {
        (ego.accel_mps2, ego.lateral_accel_mps2) = (-100.0, 80.0);
    }
    let with = draw(&story).svg();
    assert!(with != without && texts(&with) == texts(&without));
}

#[test]
fn early_chain_steps_are_on_the_time_axis_or_summarised() {
    let mut story = Drive { swerve_m: 1.4, bend_1pm: 0.0 }.story();
    let view = view::View::of(&story, (0.0, 0.0), 1000.0).unwrap();
    let from_s = view.span.0.as_secs();
    let draw_with = |story: &mut Story, steps: &[(Milestone, f64)]| {
        let step = |&(what, at_s): &(Milestone, f64)| WhyStep { what, at_s, waited: Vec::new() };
        story.why = Some(Why {
            actor: Some("person".into()),
            verdict: Verdict::Avoided,
            sentence: "it passed".into(),
            steps: steps.iter().map(step).collect(),
        });
        draw(story).svg()
    };
    let near = [(Milestone::Visible, from_s - 2.5), (Milestone::Tracked, from_s - 2.0)];
    let svg = draw_with(&mut story, &near);
    show("early.svg", &svg);
    for (what, at_s) in near {
        assert!(svg.contains(&format!(">{} {at_s:.3} s<", what.name())), "{}", what.name());
    }
    assert!(!svg.contains(">before this: ") && svg.contains("step of why, named below"));
    // A step at the start of the run is on the axis, and only there.
    let svg = draw_with(&mut story, &[(Milestone::Light, 0.0), (Milestone::Planned, from_s - 2.0)]);
    assert!(from_s <= 5.0, "else the start is long before the view");
    assert!(svg.contains(">light 0.000 s<") && !svg.contains(">before this: "), "named twice");
    // As if the drive had begun earlier.
    let far = [(Milestone::Visible, from_s - 9.0), (Milestone::Planned, from_s + 1.0)];
    let svg = draw_with(&mut story, &far);
    show("long_before.svg", &svg);
    let said = format!(">before this: visible {:.3} s<", from_s - 9.0);
    assert!(svg.contains(&said) && svg.contains(&format!(">planned {:.3} s<", from_s + 1.0)));
    let many: Vec<(Milestone, f64)> =
        (0..9).map(|k| (Milestone::Light, from_s - 20.0 + f64::from(k))).collect();
    assert!(draw_with(&mut story, &many).contains(">9 steps before this<"));
}

#[test]
fn bend_is_drawn_to_scale() {
    let drive = Drive { swerve_m: 1.4, bend_1pm: 1.0 / 150.0 };
    let story = drive.story();
    let svg = draw(&story).svg();
    show("bend.svg", &svg);
    assert!(svg.contains("along (m)"));
    let view = view::View::of(&story, (72.0, 64.0), 1144.0).unwrap();
    let place = |s, d| view.at(drive.map(s, d, 0.0).point());
    let length = |a: (f64, f64), b: (f64, f64)| math::hypot(a.0 - b.0, a.1 - b.1);
    let (along, across) =
        (length(place(110.0, 0.0), place(110.5, 0.0)), length(place(110.0, 0.0), place(110.0, 0.5)));
    assert!(
        (along / (0.5 * view.scale) - 1.0).abs() < 1e-3 && (across / (0.5 * view.scale) - 1.0).abs() < 1e-9
    );
}

#[test]
fn view_runs_from_before_the_first_actor_to_beyond_the_last() {
    let story = Drive { swerve_m: 1.4, bend_1pm: 0.0 }.story();
    let view = view::View::of(&story, (0.0, 0.0), 1000.0).unwrap();
    assert!((view.s_m.0 - 70.0).abs() < 0.1 && (view.s_m.1 - 142.0).abs() < 0.1, "{:?}", view.s_m);
    assert!(view.span.0 < Time::from_ms(3500) && view.span.1 > Time::from_ms(7000));
}

#[test]
fn story_keeps_only_changed_plans() {
    let drive = Drive { swerve_m: 1.4, bend_1pm: 0.0 };
    let mut story = drive.story();
    let statuses: Vec<PlanStatus> = story.plans.iter().map(|mark| mark.plan.status).collect();
    use PlanStatus::{Found, GaveUp, Route};
    assert_eq!(statuses, [Route, GaveUp, Found, Route]);
    let mut plan = drive.plan(Time::from_ms(5500), Found);
    story.plan(Time::from_ms(5540), &plan);
    let kept = story.plans.len();
    let shift = |plan: &mut Plan, by: f64| {
        plan.points
            .iter_mut()
            .for_each(|p| p.pose = Pose2::new(p.pose.x_m, p.pose.y_m + by, p.pose.heading_rad));
    };
    shift(&mut plan, 0.2);
    story.plan(Time::from_ms(5600), &plan);
    assert_eq!(story.plans.len(), kept, "0.2 m is none");
    shift(&mut plan, 0.2);
    story.plan(Time::from_ms(5650), &plan);
    assert_eq!(story.plans.len(), kept + 1, "0.4 m from the one kept last is one");
}

/// Plan changes every 50 ms are thinned to a readable figure: few plans, badges that do not overlap.
#[test]
fn frequent_plan_changes_are_thinned() {
    let drive = Drive { swerve_m: 1.4, bend_1pm: 0.0 };
    let mut story = drive.story();
    story.plans.clear();
    for k in 0..160_i64 {
        let at = Time::from_ms(50 * k);
        story.plans.push(PlanMark { at, plan: drive.plan(at, PlanStatus::Found), predicted: Vec::new() });
    }
    let svg = draw(&story).svg();
    show("restless.svg", &svg);
    let badges = |svg: &str| svg.matches(BADGE).count();
    // Each badge is in the view and above the panels.
    assert!((4..=18).contains(&badges(&svg)), "{}", badges(&svg));
    assert!(svg.contains(" more soon after)"));
    let places: Vec<(f64, f64)> = svg
        .lines()
        .filter(|line| line.contains(BADGE))
        .map(|line| {
            let of =
                |name: &str| line.split(name).nth(1).unwrap().split('"').next().unwrap().parse().unwrap();
            (of("cx=\""), of("cy=\""))
        })
        .collect();
    for (i, a) in places.iter().enumerate() {
        for b in &places[..i] {
            assert!((a.0 - b.0).abs() >= 16.0 || (a.1 - b.1).abs() >= 16.0, "{a:?} {b:?}");
        }
    }
}

#[test]
fn time_without_comfort_is_marked_if_there_is_a_comfortable_layer() {
    use PlanStatus::{Comfortable, Found, Kept, Route};
    let drive = Drive { swerve_m: 1.4, bend_1pm: 0.0 };
    let told = drive.story();
    assert!(told.without_comfort().is_empty(), "no layer, no time without it");
    let (none, legend) = (draw(&told).svg(), "no comfortable plan was free");
    assert!(!none.contains(legend));
    let mut story = Story::new("", drive.route(), Some(4.0), OUTLINE);
    (story.ego, story.actors, story.metrics) = (told.ego, told.actors, told.metrics);
    for (k, status) in
        [Route, Comfortable, Comfortable, Found, Kept, Comfortable, Found].into_iter().enumerate()
    {
        let at = Time::from_ms(1000 * k as i64);
        story.plan(at, &drive.plan(at, status));
    }
    let end = story.ego.last().unwrap().stamp;
    let led = [(Time::from_ms(3000), Time::from_ms(5000)), (Time::from_ms(6000), end)];
    assert_eq!(story.without_comfort(), led);
    let svg = draw(&story).svg();
    let painted = |svg: &str| svg.matches("fill-opacity=\"0.16\"").count();
    assert!(svg.contains(legend) && painted(&svg) == painted(&none) + 2 * 5 + 1, "{}", painted(&svg));
}

#[test]
fn plan_before_first_sight_is_explained() {
    let drive = Drive { swerve_m: 1.4, bend_1pm: 0.0 };
    let mut story = drive.story();
    assert!(!draw(&story).svg().contains("was visible:"));
    let at = Time::from_ms(4000);
    story.plans.insert(1, PlanMark { at, plan: drive.plan(at, PlanStatus::Found), predicted: Vec::new() });
    let note = "plan 1 is from before person was visible: only parked truck is visible then";
    assert!(draw(&story).svg().contains(note));
}

#[test]
fn run_that_ends_at_once_has_a_figure_with_a_note() {
    let route = Drive { swerve_m: 0.0, bend_1pm: 0.0 }.route();
    let svg = draw(&Story::new("a < b & c", route, None, OUTLINE)).svg();
    assert!(svg.contains("before the ego moved") && svg.contains("a &lt; b &amp; c"));
}

#[test]
fn run_without_actors_is_shown_in_full() {
    let drive = Drive { swerve_m: 0.0, bend_1pm: 0.0 };
    let mut story = Story::new("alone", drive.route(), None, OUTLINE);
    for k in 0..100_i64 {
        let mut world = drive.world(Time::from_ms(20 * k));
        world.actors.clear();
        story.world(&world);
    }
    let params = Params {
        ego: OUTLINE,
        dead_time: Span::ZERO,
        operators: Vec::new(),
        actors: (1..).map(ActorId).zip(NAMES.map(str::to_owned)).collect(),
        route: None,
        lights: Vec::new(),
        norm: Norm::default(),
        tracks_boxes: false,
    };
    let none: Metrics = Evaluation::new(params).metrics();
    story.conclude(&none, None);
    let svg = draw(&story).svg();
    assert!(svg.contains("UNFINISHED") && !svg.contains("closest"));
}

#[test]
fn nearest_points_of_outlines_span_their_distance() {
    let ego = OUTLINE.footprint(Pose2::new(0.0, 0.0, 0.3));
    for k in 0..60 {
        let at = Pose2::new(f64::from(k % 9) * 2.0 - 3.0, f64::from(k % 7) * 1.5 - 9.0, f64::from(k));
        let (kind, extent) = (ActorKind::Car, Extent { length_m: 4.0, width_m: 1.8, height_m: 1.5 });
        let car = ActorTrace { id: ActorId(1), kind, extent, poses: Vec::new() };
        let (a, b) = car.shape(at).nearest(&ego);
        let distance = extent.footprint(at).distance(&ego);
        assert!(distance == 0.0 || (a.distance(b) - distance).abs() < 1e-9, "{k}");
        let person = ActorTrace { kind: ActorKind::Pedestrian, ..car };
        let (a, b) = person.shape(at).nearest(&ego);
        let distance = (ego.distance_to_point(at.point()) - 0.9).max(0.0);
        assert!((a.distance(b) - distance).abs() < 1e-9, "{k}");
    }
}

#[test]
fn states_are_a_strip_that_names_those_with_room() {
    use swerve_eval::{BehaviourMetrics, StateChange};
    use swerve_msg::DrivingState::{Cruise, EmergencyStop, Follow, GiveWay};
    let mut story = Drive { swerve_m: 1.4, bend_1pm: 0.0 }.story();
    let without = draw(&story).svg();
    let change = |at_s, state, because: Option<&str>| StateChange {
        at_s,
        state: Some(state),
        because: because.map(str::to_owned),
    };
    let changes = vec![
        change(0.0, Cruise, None),
        change(4.0, GiveWay, Some("person")),
        change(5.0, Follow, Some("a truck with a name that is too long for its part of the strip")),
        change(5.5, Cruise, None),
        change(5.51, Follow, Some("van")),
        change(5.52, Cruise, None),
        change(6.0, EmergencyStop, None),
        change(6.01, GiveWay, Some("van")),
    ];
    let behaviour = BehaviourMetrics { changes, ..BehaviourMetrics::default() };
    story.metrics.as_mut().unwrap().behaviour = Some(behaviour);
    let svg = draw(&story).svg();
    show("states.svg", &svg);
    for text in ["behaviour", "cruises", "gives way to person", "gives way to van", "follows", "brakes hard"]
    {
        assert!(svg.contains(&format!(">{text}<")), "{text}");
    }
    assert!(!svg.contains(">follows van<") && !svg.contains("too long"));
    // Cruise, give way, follow, cruise with a short state, emergency, give way; and four entries of the legend.
    assert_eq!(
        svg.matches("fill-opacity=\"0.25\"").count() - without.matches("fill-opacity=\"0.25\"").count(),
        10
    );
    // A planner without states changes nothing.
    story.metrics.as_mut().unwrap().behaviour = Some(BehaviourMetrics::default());
    assert_eq!(draw(&story).svg(), without);
}
