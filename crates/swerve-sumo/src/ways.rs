//! Ways of vehicles in route files, for the ego.

use std::collections::BTreeSet;

use swerve_map_io::Problems;
use swerve_map_io::xml::{Element, parse};

/// Edges of the ways that route files contain: whole routes, or begin and end of trips; the first ones of the file.
///
/// # Errors
/// If the file is not XML.
pub fn ways(file: &str, text: &str, most: usize) -> Result<Vec<Vec<String>>, Problems> {
    let document = parse(file, text)?;
    let elements = document.descendants().filter(Element::is_element);
    Ok(elements.filter_map(way).take(most).collect())
}

/// Edges of a route, trip or flow.
fn way(at: Element<'_>) -> Option<Vec<String>> {
    let list = |text: &str| -> Vec<String> { text.split_whitespace().map(str::to_owned).collect() };
    let edges = match at.tag_name().name() {
        "route" => list(at.attribute("edges")?),
        "trip" | "flow" | "vehicle" => {
            let via = at.attribute("via").map(list).unwrap_or_default();
            let ends = [at.attribute("from")?, at.attribute("to")?].map(str::to_owned);
            let [from, to] = ends;
            [vec![from], via, vec![to]].concat()
        }
        _ => return None,
    };
    (!edges.is_empty()).then_some(edges)
}

/// Names of the lanes of a net on which cars may drive.
///
/// # Errors
/// If the file is not XML.
pub fn car_lanes(file: &str, text: &str) -> Result<BTreeSet<String>, Problems> {
    let document = parse(file, text)?;
    let lists = |list: &str| list.split_whitespace().any(|class| class == "passenger" || class == "all");
    let is_open = |lane: &Element<'_>| match (lane.attribute("allow"), lane.attribute("disallow")) {
        (Some(allow), _) => lists(allow),
        (None, Some(disallow)) => !lists(disallow),
        (None, None) => true,
    };
    let lanes = document.descendants().filter(|node| node.has_tag_name("lane")).filter(is_open);
    Ok(lanes.filter_map(|lane| lane.attribute("id").map(str::to_owned)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ways_are_those_of_routes_and_trips_in_order() {
        let text = "<routes><vType id=\"v\"/><trip id=\"t\" from=\"a\" to=\"c\" via=\"b\"/><vehicle id=\"w\">\
                    <route edges=\"d e\"/></vehicle><flow id=\"f\" route=\"r\"/><route id=\"r\" edges=\"\"/></routes>";
        let found = ways("r.rou.xml", text, 9).unwrap();
        assert_eq!(found, [vec!["a", "b", "c"], vec!["d", "e"]]);
        assert_eq!(ways("r.rou.xml", text, 1).unwrap().len(), 1);
        assert!(ways("r.rou.xml", "<routes>", 1).is_err());
    }
}
