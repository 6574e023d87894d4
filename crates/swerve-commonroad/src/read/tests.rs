//! A hand-written scenario, damaged copies of it, and the scenarios among the test data.

use std::path::{Path, PathBuf};

use swerve_geom::Point2;
use swerve_tests::data_or_skip;

use crate::{GoalPosition, Motion, ObstacleKind, Scenario, Shape};

const SMALL: &str = include_str!("tests/small.xml");

#[test]
fn scenario_is_read_with_all_its_parts() {
    let scenario = Scenario::read("small.xml", SMALL).unwrap();
    assert_eq!((&*scenario.benchmark, scenario.step_s), ("ZAM_Small-1_1_T-1", 0.1));
    assert_eq!(scenario.roads.as_ref().unwrap().lights.len(), 1);
    let [fixed, car, set] = &scenario.obstacles[..] else { panic!("{:?}", scenario.obstacles) };
    assert_eq!((fixed.kind, &fixed.motion), (ObstacleKind::Car, &Motion::Static));
    assert_eq!(fixed.at(7), fixed.at(0));
    let Motion::Trajectory(states) = &car.motion else { panic!("{car:?}") };
    assert_eq!((states.len(), car.last_step()), (2, Some(2)));
    assert_eq!(car.at(2)[0].center(), Point2::new(12.0, 1.5));
    assert!(car.at(3).is_empty());
    assert!(matches!(&set.at(1)[..], [Shape::Circle(..)]) && matches!(&set.at(0)[..], [Shape::Rectangle(_)]));
    let [problem] = &scenario.problems[..] else { panic!("{:?}", scenario.problems) };
    assert_eq!((problem.id, problem.last_step(), problem.goals.len()), (9, 20, 2));
    assert_eq!(problem.goals[0].position, Some(GoalPosition::Lanelets(vec![1])));
    assert!(problem.goals[1].position.is_none() && problem.goals[1].speed_mps.is_none());
    assert_eq!(scenario.environment[0].kind, "building");
}

/// Replaced text, and a part of the message with its line.
#[test]
fn damaged_scenarios_are_refused_with_line_and_expectation() {
    let cases = [
        (
            "commonRoadVersion=\"2020a\"",
            "commonRoadVersion=\"2018b\"",
            ":2:",
            "expected version 2020a, found \"2018b\"",
        ),
        (
            "<lanelet ref=\"1\"/>",
            "<lanelet ref=\"7\"/>",
            ":87:",
            "expected the identity of a lanelet, found 7",
        ),
        ("<length>4.5</length>", "<length>-4.5</length>", ":28:", "`length`: expected 0.001 to 10000 m"),
        ("id=\"5\"", "id=\"4\"", ":38:", "expected an identity, found \"4\" twice"),
        ("timeStepSize=\"0.1\"", "timeStepSize=\"0\"", ":2:", "expected 0.001 to 10 s, found 0"),
        ("<radius>2</radius>", "", ":72:", "element `radius` is missing"),
        (
            "<intervalEnd>20</intervalEnd>",
            "<intervalEnd>1e9</intervalEnd>",
            ":",
            "whole number of time steps",
        ),
    ];
    for (from, to, place, message) in cases {
        assert!(SMALL.contains(from), "{from}");
        let error = Scenario::read("small.xml", &SMALL.replacen(from, to, 1)).unwrap_err().to_string();
        let line =
            error.lines().find(|line| line.contains(message)).unwrap_or_else(|| panic!("{from}: {error}"));
        assert!(line.starts_with(&format!("small.xml{place}")), "{line}");
    }
}

#[test]
fn states_out_of_sequence_are_defects() {
    let scenario =
        Scenario::read("small.xml", &SMALL.replacen("<exact>2</exact>", "<exact>5</exact>", 1)).unwrap();
    let defects = scenario.defects.to_string();
    assert!(defects.starts_with("small.xml:46:") && defects.contains("2 next, found 5"), "{defects}");
}

fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut paths: Vec<PathBuf> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    for path in paths {
        if path.is_dir() && !path.ends_with("checked") {
            files(&path, found);
        } else if path.to_string_lossy().ends_with(".xml.gz") {
            found.push(path);
        }
    }
}

#[test]
fn all_published_scenarios_are_read() {
    let Some(folder) = data_or_skip("worlds/commonroad") else { return };
    let mut paths = Vec::new();
    files(&folder, &mut paths);
    let (mut read, mut problems, mut obstacles) = (0, 0, 0);
    for path in paths {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let text = swerve_text::unpacked(std::fs::read(&path).unwrap()).unwrap();
        if !text.contains("<commonRoad ") || name.contains(".net.") || name.contains(".rou.") {
            continue;
        }
        match Scenario::read(&name, &text) {
            Ok(scenario) => {
                (read, problems) = (read + 1, problems + scenario.problems.len());
                obstacles += scenario.obstacles.len();
            }
            Err(error) => assert!(error.to_string().contains("found \"2018b\""), "{error}"),
        }
    }
    assert_eq!((read, problems, obstacles), (55, 54, 1352));
}
