//! Markers for RViz or Foxglove.

use swerve_core::Time;
use swerve_geom::Pose2;
use swerve_map::{BorderLine, BorderLook, Map};
use swerve_msg::{ActorKind, ObstacleList, Plan};

use super::{Epoch, pose_to_ros};
use crate::msg::builtin_interfaces::Duration;
use crate::msg::geometry_msgs::{Point, Vector3};
use crate::msg::std_msgs::ColorRGBA;
use crate::msg::visualization_msgs::{Marker, MarkerArray};

/// Lifetime of a marker, ns.
const LIFETIME_NS: i64 = 500_000_000;

/// A box for each obstacle, red for persons; markers of a list replace those of the previous one.
pub fn obstacles_to_markers(obstacles: &ObstacleList, epoch: Epoch, map: &str) -> MarkerArray {
    let marker = |obstacle: &swerve_msg::Obstacle| {
        let extent = obstacle.extent;
        let mut pose = pose_to_ros(obstacle.pose);
        pose.position.z = 0.5 * extent.height_m;
        let person = obstacle.kind.is_person();
        Marker {
            header: epoch.header(obstacles.stamp, map),
            ns: "obstacles".to_owned(),
            id: obstacle.id.0 as i32,
            type_: if obstacle.kind == ActorKind::Pedestrian { Marker::CYLINDER } else { Marker::CUBE },
            action: Marker::ADD,
            pose,
            scale: Vector3 { x: extent.length_m, y: extent.width_m, z: extent.height_m },
            color: if person { color(0.9, 0.2, 0.2) } else { color(0.2, 0.4, 0.9) },
            lifetime: Duration::from_ns(LIFETIME_NS),
            ..Marker::default()
        }
    };
    MarkerArray { markers: obstacles.obstacles.iter().map(marker).collect() }
}

/// A line along the plan.
pub fn plan_to_marker(plan: &Plan, epoch: Epoch, map: &str) -> Marker {
    let point = |p: &swerve_msg::PlanPoint| Point { x: p.pose.x_m, y: p.pose.y_m, z: 0.1 };
    Marker {
        header: epoch.header(plan.stamp, map),
        ns: "plan".to_owned(),
        type_: Marker::LINE_STRIP,
        action: Marker::ADD,
        scale: Vector3 { x: 0.2, y: 0.0, z: 0.0 },
        color: if plan.status.is_fallback() { color(0.9, 0.6, 0.1) } else { color(0.1, 0.8, 0.3) },
        lifetime: Duration::from_ns(LIFETIME_NS),
        points: plan.points.iter().map(point).collect(),
        ..Marker::default()
    }
}

/// Borders of all lanes of a map, which stay: painted lines white, the others grey, thin inside junctions.
pub fn map_to_markers(map: &Map, at: Time, epoch: Epoch, frame: &str) -> MarkerArray {
    let borders = map.border_lines();
    let marker = |id, looks: &[BorderLook], width_m, grey| {
        let shown = borders.iter().filter(|line| looks.contains(&line.look));
        let ends = shown.flat_map(BorderLine::pieces).flatten();
        let points: Vec<Point> = ends.map(|end| Point { x: end.x_m, y: end.y_m, z: 0.02 }).collect();
        (!points.is_empty()).then(|| Marker {
            header: epoch.header(at, frame),
            ns: "lanes".to_owned(),
            id,
            type_: Marker::LINE_LIST,
            action: Marker::ADD,
            pose: pose_to_ros(Pose2::default()),
            scale: Vector3 { x: width_m, y: 0.0, z: 0.0 },
            color: color(grey, grey, grey),
            points,
            ..Marker::default()
        })
    };
    let painted = marker(0, &[BorderLook::Solid, BorderLook::Broken], 0.12, 0.9);
    let plain = marker(1, &[BorderLook::Plain], 0.12, 0.5);
    let inside = marker(2, &[BorderLook::InJunction], 0.04, 0.5);
    MarkerArray { markers: [painted, plain, inside].into_iter().flatten().collect() }
}

fn color(r: f32, g: f32, b: f32) -> ColorRGBA {
    ColorRGBA { r, g, b, a: 0.8 }
}
