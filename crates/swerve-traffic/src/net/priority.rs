//! Rights of way between lanes with a conflict zone.
//!
//! The first rule that decides: rights of way of the map; a stop or yield sign on one of the two ways; a left turn gives
//! way to oncoming traffic; traffic from the right goes first; the way that turns less goes first; the lane with the
//! smaller identity. Right-hand traffic is assumed.

use core::f64::consts::PI;

use swerve_geom::angle_between;
use swerve_map::{LaneId, Map};

use super::{Meeting, Net};

/// Smallest change of heading of a turn, radians.
const TURN_RAD: f64 = 0.5;
/// Most lanes of a way through a junction.
const LANES_MAX: usize = 16;

/// Way through a junction on which a lane is.
struct Passage {
    /// Lanes from the one that leads in to this one.
    lanes: Vec<LaneId>,
    in_rad: f64,
    turn_rad: f64,
    has_sign: bool,
}

/// Sets who yields in each zone.
pub(super) fn assign(net: &mut Net, map: &Map) {
    let passages: Vec<Passage> = (0..net.lanes.len()).map(|k| passage(net, k)).collect();
    for k in 0..net.lanes.len() {
        let mut zones = core::mem::take(&mut net.lanes[k].zones);
        for zone in zones.iter_mut().filter(|zone| zone.meeting != Meeting::Fork) {
            zone.yields = yields(map, &passages[k], &passages[zone.other]);
        }
        net.lanes[k].zones = zones;
    }
}

fn passage(net: &Net, k: usize) -> Passage {
    let mut lanes = vec![k];
    while lanes.len() < LANES_MAX {
        let first = lanes[lanes.len() - 1];
        let before = net.lanes[first].before.first().filter(|_| net.lanes[first].in_junction);
        let Some(&before) = before.filter(|before| !lanes.contains(before)) else { break };
        lanes.push(before);
    }
    let mut last = k;
    for _ in 0..LANES_MAX {
        let next = net.lanes[last].next.first().filter(|next| net.lanes[**next].in_junction);
        let Some(&next) = next.filter(|_| net.lanes[last].in_junction) else { break };
        last = next;
    }
    let entry = &net.lanes[lanes[lanes.len() - 1]];
    let in_rad = if lanes.len() > 1 { entry.end_rad() } else { entry.begin_rad() };
    let turn_rad = angle_between(in_rad, net.lanes[last].end_rad());
    let has_sign = lanes.iter().any(|k| {
        let stops = net.lanes[*k].stops.iter();
        let is_entry = net.lanes[*k].in_junction;
        // On the lane that leads in, only a sign at its end is for this junction.
        stops
            .filter(|stop| is_entry || stop.s_m > net.lanes[*k].length_m - 30.0)
            .any(|stop| stop.sign.is_some())
    });
    Passage { lanes: lanes.into_iter().map(|k| net.lanes[k].id).collect(), in_rad, turn_rad, has_sign }
}

fn yields(map: &Map, own: &Passage, other: &Passage) -> bool {
    let [gives, has] = [is_below(map, own, other), is_below(map, other, own)];
    if gives != has {
        return gives;
    }
    if own.has_sign != other.has_sign {
        return own.has_sign;
    }
    let between_rad = angle_between(own.in_rad, other.in_rad);
    let [own_left, other_left] = [own, other].map(|one| one.turn_rad > TURN_RAD);
    if between_rad.abs() > 0.75 * PI && own_left != other_left {
        return own_left;
    }
    if (0.25 * PI..=0.75 * PI).contains(&between_rad.abs()) {
        return between_rad > 0.0;
    }
    let [own_rad, other_rad] = [own, other].map(|one| one.turn_rad.abs());
    if (own_rad - other_rad).abs() > 1e-3 {
        return own_rad > other_rad;
    }
    own.lanes[0] > other.lanes[0]
}

/// True if the map lets a way give way to another.
fn is_below(map: &Map, own: &Passage, other: &Passage) -> bool {
    let junctions = map.junctions_of(own.lanes[0]);
    junctions
        .flat_map(|junction| &junction.rights_of_way)
        .any(|right| own.lanes.contains(&right.lane) && other.lanes.contains(&right.to))
}
