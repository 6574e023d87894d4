//! What a pass allocates, counted. One test in a program of its own: nothing else runs beside it.

#![expect(unsafe_code, reason = "a counting allocator has to implement an unsafe trait")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

use swerve_camera::{
    Camera, CameraSpec, Distortion, Frame, Outputs, RenderOptions, Renderer, Shutter, View, mount,
};
use swerve_geom::{Ego, Map, Point, Transform};
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
fn passes_into_used_memory_allocate_nothing() {
    let scene = town(WeatherPreset::WetNoon, 1, 60.0);
    let map_from_ego: Transform<Map, Ego> = Transform::from_roll_pitch_yaw(Point::default(), 0.0, 0.0, 0.0);
    let pose = map_from_ego * mount([0.0, -1.9, 1.45], 0.0, 0.03, 0.0);
    let size = CameraSpec { width_px: 320, height_px: 240, ..CameraSpec::default() };
    let cameras = [
        size,
        CameraSpec { distortion: Distortion { k1: -0.05, ..Distortion::default() }, ..size },
        CameraSpec { shutter: Shutter { blur_samples: 2, ..Shutter::default() }, ..size },
    ]
    .map(|spec| Camera::new(spec).expect("the camera is fine"));
    let mut renderer = Renderer::new(RenderOptions::default()).expect("no threads are needed");
    let mut frame = Frame::new(&cameras[0], Outputs::ALL);
    for round in 0..3 {
        for camera in &cameras {
            let before = ALLOCATIONS.load(Ordering::Relaxed);
            renderer
                .render(&scene, &View::new(camera, pose), frame.as_mut())
                .expect("scene and view are fine");
            let count = ALLOCATIONS.load(Ordering::Relaxed) - before;
            assert!(round < 2 || count == 0, "{count} allocations");
        }
    }
}
