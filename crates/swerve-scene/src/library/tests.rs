use super::*;

const KINDS: [Kind; 22] = [
    Kind::Sedan,
    Kind::Hatchback,
    Kind::Suv,
    Kind::Van,
    Kind::BoxTruck,
    Kind::Bus,
    Kind::Motorcycle,
    Kind::Cyclist { phase: 3 },
    Kind::Pedestrian { phase: 5 },
    Kind::Standing,
    Kind::Building,
    Kind::Tree,
    Kind::Bush,
    Kind::StreetLamp,
    Kind::Pole,
    Kind::TrafficLight,
    Kind::StopSign,
    Kind::YieldSign,
    Kind::SpeedSign { kmh: 50 },
    Kind::GuardRail,
    Kind::Bin,
    Kind::Block,
];

#[test]
fn every_kind_fills_its_bounding_box() {
    let mut library = MeshLibrary::default();
    for kind in KINDS {
        for seed in 0..6 {
            let model = library.model(kind, seed);
            let ([x0, y0, z0], [x1, y1, z1]) = library.get(model.mesh).bounds();
            let [length, width, height] = model.size.metres();
            let name =
                format!("{kind:?} seed {seed}: x {x0}..{x1} y {y0}..{y1} z {z0}..{z1} of {:?}", model.size);
            assert!(z0 > -0.02 && z1 < 1.002 * height + 0.05 && z1 > 0.9 * height, "{name}");
            let is_vehicle =
                matches!(kind.class(), SemanticClass::Car | SemanticClass::Truck | SemanticClass::Bus);
            if is_vehicle {
                assert!((x1 - x0 - length).abs() < 0.03 && (y1 - y0 - width).abs() < 0.03, "{name}");
                assert!(x1 <= 0.5 * length + 0.02 && y1 <= 0.5 * width + 0.02 && z0 >= -0.001, "{name}");
            }
            if matches!(kind, Kind::Building | Kind::Tree | Kind::Bush | Kind::Block) {
                assert!(x1 - x0 > 0.8 * length && x1 - x0 < length + 2.2, "{name}");
            }
        }
    }
}

#[test]
fn equal_shapes_share_a_mesh_and_seeds_differ() {
    let mut library = MeshLibrary::default();
    let size = Size::from_m(4.5, 1.8, 1.45);
    let looks: Vec<Model> = (0..30).map(|seed| library.model_sized(Kind::Sedan, size, seed)).collect();
    assert!(library.meshes().len() <= 4);
    assert!(looks.iter().any(|m| m.look != looks[0].look));
    let again = library.model_sized(Kind::Sedan, size, 7);
    assert_eq!(again, looks[7]);
    let version = library.version();
    library.model(Kind::Building, 3);
    assert_ne!(version, library.version());
}

#[test]
fn walk_cycle_moves_limbs_and_keeps_the_feet_on_the_ground() {
    let mut library = MeshLibrary::default();
    let size = Size::from_m(1.0, 0.6, 1.75);
    let mut lowest_and_reach = Vec::new();
    for phase in 0..PHASES {
        let model = library.model_sized(Kind::Pedestrian { phase }, size, 1);
        let (min, max) = library.get(model.mesh).bounds();
        assert!(min[2].abs() < 0.03 && (max[2] - 1.75).abs() < 0.03, "phase {phase}: {min:?} {max:?}");
        lowest_and_reach.push(max[0] - min[0]);
    }
    let widest = lowest_and_reach.iter().copied().fold(0.0, f32::max);
    let narrowest = lowest_and_reach.iter().copied().fold(9.0, f32::min);
    assert!(widest > 0.7 && narrowest < 0.6, "{lowest_and_reach:?}");
}

#[test]
fn phases_follow_the_distance() {
    assert_eq!(walk_phase(0.0, 1.7), 0);
    assert_eq!(walk_phase(0.82 * 1.7 * 0.5 + 1e-6, 1.7), PHASES / 2);
    assert_eq!(walk_phase(f64::NAN, 1.7), 0);
    assert!((0..100).all(|k| walk_phase(f64::from(k) * 0.37 - 10.0, 1.6) < PHASES));
}

#[test]
fn road_is_flat_and_has_the_width_of_its_layout() {
    use swerve_geom::Point2;
    let centre = (0..=20).map(|k| Point2::new(5.0 * f64::from(k), 0.02 * f64::from(k * k))).collect();
    let pieces = road_pieces(&RoadLayout::street(centre, 6.0, 2.0), 1);
    assert_eq!(pieces.len(), 3);
    for piece in &pieces {
        assert_eq!(piece.class, SemanticClass::Road);
        for (triangle, material) in piece.mesh.triangles().iter().zip(piece.mesh.triangle_materials()) {
            let material = piece.mesh.materials()[usize::from(*material)];
            for corner in triangle {
                let [_, y, z] = piece.mesh.positions()[*corner as usize];
                let reach = 6.0 + 0.16 + 2.5 + 0.1 + 8.0;
                assert!(y.abs() < reach && (-0.06..0.2).contains(&z));
                if material.class.is_none() {
                    assert!(z < 0.02, "the carriageway is flat");
                }
            }
        }
        let upward = piece.mesh.normals().iter().filter(|n| n[2] > 0.9).count();
        assert!(2 * upward > piece.mesh.normals().len());
    }
    assert!(road_pieces(&RoadLayout::street(vec![Point2::new(0.0, 0.0)], 6.0, 2.0), 1).is_empty());
}
