//! Shapes of obstacles: exact distances and normals, also where they are not unique, and rejected input.

use glam::{DMat3, DQuat, DVec3};
use palpate_body::*;
use proptest::prelude::*;

/// Corners and triangles of a box around the origin, counter-clockwise as seen from outside.
fn box_mesh(half: DVec3) -> (Vec<DVec3>, Vec<[usize; 3]>) {
    let sign = |i: usize, bit: usize| if i & bit > 0 { 1.0 } else { -1.0 };
    let corners = (0..8).map(|i| half * DVec3::new(sign(i, 1), sign(i, 2), sign(i, 4))).collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    (corners, quads.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect())
}

fn boxes(half: DVec3) -> [Obstacle; 3] {
    let (corners, triangles) = box_mesh(half);
    [
        Obstacle::cuboid(half, 0.3).unwrap(),
        Obstacle::convex_hull(&corners, 0.3).unwrap(),
        Obstacle::triangle_mesh(&corners, &triangles, 0.3).unwrap(),
    ]
}

fn vector(size: f64) -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(-size..size).prop_map(DVec3::from_array)
}

fn rotation() -> impl Strategy<Value = DQuat> {
    vector(3.0).prop_map(DQuat::from_scaled_axis)
}

#[test]
fn gap_and_normal_match_closed_forms() {
    let capsule = Obstacle::capsule(0.1, 0.05, 0.3).unwrap();
    let close = |(gap, normal): (f64, DVec3), expected: (f64, DVec3)| {
        assert!(
            (gap - expected.0).abs() < 1e-15 && normal.distance(expected.1) < 1e-15,
            "{gap} {normal}, {expected:?}"
        );
    };
    close(capsule.gap_m(DVec3::new(0.2, 0.04, 0.0)), (0.15, DVec3::X));
    close(capsule.gap_m(DVec3::new(0.0, -0.4, 0.0)), (0.25, -DVec3::Y));
    close(capsule.gap_m(DVec3::new(0.0, 0.07, 0.01)), (-0.04, DVec3::Z));
    for of in boxes(DVec3::new(0.1, 0.2, 0.3)) {
        close(of.gap_m(DVec3::new(0.4, 0.0, 0.1)), (0.3, DVec3::X));
        close(of.gap_m(DVec3::new(0.04, 0.19, 0.1)), (-0.01, DVec3::Y));
        close(of.gap_m(DVec3::new(0.13, 0.0, -0.34)), (0.05, DVec3::new(0.6, 0.0, -0.8)));
        close(of.gap_m(DVec3::new(0.2, 0.4, 0.5)), (0.3, DVec3::new(1.0, 2.0, 2.0) / 3.0));
    }
    // A tilted plane through its position.
    let slope = Obstacle::plane(DVec3::ZERO, DVec3::Z, 0.0).unwrap();
    let slope = slope.with_pose(DVec3::X, DQuat::from_rotation_y(0.3)).unwrap();
    close(slope.gap_m(DVec3::X + DVec3::Z), (0.3_f64.cos(), DVec3::new(0.3_f64.sin(), 0.0, 0.3_f64.cos())));
}

#[test]
fn normal_is_a_unit_vector_at_symmetric_places() {
    let half = DVec3::new(0.1, 0.1, 0.1);
    let mut all = boxes(half).to_vec();
    all.push(Obstacle::sphere(DVec3::ZERO, 0.1, 0.3).unwrap());
    all.push(Obstacle::capsule(0.05, 0.05, 0.3).unwrap());
    all.push(Obstacle::capsule(0.0, 0.1, 0.3).unwrap());
    all.push(Obstacle::plane(DVec3::ZERO, DVec3::Z, 0.3).unwrap());
    all.push(Obstacle::triangle_mesh(&[DVec3::ZERO, DVec3::X, DVec3::Y], &[[0, 1, 2]], 0.3).unwrap());
    let levels = [-0.1, -1e-17, 0.0, 1e-300, 0.05, 0.1, 0.1 + 1e-17, 0.100_000_000_000_01];
    for of in all {
        for x in levels {
            for y in levels {
                for z in levels {
                    let (gap, normal) = of.gap_m(DVec3::new(x, y, z));
                    assert!(
                        gap.is_finite() && (normal.length() - 1.0).abs() < 1e-12,
                        "{gap} {normal} at {x} {y} {z}, {of:?}"
                    );
                }
            }
        }
    }
    for of in boxes(half) {
        // On an edge and in a corner: the mean of the faces.
        let (gap, normal) = of.gap_m(DVec3::new(0.1, 0.1, 0.0));
        assert!(
            gap.abs() < 1e-13 && normal.distance(DVec3::new(1.0, 1.0, 0.0).normalize()) < 1e-9,
            "{gap} {normal}"
        );
        let (gap, normal) = of.gap_m(half);
        assert!(gap.abs() < 1e-13 && normal.distance(DVec3::ONE.normalize()) < 1e-9, "{gap} {normal}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn box_hull_and_mesh_agree(
        half in prop::array::uniform3(0.01..0.5f64), at in vector(1.0), position in vector(2.0), turn in rotation(),
    ) {
        let placed = boxes(DVec3::from_array(half)).map(|of| of.with_pose(position, turn).unwrap());
        let x = position + turn * at;
        let (gap, normal) = placed[0].gap_m(x);
        // The way out has the length of the gap.
        prop_assert!(placed[0].gap_m(x - gap * normal).0.abs() < 1e-12);
        for of in &placed[1..] {
            let (other, other_normal) = of.gap_m(x);
            prop_assert!((gap - other).abs() < 1e-12, "{} {}", gap, other);
            prop_assert!(of.gap_m(x - other * other_normal).0.abs() < 1e-12);
        }
    }

    #[test]
    fn hull_of_random_points_contains_them(points in prop::collection::vec(vector(1.0), 4..40), x in vector(1.5)) {
        let hull = Obstacle::convex_hull(&points, 0.0).unwrap();
        for point in &points {
            prop_assert!(hull.gap_m(*point).0 < 1e-12, "{:?}", hull.gap_m(*point));
        }
        // The nearest point is on the surface, and no point of the hull lies beyond the plane through it.
        let (gap, normal) = hull.gap_m(x);
        let on = x - gap * normal;
        prop_assert!(hull.gap_m(on).0.abs() < 1e-12);
        prop_assert!(points.iter().all(|point| (*point - on).dot(normal) < 1e-9));
    }
}

#[test]
fn open_mesh_is_a_shell_behind_its_triangles() {
    let corners = [DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
    let sheet = Obstacle::triangle_mesh(&corners, &[[0, 1, 2], [0, 2, 3]], 0.3).unwrap();
    let sheet = sheet.with_thickness(0.1).unwrap();
    assert_eq!(sheet.thickness_m(), Some(0.1));
    assert_eq!(sheet.gap_m(DVec3::new(0.5, 0.5, 0.2)), (0.2, DVec3::Z));
    assert_eq!(sheet.gap_m(DVec3::new(0.5, 0.2, -0.04)), (-0.04, DVec3::Z));
    // Behind the shell.
    let (gap, normal) = sheet.gap_m(DVec3::new(0.5, 0.2, -0.3));
    assert!((gap - 0.2).abs() < 1e-15 && normal == -DVec3::Z);
    // Beside its border.
    let (gap, normal) = sheet.gap_m(DVec3::new(1.03, 0.5, -0.04));
    assert!((gap - 0.05).abs() < 1e-15 && normal.distance(DVec3::new(0.6, 0.0, -0.8)) < 1e-12);
    // A solid has no thickness.
    assert!(Obstacle::cuboid(DVec3::ONE, 0.0).unwrap().with_thickness(0.1).is_err());
}

#[test]
fn closed_mesh_that_faces_inward_is_turned() {
    let (corners, mut triangles) = box_mesh(DVec3::ONE);
    triangles.iter_mut().for_each(|t| t.swap(0, 1));
    // Every triangle with vertices of its own, as for flat shading.
    let apart: Vec<DVec3> = triangles.iter().flatten().map(|&vertex| corners[vertex]).collect();
    let own: Vec<[usize; 3]> = (0..triangles.len()).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let solid = Obstacle::triangle_mesh(&apart, &own, 0.3).unwrap();
    assert_eq!(solid.thickness_m(), None);
    for x in [DVec3::new(0.9, 0.2, 0.1), DVec3::new(1.3, 1.4, 0.1), DVec3::new(0.3, 0.2, -2.0)] {
        let expected = Obstacle::cuboid(DVec3::ONE, 0.3).unwrap().gap_m(x);
        let found = solid.gap_m(x);
        assert!(
            (found.0 - expected.0).abs() < 1e-12 && found.1.distance(expected.1) < 1e-12,
            "{found:?} {expected:?}"
        );
    }
}

#[test]
fn rejects_invalid_shapes() {
    let is_parameter =
        |of: Result<Obstacle, BodyError>| assert!(matches!(of, Err(BodyError::Parameter { .. })), "{of:?}");
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        is_parameter(Obstacle::cuboid(DVec3::new(1.0, bad, 1.0), 0.1));
        is_parameter(Obstacle::capsule(0.1, bad, 0.1));
        let turned = DQuat::from_xyzw(0.0, 0.0, 1.0, bad);
        is_parameter(
            Obstacle::cuboid(DVec3::ONE, 0.0)
                .unwrap()
                .with_pose(DVec3::X * bad, if bad == 0.0 { turned * 2.0 } else { turned }),
        );
        assert!(
            RigidMass::of_sphere(bad, 1.0).is_err() && RigidMass::of_cuboid(1.0, DVec3::splat(bad)).is_err()
        );
        assert!(RigidMass::new(1.0, DVec3::ZERO, DMat3::from_diagonal(DVec3::new(1.0, bad, 1.0))).is_err());
    }
    is_parameter(Obstacle::capsule(-1e-3, 0.1, 0.1));
    is_parameter(Obstacle::cuboid(DVec3::ONE, -0.1));
    let (corners, triangles) = box_mesh(DVec3::ONE);
    is_parameter(Obstacle::convex_hull(&[], 0.1));
    is_parameter(Obstacle::convex_hull(&[DVec3::X; 9], 0.1));
    is_parameter(Obstacle::convex_hull(&[DVec3::ZERO, DVec3::X, 2.0 * DVec3::X, 3.0 * DVec3::X], 0.1));
    is_parameter(Obstacle::convex_hull(&corners[..4], 0.1));
    is_parameter(Obstacle::convex_hull(&[DVec3::NAN, DVec3::X, DVec3::Y, DVec3::Z], 0.1));
    is_parameter(Obstacle::triangle_mesh(&corners, &[], 0.1));
    is_parameter(Obstacle::triangle_mesh(&corners, &[[0, 1, 8]], 0.1));
    is_parameter(Obstacle::triangle_mesh(&corners, &[[0, 1, 1], [2, 2, 2]], 0.1));
    is_parameter(Obstacle::triangle_mesh(&[DVec3::ZERO, DVec3::X, DVec3::X * 2.0], &[[0, 1, 2]], 0.1));
    // Coincident points and degenerate triangles among others are allowed.
    let twice: Vec<DVec3> = corners.iter().chain(&corners).copied().collect();
    assert!((Obstacle::convex_hull(&twice, 0.1).unwrap().gap_m(DVec3::ZERO).0 + 1.0).abs() < 1e-15);
    let more: Vec<[usize; 3]> = triangles.iter().copied().chain([[3, 3, 3], [0, 1, 0]]).collect();
    assert!((Obstacle::triangle_mesh(&twice, &more, 0.1).unwrap().gap_m(DVec3::ZERO).0 + 1.0).abs() < 1e-15);
    // An inertia tensor that is not symmetric.
    let skew = DMat3::from_cols(DVec3::new(1.0, 0.1, 0.0), DVec3::Y, DVec3::Z);
    assert!(RigidMass::new(1.0, DVec3::ZERO, skew).is_err());
    let motion = RigidMotion { velocity_m_per_s: DVec3::NAN, ..RigidMotion::default() };
    let mass = RigidMass::of_sphere(1.0, 1.0).unwrap();
    is_parameter(Obstacle::sphere(DVec3::ZERO, 1.0, 0.0).unwrap().with_mass(mass, motion));
}
