use crate::{Direction, Motion, Scenario, Subject, Trigger};

const TRUCK: &str = include_str!("../../../../scenarios/person_behind_truck.toml");

#[test]
fn the_person_behind_the_truck_is_read_as_written() {
    let scenario = Scenario::parse("person.toml", TRUCK).unwrap();
    let person = &scenario.actors[1];
    assert_eq!(
        (person.s_m, person.d_m, person.extent.width_m, person.extent.height_m),
        (117.0, 4.5, 0.5, 1.8)
    );
    assert_eq!(person.trigger, Some(Trigger::Distance { to: Subject::Ego, within_m: 26.0 }));
    let walk = Motion::Walk { speed_mps: 2.75, distance_m: 4.5, direction: Direction::Right };
    assert_eq!(person.motion, [walk]);
    assert_eq!(scenario.ego.end_m, 180.0);
}
