use super::*;
use crate::weather::WeatherPreset;

/// A road that bends to the left, as in a scenario: 100 m straight, 60 m of a curve, 80 m straight.
fn bend() -> RoadLayout {
    let (mut at, mut heading) = ([0.0, 0.0], 0.0);
    let mut centre = Vec::new();
    for k in 0..=120 {
        centre.push(Point2::new(at[0], at[1]));
        if (50..80).contains(&k) {
            heading += 0.02;
        }
        let (sin, cos) = math::sin_cos(heading);
        at = [at[0] + 2.0 * cos, at[1] + 2.0 * sin];
    }
    RoadLayout::street(centre, 6.0, 2.0)
}

fn furnished(seed: u64, is_free: &dyn Fn(Point2<Map>, f64) -> bool) -> Scene {
    let mut scene = Scene::new(WeatherPreset::ClearNoon);
    furnish(&mut scene, &bend(), &Furnishing { seed, ..Furnishing::default() }, is_free);
    scene
}

#[test]
fn nothing_stands_on_the_road() {
    let layout = bend();
    for seed in 0..5 {
        let scene = furnished(seed, &|_, _| true);
        let of = |class| scene.statics().instances().iter().filter(|i| i.class == class).count();
        assert!(of(SemanticClass::Building) > 12, "{}", of(SemanticClass::Building));
        assert!(of(SemanticClass::Vegetation) > 10 && of(SemanticClass::Pole) > 8);
        assert_eq!(scene.lights.len(), of(SemanticClass::Pole));
        for instance in scene.statics().instances() {
            let mesh = scene.meshes.get(instance.mesh);
            // Whatever is below the height of a truck is beside the carriageway.
            for position in mesh.positions().iter().filter(|p| p[2] < 2.0) {
                let [x, y, z] = position.map(f64::from);
                let at = (instance.map_from_body * Point::new(x, y, z)).coords;
                for pair in layout.centre.windows(2) {
                    let (dx, dy) = (pair[1].x_m - pair[0].x_m, pair[1].y_m - pair[0].y_m);
                    let (ex, ey) = (at.x - pair[0].x_m, at.y - pair[0].y_m);
                    let length = math::hypot(dx, dy);
                    let (s, d) = ((ex * dx + ey * dy) / length, (dx * ey - dy * ex) / length);
                    let on = (0.0..length).contains(&s) && d < 6.0 && d > -2.0;
                    assert!(!on, "seed {seed}: {:?} at ({}, {})", instance.class, at.x, at.y);
                }
            }
        }
    }
}

#[test]
fn it_follows_the_seed_and_keeps_out() {
    let version = |seed: u64| furnished(seed, &|_, _| true).statics().version();
    assert_eq!(version(1), version(1));
    assert_ne!(version(1), version(2));
    assert!(furnished(1, &|_, _| false).statics().instances().is_empty());
    let halved = furnished(1, &|at, radius| at.x_m + radius < 100.0);
    assert!(!halved.statics().instances().is_empty());
    assert!(halved.statics().instances().iter().all(|i| i.map_from_body.origin().coords.x < 101.0));
    let mut nowhere = Scene::default();
    let empty = RoadLayout { centre: Vec::new(), ..bend() };
    furnish(&mut nowhere, &empty, &Furnishing::default(), &|_, _| true);
    assert!(nowhere.statics().instances().is_empty());
}

#[test]
fn grass_covers_its_rectangle() {
    let pieces = ground_pieces(Point2::new(-100.0, -50.0), Point2::new(130.0, 50.0), -0.05);
    assert_eq!(pieces.len(), 3 * 2);
    assert!(ground_pieces(Point2::new(f64::NAN, 0.0), Point2::new(1.0, 1.0), 0.0).is_empty());
}
