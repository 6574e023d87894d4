//! Stop lines of red lights, as obstacles for plans.

use serde::{Deserialize, Serialize};
use swerve_core::Time;
use swerve_flow::{At, Context, Inputs, Latest, Operator, Port, Window};
use swerve_geom::{FrenetPoint, LineTracker, Pose2};
use swerve_msg::{
    ActorId, ActorKind, EgoState, Extent, PredictedPose, Prediction, PredictionList, Route, Signal,
    TrafficLight, TrafficLights,
};
use swerve_vehicle::{Shape, VehicleParams};

use crate::kind::{Kind, Node};
use crate::problems::KeyProblems;
use crate::site::Site;

/// Thickness and height of the obstacle on a stop line, metres.
const WALL_M: [f64; 2] = [0.5, 1.0];
/// Identities of stop lines count down from this: tracks count up.
const LAST_ID: u32 = u32::MAX;
/// Distance over a line from which it counts as passed, metres.
const PASSED_M: f64 = 0.5;
/// Past poses kept to find the one at a frame's stamp: up to the age of a frame, at 100 Hz.
const POSES: usize = 64;
/// Shortest time for which every light is yellow, seconds. Source: MUTCD (2009), section 4D.26.
const YELLOW_MIN_S: f64 = 3.0;
/// Reserve before the light can be red for an ego that goes on at yellow, seconds: the first frame that shows yellow is
/// late, and the speed is not held exactly.
const EARLY_S: f64 = 0.25;

/// Adds a wall to the predictions on the stop line of each light at which the ego has to stop.
pub(super) struct StopLines {
    table: Table,
    route: Route,
    shape: Shape,
    brake_max_mps2: f64,
    /// Lines at which the ego stops, by arc length.
    held: Vec<f64>,
    /// Lines of yellow lights, and the times since which they are yellow.
    yellow: Vec<(f64, Time)>,
    /// Position of the ego along the route.
    place: LineTracker,
}

/// Keys of the stop lines.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Table {
    /// Deceleration for a stop at a yellow light, m/s²: if it takes more, the ego goes on, provided it reaches the line
    /// before the light can be red. Source: 10 ft/s² (ITE, Guidelines for Determining Traffic Signal Change and
    /// Clearance Intervals, 2020).
    brake_mps2: f64,
    /// Time from the signal to the brakes, seconds. ITE has 1 s for people.
    reaction_s: f64,
}

impl Default for Table {
    fn default() -> Self {
        Self { brake_mps2: 3.0, reaction_s: 0.5 }
    }
}

/// Predictions, and the newest signals of the lights.
#[derive(Inputs)]
pub(super) struct In {
    /// Predictions of the other road users.
    predictions: At<PredictionList>,
    /// Signals of the lights.
    lights: Latest<TrafficLights>,
    /// Past poses of the ego.
    poses: Window<EgoState, POSES>,
}

impl Kind for StopLines {
    const NODE: Node =
        Node::new("stop_lines", "a wall on the stop line of a red light, among the predictions");
    type Table = Table;

    fn problems(table: &Table) -> KeyProblems {
        let ranges =
            [("brake_mps2", table.brake_mps2, [0.1, 20.0]), ("reaction_s", table.reaction_s, [0.0, 5.0])];
        let wrong = ranges.into_iter().filter(|(_, value, [least, most])| !(*least..=*most).contains(value));
        wrong
            .map(|(key, value, [least, most])| {
                (key.to_owned(), format!("expected {least} to {most}, found {value}"))
            })
            .collect()
    }

    fn new(table: Table, site: &Site<'_>) -> anyhow::Result<Self> {
        let around = site.surroundings();
        Ok(Self::on(table, around.route.clone(), &around.vehicle))
    }
}

impl Operator for StopLines {
    type In = In;
    type Out = Port<PredictionList>;

    fn step(&mut self, _: &mut Context<'_>, input: &In, out: &mut Self::Out) {
        let Some(predictions) = input.predictions.get() else { return };
        let mut list = (**predictions).clone();
        let ego = input.poses.get().iter().rev().find(|pose| pose.stamp <= list.stamp);
        if let (Some(lights), Some(ego)) = (input.lights.get(), ego.filter(|ego| ego.is_plausible())) {
            let to_front_m = self.shape.length_m - self.shape.rear_overhang_m;
            let front_s_m = self.place.locate(self.route.line(), ego.pose).s_m + to_front_m;
            self.hold(lights, front_s_m, ego.speed_mps);
            for (k, line_s_m) in self.held.iter().enumerate() {
                let id = ActorId(LAST_ID - k as u32);
                list.predictions.push(wall(id, *line_s_m, &self.route, list.stamp));
            }
        }
        out.send(list);
    }
}

impl StopLines {
    fn on(table: Table, route: Route, vehicle: &VehicleParams) -> Self {
        let brake_max_mps2 = vehicle.limits.brake_max_mps2;
        Self {
            table,
            route,
            shape: vehicle.shape,
            brake_max_mps2,
            held: Vec::new(),
            yellow: Vec::new(),
            place: LineTracker::default(),
        }
    }

    /// Updates the lines at which the ego stops: of red lights, of yellow ones by
    /// [`stops_at_yellow`](Self::stops_at_yellow), and of held lights that show nothing now; except lines behind the
    /// ego and new ones too close for full braking.
    fn hold(&mut self, lights: &TrafficLights, front_s_m: f64, speed_mps: f64) {
        let TrafficLights { stamp, ref lights, .. } = *lights;
        self.watch_yellow(lights, stamp);
        let can_stop = |line_s_m: f64| front_s_m + way_m(speed_mps, self.brake_max_mps2) < line_s_m;
        let holds = |light: &TrafficLight| {
            let line_s_m = light.stop_s_m.filter(|line_s_m| front_s_m < line_s_m + PASSED_M)?;
            let held = self.held.contains(&line_s_m);
            let stops = match light.signal {
                Some(Signal::Red) => held || can_stop(line_s_m),
                Some(Signal::Yellow) => held || self.stops_at_yellow(line_s_m, stamp, [front_s_m, speed_mps]),
                Some(Signal::Green | Signal::Off) => false,
                None => held,
            };
            stops.then_some(line_s_m)
        };
        let mut now: Vec<f64> = lights.iter().filter_map(holds).collect();
        // A light out of sight is not taken for green.
        let gone = |line_s_m: &&f64| {
            front_s_m < **line_s_m + PASSED_M && lights.iter().all(|light| light.stop_s_m != Some(**line_s_m))
        };
        now.extend(self.held.iter().filter(gone));
        self.held = now;
    }

    /// Keeps the times since which lights are yellow.
    fn watch_yellow(&mut self, lights: &[TrafficLight], stamp: Time) {
        let is_yellow = |line_s_m: f64| {
            let shows = |light: &TrafficLight| {
                light.stop_s_m == Some(line_s_m) && light.signal == Some(Signal::Yellow)
            };
            lights.iter().any(shows)
        };
        self.yellow.retain(|(line_s_m, _)| is_yellow(*line_s_m));
        for line_s_m in
            lights.iter().filter_map(|light| light.stop_s_m).filter(|line_s_m| is_yellow(*line_s_m))
        {
            if !self.yellow.iter().any(|(known, _)| *known == line_s_m) {
                self.yellow.push((line_s_m, stamp));
            }
        }
    }

    /// Returns true if the ego stops at a yellow light: comfortably where there is room; else only if it cannot reach
    /// the line in the least time that a light is yellow, and full braking suffices. So there is no position from which
    /// the ego can neither stop nor pass (the dilemma zone of Gazis, Herman and Maradudin 1960).
    fn stops_at_yellow(&self, line_s_m: f64, stamp: Time, [front_s_m, speed_mps]: [f64; 2]) -> bool {
        let Table { brake_mps2, reaction_s } = self.table;
        let ahead_m = line_s_m - front_s_m;
        if way_m(speed_mps, brake_mps2) + speed_mps * reaction_s < ahead_m {
            return true;
        }
        let since =
            self.yellow.iter().find(|(known, _)| *known == line_s_m).map_or(stamp, |(_, since)| *since);
        // The reserve does not cause hard braking after a decision to go on.
        let early_s = if since == stamp { EARLY_S } else { 0.0 };
        let left_s = YELLOW_MIN_S - early_s - (stamp - since).as_secs();
        speed_mps * left_s < ahead_m && way_m(speed_mps, self.brake_max_mps2) < ahead_m
    }
}

/// An obstacle across the drivable ground, from arc length `line_s_m` of the route on, for the whole prediction
/// horizon.
pub(super) fn wall(id: ActorId, line_s_m: f64, route: &Route, at: Time) -> Prediction {
    let [length_m, height_m] = WALL_M;
    let s_m = line_s_m + 0.5 * length_m;
    let [left_m, right_m] = [route.left_m(s_m), route.right_m(s_m)];
    let middle = route.unproject(FrenetPoint { s_m, d_m: 0.5 * (left_m - right_m) });
    let pose = Pose2::new(middle.x_m, middle.y_m, route.line().at(s_m).pose.heading_rad);
    let extent = Extent { length_m, width_m: left_m + right_m, height_m };
    Prediction::single(id, ActorKind::Static, extent, vec![PredictedPose { at, pose }])
}

/// Stopping distance, metres.
fn way_m(speed_mps: f64, brake_mps2: f64) -> f64 {
    0.5 * speed_mps * speed_mps / brake_mps2
}

#[cfg(test)]
mod tests;
