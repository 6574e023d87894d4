//! What no single value shows: geometry, and what refers to what.

use swerve_geom::{FrenetPoint, Obb};
use swerve_vehicle::Shape;

use crate::{Scenario, Subject, Trigger};

/// Problems of a scenario whose values are each in range, as (key, message).
pub(crate) fn problems(scenario: &Scenario) -> Vec<(String, String)> {
    let mut found = Vec::new();
    if scenario.road.length_m() <= 0.0 {
        return found; // reported where the road is read
    }
    goal(scenario, &mut found);
    start(scenario, &Shape::default(), &mut found);
    triggers(scenario, &mut found);
    found
}

fn goal(scenario: &Scenario, found: &mut Vec<(String, String)>) {
    let (ego, length_m) = (&scenario.ego, scenario.road.length_m());
    let key = || "ego.end_m".to_owned();
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
        found.push(("ego.target_speed_mps".to_owned(), message.to_owned()));
    }
}

fn start(scenario: &Scenario, shape: &Shape, found: &mut Vec<(String, String)>) {
    let route = scenario.road.route();
    let footprint: Obb = shape.footprint(scenario.ego_pose(&route.line, shape));
    let outside_m = -route.margin_m(&footprint);
    if outside_m > 0.0 {
        let message = format!("the ego starts {outside_m:.2} m outside the drivable ground");
        found.push(("ego".to_owned(), message));
    }
    let behind = FrenetPoint { s_m: scenario.ego.s_m, d_m: scenario.ego.d_m };
    for actor in &scenario.actors {
        if actor.distance_to(&route.line, &footprint) > 0.0 {
            continue;
        }
        let message = format!(
            "the ego's start at s = {} m, d = {} m is inside the actor \"{}\"",
            behind.s_m, behind.d_m, actor.name
        );
        found.push(("ego".to_owned(), message));
    }
}

fn triggers(scenario: &Scenario, found: &mut Vec<(String, String)>) {
    for (i, actor) in scenario.actors.iter().enumerate() {
        let (part, who) = match actor.trigger {
            Some(Trigger::Distance { to, .. }) => ("distance.to", to),
            Some(Trigger::Reaches { who, .. }) => ("reaches.who", who),
            _ => continue,
        };
        if who == Subject::Actor(i) {
            let key = format!("actor.{}.trigger.{part}", actor.name);
            found.push((key, "an actor cannot wait for itself".to_owned()));
        }
    }
}
