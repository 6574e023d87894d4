//! Traffic light signals during a run.

use swerve_core::{Span, Time};
use swerve_eval::LightCourse;
use swerve_geom::FrenetPoint;
use swerve_msg::{Route, Signal};
use swerve_scenario::{Road, TrafficLight};

/// Distance of a light from its stop line along the route, metres.
const BEHIND_LINE_M: f64 = 50.0;

/// Signal phases of each light that the ego obeys on a route, from the start until an instant.
pub fn light_courses(road: &Road, route: &Route, until: Time) -> Vec<LightCourse> {
    let line = route.line();
    let course = |light: &TrafficLight| {
        let stop_s_m = road.stop_s_m(light, route)?;
        let (mut shows, mut at) = (Vec::new(), Time::ZERO);
        while at <= until {
            let (signal, since) = light.phase(at);
            shows.push((at, signal));
            let length_s = match signal {
                Signal::Green => light.cycle.green_s,
                Signal::Yellow => light.cycle.yellow_s,
                Signal::Red => light.cycle.red_s,
            };
            let next = at - since + Span::from_secs(length_s);
            // An unchecked light may have no phases.
            if next <= at {
                break;
            }
            at = next;
        }
        let FrenetPoint { s_m, d_m } = line.project_near(light.pose.point(), stop_s_m, BEHIND_LINE_M);
        Some(LightCourse { name: light.name.clone(), s_m, d_m, stop_s_m, shows })
    };
    road.lights.iter().filter_map(course).collect()
}

#[cfg(test)]
mod tests {
    use swerve_scenario::Scenario;

    use super::*;

    #[test]
    fn course_matches_the_light() {
        let file =
            std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/traffic_light.toml");
        let scenario = Scenario::read(&file).unwrap();
        let until = Time::from_ms(40_000);
        let course = &light_courses(&scenario.road, &scenario.road.route(), until)[0];
        assert_eq!(course.shows[..2], [(Time::ZERO, Signal::Green), (Time::from_ms(2000), Signal::Yellow)]);
        for ms in 0..=40_000 {
            let at = Time::from_ms(ms);
            assert_eq!(course.signal(at), Some(scenario.road.lights[0].signal(at)), "{ms} ms");
        }
    }
}
