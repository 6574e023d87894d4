//! Turns in pieces, with moving sensors and objects.

use core::f64::consts::FRAC_PI_2;

use swerve_scene::Size;

use super::*;

#[test]
fn moving_sensor_fires_each_column_from_its_own_position() {
    let mut scene = Scene::new(WeatherPreset::ClearNoon);
    let wall = instance(&mut scene, wall(40.0), unmoved());
    scene.add_static(wall);
    let tree = SceneTree::new(&scene).unwrap();
    let spec = LidarPreset::Vlp32.spec().without_noise();
    let mut cloud = Cloud::new(&spec, false);
    let mut sweeper = Sweeper::new(spec, 1).unwrap();
    let speed = 15.0;
    // The sensor is at 0 at the start of the turn, and drives towards the wall.
    sweeper.begin_turn(0, &mut cloud.as_mut());
    for step in 0..20_i64 {
        let pose = |ns: i64| at(speed * ns as f64 * 1e-9, 0.0, 1.5);
        let (begin_ns, end_ns) = (step * 5_000_000, (step + 1) * 5_000_000);
        let firing =
            Firing { begin_ns, begin: pose(begin_ns), end_ns, end: pose(end_ns), hidden_instance: None };
        sweeper.fire(&tree, &firing, &mut cloud.as_mut()).unwrap();
    }
    assert!(cloud.len > 8000, "{}", cloud.len);
    let (mut least, mut most) = (f32::INFINITY, 0.0_f32);
    for k in 0..cloud.len {
        let expected = 40.0 - speed as f32 * cloud.offset_s[k];
        assert!((cloud.x_m[k] - expected).abs() < 1e-3, "{} {expected}", cloud.x_m[k]);
        (least, most) = (least.min(cloud.x_m[k]), most.max(cloud.x_m[k]));
    }
    // A third of the turn hits the wall: 15 m/s over 0.03 to 0.07 s smear it by half a metre.
    assert!(most - least > 0.4, "{least} {most}");
    assert!(cloud.instance.is_empty() && cloud.class.is_empty());
}

#[test]
fn moving_car_is_hit_at_its_position_in_each_step() {
    let mut scene = Scene::new(WeatherPreset::ClearNoon);
    let speed = 15.0;
    let model = scene.meshes.model_sized(Kind::Block, Size::from_m(4.0, 30.0, 3.0), 0);
    let mut tree = SceneTree::default();
    let spec = LidarSpec { first_azimuth_rad: FRAC_PI_2, ..LidarPreset::Vlp32.spec().without_noise() };
    let mut cloud = Cloud::new(&spec, true);
    let mut sweeper = Sweeper::new(spec, 1).unwrap();
    sweeper.begin_turn(0, &mut cloud.as_mut());
    for step in 0..20_i64 {
        let begin_ns = step * 5_000_000;
        scene.dynamics.clear();
        let x = 12.0 + speed * begin_ns as f64 * 1e-9;
        scene.dynamics.push(Instance::new(&model, x, 0.0, 0.0).with_id(4));
        tree.update(&scene).unwrap();
        let rest = Firing::turn_at_rest(&sweeper, at(0.0, 0.0, 1.5));
        let firing = Firing { begin_ns, end_ns: begin_ns + 5_000_000, ..rest };
        sweeper.fire(&tree, &firing, &mut cloud.as_mut()).unwrap();
    }
    let mut steps_seen = std::collections::BTreeSet::new();
    for k in 0..cloud.len {
        // Its rear face is 2 m behind its centre, which is at rest within a step.
        let step = (f64::from(cloud.offset_s[k]) / 0.005 + 1e-4).floor();
        let face = 10.0 + speed * 0.005 * step;
        assert!((f64::from(cloud.x_m[k]) - face).abs() < 1e-3 || cloud.x_m[k] > face as f32, "{k}");
        assert_eq!((cloud.instance[k], cloud.class[k]), (4, SemanticClass::Static as u8));
        if (f64::from(cloud.x_m[k]) - face).abs() < 1e-3 {
            steps_seen.insert(step as u32);
        }
    }
    assert!(steps_seen.len() >= 5, "{steps_seen:?}");
}

#[test]
fn points_of_a_turning_sensor_are_straight_after_motion_compensation() {
    // Yaw rate of 1 rad/s: points transformed by the pose at their instant are on the wall.
    let mut scene = Scene::new(WeatherPreset::ClearNoon);
    let wall = instance(&mut scene, wall(30.0), unmoved());
    scene.add_static(wall);
    let tree = SceneTree::new(&scene).unwrap();
    let spec = LidarPreset::Os1.spec().without_noise();
    let mut cloud = Cloud::new(&spec, false);
    let mut sweeper = Sweeper::new(spec, 1).unwrap();
    let pose = |s: f64| -> Transform<Map, Lidar> {
        Transform::from_roll_pitch_yaw(Point::new(5.0 * s, 1.0 - 2.0 * s, 1.5), 0.02, -0.01, -s)
    };
    sweeper.begin_turn(0, &mut cloud.as_mut());
    for step in 0..20_i64 {
        let (begin_ns, end_ns) = (step * 5_000_000, (step + 1) * 5_000_000);
        let (begin, end) = (pose(begin_ns as f64 * 1e-9), pose(end_ns as f64 * 1e-9));
        let firing = Firing { begin_ns, begin, end_ns, end, hidden_instance: None };
        sweeper.fire(&tree, &firing, &mut cloud.as_mut()).unwrap();
    }
    assert!(cloud.len > 10_000, "{}", cloud.len);
    for k in 0..cloud.len {
        let [x, y, z] = cloud.point_m(k).map(f64::from);
        let point = pose(f64::from(cloud.offset_s[k])) * Point::new(x, y, z);
        assert!((point.coords.x - 30.0).abs() < 2e-3, "{:?}", point);
    }
}

#[test]
fn fire_rejects_small_arrays_and_invalid_poses() {
    let scene = plain();
    let tree = SceneTree::new(&scene).unwrap();
    let spec = few_columns(LidarPreset::Vlp32, 100);
    let mut sweeper = Sweeper::new(spec.clone(), 1).unwrap();
    let whole = Firing::turn_at_rest(&sweeper, at(0.0, 0.0, 1.9));
    let mut cloud = Cloud::new(&spec, true);
    cloud.ring.pop();
    let error = sweeper.fire(&tree, &whole, &mut cloud.as_mut()).unwrap_err();
    assert!(error.to_string().contains("`ring` of the cloud has 3199 elements, 3200"), "{error}");
    let mut cloud = Cloud::new(&spec, true);
    cloud.class.pop();
    assert!(
        sweeper.fire(&tree, &whole, &mut cloud.as_mut()).unwrap_err().to_string().contains("truth.class")
    );
    let mut cloud = Cloud::new(&spec, true);
    cloud.len = usize::MAX;
    assert!(sweeper.fire(&tree, &whole, &mut cloud.as_mut()).is_err());
    cloud.len = 0;
    for bad in [f64::NAN, f64::INFINITY, 1e9] {
        let firing = Firing { end: at(0.0, bad, 0.0), ..whole };
        let error = sweeper.fire(&tree, &firing, &mut cloud.as_mut()).unwrap_err();
        assert_eq!(error, FireError::Pose { when: "end" });
    }
    let backwards = Firing { begin_ns: 10, end_ns: 4, ..whole };
    let error = sweeper.fire(&tree, &backwards, &mut cloud.as_mut()).unwrap_err();
    assert_eq!(error, FireError::Backwards { by_ns: 6 });
    assert_eq!(cloud.len, 0);
    let for_ever = Firing { begin_ns: i64::MIN, end_ns: i64::MAX, ..whole };
    assert_eq!(sweeper.fire(&tree, &for_ever, &mut cloud.as_mut()).unwrap().columns, 0..100);
}
