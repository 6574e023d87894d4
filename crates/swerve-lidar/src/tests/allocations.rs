//! Allocation counts of a lidar turn.

use crate::{Cloud, Firing, LidarPreset, LidarSpec, SceneTree, Sweeper};
use swerve_geom::{Lidar, Map, Point, Transform};
use swerve_scene::WeatherPreset;
use swerve_scene::town::town;

#[test]
fn turns_into_used_memory_allocate_nothing() {
    let mut scene = town(WeatherPreset::ClearNoon, 1, 40.0);
    let mut tree = SceneTree::new(&scene).expect("the town is fine");
    let spec = LidarSpec { columns: 400, ..LidarPreset::Vlp32.spec() };
    let mut cloud = Cloud::new(&spec, true);
    let mut sweeper = Sweeper::new(spec, 1).expect("no threads are needed");
    let pose: Transform<Map, Lidar> =
        Transform::from_roll_pitch_yaw(Point::new(0.0, -1.9, 1.9), 0.0, 0.0, 0.0);
    let rest = Firing::turn_at_rest(&sweeper, pose);
    for turn in 0..3_u64 {
        let turned = allocation_counter::measure(|| {
            sweeper.begin_turn(turn, &mut cloud.as_mut());
            for step in 0..20_i64 {
                for instance in &mut scene.dynamics {
                    let at = instance.map_from_body.origin().coords;
                    let moved = Point::new(at.x + 0.05, at.y, at.z);
                    instance.map_from_body = Transform::new(moved, instance.map_from_body.rotation());
                }
                tree.update(&scene).expect("the town is fine");
                let (begin_ns, end_ns) = (step * 5_000_000, (step + 1) * 5_000_000);
                sweeper
                    .fire(&tree, &Firing { begin_ns, end_ns, ..rest }, &mut cloud.as_mut())
                    .expect("pose and room are fine");
            }
        });
        assert!(turn < 1 || turned.count_total == 0, "{turned:?} in turn {turn}");
        assert!(cloud.len > 5000, "{}", cloud.len);
    }
}
