//! Reading of files: elements to a [`Network`].

mod furniture;
mod junctions;
mod lanes;
mod references;
mod roads;
pub(crate) mod sections;

use std::collections::{BTreeMap, BTreeSet};

use super::{Header, LENGTH_MAX_M, Network};
use crate::cubic::{Cubic, Cubics};
use crate::problem::{Problems, quoted};
use crate::xml::{Element, Reader, optional, parse};

use references::Reference;

/// Revisions that are read; older ones as the first.
const MINOR: [i32; 2] = [4, 8];

/// State of the reading of a file.
#[derive(Default)]
struct Reading<'a> {
    xml: Reader,
    /// References to other elements, resolved when all are read.
    references: Vec<Reference<'a>>,
    /// Pieces of lanes that are split.
    pieces: usize,
}

/// Reads a network.
pub(super) fn network(file: &str, text: &str) -> Result<Network, Problems> {
    let document = parse(file, text)?;
    let root = document.root_element();
    let mut reading = Reading::default();
    let mut network = Network::default();
    if root.tag_name().name() == "OpenDRIVE" {
        reading.root(root, &mut network);
        references::resolve(&mut reading.xml, std::mem::take(&mut reading.references), &network);
        if reading.xml.faults() == 0 {
            reading.split_at_joints(root, &mut network);
        }
    } else {
        reading.xml.fault(root, || "expected the element `OpenDRIVE`".to_owned());
    }
    let (faults, defects, unknown) = reading.xml.finish(file, text);
    if faults.count() > 0 {
        return Err(faults.with(&defects));
    }
    Ok(Network { defects, unknown, ..network })
}

impl<'a> Reading<'a> {
    fn root(&mut self, root: Element<'a>, network: &mut Network) {
        const KNOWN: [&str; 7] =
            ["header", "road", "junction", "controller", "junctionGroup", "station", "userData"];
        let mut has_header = false;
        let (mut road_ids, mut junction_ids) = (BTreeMap::new(), BTreeSet::new());
        let mut controller_ids = BTreeSet::new();
        for child in self.xml.children(root, &KNOWN) {
            match child.tag_name().name() {
                "header" => {
                    has_header = true;
                    network.header = self.header(child);
                }
                "road" => {
                    let road = self.road(child, network.roads.len());
                    self.only_once(
                        child,
                        &road.id,
                        road_ids.insert(road.id.clone(), network.roads.len()).is_none(),
                    );
                    network.roads.push(road);
                }
                "junction" => {
                    let junction = self.junction(child, network.junctions.len());
                    self.only_once(child, &junction.id, junction_ids.insert(junction.id.clone()));
                    network.junctions.push(junction);
                }
                "controller" => {
                    let controller = self.controller(child);
                    self.only_once(child, &controller.id, controller_ids.insert(controller.id.clone()));
                    network.controllers.push(controller);
                }
                _ => {}
            }
        }
        if !has_header {
            self.xml.fault(root, || "element `header` is missing".to_owned());
        }
        let length_m: f64 = network.roads.iter().map(|road| road.length_m).sum();
        if length_m > LENGTH_MAX_M {
            self.xml.fault(root, || {
                format!("expected roads of at most {LENGTH_MAX_M} m together, found {length_m} m")
            });
        }
        network.road_of = road_ids;
    }

    /// Reports the second use of an identity.
    fn only_once(&mut self, at: Element<'_>, id: &str, is_first: bool) {
        if !is_first {
            self.xml.fault_in(at, "id", || {
                format!("expected an identity that no other has, found {} again", quoted(id))
            });
        }
    }

    fn header(&mut self, at: Element<'a>) -> Header {
        let major = self.xml.integer(at, "revMajor");
        let minor = self.xml.integer(at, "revMinor");
        let mut header =
            Header { name: optional(at, "name"), vendor: optional(at, "vendor"), ..Header::default() };
        if let (Some(major), Some(minor)) = (major, minor) {
            let [low, high] = MINOR;
            if major == 1 && (0..low).contains(&minor) {
                self.xml.defect(at, || format!("revision 1.{minor} is read as 1.{low}"));
            } else if major != 1 || !(low..=high).contains(&minor) {
                let name = if major == 1 { "revMinor" } else { "revMajor" };
                self.xml.fault_in(at, name, || {
                    format!("expected a revision from 1.{low} to 1.{high}, found {major}.{minor}")
                });
            }
            header.revision = (major.unsigned_abs(), minor.unsigned_abs());
        }
        for child in self.xml.children(at, &["geoReference", "offset", "license", "defaultRegulations"]) {
            match child.tag_name().name() {
                "geoReference" => {
                    let text: String = child.children().filter_map(|node| node.text()).collect();
                    text.trim().clone_into(&mut header.geo_reference);
                }
                "offset" => {
                    let [x, y, z] = ["x", "y", "z"].map(|name| self.xml.number(child, name));
                    header.offset = [x, y, z, self.xml.number_or(child, "hdg", 0.0)];
                }
                _ => {}
            }
        }
        header
    }

    /// Records of a cubic polynomial, whose begins are read from the attribute `begin` and counted from `from_m`.
    fn cubics(&mut self, records: &[Element<'a>], begin: &str, from_m: f64) -> Cubics {
        let mut cubics = Vec::with_capacity(records.len());
        let mut order = Order::new(begin);
        for &record in records {
            let s_m = self.xml.number(record, begin);
            order.next(self, record, s_m);
            let coefficients = ["a", "b", "c", "d"].map(|name| self.xml.number(record, name));
            cubics.push(Cubic { s_m: from_m + s_m, coefficients });
        }
        Cubics(cubics)
    }
}

/// Check that records are in ascending order; equal positions are accepted, of which the last applies.
struct Order<'n> {
    attribute: &'n str,
    last: Option<f64>,
    /// True for records of geometry, of which disorder is a fault.
    is_fault: bool,
}

impl<'n> Order<'n> {
    fn new(attribute: &'n str) -> Self {
        Self { attribute, last: None, is_fault: true }
    }

    /// For records without geometry: disorder is a defect, and the caller sorts them.
    fn lenient(attribute: &'n str) -> Self {
        Self { is_fault: false, ..Self::new(attribute) }
    }

    fn next(&mut self, reading: &mut Reading<'_>, at: Element<'_>, value: f64) {
        if let Some(last) = self.last.filter(|last| value < *last) {
            let message = || format!("expected records in ascending order, found {value} after {last}");
            if self.is_fault {
                reading.xml.fault_in(at, self.attribute, message);
            } else {
                reading.xml.defect(at, || format!("`{}`: {}", self.attribute, message()));
            }
        }
        self.last = Some(value);
    }
}

/// Child elements with this name.
fn named<'a>(children: &[Element<'a>], name: &str) -> Vec<Element<'a>> {
    children.iter().filter(|child| child.tag_name().name() == name).copied().collect()
}
