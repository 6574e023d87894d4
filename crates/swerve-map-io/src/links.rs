//! Links between lanes, and the gaps between their ends.

use serde_json::{Value, json};
use swerve_geom::math;

use crate::opendrive::read::sections::section_at_joint;
use crate::opendrive::{Contact, JunctionKind, Network, Road, Target};

/// An end of a lane in a lane section.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct LaneEnd {
    /// Index of the road in the network.
    pub road: usize,
    /// Lane section of the road, from 0.
    pub section: usize,
    /// Identity of the lane in the section.
    pub lane: i32,
    /// End of the lane section, in the direction of s.
    pub end: Contact,
}

/// Statement of a file from which a link is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum LinkKind {
    /// Lane sections of one road.
    Section,
    /// Roads that continue each other.
    Road,
    /// A connection of a junction.
    Junction,
}

impl LinkKind {
    /// Name in output.
    pub fn name(self) -> &'static str {
        match self {
            Self::Section => "section",
            Self::Road => "road",
            Self::Junction => "junction",
        }
    }
}

/// Two ends of lanes that a file links.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Link {
    /// Statement that links them.
    pub kind: LinkKind,
    /// The lane that the statement is for.
    pub from: LaneEnd,
    /// The lane that it names.
    pub to: LaneEnd,
    /// Distance between the ends of the centre lines in the ground plane, metres.
    pub gap_m: f64,
    /// Difference of their heights, metres.
    pub height_gap_m: f64,
    /// Difference of the widths, metres.
    pub width_gap_m: f64,
}

/// A link of which an end is not there, by the identities in the file.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Dangling {
    /// Two lanes.
    Lanes {
        /// Statement that links them.
        kind: LinkKind,
        /// The lane that the statement is for: road, lane section, lane.
        from: (String, usize, i32),
        /// The lane that it names.
        to: (String, usize, i32),
    },
    /// Two roads, of which one is missing or the first does not lead into the junction.
    Connection {
        /// The junction.
        junction: String,
        /// The incoming road.
        incoming: String,
        /// The road that continues it.
        continuing: String,
    },
}

impl Dangling {
    fn json(&self) -> Value {
        match self {
            Self::Lanes { kind, from, to } => {
                json!([kind.name(), from.0, from.1, from.2, to.0, to.1, to.2])
            }
            Self::Connection { junction, incoming, continuing } => {
                json!([LinkKind::Junction.name(), junction, incoming, continuing])
            }
        }
    }
}

/// All links of a network.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Links {
    /// Links whose ends are there, in the order of the file: by road, section and lane, then junctions.
    pub all: Vec<Link>,
    /// Links of which an end is not there.
    pub dangling: Vec<Dangling>,
    /// Lane links of virtual junctions whose place within a road is unknown; they are in neither list.
    pub within_roads: usize,
}

/// Number of the widest gaps in the output.
const WORST: usize = 8;

/// Number of dangling links in the output.
const DANGLING: usize = 5;

impl Links {
    /// Finds and measures all links. Of a pair of lane sections, either lane may name the other; a pair that both name
    /// is one link. Of a pair of roads, each statement is a link.
    pub fn of(network: &Network) -> Self {
        let mut links = Self::default();
        for (index, road) in network.roads.iter().enumerate() {
            links.road(network, index, road);
        }
        links.junctions(network);
        links
    }

    fn road(&mut self, network: &Network, index: usize, road: &Road) {
        let last = road.sections.len().saturating_sub(1);
        for (section, within) in road.sections.iter().enumerate() {
            for lane in within.left.iter().chain(&within.right) {
                let at = |end| LaneEnd { road: index, section, lane: lane.id, end };
                for &next in &lane.successors {
                    if section < last {
                        let to = LaneEnd { section: section + 1, lane: next, ..at(Contact::Start) };
                        self.join(network, LinkKind::Section, at(Contact::End), to);
                    } else {
                        self.beyond(network, road, at(Contact::End), next);
                    }
                }
                for &before in &lane.predecessors {
                    if section == 0 {
                        self.beyond(network, road, at(Contact::Start), before);
                        continue;
                    }
                    let other = road.sections[section - 1].lane(before);
                    if other.is_none_or(|other| !other.successors.contains(&lane.id)) {
                        let to = LaneEnd { section: section - 1, lane: before, ..at(Contact::End) };
                        self.join(network, LinkKind::Section, at(Contact::Start), to);
                    }
                }
            }
        }
    }

    /// The link of a lane beyond the end of its road, unless a junction has it.
    fn beyond(&mut self, network: &Network, road: &Road, from: LaneEnd, lane: i32) {
        let Some(link) = road.link_at(from.end) else { return };
        if link.target == Target::Junction {
            return;
        }
        if let Some(&other) = network.road_of.get(&link.id) {
            match link.target {
                Target::Road(contact) => {
                    self.join(network, LinkKind::Road, from, road_end(network, other, contact, lane));
                }
                Target::Within { s_m } => match within_road(network, from, (other, s_m), lane) {
                    Some(to) => self.join(network, LinkKind::Road, from, to),
                    None => self.within_roads += 1,
                },
                Target::Junction => {}
            }
        } else {
            let from = (road.id.clone(), from.section, from.lane);
            let to = (link.id.clone(), 0, lane);
            self.dangling.push(Dangling::Lanes { kind: LinkKind::Road, from, to });
        }
    }

    fn join(&mut self, network: &Network, kind: LinkKind, from: LaneEnd, to: LaneEnd) {
        let (Some(a), Some(b)) = (end_of(network, from), end_of(network, to)) else {
            let lane = |end: LaneEnd| (network.roads[end.road].id.clone(), end.section, end.lane);
            self.dangling.push(Dangling::Lanes { kind, from: lane(from), to: lane(to) });
            return;
        };
        let gap_m = math::hypot(a.at[0] - b.at[0], a.at[1] - b.at[1]);
        let height_gap_m = (a.at[2] - b.at[2]).abs();
        self.all.push(Link {
            kind,
            from,
            to,
            gap_m,
            height_gap_m,
            width_gap_m: (a.width_m - b.width_m).abs(),
        });
    }

    fn junctions(&mut self, network: &Network) {
        for junction in &network.junctions {
            for connection in &junction.connections {
                let road = |id: &str| network.road_of.get(id).copied();
                let dangling = || Dangling::Connection {
                    junction: junction.id.clone(),
                    incoming: connection.incoming.clone(),
                    continuing: connection.continuing.clone(),
                };
                let (Some(a), Some(b)) = (road(&connection.incoming), road(&connection.continuing)) else {
                    if junction.kind == JunctionKind::Virtual {
                        self.within_roads += connection.lane_links.len();
                        continue;
                    }
                    self.dangling.push(dangling());
                    continue;
                };
                let into = |end: &Contact| {
                    let link = network.roads[a].link_at(*end);
                    link.is_some_and(|link| link.target == Target::Junction && link.id == junction.id)
                };
                let ends: Vec<Contact> = [Contact::Start, Contact::End].into_iter().filter(into).collect();
                for link in &connection.lane_links {
                    let to = road_end(network, b, connection.contact, link.to);
                    let from = ends.iter().map(|end| road_end(network, a, *end, link.from));
                    // A road with both ends at the junction: the nearer one.
                    let from = from.min_by(|x, y| gap_m(network, *x, to).total_cmp(&gap_m(network, *y, to)));
                    let joint = || {
                        let joint = network.roads[b].link_at(connection.contact)?;
                        let Target::Within { s_m } = joint.target else { return None };
                        let is_from = joint.id == connection.incoming;
                        is_from.then(|| within_road(network, to, (a, s_m), link.from)).flatten()
                    };
                    match from.or_else(joint) {
                        Some(from) => self.join(network, LinkKind::Junction, from, to),
                        None if junction.kind == JunctionKind::Virtual => self.within_roads += 1,
                        None => {
                            self.dangling.push(dangling());
                        }
                    }
                }
            }
        }
    }

    /// Widest gap, metres; 0 without links.
    pub fn widest_m(&self) -> f64 {
        self.all.iter().map(|link| link.gap_m).fold(0.0, f64::max)
    }

    /// Counts, percentiles and the widest gaps.
    pub fn json(&self, network: &Network) -> Value {
        let mut gaps: Vec<&Link> = self.all.iter().collect();
        gaps.sort_by(|a, b| b.gap_m.total_cmp(&a.gap_m));
        let sorted: Vec<f64> = gaps.iter().rev().map(|link| link.gap_m).collect();
        let over = |limit_m: f64| gaps.iter().filter(|link| link.gap_m > limit_m).count();
        let end = |end: LaneEnd| {
            let at = if end.end == Contact::Start { "start" } else { "end" };
            json!({ "road": network.roads[end.road].id, "section": end.section, "lane": end.lane, "at": at })
        };
        let worst = |link: &&Link| {
            json!({
                "gap_m": rounded(link.gap_m), "dz_m": rounded(link.height_gap_m),
                "dwidth_m": rounded(link.width_gap_m), "kind": link.kind.name(), "from": end(link.from), "to": end(link.to),
            })
        };
        json!({
            "links": gaps.len(),
            "dangling": self.dangling.len(),
            "dangling_first": self.dangling.iter().take(DANGLING).map(Dangling::json).collect::<Vec<_>>(),
            "within_roads": self.within_roads,
            "gap_m": { "p50": share(&sorted, 0.5), "p99": share(&sorted, 0.99), "max": self.widest_m() },
            "over_0_01_m": over(0.01),
            "over_0_05_m": over(0.05),
            "worst": gaps.iter().take(WORST).map(worst).collect::<Vec<_>>(),
        })
    }
}

/// Value at a share of a sorted list, linear between its values; 0 for an empty list.
fn share(sorted: &[f64], share: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return 0.0 };
    let at = share * last as f64;
    let below = at.floor() as usize;
    let above = (below + 1).min(last);
    sorted[below] + (sorted[above] - sorted[below]) * (at - below as f64)
}

fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

/// The end of a lane at an end of a road.
fn road_end(network: &Network, road: usize, end: Contact, lane: i32) -> LaneEnd {
    let section = match end {
        Contact::Start => 0,
        Contact::End => network.roads[road].sections.len().saturating_sub(1),
    };
    LaneEnd { road, section, lane, end }
}

/// The end of a lane at a place within its road, at which another road ends: the end whose traffic continues to the
/// other lane, or comes from it. `None` if no lane section ends there.
fn within_road(network: &Network, other: LaneEnd, (road, s_m): (usize, f64), lane: i32) -> Option<LaneEnd> {
    let leaves = |road: &Road, lane: i32, end: Contact| road.runs_forward(lane) == (end == Contact::End);
    let enters_here = leaves(&network.roads[other.road], other.lane, other.end);
    let ends = [Contact::Start, Contact::End];
    let end = ends.into_iter().find(|end| leaves(&network.roads[road], lane, *end) != enters_here)?;
    let section = section_at_joint(&network.roads[road], s_m, end)?;
    Some(LaneEnd { road, section, lane, end })
}

/// Place and width of a lane's end.
struct End {
    at: [f64; 3],
    width_m: f64,
}

/// `None` if there is no such lane.
fn end_of(network: &Network, end: LaneEnd) -> Option<End> {
    // Within the section, where a record that begins at its end does not hold.
    const INSIDE_M: f64 = 1e-9;
    let road = network.roads.get(end.road)?;
    let section = road.sections.get(end.section)?;
    section.lane(end.lane)?;
    let [from_m, to_m] = road.section_span_m(end.section)?;
    let s_m = if end.end == Contact::Start { from_m + INSIDE_M } else { to_m - INSIDE_M };
    let (_, edges) = road.edges(section, end.lane > 0, s_m).find(|(lane, _)| lane.id == end.lane)?;
    let at = network.place(road, s_m, edges.center().t_m).position_m;
    Some(End { at, width_m: edges.width_m() })
}

fn gap_m(network: &Network, a: LaneEnd, b: LaneEnd) -> f64 {
    match (end_of(network, a), end_of(network, b)) {
        (Some(a), Some(b)) => math::hypot(a.at[0] - b.at[0], a.at[1] - b.at[1]),
        _ => f64::INFINITY,
    }
}

/// A lane's end in a message.
pub(crate) fn named(network: &Network, end: LaneEnd) -> String {
    let at = if end.end == Contact::Start { "start" } else { "end" };
    format!("road {} section {} lane {} at its {at}", network.roads[end.road].id, end.section, end.lane)
}
