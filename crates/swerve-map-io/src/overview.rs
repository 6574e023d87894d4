//! Summary of a lane map: lanes by type and kind, other contents, extent, gaps, defects.

use std::collections::BTreeMap;

use serde_json::{Value, json};
use swerve_map::{LaneKind, Map};

use crate::draft::outline;
use crate::features;
use crate::lane_map::LaneMap;
use crate::summary::list;

/// Defects and gaps in the text.
const SHOWN: usize = 20;

/// Figures of a lane map.
#[derive(Clone, PartialEq, Debug)]
pub struct Overview {
    /// Size of the file, bytes.
    pub bytes: usize,
    /// Number and length (metres) of the lanes of each kind.
    pub kinds: BTreeMap<&'static str, (usize, f64)>,
    /// Lowest and highest x and y of the lanes, metres; `None` without lanes.
    pub extent_m: Option<[[f64; 2]; 2]>,
    /// Pairs of a lane and one that continues it.
    pub successors: usize,
    /// Lanes with a neighbour in the same direction, and in the opposite one.
    pub neighbours: [usize; 2],
}

impl Overview {
    /// Counts what is in a map that was read from a file of `bytes`.
    pub fn of(map: &Map, bytes: usize) -> Self {
        let mut kinds: BTreeMap<&'static str, (usize, f64)> = BTreeMap::new();
        for lane in map.lanes() {
            let (count, length_m) = kinds.entry(kind_name(lane.kind)).or_default();
            *count += 1;
            *length_m += lane.line.length();
        }
        let beside = |opposite| {
            let has = |lane: &&swerve_map::Lane| {
                [lane.left, lane.right].into_iter().flatten().any(|beside| beside.opposite == opposite)
            };
            map.lanes().iter().filter(has).count()
        };
        Self {
            bytes,
            kinds,
            extent_m: extent_m(map),
            successors: map.lanes().iter().map(|lane| lane.successors.len()).sum(),
            neighbours: [beside(false), beside(true)],
        }
    }

    /// Number of defects and gaps.
    pub fn defects(lanes: &LaneMap) -> usize {
        lanes.defects.count() + lanes.gaps.len()
    }

    /// Summary for a terminal.
    pub fn text(&self, file: &str, lanes: &LaneMap) -> String {
        let counts = |of: &BTreeMap<String, usize>| list(of.iter().map(|(name, count)| (&**name, *count)));
        let mut out = format!("{file}: {}, {} KiB\n", lanes.format, self.bytes.div_ceil(1024));
        let mut row = |name: &str, text: String| out.push_str(&format!("{name:<12}{text}\n"));
        let kinds = self
            .kinds
            .iter()
            .map(|(kind, (count, length_m))| format!("{count} {kind} {:.3} km", length_m / 1e3));
        let kinds: Vec<String> = kinds.collect();
        let features = features::text(&lanes.map);
        row("lane map", format!("{} lanes: {}{features}", lanes.map.lanes().len(), kinds.join(", ")));
        row("types", counts(&lanes.types));
        let [same, opposite] = self.neighbours;
        row(
            "links",
            format!(
                "{} successors; {same} lanes with a neighbour in the same direction, {opposite} in the opposite one",
                self.successors
            ),
        );
        row("contents", counts(&lanes.contents));
        let [x, y] = self.extent_m.unwrap_or_default().map(|[low, high]| format!("{low:.1} to {high:.1}"));
        let z =
            lanes.heights_m.map_or_else(String::new, |[low, high]| format!(", z {low:.1} to {high:.1} m"));
        row("extent", format!("x {x} m, y {y} m{z}"));
        row("unknown", counts(&lanes.unknown));
        row("defects", Self::defects(lanes).to_string());
        if lanes.defects.count() > 0 {
            out.push_str(&format!("{}\n", lanes.defects.first(SHOWN)));
        }
        for gap in lanes.gaps.iter().take(SHOWN) {
            let joined = if gap.joined { "joined" } else { "not joined" };
            out.push_str(&format!("{file}: {} are {:.4} m apart: {joined}\n", gap.ends, gap.gap_m));
        }
        if let Some(more) = lanes.gaps.len().checked_sub(SHOWN + 1) {
            out.push_str(&format!("{file}: and {} more gaps\n", more + 1));
        }
        out
    }

    /// Summary for programs.
    pub fn json(&self, file: &str, lanes: &LaneMap) -> Value {
        let defects: Vec<Value> = lanes
            .defects
            .iter()
            .map(|one| json!({ "line": one.line, "column": one.column, "element": one.element, "message": one.message }))
            .collect();
        let kind = |(name, (count, length_m)): (&&str, &(usize, f64))| {
            ((*name).to_owned(), json!({ "lanes": count, "length_m": length_m }))
        };
        json!({
            "file": file,
            "bytes": self.bytes,
            "format": lanes.format,
            "map_lanes": lanes.map.lanes().len(),
            "kinds": self.kinds.iter().map(kind).collect::<serde_json::Map<String, Value>>(),
            "types": lanes.types,
            "contents": lanes.contents,
            "map_features": features::json(&lanes.map),
            "successors": self.successors,
            "neighbours_same": self.neighbours[0],
            "neighbours_opposite": self.neighbours[1],
            "extent_m": self.extent_m.map(|[x, y]| json!({ "x": x, "y": y, "z": lanes.heights_m })),
            "unknown": lanes.unknown,
            "defect_count": lanes.defects.count(),
            "defects": defects,
            "gaps": gaps(lanes),
        })
    }

    /// Gaps between the ends of lanes for programs.
    pub fn links(&self, lanes: &LaneMap) -> Value {
        let widest_m = lanes.gaps.iter().map(|gap| gap.gap_m).fold(0.0, f64::max);
        let not_joined = lanes.gaps.iter().filter(|gap| !gap.joined).count();
        json!({
            "links": self.successors + not_joined,
            "not_joined": not_joined,
            "gap_m": { "max": widest_m },
            "gaps": gaps(lanes),
        })
    }
}

fn gaps(lanes: &LaneMap) -> Vec<Value> {
    lanes
        .gaps
        .iter()
        .map(|gap| json!({ "ends": gap.ends, "gap_m": gap.gap_m, "joined": gap.joined }))
        .collect()
}

/// Name of a kind in output.
pub(crate) fn kind_name(kind: LaneKind) -> &'static str {
    match kind {
        LaneKind::Driving => "driving",
        LaneKind::Shoulder => "shoulder",
        LaneKind::Cycling => "cycling",
        LaneKind::Walking => "walking",
        LaneKind::Parking => "parking",
    }
}

/// Lowest and highest x and y of the outlines of lanes.
fn extent_m(map: &Map) -> Option<[[f64; 2]; 2]> {
    let corners = map.lanes().iter().flat_map(outline);
    corners.fold(None, |extent: Option<[[f64; 2]; 2]>, at| {
        let [[left, right], [low, high]] = extent.unwrap_or([[at.x_m; 2], [at.y_m; 2]]);
        Some([[left.min(at.x_m), right.max(at.x_m)], [low.min(at.y_m), high.max(at.y_m)]])
    })
}
