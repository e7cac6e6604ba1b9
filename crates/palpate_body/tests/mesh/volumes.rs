//! Volume and mass of meshes with a known volume, in any direction.

use super::shapes::{Shape, cuboid, sphere, torus};
use glam::{DQuat, DVec3, EulerRot};
use palpate_body::{CellLattice, CellSize, ClosedMesh, Tissue};

const TURNS: [[f64; 3]; 3] = [[0.0; 3], [0.4, 1.1, -0.7], [0.0, 0.0, std::f64::consts::FRAC_PI_4]];

/// Asserts that volume and mass of `shape` are within `share` of those of `volume_m3`, however it is turned.
fn check(shape: &Shape, volume_m3: f64, share: f64) {
    for [x, y, z] in TURNS {
        let Shape { vertices, triangles } = shape.clone().turned(DQuat::from_euler(EulerRot::XYZ, x, y, z));
        let mesh = ClosedMesh::enclose(vertices, triangles, None).unwrap();
        assert!(
            (mesh.volume_m3() / volume_m3 - 1.0).abs() < share,
            "{} m³ instead of {volume_m3}",
            mesh.volume_m3()
        );
        let made = CellLattice::fit(&mesh, CellSize::Along(9))
            .unwrap()
            .allow_unconstrained()
            .tissue(&Tissue::default());
        let made = made.unwrap();
        let mass_kg: f64 = made.network.mass_kg().iter().sum();
        let expected_kg = 1000.0 * volume_m3 * (1.0 + made.cells.raised_share);
        assert!((mass_kg / expected_kg - 1.0).abs() < share, "{mass_kg} kg instead of {expected_kg}");
    }
}

#[test]
fn closed_meshes_have_their_exact_volume() {
    for shape in [
        cuboid(DVec3::new(0.1, 0.04, 0.07), [2; 3]),
        // A plate of which 32 cells along its longest side see less than one layer.
        cuboid(DVec3::new(0.21, 0.005, 0.13), [4; 3]),
        sphere(0.05, 16),
        torus(0.05, 0.012, 32, 16),
    ] {
        check(&shape, shape.volume(), 1e-6);
    }
    // A tube with a wall.
    let tube = cuboid(DVec3::new(0.02, 0.15, 0.02), [2; 3]);
    let lumen = cuboid(DVec3::new(0.012, 0.14, 0.012), [2; 3]);
    check(&tube.clone().and(&lumen.clone().inside_out()), tube.volume() - lumen.volume(), 1e-6);
}

#[test]
fn crossing_parts_have_the_volume_of_their_union() {
    let block = cuboid(DVec3::splat(0.1), [3; 3]);
    // Two blocks have a block of 4 × 7 × 8 cm in common.
    check(
        &block.clone().and(&block.clone().moved(DVec3::new(0.06, 0.03, 0.02))),
        2e-3 - 0.04 * 0.07 * 0.08,
        5e-3,
    );
    // Half of a ball is in the block, and its plane of symmetry on a side of the block.
    let ball = sphere(0.04, 32);
    let half = ball.moved(DVec3::new(0.0, 0.0, 0.05));
    check(&block.clone().and(&half), 1e-3 + 0.5 * half.volume(), 5e-3);
    // A post through a plate, both much smaller than the bounds: their edges are as sharp as the samples are apart.
    let plate = cuboid(DVec3::new(0.2, 0.02, 0.03), [3; 3]);
    let post = cuboid(DVec3::new(0.02, 0.09, 0.02), [3; 3]);
    check(&plate.and(&post.moved(DVec3::X * 0.03)), 0.2 * 0.02 * 0.03 + 0.02 * 0.07 * 0.02, 1e-2);
    // A row of parts, two of which cross.
    let row = (0..5).fold(Shape::default(), |row, i| {
        row.and(&cuboid(DVec3::splat(0.02), [2; 3]).moved(DVec3::X * 0.03 * f64::from(i)))
    });
    let row = row.and(&cuboid(DVec3::splat(0.02), [2; 3]).moved(DVec3::new(0.005, 0.01, 0.005)));
    check(&row, 6.0 * 8e-6 - 0.015 * 0.01 * 0.015, 2e-2);
}
