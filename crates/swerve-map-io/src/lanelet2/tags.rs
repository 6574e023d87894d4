//! Meaning of tags: kinds of lanes, speed limits, directions.

use swerve_map::LaneKind;

use super::osm::{tag, tag_element};
use crate::problem::quoted;
use crate::xml::{Element, Reader, number};

/// Kind of a lanelet by its subtype; `None` for subtypes that Lanelet2 and Autoware do not have.
fn kind_of(subtype: &str) -> Option<LaneKind> {
    Some(match subtype {
        "road" | "highway" | "play_street" | "bus_lane" | "exit" => LaneKind::Driving,
        "road_shoulder" | "emergency_lane" => LaneKind::Shoulder,
        "bicycle_lane" => LaneKind::Cycling,
        "walkway" | "shared_walkway" | "crosswalk" | "stairs" | "pedestrian_lane" => LaneKind::Walking,
        "parking" => LaneKind::Parking,
        _ => return None,
    })
}

/// True for a participant, or the group that it is in; `None` if neither has a tag.
fn participates(of: Element<'_>, participants: &[&str]) -> Option<bool> {
    participants.iter().find_map(|one| tag(of, &format!("participant:{one}"))).map(is_yes)
}

pub(super) fn is_yes(value: &str) -> bool {
    !matches!(value, "no" | "false" | "0")
}

/// Kind of a lanelet: by its subtype; where participants exclude vehicles, by them.
pub(super) fn kind(xml: &mut Reader, lanelet: Element<'_>) -> LaneKind {
    let subtype = tag(lanelet, "subtype").unwrap_or_default();
    let found = kind_of(subtype);
    let may = |participants: &[&str]| participates(lanelet, participants);
    let vehicles = may(&["vehicle:car", "vehicle", "vehicle:bus", "vehicle:emergency"]);
    let (bicycles, people) = (may(&["bicycle"]), may(&["pedestrian"]));
    let by_participants = match (vehicles, bicycles, people) {
        (Some(true), _, _) => Some(LaneKind::Driving),
        (_, Some(true), _) => Some(LaneKind::Cycling),
        (_, _, Some(true)) => Some(LaneKind::Walking),
        _ => None,
    };
    if found.is_none() {
        let name = by_participants.unwrap_or_default();
        xml.defect(lanelet, || {
            format!("`subtype`: expected one of Lanelet2, found {}: read as {name:?}", quoted(subtype))
        });
    }
    match found {
        // Lanes of other kinds may admit vehicles, too.
        Some(LaneKind::Driving) | None => by_participants.or(found).unwrap_or_default(),
        Some(kind) => kind,
    }
}

/// True if vehicles may use a lanelet in both directions.
pub(super) fn is_both_ways(lanelet: Element<'_>) -> bool {
    let one_way = tag(lanelet, "one_way:vehicle").or_else(|| tag(lanelet, "one_way"));
    one_way.is_some_and(|one_way| !is_yes(one_way))
}

/// Speed limit in a tag, m/s; `None` without one, or for `none` and `null`.
pub(super) fn speed(xml: &mut Reader, of: Element<'_>, key: &str) -> Option<f64> {
    let at = tag_element(of, key)?;
    let text = at.attribute("v").unwrap_or_default().trim();
    if matches!(text, "" | "none" | "null" | "None" | "Null" | "unlimited") {
        return None;
    }
    let speed_mps = speed_of(text);
    if speed_mps.is_none() {
        xml.defect(at, || format!("expected a speed with km/h, mph or m/s, found {}", quoted(text)));
    }
    speed_mps
}

/// Speed in a text, m/s: a positive number with km/h (default), mph or m/s.
pub(super) fn speed_of(text: &str) -> Option<f64> {
    let end =
        text.find(|c: char| !(c.is_ascii_digit() || matches!(c, '.' | '+' | '-'))).unwrap_or(text.len());
    let value = number(&text[..end]).ok().filter(|value| *value > 0.0)?;
    let unit: String = text[end..].chars().filter(|c| !c.is_whitespace()).collect::<String>().to_lowercase();
    let scale = match &*unit {
        "" | "km/h" | "kmh" | "kph" => 1.0 / 3.6,
        "mph" | "mi/h" => 0.44704,
        "m/s" | "mps" => 1.0,
        _ => return None,
    };
    Some(value * scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speeds_are_read_with_their_units() {
        let cases = [
            ("36", Some(10.0)),
            ("36 km/h", Some(10.0)),
            ("36kmh", Some(10.0)),
            ("36.0 KM/H", Some(10.0)),
            ("50mph", Some(22.352)),
            ("13.9 m/s", Some(13.9)),
            ("13.9mps", Some(13.9)),
            ("-5", None),
            ("0", None),
            ("fast", None),
            ("50 knots", None),
            ("50 µm", None),
            ("NaN", None),
        ];
        for (text, expected) in cases {
            let found = speed_of(text);
            let is_equal = match (found, expected) {
                (Some(found), Some(expected)) => f64::abs(found - expected) < 1e-12,
                (found, expected) => found == expected,
            };
            assert!(is_equal, "{text}: {found:?}");
        }
    }
}
