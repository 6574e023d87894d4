//! Localization by lidar sweeps: matched with a map, or each with those before it.
//!
//! ```text
//! lidar, imu, wheels, first fix > scan_matcher   --PoseMatch--> localizer      on a map
//!                               > lidar_odometry --PoseMatch--> localizer      without one
//! ```
//!
//! Wheels and gyroscopes undistort each sweep and predict its pose. The first fix and the lane give the initial pose.

mod survey;

use std::path::Path;

use anyhow::{Context as _, ensure};
use swerve_core::{Rng, Time};
use swerve_flow::{At, Context, Inputs, Latest, Message, Operator, Port, RuntimeModel, Window};
use swerve_geom::math;
use swerve_localization::dead_reckoning::{LidarMotion, Reading, Turned};
use swerve_localization::eskf::yaw_rad;
use swerve_localization::map_file::MapFile;
use swerve_localization::matcher::{Guess, Matcher};
use swerve_localization::ndt::{Isometry3, Matched, Vector3};
use swerve_localization::odometry::Odometry;
use swerve_msg::{EgoState, Gnss, Imu, PointCloud, PoseMatch, PoseMode, PoseQuality, Route, WheelOdometry};
use swerve_text::{FILE_MAX, read_bytes};

use super::receiver::{Receiver, new_messages, pose_of};
use crate::config::execution::Runtime;
use crate::config::sensors::LidarConfig;
use crate::kind::{Heavy, Kind, Node, Settings};
use crate::named::NoKeys;
use crate::site::Site;

/// Readings kept of inertial unit and wheels: those of a sweep and of one missed sweep, at 100 Hz.
const READINGS: usize = 64;
const FIXES: usize = 16;
/// Poses drawn for a search.
const PARTICLES: u32 = 200;
/// Standard deviation of the lane's heading as initial heading, radians.
const LANE_SIGMA_RAD: f64 = 0.09;
/// Age above which a pose of the localizer is not used, seconds; bounds of its standard deviations, metres and radians.
const PRIOR_AGE_S: f64 = 0.5;
const PRIOR_SIGMA_M: [f64; 2] = [0.3, 10.0];
const PRIOR_SIGMA_RAD: [f64; 2] = [0.03, 1.0];
/// Error of odometry without a map: metres in the first sweeps, which have little to be matched with, a share of the
/// distance, and radians per metre.
const BEGIN_M: f64 = 0.3;
const DRIFT: f64 = 0.01;
const DRIFT_RAD_PER_M: f64 = 1e-4;

/// Percentiles of the run time for a sweep of 54,000 points, ms, on one core of an AMD EPYC (family 25, model 17):
/// `benches/localization.rs`. The largest is that of a sweep with a search.
const MATCHER_MS: [[f64; 2]; 4] = [[0.0, 2.2], [50.0, 2.5], [99.0, 3.5], [100.0, 10.0]];
const ODOMETRY_MS: [[f64; 2]; 4] = [[0.0, 20.0], [50.0, 45.0], [99.0, 90.0], [100.0, 110.0]];

/// A sweep, and measurements of the motion and the initial pose.
#[derive(Inputs)]
pub(super) struct In {
    /// Points of the sweep.
    points: At<PointCloud>,
    /// Turn rates.
    imu: Window<Imu, READINGS>,
    /// Wheel speeds.
    wheels: Window<WheelOdometry, READINGS>,
    /// Satellite fixes.
    fixes: Window<Gnss, FIXES>,
    /// Route of the ego, on whose lane it starts.
    route: Latest<Route>,
}

/// The same, and the pose of the localizer.
#[derive(Inputs)]
pub(super) struct MatcherIn {
    /// Points of the sweep.
    points: At<PointCloud>,
    /// Turn rates.
    imu: Window<Imu, READINGS>,
    /// Wheel speeds.
    wheels: Window<WheelOdometry, READINGS>,
    /// Satellite fixes.
    fixes: Window<Gnss, FIXES>,
    /// Route of the ego, on whose lane it starts.
    route: Latest<Route>,
    /// Past state of the ego: centre of the search for a lost lidar.
    #[port(feedback)]
    state: Latest<EgoState>,
    /// Accuracy of that state.
    #[port(feedback)]
    quality: Latest<PoseQuality>,
}

/// Motion and initial pose of a lidar.
struct Front {
    motion: LidarMotion,
    ego_from_lidar: Isometry3<f64>,
    receiver: Receiver,
    /// Number of messages taken of inertial unit and wheels.
    taken: [u64; 2],
}

impl Front {
    fn new<'a>(site: &'a Site<'_>) -> anyhow::Result<(Self, &'a LidarConfig)> {
        let (name, config) = (site.name(), site.config());
        let from = site.source_of("points").with_context(|| format!("operator.{name}: it reads no lidar"))?;
        let lidar = config.lidar.get(from).with_context(|| {
            format!(
                "operator.{name}: expected points of a [lidar.NAME], whose mounting pose is known, found `{from}`"
            )
        })?;
        let ego_from_lidar = lidar.ego_from_lidar(&config.sim.vehicle.shape).isometry();
        let (motion, receiver) = (LidarMotion::new(ego_from_lidar), Receiver::new(site));
        Ok((Self { motion, ego_from_lidar, receiver, taken: [0; 2] }, lidar))
    }

    /// A sweep, and the motion of the lidar during it.
    fn turn<'a>(
        &mut self,
        points: &'a At<PointCloud>,
        imu: &[Message<Imu>],
        wheels: &[Message<WheelOdometry>],
    ) -> Option<(&'a PointCloud, Turned)> {
        for (stamp, reading) in readings(imu, wheels, &mut self.taken) {
            self.motion.car.take(stamp, reading);
        }
        let cloud: &PointCloud = points.get()?;
        Some((cloud, self.motion.turn(cloud.stamp)?))
    }

    /// Pose of the lidar at an instant, by the newest fix and the heading of the lane there.
    fn guess(&self, fixes: &[Message<Gnss>], at: Time) -> Option<Isometry3<f64>> {
        let fix = fixes.last()?;
        let car = self.motion.car.between(fix.stamp, at)?;
        Some(self.receiver.ego(fix)? * car * self.ego_from_lidar)
    }

    /// Published match of a lidar's pose: the car's pose, with the covariance of position and heading on the ground.
    fn told(&self, stamp: Time, map_from_lidar: &Isometry3<f64>, spread: &Spread) -> PoseMatch {
        let map_from_ego = map_from_lidar * self.ego_from_lidar.inverse();
        let at = map_from_ego.translation.vector;
        // The lever arm from lidar to car converts turns to displacements.
        let lever = at - map_from_lidar.translation.vector;
        let turned = [-lever.y, lever.x];
        let [xx, xy, yy] = spread.covariance_m2;
        let [xh, yh] = spread.with_heading;
        let hh = spread.heading_sigma_rad * spread.heading_sigma_rad;
        PoseMatch {
            stamp,
            at_m: at.into(),
            heading_rad: yaw_rad(&map_from_ego.rotation),
            covariance_m2: [
                xx + 2.0 * turned[0] * xh + turned[0] * turned[0] * hh,
                xy + turned[0] * yh + turned[1] * xh + turned[0] * turned[1] * hh,
                yy + 2.0 * turned[1] * yh + turned[1] * turned[1] * hh,
            ],
            height_sigma_m: spread.height_sigma_m,
            heading_sigma_rad: spread.heading_sigma_rad,
        }
    }
}

/// Accuracy of a lidar's pose.
struct Spread {
    covariance_m2: [f64; 3],
    /// Covariance of x and of y with the heading, m rad.
    with_heading: [f64; 2],
    height_sigma_m: f64,
    heading_sigma_rad: f64,
}

impl Spread {
    fn of(found: &Matched) -> Self {
        let c = |i: usize, j: usize| found.covariance[(i, j)];
        Self {
            covariance_m2: [c(0, 0), c(0, 1), c(1, 1)],
            with_heading: [c(0, 5), c(1, 5)],
            height_sigma_m: c(2, 2).sqrt(),
            heading_sigma_rad: c(5, 5).sqrt(),
        }
    }
}

/// New readings of both, ordered by stamp.
pub(super) fn readings(
    imu: &[Message<Imu>],
    wheels: &[Message<WheelOdometry>],
    taken: &mut [u64; 2],
) -> Vec<(Time, Reading)> {
    let [imu_taken, wheels_taken] = taken;
    let gyro = new_messages(imu, imu_taken).map(|imu| (imu.stamp, Reading::Gyro(imu.gyro_radps)));
    let wheels =
        new_messages(wheels, wheels_taken).map(|wheels| (wheels.stamp, Reading::Wheels(wheels.speed_mps)));
    let mut readings: Vec<_> = wheels.chain(gyro).collect();
    readings.sort_by_key(|(stamp, _)| *stamp);
    readings
}

/// Points, each with its time relative to the end of the sweep as a share of the period, -1 to 0.
fn points(cloud: &PointCloud, period_s: f64) -> Vec<(Vector3<f64>, f64)> {
    let point = |k: usize| {
        let at_m = [cloud.x_m[k], cloud.y_m[k], cloud.z_m[k]].map(f64::from);
        (Vector3::from(at_m), f64::from(cloud.time_offset_s[k]) / period_s)
    };
    (0..cloud.len()).map(point).collect()
}

/// Reads a map file.
fn read(path: &Path) -> anyhow::Result<MapFile> {
    ensure!(path.exists(), "there is no such file; `swerve map build` writes one");
    Ok(MapFile::read(&read_bytes(path, FILE_MAX)?)?)
}

/// Localizes a lidar on a map.
pub(super) struct ScanMatcher {
    front: Front,
    map: MapFile,
    seed: u64,
    matcher: Option<Matcher>,
}

impl Kind for ScanMatcher {
    const NODE: Node = Node::new("scan_matcher", "where the ego is by matching a lidar's turns with a map")
        .heavy(Heavy::Yes);
    type Table = NoKeys;

    fn new(_: NoKeys, site: &Site<'_>) -> anyhow::Result<Self> {
        let (front, lidar) = Front::new(site)?;
        let (config, surroundings) = (site.config(), site.surroundings());
        let map = match &config.localization.map {
            Some(path) => read(path).with_context(|| format!("localization.map: {}", path.display()))?,
            None => survey::survey(config, &surroundings.scenario, lidar)?,
        };
        let seed = Rng::keyed(config.seed, site.name(), &[]).bits();
        Ok(Self { front, map, seed, matcher: None })
    }

    fn runtime(_: &NoKeys, _: &Settings<'_>) -> Result<RuntimeModel, String> {
        Runtime { percentiles_ms: Some(MATCHER_MS.to_vec()), ..Runtime::default() }.model()
    }
}

impl ScanMatcher {
    /// Pose of the lidar at the end of a sweep by the localizer; without that, by a fix and the lane.
    fn prior(&self, input: &MatcherIn, end: Time) -> Option<Guess> {
        let by_fix = || {
            let map_from_lidar = self.front.guess(input.fixes.get(), end)?;
            Some((map_from_lidar, self.front.receiver.sigma_m(), LANE_SIGMA_RAD))
        };
        let (mut map_from_lidar, sigma_m, sigma_rad) = self.fused(input, end).or_else(by_fix)?;
        // The map has the better height of the ground.
        let at = &mut map_from_lidar.translation.vector;
        if let Some(ground_m) = self.map.ground_m([at.x, at.y]) {
            at.z = ground_m + self.front.ego_from_lidar.translation.vector.z;
        }
        Some(Guess { map_from_lidar, sigma_m, sigma_rad, particles: PARTICLES })
    }

    /// Localizer's pose, extrapolated to the end of a sweep, and its standard deviations.
    fn fused(&self, input: &MatcherIn, end: Time) -> Option<(Isometry3<f64>, f64, f64)> {
        let (state, quality) = (input.state.get()?, input.quality.get()?);
        let is_fresh = (end - state.stamp).as_secs() <= PRIOR_AGE_S && quality.mode != PoseMode::Lost;
        let car = self.front.motion.car.between(state.stamp, end).filter(|_| is_fresh)?;
        let map_from_ego = pose_of([state.pose.x_m, state.pose.y_m, 0.0], state.pose.heading_rad);
        let clamped = |sigma: f64, [least, most]: [f64; 2]| sigma.clamp(least, most);
        let [.., heading_variance] = quality.covariance;
        let sigma_rad = clamped(heading_variance.max(0.0).sqrt(), PRIOR_SIGMA_RAD);
        let sigma_m = clamped(quality.sigma_m(), PRIOR_SIGMA_M);
        Some((map_from_ego * car * self.front.ego_from_lidar, sigma_m, sigma_rad))
    }
}

impl Operator for ScanMatcher {
    type In = MatcherIn;
    type Out = Port<PoseMatch>;

    fn step(&mut self, _: &mut Context<'_>, input: &MatcherIn, out: &mut Self::Out) {
        let MatcherIn { points: cloud, imu, wheels, .. } = input;
        self.front.receiver.follow(input.route.get().map(Message::shared));
        let Some((cloud, turn)) = self.front.turn(cloud, imu.get(), wheels.get()) else { return };
        let end = cloud.stamp;
        let is_followed = !turn.is_first && self.matcher.as_ref().is_some_and(Matcher::is_found);
        let mut since_last = turn.over_turn;
        if !is_followed && let Some(prior) = self.prior(input, end) {
            since_last = Isometry3::identity();
            let new = || Matcher::new(&self.map, self.seed, prior);
            self.matcher.get_or_insert_with(new).suppose_at(prior);
        }
        let Some(matcher) = &mut self.matcher else { return };
        let found = matcher.take(&points(cloud, turn.period_s), &turn.sweep, &since_last);
        if let Some(found) = found {
            out.send(self.front.told(end, &found.map_from_scan, &Spread::of(&found)));
        }
    }
}

/// Tracks a lidar's pose by its own sweeps from the initial pose.
pub(super) struct LidarOdometry {
    front: Front,
    odometry: Odometry,
    /// Initial pose, and distance travelled since, metres.
    start: Option<Isometry3<f64>>,
    way_m: f64,
}

impl Kind for LidarOdometry {
    const NODE: Node =
        Node::new("lidar_odometry", "where the ego is by matching a lidar's turns with those before them")
            .heavy(Heavy::Yes);
    type Table = NoKeys;

    fn new(_: NoKeys, site: &Site<'_>) -> anyhow::Result<Self> {
        let (front, _) = Front::new(site)?;
        Ok(Self { front, odometry: Odometry::new(), start: None, way_m: 0.0 })
    }

    fn runtime(_: &NoKeys, _: &Settings<'_>) -> Result<RuntimeModel, String> {
        Runtime { percentiles_ms: Some(ODOMETRY_MS.to_vec()), ..Runtime::default() }.model()
    }
}

impl Operator for LidarOdometry {
    type In = In;
    type Out = Port<PoseMatch>;

    fn step(&mut self, _: &mut Context<'_>, input: &In, out: &mut Self::Out) {
        let In { points: cloud, imu, wheels, .. } = input;
        self.front.receiver.follow(input.route.get().map(Message::shared));
        let Some((cloud, turn)) = self.front.turn(cloud, imu.get(), wheels.get()) else { return };
        let end = cloud.stamp;
        let guess = || self.front.guess(input.fixes.get(), end);
        let Some(start) = self.start.or_else(guess) else { return };
        self.start = Some(start);
        let points = points(cloud, turn.period_s);
        let at = start * self.odometry.take_moved(&points, &turn.sweep, &turn.over_turn).pose();
        self.way_m += turn.over_turn.translation.vector.norm();
        let (sigma_m, turned_rad) = (self.front.receiver.sigma_m(), DRIFT_RAD_PER_M * self.way_m);
        let off_m = math::hypot(BEGIN_M, DRIFT * self.way_m);
        let variance_m2 = sigma_m * sigma_m + off_m * off_m;
        let spread = Spread {
            covariance_m2: [variance_m2, 0.0, variance_m2],
            with_heading: [0.0; 2],
            height_sigma_m: variance_m2.sqrt(),
            heading_sigma_rad: math::hypot(LANE_SIGMA_RAD, turned_rad),
        };
        out.send(self.front.told(end, &at, &spread));
    }
}
