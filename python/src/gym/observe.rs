//! Messages as numbers for learning agents.
//!
//! Positions are relative to the ego as reported by localization: forward, left, counter-clockwise.

use std::sync::Arc;

use swerve_core::Span;
use swerve_flow::ErasedPayload;
use swerve_geom::{Point2, Pose2, Vector2, angle_between, math};
use swerve_msg::truth::WorldState;
use swerve_msg::{
    ActorKind, Command, EgoState, Extent, Gnss, Imu, ObstacleList, PointCloud, PredictionList, RadarScan,
    Route, TrackList, WheelOdometry,
};

/// Conversion of a stream's messages to numbers.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Form {
    Ego,
    /// Position of the ego along and beside its route; from the stream `pose`.
    Route,
    World,
    Imu,
    Gnss,
    Odometry,
    Command,
    Obstacles,
    Tracks,
    Predictions,
    Radar,
    /// Distance to the nearest point of a lidar in each of its sectors.
    Lidar,
    /// A separate array, not part of the numbers.
    Image,
}

/// Distances ahead at which the route's curvature is observed, metres.
const AHEAD_M: [f64; 4] = [0.0, 5.0, 10.0, 20.0];
/// Number of sectors of a lidar's surroundings, and the distance of an empty one, metres.
const SECTORS: usize = 72;
const FREE_M: f64 = 200.0;
/// Heights of the points that count, relative to the sensor, metres.
const BELOW_M: f64 = -1.4;
const ABOVE_M: f64 = 1.0;
/// Instants of the observed predictions.
const LATER: [Span; 3] = [Span::from_ms(500), Span::from_ms(1000), Span::from_ms(2000)];
const EGO: [&str; 8] = [
    "x_m",
    "y_m",
    "heading_rad",
    "speed_mps",
    "accel_mps2",
    "lateral_accel_mps2",
    "yaw_rate_radps",
    "steering_rad",
];
const THING: [&str; 10] = [
    "present",
    "kind",
    "forward_m",
    "left_m",
    "cos_heading",
    "sin_heading",
    "forward_mps",
    "left_mps",
    "length_m",
    "width_m",
];

impl Form {
    /// Form of a stream's messages, by the Rust type.
    pub(crate) fn of(type_name: &str) -> Option<Self> {
        Some(match type_name.rsplit("::").next()? {
            "EgoState" => Self::Ego,
            "WorldState" => Self::World,
            "Imu" => Self::Imu,
            "Gnss" => Self::Gnss,
            "WheelOdometry" => Self::Odometry,
            "Command" => Self::Command,
            "ObstacleList" => Self::Obstacles,
            "TrackList" => Self::Tracks,
            "PredictionList" => Self::Predictions,
            "RadarScan" => Self::Radar,
            "PointCloud" => Self::Lidar,
            "Image" => Self::Image,
            _ => return None,
        })
    }

    /// Names of the numbers of one row.
    pub(crate) fn names(self) -> Vec<String> {
        let named = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        match self {
            Self::Ego | Self::World => named(&EGO),
            Self::Route => {
                let mut names: Vec<String> = named(&["s_m", "d_m", "heading_error_rad", "left_m", "right_m"]);
                names.extend(AHEAD_M.iter().map(|ahead| format!("curvature_1pm.{ahead}m")));
                names
            }
            Self::Imu => ["accel_mps2", "gyro_radps"]
                .iter()
                .flat_map(|name| (0..3).map(move |axis| format!("{name}.{axis}")))
                .collect(),
            Self::Gnss => named(&["latitude_deg", "longitude_deg", "altitude_m", "deviation_m"]),
            Self::Odometry => named(&["speed_mps", "yaw_rate_radps", "steering_rad"]),
            Self::Command => named(&["steering_rad", "throttle", "brake"]),
            Self::Obstacles | Self::Tracks => named(&THING),
            Self::Predictions => {
                let mut names: Vec<String> =
                    named(&["present", "kind", "probability", "length_m", "width_m"]);
                for later in [Span::ZERO].into_iter().chain(LATER) {
                    names
                        .extend(["forward_m", "left_m"].map(|n| format!("{n}.{}ms", later.ns() / 1_000_000)));
                }
                names
            }
            Self::Radar => named(&["present", "range_m", "range_rate_mps", "azimuth_rad", "rcs_dbsm"]),
            Self::Lidar => (0..SECTORS).map(|k| format!("range_m.{}deg", k * 360 / SECTORS)).collect(),
            Self::Image => Vec::new(),
        }
    }

    /// True if there is a row for each object.
    pub(crate) fn has_rows(self) -> bool {
        matches!(self, Self::Obstacles | Self::Tracks | Self::Predictions | Self::Radar)
    }
}

/// Reference frame of the observations.
#[derive(Clone, Copy)]
pub(crate) struct From<'a> {
    pub(crate) ego: &'a EgoState,
    /// Unit vector of its heading.
    pub(crate) ahead: Vector2,
    pub(crate) route: &'a Route,
    /// Maximum number of rows.
    pub(crate) rows: usize,
}

impl From<'_> {
    fn place(&self, point: Point2) -> [f64; 2] {
        self.turned(point - self.ego.pose.point())
    }

    fn turned(&self, vector: Vector2) -> [f64; 2] {
        [vector.dot(self.ahead), self.ahead.cross(vector)]
    }

    fn thing(&self, kind: ActorKind, pose: Pose2, velocity: Vector2, extent: Extent) -> Vec<f64> {
        let ([forward, left], [forward_mps, left_mps]) = (self.place(pose.point()), self.turned(velocity));
        let heading = angle_between(self.ego.pose.heading_rad, pose.heading_rad);
        let (sin, cos) = math::sin_cos(heading);
        let kind = f64::from(kind as u8);
        vec![1.0, kind, forward, left, cos, sin, forward_mps, left_mps, extent.length_m, extent.width_m]
    }

    /// Numbers of a message, as many as its form has; zeros without a message.
    pub(crate) fn numbers(&self, form: Form, payload: Option<&Arc<dyn ErasedPayload>>, out: &mut Vec<f32>) {
        let width = form.names().len();
        let size = if form.has_rows() { width * self.rows } else { width };
        let begin = out.len();
        if form == Form::Route {
            self.route_numbers().into_iter().for_each(|x| out.push(x as f32));
        } else if let Some(payload) = payload {
            let any = (**payload).as_any();
            let mut rows = self.rows_of(form, any);
            if form.has_rows() {
                // The nearest come first, so that rows beyond the limit are the farthest.
                rows.sort_by(|a, b| a.0.total_cmp(&b.0));
                rows.truncate(self.rows);
            }
            out.extend(rows.into_iter().flat_map(|(_, row)| row).map(|x| x as f32));
        }
        out.resize(begin + size, 0.0);
    }

    fn route_numbers(&self) -> Vec<f64> {
        let line = self.route.line();
        let place = line.project(self.ego.pose.point());
        let on_line = line.at(place.s_m);
        let error = angle_between(on_line.pose.heading_rad, self.ego.pose.heading_rad);
        let sides = [self.route.left_m(place.s_m) - place.d_m, self.route.right_m(place.s_m) + place.d_m];
        let bends = AHEAD_M.map(|ahead| line.at(place.s_m + ahead).curvature_1pm);
        [place.s_m, place.d_m, error].into_iter().chain(sides).chain(bends).collect()
    }

    /// Rows of a message, each with its sort key.
    fn rows_of(&self, form: Form, any: &dyn core::any::Any) -> Vec<(f64, Vec<f64>)> {
        let far = |row: &[f64], [x, y]: [usize; 2]| math::hypot(row[x], row[y]);
        let thing = |row: Vec<f64>| (far(&row, [2, 3]), row);
        let one = |row: Vec<f64>| vec![(0.0, row)];
        match form {
            Form::Ego => any.downcast_ref().map(|ego| one(ego_numbers(ego))),
            Form::World => any.downcast_ref().map(|world: &WorldState| one(ego_numbers(&world.ego.state))),
            Form::Imu => any.downcast_ref().map(|imu: &Imu| one([imu.accel_mps2, imu.gyro_radps].concat())),
            Form::Gnss => any.downcast_ref().map(|gnss: &Gnss| {
                one(vec![gnss.latitude_deg, gnss.longitude_deg, gnss.altitude_m, gnss.deviation_m])
            }),
            Form::Odometry => any.downcast_ref().map(|odometry: &WheelOdometry| {
                one(vec![odometry.speed_mps, odometry.yaw_rate_radps, odometry.steering_rad])
            }),
            Form::Command => any
                .downcast_ref()
                .map(|command: &Command| one(vec![command.steering_rad, command.throttle, command.brake])),
            Form::Obstacles => any.downcast_ref().map(|list: &ObstacleList| {
                let of =
                    |o: &swerve_msg::Obstacle| thing(self.thing(o.kind, o.pose, o.velocity_mps, o.extent));
                list.obstacles.iter().map(of).collect()
            }),
            Form::Tracks => any.downcast_ref().map(|list: &TrackList| {
                let of = |t: &swerve_msg::Track| thing(self.thing(t.kind, t.pose, t.velocity_mps, t.extent));
                list.tracks.iter().map(of).collect()
            }),
            Form::Predictions => any.downcast_ref().map(|list: &PredictionList| {
                let rows = list.predictions.iter().filter(|p| !p.path.is_empty()).map(|prediction| {
                    let extent = prediction.extent;
                    let kind = f64::from(prediction.kind as u8);
                    let mut row = vec![1.0, kind, prediction.probability, extent.length_m, extent.width_m];
                    for later in [Span::ZERO].into_iter().chain(LATER) {
                        row.extend(self.place(prediction.pose_at(list.stamp + later).point()));
                    }
                    (far(&row, [5, 6]), row)
                });
                rows.collect()
            }),
            Form::Radar => any.downcast_ref().map(|scan: &RadarScan| {
                let echo = |d: &swerve_msg::RadarDetection| {
                    (d.range_m, vec![1.0, d.range_m, d.range_rate_mps, d.azimuth_rad, d.rcs_dbsm])
                };
                scan.detections.iter().map(echo).collect()
            }),
            Form::Lidar => any.downcast_ref().map(|cloud: &PointCloud| one(ranges(cloud))),
            Form::Route | Form::Image => None,
        }
        .unwrap_or_default()
    }
}

/// Distance to the nearest point in each sector around a lidar, counter-clockwise from straight ahead; [`FREE_M`] without a
/// point. Points lower than [`BELOW_M`] are ground, of a
/// sensor on the roof.
fn ranges(cloud: &PointCloud) -> Vec<f64> {
    let mut ranges = vec![FREE_M; SECTORS];
    for ((x, y), z) in cloud.x_m.iter().zip(cloud.y_m.iter()).zip(cloud.z_m.iter()) {
        let (x, y, z) = (f64::from(*x), f64::from(*y), f64::from(*z));
        if !(BELOW_M..=ABOVE_M).contains(&z) {
            continue;
        }
        let turn = math::atan2(y, x) / core::f64::consts::TAU;
        let sector = (turn.rem_euclid(1.0) * SECTORS as f64) as usize % SECTORS;
        ranges[sector] = ranges[sector].min(math::hypot(x, y));
    }
    ranges
}

fn ego_numbers(ego: &EgoState) -> Vec<f64> {
    let EgoState { pose, speed_mps, accel_mps2, lateral_accel_mps2, yaw_rate_radps, steering_rad, .. } = *ego;
    let Pose2 { x_m, y_m, heading_rad, .. } = pose;
    vec![x_m, y_m, heading_rad, speed_mps, accel_mps2, lateral_accel_mps2, yaw_rate_radps, steering_rad]
}
