//! Operators of Swerve: one file each, and one line each in the registry.

mod behaviour;
mod camera;
mod camera_objects;
mod changes;
mod closures;
mod commands;
mod controller;
mod dead_reckoning;
pub(crate) mod deadlines;
mod detector;
mod events;
mod fusion;
mod gate;
mod gnss;
mod imu;
mod inputs;
mod lanes;
mod lidar;
mod lidar_objects;
mod light_sensor;
mod localizer;
mod monitor;
mod objects_now;
mod obstacles;
mod odom;
mod odometry;
mod pedals;
mod planner;
mod pose;
mod pose_trust;
mod predictor;
mod python;
mod python_world;
mod radar;
mod receiver;
mod relative;
mod report;
mod reported_odometry;
mod router;
mod scan_matcher;
mod segmentation;
mod switch;
mod tracker;
mod traffic_lights;
mod world;

use swerve_msg::{
    Command, Detections, EgoState, Gnss, Image, Imu, MotionCommand, ObstacleList, Plan, PointCloud,
    PredictionList, RadarScan, Supervision, TrackList, VehicleReport, WheelOdometry, WireAlarm,
};

use crate::registry::Registry;

pub(crate) use dead_reckoning::Carried;
pub(crate) use localizer::Filter;
pub use obstacles::ObstacleSight;
pub(crate) use pose::PoseSensor;
pub(crate) use world::add_shared;

/// Registers all operators.
pub(crate) fn all(registry: Registry) -> Registry {
    with_faults(registry)
        .with::<world::World>()
        .with_kind(obstacles::ObstacleSensor)
        .with::<pose::PoseSensor>()
        .with::<imu::ImuSensor>()
        .with::<gnss::Receiver>()
        .with::<odometry::Odometry>()
        .with::<events::CollisionSensor>()
        .with::<events::LaneInvasions>()
        .with::<events::RedLights>()
        .with::<light_sensor::LightSensor>()
        .with_kind(radar::Radars)
        .with_kind(camera::Cameras)
        .with_kind(lidar::Lidars)
        .with_kind(monitor::Monitors)
        .with_kind(detector::EmulatedDetector)
        .with_kind(camera_objects::CameraObjects)
        .with_lidar_detector::<swerve_perception::LidarObjects>()
        .with_kind(fusion::Fusions)
        .with::<lanes::LaneLines>()
        .with::<localizer::Filter>()
        .with::<dead_reckoning::Carried>()
        .with::<scan_matcher::ScanMatcher>()
        .with::<scan_matcher::LidarOdometry>()
        .with::<segmentation::Segmentation>()
        .with::<traffic_lights::Lights>()
        .with_kind(tracker::Trackers)
        .with_kind(predictor::Predictors)
        .with::<closures::ClosureReport>()
        .with::<router::Router>()
        .with_behaviour::<swerve_behaviour::FollowRoute>()
        .with_behaviour::<swerve_behaviour::PylotStates>()
        .with_behaviour::<swerve_behaviour::RuleBased>()
        .with_kind(deadlines::DeadlinePolicy)
        .with_kind(planner::Planners)
        .with_kind(controller::Controllers)
        .with_kind(report::Reports)
        .with::<reported_odometry::ReportedOdometry>()
        .with_kind(switch::EnableSwitch)
        .with::<gate::Gate>()
        .with::<pedals::PedalsOperator>()
        .with::<objects_now::ObjectsNow>()
        .with_kind(python::Python)
        .with_kind(python_world::PythonWorld)
        .with_kind(python_world::PythonSensor)
        .with::<commands::FreshCommands>()
        .with_kind(inputs::source::<Supervision>(
            "process_events",
            "what becomes of the run's processes",
            |s| s.on_wall_clock() && !s.setup.process.is_empty(),
        ))
        .with_kind(inputs::source::<WireAlarm>(
            "wire_alarm_input",
            "faults of the connection between a vehicle and its driver",
            |s| s.on_wall_clock() && (s.setup.live.is_some() || s.setup.is_driven_over_ros2()),
        ))
        .with_kind(inputs::source::<MotionCommand>("command_input", "what another stack asks for", |_| true))
        .with_kind(inputs::source::<EgoState>("pose_input", "poses that a vehicle reports", |_| true))
        .with_kind(inputs::source::<ObstacleList>("object_input", "objects that others see", |_| true))
        .with_kind(inputs::source::<Imu>("imu_input", "accelerations and turn rates of a vehicle", |_| true))
        .with_kind(inputs::source::<Gnss>("gnss_input", "satellite fixes of a vehicle", |_| true))
        .with_kind(inputs::source::<VehicleReport>("report_input", "the vehicle's report on itself", |_| {
            true
        }))
        .with_kind(inputs::source::<swerve_msg::Switch>(
            "switch_input",
            "the switch that a person holds",
            |_| true,
        ))
}

/// Messages that faults can affect.
fn with_faults(registry: Registry) -> Registry {
    registry
        .with_corruptible::<ObstacleList>()
        .with_corruptible::<Detections>()
        .with_corruptible::<TrackList>()
        .with_corruptible::<PredictionList>()
        .with_corruptible::<Plan>()
        .with_corruptible::<EgoState>()
        .with_corruptible::<Imu>()
        .with_corruptible::<Gnss>()
        .with_corruptible::<WheelOdometry>()
        .with_corruptible::<RadarScan>()
        .with_corruptible::<MotionCommand>()
        .with_corruptible::<VehicleReport>()
        .with_corruptible::<Command>()
        .with_corruptible::<Image>()
        .with_corruptible::<PointCloud>()
}
