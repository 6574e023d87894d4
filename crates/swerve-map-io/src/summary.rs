//! Summary of a network: counts, extent, links, unknown elements, defects.

use std::collections::BTreeMap;

use serde_json::{Value, json};
use swerve_map::LaneKind;

use crate::features;
use crate::import::{Imported, vertices};
use crate::links::Links;
use crate::opendrive::{Network, PieceKind};

/// Defects and gaps in the text.
const SHOWN: usize = 20;

/// Figures of a network.
#[derive(Clone, PartialEq, Debug)]
pub struct Summary {
    /// Size of the file, bytes.
    pub bytes: usize,
    /// Length of all roads, metres.
    pub length_m: f64,
    /// Roads in junctions.
    pub in_junctions: usize,
    /// Roads with left-hand traffic.
    pub left_hand: usize,
    /// Lane sections.
    pub sections: usize,
    /// Lanes by type, each counted in every lane section.
    pub lanes: BTreeMap<String, usize>,
    /// Pieces of reference lines by kind.
    pub pieces: BTreeMap<PieceKind, usize>,
    /// Junctions by kind.
    pub junctions: BTreeMap<&'static str, usize>,
    /// Connections of all junctions.
    pub connections: usize,
    /// Signals, and those of them that change.
    pub signals: [usize; 2],
    /// Objects by kind.
    pub objects: BTreeMap<String, usize>,
    /// Lowest and highest x, y and z of the roads, metres; `None` without lanes.
    pub extent_m: Option<[[f64; 2]; 3]>,
    /// Length of driving lanes, metres.
    pub driving_m: f64,
}

impl Summary {
    /// Counts what is in a network that was read from a file of `bytes`.
    pub fn of(network: &Network, imported: &Imported, bytes: usize) -> Self {
        let roads = &network.roads;
        let sections = || roads.iter().flat_map(|road| &road.sections);
        let objects = roads.iter().flat_map(|road| &road.objects);
        let signals = roads.iter().flat_map(|road| &road.signals);
        let driving = imported.map.lanes().iter().filter(|lane| lane.kind == LaneKind::Driving);
        Self {
            bytes,
            length_m: roads.iter().map(|road| road.length_m).sum(),
            in_junctions: roads.iter().filter(|road| road.junction.is_some()).count(),
            left_hand: roads.iter().filter(|road| road.left_hand).count(),
            sections: sections().count(),
            lanes: counted(
                sections().flat_map(|section| section.lanes()).map(|lane| lane.kind.name().to_owned()),
            ),
            pieces: counted(roads.iter().flat_map(|road| road.pieces())),
            junctions: counted(network.junctions.iter().map(|junction| junction.kind.name())),
            connections: network.junctions.iter().map(|junction| junction.connections.len()).sum(),
            signals: [signals.clone().count(), signals.filter(|signal| signal.dynamic).count()],
            objects: counted(objects.map(|object| object.kind.clone())),
            extent_m: extent_m(network),
            driving_m: driving.map(|lane| lane.line.length()).sum(),
        }
    }

    /// Summary for a terminal.
    pub fn text(&self, file: &str, network: &Network, imported: &Imported, links: &Links) -> String {
        let (major, minor) = network.header.revision;
        let lanes: usize = self.lanes.values().sum();
        let hand = match self.left_hand {
            0 => "right-hand traffic".to_owned(),
            all if all == network.roads.len() => "left-hand traffic".to_owned(),
            some => format!("left-hand traffic on {some}"),
        };
        let [x, y, z] = self.extent_m.unwrap_or_default().map(|[low, high]| format!("{low:.1} to {high:.1}"));
        let kib = self.bytes.div_ceil(1024);
        let mut out = format!("{file}: OpenDRIVE {major}.{minor}, {kib} KiB\n");
        let mut row = |name: &str, text: String| out.push_str(&format!("{name:<12}{text}\n"));
        if !network.header.name.is_empty() || !network.header.vendor.is_empty() {
            row("name", [&*network.header.name, &*network.header.vendor].join(" ").trim().to_owned());
        }
        row(
            "roads",
            format!(
                "{}, {:.3} km; {} in junctions; {hand}",
                network.roads.len(),
                self.length_m / 1e3,
                self.in_junctions
            ),
        );
        row("geometry", list(self.pieces.iter().map(|(kind, count)| (kind.name(), *count))));
        row(
            "lanes",
            format!(
                "{lanes} in {} lane sections: {}",
                self.sections,
                list(self.lanes.iter().map(|(name, count)| (&**name, *count)))
            ),
        );
        let kinds = list(self.junctions.iter().map(|(kind, count)| (*kind, *count)));
        row("junctions", format!("{}: {kinds}; {} connections", network.junctions.len(), self.connections));
        row(
            "signals",
            format!(
                "{}, {} of them dynamic; {} controllers",
                self.signals[0],
                self.signals[1],
                network.controllers.len()
            ),
        );
        row("objects", list(self.objects.iter().map(|(kind, count)| (&**kind, *count))));
        row("extent", format!("x {x} m, y {y} m, z {z} m"));
        row(
            "links",
            format!(
                "{}, widest gap {:.2} mm; {} dangling",
                links.all.len(),
                1e3 * links.widest_m(),
                links.dangling.len()
            ),
        );
        let (lanes, features) = (imported.map.lanes().len(), features::text(&imported.map));
        row("lane map", format!("{lanes} lanes, {:.3} km for driving{features}", self.driving_m / 1e3));
        row("unknown", list(network.unknown.iter().map(|(name, count)| (&**name, *count))));
        row("defects", (network.defects.count() + imported.gaps.len()).to_string());
        if network.defects.count() > 0 {
            out.push_str(&format!("{}\n", network.defects.first(SHOWN)));
        }
        for gap in imported.gaps.iter().take(SHOWN) {
            let joined = if gap.joined { "joined" } else { "not joined" };
            out.push_str(&format!("{file}: {} are {:.4} m apart: {joined}\n", gap.ends, gap.gap_m));
        }
        if let Some(more) = imported.gaps.len().checked_sub(SHOWN + 1) {
            out.push_str(&format!("{file}: and {} more gaps\n", more + 1));
        }
        out
    }

    /// Summary for programs.
    pub fn json(&self, file: &str, network: &Network, imported: &Imported, links: &Links) -> Value {
        let (major, minor) = network.header.revision;
        let pieces: BTreeMap<&str, usize> =
            self.pieces.iter().map(|(kind, count)| (kind.name(), *count)).collect();
        let defects: Vec<Value> = network
            .defects
            .iter()
            .map(|one| json!({ "line": one.line, "column": one.column, "element": one.element, "message": one.message }))
            .collect();
        let gaps: Vec<Value> = imported
            .gaps
            .iter()
            .map(|gap| json!({ "ends": gap.ends, "gap_m": gap.gap_m, "joined": gap.joined }))
            .collect();
        json!({
            "file": file,
            "bytes": self.bytes,
            "revision": format!("{major}.{minor}"),
            "name": network.header.name,
            "vendor": network.header.vendor,
            "geo_reference": network.header.geo_reference,
            "offset": network.header.offset,
            "roads": network.roads.len(),
            "roads_in_junctions": self.in_junctions,
            "roads_left_hand": self.left_hand,
            "length_m": self.length_m,
            "geometry": pieces,
            "lane_sections": self.sections,
            "lanes": self.lanes,
            "junctions": self.junctions,
            "connections": self.connections,
            "signals": self.signals[0],
            "signals_dynamic": self.signals[1],
            "controllers": network.controllers.len(),
            "objects": self.objects,
            "extent_m": self.extent_m.map(|[x, y, z]| json!({ "x": x, "y": y, "z": z })),
            "map_lanes": imported.map.lanes().len(),
            "driving_m": self.driving_m,
            "map_features": features::json(&imported.map),
            "unknown": network.unknown,
            "defect_count": network.defects.count(),
            "defects": defects,
            "gaps": gaps,
            "links": links.json(network),
        })
    }
}

fn counted<K: Ord>(all: impl Iterator<Item = K>) -> BTreeMap<K, usize> {
    let mut counts = BTreeMap::new();
    all.for_each(|key| *counts.entry(key).or_default() += 1);
    counts
}

/// Counts with their names, most first.
pub(crate) fn list<'n>(counts: impl Iterator<Item = (&'n str, usize)>) -> String {
    let mut counts: Vec<(&str, usize)> = counts.collect();
    counts.sort_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(b.0)));
    let named =
        |(name, count): (&str, usize)| format!("{count} {}", if name.is_empty() { "unnamed" } else { name });
    let text: Vec<String> = counts.into_iter().map(named).collect();
    if text.is_empty() { "none".to_owned() } else { text.join(", ") }
}

fn extent_m(network: &Network) -> Option<[[f64; 2]; 3]> {
    let mut extent: Option<[[f64; 2]; 3]> = None;
    for road in &network.roads {
        for (index, section) in road.sections.iter().enumerate() {
            let Some(span_m) = road.section_span_m(index) else { continue };
            for s_m in vertices::stations(road, section, span_m).unwrap_or_default() {
                for is_left in [true, false] {
                    let Some((_, edges)) = road.edges(section, is_left, s_m).last() else { continue };
                    let at = network.place(road, s_m, edges.outer.t_m).position_m;
                    let mut extended = extent.unwrap_or(at.map(|value| [value, value]));
                    for ([low, high], value) in extended.iter_mut().zip(at) {
                        (*low, *high) = (low.min(value), high.max(value));
                    }
                    extent = Some(extended);
                }
            }
        }
    }
    extent
}
