//! Places at which vehicles begin.

use std::collections::VecDeque;

use swerve_core::Rng;
use swerve_geom::{Obb, Pose2};
use swerve_msg::{ActorId, Extent};
use swerve_road_user::idm::Idm;

use crate::car::Car;
use crate::net::Net;
use crate::setup::TrafficSetup;

/// Most places that are tried for a vehicle.
const TRIES: usize = 400;
/// Free length before and behind a vehicle at the start, and free width on each side, metres.
pub(crate) const AT_START_M: [f64; 2] = [5.0, 0.4];
/// Fastest lane that cyclists use, m/s.
const CYCLES_MPS: f64 = 17.0;

/// Ground that is not available.
pub(crate) struct Taken<'a> {
    /// Boxes that must not overlap.
    pub(crate) bodies: &'a [Obb],
    /// Boxes to keep a distance from.
    pub(crate) reserved: &'a [Obb],
    pub(crate) reserve_m: f64,
}

impl Taken<'_> {
    /// True if a box, with the free ground around it, is available.
    pub(crate) fn is_free(&self, body: &Obb, free_m: [f64; 2]) -> bool {
        let wide = Obb {
            half_length_m: body.half_length_m + free_m[0],
            half_width_m: body.half_width_m + free_m[1],
            ..*body
        };
        let center = body.center.point();
        let is_apart = |other: &Obb, reach_m: f64| {
            center.distance(other.center.point()) > wide.radius() + other.radius() + reach_m
        };
        self.bodies.iter().all(|other| is_apart(other, 0.0) || !wide.overlaps(other))
            && self
                .reserved
                .iter()
                .all(|other| is_apart(other, self.reserve_m) || body.distance(other) >= self.reserve_m)
    }
}

/// Lanes that vehicles of a kind begin on, and their summed lengths.
#[derive(Clone, Debug)]
pub(crate) struct Entries {
    lanes: Vec<(usize, f64)>,
    total_m: f64,
}

impl Entries {
    pub(crate) fn new(net: &Net, cycles: bool) -> Self {
        let has_cycling = net.lanes.iter().any(|lane| lane.cycling);
        let mut entries = Self { lanes: Vec::new(), total_m: 0.0 };
        for (k, lane) in net.lanes.iter().enumerate() {
            let is_kind = match cycles {
                true if has_cycling => lane.cycling,
                true => lane.for_cars && lane.limit_mps <= CYCLES_MPS,
                false => lane.for_cars,
            };
            if is_kind && !lane.in_junction && lane.length_m > 12.0 {
                entries.total_m += lane.length_m;
                entries.lanes.push((k, entries.total_m));
            }
        }
        entries
    }

    /// First free place with room among keyed draws: lane and place along it.
    pub(crate) fn place(
        &self,
        net: &Net,
        car: &Car,
        (rng, taken, free_m): (&mut Rng, &Taken<'_>, [f64; 2]),
        has_room: impl Fn(usize, f64) -> bool,
    ) -> Option<(usize, f64, Pose2)> {
        for _ in 0..TRIES {
            let draw_m = rng.uniform(0.0, self.total_m);
            let k = self.lanes.partition_point(|(_, end_m)| *end_m <= draw_m);
            let &(lane, end_m) = self.lanes.get(k)?;
            let on = net.lane(lane);
            let s_m = draw_m - (end_m - on.length_m);
            let margin_m = car.half_m() + 1.0;
            let in_zone = on.zones.iter().any(|zone| zone.at_m[0] - 1.0 < s_m && s_m < zone.at_m[1] + 1.0);
            let on_crossing = on
                .crossings
                .iter()
                .any(|(_, [from_m, to_m])| from_m - margin_m < s_m && s_m < to_m + margin_m);
            let is_closed = on.closed_m.map_or(on.is_blocked, |closed_m| s_m < closed_m + margin_m);
            if s_m < margin_m || s_m > on.length_m - margin_m || in_zone || on_crossing || is_closed {
                continue;
            }
            let pose = on.line.at(s_m).pose;
            if taken.is_free(&car.extent.footprint(pose), free_m) && has_room(lane, s_m) {
                return Some((lane, s_m, pose));
            }
        }
        None
    }
}

/// A driver and its vehicle, not yet on a lane.
pub(crate) fn vehicle(setup: &TrafficSetup, seed: u64, cycles: bool, key: usize, id: ActorId) -> Car {
    let key = key as i64;
    let mut rng = Rng::keyed(seed, if cycles { "traffic cyclist" } else { "traffic car" }, &[key]);
    let params = &setup.drivers;
    let mut within = |[low, high]: [f64; 2]| rng.uniform(low, high);
    let share = within(params.speed_shares);
    let headway_s = within(params.headways_s);
    let gain_mps2 = within(params.gains_mps2);
    let (extent, top_mps, gain_mps2) = if cycles {
        let extent = Extent { length_m: 1.8, width_m: 0.6, height_m: 1.75 };
        (extent, within([4.0, 6.5]), 0.6 * gain_mps2)
    } else {
        let extent = Extent {
            length_m: within([4.1, 4.9]),
            width_m: within([1.75, 1.9]),
            height_m: within([1.4, 1.65]),
        };
        (extent, f64::INFINITY, gain_mps2)
    };
    Car {
        id,
        key,
        cycles,
        extent,
        idm: Idm { gain_mps2, brake_mps2: params.brake_mps2, headway_s, stand_gap_m: params.stand_gap_m },
        share,
        top_mps,
        way: VecDeque::new(),
        x_m: 0.0,
        speed_mps: 0.0,
        gain_mps2: 0.0,
        beside_m: 0.0,
        blocks: VecDeque::new(),
        grants: VecDeque::new(),
        change: None,
        choices: 0,
        entries: 0,
        since_change_s: 0.0,
        stands_s: 0.0,
        waits_s: 0.0,
        counted: false,
        is_held: false,
        at_red: false,
        passes: None,
        stops: None,
        is_hit: false,
        rests_at: None,
    }
}

impl Car {
    /// Puts the vehicle on a lane and plans its way from there.
    pub(crate) fn enter(&mut self, net: &Net, seed: u64, (lane, s_m): (usize, f64)) {
        self.way.clear();
        self.way.push_back((lane, 0.0));
        self.x_m = s_m;
        (self.gain_mps2, self.speed_mps) = (0.0, 0.0);
        self.blocks.clear();
        self.grants.clear();
        (self.change, self.passes, self.stops) = (None, None, None);
        (self.stands_s, self.waits_s, self.since_change_s) = (0.0, 0.0, 0.0);
        (self.counted, self.is_held, self.at_red) = (false, false, false);
        // On a lane for cars, cyclists keep to the right.
        let on = net.lane(lane);
        self.beside_m =
            if self.cycles && !on.cycling { -(0.5 * on.width_m - 0.75).clamp(0.0, 1.2) } else { 0.0 };
        self.entries += 1;
        self.plan(net, seed);
    }
}
