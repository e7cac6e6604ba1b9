//! A body that rests on an obstacle: the local model against the oracle.

use glam::DVec3;
use palpate_body::*;
use palpate_local::Scheme;
use palpate_reduce::*;
use palpate_tests_without_bevy::samples;
use std::f64::consts::TAU;

const NEAR: Scheme = Scheme::NearFieldExact;

/// A block on the plane z = 0 under gravity, at rest.
fn resting_block(nodes: [usize; 3], size_m: DVec3, obstacle: Obstacle) -> Body {
    let made = Block::new(nodes, size_m).unwrap().allow_unconstrained().tissue(&Tissue::default()).unwrap();
    let made = made.placed(glam::DQuat::IDENTITY, DVec3::Z * 0.5 * size_m.z).unwrap();
    at_rest(Body::new(made.network, made.surface).unwrap(), obstacle)
}

/// The body after it has settled on the obstacle.
fn at_rest(mut body: Body, obstacle: Obstacle) -> Body {
    body.set_gravity(-9.81 * DVec3::Z).unwrap();
    body.set_obstacles(vec![obstacle]);
    for _ in 0..200 {
        body.advance(None, 50, SemiImplicitEuler::default()).unwrap();
        if body.is_settled() {
            break;
        }
    }
    assert!(body.is_settled());
    body
}

/// The tool presses 5 mm deep once a second. A local model arrives 40 ms after its model step.
fn errors(body: &Body, place_m: DVec3) -> [f64; 2] {
    let points =
        body.surface().vertices.iter().map(|&point| body.surface().points[point].of(body.positions_m()));
    let top_m = points.map(|x| x.z).fold(f64::MIN, f64::max);
    let contact = ToolContact::touch(ToolShape::Sphere { radius_m: 0.005 }, 0.3).unwrap();
    let path = samples(1500, |t| {
        let above_m = 0.004 - 0.009 * (1.0 - (TAU * t).cos()) / 2.0;
        place_m + DVec3::Z * (top_m + 0.005 + above_m)
    });
    let options = ComparisonOptions { delay_ticks: 40, ..ComparisonOptions::default() };
    let found = Comparison::run(body, &contact, &path, &[Scheme::Hold, NEAR], &options).unwrap();
    [Scheme::Hold, NEAR].map(|scheme| found.relative_rms_error(scheme, 200).unwrap())
}

#[test]
fn resting_block_matches_the_oracle_within_one_per_cent() {
    let plane = |friction| Obstacle::plane(DVec3::ZERO, DVec3::Z, friction).unwrap();
    let cube = ([6, 6, 6], DVec3::splat(0.1));
    let slab = ([8, 8, 4], DVec3::new(0.14, 0.14, 0.06));
    // The lower nodes of the sheet are within reach of the tool.
    let sheet = ([6, 6, 2], DVec3::new(0.1, 0.1, 0.02));
    for ((nodes, size_m), friction) in
        [(cube, 0.5), (cube, 0.0), (slab, 0.5), (slab, 0.0), (sheet, 0.5), (sheet, 0.0)]
    {
        let body = resting_block(nodes, size_m, plane(friction));
        for place_m in [DVec3::ZERO, DVec3::new(0.3 * size_m.x, 0.2 * size_m.y, 0.0)] {
            let [hold, near] = errors(&body, place_m);
            // Measured: at most 0.5 %. Without the table in the local model 6 % on the cube and 37 % on the sheet.
            assert!(
                near < 0.01 && hold > 0.3,
                "{nodes:?}, friction {friction}, at {place_m}: {near}, {hold}"
            );
        }
    }
}

/// The contact points of a mesh lie within its cells, between eight nodes.
#[test]
fn resting_mesh_matches_the_oracle_as_a_fixed_one() {
    let half_m = DVec3::new(0.05, 0.045, 0.03);
    let corners =
        (0..8).map(|c| half_m * DVec3::from_array([0, 1, 2].map(|axis| f64::from((c >> axis & 1) * 2 - 1))));
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let mesh = ClosedMesh::new(corners.collect(), triangles).unwrap();
    // The lowest cells are partly filled.
    let lattice = CellLattice::fit(&mesh, CellSize::Side(0.012)).unwrap().allow_unconstrained();
    let made = lattice.tissue(&Tissue::default()).unwrap();
    let made = made.placed(glam::DQuat::IDENTITY, DVec3::Z * half_m.z).unwrap();
    let plane = Obstacle::plane(DVec3::ZERO, DVec3::Z, 0.5).unwrap();
    let body = at_rest(Body::new(made.network, made.surface).unwrap(), plane);
    for place_m in [DVec3::new(0.001, 0.002, 0.0), DVec3::new(0.03, -0.02, 0.0)] {
        let [hold, near] = errors(&body, place_m);
        // Measured: 2.2 and 1.4 %; with the bottom fixed instead, 1.9 and 1.3 %.
        assert!(near < 0.025 && hold > 0.3, "at {place_m}: {near}, {hold}");
    }
}

/// A slab of a hundred times the mass of the block, carried against the weight of both, gives way slowly.
#[test]
fn block_on_a_heavy_rigid_body_matches_the_oracle() {
    let half_m = DVec3::new(0.1, 0.1, 0.02);
    let mass = RigidMass::of_cuboid(100.0, half_m).unwrap();
    let carried = RigidMotion { acceleration_m_per_s2: 9.81 / 100.0 * DVec3::Z, ..RigidMotion::default() };
    let slab = Obstacle::cuboid(half_m, 0.5)
        .unwrap()
        .with_pose(-half_m.z * DVec3::Z, glam::DQuat::IDENTITY)
        .unwrap()
        .with_mass(mass, carried)
        .unwrap();
    let body = resting_block([6, 6, 6], DVec3::splat(0.1), slab);
    let [hold, near] = errors(&body, DVec3::ZERO);
    assert!(near < 0.01 && hold > 0.3, "{near}, {hold}");
}
