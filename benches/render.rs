//! Cameras on the CPU: one frame of a town, by output and by weather.
//!
//! Also on a software adapter (lavapipe), if installed, in the same run and with its default number of threads: one per
//! processor, or `LP_NUM_THREADS`.
//!
//! The town has about 64,000 triangles, a quarter of them moving; colour includes textures, shadows and reflections.

use swerve_benches::{Goal, Rows, Sample, busy_ms, is_asked_to_measure, now};
use swerve_camera::{
    Backend, Camera, CameraSpec, Distortion, Frame, Outputs, RenderOptions, Renderer, SensorNoise, View,
    mount,
};
use swerve_geom::{Ego, Map, Point, Transform};
use swerve_scene::town::town;
use swerve_scene::{Scene, WeatherPreset};

/// Frames of one measurement.
const FRAMES: usize = 5;
/// Measurements of each row; rows alternate, so that host noise affects all of them.
const ROUNDS: usize = 25;
/// Reach of the town, metres: houses and traffic within this distance.
const REACH_M: f64 = 42.0;

/// One row: output, back end, number of threads.
struct Row {
    what: &'static str,
    camera: Camera,
    outputs: Outputs,
    scene: usize,
    threads: usize,
    goal: Goal,
    rounds: Vec<f64>,
    /// Processor time of a frame, all threads together, milliseconds.
    busy: Vec<f64>,
}

fn camera(change: impl Fn(&mut CameraSpec)) -> Camera {
    let mut spec = CameraSpec::default();
    change(&mut spec);
    Camera::new(spec).expect("the camera is fine")
}

/// Median time of a frame and processor time of a frame, milliseconds.
fn measure(row: &Row, scene: &Scene, renderer: &mut Renderer) -> (f64, Option<f64>) {
    let map_from_ego: Transform<Map, Ego> = Transform::from_roll_pitch_yaw(Point::default(), 0.0, 0.0, 0.0);
    let pose = map_from_ego * mount([0.0, -1.9, 1.45], 0.0, 0.03, 0.0);
    let mut frame = Frame::new(&row.camera, row.outputs);
    let mut draw = |number: u64| {
        let view = View { frame: number, ..View::new(&row.camera, pose) };
        renderer.render(scene, &view, frame.as_mut()).expect("scene and view are fine");
    };
    draw(0);
    let before = busy_ms();
    let times = (0..FRAMES).map(|k| {
        let start = now();
        draw(k as u64);
        start.elapsed().as_secs_f64() * 1e3
    });
    let median = Sample::new(times.collect()).median();
    let busy = busy_ms().zip(before).map(|(after, before)| (after - before) / FRAMES as f64);
    (median, busy)
}

/// Rows of the software adapter, and the speed of the CPU back end relative to it with the same images.
fn compare(table: &mut Rows, software: &Renderer, rows: &[Row], references: &[Row]) {
    if let Some(adapter) = software.adapter() {
        table.row("software adapter", 0.0, &adapter.to_string(), Goal::None);
    }
    if let Some(why) = software.fell_back() {
        return table.skipped("software adapter", why);
    }
    for (row, reference) in rows.iter().zip(references) {
        let sample = Sample::new(reference.rounds.clone());
        let busy = Sample::new(reference.busy.clone());
        let mut reads = sample.text(2, "ms");
        if !reference.busy.is_empty() {
            reads += &format!(", busy {:.2} ms", busy.median());
        }
        table.row(&format!("{}, software adapter", row.what), sample.least(), &reads, Goal::None);
        // Round by round, so that host noise affects both.
        let ratios = row.rounds.iter().zip(&reference.rounds).map(|(cpu, software)| software / cpu);
        let ratio = Sample::new(ratios.collect());
        let what = format!("{}, how much faster", row.what);
        table.row(&what, ratio.median(), &ratio.text(2, "times"), Goal::Least(1.5));
    }
}

fn main() {
    if !is_asked_to_measure() {
        return;
    }
    let presets = [WeatherPreset::ClearNoon, WeatherPreset::HardRainNoon, WeatherPreset::ClearNight];
    let scenes = presets.map(|preset| town(preset, 1, REACH_M));
    let plain = camera(|_| {});
    let row = |what, camera, outputs, (scene, threads), goal| {
        let rounds = Vec::with_capacity(ROUNDS);
        Row { what, camera, outputs, scene, threads, goal, rounds, busy: Vec::with_capacity(ROUNDS) }
    };
    let large = camera(|s| (s.width_px, s.height_px) = (1920, 1080));
    let small = camera(|s| (s.width_px, s.height_px) = (640, 360));
    let real = camera(|s| (s.noise, s.vignetting) = (SensorNoise::TYPICAL, 0.4));
    let lens = camera(|s| s.distortion = Distortion { k1: -0.15, k2: 0.03, ..Distortion::default() });
    let mut rows = [
        row("800x600, all four images, 2 threads", plain, Outputs::ALL, (0, 2), Goal::Most(16.0)),
        row("800x600, depth and ids alone, 2 threads", plain, Outputs::GEOMETRY, (0, 2), Goal::Most(3.0)),
        row("800x600, all four images, 1 thread", plain, Outputs::ALL, (0, 1), Goal::None),
        row("800x600, depth and ids alone, 1 thread", plain, Outputs::GEOMETRY, (0, 1), Goal::None),
        row("800x600, with noise and vignetting, 2 threads", real, Outputs::ALL, (0, 2), Goal::None),
        row("800x600, through a lens, 2 threads", lens, Outputs::ALL, (0, 2), Goal::None),
        row("800x600, hard rain, 2 threads", plain, Outputs::ALL, (1, 2), Goal::None),
        row("800x600, night with lamps, 2 threads", plain, Outputs::ALL, (2, 2), Goal::None),
        row("640x360, all four images, 2 threads", small, Outputs::ALL, (0, 2), Goal::None),
        row("1920x1080, all four images, 2 threads", large, Outputs::ALL, (0, 2), Goal::None),
    ];
    let mut renderers = [1, 2].map(|threads| {
        Renderer::new(RenderOptions { threads, ..RenderOptions::default() }).expect("threads can be started")
    });
    let mut software = Renderer::new(RenderOptions { backend: Backend::Software, threads: 2 });
    let by_software = |k: usize| {
        let row = &rows[k];
        let rounds = Vec::with_capacity(ROUNDS);
        Row { goal: Goal::None, rounds, busy: Vec::with_capacity(ROUNDS), ..*row }
    };
    let mut references = [0, 1].map(by_software);
    for _ in 0..ROUNDS {
        if let Ok(software) = &mut software {
            for row in &mut references {
                let (ms, busy) = measure(row, &scenes[row.scene], software);
                row.rounds.push(ms);
                row.busy.extend(busy);
            }
        }
        for row in &mut rows {
            let (ms, busy) = measure(row, &scenes[row.scene], &mut renderers[row.threads - 1]);
            row.rounds.push(ms);
            row.busy.extend(busy);
        }
    }
    let mut table = Rows::new(env!("CARGO_TARGET_TMPDIR"), "render");
    let scene = &scenes[0];
    let instances = scene.statics().instances().iter().chain(&scene.dynamics);
    let triangles: usize = instances.map(|i| scene.meshes.get(i.mesh).triangles().len()).sum();
    table.row("triangles of the town", triangles as f64, &format!("{triangles}"), Goal::None);
    match &software {
        Ok(software) => compare(&mut table, software, &rows, &references),
        Err(error) => table.skipped("software adapter", &error.to_string()),
    }
    for row in rows {
        let sample = Sample::new(row.rounds);
        // The fastest round is compared with the goal: the time without disturbance by the host.
        let mut reads = sample.text(2, "ms");
        if !row.busy.is_empty() {
            reads += &format!(", busy {:.2} ms", Sample::new(row.busy).median());
        }
        table.row(row.what, sample.least(), &reads, row.goal);
    }
    table.finish();
}
