//! Marks of lanes by the tags of the ways that are their borders.

use swerve_map::{MARK_WIDTH_M, Mark, MarkColour, MarkKind};

use super::osm::{Osm, tag, tag_element};
use super::tags::is_yes;
use crate::draft::WIDE_MARK_M;
use crate::xml::Reader;

/// Mark of a way for a lane on its left or right; `None` for ways of other types and without one.
pub(super) fn mark(xml: &mut Reader, osm: &Osm<'_>, way: i64, is_at_left: bool) -> Option<Mark> {
    let way = osm.ways.get(&way)?.element;
    let kind = kind_of(tag(way, "type")?, tag(way, "subtype").unwrap_or_default())?;
    let usual_m = if tag(way, "type") == Some("line_thick") { WIDE_MARK_M } else { MARK_WIDTH_M };
    let width = tag_element(way, "width").and_then(|width| xml.lenient(width, "v"));
    let colour = tag(way, "color").or_else(|| tag(way, "colour")).unwrap_or_default();
    let across = if is_at_left { "lane_change:right" } else { "lane_change:left" };
    Some(Mark {
        colour: match colour {
            "yellow" => MarkColour::Yellow,
            "blue" => MarkColour::Blue,
            "red" => MarkColour::Red,
            _ => MarkColour::White,
        },
        width_m: width.filter(|width_m| *width_m > 0.0).unwrap_or(usual_m),
        permission: tag(way, across).or_else(|| tag(way, "lane_change")).map(is_yes),
        ..Mark::new(0.0, if is_at_left { kind } else { kind.mirrored() })
    })
}

/// Kind of a mark for a lane on the left of its way: of two lines, the left one is named first.
fn kind_of(name: &str, subtype: &str) -> Option<MarkKind> {
    Some(match (name, subtype) {
        ("line_thin" | "line_thick", "solid") => MarkKind::Solid,
        ("line_thin" | "line_thick", "dashed") => MarkKind::Broken,
        ("line_thin" | "line_thick", "solid_solid") => MarkKind::SolidSolid,
        ("line_thin" | "line_thick", "solid_dashed") => MarkKind::SolidBroken,
        ("line_thin" | "line_thick", "dashed_solid") => MarkKind::BrokenSolid,
        ("line_thin" | "line_thick", "dashed_dashed") => MarkKind::BrokenBroken,
        ("curbstone", _) => MarkKind::Kerb,
        ("road_border", _) => MarkKind::Edge,
        ("guard_rail" | "fence" | "wall" | "jersey_barrier", _) => MarkKind::Barrier,
        ("virtual", _) => MarkKind::None,
        _ => return None,
    })
}
