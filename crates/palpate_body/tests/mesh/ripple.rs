//! Forces on a surface that is extracted from a mesh which is not closed, against those on the closed mesh of the same shape.

use super::enclosed::{enclose, opened};
use super::shapes::{Shape, cuboid, sphere};
use glam::{DQuat, DVec3};
use palpate_body::*;

/// Oblique to the size of the shapes: the surface lies anywhere in its cells.
const CELL: f64 = 0.0103;
const E_PA: f64 = 20e3;

/// The body of `shape` with the nodes below `held_m` fixed; heights are those before `turn`.
fn body_of(shape: &Shape, turn: DQuat, held_m: f64) -> (Body, ClosedMesh) {
    let shape = shape.clone().turned(turn);
    let mesh = ClosedMesh::enclose(shape.vertices, shape.triangles, None).unwrap();
    let held = Region::HalfSpace { point_m: turn * (held_m * DVec3::Z), outward: turn * DVec3::Z };
    let lattice = CellLattice::fit(&mesh, CellSize::Side(CELL)).unwrap().fix(held);
    let made = lattice.tissue(&Tissue { youngs_modulus_pa: E_PA, ..Tissue::default() }).unwrap();
    (Body::new(made.network, made.surface).unwrap(), mesh)
}

/// Force of a ball that is pressed at `at_m` against the outward `normal`, at rest, N.
pub fn press(body: &Body, radius_m: f64, (at_m, normal): (DVec3, DVec3), depth_m: f64) -> f64 {
    let (mut body, mut force_n) = (body.clone(), 0.0);
    let mut tool = ToolContact::touch(ToolShape::Sphere { radius_m }, 0.0).unwrap();
    let at = |sunk: f64| ToolPoint::at_rest(at_m + normal * (radius_m + 3e-4 - (depth_m + 3e-4) * sunk));
    let step = |ticks_per_step| LinearlyImplicitEuler { ticks_per_step, ..LinearlyImplicitEuler::default() };
    let down: Vec<ToolPoint> = (0..=40).map(|i| at(f64::from(i) / 40.0)).collect();
    body.advance(Some((&mut tool, &down)), 40, step(4)).unwrap();
    let stay = vec![at(1.0); 41];
    for _ in 0..50 {
        let report = body.advance(Some((&mut tool, &stay)), 40, step(40)).unwrap();
        assert_eq!((report.unconverged, report.left_out), (0, 0));
        let now_n = tool.displayed_force_n(&body).dot(normal);
        if (now_n - force_n).abs() < 1e-5 * now_n {
            break;
        }
        force_n = now_n;
    }
    let is_one_patch =
        tool.touched().iter().all(|touched| touched.patch.foot == tool.touched()[0].patch.foot);
    assert!(is_one_patch, "a smooth surface is touched in one patch");
    force_n
}

/// (max − min) / mean.
pub fn ripple(forces: &[f64]) -> f64 {
    let (low, high) = forces.iter().fold((f64::INFINITY, 0.0_f64), |(l, h), f| (l.min(*f), h.max(*f)));
    (high - low) * forces.len() as f64 / forces.iter().sum::<f64>()
}

/// Size of the boxes.
const BOX: DVec3 = DVec3::new(0.08, 0.07, 0.045);

/// A box of two that overlap by 13 mm. The narrower one passes through the wall of the other.
fn crossing_boxes() -> Shape {
    let left = cuboid(DVec3 { x: 0.047, ..BOX }, [1; 3]).moved(-0.0165 * DVec3::X);
    left.and(&cuboid(DVec3 { x: 0.046, y: 0.068, ..BOX }, [1; 3]).moved(0.017 * DVec3::X))
}

/// Every triangle by itself, with its corners moved by up to 1.7e-5 of the size.
fn cracked(shape: &Shape, by_m: f64) -> Shape {
    let mut random = 12_345_u64;
    let mut next = || {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (random >> 33) as f64 / (1_u64 << 30) as f64 - 1.0
    };
    let mut cracked = shape.split();
    cracked.vertices.iter_mut().for_each(|x| *x += by_m * DVec3::new(next(), next(), next()));
    cracked
}

#[test]
fn flat_extracted_surface_has_the_ripple_of_a_block() {
    let fine = cuboid(BOX, [16, 14, 9]);
    let open = opened(fine.clone(), |x| x.z < -0.0224);
    let oblique = DQuat::from_euler(glam::EulerRot::XYZ, 0.4, 0.7, -0.3);
    for (turn, shape) in [(DQuat::IDENTITY, crossing_boxes()), (oblique, open)] {
        let (closed, mesh) = body_of(&fine, turn, -0.0164);
        assert_eq!(mesh.assumptions(), None);
        let (extracted, mesh) = body_of(&shape, turn, -0.0164);
        assert!(mesh.assumptions().is_some());
        for (radius, depth, most) in [(0.5, 0.2, 0.005), (1.0, 0.4, 0.015)] {
            let [expected, found] = [&closed, &extracted].map(|body| {
                [(-0.0077, 0.0024), (-0.0005, 0.0067), (0.0066, 0.0011)].map(|(x, y)| {
                    let place = (turn * DVec3::new(x, y, 0.5 * BOX.z), turn * DVec3::Z);
                    press(body, radius * CELL, place, depth * CELL)
                })
            });
            let text = format!("{radius} cells, {turn}: {expected:?}, {found:?}");
            assert!(ripple(&expected) < most && ripple(&found) < most, "{text}");
            let mean = found.iter().sum::<f64>() / expected.iter().sum::<f64>();
            assert!((mean - 1.0).abs() < 0.5 * most, "{text}");
        }
    }
}

#[test]
fn ball_of_crossing_halves_has_the_force_of_the_ball() {
    let half = |shape: Shape, low: f64, high: f64| shape.map(|x| DVec3 { x: x.x.clamp(low, high), ..x });
    let closed = sphere(0.05, 24);
    let turned = sphere(0.05, 24).turned(DQuat::from_rotation_x(0.35));
    let crossing = half(closed.clone(), -1.0, 0.004).and(&half(turned, -0.004, 1.0));
    let of = |shape: &Shape| {
        let (body, mesh) = body_of(shape, DQuat::IDENTITY, -0.015);
        let forces = [-0.32, -0.1, 0.04, 0.27].map(|angle| {
            let normal = DQuat::from_rotation_y(angle) * DQuat::from_rotation_x(-0.07) * DVec3::Z;
            press(&body, CELL, (0.05 * normal, normal), 0.4 * CELL)
        });
        (body, mesh, forces)
    };
    let (_, mesh, expected) = of(&closed);
    assert_eq!(mesh.assumptions(), None);
    let (body, mesh, found) = of(&crossing);
    assert!(mesh.assumptions().unwrap().crossing_count > 0);
    // The points lie on the triangles, which are up to 2.7e-4 m below the sphere in the middle.
    for point in &body.surface().points {
        let below_m = 0.05 - point.of(body.network().rest_m()).length();
        assert!((-1e-9..3e-4).contains(&below_m), "{below_m} m");
    }
    for (found, expected) in found.iter().zip(expected) {
        assert!((found / expected - 1.0).abs() < 0.02, "{found} N, {expected} N");
    }
    let mean = found.iter().sum::<f64>() / expected.iter().sum::<f64>();
    assert!((mean - 1.0).abs() < 0.01, "{mean}");
    assert!(ripple(&found) < ripple(&expected) + 0.015, "{found:?}, {expected:?}");
}

#[test]
fn cracks_are_closed_exactly() {
    let ball = sphere(0.05, 16);
    let mesh = enclose(&cracked(&ball, 1e-6));
    assert_eq!(mesh.assumptions(), None);
    let points = mesh.vertices_m().len() - mesh.repairs().welded;
    assert_eq!(points, ball.vertices.len());
    assert!((mesh.volume_m3() / ball.volume() - 1.0).abs() < 1e-4);
    // With a hole besides the cracks only the hole is closed by a cap.
    let open = opened(ball, |x| x.z > 0.045);
    let found = enclose(&cracked(&open, 1e-6)).assumptions().unwrap();
    let expected = enclose(&open).assumptions().unwrap();
    assert_eq!((found.hole_count, found.open_edge_count), (1, expected.open_edge_count));
    // Cracks of 1/1000 of the size are not closed. A triangle by itself has no orientation, and keeps its winding.
    let torn = enclose(&cracked(&cuboid(BOX, [1; 3]), 1e-4));
    assert_eq!(torn.assumptions().unwrap().reoriented_part_count, 0);
    let volume = BOX.element_product();
    assert!((torn.volume_m3() / volume - 1.0).abs() < 0.02, "{} m³", torn.volume_m3());
}
