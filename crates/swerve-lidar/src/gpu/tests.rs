use swerve_geom::{Lidar, Map, Point, Transform};
use swerve_gpu::AdapterKind;
use swerve_scene::town::town;
use swerve_scene::{Instance, Kind, Scene, WeatherPreset};

use super::*;
use crate::{Cloud, Firing, LidarEngine, LidarPreset, LidarSpec, Sweeper};

/// Device of any adapter, preferably hardware.
fn device(fresh: bool) -> Option<Arc<Gpu>> {
    let open = if fresh { Gpu::fresh } else { Gpu::shared };
    swerve_tests::or_skip(open(AdapterKind::Software).or_else(|_| open(AdapterKind::Gpu)))
}

fn pose(seconds: f64) -> Transform<Map, Lidar> {
    let point = Point::new(1.0 + 14.0 * seconds, -1.9, 1.9);
    Transform::from_roll_pitch_yaw(point, 0.01, -0.02, 0.3 + 0.5 * seconds)
}

/// Turn in this many world steps; `change` modifies the scene at the start of each step.
fn turn(
    sweeper: &mut Sweeper,
    scene: &mut Scene,
    tree: &mut SceneTree,
    steps: i64,
    mut change: impl FnMut(i64, &mut Scene),
) -> Cloud {
    let mut cloud = Cloud::new(sweeper.spec(), true);
    sweeper.begin_turn(3, &mut cloud.as_mut());
    let step_ns = sweeper.period_ns() / steps;
    for step in 0..steps {
        for instance in &mut scene.dynamics {
            let at = instance.map_from_body.origin().coords;
            let moved = Point::new(at.x + 0.4, at.y - 0.1, at.z);
            instance.map_from_body = Transform::new(moved, instance.map_from_body.rotation());
        }
        change(step, scene);
        tree.update(scene).unwrap();
        let (begin_ns, end_ns) = (step * step_ns, (step + 1) * step_ns);
        let (begin, end) = (pose(begin_ns as f64 * 1e-9), pose(end_ns as f64 * 1e-9));
        let firing = Firing { begin_ns, begin, end_ns, end, hidden_instance: None };
        let fired = sweeper.fire(tree, &firing, &mut cloud.as_mut()).unwrap();
        assert_eq!(fired.is_complete, step + 1 == steps);
    }
    cloud
}

/// Differences of two clouds of the same pattern.
#[derive(Debug, Default)]
struct Difference {
    both: usize,
    only_one: usize,
    other_ids: usize,
    range_sum_m: f64,
    far_ranges: usize,
    intensity_max: f32,
}

impl Difference {
    /// Compares points by column and ring; ranges that differ by more than `far_m` are counted as far.
    fn new(a: &Cloud, b: &Cloud, far_m: f64) -> Self {
        let mut all = std::collections::BTreeMap::new();
        for (side, cloud) in [a, b].into_iter().enumerate() {
            for k in 0..cloud.len {
                let entry = all.entry((cloud.offset_s[k].to_bits(), cloud.ring[k])).or_insert([None; 2]);
                assert_eq!(entry[side], None, "a shot gives one point");
                entry[side] = Some(k);
            }
        }
        let mut difference = Self::default();
        for pair in all.values() {
            let [Some(i), Some(j)] = *pair else {
                difference.only_one += 1;
                continue;
            };
            let range = |cloud: &Cloud, k: usize| {
                let [x, y, z] = cloud.point_m(k).map(f64::from);
                (x * x + y * y + z * z).sqrt()
            };
            difference.both += 1;
            let apart = (range(a, i) - range(b, j)).abs();
            difference.range_sum_m += apart;
            difference.far_ranges += usize::from(apart > far_m);
            if (a.instance[i], a.class[i]) == (b.instance[j], b.class[j]) {
                let apart = (a.intensity[i] - b.intensity[j]).abs();
                difference.intensity_max = difference.intensity_max.max(apart);
            } else {
                difference.other_ids += 1;
            }
        }
        difference
    }
}

fn spec(columns: u32) -> LidarSpec {
    LidarSpec { columns, ..LidarPreset::Os1.spec() }
}

/// Same turn on both engines.
fn both(
    spec: &LidarSpec,
    gpu: &Arc<Gpu>,
    threads: usize,
    scene: &Scene,
    tree: fn() -> SceneTree,
    change: impl Fn(i64, &mut Scene),
) -> [Cloud; 2] {
    let mut here = Sweeper::new(spec.clone(), 1).unwrap();
    let mut there = Sweeper::on_gpu(spec.clone(), threads, gpu).unwrap();
    let one = turn(&mut here, &mut scene.clone(), &mut tree(), 4, &change);
    let other = turn(&mut there, &mut scene.clone(), &mut tree(), 4, &change);
    assert_eq!((there.engine(), there.fallback()), (LidarEngine::Gpu, None));
    // By column and then by beam.
    let order: Vec<_> = (0..other.len).map(|k| (other.offset_s[k].to_bits(), other.ring[k])).collect();
    assert!(order.is_sorted());
    [one, other]
}

#[test]
fn gpu_hits_match_cpu_hits() {
    let Some(gpu) = device(false) else { return };
    let spec = spec(160).without_noise();
    let [here, there] =
        both(&spec, &gpu, 1, &town(WeatherPreset::ClearNoon, 1, 45.0), SceneTree::default, |_, _| {});
    let difference = Difference::new(&here, &there, 0.01);
    let rays = 160 * 64;
    println!("{} and {} hits of {rays} rays: {difference:?}", here.len, there.len);
    assert!(here.len * 2 > rays, "{}", here.len);
    assert!(difference.only_one <= 6 && difference.far_ranges <= 6, "{difference:?}");
    assert!(difference.range_sum_m < 1e-3 * difference.both as f64, "{difference:?}");
    assert!(difference.other_ids * 1000 <= difference.both, "{difference:?}");
    assert!(difference.intensity_max < 1e-3, "{difference:?}");
}

#[test]
fn gpu_noise_dropout_and_rain_match_the_cpu() {
    let Some(gpu) = device(false) else { return };
    let spec = LidarSpec { dropout: 0.1, ..spec(160) };
    let scene = town(WeatherPreset::HardRainNoon, 2, 45.0);
    let [here, there] = both(&spec, &gpu, 3, &scene, SceneTree::default, |_, _| {});
    // Ranges are multiples of 3 mm; rounding may select the neighbouring one.
    let difference = Difference::new(&here, &there, 0.0035);
    println!("{} and {} returns: {difference:?}", here.len, there.len);
    assert!(here.len > 2500, "{}", here.len);
    assert!(difference.only_one <= 10 && difference.far_ranges <= 6, "{difference:?}");
    assert!(difference.range_sum_m < 1e-4 * difference.both as f64, "{difference:?}");
    assert!(difference.other_ids * 1000 <= difference.both, "{difference:?}");
    assert!(difference.intensity_max < 1e-3, "{difference:?}");
}

#[test]
fn gpu_casts_each_column_in_the_scene_of_its_step() {
    let Some(gpu) = device(false) else { return };
    let scene = town(WeatherPreset::ClearNoon, 3, 40.0);
    let change = |step: i64, scene: &mut Scene| match step {
        1 => {
            let walker = scene.meshes.model(Kind::Pedestrian { phase: 5 }, 8);
            scene.dynamics.push(Instance::new(&walker, 7.0, -2.0, 0.0).with_id(900));
        }
        2 => {
            let house = scene.meshes.model(Kind::Building, 77);
            scene.add_static(Instance::new(&house, 3.0, -12.0, 0.3).with_id(901));
        }
        3 => scene.set_weather(WeatherPreset::SoftRainNoon),
        _ => {}
    };
    // With a static tree, and with all instances in the dynamic tree.
    for tree in [SceneTree::default, || SceneTree::with_static_triangles(0)] {
        let spec = spec(80).without_noise();
        let [here, there] = both(&spec, &gpu, 2, &scene, tree, change);
        let difference = Difference::new(&here, &there, 0.01);
        assert!(here.len > 2500 && difference.only_one + difference.far_ranges <= 6, "{difference:?}");
        assert!(difference.other_ids * 1000 <= difference.both, "{difference:?}");
        assert!(difference.intensity_max < 1e-3, "{difference:?}");
        assert!(here.instance[..here.len].contains(&901));
    }
}

#[test]
fn gpu_hides_the_carrying_vehicle() {
    let Some(gpu) = device(false) else { return };
    let mut scene = town(WeatherPreset::ClearNoon, 1, 40.0);
    let (own, parked) = (scene.meshes.model(Kind::Sedan, 1), scene.meshes.model(Kind::Van, 1));
    scene.dynamics.push(Instance::new(&own, 1.0, -1.9, 0.3).with_id(77));
    scene.add_static(Instance::new(&parked, 1.0, 3.0, 0.3).with_id(78));
    let tree = SceneTree::new(&scene).unwrap();
    let spec = LidarSpec { columns: 64, range_min_m: 0.1, ..LidarPreset::Vlp32.spec().without_noise() };
    let mut sweeper = Sweeper::on_gpu(spec.clone(), 1, &gpu).unwrap();
    let mut cloud = Cloud::new(&spec, true);
    for (hidden, seen) in [(None, [true, true]), (Some(77), [false, true]), (Some(78), [true, false])] {
        sweeper.begin_turn(0, &mut cloud.as_mut());
        let rest = Firing::turn_at_rest(&sweeper, pose(0.0));
        let firing = Firing { hidden_instance: hidden, ..rest };
        sweeper.fire(&tree, &firing, &mut cloud.as_mut()).unwrap();
        assert_eq!([77, 78].map(|id| cloud.instance[..cloud.len].contains(&id)), seen, "{hidden:?}");
    }
    assert_eq!((sweeper.engine(), sweeper.fallback()), (LidarEngine::Gpu, None));
}

#[test]
fn gpu_returns_no_points_in_an_empty_scene() {
    let Some(gpu) = device(false) else { return };
    let mut sweeper = Sweeper::on_gpu(spec(16), 1, &gpu).unwrap();
    let cloud = turn(&mut sweeper, &mut Scene::default(), &mut SceneTree::default(), 2, |_, _| {});
    assert_eq!((cloud.len, sweeper.fallback()), (0, None));
}

/// Runs turns before, during and after the loss of the device.
fn lose(gpu: &Arc<Gpu>, scene: &Scene) {
    let mut here = Sweeper::new(spec(64), 1).unwrap();
    let mut there = Sweeper::on_gpu(spec(64), 2, gpu).unwrap();
    let first = turn(&mut there, &mut scene.clone(), &mut SceneTree::default(), 4, |_, _| {});
    assert_eq!((there.engine(), there.fallback()), (LidarEngine::Gpu, None));
    assert!(first.len > 30, "{}", first.len);
    for _ in 0..2 {
        let one = turn(&mut here, &mut scene.clone(), &mut SceneTree::default(), 4, |_, _| {});
        let lose = |step: i64, _: &mut Scene| {
            if step == 2 {
                gpu.device().destroy();
            }
        };
        let other = turn(&mut there, &mut scene.clone(), &mut SceneTree::default(), 4, lose);
        assert!(other == one, "{} and {} points", other.len, one.len);
        assert_eq!(there.engine(), LidarEngine::Cpu);
        let why = there.fallback().unwrap_or_default();
        assert!(why.contains("lost"), "{why}");
    }
}

#[test]
fn sweeper_falls_back_to_the_cpu_without_losing_points() {
    let scene = town(WeatherPreset::ClearNoon, 1, 40.0);
    // Without static instances the origin of the coordinates depends on the moving ones.
    let mut moving = scene.clone();
    moving.clear_statics();
    let own = moving.meshes.model(Kind::Sedan, 1);
    moving.dynamics.push(Instance::new(&own, 9.0, -2.0, 0.0));
    for scene in [scene, moving] {
        let Some(gpu) = device(true) else { return };
        lose(&gpu, &scene);
    }
}

/// Turn as in [`turn`], with each piece collected after the next is submitted; `change` is called before each.
fn turn_ahead(sweeper: &mut Sweeper, scene: &mut Scene, steps: i64, mut change: impl FnMut(i64)) -> Cloud {
    let mut tree = SceneTree::default();
    let mut cloud = Cloud::new(sweeper.spec(), true);
    let step_ns = sweeper.period_ns() / steps;
    let mut collected = 0;
    for step in 0..steps {
        for instance in &mut scene.dynamics {
            let at = instance.map_from_body.origin().coords;
            let moved = Point::new(at.x + 0.4, at.y - 0.1, at.z);
            instance.map_from_body = Transform::new(moved, instance.map_from_body.rotation());
        }
        change(step);
        tree.update(scene).unwrap();
        let (begin_ns, end_ns) = (step * step_ns, (step + 1) * step_ns);
        let (begin, end) = (pose(begin_ns as f64 * 1e-9), pose(end_ns as f64 * 1e-9));
        let firing = Firing { begin_ns, begin, end_ns, end, hidden_instance: None };
        let fired = sweeper.submit(3, &tree, &firing).unwrap();
        assert_eq!(fired.is_complete, step + 1 == steps);
        if step > 0 {
            let columns = sweeper.collect(&tree, &mut cloud.as_mut()).unwrap().unwrap();
            assert_eq!(columns.start, collected);
            collected = columns.end;
        }
    }
    assert_eq!(sweeper.collect(&tree, &mut cloud.as_mut()).unwrap(), Some(collected..sweeper.spec().columns));
    assert_eq!(sweeper.collect(&tree, &mut cloud.as_mut()).unwrap(), None);
    cloud
}

#[test]
fn collected_points_match_those_of_fire() {
    let scene = town(WeatherPreset::ClearNoon, 1, 40.0);
    let mut here = Sweeper::new(spec(64), 2).unwrap();
    let one = turn(&mut here, &mut scene.clone(), &mut SceneTree::default(), 4, |_, _| {});
    for _ in 0..2 {
        assert!(turn_ahead(&mut here, &mut scene.clone(), 4, |_| {}) == one);
    }
    let Some(gpu) = device(false) else { return };
    let mut there = Sweeper::on_gpu(spec(64), 1, &gpu).unwrap();
    let one = turn(&mut there, &mut scene.clone(), &mut SceneTree::default(), 4, |_, _| {});
    for steps in [4, 4] {
        assert!(turn_ahead(&mut there, &mut scene.clone(), steps, |_| {}) == one);
    }
    assert_eq!((there.engine(), there.fallback()), (LidarEngine::Gpu, None));
    // Too little room: collecting can be repeated with more room without loss.
    let tree = SceneTree::new(&scene).unwrap();
    there.submit(0, &tree, &Firing::turn_at_rest(&there, pose(0.0))).unwrap();
    let mut small = Cloud::new(&spec(32), true);
    assert!(there.collect(&tree, &mut small.as_mut()).is_err());
    let mut cloud = Cloud::new(there.spec(), false);
    assert_eq!(there.collect(&tree, &mut cloud.as_mut()).unwrap(), Some(0..64));
    assert!(cloud.len > 1000 && small.len == 0);
}

#[test]
fn gpu_lost_with_columns_in_flight_loses_no_points() {
    let scene = town(WeatherPreset::ClearNoon, 1, 40.0);
    let Some(gpu) = device(true) else { return };
    let mut here = Sweeper::new(spec(64), 1).unwrap();
    let mut there = Sweeper::on_gpu(spec(64), 1, &gpu).unwrap();
    // The device is lost before any result: the CPU computes the points in flight and all later ones.
    let lose = |step: i64| {
        if step == 1 {
            gpu.device().destroy();
        }
    };
    let other = turn_ahead(&mut there, &mut scene.clone(), 4, lose);
    assert_eq!(there.engine(), LidarEngine::Cpu);
    assert!(there.fallback().is_some());
    let one = turn_ahead(&mut here, &mut scene.clone(), 4, |_| {});
    assert!(other == one, "{} and {} points", other.len, one.len);
}

#[test]
fn begin_turn_drops_the_pieces_of_the_previous_turn() {
    let Some(gpu) = device(false) else { return };
    let tree = SceneTree::new(&town(WeatherPreset::ClearNoon, 1, 40.0)).unwrap();
    let mut sweeper = Sweeper::on_gpu(spec(64), 1, &gpu).unwrap();
    let mut cloud = Cloud::new(sweeper.spec(), true);
    let whole = Firing::turn_at_rest(&sweeper, pose(0.0));
    let half = Firing { end_ns: whole.end_ns / 2, ..whole };
    sweeper.begin_turn(0, &mut cloud.as_mut());
    assert!(!sweeper.fire(&tree, &half, &mut cloud.as_mut()).unwrap().is_complete);
    assert_eq!(cloud.len, 0, "points come with the last piece");
    sweeper.begin_turn(1, &mut cloud.as_mut());
    sweeper.fire(&tree, &whole, &mut cloud.as_mut()).unwrap();
    assert_eq!((sweeper.engine(), sweeper.fallback()), (LidarEngine::Gpu, None));
    let (columns, rings) = (64, 64);
    assert!(cloud.len > 1000 && cloud.len <= columns * rings);
    assert_eq!(cloud.offset_s[0], 0.0);
}
