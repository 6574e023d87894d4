use super::*;

fn triangle() -> MeshParts {
    MeshParts {
        positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]],
        normals: vec![[0.0, 0.0, 1.0]; 3],
        uvs: vec![[0.0; 2]; 3],
        triangles: vec![[0, 1, 2]],
        triangle_materials: vec![0],
        materials: vec![Material::default()],
    }
}

#[test]
fn inconsistent_arrays_are_refused() {
    let refused = |change: fn(&mut MeshParts)| {
        let mut parts = triangle();
        change(&mut parts);
        Mesh::new(parts).unwrap_err()
    };
    assert!(matches!(refused(|p| p.uvs.clear()), MeshError::Vertices { uvs: 0, .. }));
    assert!(matches!(refused(|p| p.triangle_materials.clear()), MeshError::Triangles { materials: 0, .. }));
    assert_eq!(refused(|p| p.triangles[0][2] = 3), MeshError::Index { triangle: 0 });
    assert_eq!(refused(|p| p.triangle_materials[0] = 1), MeshError::Index { triangle: 0 });
    assert_eq!(refused(|p| p.positions[1][1] = f32::NAN), MeshError::NotFinite { vertex: 1 });
}

#[test]
fn bounds_contain_all_vertices() {
    let mesh = Mesh::new(triangle()).unwrap();
    assert_eq!(mesh.bounds(), ([0.0; 3], [1.0, 2.0, 0.0]));
    let (centre, radius) = mesh.sphere();
    assert_eq!(centre, [0.5, 1.0, 0.0]);
    assert!((radius - 1.25f32.sqrt()).abs() < 1e-6);
}

#[test]
fn shapes_are_closed_and_face_outwards() {
    let mut builder = MeshBuilder::new(40.0);
    let material = builder.material(Material::default());
    builder.cuboid(material, [-1.0, -0.5, 0.0], [1.0, 0.5, 2.0]);
    builder.place = Placed::along([4.0, 0.0, 0.0], [0.0, 1.0, 1.0]);
    builder.cone(material, (0.0, 0.5), (2.0, 0.25), 12, true);
    builder.place = Placed::turned([0.0, 6.0, 0.0], 0.7);
    builder.ball(material, [0.5, 0.7, 0.9], 12, 8, |_, _| 1.0);
    builder.limb(material, ([3.0, 0.0, 0.0], 0.2), ([3.0, 1.0, 1.0], 0.1), 8);
    let mesh = builder.finish();
    // By the divergence theorem, six times the volume is the sum of the triangles' triple products, which for a closed
    // surface does not depend on the origin.
    let volume = |origin: [f32; 3]| {
        mesh.triangles()
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|k| crate::vector::sub(mesh.positions()[k as usize], origin));
                crate::vector::dot(a, crate::vector::cross(b, c)) / 6.0
            })
            .sum::<f32>()
    };
    let (here, there) = (volume([0.0; 3]), volume([5.0, -3.0, 2.0]));
    assert!((here - there).abs() < 1e-3 * here, "{here} {there}");
    // Box 4, cone about 0.9, ball about 1.2, limb about 0.1.
    assert!((5.8..6.5).contains(&here), "{here}");
    assert!(mesh.normals().iter().all(|n| (crate::vector::dot(*n, *n) - 1.0).abs() < 1e-4));
}
