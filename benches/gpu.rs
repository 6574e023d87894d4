//! Cameras on a GPU: frames per second with all four images in the caller's memory.
//!
//! The town of the benchmark `render`; in every frame the car and all moving objects are at new positions, so that
//! uploads count. With `--software`, the same on a software adapter, without goals and in one round, to try the
//! benchmark out.

use swerve_benches::{Goal, Rows, Sample, is_asked_to_measure, now};
use swerve_camera::{
    Backend, Camera, CameraSpec, Frame, FrameMut, Outputs, RenderOptions, Renderer, View, mount,
};
use swerve_geom::{Ego, Map, Point, Transform};
use swerve_gpu::{AdapterKind, probe};
use swerve_scene::town::town;
use swerve_scene::{Instance, Scene, WeatherPreset};

/// Duration of one measurement, seconds.
const LENGTH_S: f64 = 0.8;
/// Measurements of each row; rows alternate.
const ROUNDS: usize = 5;
/// Reach of the town, metres.
const REACH_M: f64 = 42.0;
/// Number of submissions in flight.
const ON_THE_WAY: usize = 2;

/// Order of submission and collection.
#[derive(Clone, Copy)]
enum How {
    /// Each frame is awaited before the next.
    OneByOne,
    /// The next frame is submitted before the last one is collected.
    DoubleBuffered,
}

struct Row {
    what: String,
    size: (u32, u32),
    cameras: usize,
    how: How,
    goal: Goal,
    rounds: Vec<f64>,
}

/// The town and its motion.
struct Town {
    scene: Scene,
    start: Vec<Instance>,
    frame: u64,
}

impl Town {
    fn step(&mut self) {
        self.frame += 1;
        let seconds = 0.001 * (self.frame % 1000) as f64;
        for (now, start) in self.scene.dynamics.iter_mut().zip(&self.start) {
            let [x, y, z] = start.motion.linear_mps.map(|v| v * seconds);
            let step: Transform<Map, Map> =
                Transform::from_roll_pitch_yaw(Point::new(x, y, z), 0.0, 0.0, 0.0);
            now.map_from_body = step * start.map_from_body;
        }
    }

    /// Views of cameras all around the car.
    fn views<'a>(&self, camera: &'a Camera, cameras: usize) -> Vec<View<'a>> {
        let x = 0.005 * (self.frame % 1000) as f64;
        let map_from_ego: Transform<Map, Ego> =
            Transform::from_roll_pitch_yaw(Point::new(x, 0.0, 0.0), 0.0, 0.0, 0.0);
        let view = |k: usize| {
            let yaw = core::f64::consts::TAU * k as f64 / cameras as f64;
            let pose = map_from_ego * mount([0.0, -1.9, 1.45], 0.0, 0.03, yaw);
            View { frame: self.frame, ..View::new(camera, pose) }
        };
        (0..cameras).map(view).collect()
    }
}

/// Frames per second of a row.
fn measure(row: &Row, town: &mut Town, renderer: &mut Renderer) -> f64 {
    let spec = CameraSpec { width_px: row.size.0, height_px: row.size.1, ..CameraSpec::default() };
    let camera = Camera::new(spec).expect("the camera is fine");
    let mut frames: Vec<Frame> = (0..row.cameras).map(|_| Frame::new(&camera, Outputs::ALL)).collect();
    fn out(frames: &mut [Frame]) -> Vec<FrameMut<'_>> {
        frames.iter_mut().map(Frame::as_mut).collect()
    }
    let mut on_the_way = std::collections::VecDeque::new();
    let mut draw = |town: &mut Town, renderer: &mut Renderer| {
        town.step();
        let views = town.views(&camera, row.cameras);
        let fine = "scene and views are fine";
        match row.how {
            How::OneByOne => renderer.render_batch(&town.scene, &views, &mut out(&mut frames)).expect(fine),
            How::DoubleBuffered => {
                let views: Vec<_> = views.into_iter().map(|view| (view, Outputs::ALL)).collect();
                on_the_way.push_back(renderer.submit(&town.scene, &views).expect(fine));
                if on_the_way.len() > ON_THE_WAY {
                    let oldest = on_the_way.pop_front().expect("there are some");
                    renderer.collect(oldest, &mut out(&mut frames)).expect(fine);
                }
            }
        }
    };
    for _ in 0..=2 * ON_THE_WAY {
        draw(town, renderer);
    }
    let start = now();
    let mut count = 0;
    while start.elapsed().as_secs_f64() < LENGTH_S {
        draw(town, renderer);
        count += row.cameras;
    }
    let rate = count as f64 / start.elapsed().as_secs_f64();
    for rest in on_the_way {
        renderer.collect(rest, &mut out(&mut frames)).expect("the device works");
    }
    rate
}

fn main() {
    if !is_asked_to_measure() {
        return;
    }
    let software = std::env::args().any(|argument| argument == "--software");
    let (kind, backend) =
        if software { (AdapterKind::Software, Backend::Software) } else { (AdapterKind::Gpu, Backend::Gpu) };
    let mut table = Rows::new(env!("CARGO_TARGET_TMPDIR"), "gpu");
    let what = "cameras on a graphics processor";
    match probe().choose(kind) {
        Ok(report) => table.row("adapter", 0.0, &report.to_string(), Goal::None),
        Err(none) => {
            table.skipped(what, &none.to_string());
            return table.finish();
        }
    }
    let threads = std::thread::available_parallelism().map_or(1, usize::from).min(8);
    let mut renderer = match Renderer::new(RenderOptions { backend, threads }) {
        Ok(renderer) => renderer,
        Err(error) => {
            table.skipped(what, &error.to_string());
            return table.finish();
        }
    };
    let scene = town(WeatherPreset::ClearNoon, 1, REACH_M);
    let start = scene.dynamics.clone();
    let mut town = Town { scene, start, frame: 0 };
    let least = |rate: f64| if software { Goal::None } else { Goal::Least(rate) };
    let row = |size: (u32, u32), cameras: usize, how: How, goal: Goal| {
        let (width, height) = size;
        let number = if cameras == 1 { "one camera".to_owned() } else { format!("{cameras} in one submit") };
        let manner = match how {
            How::OneByOne => "one by one",
            How::DoubleBuffered => "double-buffered",
        };
        let what = format!("{width}x{height}, {number}, {manner}");
        Row { what, size, cameras, how, goal, rounds: Vec::new() }
    };
    let (small, usual, large) = ((640, 360), (800, 600), (1920, 1080));
    let mut rows = [
        row(usual, 1, How::OneByOne, Goal::None),
        row(usual, 1, How::DoubleBuffered, least(1500.0)),
        row(large, 1, How::OneByOne, Goal::None),
        row(large, 1, How::DoubleBuffered, least(500.0)),
        row(small, 1, How::OneByOne, Goal::None),
        row(small, 1, How::DoubleBuffered, Goal::None),
        row(small, 16, How::OneByOne, Goal::None),
        row(small, 16, How::DoubleBuffered, Goal::None),
    ];
    for _ in 0..if software { 1 } else { ROUNDS } {
        for row in &mut rows {
            let rate = measure(row, &mut town, &mut renderer);
            row.rounds.push(rate);
        }
    }
    let median = |row: &Row| Sample::new(row.rounds.clone()).at(0.5);
    for row in &rows {
        let reads = Sample::new(row.rounds.clone()).text(0, "frames/s");
        table.row(&row.what, median(row), &reads, row.goal);
    }
    for (one, manner) in [(4, "one by one"), (5, "double-buffered")] {
        let ratio = median(&rows[7]) / median(&rows[one]);
        let goal = if one == 4 { least(3.0) } else { Goal::None };
        table.row(
            &format!("640x360, 16 in one submit over one camera, {manner}"),
            ratio,
            &format!("{ratio:.2}"),
            goal,
        );
    }
    if let Some(why) = renderer.fell_back() {
        table.skipped("the adapter failed, these are figures of the CPU", why);
    }
    table.finish();
}
