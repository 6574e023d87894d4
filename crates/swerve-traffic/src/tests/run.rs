//! Drives of traffic alone, with the checks that hold in every drive.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use swerve_core::{Span, Time};
use swerve_geom::Obb;
use swerve_map::{Aspect, LaneId, Map};
use swerve_map_io::MapFile;
use swerve_msg::{ActorId, ActorKind};

use crate::scene::Other;
use crate::{Counts, Lights, Traffic, TrafficSetup};

/// A map of the scenarios.
pub(super) fn scenario_map(name: &str) -> Arc<Map> {
    read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/maps").join(name))
}

/// A map of the test data; `None` if it is missing.
pub(super) fn data_map(name: &str) -> Option<Arc<Map>> {
    swerve_tests::data_or_skip(name).map(|path| read(&path))
}

fn read(path: &Path) -> Arc<Map> {
    let text = std::fs::read_to_string(path).unwrap();
    MapFile::read(&path.display().to_string(), &text).unwrap().map
}

/// Lights that change between green, yellow and red, in turn for the two axes of the map.
pub(super) fn lights(map: &Arc<Map>) -> Lights {
    let map = Arc::clone(map);
    Lights::new(move |id, at| {
        let heading_rad = map.signal(id).map_or(0.0, |signal| signal.heading_rad);
        let along_y = swerve_geom::math::sin(heading_rad).abs() > 0.7;
        let into_s = (at.as_secs() + if along_y { 20.0 } else { 0.0 }) % 40.0;
        match into_s {
            s if s < 15.0 => Aspect::Green,
            s if s < 18.0 => Aspect::Yellow,
            _ => Aspect::Red,
        }
    })
}

/// Sums over a drive.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(super) struct Sums {
    pub(super) counts: Counts,
    /// Pairs of vehicles and of vehicle and pedestrian that overlap, summed over ticks.
    pub(super) overlaps: u64,
    pub(super) red_lines: u64,
    pub(super) slowest_mps: f64,
    /// Distance covered by all vehicles, metres.
    pub(super) covered_m: f64,
    pub(super) longest_wait_s: f64,
}

/// Drives for a time and sums up.
pub(super) fn drive(traffic: &mut Traffic, seconds: f64, others: impl Fn(Time) -> Vec<Other>) -> Sums {
    let mut sums = Sums::default();
    let tick = Span::from_ms(100);
    let begin = traffic.tick;
    let mut passed: BTreeMap<ActorId, (usize, f64)> = BTreeMap::new();
    for k in 1..=(seconds / tick.as_secs()) as i64 {
        let now = begin + tick * k;
        let before: Vec<(i64, f64)> = traffic.cars.iter().map(|car| (car.entries, car.x_m)).collect();
        traffic.advance(now, &others(now));
        for (car, (entries, x_m)) in traffic.cars.iter().zip(before) {
            if car.entries == entries {
                assert!(car.x_m >= x_m, "{:?} moves backwards", car.id);
                sums.covered_m += (car.x_m - x_m).max(0.0);
            }
            assert!(car.gain_mps2 >= -9.0, "{:?} brakes by {}", car.id, -car.gain_mps2);
            sums.slowest_mps = sums.slowest_mps.min(car.speed_mps);
            sums.longest_wait_s = sums.longest_wait_s.max(car.stands_s);
        }
        sums.red_lines += red_lines(traffic, &mut passed, now);
        sums.overlaps += overlaps(traffic, now);
    }
    sums.counts = traffic.counts();
    sums
}

/// Stop lines that fronts passed at red since the last call.
fn red_lines(traffic: &Traffic, fronts: &mut BTreeMap<ActorId, (usize, f64)>, now: Time) -> u64 {
    let mut count = 0;
    for car in &traffic.cars {
        let front_m = car.x_m + car.half_m();
        let on = car.way.iter().rev().find(|(_, begin_m)| *begin_m <= front_m).copied().unwrap();
        let front = (on.0, front_m - on.1);
        let before = fronts.insert(car.id, front);
        for stop in &traffic.net.lane(on.0).stops {
            let came_m = match before {
                Some((lane, s_m)) if lane == on.0 => s_m,
                Some((lane, _)) if traffic.net.lane(lane).next.contains(&on.0) => -1e-9,
                _ => continue,
            };
            let aspect = traffic.lights.strictest(&stop.signals, now);
            count += u64::from(came_m < stop.s_m && stop.s_m <= front.1 && aspect == Aspect::Red);
        }
    }
    count
}

/// Number of pairs that overlap.
pub(super) fn overlaps(traffic: &Traffic, now: Time) -> u64 {
    let actors: Vec<(ActorId, ActorKind, Obb)> = traffic
        .actors()
        .iter()
        .filter_map(|actor| {
            let pose = traffic.movement(actor.id, now)?.pose;
            Some((actor.id, actor.kind, actor.extent.footprint(pose)))
        })
        .collect();
    let mut count = 0;
    for (k, (id, kind, body)) in actors.iter().enumerate() {
        for (other_id, other_kind, other) in &actors[k + 1..] {
            let people = [kind, other_kind].iter().all(|kind| **kind == ActorKind::Pedestrian);
            let reach_m = body.radius() + other.radius();
            let is_near = body.center.point().distance(other.center.point()) < reach_m;
            if !people && is_near && body.overlaps(other) {
                count += 1;
                if count < 3 {
                    println!("{now:?}: {} and {} overlap at {:?}", id.0, other_id.0, body.center.point());
                }
            }
        }
    }
    count
}

/// Traffic of cars alone.
pub(super) fn cars(map: &Arc<Map>, vehicles: usize, seed: u64) -> Traffic {
    let setup = TrafficSetup { vehicles, ..TrafficSetup::default() };
    Traffic::new(Arc::clone(map), &setup, lights(map), seed, &[])
}

/// Puts a vehicle onto a way of lanes, at a place on the first one.
pub(super) fn put(traffic: &mut Traffic, who: usize, lanes: &[LaneId], s_m: f64, speed_mps: f64) {
    let index = |id: &LaneId| traffic.net.lanes.iter().position(|lane| lane.id == *id).unwrap();
    let lanes: Vec<usize> = lanes.iter().map(index).collect();
    let car = &mut traffic.cars[who];
    car.enter(&traffic.net, 0, (lanes[0], s_m));
    car.way.truncate(1);
    for &lane in &lanes[1..] {
        let (last, begin_m) = *car.way.back().unwrap();
        car.way.push_back((lane, begin_m + traffic.net.lane(last).length_m));
    }
    car.blocks.clear();
    car.plan(&traffic.net, 0);
    car.speed_mps = speed_mps;
}

/// For each lane into the only junction of a map: the lane, and a way through that turns by `turn_rad` at least nearly,
/// ordered by the heading in.
pub(super) fn ways(traffic: &Traffic, turn_rad: f64) -> Vec<Vec<LaneId>> {
    let net = &traffic.net;
    let into = |k: &usize| {
        !net.lane(*k).in_junction && net.lane(*k).next.iter().any(|next| net.lane(*next).in_junction)
    };
    let end_rad = |k: usize| net.lane(k).line.at(net.lane(k).length_m).pose.heading_rad;
    let mut ways: Vec<(f64, Vec<LaneId>)> = Vec::new();
    for k in (0..net.lanes.len()).filter(into) {
        let through = |next: &usize| {
            let mut way = vec![k, *next];
            while net.lane(way[way.len() - 1]).in_junction {
                way.push(net.lane(way[way.len() - 1]).next[0]);
            }
            way
        };
        let off_rad = |way: &Vec<usize>| {
            let last = net.lane(way[way.len() - 1]);
            let turned_rad = swerve_geom::angle_between(end_rad(k), last.line.at(0.0).pose.heading_rad);
            (turned_rad - turn_rad).abs()
        };
        let options = net.lane(k).next.iter().map(through);
        let best = options.min_by(|a, b| off_rad(a).total_cmp(&off_rad(b))).unwrap();
        ways.push((end_rad(k), best.into_iter().map(|k| net.lane(k).id).collect()));
    }
    ways.sort_by(|a, b| a.0.total_cmp(&b.0));
    ways.into_iter().map(|(_, way)| way).collect()
}
