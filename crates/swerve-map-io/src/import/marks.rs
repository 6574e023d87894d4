//! Marks of lanes: records of the file along the road, as marks along the lane.

use swerve_map::{LaneMarks, MARK_WIDTH_M, Mark, MarkColour, MarkKind};

use super::vertices::Strip;
use crate::opendrive::{Lane, LaneSection, RoadMark};

/// Shortest stretch that has a mark, metres.
const SHORTEST_M: f64 = 1e-6;

/// A border of a lane.
struct Border<'r> {
    records: &'r [RoadMark],
    /// True if the lane has the higher identity of the two beside the border.
    is_higher: bool,
    /// True if the lane is beside the line that its records name second.
    is_second: bool,
}

/// Marks of a lane of a section that spans `span_m` along the road.
pub(super) fn marks(
    section: &LaneSection,
    lane: &Lane,
    strip: &Strip,
    span_m: [f64; 2],
    forward: bool,
) -> LaneMarks {
    // Double lines are named from inside to outside, those of the centre lane from left to right.
    let is_left = lane.id > 0;
    let inner = match section.lane(lane.id - lane.id.signum()) {
        Some(inside) => Border { records: &inside.marks, is_higher: is_left, is_second: true },
        None => Border { records: &section.center_marks, is_higher: is_left, is_second: !is_left },
    };
    let outer = Border { records: &lane.marks, is_higher: !is_left, is_second: false };
    let along = |border: &Border<'_>| border.along(strip, span_m, forward);
    let (left, right) = if is_left == forward { (outer, inner) } else { (inner, outer) };
    // Marks of files are lengths, in order of their begins.
    LaneMarks::new(along(&left), along(&right)).unwrap_or_default()
}

impl Border<'_> {
    /// Marks in the direction of travel.
    fn along(&self, strip: &Strip, [from_m, to_m]: [f64; 2], forward: bool) -> Vec<Mark> {
        let count = self.records.len();
        let mut marks: Vec<Mark> = Vec::new();
        for k in (0..count).map(|k| if forward { k } else { count - 1 - k }) {
            let begin_m = self.records[k].s_m.max(from_m);
            let end_m = self.records.get(k + 1).map_or(to_m, |next| next.s_m.min(to_m));
            if end_m - begin_m < SHORTEST_M {
                continue;
            }
            let from_m = strip.along_m(if forward { begin_m } else { end_m }, forward);
            let mark = self.mark(&self.records[k], from_m);
            if marks.last().is_none_or(|last| Mark { from_m, ..*last } != mark && last.from_m < from_m) {
                marks.push(mark);
            }
        }
        marks
    }

    fn mark(&self, record: &RoadMark, from_m: f64) -> Mark {
        let kind = kind_of(&record.kind);
        // `none` and `both` are constants of editors: published files have them at all lines, or do not have them.
        let permission = match &*record.lane_change {
            "increase" => Some(!self.is_higher),
            "decrease" => Some(self.is_higher),
            _ => None,
        };
        Mark {
            kind: if self.is_second { kind.mirrored() } else { kind },
            colour: colour_of(&record.color),
            width_m: record.width_m.filter(|width_m| *width_m > 0.0).unwrap_or(MARK_WIDTH_M),
            permission,
            ..Mark::new(from_m, kind)
        }
    }
}

/// Kind of a mark by its type in the standard. Custom marks, which are drawn line by line, and unknown types have none.
fn kind_of(name: &str) -> MarkKind {
    match name {
        "solid" => MarkKind::Solid,
        "broken" => MarkKind::Broken,
        "solid solid" => MarkKind::SolidSolid,
        "solid broken" => MarkKind::SolidBroken,
        "broken solid" => MarkKind::BrokenSolid,
        "broken broken" => MarkKind::BrokenBroken,
        "botts dots" => MarkKind::Dots,
        "curb" => MarkKind::Kerb,
        "grass" | "edge" => MarkKind::Edge,
        _ => MarkKind::None,
    }
}

fn colour_of(name: &str) -> MarkColour {
    match name {
        "yellow" | "orange" => MarkColour::Yellow,
        "blue" => MarkColour::Blue,
        "red" => MarkColour::Red,
        _ => MarkColour::White,
    }
}
