//! What is taken for a closed mesh, what is put right, and what is refused with what words.

use crate::shapes::{Shape, cube, cuboid, sphere, torus};
use glam::{DQuat, DVec3};
use palpate_body::{ClosedMesh, MeshError, MeshRepairs};
use proptest::prelude::*;
use std::f64::consts::PI;

fn refused(shape: &Shape) -> MeshError {
    shape.close().map(|mesh| mesh.volume_m3()).unwrap_err()
}

#[test]
fn volumes_are_those_of_geometry() {
    let volume = |shape: Shape| shape.close().unwrap().volume_m3();
    assert!((volume(cube(0.1)) - 1e-3).abs() < 1e-17);
    // The facets of a sphere and a torus cut off shares of order 1/n².
    assert!((volume(sphere(0.05, 32)) / (4.0 / 3.0 * PI * 0.05_f64.powi(3)) - 1.0).abs() < 2e-3);
    assert!((volume(torus(0.05, 0.02, 96, 48)) / (2.0 * PI * PI * 0.05 * 0.02 * 0.02) - 1.0).abs() < 5e-3);
    let hollow = cube(0.1).and(&cube(0.06).inside_out());
    assert!((volume(hollow) - (1e-3 - 0.216e-3)).abs() < 1e-16);
}

#[test]
fn places_in_a_sphere_and_a_torus_are_told_from_places_outside() {
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.4, 1.1, -0.7);
    for (shape, depth) in [
        (sphere(0.05, 24), (|x| 0.05 - x.length()) as fn(DVec3) -> f64),
        (torus(0.05, 0.02, 64, 32), |x| 0.02 - (x.truncate().length() - 0.05).hypot(x.z)),
    ] {
        for (turn, by) in [(DQuat::IDENTITY, DVec3::ZERO), (turn, DVec3::new(3.0, -2.0, 900.0))] {
            let mesh = shape.clone().turned(turn).moved(by).close().unwrap();
            let mut asked = [0, 0];
            for i in 0..20_000_u32 {
                // R. Roberts' sequence fills space evenly.
                let share = DVec3::new(0.819_172_5, 0.671_043_6, 0.549_700_5) * f64::from(i);
                let place = (share.fract() - 0.5) * 0.15;
                let deep = depth(place);
                // Facets lie up to 2e-4 m inside the surface.
                if deep.abs() > 2e-4 {
                    assert_eq!(mesh.contains(turn * place + by), deep > 0.0, "{place}, {deep} m deep");
                    asked[usize::from(deep > 0.0)] += 1;
                }
            }
            assert!(asked[0] > 2000 && asked[1] > 2000, "{asked:?}");
        }
    }
}

#[test]
fn rays_through_corners_and_edges_are_no_trouble() {
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
fn split_vertices_are_welded_and_remembered() {
    let split = sphere(0.05, 6).split();
    let mesh = split.close().unwrap();
    assert_eq!(mesh.repairs(), MeshRepairs { welded: 3 * 432 - 218, ..MeshRepairs::default() });
    assert_eq!(mesh.triangles(), split.triangles);
    assert_eq!(mesh.vertices_m(), split.vertices);
    // As far apart as rounding of single-precision numbers puts them.
    let mut noise = 1_u32;
    let noisy = split.clone().map(|x| x.as_vec3().as_dvec3()).vertices.into_iter().map(|x| {
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        x + DVec3::X * (f64::from(noise >> 16) / 65536.0 - 0.5) * 1e-8
    });
    let mesh = ClosedMesh::new(noisy.collect(), split.triangles.clone()).unwrap();
    assert_eq!(mesh.repairs().welded, 3 * 432 - 218);
}

#[test]
fn triangles_that_are_nothing_or_too_much_are_left_out() {
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
fn windings_are_made_to_agree_and_to_look_outward() {
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
fn parts_may_lie_beside_each_other_and_cavities_within() {
    let three =
        cube(0.1).and(&sphere(0.02, 6).moved(DVec3::X * 0.2)).and(&cube(0.1).moved(DVec3::Y * 0.1000));
    let mesh = three.split().close().unwrap();
    assert_eq!(mesh.parts(), 2);
    // A cavity with a stone in it, all of it inside out.
    let nested = cube(0.1).and(&cube(0.06).inside_out()).and(&cube(0.02)).inside_out();
    let mesh = nested.close().unwrap();
    assert_eq!((mesh.parts(), mesh.repairs().turned), (3, 36));
    assert!((mesh.volume_m3() - (1.0 - 0.216 + 0.008) * 1e-3).abs() < 1e-16);
    for (x, inside) in [(0.005, true), (0.02, false), (0.04, true), (0.06, false)] {
        assert_eq!(mesh.contains(DVec3::new(x, 1e-3, 2e-3)), inside, "{x}");
    }
    // Without an opposite winding it is no cavity.
    let full = cube(0.1).and(&cube(0.06));
    assert!(
        matches!(refused(&full), MeshError::Nested { at_m } if (at_m.abs().max_element() - 0.03).abs() < 1e-6)
    );
    // Turned boxes that touch face to face are no trouble, and neither is within the other.
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 0.5, 0.7);
    let stacked =
        cuboid(DVec3::splat(0.1), [2; 3]).and(&cuboid(DVec3::splat(0.1), [3; 3]).moved(DVec3::X * 0.1));
    let mesh = stacked.turned(turn).close().unwrap();
    assert_eq!((mesh.parts(), mesh.repairs().turned), (2, 0));
    assert!((mesh.volume_m3() - 2e-3).abs() < 1e-15);
}

#[test]
fn an_edge_shared_by_two_cubes_is_taken_as_it_is_if_it_closes() {
    let mut two = cube(0.1).and(&cube(0.1).moved(DVec3::new(0.1, 0.1, 0.0)));
    let mesh = two.close().unwrap();
    assert_eq!(mesh.repairs().pinched_edges, 1);
    assert!((mesh.volume_m3() - 2e-3).abs() < 1e-16);
    two.triangles[0].swap(1, 2);
    assert!(
        matches!(refused(&two), MeshError::NonManifold { edges: 1, at_m } if at_m.distance(DVec3::new(0.05, 0.05, 0.0)) < 1e-6)
    );
}

#[test]
fn what_is_open_flat_or_no_surface_is_refused_with_the_place() {
    let mut open = sphere(0.05, 8);
    open.triangles.remove(17);
    assert!(
        matches!(refused(&open), MeshError::Holes { edges: 3, at_m } if (at_m.length() - 0.05).abs() < 1e-3)
    );
    let mut wall = cube(0.1);
    wall.triangles.push([0, 1, 7]);
    let found = refused(&wall);
    assert!(matches!(found, MeshError::NonManifold { .. } | MeshError::Holes { .. }), "{found}");
    let sheet = Shape {
        vertices: vec![DVec3::ZERO, DVec3::X * 0.1, DVec3::Y * 0.1, DVec3::new(0.1, 0.1, 0.0)],
        triangles: vec![[0, 1, 2], [1, 3, 2]],
    };
    assert!(matches!(refused(&sheet), MeshError::Holes { edges: 4, .. }));
    // Both sides of a sheet, sharing their vertices or not, and a box pressed flat.
    assert!(matches!(refused(&sheet.clone().and(&sheet.inside_out())), MeshError::Flat { .. }));
    let pressed = cuboid(DVec3::new(0.1, 0.1, 1e-9), [3; 3]);
    assert!(matches!(refused(&pressed), MeshError::Flat { .. }), "{}", refused(&pressed));
    let thin = cuboid(DVec3::new(0.1, 0.1, 2e-6), [3; 3]);
    assert!((thin.close().unwrap().volume_m3() - 2e-8).abs() < 1e-20);
}

/// A Klein bottle has no inside; in space it passes through itself besides.
#[test]
fn a_klein_bottle_has_one_side_only() {
    let (n, m) = (24, 12);
    let mut shape = Shape::default();
    for (i, j) in (0..n).flat_map(|i| (0..m).map(move |j| (i, j))) {
        let (u, v) = (f64::from(i) / f64::from(n) * 2.0 * PI, (f64::from(j) + 0.5) / f64::from(m) * 2.0 * PI);
        let r = 0.03 + 0.01 * ((u / 2.0).cos() * v.sin() - (u / 2.0).sin() * (2.0 * v).sin());
        let z = 0.01 * ((u / 2.0).sin() * v.sin() + (u / 2.0).cos() * (2.0 * v).sin());
        shape.vertices.push(DVec3::new(r * u.cos(), r * u.sin(), z));
        // Once round, the tube comes back mirrored.
        let at = |i: i32, j: i32| {
            let j = if i == n { -1 - j } else { j };
            (i % n * m + j.rem_euclid(m)) as usize
        };
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        shape.triangles.extend([[a, b, c], [a, c, d]]);
    }
    assert!(matches!(refused(&shape), MeshError::OneSided { .. }), "{}", refused(&shape));
}

#[test]
fn parts_that_cross_are_refused_and_parts_that_touch_are_not() {
    let two = sphere(0.05, 10).and(&cube(0.04).moved(DVec3::X * 0.05));
    let MeshError::Crossing { pairs, at_m } = refused(&two) else { panic!("{}", refused(&two)) };
    assert!(pairs > 8 && (at_m.length() - 0.05).abs() < 1e-3, "{pairs} {at_m}");
    // Aligned so that edges meet edges.
    let aligned = cube(0.1).and(&cube(0.1).moved(DVec3::splat(0.05)));
    assert!(matches!(refused(&aligned), MeshError::Crossing { .. }), "{}", refused(&aligned));
    // One surface that passes through itself: a figure of eight swept round.
    let eight = torus(0.06, 0.02, 32, 24).map(|x| {
        let from_axis = x.truncate().length();
        let (out, up) = ((from_axis - 0.06) / 0.02, x.z / 0.02);
        let around = up.atan2(out);
        let bent = 0.06 + 0.02 * (2.0 * around).sin();
        DVec3::new(x.x / from_axis * bent, x.y / from_axis * bent, 0.03 * around.sin())
    });
    let found = refused(&eight);
    assert!(matches!(found, MeshError::Crossing { .. } | MeshError::Flat { .. }), "{found}");
}

#[test]
fn units_that_are_not_metres_are_asked_about() {
    for (size, factor) in [(120.0, 1e-3), (12.0, 1e-3), (0.0005, 1e3), (1e-9, 1e8), (1e7, 1e-8)] {
        let MeshError::Size { size_m, factor: said } = refused(&cube(size)) else {
            panic!("{}", refused(&cube(size)))
        };
        assert!((size_m / size - 1.0).abs() < 1e-9 && (said / factor - 1.0).abs() < 1e-9, "{size}: {said}");
        let scaled = cube(size).map(|x| x * said);
        assert!(scaled.close().is_ok());
    }
    let text = refused(&cube(120.0)).to_string();
    assert!(text.contains("120 m") && text.contains("0.001"), "{text}");
    assert!(cube(0.001).close().is_ok() && cube(10.0).close().is_ok());
}

#[test]
fn a_mesh_far_away_is_the_same_mesh_while_its_numbers_last() {
    let by = DVec3::new(1e6, -2e6, 3e6);
    let far = sphere(0.05, 12).moved(by);
    let mesh = far.close().unwrap();
    assert!((mesh.volume_m3() / sphere(0.05, 12).volume() - 1.0).abs() < 1e-6);
    assert!(mesh.contains(by) && !mesh.contains(by + 0.06 * DVec3::Z) && !mesh.contains(DVec3::ZERO));
    // The same in single precision: 0.06 to 0.25 m from one number to the next.
    let lost = far.map(|x| x.as_vec3().as_dvec3());
    let error = refused(&lost);
    assert!(
        matches!(error, MeshError::LostDigits { distance_m, grid_m } if distance_m > 2.9e6 && grid_m > 0.1),
        "{error}"
    );
    // Whole numbers are the same in single precision; nothing is lost.
    let whole = cube(4.0).moved(DVec3::splat(1e6)).close().unwrap();
    assert!((whole.volume_m3() - 64.0).abs() < 1e-9);
}

#[test]
fn lists_that_make_no_sense_are_refused() {
    let cube = cube(0.1);
    assert_eq!(ClosedMesh::new(Vec::new(), Vec::new()).unwrap_err(), MeshError::Empty);
    assert_eq!(ClosedMesh::new(cube.vertices.clone(), Vec::new()).unwrap_err(), MeshError::Empty);
    let beyond = ClosedMesh::new(cube.vertices.clone(), vec![[0, 1, 2], [0, 8, 1]]).unwrap_err();
    assert_eq!(beyond, MeshError::Index { triangle: 1, vertex: 8, vertices: 8 });
    for bad in [f64::NAN, f64::INFINITY, -1e300] {
        let mut shape = cube.clone();
        shape.vertices[3].y = bad;
        assert_eq!(refused(&shape), MeshError::NotFinite { vertex: 3 });
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
    assert!(matches!(refused(&one), MeshError::Flat { .. }));
    // Vertices that no triangle has do not count.
    let mut loose = cube.clone();
    loose.vertices.push(DVec3::splat(5e3));
    assert!((loose.close().unwrap().volume_m3() - 1e-3).abs() < 1e-17);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_place_is_inside_a_turned_box_when_it_is(
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
