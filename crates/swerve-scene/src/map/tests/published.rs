//! Published maps: objects keep clear of lanes, and results are reproducible.

use swerve_map_io::{import, links, opendrive, sumo};
use swerve_tests::data_or_skip;

use super::*;
use crate::scene::Scene;

fn read(path: &str) -> Option<Map> {
    let file = data_or_skip(path)?;
    let text = std::fs::read_to_string(&file).unwrap();
    if path.ends_with(".net.xml") {
        return Some(sumo::read(path, &text).unwrap_or_else(|problems| panic!("{problems}")).lanes.map);
    }
    let network = opendrive::Network::read(path, &text).unwrap_or_else(|problems| panic!("{problems}"));
    Some(import::import(&network, &links::Links::of(&network)).unwrap().map)
}

#[test]
fn objects_of_published_maps_keep_clear_of_all_lanes() {
    for (path, least) in [
        ("external/carla/Town01.xodr", 400),
        ("external/esmini/resources/xodr/fabriksgatan.xodr", 40),
        ("worlds/sumo/bologna_acosta/acosta_buslanes.net.xml", 2000),
    ] {
        let Some(map) = read(path) else { return };
        let mut scene = Scene::default();
        add_map(&mut scene, &map, 1);
        let mut objects = 0;
        for instance in scene.statics().instances() {
            if !matches!(instance.class, SemanticClass::Building | SemanticClass::Vegetation) {
                continue;
            }
            objects += 1;
            // The walls of houses, and the trunks of trees.
            let ([x0, y0, _], [x1, y1, _]) = scene.meshes.get(instance.mesh).bounds();
            let is_house = instance.class == SemanticClass::Building;
            let reach = if is_house { [x0, y0, x1, y1] } else { [-0.3, -0.3, 0.3, 0.3] }.map(f64::from);
            for (x, y) in [(0, 1), (2, 1), (2, 3), (0, 3)] {
                let corner = swerve_geom::Point::new(reach[x], reach[y], 0.0);
                let at = (instance.map_from_body * corner).coords;
                let mut lanes = map.at(Point2::new(at.x, at.y));
                assert!(lanes.next().is_none(), "{path}: {:?} at {at:?}", instance.class);
            }
        }
        println!("{path}: {objects} houses and plants");
        assert!(objects > least, "{path}: {objects}");
    }
}

#[test]
fn lanes_of_a_published_town_are_drawn_at_their_height() {
    let Some(map) = read("external/carla/Town01.xodr") else { return };
    let (pieces, ground) = (map_pieces(&map), MapGround::new(&map));
    for lane in map.lanes() {
        let at = lane.line.at(0.5 * lane.line.length()).pose.point();
        let drawn_m = f64::from(top(&pieces, at.x_m, at.y_m).0);
        let expected_m = ground.height_m(at);
        assert!((drawn_m - expected_m).abs() < 0.007, "lane {}: {drawn_m} {expected_m}", lane.id.0);
        assert_eq!(expected_m > 0.0, lane.kind == LaneKind::Walking, "lane {}", lane.id.0);
    }
}

#[test]
fn scene_of_a_map_depends_on_the_seed_only() {
    let Some(map) = read("external/esmini/resources/xodr/fabriksgatan.xodr") else { return };
    let version = |seed| {
        let mut scene = Scene::default();
        add_map(&mut scene, &map, seed);
        (scene.statics().version(), scene.meshes.version(), scene.lights.len())
    };
    assert_eq!(version(1), version(1));
    assert_ne!(version(1).0, version(2).0);
}
