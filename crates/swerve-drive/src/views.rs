//! Static data of a run for Foxglove and OSI.

use std::sync::Arc;

use swerve_core::Span;
use swerve_foxglove::{self as foxglove, ImageForm, Mount, Sensor};
use swerve_geom::{Ego, Point, Transform};
use swerve_osi as osi;
use swerve_scenario::{Scenario, TrafficLight};
use swerve_stack::Setup;
use swerve_stack::config::{Config, Images};
use swerve_stack::pipeline::Pipeline;

use crate::measured::track_names;

/// Road, car and sensors of a run.
pub fn views_of(config: &Setup, pipeline: &Pipeline) -> foxglove::Setup {
    let assembly = &pipeline.assembly;
    let camera = |stream: &str| stream.split('.').next().unwrap_or_default().to_owned();
    let detectors = assembly.operators().iter().filter_map(|placed| {
        assembly.image_of(&placed.name).map(|stream| (placed.name.clone(), camera(stream)))
    });
    let (detectors, mounts) = (detectors.collect(), mounts(config, |name| config.runs(name)));
    let actors = Arc::new(pipeline.scenario.names());
    let tracks = Arc::new(track_names(assembly, &pipeline.scenario));
    foxglove::Setup { mounts, detectors, actors, tracks, ..setup(config, &pipeline.scenario) }
}

/// Car, lanes and traffic lights of a run.
pub(crate) fn osi_of(config: &Config, pipeline: &Pipeline) -> osi::Setup {
    let road = &pipeline.scenario.road;
    let light = |light: &TrafficLight| {
        let signal = road.network().zip(light.signal).and_then(|(map, id)| map.signal(id));
        osi::Light {
            pose: light.pose,
            height_m: signal.and_then(|signal| signal.height_m),
            lanes: signal.map(|signal| signal.lanes.clone()).unwrap_or_default(),
            program: light.program.clone(),
        }
    };
    osi::Setup {
        vehicle: config.sim.vehicle.clone(),
        map: road.map(),
        lights: road.lights.iter().map(light).collect(),
    }
}

/// Road, car and sensors of a drive with a vehicle; all mounted sensors run.
pub fn live_views(config: &Config, scenario: &Scenario) -> foxglove::Setup {
    foxglove::Setup { ego_from_pose: true, mounts: mounts(config, |_| true), ..setup(config, scenario) }
}

fn setup(config: &Config, scenario: &Scenario) -> foxglove::Setup {
    let (log, vehicle) = (&config.log, &config.sim.vehicle);
    foxglove::Setup {
        route: scenario.road.route(),
        lines_m: scenario.road.lines().inner(),
        map: scenario.road.network().cloned(),
        shape: vehicle.shape,
        dead_time: Span::from_secs(vehicle.dead_time_s),
        mounts: Vec::new(),
        detectors: Vec::new(),
        images: match log.images {
            Images::None => None,
            Images::Jpeg => Some(ImageForm::Jpeg(log.jpeg_quality)),
            Images::Lossless => Some(ImageForm::Png),
        },
        raw_images: log.images == Images::Lossless,
        actors: Arc::default(),
        tracks: Arc::default(),
        ego_from_pose: false,
    }
}

/// Mounting poses of the running sensors.
fn mounts(config: &Config, runs: impl Fn(&str) -> bool) -> Vec<Mount> {
    let shape = &config.sim.vehicle.shape;
    let runs = |name: &&String| runs(name);
    let cameras = config.camera.keys().filter(runs).map(|name| {
        let camera = &config.camera[name];
        Mount::new(name, camera.ego_from_camera())
    });
    let lidars = config.lidar.keys().filter(runs).map(|name| {
        let lidar = &config.lidar[name];
        Mount::new(name, lidar.ego_from_lidar(shape))
    });
    let radars = config.radar.keys().filter(runs).map(|name| {
        let at = config.radar[name].mount(shape);
        let origin = Point::new(at.x_m, at.y_m, at.z_m);
        let turned: Transform<Ego, Sensor> = Transform::from_roll_pitch_yaw(origin, 0.0, 0.0, at.yaw_rad);
        Mount::new(name, turned)
    });
    cameras.chain(lidars).chain(radars).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read_scenario;

    #[test]
    fn lanes_of_a_map_are_shown_and_a_road_has_its_lines_alone() {
        let config = Setup::load(None, &[]).unwrap();
        let lanes = |name: &str| {
            let file = format!("{}/../../scenarios/{name}.toml", env!("CARGO_MANIFEST_DIR"));
            let scenario = read_scenario(file.as_ref()).unwrap();
            live_views(&config, &scenario).map.map(|map| map.lanes().len())
        };
        assert!(lanes("maps/right_before_left").is_some_and(|n| n > 12));
        assert_eq!(lanes("lane"), None);
    }
}
