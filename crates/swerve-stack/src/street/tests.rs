use std::path::Path;

use swerve_core::Span;
use swerve_geom::{FrenetPoint, Pose2, Vector2};
use swerve_msg::{ActorId, Command, Extent};
use swerve_scenario::Scenario;
use swerve_scene::{MapGround, SemanticClass};
use swerve_sim::{SimParams, Simulator};
use swerve_vehicle::VehicleParams;

use super::*;

/// The scenarios on a road without a map.
fn scenarios() -> Vec<Scenario> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
    let mut files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|file| file.is_file());
    files.sort();
    let read = files.iter().map(|file| Scenario::read(file).unwrap());
    read.filter(|scenario| scenario.road.strip().is_some()).collect()
}

#[test]
fn scenery_is_clear_of_the_drivable_ground_and_actor_starts() {
    for scenario in scenarios() {
        for seed in 0..4 {
            let street = Street::new(&scenario, &Shape::default(), WeatherPreset::default(), seed);
            let line = scenario.road.line();
            let ground = [SemanticClass::Road, SemanticClass::Sidewalk, SemanticClass::Terrain];
            let standing: Vec<_> = street
                .scene()
                .statics()
                .instances()
                .iter()
                .filter(|instance| !ground.contains(&instance.class))
                .collect();
            assert!(standing.len() > 10, "{}: {} things", scenario.name, standing.len());
            for instance in standing {
                let at = instance.map_from_body.origin().coords;
                let point = Point2::new(at.x, at.y);
                let d_m = line.project(point).d_m;
                let off = d_m > scenario.road.strip().unwrap().left_m
                    || d_m < -scenario.road.strip().unwrap().right_m;
                assert!(off, "{}: {:?} at d = {d_m}", scenario.name, instance.class);
                for actor in &scenario.actors {
                    let far_m = actor.pose(&line).point().distance(point);
                    assert!(far_m > 0.6, "{}: {:?} by {}", scenario.name, instance.class, actor.name);
                }
            }
        }
    }
}

fn person(x_m: f64, speed_mps: f64) -> Actor {
    Actor {
        id: ActorId(2),
        kind: ActorKind::Pedestrian,
        pose: Pose2::new(x_m, 1.0, 0.3),
        z_m: 0.0,
        extent: Extent { length_m: 0.5, width_m: 0.5, height_m: 1.8 },
        velocity_mps: Vector2::new(speed_mps, 0.0),
    }
}

#[test]
fn actors_follow_the_world_and_people_move_their_legs() {
    let scenario = scenarios().into_iter().find(|s| s.name == "person_behind_truck").unwrap();
    let mut street = Street::new(&scenario, &Shape::default(), WeatherPreset::default(), 1);
    let params = SimParams { dt: Span::from_ms(5), vehicle: VehicleParams::default() };
    let world = Simulator::exact(scenario, &params).unwrap().state().clone();
    let mut shown = |x_m: f64, speed_mps: f64| {
        street.show(&WorldState { actors: vec![person(x_m, speed_mps)], ..world.clone() });
        let dynamics = &street.scene().dynamics;
        assert_eq!(dynamics.len(), 2);
        assert_eq!((dynamics[0].instance_id, dynamics[1].instance_id), (EGO_INSTANCE, 2));
        assert!((dynamics[1].map_from_body.origin().coords.x - x_m).abs() < 1e-12);
        dynamics[1].mesh
    };
    let (standing, first, second) = (shown(10.0, 0.0), shown(10.0, 1.4), shown(10.4, 1.4));
    assert!(standing != first && first != second);
    assert_eq!(shown(10.0, 1.4), first, "a function of the state alone");
}

/// Height of the drawn ground at a point, metres.
fn drawn_m(street: &Street, at: Point2) -> f64 {
    let scene = street.scene();
    let grounds = scene.statics().instances().iter().filter(|instance| {
        matches!(instance.class, SemanticClass::Road | SemanticClass::Sidewalk | SemanticClass::Terrain)
    });
    let heights = grounds.flat_map(|instance| {
        let mesh = scene.meshes.get(instance.mesh);
        mesh.triangles().iter().filter_map(move |corners| {
            let [a, b, c] = corners.map(|k| {
                let [x, y, z] = mesh.positions()[k as usize].map(f64::from);
                (instance.map_from_body * Point::new(x, y, z)).coords
            });
            let across = |p: [f64; 2], q: [f64; 2]| p[0] * q[1] - p[1] * q[0];
            let (ab, ac) = ([b.x - a.x, b.y - a.y], [c.x - a.x, c.y - a.y]);
            let to = [at.x_m - a.x, at.y_m - a.y];
            let area = across(ab, ac);
            let (v, w) = (across(to, ac) / area, across(ab, to) / area);
            (v >= 0.0 && w >= 0.0 && v + w <= 1.0).then(|| a.z + v * (b.z - a.z) + w * (c.z - a.z))
        })
    });
    heights.fold(f64::NEG_INFINITY, f64::max)
}

#[test]
fn actors_stand_on_the_drawn_ground() {
    for scenario in scenarios() {
        let street = Street::new(&scenario, &Shape::default(), WeatherPreset::default(), 1);
        let (road, line) = (&scenario.road, scenario.road.line());
        let (strip, edges) = (road.strip().unwrap(), [0.3, 1.4, 2.5, 3.2]);
        let beside = edges.map(|m| strip.left_m + m).into_iter().chain(edges.map(|m| -strip.right_m - m));
        // Grass is six centimetres below the plane.
        for d_m in beside.chain([0.0, strip.left_m - 0.3, 0.3 - strip.right_m]) {
            let drawn_m = drawn_m(&street, line.to_map(FrenetPoint { s_m: 31.3, d_m }));
            let error_m = drawn_m - road.ground_m(line.to_map(FrenetPoint { s_m: 31.3, d_m }), d_m);
            assert!(error_m.abs() < 0.07, "{} at {d_m}: drawn at {drawn_m}", scenario.name);
        }
        let params = SimParams { dt: Span::from_ms(5), vehicle: VehicleParams::default() };
        for actor in &Simulator::exact(scenario.clone(), &params).unwrap().state().actors {
            let at = actor.pose.point();
            let ground_m = road.ground_m(at, line.project(at).d_m);
            assert_eq!(actor.z_m, ground_m, "{}: actor {}", scenario.name, actor.id.0);
        }
    }
}

#[test]
fn people_on_a_map_stand_on_the_drawn_ground() {
    // The lane is 3.5 m wide, with a pavement of 2 m on the right, then grass.
    let person = |name: &str, s_m: f64, d_m: f64| {
        format!(
            "[[actor]]\nname = {name:?}\nkind = \"pedestrian\"\n\
             start = {{ road = \"4\", lane = -1, s_m = {s_m:?} }}\nd_m = {d_m:?}\n"
        )
    };
    let text = [
        "name = \"people\"\n[map]\nfile = \"crossing.xodr\"\n[ego]\n\
         start = { road = \"4\", lane = -1, s_m = 50.0 }\ngoal = { road = \"2\", lane = 1, s_m = 60.0 }\n"
            .to_owned(),
        person("on the pavement", 80.0, -3.0),
        person("on the road", 90.0, -1.0),
        person("on the grass", 100.0, -6.0),
    ];
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/maps/people.toml");
    let scenario = Scenario::parse(file.to_str().unwrap(), &text.concat()).unwrap();
    let (map, street) =
        (scenario.road.map(), Street::new(&scenario, &Shape::default(), WeatherPreset::default(), 1));
    let params = SimParams { dt: Span::from_ms(5), vehicle: VehicleParams::default() };
    let mut simulator = Simulator::exact(scenario, &params).unwrap();
    for _ in 0..2 {
        let people = &simulator.state().actors;
        assert_eq!(people.iter().map(|person| person.z_m).collect::<Vec<_>>(), [0.12, 0.0, 0.0]);
        for person in people {
            let at = person.pose.point();
            let error_m = drawn_m(&street, at) - person.z_m;
            assert!(error_m.abs() < 0.07, "{}: {error_m}", person.id.0);
            assert!((MapGround::new(&map).height_m(at) - person.z_m).abs() < 1e-6);
        }
        simulator.step(Command::default());
    }
}
