//! Recorded motion of actors.

use std::sync::Arc;

use swerve_geom::Pose2;
use swerve_text::{Range, TableReader};
use toml::Value;

use super::PLACE;
use crate::{Actor, Motion, Track};

/// Most poses of a track.
const POSES_MAX: usize = 100_000;

/// Values of `reactive`.
const REACTIVE: [&str; 2] = ["off", "idm"];

/// Reads the table `track`; without poses after a problem.
pub(super) fn read(table: &TableReader<'_>) -> Track {
    let Some(track) = table.table("track") else { return none() };
    let from_s = track.number_or("from_s", 0.0, Range::between(0.0, 86_400.0));
    let step_s = track.number("step_s", Range::between(0.001, 10.0));
    let points = track.pairs("at", "an array of pairs [x, y] in metres", [PLACE, PLACE]);
    let headings_rad = headings(&track);
    if points.len() > POSES_MAX {
        track.report("at", format!("expected at most {POSES_MAX} poses, found {}", points.len()));
    }
    let are_read = !points.is_empty() && !headings_rad.is_empty();
    if are_read && points.len() != headings_rad.len() {
        let (at, headings) = (points.len(), headings_rad.len());
        track.report("heading_rad", format!("expected {at} numbers as in `at`, found {headings}"));
    }
    track.finish();
    let poses: Arc<[Pose2]> =
        points.iter().zip(headings_rad).map(|([x, y], heading)| Pose2::new(*x, *y, heading)).collect();
    match poses.is_empty() {
        true => none(),
        false => Track { from_s, step_s, poses, reacts: false },
    }
}

/// Reads the key `reactive` of the scenario, which applies to all recorded motion.
pub(super) fn react(top: &TableReader<'_>, actors: &mut [Actor]) {
    let reacts = top.one_of_if_any("reactive", &REACTIVE) == Some(1);
    for leg in actors.iter_mut().flat_map(|actor| &mut actor.motion) {
        if let Motion::Track(track) = leg {
            track.reacts = reacts;
        }
    }
}

/// Values after a problem.
fn none() -> Track {
    Track { from_s: 0.0, step_s: 0.1, poses: Arc::from([Pose2::default()]), reacts: false }
}

fn headings(track: &TableReader<'_>) -> Vec<f64> {
    const WANTED: &str = "an array of headings in radians";
    let Some(value) = track.value("heading_rad") else {
        track.report("heading_rad", format!("is missing: expected {WANTED}"));
        track.reading().guess();
        return Vec::new();
    };
    let number = |value: &Value| match value {
        Value::Float(number) => Some(*number).filter(|number| number.is_finite() && number.abs() <= 100.0),
        Value::Integer(number) => Some(*number as f64).filter(|number| number.abs() <= 100.0),
        _ => None,
    };
    let read = value.as_array().and_then(|all| all.iter().map(number).collect::<Option<Vec<f64>>>());
    read.unwrap_or_else(|| {
        track.mistyped("heading_rad", WANTED, value);
        track.reading().guess();
        Vec::new()
    })
}

#[cfg(test)]
mod tests {
    use crate::{MapText, Scenario};

    /// A straight lane of 100 m along x.
    const MAP: &str = "<commonRoad commonRoadVersion=\"2020a\"><lanelet id=\"1\">\
        <leftBound><point><x>0</x><y>2</y></point><point><x>100</x><y>2</y></point></leftBound>\
        <rightBound><point><x>0</x><y>-2</y></point><point><x>100</x><y>-2</y></point></rightBound>\
        <laneletType>urban</laneletType></lanelet></commonRoad>";

    fn read(track: &str) -> Result<Scenario, String> {
        read_with(track, &[])
    }

    fn read_with(track: &str, sets: &[(String, toml::Value)]) -> Result<Scenario, String> {
        let text = format!(
            "name = \"x\"\nseeded = false\n[map]\nfile = \"x.xml\"\n[ego]\ntarget_speed_mps = 10.0\n\
             start = {{ lane = \"1\", s_m = 10.0 }}\ngoal = {{ lane = \"1\", s_m = 90.0 }}\n\
             [[actor]]\nname = \"car\"\nkind = \"car\"\ntrack = {{ {track} }}\n"
        );
        let map = MapText::from(MAP);
        Scenario::parse_on("x.toml", &text, Some(&map), sets).map_err(|problems| problems.to_string())
    }

    #[test]
    fn track_is_read_and_not_varied() {
        let scenario =
            read("from_s = 0.5, step_s = 0.1, at = [[5.0, 1.0], [6.0, 1.0]], heading_rad = [0.0, 0.1]")
                .unwrap();
        let track = scenario.actors[0].track().unwrap();
        assert_eq!((track.from_s, track.step_s, track.poses.len()), (0.5, 0.1, 2));
        assert_eq!((track.poses[1].x_m, track.poses[1].heading_rad), (6.0, 0.1));
        assert_eq!(scenario.drawn(7), scenario);
    }

    #[test]
    fn recorded_vehicles_react_if_the_scenario_says_so() {
        let track = "step_s = 0.1, at = [[5.0, 1.0]], heading_rad = [0.0]";
        for (value, expected) in [("idm", Ok(true)), ("off", Ok(false)), ("mobil", Err("expected one of"))] {
            let set = [("reactive".to_owned(), toml::Value::from(value))];
            let found = read_with(track, &set).map(|scenario| scenario.actors[0].track().unwrap().reacts);
            match expected {
                Ok(reacts) => assert_eq!(found, Ok(reacts), "{value}"),
                Err(message) => assert!(found.clone().unwrap_err().contains(message), "{found:?}"),
            }
        }
    }

    #[test]
    fn wrong_tracks_are_reported() {
        for (track, message) in [
            ("at = [[5.0, 1.0]], heading_rad = [0.0]", "step_s"),
            ("step_s = 0.1, at = [], heading_rad = [0.0]", "found an empty array"),
            (
                "step_s = 0.1, at = [[5.0, 1.0]], heading_rad = [0.0, 0.1]",
                "expected 1 numbers as in `at`, found 2",
            ),
            ("step_s = 0.1, at = [[5.0, 1.0]], heading_rad = [nan]", "an array of headings in radians"),
            ("step_s = 0.1, at = [[5.0, 1.0]], heading_rad = [0.0], speed = 1", "speed"),
        ] {
            let error = read(track).unwrap_err();
            assert!(error.contains(message), "{track}: {error}");
        }
    }
}
