//! A vehicle of the traffic, and its way over the lanes.

use std::collections::VecDeque;

use swerve_core::Rng;
use swerve_geom::{Pose2, Vector2, math};
use swerve_msg::{ActorId, Extent};
use swerve_road_user::idm::Idm;

use crate::net::{End, Meeting, Net, Zone};

/// Length of the way that is known ahead, metres.
const AHEAD_M: f64 = 160.0;
/// Zones closer than a vehicle and its gaps are passed together, metres.
const ROOM_M: f64 = 9.0;
/// Largest distance of a stop line before the zones that it is for, metres.
const LINE_M: f64 = 25.0;
/// Gap left at stop lines and zones, metres.
pub(crate) const LINE_GAP_M: f64 = 0.4;
/// Duration of a lane change, seconds.
pub(crate) const CHANGE_S: f64 = 3.5;

/// Zones that are passed without a stop between them. Places are those of the vehicle's centre along its way.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    /// Place where it waits.
    pub(crate) stop_m: f64,
    pub(crate) begin_m: f64,
    pub(crate) end_m: f64,
    /// Zones, each with the begin of its lane.
    pub(crate) zones: Vec<(f64, Zone)>,
    /// True if it must come to rest before.
    pub(crate) has_stop_sign: bool,
}

/// A lane change under way: the vehicle counts on both lanes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Change {
    /// The lane that it leaves.
    pub(crate) from: usize,
    /// Place on that lane less the place along the way, metres.
    pub(crate) offset_m: f64,
    /// Lateral offset at the begin, metres.
    pub(crate) begin_d_m: f64,
    /// Time since the begin, seconds.
    pub(crate) since_s: f64,
}

/// Permission to pass zones up to a place of the way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grant {
    pub(crate) until_m: f64,
    /// Place where it would have waited.
    pub(crate) stop_m: f64,
    /// The lower number goes first where two conflict.
    pub(crate) number: u64,
}

/// A car or cyclist.
#[derive(Clone, Debug)]
pub(crate) struct Car {
    pub(crate) id: ActorId,
    /// Index among the actors of its kind: with the seed, the key of its draws.
    pub(crate) key: i64,
    pub(crate) cycles: bool,
    pub(crate) extent: Extent,
    pub(crate) idm: Idm,
    /// Ratio of its desired speed to the limit.
    pub(crate) share: f64,
    /// Largest desired speed, m/s.
    pub(crate) top_mps: f64,
    /// Lanes from the present one on, and the place where each begins along the way, metres.
    pub(crate) way: VecDeque<(usize, f64)>,
    /// Place of the centre along the way, metres.
    pub(crate) x_m: f64,
    pub(crate) speed_mps: f64,
    pub(crate) gain_mps2: f64,
    /// Lateral offset in its lane, metres.
    pub(crate) beside_m: f64,
    pub(crate) blocks: VecDeque<Block>,
    pub(crate) grants: VecDeque<Grant>,
    pub(crate) change: Option<Change>,
    /// Number of choices made at forks, and of places entered.
    pub(crate) choices: i64,
    pub(crate) entries: i64,
    pub(crate) since_change_s: f64,
    /// Time at rest, and time for which it could not pass the next block, seconds.
    pub(crate) stands_s: f64,
    pub(crate) waits_s: f64,
    /// True once it is counted as one that stands for too long.
    pub(crate) counted: bool,
    /// True if a vehicle ahead, or the lack of room beyond, keeps it from the next block: nobody gives way to it.
    pub(crate) is_held: bool,
    /// True if it waits at a red light, or behind someone who does.
    pub(crate) at_red: bool,
    /// Stop line whose light it passes although it is no longer green: lane and index.
    pub(crate) passes: Option<(usize, usize)>,
    /// Stop line at which it has decided to stop.
    pub(crate) stops: Option<(usize, usize)>,
    /// True after a collision: physics moves it.
    pub(crate) is_hit: bool,
    /// Pose and velocity until the next tick, if it rests up to then.
    pub(crate) rests_at: Option<(Pose2, Vector2)>,
}

impl Car {
    pub(crate) fn half_m(&self) -> f64 {
        0.5 * self.extent.length_m
    }

    pub(crate) fn lane(&self) -> usize {
        self.way[0].0
    }

    /// Place on the present lane, metres.
    pub(crate) fn s_m(&self) -> f64 {
        self.x_m - self.way[0].1
    }

    /// Place up to which it may pass zones.
    pub(crate) fn granted_m(&self) -> f64 {
        self.grants.back().map_or(f64::NEG_INFINITY, |grant| grant.until_m)
    }

    /// Number of the grant for a place, if there is one.
    pub(crate) fn grant_at(&self, place_m: f64) -> Option<u64> {
        self.grants.iter().find(|grant| place_m <= grant.until_m).map(|grant| grant.number)
    }

    /// Next block that it has no grant for.
    pub(crate) fn next_block(&self) -> Option<&Block> {
        self.blocks.iter().find(|block| block.begin_m > self.granted_m() && block.end_m > self.x_m)
    }

    /// End of the way, if it is known: a closed place ahead, or the end of a lane without another one.
    pub(crate) fn end(&self, net: &Net) -> Option<End> {
        let closed = |(lane, begin_m): &(usize, f64)| Some(begin_m + net.lane(*lane).closed_m?);
        if let Some(closed_m) = self.way.iter().filter_map(closed).find(|closed_m| *closed_m > self.x_m) {
            return Some(End::Closed(closed_m));
        }
        let &(last, begin_m) = self.way.back()?;
        let end_m = begin_m + net.lane(last).length_m;
        let goes_on = net.onward(last, self.cycles).next().is_some();
        let end = if net.lane(last).is_open { End::Open(end_m) } else { End::Dead(end_m) };
        (!goes_on).then_some(end)
    }

    /// Largest desired speed at its place, with regard to bends ahead, m/s.
    pub(crate) fn desired_mps(&self, net: &Net, brake_mps2: f64) -> f64 {
        let mut desired_mps = self.top_mps;
        for &(lane, begin_m) in &self.way {
            let ahead_m = begin_m - self.x_m;
            if ahead_m > 80.0 {
                break;
            }
            let lane = net.lane(lane);
            let there_mps = lane.speed_mps(-ahead_m) * self.share;
            let reach_mps = (there_mps * there_mps + brake_mps2 * ahead_m.max(0.0)).sqrt();
            desired_mps = desired_mps.min(reach_mps);
        }
        desired_mps
    }

    /// Moves by a tick: constant acceleration, no motion backwards.
    pub(crate) fn advance(&mut self, dt_s: f64) {
        let (along_m, speed_mps) = self.after(dt_s);
        self.x_m += along_m;
        self.speed_mps = speed_mps;
    }

    /// Distance and speed after a time with the present acceleration.
    fn after(&self, dt_s: f64) -> (f64, f64) {
        let moves_s = if self.gain_mps2 < 0.0 { dt_s.min(self.speed_mps / -self.gain_mps2) } else { dt_s };
        let along_m = self.speed_mps * moves_s + 0.5 * self.gain_mps2 * moves_s * moves_s;
        let speed_mps = (self.speed_mps + self.gain_mps2 * dt_s).max(0.0);
        (along_m.max(0.0), speed_mps)
    }

    /// True if it rests until the next tick.
    pub(crate) fn rests(&self) -> bool {
        self.speed_mps == 0.0 && self.gain_mps2 == 0.0 && self.change.is_none()
    }

    /// Lateral offset and its rate, metres and m/s, a time after the last tick.
    fn lateral(&self, dt_s: f64) -> (f64, f64) {
        let Some(change) = self.change else { return (self.beside_m, 0.0) };
        let t = ((change.since_s + dt_s) / CHANGE_S).min(1.0);
        // Quintic: no velocity and acceleration at both ends.
        let left = 1.0 - t * t * t * (10.0 - 15.0 * t + 6.0 * t * t);
        let rate = -30.0 * t * t * (1.0 - t) * (1.0 - t) / CHANGE_S;
        let way_m = change.begin_d_m - self.beside_m;
        (self.beside_m + way_m * left, way_m * rate)
    }

    /// Pose and velocity a time after the last tick.
    pub(crate) fn movement(&self, net: &Net, dt_s: f64) -> (Pose2, Vector2) {
        let (along_m, speed_mps) = self.after(dt_s);
        let x_m = self.x_m + along_m;
        let on = self.way.iter().take_while(|(_, begin_m)| *begin_m <= x_m).last();
        let &(lane, begin_m) = on.unwrap_or(&self.way[0]);
        let at = net.lane(lane).line.at(x_m - begin_m).pose;
        let (d_m, rate_mps) = self.lateral(dt_s);
        let ahead = at.direction();
        let left = ahead.left();
        let point = at.point() + left * d_m;
        // A vehicle at rest does not slide sideways; one that moves heads where it goes.
        let rate_mps = if speed_mps > 1.0 { rate_mps } else { 0.0 };
        // The angle of a motion straight ahead is zero with the sign of its rate.
        let off_rad = if rate_mps == 0.0 { rate_mps } else { math::atan2(rate_mps, speed_mps.max(1.0)) };
        let heading_rad = at.heading_rad + off_rad;
        (Pose2::new(point.x_m, point.y_m, heading_rad), ahead * speed_mps + left * rate_mps)
    }

    /// Continues the way: drops lanes that are passed, adds lanes ahead by keyed choices, and finds the zones on them.
    pub(crate) fn plan(&mut self, net: &Net, seed: u64) {
        let before = self.way.len();
        while self.way.len() > 1 && self.way[1].1 <= self.x_m {
            self.way.pop_front();
        }
        let mut is_new = self.way.len() != before || self.blocks.is_empty();
        loop {
            let &(last, begin_m) = self.way.back().expect("a way has a lane");
            let end_m = begin_m + net.lane(last).length_m;
            if end_m > self.x_m + AHEAD_M {
                break;
            }
            let Some(next) = self.choose(net, seed, last) else { break };
            self.way.push_back((next, end_m));
            is_new = true;
        }
        if is_new {
            self.find_blocks(net);
        }
        while self.grants.front().is_some_and(|grant| grant.until_m < self.x_m) {
            self.grants.pop_front();
        }
        while self.blocks.front().is_some_and(|block| block.end_m < self.x_m) {
            self.blocks.pop_front();
        }
    }

    fn choose(&mut self, net: &Net, seed: u64, last: usize) -> Option<usize> {
        let mut onward: Vec<usize> = net.onward(last, self.cycles).collect();
        if self.cycles && onward.iter().any(|next| net.lane(*next).cycling) {
            onward.retain(|next| net.lane(*next).cycling);
        }
        if onward.len() < 2 {
            return onward.first().copied();
        }
        let name = if self.cycles { "traffic cyclist fork" } else { "traffic car fork" };
        self.choices += 1;
        Some(onward[Rng::keyed(seed, name, &[self.key, self.choices]).below(onward.len())])
    }

    /// Groups the zones ahead into blocks.
    pub(crate) fn find_blocks(&mut self, net: &Net) {
        self.blocks.clear();
        let granted_m = self.granted_m();
        let mut zones: Vec<(f64, f64, f64, Zone)> = Vec::new();
        for &(lane, begin_m) in &self.way {
            for zone in net.lane(lane).zones.iter().filter(|zone| zone.meeting != Meeting::Fork) {
                zones.push((begin_m + zone.at_m[0], begin_m + zone.at_m[1], begin_m, *zone));
            }
        }
        zones.sort_by(|a, b| a.0.total_cmp(&b.0));
        let grants = &self.grants;
        let grant_at = |place_m: f64| grants.iter().position(|grant| place_m <= grant.until_m);
        for (from_m, to_m, begin_m, zone) in zones {
            if to_m < self.x_m {
                continue;
            }
            let joins = |block: &&mut Block| {
                // Grants are withdrawn one by one.
                let grant = grant_at(from_m);
                let both_before = grant.is_some() && grant_at(block.begin_m) == grant;
                let both_after = block.begin_m > granted_m && from_m - block.end_m < ROOM_M;
                both_before || both_after
            };
            match self.blocks.back_mut().filter(joins) {
                Some(block) => {
                    block.end_m = block.end_m.max(to_m);
                    block.zones.push((begin_m, zone));
                }
                None => self.blocks.push_back(Block {
                    stop_m: from_m - LINE_GAP_M,
                    begin_m: from_m,
                    end_m: to_m,
                    zones: vec![(begin_m, zone)],
                    has_stop_sign: false,
                }),
            }
        }
        for k in 0..self.blocks.len() {
            // A zone that begins before the end of the grant is passed under it.
            if self.blocks[k].begin_m <= granted_m {
                continue;
            }
            let after_m = if k > 0 { self.blocks[k - 1].end_m } else { f64::NEG_INFINITY };
            let block = &self.blocks[k];
            let (mut stop_m, mut has_sign) = (block.stop_m, false);
            for &(lane, begin_m) in &self.way {
                for stop in &net.lane(lane).stops {
                    let line_m = begin_m + stop.s_m - self.half_m() - LINE_GAP_M;
                    let is_for = line_m > block.begin_m - LINE_M && line_m < block.begin_m + 6.0;
                    // Lanes passed in the meantime may have hidden a line at which it is too late to stop.
                    let is_late = line_m - self.x_m < self.speed_mps * self.speed_mps / 8.0 - LINE_GAP_M;
                    if is_for && line_m > after_m {
                        stop_m = if is_late { stop_m } else { stop_m.min(line_m) };
                        has_sign |= stop.sign == Some(swerve_map::StopSign::Stop) && stop.signals.is_empty();
                    }
                }
            }
            self.blocks[k].stop_m = stop_m;
            self.blocks[k].has_stop_sign = has_sign;
        }
    }
}
