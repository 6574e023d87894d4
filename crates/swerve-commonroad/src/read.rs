//! Reader of scenario files.

mod goals;
mod motion;
mod shapes;
pub(crate) mod values;

use std::collections::{BTreeMap, BTreeSet};

use swerve_geom::Point2;
use swerve_map_io::commonroad::{self, Centers};
use swerve_map_io::content::{all, child};
use swerve_map_io::xml::{Element, Reader, parse};
use swerve_map_io::{Problems, quoted};

use crate::{Beside, Environment, Lanelet, OBSTACLES_MAX, Scenario};

/// The version that is read.
const VERSION: &str = "2020a";

impl Scenario {
    /// Reads the text of a file; `swerve_text::unpacked` makes it of the bytes of an `.xml.gz`.
    ///
    /// # Errors
    /// All faults of the file, those of its roads included.
    pub fn read(file: &str, text: &str) -> Result<Self, Problems> {
        let document = parse(file, text)?;
        let root = document.root_element();
        let mut xml = Reader::default();
        if !is_scenario(&mut xml, root) {
            return Err(xml.finish(file, text).0);
        }
        let step_s = xml.number(root, "timeStepSize");
        if root.has_attribute("timeStepSize") && !(0.001..=10.0).contains(&step_s) {
            xml.fault_in(root, "timeStepSize", || format!("expected 0.001 to 10 s, found {step_s}"));
        }
        let lanelets = lanelets(&mut xml, root);
        let obstacles = motion::obstacles(&mut xml, root);
        let environment = environment(&mut xml, root);
        let problems = goals::problems(&mut xml, root, &lanelets);
        identities(&mut xml, root);
        let is_whole = xml.faults() == 0;
        let (faults, defects, _) = xml.finish(file, text);
        if !is_whole {
            return Err(faults.with(&defects));
        }
        let roads = match lanelets.is_empty() {
            true => None,
            false => Some(commonroad::read(file, text, Centers::Rounded)?),
        };
        let benchmark = root.attribute("benchmarkID").unwrap_or_default().to_owned();
        Ok(Self { benchmark, step_s, roads, lanelets, obstacles, environment, problems, defects })
    }
}

/// True if the root is that of a scenario of the version that is read.
fn is_scenario(xml: &mut Reader, root: Element<'_>) -> bool {
    let name = root.tag_name().name();
    if name != "commonRoad" {
        xml.fault(root, || format!("expected the element `commonRoad`, found {}", quoted(name)));
        return false;
    }
    match root.attribute("commonRoadVersion") {
        Some(VERSION) => true,
        Some(version) => {
            xml.fault_in(root, "commonRoadVersion", || {
                format!("expected version {VERSION}, found {}", quoted(version))
            });
            false
        }
        None => {
            xml.missing(root, "commonRoadVersion");
            false
        }
    }
}

fn lanelets(xml: &mut Reader, root: Element<'_>) -> BTreeMap<u32, Lanelet> {
    let mut lanelets = BTreeMap::new();
    for at in all(root, "lanelet") {
        let Some(id) = xml.identity(at, "id") else { continue };
        let [left, right] = ["leftBound", "rightBound"].map(|name| bound(xml, at, name));
        let beside = ["adjacentLeft", "adjacentRight"].map(|name| {
            let at = child(at, name)?;
            let opposite = at.attribute("drivingDir") == Some("opposite");
            Some(Beside { lanelet: xml.identity(at, "ref")?, opposite })
        });
        lanelets.entry(id).or_insert(Lanelet { left, right, beside });
    }
    lanelets
}

fn bound(xml: &mut Reader, at: Element<'_>, name: &str) -> Vec<Point2> {
    let Some(bound) = xml.child(at, name) else { return Vec::new() };
    all(bound, "point").map(|point| values::coordinates(xml, point)).collect()
}

fn environment(xml: &mut Reader, root: Element<'_>) -> Vec<Environment> {
    let mut found = Vec::new();
    for at in all(root, "environmentObstacle").take(OBSTACLES_MAX) {
        let Some(id) = xml.identity(at, "id") else { continue };
        let kind = child(at, "type").and_then(|kind| kind.text()).unwrap_or_default().trim().to_owned();
        let Some(shape) = xml.child(at, "shape") else { continue };
        found.push(Environment { id, kind, shapes: shapes::shapes(xml, shape) });
    }
    found
}

/// Reports identities of obstacles and planning problems that are there twice.
fn identities(xml: &mut Reader, root: Element<'_>) {
    const NAMED: [&str; 5] =
        ["staticObstacle", "dynamicObstacle", "environmentObstacle", "phantomObstacle", "planningProblem"];
    let mut ids = BTreeSet::new();
    for at in root.children().filter(|at| NAMED.contains(&at.tag_name().name())) {
        let Some(id) = at.attribute("id") else { continue };
        if !ids.insert(id.trim()) {
            xml.fault_in(at, "id", || format!("expected an identity, found {} twice", quoted(id)));
        }
    }
}

#[cfg(test)]
mod tests;
