//! A scenario made of bytes, damaged copies of it, and the files among the test data with their twins in XML.

use swerve_tests::data_or_skip;

use super::*;
use crate::{Motion, Obstacle, ObstacleKind, Scenario};

/// A field with a whole number.
fn whole(number: u8, value: u8) -> Vec<u8> {
    assert!(value < 128);
    let mut bytes = varint(u32::from(number) << 3);
    bytes.push(value);
    bytes
}

/// A field with a number of 64 bits.
fn real(number: u8, value: f64) -> Vec<u8> {
    let mut bytes = varint(u32::from(number) << 3 | 1);
    bytes.extend(value.to_le_bytes());
    bytes
}

/// A field with a message or text.
fn part(number: u8, parts: &[Vec<u8>]) -> Vec<u8> {
    let content = parts.concat();
    let mut bytes = varint(u32::from(number) << 3 | 2);
    bytes.extend(varint(content.len() as u32));
    bytes.extend(content);
    bytes
}

fn varint(mut value: u32) -> Vec<u8> {
    let mut bytes = Vec::new();
    while value >= 128 {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
    bytes
}

fn point(number: u8, x: f64, y: f64) -> Vec<u8> {
    part(number, &[real(1, x), real(2, y)])
}

fn state(number: u8, x: f64, y: f64, speed_mps: f64, step: u8) -> Vec<u8> {
    let exact = |field, value| part(field, &[real(1, value)]);
    part(number, &[point(1, x, y), exact(3, 0.0), exact(4, speed_mps), part(39, &[whole(1, step)])])
}

/// A lane of 100 m with a limit of 13 m/s, a car and a planning problem.
fn scenario(length_m: f64) -> Vec<u8> {
    let bound = |number, y| part(number, &[point(1, 0.0, y), point(1, 100.0, y)]);
    let rectangle = part(1, &[real(1, length_m), real(2, 2.0)]);
    let limit = part(2, &[whole(1, 57), part(15, &[b"13.0".to_vec()])]);
    let trajectory = part(1, &[whole(1, 1), state(2, 41.0, 1.5, 10.0, 1), state(2, 42.0, 1.5, 10.0, 2)]);
    let times = part(39, &[part(2, &[whole(1, 10), whole(2, 20)])]);
    [
        part(1, &[part(1, &[b"2020a".to_vec()]), part(2, &[b"ZAM_Small-1_1_T-1".to_vec()]), real(7, 0.1)]),
        // Packed type of lanelet, and a reference that is not packed.
        part(4, &[whole(1, 1), bound(2, 3.0), bound(3, 0.0), part(11, &[vec![0]]), whole(14, 7)]),
        part(5, &[whole(1, 7), limit]),
        part(
            9,
            &[
                whole(1, 5),
                whole(2, 2),
                part(3, std::slice::from_ref(&rectangle)),
                state(4, 40.0, 1.5, 10.0, 0),
                part(5, &[trajectory, part(2, &[rectangle])]),
            ],
        ),
        part(12, &[whole(1, 9), state(2, 20.0, 1.5, 10.0, 0), part(3, &[part(1, &[times]), whole(2, 1)])]),
    ]
    .concat()
}

fn read(bytes: &[u8]) -> Scenario {
    let xml = xml_of_protobuf(bytes).unwrap();
    Scenario::read("x.pb", &xml).unwrap_or_else(|problems| panic!("{problems}\n{xml}"))
}

#[test]
fn scenario_is_read_with_all_its_parts() {
    let scenario = read(&scenario(4.5));
    assert_eq!((&*scenario.benchmark, scenario.step_s), ("ZAM_Small-1_1_T-1", 0.1));
    let roads = scenario.roads.as_ref().unwrap();
    assert_eq!(roads.signs[0].speed_limit_mps, Some(13.0));
    let [truck] = &scenario.obstacles[..] else { panic!("{:?}", scenario.obstacles) };
    let Motion::Trajectory(states) = &truck.motion else { panic!("{truck:?}") };
    assert_eq!((truck.kind, states.len(), states[1].position.x_m), (ObstacleKind::Truck, 2, 42.0));
    let [problem] = &scenario.problems[..] else { panic!("{:?}", scenario.problems) };
    assert_eq!((problem.id, problem.last_step(), problem.initial.speed_mps), (9, 20, 10.0));
}

#[test]
fn damaged_files_are_refused_with_place_and_expectation() {
    let whole_file = scenario(4.5);
    let message = |bytes: &[u8]| xml_of_protobuf(bytes).unwrap_err().to_string();
    let cut = message(&whole_file[..whole_file.len() - 3]);
    assert!(cut.contains("more bytes, found") && cut.contains("the file is cut off"), "{cut}");
    let nan = message(&scenario(f64::NAN));
    assert!(
        nan.contains("dynamic_obstacles.shape.rectangle.length: expected a finite number, found NaN"),
        "{nan}"
    );
    assert_eq!(message(&[]), "byte 0: information: is missing");
    let xml = message(b"<?xml version=\"1.0\"?><commonRoad/>");
    assert!(xml.contains("no scenario in the protobuf format"), "{xml}");
    let pickle = message(b"\x80\x04\x95\x10\x00\x00\x00\x00\x00\x00\x00}\x94(\x8c\x01a\x94K\x01u.");
    assert!(pickle.contains("protobuf") || pickle.contains("missing"), "{pickle}");
    // Groups of shapes in each other.
    let deep = (0..40).fold(part(1, &[real(1, 1.0), real(2, 1.0)]), |inner, _| part(4, &[part(1, &[inner])]));
    let information = part(1, &[part(1, &[b"2020a".to_vec()]), part(2, &[b"x".to_vec()]), real(7, 0.1)]);
    let obstacle = part(10, &[whole(1, 5), whole(2, 13), part(3, &[deep])]);
    let deep = message(&[information, obstacle].concat());
    assert!(deep.contains("at most 8 groups of shapes"), "{deep}");
}

/// Every cut, and every byte replaced by several others.
#[test]
fn no_damage_makes_the_reader_fail_otherwise() {
    let bytes = scenario(4.5);
    let try_all = |bytes: &[u8]| {
        if let Ok(xml) = xml_of_protobuf(bytes) {
            let _read = Scenario::read("x.pb", &xml);
        }
    };
    (0..bytes.len()).for_each(|count| try_all(&bytes[..count]));
    for k in 0..bytes.len() {
        for other in [0, 1, 0x7f, 0x80, 0xff, bytes[k] ^ 0x08] {
            let mut damaged = bytes.clone();
            damaged[k] = other;
            try_all(&damaged);
        }
    }
}

fn sorted(scenario: &Scenario) -> Vec<Obstacle> {
    let mut obstacles = scenario.obstacles.clone();
    obstacles.sort_by_key(|obstacle| obstacle.id);
    obstacles
}

#[test]
fn files_of_the_test_data_are_the_scenarios_of_their_twins_in_xml() {
    let Some(folder) = data_or_skip("worlds/commonroad/format") else { return };
    let pb = |name: &str| read(&std::fs::read(folder.join(format!("{name}.pb"))).unwrap());
    let xml = |name: &str| {
        let bytes = std::fs::read(folder.join(format!("{name}.xml.gz"))).unwrap();
        Scenario::read(name, &swerve_text::unpacked(bytes).unwrap()).unwrap()
    };
    let (one, twin) = (pb("FRA_Anglet-1_1_T-1"), xml("FRA_Anglet-1_1_T-1"));
    assert_eq!((&one.benchmark, one.step_s, &one.problems), (&twin.benchmark, twin.step_s, &twin.problems));
    assert_eq!(one.lanelets, twin.lanelets);
    assert_eq!(sorted(&one), sorted(&twin));
    let (roads, expected) = (one.roads.unwrap(), twin.roads.unwrap());
    // The twin names the signs of France by the German catalogue.
    let signs = |roads: &swerve_map_io::commonroad::Commonroad| {
        let signs = roads.signs.iter().map(|sign| (sign.id, sign.speed_limit_mps, sign.position_m));
        signs.collect::<Vec<_>>()
    };
    assert_eq!((signs(&roads), &roads.lights), (signs(&expected), &expected.lights));
    assert_eq!(roads.lanes.map, expected.lanes.map);
    let recorded = pb("USA_Lanker-1_11_T-1");
    assert!(recorded.obstacles.len() > 10 && recorded.roads.unwrap().lights.len() > 1);
    let old = std::fs::read(folder.join("test_reading_ks_state.pb")).unwrap();
    let refused = Scenario::read("old.pb", &xml_of_protobuf(&old).unwrap()).unwrap_err().to_string();
    assert!(refused.contains("expected version 2020a, found \"2018b\""), "{refused}");
}
