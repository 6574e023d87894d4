//! Lane sections that hold for one side of a road, and places within a road at which others join it.
//!
//! Both split lanes: a section of a [`Road`] holds for both sides, and begins where a section of either side begins, or
//! where another road joins. The pieces of a lane continue each other under its identity.

use core::ops::Range;
use std::collections::BTreeMap;

use super::Reading;
use crate::cubic::{Cubics, holding};
use crate::opendrive::lane::LaneGeometry;
use crate::opendrive::{Contact, Lane, LaneSection, Network, Road, Target};
use crate::xml::Element;

/// Most pieces of lanes that are split.
const PIECES_MAX: usize = 200_000;

/// Sections closer than this begin at one place, metres.
const SAME_M: f64 = 1e-6;

/// A lane section of the file.
#[derive(Clone, Copy)]
pub(super) struct Begin {
    pub(super) s_m: f64,
    /// True if it holds for the left and for the right side.
    pub(super) sides: [bool; 2],
}

/// Sections of a road for those of the file.
pub(super) struct Plan {
    /// Begin of each section of the road, metres.
    begins_m: Vec<f64>,
    /// Of each lane section of the file, the sections of the road that its left lanes and its right lanes are in.
    spans: Vec<[Range<usize>; 2]>,
}

impl Plan {
    /// Of sections in order; of those in disorder, which is a fault, the result has no meaning.
    pub(super) fn new(sections: &[Begin]) -> Self {
        if sections.iter().all(|section| section.sides == [true; 2]) {
            let spans = (0..sections.len()).map(|k| [k..k + 1, k..k + 1]).collect();
            return Self { begins_m: sections.iter().map(|section| section.s_m).collect(), spans };
        }
        let mut begins_m: Vec<f64> = Vec::new();
        let mut index = Vec::with_capacity(sections.len());
        for section in sections {
            if begins_m.last().is_none_or(|last| section.s_m > last + SAME_M) {
                begins_m.push(section.s_m);
            }
            index.push(begins_m.len() - 1);
        }
        let mut spans = vec![[0..0, 0..0]; sections.len()];
        let mut until = [begins_m.len(); 2];
        for (k, section) in sections.iter().enumerate().rev() {
            for side in [0, 1].into_iter().filter(|side| section.sides[*side]) {
                spans[k][side] = index[k]..until[side];
                until[side] = index[k];
            }
        }
        Self { begins_m, spans }
    }

    /// Sections of the road that the lanes of a side of a section of the file are in.
    pub(super) fn span(&self, section: usize, sign: i32) -> Range<usize> {
        self.spans[section][usize::from(sign < 0)].clone()
    }
}

impl Reading<'_> {
    /// Sections of the road from those of the file, up to the end of the road.
    pub(super) fn distributed(
        &mut self,
        at: Element<'_>,
        plan: &Plan,
        sections: Vec<LaneSection>,
        length_m: f64,
    ) -> Vec<LaneSection> {
        if plan.begins_m.len() == sections.len() && plan.spans.iter().flatten().all(|span| span.len() == 1) {
            return sections;
        }
        let empty = |s_m: &f64| LaneSection {
            s_m: *s_m,
            left: Vec::new(),
            right: Vec::new(),
            center_marks: Vec::new(),
        };
        let mut all: Vec<LaneSection> = plan.begins_m.iter().map(empty).collect();
        for (section, spans) in sections.into_iter().zip(&plan.spans) {
            let LaneSection { left, right, mut center_marks, .. } = section;
            for (lanes, span, is_left) in [(left, &spans[0], true), (right, &spans[1], false)] {
                if !self.has_room(at, lanes.len() * span.len()) {
                    return all;
                }
                for k in span.clone() {
                    let to_m = plan.begins_m.get(k + 1).copied().unwrap_or(length_m);
                    let range_m = [plan.begins_m[k], to_m];
                    let ends = [k == span.start, k + 1 == span.end];
                    let pieces = lanes.iter().map(|lane| piece(lane, range_m, ends)).collect();
                    *(if is_left { &mut all[k].left } else { &mut all[k].right }) = pieces;
                }
            }
            let first = spans.iter().filter(|span| !span.is_empty()).map(|span| span.start).min();
            if let Some(first) = first {
                all[first].center_marks.append(&mut center_marks);
            }
        }
        all
    }

    /// Counts pieces of lanes; too many are a fault.
    fn has_room(&mut self, at: Element<'_>, pieces: usize) -> bool {
        self.pieces = self.pieces.saturating_add(pieces);
        if self.pieces > PIECES_MAX {
            self.xml.fault(at, || format!("expected at most {PIECES_MAX} pieces of split lanes"));
        }
        self.pieces <= PIECES_MAX
    }

    /// Splits sections where roads join others between their ends.
    pub(super) fn split_at_joints(&mut self, root: Element<'_>, network: &mut Network) {
        let mut joints: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
        for road in &network.roads {
            for end in [Contact::Start, Contact::End] {
                let Some(link) = road.link_at(end) else { continue };
                if let (Target::Within { s_m }, Some(&other)) = (link.target, network.road_of.get(&link.id)) {
                    joints.entry(other).or_default().push(s_m);
                }
            }
        }
        for (road, mut places_m) in joints {
            let road = &mut network.roads[road];
            places_m.sort_by(f64::total_cmp);
            let begins_m: Vec<f64> = road.sections.iter().map(|section| section.s_m).collect();
            let is_new = |s_m: &f64| {
                let near = begins_m.iter().any(|begin_m| (begin_m - s_m).abs() <= SAME_M);
                !near && *s_m > SAME_M && *s_m < road.length_m - SAME_M
            };
            places_m.retain(is_new);
            places_m.dedup_by(|b, a| *b - *a <= SAME_M);
            let mut sections = Vec::with_capacity(road.sections.len() + places_m.len());
            for (k, section) in road.sections.iter().enumerate() {
                let to_m = begins_m.get(k + 1).copied().unwrap_or(road.length_m);
                let within: Vec<f64> =
                    places_m.iter().copied().filter(|s_m| section.s_m < *s_m && *s_m < to_m).collect();
                if !within.is_empty() && !self.has_room(root, section.lanes().count() * (within.len() + 1)) {
                    return;
                }
                sections.extend(cut(section, &within, to_m));
            }
            road.sections = sections;
        }
    }
}

/// A section that ends at `to_m`, split at places within it.
fn cut(section: &LaneSection, places_m: &[f64], to_m: f64) -> Vec<LaneSection> {
    let mut bounds_m = vec![section.s_m];
    bounds_m.extend(places_m);
    bounds_m.push(to_m);
    let last = places_m.len();
    let part = |k: usize| {
        let (range_m, ends) = ([bounds_m[k], bounds_m[k + 1]], [k == 0, k == last]);
        let pieces = |lanes: &[Lane]| lanes.iter().map(|lane| piece(lane, range_m, ends)).collect();
        LaneSection {
            s_m: bounds_m[k],
            left: pieces(&section.left),
            right: pieces(&section.right),
            center_marks: holding(&section.center_marks, |mark| mark.s_m, range_m).to_vec(),
        }
    };
    (0..=last).map(part).collect()
}

/// The lane within a range; its links are those of the file at the ends that it has, and itself at the others.
fn piece(lane: &Lane, range_m: [f64; 2], [has_start, has_end]: [bool; 2]) -> Lane {
    let records = |cubics: &Cubics| Cubics(holding(&cubics.0, |record| record.s_m, range_m).to_vec());
    Lane {
        id: lane.id,
        kind: lane.kind.clone(),
        predecessors: if has_start { lane.predecessors.clone() } else { vec![lane.id] },
        successors: if has_end { lane.successors.clone() } else { vec![lane.id] },
        marks: holding(&lane.marks, |mark| mark.s_m, range_m).to_vec(),
        speeds: holding(&lane.speeds, |one| one.0, range_m).to_vec(),
        heights: holding(&lane.heights, |one| one.0, range_m).to_vec(),
        geometry: match &lane.geometry {
            LaneGeometry::Width(cubics) => LaneGeometry::Width(records(cubics)),
            LaneGeometry::Border(cubics) => LaneGeometry::Border(records(cubics)),
        },
    }
}

/// Section of a road that ends or begins at a place within the road, metres; `None` if there is none.
pub(crate) fn section_at_joint(road: &Road, s_m: f64, end: Contact) -> Option<usize> {
    let at = |place_m: f64| (place_m - s_m).abs() <= SAME_M;
    let count = road.sections.len();
    match end {
        Contact::Start => road.sections.iter().position(|section| at(section.s_m)),
        Contact::End => {
            (0..count).find(|k| at(road.sections.get(k + 1).map_or(road.length_m, |next| next.s_m)))
        }
    }
}
