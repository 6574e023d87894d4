//! What a turn of a lidar allocates, counted. One test in a program of its own: nothing else runs beside it.

#![expect(unsafe_code, reason = "a counting allocator has to implement an unsafe trait")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

use swerve_geom::{Lidar, Map, Point, Transform};
use swerve_lidar::{Cloud, Firing, LidarPreset, LidarSpec, SceneTree, Sweeper};
use swerve_scene::WeatherPreset;
use swerve_scene::town::town;

struct Counting;

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call is passed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        // SAFETY: `place` came from `alloc` with this layout.
        unsafe { System.dealloc(place, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

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
        let before = ALLOCATIONS.load(Ordering::Relaxed);
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
        let count = ALLOCATIONS.load(Ordering::Relaxed) - before;
        assert!(turn < 1 || count == 0, "{count} allocations in turn {turn}");
        assert!(cloud.len > 5000, "{}", cloud.len);
    }
}
