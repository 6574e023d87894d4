use std::path::Path;

use swerve_core::Span;
use swerve_geom::{Pose2, Vector2};
use swerve_msg::{ActorId, Extent};
use swerve_scenario::Scenario;
use swerve_scene::SemanticClass;
use swerve_sim::{SimParams, Simulator};
use swerve_vehicle::VehicleParams;

use super::*;

fn scenarios() -> Vec<Scenario> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
    let mut files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files.iter().map(|file| Scenario::read(file).unwrap()).collect()
}

#[test]
fn scenery_stands_off_the_drivable_ground_and_away_from_where_actors_start() {
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
                let off = d_m > scenario.road.left_m || d_m < -scenario.road.right_m;
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
fn actors_are_where_the_world_has_them_and_people_move_their_legs() {
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
