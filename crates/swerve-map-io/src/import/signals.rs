//! Traffic signals and stop lines of the map.
//!
//! A stop line is one of the file (a signal of type 294 or 341, or a road mark), or the place of a light or sign without
//! one: its position along the road, which is where it holds (clause 14.2).

use core::f64::consts::PI;
use std::collections::BTreeMap;

use swerve_geom::{Point2, wrap_angle};
use swerve_map::{LaneId, LaneKind, SignalId, StopLine, StopSign};

use super::ImportError;
use super::places::{Places, Scope};
use crate::opendrive::{Object, Physical, Signal, SignalReference};

/// Largest distance along the lane between a light or sign and its stop line, if the file does not relate them, metres.
const LINE_M: f64 = 20.0;

/// Most lane sections between a light or sign and its stop line.
const SECTIONS_MAX: usize = 8;

/// Lights and signs closer than this along the lane share a stop line, metres.
const SHARED_M: f64 = 1.0;

/// A statement of the file about a place of a lane.
struct Mark<'n> {
    lane: LaneId,
    /// Along the lane, metres.
    s_m: f64,
    what: What,
    /// Identity of the signal or object.
    name: &'n str,
    /// Identities of related signals and objects.
    related: &'n [String],
}

#[derive(Clone, Copy, PartialEq)]
enum What {
    Line,
    Sign(StopSign),
    Light(SignalId),
}

/// Signals and stop lines; signals are numbered in the order of the file.
pub(super) fn signals(places: &Places<'_>) -> Result<(Vec<swerve_map::Signal>, Vec<StopLine>), ImportError> {
    let network = places.network;
    let controllers: BTreeMap<&str, &str> = (network.controllers.iter().rev())
        .flat_map(|controller| controller.signals.iter().map(|signal| (&**signal, &*controller.id)))
        .collect();
    let mut references: BTreeMap<&str, Vec<(usize, &SignalReference)>> = BTreeMap::new();
    for (road, of) in network.roads.iter().enumerate() {
        for reference in &of.signal_references {
            references.entry(&reference.id).or_default().push((road, reference));
        }
    }
    let (mut signals, mut marks) = (Vec::new(), Vec::new());
    for (road, of) in network.roads.iter().enumerate() {
        for signal in &of.signals {
            let id = SignalId(signals.len() as u32);
            let Some((what, kinds)) = meaning(signal, id) else { continue };
            let Signal { s_m, orientation, validity, .. } = signal;
            let mut scopes = vec![Scope { road, s_m: *s_m, orientation, validity, kinds }];
            for (road, reference) in references.remove(&*signal.id).into_iter().flatten() {
                let SignalReference { s_m, orientation, validity, .. } = reference;
                scopes.push(Scope { road, s_m: *s_m, orientation, validity, kinds });
            }
            let begin = marks.len();
            for scope in scopes {
                for lane in places.in_scope(scope)? {
                    let s_m = places.along_m(lane, scope.s_m);
                    marks.push(Mark { lane, s_m, what, name: &signal.id, related: &signal.related });
                }
            }
            if let What::Light(id) = what {
                let lanes = marks[begin..].iter().map(|mark| mark.lane).collect();
                let controller = controllers.get(&*signal.id).map(|name| (*name).to_owned());
                signals.push(light(places, road, signal, (id, lanes, controller)));
            }
        }
        for object in of.objects.iter().filter(|object| is_stop_line(object)) {
            let Object { s_m, orientation, validity, .. } = object;
            let scope = Scope { road, s_m: *s_m, orientation, validity, kinds: &VEHICLES };
            for lane in places.in_scope(scope)? {
                let s_m = places.along_m(lane, object.s_m);
                marks.push(Mark { lane, s_m, what: What::Line, name: &object.id, related: &[] });
            }
        }
    }
    Ok((signals, stop_lines(places, marks)))
}

const VEHICLES: [LaneKind; 2] = [LaneKind::Driving, LaneKind::Cycling];

/// Meaning of a signal for the traffic of lanes of some kinds; `None` for other signs.
///
/// Types are those of the German catalogue, which OpenDRIVE's own catalogue and CARLA use too, and those of the United
/// States and Sweden. Dots in a type have no meaning.
fn meaning(signal: &Signal, id: SignalId) -> Option<(What, &'static [LaneKind])> {
    let kind: String = signal.kind.chars().filter(|c| *c != '.').flat_map(char::to_lowercase).collect();
    if signal.dynamic && kind.len() == 7 && kind.starts_with("10000") {
        let kinds: &[LaneKind] = match &*kind {
            "1000002" => &[LaneKind::Walking],
            "1000007" => &[LaneKind::Walking, LaneKind::Cycling],
            "1000013" => &[LaneKind::Cycling],
            _ => &VEHICLES,
        };
        return Some((What::Light(id), kinds));
    }
    let what = match (&*signal.country.to_lowercase(), &*kind, &*signal.subtype) {
        ("us" | "usa", "r1-1", _) | ("us" | "usa", "r1", "1") => What::Sign(StopSign::Stop),
        ("us" | "usa", "r1-2", _) | ("us" | "usa", "r1", "2") => What::Sign(StopSign::Yield),
        ("se", "b", "2") => What::Sign(StopSign::Stop),
        ("se", "b", "1") => What::Sign(StopSign::Yield),
        (_, "206", _) => What::Sign(StopSign::Stop),
        (_, "205", _) => What::Sign(StopSign::Yield),
        // Stop line; the line at which traffic gives way.
        (_, "294" | "341", _) => What::Line,
        _ => return None,
    };
    Some((what, &VEHICLES))
}

/// True for a stop line that is an object: a road mark of the standard, or one named so by an exporter.
fn is_stop_line(object: &Object) -> bool {
    let is_named = |text: &str| {
        let letters: String = text.chars().filter(|c| c.is_alphanumeric()).take(40).collect();
        letters.to_lowercase().contains("stopline")
    };
    match &*object.kind {
        "roadMark" => object.subtype == "signalLines" || is_named(&object.name),
        kind => is_named(kind),
    }
}

fn light(
    places: &Places<'_>,
    road: usize,
    signal: &Signal,
    (id, lanes, controller): (SignalId, Vec<LaneId>, Option<String>),
) -> swerve_map::Signal {
    let network = places.network;
    let place = network.place(&network.roads[road], signal.s_m, signal.t_m);
    // A signal for traffic in the direction of s shines against it.
    let turned_rad = if signal.orientation == "-" { 0.0 } else { PI };
    let (position, height_m) = match &signal.physical {
        Some(Physical::Road { road, s_m, t_m, z_offset_m }) if network.road_of.contains_key(road) => {
            (places.point(network.road_of[road], *s_m, *t_m), *z_offset_m)
        }
        Some(Physical::Inertial(at)) => {
            let [x_m, y_m, z_m] = network.projected(*at);
            (Point2::new(x_m, y_m), z_m - place.position_m[2])
        }
        _ => (places.point(road, signal.s_m, signal.t_m), signal.z_offset_m),
    };
    swerve_map::Signal {
        id,
        name: signal.id.clone(),
        position,
        heading_rad: wrap_angle(place.reference_heading_rad + turned_rad + signal.heading_rad),
        height_m: Some(height_m),
        lanes,
        controller,
        program: None,
    }
}

/// Stop lines of all marks: of each lane its own lines first, then the places of lights and signs without one.
fn stop_lines(places: &Places<'_>, mut marks: Vec<Mark<'_>>) -> Vec<StopLine> {
    move_to_lines(places, &mut marks);
    let is_line = |mark: &Mark<'_>| mark.what == What::Line;
    marks.sort_by(|a, b| {
        let order = a.lane.cmp(&b.lane).then(is_line(b).cmp(&is_line(a)));
        order.then(a.s_m.total_cmp(&b.s_m))
    });
    let mut lines = Vec::new();
    for of_lane in marks.chunk_by(|a, b| a.lane == b.lane) {
        let count = of_lane.partition_point(is_line);
        let (drawn, others) = of_lane.split_at(count);
        lines.extend(lines_of_lane(drawn, others));
    }
    lines
}

/// Moves lights and signs without a line on their lane to the nearest line on the lanes before or after it on the road:
/// a lane section may begin between the two.
fn move_to_lines(places: &Places<'_>, marks: &mut [Mark<'_>]) {
    let mut drawn: BTreeMap<LaneId, Vec<f64>> = BTreeMap::new();
    for mark in marks.iter().filter(|mark| mark.what == What::Line) {
        drawn.entry(mark.lane).or_default().push(mark.s_m);
    }
    if drawn.is_empty() {
        return;
    }
    let (before, after) = places.along_roads();
    for mark in marks.iter_mut().filter(|mark| mark.what != What::Line) {
        if drawn.contains_key(&mark.lane) {
            continue;
        }
        let rest_m = places.lane(mark.lane).line.length() - mark.s_m;
        let found = [(&before, mark.s_m, true), (&after, rest_m, false)].map(|(next, off_m, is_before)| {
            let (mut lane, mut off_m) = (mark.lane, off_m);
            for _ in 0..SECTIONS_MAX {
                lane = *next.get(&lane)?;
                let length_m = places.lane(lane).line.length();
                let off = |s_m: f64| off_m + if is_before { length_m - s_m } else { s_m };
                let near = drawn.get(&lane).into_iter().flatten().map(|s_m| (off(*s_m), lane, *s_m));
                if let Some(found) = near.min_by(|a, b| a.0.total_cmp(&b.0)) {
                    return Some(found).filter(|found| found.0 <= LINE_M);
                }
                off_m += length_m;
                if off_m > LINE_M {
                    return None;
                }
            }
            None
        });
        if let Some((_, lane, s_m)) = found.into_iter().flatten().min_by(|a, b| a.0.total_cmp(&b.0)) {
            (mark.lane, mark.s_m) = (lane, s_m);
        }
    }
}

/// Stop lines of a lane from its lines and from its lights and signs, both in order.
fn lines_of_lane(drawn: &[Mark<'_>], others: &[Mark<'_>]) -> Vec<StopLine> {
    let mut lines: Vec<StopLine> = drawn.iter().map(|mark| StopLine::new(mark.lane, mark.s_m)).collect();
    let by_name: BTreeMap<&str, usize> = drawn.iter().enumerate().map(|(k, mark)| (mark.name, k)).collect();
    let by_related: BTreeMap<&str, usize> = (drawn.iter().enumerate())
        .flat_map(|(k, mark)| mark.related.iter().map(move |name| (&**name, k)))
        .collect();
    for mark in others {
        let named = || mark.related.iter().find_map(|name| by_name.get(&**name));
        let line = match by_related.get(mark.name).or_else(named) {
            Some(&related) => related,
            None => nearest(drawn, mark.s_m).unwrap_or_else(|| {
                let last = lines.len().checked_sub(1).filter(|last| *last >= drawn.len());
                let shared = last.filter(|last| mark.s_m - lines[*last].s_m <= SHARED_M);
                shared.unwrap_or_else(|| {
                    lines.push(StopLine::new(mark.lane, mark.s_m));
                    lines.len() - 1
                })
            }),
        };
        match mark.what {
            What::Light(id) => lines[line].signals.push(id),
            // Of two signs, the stricter.
            What::Sign(sign) => {
                lines[line].sign = Some(lines[line].sign.map_or(sign, |other| other.min(sign)))
            }
            What::Line => {}
        }
    }
    lines
}

/// Line that is nearest to a place, up to [`LINE_M`].
fn nearest(drawn: &[Mark<'_>], s_m: f64) -> Option<usize> {
    let next = drawn.partition_point(|mark| mark.s_m < s_m);
    let candidates = [next.checked_sub(1), Some(next).filter(|next| *next < drawn.len())];
    let off_m = |k: &usize| (drawn[*k].s_m - s_m).abs();
    let found = candidates.into_iter().flatten().min_by(|a, b| off_m(a).total_cmp(&off_m(b)));
    found.filter(|k| off_m(k) <= LINE_M)
}

#[cfg(test)]
mod tests;
