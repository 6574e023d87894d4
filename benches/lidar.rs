//! Lidar rays: Swerve's trees and rapier's query pipeline on the same triangles, alternately, round by round; and the
//! same scans on a GPU if available.
//!
//! `--bench compute` measures only the latter, with `SWERVE_SOFTWARE_ADAPTER=1` on a software adapter if there is no
//! other. `--bench objects` measures only object detection in a scan.

use std::hint::black_box;
use std::sync::Arc;

use rapier3d::prelude::{ColliderBuilder, PhysicsWorld, Pose, QueryFilter, Ray, Rotation, Vector};
use swerve_benches::{Goal, Rows, Sample, is_asked, is_asked_to_measure, now, print};
use swerve_geom::{Ego, Lidar, Map, Point, Transform};
use swerve_gpu::{AdapterKind, Gpu, NoAdapter};
use swerve_lidar::{Cloud, Firing, LidarPreset, LidarSpec, RayMemory, SceneTree, Sweeper};
use swerve_msg::{Detections, EgoState, LidarPoint, PointCloud};
use swerve_perception::LidarObjects;
use swerve_perception::lidar::ground::Method;
use swerve_perception::lidar::{Params, Scan};
use swerve_scene::town::town;
use swerve_scene::{Instance, Scene, WeatherPreset};

/// Position of the sensor in the town.
const SENSOR_M: [f64; 3] = [0.0, -1.9, 1.9];
/// Maximum length of a ray, metres.
const RANGE_M: f64 = 120.0;
/// Reach of a town of about 64,000 triangles, metres.
const NEAR_M: f64 = 38.0;
/// Reach of the whole town, metres.
const WHOLE_M: f64 = 200.0;
const ROUNDS: usize = 15;
/// Number of lidars that share a GPU.
const LIDARS: usize = 4;

fn triangles(scene: &Scene, instance: &Instance) -> usize {
    scene.meshes.get(instance.mesh).triangles().len()
}

fn all(scene: &Scene) -> impl Iterator<Item = &Instance> {
    scene.statics().instances().iter().chain(&scene.dynamics)
}

/// The same instances as trimeshes of a physics world.
fn physics(scene: &Scene) -> PhysicsWorld {
    let mut world = PhysicsWorld::new();
    for instance in all(scene) {
        let mesh = scene.meshes.get(instance.mesh);
        let corners = mesh.positions().iter().map(|&[x, y, z]| Vector::new(x, y, z)).collect();
        let shape =
            ColliderBuilder::trimesh(corners, mesh.triangles().to_vec()).expect("meshes are not empty");
        let (at, turn) = (instance.map_from_body.origin().coords, instance.map_from_body.rotation());
        let [x, y, z, w] = [turn.i, turn.j, turn.k, turn.w].map(|q| q as f32);
        let translation = Vector::new(at.x as f32, at.y as f32, at.z as f32);
        let pose = Pose::from_parts(translation, Rotation::from_xyzw(x, y, z, w));
        world.insert_collider(shape.position(pose), None);
    }
    world.step();
    world
}

/// Ray directions of a full scan, column by column.
fn directions(spec: &LidarSpec) -> Vec<[f64; 3]> {
    let mut rays = Vec::new();
    for column in 0..spec.columns {
        let turn = std::f64::consts::TAU * f64::from(column) / f64::from(spec.columns);
        for beam in &spec.beams {
            let (sin, cos) = swerve_geom::math::sin_cos(turn + beam.azimuth_rad);
            let (up, flat) = swerve_geom::math::sin_cos(beam.elevation_rad);
            rays.push([flat * cos, flat * sin, up]);
        }
    }
    rays
}

/// Million rays per second of `work`.
fn rate(rays: usize, work: impl FnOnce()) -> f64 {
    let began = now();
    work();
    rays as f64 / began.elapsed().as_secs_f64() * 1e-6
}

struct Turn {
    sweeper: Sweeper,
    cloud: Cloud,
    pose: Transform<Map, Lidar>,
}

impl Turn {
    fn new(spec: LidarSpec, threads: usize) -> Self {
        Self::of(Sweeper::new(spec, threads).expect("a preset"))
    }

    fn of(sweeper: Sweeper) -> Self {
        let spec = sweeper.spec();
        let cloud = Cloud::new(spec, true);
        let [x, y, z] = SENSOR_M;
        let pose = Transform::from_roll_pitch_yaw(Point::new(x, y, z), 0.0, 0.0, 0.0);
        Self { sweeper, cloud, pose }
    }

    /// Full scans of one world.
    fn fire_at_rest(&mut self, tree: &SceneTree, turns: usize) {
        let rest = Firing::turn_at_rest(&self.sweeper, self.pose);
        for turn in 0..turns {
            self.sweeper.begin_turn(turn as u64, &mut self.cloud.as_mut());
            self.sweeper.fire(tree, &rest, &mut self.cloud.as_mut()).expect("a sound firing");
            black_box(&self.cloud);
        }
    }

    /// Full scans of one world, each in flight while the previous one is collected.
    fn fire_double_buffered(&mut self, tree: &SceneTree, turns: usize) {
        let rest = Firing::turn_at_rest(&self.sweeper, self.pose);
        self.sweeper.submit(0, tree, &rest).expect("a sound firing");
        for turn in 1..=turns {
            if turn < turns {
                self.sweeper.submit(turn as u64, tree, &rest).expect("a sound firing");
            }
            self.cloud.len = 0;
            let columns = self.sweeper.collect(tree, &mut self.cloud.as_mut()).expect("room for a turn");
            assert!(columns.is_some(), "it was submitted");
            black_box(&self.cloud);
        }
    }

    /// A full scan in steps of 5 ms, with the tree updated before each.
    fn fire(&mut self, scene: &Scene, tree: &mut SceneTree) {
        let rest = Firing::turn_at_rest(&self.sweeper, self.pose);
        self.sweeper.begin_turn(0, &mut self.cloud.as_mut());
        for step in 0..20_i64 {
            tree.update(scene).expect("a sound scene");
            let (begin_ns, end_ns) = (step * 5_000_000, (step + 1) * 5_000_000);
            let firing = Firing { begin_ns, end_ns, ..rest };
            self.sweeper.fire(tree, &firing, &mut self.cloud.as_mut()).expect("a sound firing");
        }
    }
}

/// One town: Swerve's rays alone, full scans with noise, and rapier's rays, alternating each round.
fn compare(rows: &mut Rows, scene: &Scene, is_held: bool) {
    let count: usize = all(scene).map(|instance| triangles(scene, instance)).sum();
    let name = format!("{}k triangles", (count + 500) / 1000);
    let goal = |goal: Goal| if is_held { goal } else { Goal::None };
    let mut tree = SceneTree::new(scene).expect("a sound scene");
    let world = physics(scene);
    let rays = directions(&LidarPreset::Vlp32.spec());
    let mut memory = RayMemory::default();
    let perfect = LidarPreset::Vlp32.spec().without_noise();
    let mut bare = Turn::new(LidarSpec { range_max_m: RANGE_M, ..perfect }, 1);
    let mut noisy = Turn::new(LidarSpec { range_max_m: RANGE_M, ..LidarPreset::Vlp32.spec() }, 1);
    let mut wide = Turn::new(LidarPreset::Os1.spec(), 1);
    let mut two = Turn::new(LidarPreset::Os1.spec(), 2);
    let [mut peers, mut singles, mut turns, mut noisies, mut wides, mut twos, mut ratios] =
        [const { Vec::new() }; 7];
    let (mut peer_hits, mut our_hits) = (0, 0);
    for _ in 0..ROUNDS {
        let peer = rate(rays.len(), || {
            let pipeline = world.query_pipeline_with_filter(QueryFilter::default());
            let [x, y, z] = SENSOR_M.map(|v| v as f32);
            let hits = rays.iter().filter(|d| {
                let ray = Ray::new(Vector::new(x, y, z), Vector::new(d[0] as f32, d[1] as f32, d[2] as f32));
                black_box(pipeline.cast_ray_and_get_normal(&ray, RANGE_M as f32, true)).is_some()
            });
            peer_hits = hits.count();
        });
        singles.push(rate(rays.len(), || {
            let hits = rays
                .iter()
                .filter(|d| black_box(tree.cast_with(&mut memory, SENSOR_M, **d, RANGE_M, None)).is_some());
            our_hits = hits.count();
        }));
        let turn = rate(rays.len(), || bare.fire(scene, &mut tree));
        noisies.push(rate(rays.len(), || noisy.fire(scene, &mut tree)));
        wides.push(rate(wide.sweeper.points_max(), || wide.fire(scene, &mut tree)));
        twos.push(rate(two.sweeper.points_max(), || two.fire(scene, &mut tree)));
        ratios.push(turn / peer);
        turns.push(turn);
        peers.push(peer);
    }
    let apart = our_hits.abs_diff(peer_hits) as f64 / rays.len() as f64;
    assert!(apart < 2e-3, "rapier's rays hit {peer_hits} times, ours {our_hits}");
    let [peers, singles, turns, noisies, wides, twos, ratios] =
        [peers, singles, turns, noisies, wides, twos, ratios].map(Sample::new);
    let mut row = |what: &str, sample: &Sample, unit: &str, held: Goal| {
        rows.row(&format!("{what}, {name}"), sample.median(), &sample.text(2, unit), goal(held));
    };
    row("rapier QueryPipeline, trimesh per object, one core", &peers, "Mray/s", Goal::None);
    row("ours, 32x1800 turn in 20 steps, trees updated, one core", &turns, "Mray/s", Goal::Least(3.5));
    row("  the latter over the former", &ratios, "x", Goal::Least(2.5));
    row("ours, with noise, dropout and truth", &noisies, "Mray/s", Goal::Least(3.5));
    row("ours, single rays in the same order", &singles, "Mray/s", Goal::None);
    row("ours, 64x2048 with noise, one core", &wides, "Mray/s", Goal::None);
    row("ours, 64x2048 with noise, two threads", &twos, "Mray/s", Goal::None);
}

/// Cost of a step besides its rays.
fn trees(rows: &mut Rows, scene: &Scene) {
    let (mut fresh, mut kept) = (Vec::new(), Vec::new());
    for _ in 0..ROUNDS {
        let began = now();
        let mut tree = SceneTree::new(scene).expect("a sound scene");
        fresh.push(began.elapsed().as_secs_f64() * 1e3);
        let began = now();
        (0..20).for_each(|_| tree.update(black_box(scene)).expect("a sound scene"));
        kept.push(began.elapsed().as_secs_f64() * 1e3 / 20.0);
    }
    let (fresh, kept) = (Sample::new(fresh), Sample::new(kept));
    let what = format!("tree over {} moving instances anew, each step", scene.dynamics.len());
    rows.row(&what, kept.median(), &kept.text(3, "ms"), Goal::Most(0.1));
    rows.row("trees over all that never moves, once", fresh.median(), &fresh.text(1, "ms"), Goal::None);
}

/// Object detection in the points of a scan, on one core.
fn objects(rows: &mut Rows, scene: &Scene) {
    let mut turn = Turn::new(LidarPreset::Vlp32.spec(), 1);
    turn.fire_at_rest(&SceneTree::new(scene).expect("a sound scene"), 1);
    let from = &turn.cloud;
    let mut cloud = PointCloud::default();
    for k in 0..from.len {
        let time_offset_s = from.offset_s[k] - 0.1;
        let (intensity, ring) = (from.intensity[k], from.ring[k]);
        cloud.push(LidarPoint { place_m: from.point_m(k), intensity, ring, time_offset_s });
    }
    let ego_from_lidar: Transform<Ego, Lidar> =
        Transform::from_roll_pitch_yaw(Point::new(1.4, 0.0, SENSOR_M[2]), 0.0, 0.0, 0.0);
    let ego = EgoState { speed_mps: 10.0, yaw_rate_radps: 0.1, ..EgoState::default() };
    let scan = Scan { cloud: &cloud, ego_from_lidar, ego, own_m: [-1.0, 3.9, 1.0], route: None };
    for (ground, name) in [(Method::Rays, "rays"), (Method::Zones, "zones")] {
        let mut objects =
            LidarObjects::new(Params { ground, ..Params::default() }).expect("the defaults are fine");
        let (mut found, mut clusters, mut wholes) = (Detections::default(), Vec::new(), Vec::new());
        for _ in 0..10 * ROUNDS {
            let began = now();
            black_box(objects.cluster(&scan));
            clusters.push(began.elapsed().as_secs_f64() * 1e3);
            let began = now();
            objects.detect(&scan, &mut found);
            wholes.push(began.elapsed().as_secs_f64() * 1e3);
        }
        let count = cloud.len();
        for (what, figures, goal) in [
            (format!("ground by {name} and clusters, {count} points"), clusters, Goal::Most(8.0)),
            (format!("all of it, {} objects", found.boxes.len()), wholes, Goal::None),
        ] {
            let sample = Sample::new(figures);
            rows.row(&what, sample.median(), &sample.text(2, "ms"), goal);
        }
    }
}

/// Adapter to measure on: a GPU, or a software adapter on request.
fn adapter() -> Result<Arc<Gpu>, NoAdapter> {
    let software = std::env::var("SWERVE_SOFTWARE_ADAPTER").is_ok_and(|value| value == "1");
    Gpu::shared(AdapterKind::Gpu)
        .or_else(|none| if software { Gpu::shared(AdapterKind::Software) } else { Err(none) })
}

/// Full scans on a GPU: upload of all changes, firing with noise, and download as points with ground truth in the
/// arrays of a cloud.
fn compute(rows: &mut Rows, scene: &Scene) {
    let gpu = match adapter() {
        Ok(gpu) => gpu,
        Err(none) => return rows.skipped("rays by compute", &none.to_string()),
    };
    print(&format!("adapter: {}", gpu.report()));
    let is_gpu = gpu.report().kind == Some(AdapterKind::Gpu);
    let (rounds, turns) = if is_gpu { (ROUNDS, 100) } else { (3, 1) };
    let mut tree = SceneTree::new(scene).expect("a sound scene");
    let there =
        |spec: LidarSpec, threads: usize| Turn::of(Sweeper::on_gpu(spec, threads, &gpu).expect("a preset"));
    let small = LidarPreset::Vlp32.spec();
    let wide = LidarPreset::Os1.spec();
    let mut one_small = there(small, 1);
    let (mut one, mut ahead) = (there(wide.clone(), 1), there(wide.clone(), 1));
    let mut all: Vec<Turn> = (0..LIDARS).map(|_| there(wide.clone(), 1)).collect();
    let began = now();
    one.fire_at_rest(&tree, 1);
    let first_ms = began.elapsed().as_secs_f64() * 1e3;
    [&mut one_small, &mut ahead].into_iter().chain(&mut all).for_each(|turn| turn.fire_at_rest(&tree, 1));
    let [mut smalls, mut ones, mut aheads, mut steps, mut alls] = [const { Vec::new() }; 5];
    for _ in 0..rounds {
        let rays = one_small.sweeper.points_max() * turns;
        smalls.push(rate(rays, || one_small.fire_at_rest(&tree, turns)));
        let rays = one.sweeper.points_max() * turns;
        ones.push(rate(rays, || one.fire_at_rest(&tree, turns)));
        aheads.push(rate(rays, || ahead.fire_double_buffered(&tree, turns)));
        alls.push(rate(rays * LIDARS, || {
            std::thread::scope(|scope| {
                for turn in &mut all {
                    scope.spawn(|| turn.fire_at_rest(&tree, turns));
                }
            });
        }));
        steps.push(rate(rays, || (0..turns).for_each(|_| one.fire(scene, &mut tree))));
    }
    for turn in [&one_small, &one, &ahead].into_iter().chain(&all) {
        assert!(turn.cloud.len * 2 > turn.sweeper.points_max(), "{} points", turn.cloud.len);
        assert_eq!(turn.sweeper.fallback(), None);
    }
    let mut row = |what: &str, figures: Vec<f64>, goal: Goal| {
        let sample = Sample::new(figures);
        rows.row(what, sample.median(), &sample.text(1, "Mray/s"), goal);
    };
    let goal = if is_gpu { Goal::Least(300.0) } else { Goal::None };
    row("by compute, 32x1800 turn at rest, each waited for", smalls, Goal::None);
    row("by compute, 64x2048 turn at rest, each waited for", ones, Goal::None);
    row("by compute, 64x2048 turn at rest, double-buffered", aheads, goal);
    row(&format!("by compute, 64x2048 turns at rest, {LIDARS} lidars in as many threads"), alls, Goal::None);
    row("by compute, 64x2048 turn in 20 steps, trees updated", steps, Goal::None);
    rows.row("first turn: shader compiled, trees sent", first_ms, &format!("{first_ms:.0} ms"), Goal::None);
}

fn main() {
    if !is_asked_to_measure() {
        return;
    }
    let mut rows = Rows::new(env!("CARGO_TARGET_TMPDIR"), "lidar");
    let near = town(WeatherPreset::ClearNoon, 1, NEAR_M);
    if is_asked("objects") {
        objects(&mut rows, &town(WeatherPreset::ClearNoon, 1, WHOLE_M));
    }
    if is_asked("rays") {
        compare(&mut rows, &near, true);
        compare(&mut rows, &town(WeatherPreset::ClearNoon, 1, WHOLE_M), false);
        trees(&mut rows, &near);
    }
    if is_asked("compute") {
        compute(&mut rows, &near);
    }
    rows.finish();
}
