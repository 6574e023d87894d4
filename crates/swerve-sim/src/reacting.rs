//! The driver of a recorded vehicle that brakes for the ego, by the intelligent driver model along its recorded path.
//!
//! It replays the recording until the model asks for less acceleration than was recorded, because of the ego or of a
//! road user that is not where it was recorded. From then on the model drives it, among all road users, behind its
//! recorded place, until it has caught up with that. It never leaves its path and never is ahead of its recording.

use std::collections::BTreeMap;
use std::sync::Arc;

use swerve_core::{Span, Time};
use swerve_geom::{Obb, Point2, Polyline, Vector2};
use swerve_msg::truth::Actor;
use swerve_msg::{ActorId, ActorKind, Extent};
use swerve_road_user::idm::{Idm, STAND_GAP_M};
use swerve_scenario::Scenario;
use swerve_world::{Driver, Movement, View};

use crate::track::{Played, is_parked};

/// Drivers in a town. Source: Treiber and Kesting, "Traffic Flow Dynamics" (2013), table 11.2.
const IDM: Idm = Idm { gain_mps2: 1.0, brake_mps2: 1.5, headway_s: 1.0, stand_gap_m: STAND_GAP_M };

/// The recorded place as the vehicle ahead: it is caught up with.
const RECORDED: Idm = Idm { headway_s: 0.0, stand_gap_m: 0.0, ..IDM };

/// Deceleration in an emergency, m/s².
const BRAKE_MAX_MPS2: f64 = 8.0;

/// Time between two decisions.
const DECIDES: Span = Span::from_ms(50);

/// Distance up to which vehicles ahead are regarded, metres.
const LOOK_M: f64 = 80.0;

/// Lateral distance at which vehicles count as ahead of each other, metres.
const BESIDE_M: f64 = 0.1;

/// Distance from its recorded place at which a road user is not where it was recorded, metres.
const OFF_M: f64 = 0.05;

/// Distance between points of the path, metres: a vehicle that stands does not move by the noise of its recording.
const POINT_STEP_M: f64 = 0.2;

/// Desired speed by the fastest recorded one: more, so that a vehicle catches up.
const FASTER: f64 = 1.1;

/// Smallest desired speed, m/s.
const FREE_MIN_MPS: f64 = 1.0;

/// Recorded motion of all road users.
pub(crate) type Recordings = Arc<BTreeMap<ActorId, Played>>;

/// Drivers of the recorded vehicles of a scenario that react.
pub(crate) fn drivers(scenario: &Scenario) -> BTreeMap<ActorId, Box<dyn Driver>> {
    let recorded = || scenario.actors.iter().filter_map(|actor| Some((actor, actor.track()?)));
    if !recorded().any(|(_, track)| track.reacts) {
        return BTreeMap::new();
    }
    let all = recorded().map(|(actor, track)| (actor.id, Played::new(actor.id, track)));
    let all: Recordings = Arc::new(all.collect());
    let vehicles = recorded().filter(|(actor, track)| track.reacts && actor.kind != ActorKind::Pedestrian);
    let driver = |actor: &swerve_scenario::Actor| {
        let driver = Reacting::new(all.get(&actor.id)?.clone(), &all, actor.extent)?;
        Some((actor.id, Box::new(driver) as Box<dyn Driver>))
    };
    vehicles.filter_map(|(actor, _)| driver(actor)).collect()
}

/// A recorded vehicle that brakes for others.
#[derive(Clone, Debug)]
pub(crate) struct Reacting {
    played: Played,
    all: Recordings,
    path: Path,
    half_length_m: f64,
    half_width_m: f64,
    /// Desired speed, m/s.
    free_mps: f64,
    /// Its motion at the newest observed instant; `None` while it replays the recording.
    behind: Option<Behind>,
    now: Time,
    decides_at: Time,
}

/// Motion behind the recorded place.
#[derive(Clone, Copy, Debug)]
struct Behind {
    s_m: f64,
    speed_mps: f64,
    accel_mps2: f64,
}

impl Behind {
    /// Motion after a time, until it stands.
    fn after(self, dt_s: f64) -> Self {
        let Self { s_m, speed_mps, accel_mps2 } = self;
        let end_mps = speed_mps + accel_mps2 * dt_s;
        if end_mps < 0.0 {
            let way_m = speed_mps * speed_mps / (-2.0 * accel_mps2);
            return Self { s_m: s_m + way_m, speed_mps: 0.0, accel_mps2 };
        }
        Self { s_m: s_m + 0.5 * (speed_mps + end_mps) * dt_s, speed_mps: end_mps, accel_mps2 }
    }
}

/// The recorded path.
#[derive(Clone, Debug)]
struct Path {
    line: Polyline,
    /// Arc length of each recorded pose, metres; does not decrease.
    s_m: Vec<f64>,
}

impl Path {
    /// The path of a recording; `None` if it does not move.
    fn new(played: &Played) -> Option<Self> {
        let poses = &played.track().poses;
        let mut points: Vec<Point2> = vec![poses.first()?.point()];
        let mut s_m: Vec<f64> = Vec::with_capacity(poses.len());
        let (mut last, mut length_m) = (points[0], 0.0);
        for pose in poses.iter() {
            let way_m = pose.point().distance(last);
            s_m.push((length_m + way_m).max(s_m.last().copied().unwrap_or(0.0)));
            if way_m >= POINT_STEP_M {
                (last, length_m) = (pose.point(), length_m + way_m);
                points.push(last);
            }
        }
        Some(Self { line: Polyline::new(&points).ok()?, s_m })
    }

    /// Arc length at a place among the poses, such as 2.5 in the middle between the third and the fourth, metres.
    fn at(&self, place: f64) -> f64 {
        let last = self.s_m.len() - 1;
        let k = (place.max(0.0) as usize).min(last);
        let (from_m, to_m) = (self.s_m[k], self.s_m[(k + 1).min(last)]);
        from_m + (to_m - from_m) * (place - k as f64).clamp(0.0, 1.0)
    }

    /// The last place among the poses with an arc length.
    fn place(&self, s_m: f64) -> f64 {
        let next = self.s_m.partition_point(|at_m| *at_m <= s_m);
        let (Some(k), Some(to_m)) = (next.checked_sub(1), self.s_m.get(next)) else {
            return if next == 0 { 0.0 } else { (next - 1) as f64 };
        };
        k as f64 + (s_m - self.s_m[k]) / (to_m - self.s_m[k])
    }
}

impl Reacting {
    /// Driver of a vehicle of this size; `None` if its recording does not move.
    pub(crate) fn new(played: Played, all: &Recordings, extent: Extent) -> Option<Self> {
        let path = Path::new(&played)?;
        let step_s = played.track().step_s;
        let fastest_mps = path.s_m.windows(2).map(|two| (two[1] - two[0]) / step_s).fold(0.0, f64::max);
        Some(Self {
            played,
            all: Arc::clone(all),
            path,
            half_length_m: 0.5 * extent.length_m,
            half_width_m: 0.5 * extent.width_m,
            free_mps: (FASTER * fastest_mps).max(FREE_MIN_MPS),
            behind: None,
            now: Time::ZERO,
            decides_at: Time::ZERO,
        })
    }

    /// Arc length and speed of the recorded place, metres and m/s.
    fn recorded(&self, at_s: f64) -> (f64, f64) {
        (self.path.at(self.played.place(at_s)), self.played.at(at_s).velocity_mps.norm())
    }

    /// Gap to a body ahead on the path, metres, and its speed along the path, m/s, from an arc length.
    fn gap(&self, s_m: f64, own: Point2, body: &Obb, velocity_mps: Vector2) -> Option<(f64, f64)> {
        let center = body.center.point();
        if own.distance(center) > LOOK_M + body.radius() {
            return None;
        }
        let project = |point| self.path.line.project_near(point, s_m + 0.5 * LOOK_M, 0.5 * LOOK_M + 10.0);
        let middle = project(center);
        if middle.s_m <= s_m {
            return None;
        }
        let corners = body.corners().map(project);
        let [from_m, low_m, high_m] =
            corners.iter().fold([f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY], |all, at| {
                [all[0].min(at.s_m), all[1].min(at.d_m), all[2].max(at.d_m)]
            });
        let reach_m = self.half_width_m + BESIDE_M;
        let along = self.path.line.at(middle.s_m).pose.direction();
        let is_ahead = low_m <= reach_m && high_m >= -reach_m;
        is_ahead.then(|| (from_m - s_m - self.half_length_m, velocity_mps.dot(along)))
    }

    /// True if a road user is where it was recorded, or has not been recorded and stands.
    fn is_as_recorded(&self, actor: &Actor, at_s: f64) -> bool {
        match self.all.get(&actor.id) {
            Some(played) => played.at(at_s).pose.point().distance(actor.pose.point()) <= OFF_M,
            None => actor.velocity_mps.norm() == 0.0,
        }
    }

    /// Chooses the acceleration until the next decision.
    fn decide(&mut self, view: &View<'_>) {
        let at_s = (self.now - Time::ZERO).as_secs();
        let (recorded_m, recorded_mps) = self.recorded(at_s);
        let (s_m, speed_mps) = self.behind.map_or((recorded_m, recorded_mps), |own| (own.s_m, own.speed_mps));
        let Some(own) = view.world.actor(view.own).map(|actor| actor.pose.point()) else { return };
        let [x, y, _] = view.world.ego.velocity_mps.coords.into();
        let ego = self.gap(s_m, own, &view.ego, Vector2::new(x, y));
        let is_replayed = self.behind.is_none();
        let others = view.world.actors.iter().filter(|actor| {
            actor.id != view.own
                && !is_parked(actor.pose)
                && !(is_replayed && self.is_as_recorded(actor, at_s))
        });
        let others = others.filter_map(|actor| self.gap(s_m, own, &actor.footprint(), actor.velocity_mps));
        let wanted = ego
            .into_iter()
            .chain(others)
            .map(|lead| IDM.acceleration_mps2(speed_mps, self.free_mps, Some(lead)));
        let wanted_mps2 = wanted.reduce(f64::min);
        let accel_mps2 = match (self.behind, wanted_mps2) {
            (None, None) => return,
            (None, Some(wanted_mps2)) => {
                let step_s = self.played.track().step_s;
                let recorded_mps2 = (self.recorded(at_s + step_s).1 - recorded_mps) / step_s;
                if wanted_mps2 >= recorded_mps2 {
                    return;
                }
                wanted_mps2
            }
            (Some(_), wanted_mps2) => {
                let ahead = Some((recorded_m - s_m, recorded_mps));
                let catches_up_mps2 = RECORDED.acceleration_mps2(speed_mps, self.free_mps, ahead);
                wanted_mps2.map_or(catches_up_mps2, |wanted_mps2| wanted_mps2.min(catches_up_mps2))
            }
        };
        self.behind = Some(Behind { s_m, speed_mps, accel_mps2: accel_mps2.max(-BRAKE_MAX_MPS2) });
    }
}

impl Driver for Reacting {
    fn observe(&mut self, view: &View<'_>) {
        let dt_s = (view.now() - self.now).as_secs();
        self.now = view.now();
        let at_s = (self.now - Time::ZERO).as_secs();
        let recorded_m = self.recorded(at_s).0;
        self.behind = self.behind.map(|own| own.after(dt_s)).filter(|own| own.s_m < recorded_m);
        if self.now >= self.decides_at && !is_parked(self.played.at(at_s).pose) {
            self.decides_at = self.now + DECIDES;
            self.decide(view);
        }
    }

    fn movement(&self, from: Time, to: Time) -> Option<Movement> {
        let [from_s, to_s] = [from, to].map(|at| (at - Time::ZERO).as_secs());
        if self.played.is_over(from_s) {
            return None;
        }
        let recorded = self.played.at(to_s);
        let Some(own) = self.behind.filter(|_| !is_parked(recorded.pose)) else { return Some(recorded) };
        let own = own.after((to - self.now).as_secs());
        if own.s_m >= self.recorded(to_s).0 {
            return Some(recorded);
        }
        let pose = self.played.at_place(self.path.place(own.s_m)).pose;
        Some(Movement { pose, velocity_mps: pose.direction() * own.speed_mps })
    }
}
