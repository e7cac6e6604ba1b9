//! Closed meshes: accepted, repaired and rejected ones.

use super::shapes::{Shape, cube, cuboid, sphere, torus};
use glam::{DQuat, DVec3};
use palpate_body::{ClosedMesh, MeshError, MeshRepairs};
use proptest::prelude::*;
use std::f64::consts::PI;

fn rejected(shape: &Shape) -> MeshError {
    shape.close().map(|mesh| mesh.volume_m3()).unwrap_err()
}

#[test]
fn volumes_match_closed_forms() {
    let volume = |shape: Shape| shape.close().unwrap().volume_m3();
    assert!((volume(cube(0.1)) - 1e-3).abs() < 1e-17);
    // The facets of a sphere and a torus cut off shares of order 1/n².
    assert!((volume(sphere(0.05, 32)) / (4.0 / 3.0 * PI * 0.05_f64.powi(3)) - 1.0).abs() < 2e-3);
    assert!((volume(torus(0.05, 0.02, 96, 48)) / (2.0 * PI * PI * 0.05 * 0.02 * 0.02) - 1.0).abs() < 5e-3);
    let hollow = cube(0.1).and(&cube(0.06).inside_out());
    assert!((volume(hollow) - (1e-3 - 0.216e-3)).abs() < 1e-16);
}

#[test]
fn contains_matches_sphere_and_torus() {
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.4, 1.1, -0.7);
    for (shape, depth) in [
        (sphere(0.05, 24), (|x| 0.05 - x.length()) as fn(DVec3) -> f64),
        (torus(0.05, 0.02, 64, 32), |x| 0.02 - (x.truncate().length() - 0.05).hypot(x.z)),
    ] {
        for (turn, by) in [(DQuat::IDENTITY, DVec3::ZERO), (turn, DVec3::new(3.0, -2.0, 900.0))] {
            let mesh = shape.clone().turned(turn).moved(by).close().unwrap();
            let mut counts = [0, 0];
            for i in 0..20_000_u32 {
                // R. Roberts' low-discrepancy sequence fills space evenly.
                let share = DVec3::new(0.819_172_5, 0.671_043_6, 0.549_700_5) * f64::from(i);
                let place = (share.fract() - 0.5) * 0.15;
                let deep = depth(place);
                // Facets lie up to 2e-4 m inside the surface.
                if deep.abs() > 2e-4 {
                    assert_eq!(mesh.contains(turn * place + by), deep > 0.0, "{place}, {deep} m deep");
                    counts[usize::from(deep > 0.0)] += 1;
                }
            }
            assert!(counts[0] > 2000 && counts[1] > 2000, "{counts:?}");
        }
    }
}

#[test]
fn contains_is_exact_for_rays_through_corners_and_edges() {
    let mesh = cuboid(DVec3::splat(0.2), [4; 3]).close().unwrap();
    for (i, j, k) in (-4..=4).flat_map(|i| (-4..=4).flat_map(move |j| (-4..=4).map(move |k| (i, j, k)))) {
        let place = DVec3::new(f64::from(i), f64::from(j), f64::from(k)) * 0.05 / 2.0;
        if place.abs().max_element() < 0.0999 {
            assert!(mesh.contains(place), "{place}");
        }
    }
    for place in [DVec3::splat(0.1001), DVec3::NAN, DVec3::INFINITY, DVec3::new(-1e300, 0.0, 0.0)] {
        assert!(!mesh.contains(place));
    }
}

#[test]
fn split_vertices_are_welded_and_stay_addressable() {
    let split = sphere(0.05, 6).split();
    let mesh = split.close().unwrap();
    assert_eq!(mesh.repairs(), MeshRepairs { welded: 3 * 432 - 218, ..MeshRepairs::default() });
    assert_eq!(mesh.triangles(), split.triangles);
    assert_eq!(mesh.vertices_m(), split.vertices);
    // As far apart as single-precision rounding puts them.
    let mut noise = 1_u32;
    let noisy = split.clone().map(|x| x.as_vec3().as_dvec3()).vertices.into_iter().map(|x| {
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        x + DVec3::X * (f64::from(noise >> 16) / 65536.0 - 0.5) * 1e-8
    });
    let mesh = ClosedMesh::new(noisy.collect(), split.triangles.clone()).unwrap();
    assert_eq!(mesh.repairs().welded, 3 * 432 - 218);
}

#[test]
fn degenerate_repeated_and_opposite_triangles_are_omitted() {
    let mut shape = cube(0.1);
    shape.triangles.push([0, 0, 1]);
    shape.triangles.push(shape.triangles[3]);
    let [a, b, c] = shape.triangles[5];
    shape.triangles.push([b, c, a]);
    let mesh = shape.close().unwrap();
    assert_eq!(mesh.repairs(), MeshRepairs { collapsed: 1, duplicates: 2, ..MeshRepairs::default() });
    assert!((mesh.volume_m3() - 1e-3).abs() < 1e-17);
    // Two cubes that share a wall, each with its own face there.
    let two = cube(0.1).and(&cube(0.1).moved(DVec3::X * 0.1));
    let mesh = two.close().unwrap();
    assert_eq!(mesh.repairs(), MeshRepairs { welded: 4, back_to_back: 4, ..MeshRepairs::default() });
    assert!((mesh.volume_m3() - 2e-3).abs() < 1e-16 && mesh.contains(DVec3::X * 0.05));
    // Every triangle in both windings.
    let both = sphere(0.05, 5).and(&sphere(0.05, 5).inside_out());
    let mesh = both.close().unwrap();
    assert_eq!(mesh.repairs().duplicates, 300);
    assert!((mesh.volume_m3() - sphere(0.05, 5).volume()).abs() < 1e-16);
}

#[test]
fn windings_become_consistent_and_outward() {
    let good = torus(0.05, 0.02, 20, 10);
    let turned = good.clone().inside_out().close().unwrap();
    assert_eq!(turned.repairs().turned, 400);
    assert_eq!(turned.volume_m3(), good.close().unwrap().volume_m3());
    let mut mixed = good.clone();
    mixed.triangles.iter_mut().step_by(3).for_each(|t| t.swap(1, 2));
    let mixed = mixed.close().unwrap();
    assert_eq!(mixed.repairs().turned, 134);
    assert!((mixed.volume_m3() - good.volume()).abs() < 1e-16);
    let drawn = Shape { vertices: mixed.vertices_m().to_vec(), triangles: mixed.triangles().to_vec() };
    assert!((drawn.volume() - good.volume()).abs() < 1e-16);
}

#[test]
fn accepts_separate_parts_and_cavities() {
    let three =
        cube(0.1).and(&sphere(0.02, 6).moved(DVec3::X * 0.2)).and(&cube(0.1).moved(DVec3::Y * 0.1000));
    let mesh = three.split().close().unwrap();
    assert_eq!(mesh.parts(), 2);
    // A cavity that contains a stone, all inverted.
    let nested = cube(0.1).and(&cube(0.06).inside_out()).and(&cube(0.02)).inside_out();
    let mesh = nested.close().unwrap();
    assert_eq!((mesh.parts(), mesh.repairs().turned), (3, 36));
    assert!((mesh.volume_m3() - (1.0 - 0.216 + 0.008) * 1e-3).abs() < 1e-16);
    for (x, inside) in [(0.005, true), (0.02, false), (0.04, true), (0.06, false)] {
        assert_eq!(mesh.contains(DVec3::new(x, 1e-3, 2e-3)), inside, "{x}");
    }
    // With the same winding it is no cavity.
    let full = cube(0.1).and(&cube(0.06));
    assert!(
        matches!(rejected(&full), MeshError::Nested { at_m } if (at_m.abs().max_element() - 0.03).abs() < 1e-6)
    );
    // Rotated boxes that touch face to face are accepted, and neither is inside the other.
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 0.5, 0.7);
    let stacked =
        cuboid(DVec3::splat(0.1), [2; 3]).and(&cuboid(DVec3::splat(0.1), [3; 3]).moved(DVec3::X * 0.1));
    let mesh = stacked.turned(turn).close().unwrap();
    assert_eq!((mesh.parts(), mesh.repairs().turned), (2, 0));
    assert!((mesh.volume_m3() - 2e-3).abs() < 1e-15);
}

#[test]
fn accepts_an_edge_shared_by_two_cubes() {
    let mut two = cube(0.1).and(&cube(0.1).moved(DVec3::new(0.1, 0.1, 0.0)));
    let mesh = two.close().unwrap();
    assert_eq!(mesh.repairs().pinched_edges, 1);
    assert!((mesh.volume_m3() - 2e-3).abs() < 1e-16);
    two.triangles[0].swap(1, 2);
    assert!(
        matches!(rejected(&two), MeshError::NonManifold { edges: 1, at_m } if at_m.distance(DVec3::new(0.05, 0.05, 0.0)) < 1e-6)
    );
}

#[test]
fn parts_that_touch_along_an_edge_are_oriented_separately() {
    let beside = || cube(0.1).moved(DVec3::new(0.1, 0.1, 0.0));
    for mesh in [
        cube(0.1).and(&beside()),
        cube(0.1).inside_out().and(&beside()),
        cube(0.1).and(&beside().inside_out()),
        cube(0.1).inside_out().and(&beside().inside_out()),
    ] {
        let mesh = mesh.close().unwrap();
        assert!((mesh.volume_m3() - 2e-3).abs() < 1e-15, "{}", mesh.volume_m3());
        let [in_one, in_other] = [DVec3::splat(0.04), DVec3::new(0.06, 0.06, 0.0)];
        assert!(mesh.contains(in_one) && mesh.contains(in_other));
    }
}

#[test]
fn rejects_open_flat_and_non_manifold_meshes_with_the_position() {
    let mut open = sphere(0.05, 8);
    open.triangles.remove(17);
    assert!(
        matches!(rejected(&open), MeshError::Holes { edges: 3, at_m } if (at_m.length() - 0.05).abs() < 1e-3)
    );
    let mut wall = cube(0.1);
    wall.triangles.push([0, 1, 7]);
    let found = rejected(&wall);
    assert!(matches!(found, MeshError::NonManifold { .. } | MeshError::Holes { .. }), "{found}");
    let sheet = Shape {
        vertices: vec![DVec3::ZERO, DVec3::X * 0.1, DVec3::Y * 0.1, DVec3::new(0.1, 0.1, 0.0)],
        triangles: vec![[0, 1, 2], [1, 3, 2]],
    };
    assert!(matches!(rejected(&sheet), MeshError::Holes { edges: 4, .. }));
    // Both sides of a sheet, with or without shared vertices, and a flattened box.
    assert!(matches!(rejected(&sheet.clone().and(&sheet.inside_out())), MeshError::Flat { .. }));
    let pressed = cuboid(DVec3::new(0.1, 0.1, 1e-9), [3; 3]);
    assert!(matches!(rejected(&pressed), MeshError::Flat { .. }), "{}", rejected(&pressed));
    let thin = cuboid(DVec3::new(0.1, 0.1, 2e-6), [3; 3]);
    assert!((thin.close().unwrap().volume_m3() - 2e-8).abs() < 1e-20);
}

/// A Klein bottle has no inside, and intersects itself in space.
#[test]
fn rejects_a_klein_bottle() {
    let (n, m) = (24, 12);
    let mut shape = Shape::default();
    for (i, j) in (0..n).flat_map(|i| (0..m).map(move |j| (i, j))) {
        let (u, v) = (f64::from(i) / f64::from(n) * 2.0 * PI, (f64::from(j) + 0.5) / f64::from(m) * 2.0 * PI);
        let r = 0.03 + 0.01 * ((u / 2.0).cos() * v.sin() - (u / 2.0).sin() * (2.0 * v).sin());
        let z = 0.01 * ((u / 2.0).sin() * v.sin() + (u / 2.0).cos() * (2.0 * v).sin());
        shape.vertices.push(DVec3::new(r * u.cos(), r * u.sin(), z));
        // After one turn the tube comes back mirrored.
        let at = |i: i32, j: i32| {
            let j = if i == n { -1 - j } else { j };
            (i % n * m + j.rem_euclid(m)) as usize
        };
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        shape.triangles.extend([[a, b, c], [a, c, d]]);
    }
    assert!(matches!(rejected(&shape), MeshError::OneSided { .. }), "{}", rejected(&shape));
}

#[test]
fn rejects_intersecting_parts_and_accepts_touching_ones() {
    let two = sphere(0.05, 10).and(&cube(0.04).moved(DVec3::X * 0.05));
    let MeshError::Crossing { pairs, at_m } = rejected(&two) else { panic!("{}", rejected(&two)) };
    assert!(pairs > 8 && (at_m.length() - 0.05).abs() < 1e-3, "{pairs} {at_m}");
    // Aligned so that edges meet edges.
    let aligned = cube(0.1).and(&cube(0.1).moved(DVec3::splat(0.05)));
    assert!(matches!(rejected(&aligned), MeshError::Crossing { .. }), "{}", rejected(&aligned));
    // A single surface that intersects itself: a figure of eight swept around an axis.
    let eight = |around| {
        torus(0.06, 0.02, 32, around).map(|x| {
            let from_axis = x.truncate().length();
            let (out, up) = ((from_axis - 0.06) / 0.02, x.z / 0.02);
            let around = up.atan2(out);
            let bent = 0.06 + 0.02 * (2.0 * around).sin();
            DVec3::new(x.x / from_axis * bent, x.y / from_axis * bent, 0.03 * around.sin())
        })
    };
    let found = rejected(&eight(25));
    assert!(matches!(found, MeshError::Crossing { .. } | MeshError::Flat { .. }), "{found}");
    // With vertices where it does, its halves touch along a circle. Each has the cross-section 4/3 · 0.02 m · 0.03 m.
    let volume_m3 = eight(48).close().unwrap().volume_m3();
    assert!((volume_m3 / (2.0 * 8e-4 * 2.0 * PI * 0.06) - 1.0).abs() < 0.02, "{volume_m3}");
}

#[test]
fn rejects_meshes_outside_the_size_range_with_a_scale_factor() {
    for (size, factor) in [(120.0, 1e-3), (12.0, 1e-2), (0.0005, 1e3), (1e-9, 1e8), (1e7, 1e-8)] {
        let MeshError::Size { size_m, factor: advised } = rejected(&cube(size)) else {
            panic!("{}", rejected(&cube(size)))
        };
        assert!(
            (size_m / size - 1.0).abs() < 1e-9 && (advised / factor - 1.0).abs() < 1e-9,
            "{size}: {advised}"
        );
        let scaled = cube(size).map(|x| x * advised);
        assert!(scaled.close().is_ok());
    }
    let text = rejected(&cube(120.0)).to_string();
    assert!(text.contains("120 m") && text.contains("0.001"), "{text}");
    assert!(cube(0.001).close().is_ok() && cube(10.0).close().is_ok());
}

#[test]
fn distant_mesh_is_accepted_while_its_digits_suffice() {
    let by = DVec3::new(1e6, -2e6, 3e6);
    let far = sphere(0.05, 12).moved(by);
    let mesh = far.close().unwrap();
    assert!((mesh.volume_m3() / sphere(0.05, 12).volume() - 1.0).abs() < 1e-6);
    assert!(mesh.contains(by) && !mesh.contains(by + 0.06 * DVec3::Z) && !mesh.contains(DVec3::ZERO));
    // The same in single precision, whose spacing is 0.06 to 0.25 m there.
    let lost = far.map(|x| x.as_vec3().as_dvec3());
    let error = rejected(&lost);
    assert!(
        matches!(error, MeshError::LostDigits { distance_m, grid_m } if distance_m > 2.9e6 && grid_m > 0.1),
        "{error}"
    );
    // Integers are exact in single precision.
    let whole = cube(4.0).moved(DVec3::splat(1e6)).close().unwrap();
    assert!((whole.volume_m3() - 64.0).abs() < 1e-9);
}

#[test]
fn rejects_invalid_lists() {
    let cube = cube(0.1);
    assert_eq!(ClosedMesh::new(Vec::new(), Vec::new()).unwrap_err(), MeshError::Empty);
    assert_eq!(ClosedMesh::new(cube.vertices.clone(), Vec::new()).unwrap_err(), MeshError::Empty);
    let beyond = ClosedMesh::new(cube.vertices.clone(), vec![[0, 1, 2], [0, 8, 1]]).unwrap_err();
    assert_eq!(beyond, MeshError::Index { triangle: 1, vertex: 8, vertices: 8 });
    for bad in [f64::NAN, f64::INFINITY, -1e300] {
        let mut shape = cube.clone();
        shape.vertices[3].y = bad;
        assert_eq!(rejected(&shape), MeshError::NotFinite { vertex: 3 });
    }
    let many = vec![[0, 1, 2]; ClosedMesh::MAX_TRIANGLES + 1];
    assert!(matches!(
        ClosedMesh::new(cube.vertices.clone(), many).unwrap_err(),
        MeshError::TooLarge { what: "triangles", .. }
    ));
    let mesh = cube.close().unwrap();
    let few = mesh.with_normals(vec![DVec3::X; 7]).unwrap_err();
    assert_eq!(few, MeshError::Length { what: "the list of normals", found: 7, vertices: 8 });
    let one = Shape { vertices: vec![DVec3::ONE; 3], triangles: vec![[0, 1, 2]] };
    assert!(matches!(rejected(&one), MeshError::Flat { .. }));
    // Vertices without triangles do not count.
    let mut loose = cube.clone();
    loose.vertices.push(DVec3::splat(5e3));
    assert!((loose.close().unwrap().volume_m3() - 1e-3).abs() < 1e-17);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn contains_matches_a_rotated_box(
        angles in prop::array::uniform3(-3.0..3.0f64),
        places in prop::collection::vec(prop::array::uniform3(-0.06..0.06f64), 50),
    ) {
        let turn = DQuat::from_euler(glam::EulerRot::XYZ, angles[0], angles[1], angles[2]);
        let half = DVec3::new(0.05, 0.03, 0.04);
        let mesh = cuboid(2.0 * half, [2, 3, 4]).turned(turn).close().unwrap();
        prop_assert!((mesh.volume_m3() / (8.0 * half.element_product()) - 1.0).abs() < 1e-12);
        for place in places.into_iter().map(DVec3::from_array) {
            let out = (place.abs() - half).max_element();
            prop_assert_eq!(mesh.contains(turn * place), out < 0.0, "{} m outside", out);
        }
    }
}
