//! Stop lines of red lights, as what no plan may go over.

use serde::{Deserialize, Serialize};
use swerve_flow::{At, Context, Inputs, Latest, Operator, Port, Window};
use swerve_geom::{FrenetPoint, LineTracker, Pose2};
use swerve_msg::{
    ActorId, ActorKind, EgoState, Extent, PredictedPose, Prediction, PredictionList, Route, Signal,
    TrafficLight, TrafficLights,
};
use swerve_vehicle::Shape;

use crate::kind::{KeyProblems, Kind, Node};
use crate::site::Site;

/// Thickness and height of what stands on a stop line, metres.
const WALL_M: [f64; 2] = [0.5, 1.0];
/// Identities of stop lines are counted down from this: tracks are counted up.
const LAST_ID: u32 = u32::MAX;
/// Who is over a line by so much has passed it, metres.
const PASSED_M: f64 = 0.5;
/// Past poses kept to find the one measured at a frame's stamp: as old as frames get, at 100 Hz.
const POSES: usize = 64;

/// Adds a wall on the stop line of each light at which the ego is to stop to what is predicted.
pub(super) struct StopLines {
    table: Table,
    route: Route,
    shape: Shape,
    /// Lines at which the ego stops, by where they are.
    held: Vec<f64>,
    /// The ego's place along the route.
    place: LineTracker,
}

/// Its keys.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Table {
    /// At a yellow light the ego stops where it can by this, m/s²; at a red one always.
    brake_mps2: f64,
}

impl Default for Table {
    fn default() -> Self {
        Self { brake_mps2: 3.0 }
    }
}

/// What is predicted, and the newest of the lights.
#[derive(Inputs)]
pub(super) struct In {
    /// Where the others will be.
    predictions: At<PredictionList>,
    /// What the lights show.
    lights: Latest<TrafficLights>,
    /// Where the ego was.
    poses: Window<EgoState, POSES>,
}

impl Kind for StopLines {
    const NODE: Node =
        Node::new("stop_lines", "a wall on the stop line of a red light, among the predictions");
    type Table = Table;

    fn problems(table: &Table) -> KeyProblems {
        let told = (!(0.1..=20.0).contains(&table.brake_mps2))
            .then(|| ("brake_mps2".to_owned(), format!("expected 0.1 to 20, found {}", table.brake_mps2)));
        told.into_iter().collect()
    }

    fn new(table: Table, site: &Site<'_>) -> anyhow::Result<Self> {
        let around = site.surroundings();
        Ok(Self {
            table,
            route: around.route.clone(),
            shape: around.vehicle.shape,
            held: Vec::new(),
            place: LineTracker::default(),
        })
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
            self.hold(&lights.lights, front_s_m, ego.speed_mps);
            for (k, line_s_m) in self.held.iter().enumerate() {
                list.predictions.push(self.wall(LAST_ID - k as u32, *line_s_m, &list));
            }
        }
        out.send(list);
    }
}

impl StopLines {
    /// Which lines hold: those of red lights, of yellow ones where there is room, and of those that held and show
    /// nothing now; never one that is behind.
    fn hold(&mut self, lights: &[TrafficLight], front_s_m: f64, speed_mps: f64) {
        let room_m = 0.5 * speed_mps * speed_mps / self.table.brake_mps2;
        let holds = |light: &TrafficLight| {
            let line_s_m = light.stop_s_m.filter(|line_s_m| front_s_m < line_s_m + PASSED_M)?;
            let held = self.held.contains(&line_s_m);
            let stops = match light.signal {
                Some(Signal::Red) => true,
                Some(Signal::Yellow) => held || front_s_m + room_m < line_s_m,
                Some(Signal::Green) => false,
                None => held,
            };
            stops.then_some(line_s_m)
        };
        let mut now: Vec<f64> = lights.iter().filter_map(holds).collect();
        // Out of sight is not green.
        let gone = |line_s_m: &&f64| {
            front_s_m < **line_s_m + PASSED_M && lights.iter().all(|light| light.stop_s_m != Some(**line_s_m))
        };
        now.extend(self.held.iter().filter(gone));
        self.held = now;
    }

    /// Something that stands across the drivable ground, from the line on, as long as anything is predicted.
    fn wall(&self, id: u32, line_s_m: f64, list: &PredictionList) -> Prediction {
        let [length_m, height_m] = WALL_M;
        let s_m = line_s_m + 0.5 * length_m;
        let [left_m, right_m] = [self.route.left_m(s_m), self.route.right_m(s_m)];
        let at = self.route.unproject(FrenetPoint { s_m, d_m: 0.5 * (left_m - right_m) });
        let pose = Pose2::new(at.x_m, at.y_m, self.route.line().at(s_m).pose.heading_rad);
        Prediction {
            id: ActorId(id),
            kind: ActorKind::Static,
            extent: Extent { length_m, width_m: left_m + right_m, height_m },
            probability: 1.0,
            path: vec![PredictedPose { at: list.stamp, pose }],
        }
    }
}
