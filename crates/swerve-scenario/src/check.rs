//! Checks that span several values of a scenario: geometry and references.

use swerve_geom::{Obb, Polyline, math};
use swerve_msg::ActorKind;
use swerve_vehicle::Shape;

use crate::model::EGO_START_M;
use crate::{Actor, Scenario, Subject, Trigger};

/// Problems of a scenario whose single values are in range, as (key, message).
pub(crate) fn problems(scenario: &Scenario) -> Vec<(String, String)> {
    let mut found = Vec::new();
    if !scenario.road.is_line() {
        return found; // reported where the road is read
    }
    lights(scenario, &mut found);
    for (id, name) in scenario.egos() {
        let view = scenario.of_ego(id).expect("it is one of the egos");
        let key = if scenario.other_egos.is_empty() { "ego".to_owned() } else { format!("ego.{name}") };
        goal(&view, &key, &mut found);
        start(&view, &Shape::default(), &key, &mut found);
    }
    on_the_road(scenario, &mut found);
    actors(scenario, &mut found);
    triggers(scenario, &mut found);
    found
}

fn lights(scenario: &Scenario, found: &mut Vec<(String, String)>) {
    let length_m = scenario.road.length_m();
    let lights = scenario.road.lights.iter();
    for (light, stop_s_m) in lights.filter_map(|light| Some((light, light.stop_s_m?))) {
        if !(0.0..=length_m).contains(&stop_s_m) {
            found.push((
                format!("road.light.{}.stop_s_m", light.name),
                format!("the stop line at {stop_s_m} m is not on the road, which is {length_m} m long"),
            ));
        }
    }
}

fn goal(scenario: &Scenario, ego_key: &str, found: &mut Vec<(String, String)>) {
    let (ego, length_m) = (&scenario.ego, scenario.road.length_m());
    let key = || format!("{ego_key}.end_m");
    if ego.end_m > length_m {
        found.push((
            key(),
            format!("the goal at {} m is beyond the end of the road at {length_m} m", ego.end_m),
        ));
    }
    if ego.end_m <= ego.s_m {
        found
            .push((key(), format!("the goal at {} m is not ahead of the start at {} m", ego.end_m, ego.s_m)));
    }
    let standing = ego.target_speed_mps == 0.0;
    if standing {
        let message = "a target speed of 0 never reaches the goal: expected a number above 0";
        found.push((format!("{ego_key}.target_speed_mps"), message.to_owned()));
    }
}

fn start(scenario: &Scenario, shape: &Shape, ego_key: &str, found: &mut Vec<(String, String)>) {
    let route = scenario.road.route();
    let footprint: Obb = shape.footprint(scenario.ego_pose(route.line(), shape));
    let outside_m = -route.margin_m(&footprint);
    if outside_m > 0.0 {
        let message = format!("the ego starts {outside_m:.2} m outside the drivable ground");
        found.push((ego_key.to_owned(), message));
    }
    // A seed shifts the start along the road by up to this distance.
    let drawn = Obb { half_length_m: footprint.half_length_m + EGO_START_M, ..footprint };
    // Recorded road users are where they were.
    let written = scenario.actors.iter().filter(|actor| actor.track().is_none());
    for actor in written.filter(|actor| actor.distance_to(route.line(), &drawn) == 0.0) {
        let inside = actor.distance_to(route.line(), &footprint) == 0.0;
        let how = if inside { "" } else { ", or can be as a seed draws it (within 0.5 m)," };
        let (s_m, d_m, name) = (scenario.ego.s_m, scenario.ego.d_m, &actor.name);
        let message =
            format!("the ego's start at s = {s_m} m, d = {d_m} m{how} is inside the actor \"{name}\"");
        found.push((ego_key.to_owned(), message));
    }
    for other in scenario.other_egos.iter().filter(|other| other.id < scenario.ego_id) {
        let outline = shape.footprint(other.pose(shape));
        // A seed shifts this one, too.
        let outline = Obb { half_length_m: outline.half_length_m + EGO_START_M, ..outline };
        if drawn.distance(&outline) == 0.0 {
            let message = format!("starts inside the ego \"{}\", or can as a seed draws them", other.name);
            found.push((ego_key.to_owned(), message));
        }
    }
}

/// Distance before the start and beyond the end of the road up to which actors may start, metres.
const BESIDE_ENDS_M: f64 = 100.0;

/// Actors must start along the road or near its ends: `s_m` far beyond them is a mistake.
fn on_the_road(scenario: &Scenario, found: &mut Vec<(String, String)>) {
    let length_m = scenario.road.length_m();
    let reach = -BESIDE_ENDS_M..=length_m + BESIDE_ENDS_M;
    let by_road = scenario.actors.iter().filter(|actor| actor.line.is_none());
    let beyond = by_road.filter(|actor| !reach.contains(&actor.s_m));
    for Actor { name, s_m, .. } in beyond.take(PROBLEMS_MAX) {
        let message = format!(
            "starts at {s_m} m: expected a place on the road, 0 to {length_m} m, or at most {BESIDE_ENDS_M} m beyond its ends"
        );
        found.push((format!("actor.{name}.s_m"), message));
    }
}

/// Largest number of problems of one sort that are reported one by one.
const PROBLEMS_MAX: usize = 100;

/// Movable actors must not overlap at the start: the physics engine would push them apart. For each actor only the
/// first overlap is reported.
fn actors(scenario: &Scenario, found: &mut Vec<(String, String)>) {
    let line = scenario.road.line();
    let overlaps = overlaps(scenario, &line);
    for (i, other) in overlaps.iter().take(PROBLEMS_MAX) {
        let message = format!("starts inside the actor \"{}\"", scenario.actors[*other].name);
        found.push((format!("actor.{}", scenario.actors[*i].name), message));
    }
    if let Some(more) = overlaps.len().checked_sub(PROBLEMS_MAX).filter(|more| *more > 0) {
        found.push(("actor".to_owned(), format!("{more} more start inside others")));
    }
}

/// Actors that overlap earlier ones at the start, each with the first of these.
fn overlaps(scenario: &Scenario, line: &Polyline) -> Vec<(usize, usize)> {
    let mut first: Vec<Option<usize>> = vec![None; scenario.actors.len()];
    near(scenario, line, |i, other| {
        if first[i].is_none_or(|first| other < first) && is_inside(scenario, line, i, other) {
            first[i] = Some(other);
        }
    });
    first.into_iter().enumerate().filter_map(|(i, other)| Some((i, other?))).collect()
}

fn is_inside(scenario: &Scenario, line: &Polyline, i: usize, other: usize) -> bool {
    let (actor, other) = (&scenario.actors[i], &scenario.actors[other]);
    let is_recorded = actor.track().is_some() || other.track().is_some();
    let both_fixed = actor.kind == ActorKind::Static && other.kind == ActorKind::Static;
    // For two round bodies, one is replaced by its box, which contains it.
    let (round, square) = if actor.is_round() { (actor, other) } else { (other, actor) };
    let rectangle = square.extent.footprint(square.pose(line));
    !is_recorded && !both_fixed && round.distance_to(line, &rectangle) == 0.0
}

/// Pairs of actors, the later one first, that are near enough along x to touch.
fn near(scenario: &Scenario, line: &Polyline, mut pair: impl FnMut(usize, usize)) {
    let reach = |(i, actor): (usize, &Actor)| {
        let at = actor.extent.footprint(actor.pose(line));
        let radius_m = math::hypot(at.half_length_m, at.half_width_m);
        (at.center.x_m - radius_m, at.center.x_m + radius_m, i)
    };
    let mut reaches: Vec<(f64, f64, usize)> = scenario.actors.iter().enumerate().map(reach).collect();
    reaches.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (k, (_, to, i)) in reaches.iter().enumerate() {
        let behind = reaches[k + 1..].iter().take_while(|(from, _, _)| from <= to);
        behind.for_each(|(_, _, j)| pair(*i.max(j), *i.min(j)));
    }
}

fn triggers(scenario: &Scenario, found: &mut Vec<(String, String)>) {
    for actor in &scenario.actors {
        let (part, who) = match actor.trigger {
            Some(Trigger::Distance { to, .. }) => ("distance.to", to),
            Some(Trigger::Reaches { who, .. }) => ("reaches.who", who),
            _ => continue,
        };
        if who == Subject::Actor(actor.id) {
            let key = format!("actor.{}.trigger.{part}", actor.name);
            found.push((key, "an actor cannot wait for itself".to_owned()));
        }
    }
}
