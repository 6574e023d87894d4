//! Traffic light signals during a run.

use swerve_core::Time;
use swerve_eval::LightCourse;
use swerve_geom::FrenetPoint;
use swerve_scenario::{Scenario, TrafficLight};

/// Distance of a light from its stop line along the route, metres.
const BEHIND_LINE_M: f64 = 50.0;

/// Signal phases of each light that the ego obeys, from the start until an instant.
pub fn light_courses(scenario: &Scenario, until: Time) -> Vec<LightCourse> {
    let line = scenario.road.line();
    let course = |light: &TrafficLight| {
        let stop_s_m = light.stop_s_m?;
        let (mut shows, mut at) = (Vec::new(), Time::ZERO);
        while at <= until {
            let signal = light.signal(at);
            if shows.last().is_none_or(|(_, last)| *last != signal) {
                shows.push((at, signal));
            }
            // An unchecked light may have no phases.
            let Some(left) = light.phase_left(at) else { break };
            at += left;
        }
        let FrenetPoint { s_m, d_m } = line.project_near(light.pose.point(), stop_s_m, BEHIND_LINE_M);
        Some(LightCourse { name: light.name.clone(), s_m, d_m, stop_s_m, shows })
    };
    scenario.road.lights.iter().filter_map(course).collect()
}

#[cfg(test)]
mod tests {
    use swerve_msg::Signal;

    use super::*;

    #[test]
    fn course_matches_the_light() {
        let file =
            std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/traffic_light.toml");
        let scenario = Scenario::read(&file).unwrap();
        let until = Time::from_ms(40_000);
        let course = &light_courses(&scenario, until)[0];
        assert_eq!(course.shows[..2], [(Time::ZERO, Signal::Green), (Time::from_ms(2000), Signal::Yellow)]);
        for ms in 0..=40_000 {
            let at = Time::from_ms(ms);
            assert_eq!(course.signal(at), Some(scenario.road.lights[0].signal(at)), "{ms} ms");
        }
    }

    /// The ego arrives at red, which the program of SUMO's file shows from 38 to 58 s, and goes on at green.
    #[test]
    fn ego_waits_at_red_of_a_program_of_the_map() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../swerve-map-io/maps/way.toml");
        let text = "name = \"way\"\n[map]\nfile = \"junction.net.xml\"\n[ego]\nstart = { lane = \"in_2\", s_m = 10.0 }\n\
                    goal = { lane = \"out_0\", s_m = 30.0 }\ntarget_speed_mps = 2.0\n[end]\ntimeout_s = 120.0\n";
        let scenario = Scenario::parse(file, text).unwrap();
        let metrics = crate::drive(&swerve_stack::Setup::default(), &scenario).unwrap().metrics;
        let (verdict, passed, duration_s) =
            (metrics.verdict, metrics.red_lights_passed, metrics.drive.duration_s);
        assert_eq!((verdict, passed), (swerve_eval::Verdict::Completed, 0));
        // 59 m at 2 m/s from the light, if it is left at 58 s.
        assert!((58.0 + 20.0..58.0 + 40.0).contains(&duration_s), "{duration_s} s");
    }
}
