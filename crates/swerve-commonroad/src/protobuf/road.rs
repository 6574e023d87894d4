//! Lanelets, traffic signs and lights, intersections.

use super::wire::{Message, Writer};
use super::{Done, named, point};

/// Names of the types of lanelets.
const LANELETS: [&str; 20] = [
    "urban",
    "country",
    "highway",
    "driveWay",
    "mainCarriageWay",
    "accessRamp",
    "exitRamp",
    "shoulder",
    "busLane",
    "busStop",
    "bicycleLane",
    "sidewalk",
    "crosswalk",
    "interstate",
    "intersection",
    "border",
    "parking",
    "restricted",
    "restrictedArea",
    "unknown",
];

/// Names of road users.
const USERS: [&str; 10] = [
    "vehicle",
    "car",
    "truck",
    "bus",
    "priorityVehicle",
    "motorcycle",
    "bicycle",
    "pedestrian",
    "train",
    "taxi",
];

/// Colours of lights.
const COLORS: [&str; 5] = ["red", "redYellow", "green", "yellow", "inactive"];

/// Directions that lights are for.
const DIRECTIONS: [&str; 7] =
    ["right", "straight", "left", "leftStraight", "straightRight", "leftRight", "all"];

/// Signs that are read: field of the country, value of its enumeration, identity in its catalogue.
const SIGNS: [(u64, u64, &str); 19] = [
    (1, 16, "205"),
    (1, 17, "206"),
    (1, 57, "274"),
    (1, 58, "274.1"),
    (2, 16, "205"),
    (2, 17, "206"),
    (2, 57, "274"),
    (2, 58, "274.1"),
    (3, 0, "R2-1"),
    (4, 0, "274"),
    (5, 7, "R301"),
    (7, 0, "3.24"),
    (8, 0, "R15"),
    (9, 0, "C43"),
    (10, 0, "B14"),
    (11, 0, "R-32"),
    (12, 0, "B31"),
    (13, 0, "FIG_50"),
    (14, 0, "R2-1"),
];

/// Largest field of a country in an element of a sign.
const COUNTRIES_MAX: u64 = 14;

pub(super) fn lanelet(xml: &mut Writer, of: &Message<'_>) -> Done {
    xml.open_with("lanelet", &[("id", &of.whole(1, "lanelet_id")?.to_string())]);
    for (number, field, element) in [(2, "left_bound", "leftBound"), (3, "right_bound", "rightBound")] {
        xml.open(element);
        for at in of.only(number, field)?.all(1, "points") {
            point(xml, "point", &at?)?;
        }
        xml.close(element);
    }
    refs(xml, of, &[(4, "predecessors", "predecessor"), (5, "successors", "successor")])?;
    for (number, direction, element) in [(6, 8, "adjacentLeft"), (7, 9, "adjacentRight")] {
        let Some(beside) = of.maybe_whole(number, element)? else { continue };
        let is_opposite = of.maybe_whole(direction, "driving_dir")? == Some(1);
        let direction = if is_opposite { "opposite" } else { "same" };
        xml.empty_with(element, &[("ref", &beside.to_string()), ("drivingDir", direction)]);
    }
    if let Some(line) = of.maybe(10, "stop_line")? {
        xml.open("stopLine");
        for at in line.all(1, "points") {
            point(xml, "point", &at?)?;
        }
        xml.leaf("lineMarking", "solid");
        let named =
            [(3, "traffic_sign_refs", "trafficSignRef"), (4, "traffic_light_refs", "trafficLightRef")];
        refs(xml, &line, &named)?;
        xml.close("stopLine");
    }
    for (number, field, element, names) in [
        (11, "lanelet_types", "laneletType", &LANELETS[..]),
        (12, "user_one_way", "userOneWay", &USERS),
        (13, "user_bidirectional", "userBidirectional", &USERS),
    ] {
        for value in of.wholes(number, field)? {
            xml.leaf(element, named(names, value));
        }
    }
    refs(
        xml,
        of,
        &[(14, "traffic_sign_refs", "trafficSignRef"), (15, "traffic_light_refs", "trafficLightRef")],
    )?;
    xml.close("lanelet");
    Ok(())
}

/// Elements that name others.
fn refs<'a>(xml: &mut Writer, of: &Message<'a>, fields: &[(u64, &'a str, &str)]) -> Done {
    for (number, field, element) in fields {
        for id in of.wholes(*number, field)? {
            xml.empty_with(element, &[("ref", &id.to_string())]);
        }
    }
    Ok(())
}

pub(super) fn sign(xml: &mut Writer, of: &Message<'_>) -> Done {
    xml.open_with("trafficSign", &[("id", &of.whole(1, "traffic_sign_id")?.to_string())]);
    for element in of.all(2, "traffic_sign_elements") {
        let element = element?;
        let mut id = None;
        for country in 1..=COUNTRIES_MAX {
            let Some(value) = element.maybe_whole(country, "traffic_sign_element_id")? else { continue };
            id = SIGNS.iter().find(|(of, sign, _)| (*of, *sign) == (country, value)).map(|(.., id)| *id);
        }
        xml.open("trafficSignElement");
        xml.leaf("trafficSignID", id.unwrap_or("unknown"));
        for value in element.texts(15, "additional_values")? {
            xml.leaf("additionalValue", value);
        }
        xml.close("trafficSignElement");
    }
    place(xml, of, 4)?;
    xml.close("trafficSign");
    Ok(())
}

fn place(xml: &mut Writer, of: &Message<'_>, number: u64) -> Done {
    if let Some(at) = of.maybe(number, "position")? {
        xml.open("position");
        point(xml, "point", &at)?;
        xml.close("position");
    }
    Ok(())
}

pub(super) fn light(xml: &mut Writer, of: &Message<'_>) -> Done {
    xml.open_with("trafficLight", &[("id", &of.whole(1, "traffic_light_id")?.to_string())]);
    let mut phases = of.all(2, "cycle_elements").peekable();
    if phases.peek().is_some() {
        xml.open("cycle");
        for phase in phases {
            let phase = phase?;
            xml.open("cycleElement");
            xml.leaf("duration", &phase.whole(1, "duration")?.to_string());
            xml.leaf("color", named(&COLORS, phase.whole(2, "color")?));
            xml.close("cycleElement");
        }
        if let Some(offset) = of.maybe_whole(4, "time_offset")? {
            xml.leaf("timeOffset", &offset.to_string());
        }
        xml.close("cycle");
    }
    place(xml, of, 3)?;
    if let Some(direction) = of.maybe_whole(5, "direction")? {
        xml.leaf("direction", named(&DIRECTIONS, direction));
    }
    if let Some(active) = of.maybe_whole(6, "active")? {
        xml.leaf("active", if active == 0 { "false" } else { "true" });
    }
    xml.close("trafficLight");
    Ok(())
}

pub(super) fn intersection(xml: &mut Writer, of: &Message<'_>) -> Done {
    xml.open_with("intersection", &[("id", &of.whole(1, "intersection_id")?.to_string())]);
    for incoming in of.all(2, "incomings") {
        let incoming = incoming?;
        xml.open_with("incoming", &[("id", &incoming.whole(1, "incoming_id")?.to_string())]);
        refs(
            xml,
            &incoming,
            &[
                (2, "incoming_lanelets", "incomingLanelet"),
                (3, "successors_right", "successorsRight"),
                (4, "successors_straight", "successorsStraight"),
                (5, "successors_left", "successorsLeft"),
            ],
        )?;
        if let Some(left) = incoming.maybe_whole(6, "is_left_of")? {
            xml.empty_with("isLeftOf", &[("ref", &left.to_string())]);
        }
        xml.close("incoming");
    }
    let crossings = of.wholes(3, "crossing_lanelets")?;
    if !crossings.is_empty() {
        xml.open("crossing");
        for id in crossings {
            xml.empty_with("crossingLanelet", &[("ref", &id.to_string())]);
        }
        xml.close("crossing");
    }
    xml.close("intersection");
    Ok(())
}
