//! Traffic light signals during a run.

use swerve_core::{Span, Time};
use swerve_eval::LightCourse;
use swerve_msg::Signal;
use swerve_scenario::{Scenario, TrafficLight};

/// Signal phases of each light of a scenario, from the start until an instant.
pub fn light_courses(scenario: &Scenario, until: Time) -> Vec<LightCourse> {
    let course = |light: &TrafficLight| {
        let (mut shows, mut at) = (Vec::new(), Time::ZERO);
        while at <= until {
            let (signal, since) = light.phase(at);
            shows.push((at, signal));
            let length_s = match signal {
                Signal::Green => light.green_s,
                Signal::Yellow => light.yellow_s,
                Signal::Red => light.red_s,
            };
            let next = at - since + Span::from_secs(length_s);
            // An unchecked light may have no phases.
            if next <= at {
                break;
            }
            at = next;
        }
        let (s_m, d_m, stop_s_m) = (light.s_m, light.d_m, light.stop_s_m);
        LightCourse { name: light.name.clone(), s_m, d_m, stop_s_m, shows }
    };
    scenario.road.lights.iter().map(course).collect()
}

#[cfg(test)]
mod tests {
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
}
