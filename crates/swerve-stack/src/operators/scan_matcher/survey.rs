//! A map of a scenario's road, as surveyed before the drive without actors.

use anyhow::Context as _;
use swerve_core::Time;
use swerve_geom::{Ego, Map, Point, Transform, Vector};
use swerve_lidar::{Cloud, Firing, LidarSpec, SceneTree, Sweeper};
use swerve_localization::map_file::MapFile;
use swerve_localization::ndt::Vector3;
use swerve_localization::voxels::VoxelSums;
use swerve_msg::truth::{EgoTruth, WorldState};
use swerve_msg::{ActorId, EgoState};
use swerve_scenario::Scenario;

use crate::config::Config;
use crate::config::sensors::LidarConfig;
use crate::street::{EGO_INSTANCE, Street};

/// Edge of a voxel, metres.
const VOXEL_M: f64 = 1.0;
/// Distance between the lidar's positions along the road, metres,
const STEP_M: f64 = 2.0;
/// with this many columns a sweep: neighbouring positions see the same wall,
const COLUMNS: u32 = 512;
/// from this far before the start to this far beyond the goal, metres.
const BEYOND_M: f64 = 30.0;

/// Map of the static surroundings along a scenario's road, from noise-free lidar sweeps at true poses.
pub(super) fn survey(config: &Config, scenario: &Scenario, lidar: &LidarConfig) -> anyhow::Result<MapFile> {
    let shape = &config.sim.vehicle.shape;
    let mut street = Street::new(scenario, shape, config.render.weather, config.seed);
    let told = |faults| anyhow::anyhow!("lidar: {faults:?}");
    let spec = lidar.spec(0).map_err(told)?.without_noise();
    let mut sweeper = Sweeper::new(LidarSpec { columns: spec.columns.min(COLUMNS), ..spec }, 1)?;
    let mut cloud = Cloud::new(sweeper.spec(), true);
    let (ego_from_lidar, line) = (lidar.ego_from_lidar(shape), scenario.road.line());
    let mut sums = VoxelSums::new(VOXEL_M);
    let from_m = scenario.ego.s_m - BEYOND_M;
    let to_m = (scenario.ego.end_m + BEYOND_M).max(from_m);
    let mut tree = SceneTree::default();
    for k in 0..=((to_m - from_m) / STEP_M) as u32 {
        let pose = line.at(from_m + STEP_M * f64::from(k)).pose;
        let at = Point::new(pose.x_m, pose.y_m, 0.0);
        let map_from_ego = Transform::from_roll_pitch_yaw(at, 0.0, 0.0, pose.heading_rad);
        if k == 0 {
            street.show(&alone(map_from_ego));
            tree.update(street.scene()).context("a map of the road")?;
        }
        let map_from_lidar = map_from_ego * ego_from_lidar;
        let turn =
            Firing { hidden_instance: Some(EGO_INSTANCE), ..Firing::turn_at_rest(&sweeper, map_from_lidar) };
        cloud.len = 0;
        sweeper.begin_turn(u64::from(k), &mut cloud.as_mut());
        sweeper.fire(&tree, &turn, &mut cloud.as_mut())?;
        let isometry = map_from_lidar.isometry();
        for point in 0..cloud.len {
            let there = Vector3::from(cloud.point_m(point).map(f64::from));
            sums.add(&(isometry.rotation * there + isometry.translation.vector));
        }
    }
    Ok(MapFile::new(VOXEL_M, sums.voxels()))
}

/// A world with no actors.
fn alone(map_from_ego: Transform<Map, Ego>) -> WorldState {
    let ego = EgoTruth {
        id: ActorId::EGO,
        map_from_ego,
        state: EgoState::default(),
        velocity_mps: Vector::default(),
        specific_force_mps2: Vector::default(),
        angular_velocity_radps: Vector::default(),
    };
    WorldState {
        stamp: Time::ZERO,
        ego,
        actors: Vec::new(),
        collisions: Vec::new(),
        infractions: Vec::new(),
        ended: None,
    }
}
