//! The drawn mesh: positions and normals.

use super::shapes::{Shape, cuboid, sphere, torus};
use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};
use palpate_body::*;

fn made(mesh: &ClosedMesh, cells: usize) -> MeshBody {
    CellLattice::fit(mesh, CellSize::Along(cells))
        .unwrap()
        .allow_unconstrained()
        .tissue(&Tissue::default())
        .unwrap()
}

struct Drawn {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
}

fn draw(skin: &mut Skin, nodes: &[DVec3], to_local: &DAffine3) -> Drawn {
    let mut drawn = Drawn {
        positions: vec![[f32::NAN; 3]; skin.vertices()],
        normals: vec![[f32::NAN; 3]; skin.vertices()],
    };
    skin.deform(nodes, to_local, &mut drawn.positions, &mut drawn.normals).unwrap();
    drawn
}

fn at(all: &[[f32; 3]], vertex: usize) -> DVec3 {
    Vec3::from_array(all[vertex]).as_dvec3()
}

fn turn() -> DQuat {
    DQuat::from_euler(glam::EulerRot::XYZ, 0.4, 1.1, -0.7)
}

/// Area-weighted normal at each vertex.
fn normals(shape: &Shape) -> Vec<DVec3> {
    let mut normals = vec![DVec3::ZERO; shape.vertices.len()];
    for t in &shape.triangles {
        let [a, b, c] = t.map(|v| shape.vertices[v]);
        t.iter().for_each(|&v| normals[v] += (b - a).cross(c - a));
    }
    normals.into_iter().map(DVec3::normalize).collect()
}

#[test]
fn affine_node_motion_moves_vertices_and_normals_alike() {
    let stretch =
        DMat3::from_cols(DVec3::new(1.3, 0.1, 0.0), DVec3::new(-0.2, 0.8, 0.05), DVec3::new(0.1, 0.0, 1.1));
    for (shape, cells) in [
        (sphere(0.05, 20), 9),
        (torus(0.05, 0.02, 48, 24).turned(turn()), 14),
        (cuboid(DVec3::new(0.1, 0.1, 0.002), [20, 20, 1]).turned(turn()), 10),
    ] {
        let shape = shape.moved(DVec3::new(2.0, -1.0, 0.5));
        let mesh = shape.close().unwrap();
        let mut body = made(&mesh, cells);
        let center = DVec3::new(2.0, -1.0, 0.5);
        for (linear, by) in [
            (DMat3::IDENTITY, DVec3::ZERO),
            (DMat3::from_quat(turn()), DVec3::splat(0.3)),
            (DMat3::from_quat(turn()) * stretch, DVec3::new(-1.0, 4.0, 0.0)),
        ] {
            let map = |x: DVec3| center + linear * (x - center) + by;
            let nodes: Vec<DVec3> = body.network.rest_m().iter().map(|x| map(*x)).collect();
            let to_local = DAffine3::from_rotation_translation(
                turn().inverse(),
                -turn().inverse().mul_vec3(center + by),
            );
            let drawn = draw(&mut body.skin, &nodes, &to_local);
            let expected = shape.clone().map(|x| to_local.transform_point3(map(x)));
            let normals = normals(&expected);
            for (vertex, (x, normal)) in expected.vertices.iter().zip(&normals).enumerate() {
                let (drawn_x, drawn_normal) = (at(&drawn.positions, vertex), at(&drawn.normals, vertex));
                assert!(drawn_x.distance(*x) < 1e-6 * 0.1, "{drawn_x}, not {x}");
                assert!(drawn_normal.distance(*normal) < 2e-3, "{drawn_normal}, not {normal}");
            }
        }
    }
}

#[test]
fn distant_rigid_motion_keeps_local_precision() {
    let by = DVec3::new(1e6, -3e6, 2e6);
    let shape = sphere(0.05, 12);
    let mesh = shape.clone().moved(by).close().unwrap();
    let mut body = made(&mesh, 8);
    let nodes = body.network.rest_m().to_vec();
    let drawn = draw(&mut body.skin, &nodes, &DAffine3::from_translation(-by));
    for (vertex, x) in shape.vertices.iter().enumerate() {
        assert!(at(&drawn.positions, vertex).distance(*x) < 1e-8);
    }
    // With a distant frame, positions are rounded and normals are not.
    let drawn = draw(&mut body.skin, &nodes, &DAffine3::from_translation(-by + 1e3));
    for (vertex, normal) in normals(&shape).into_iter().enumerate() {
        assert!(at(&drawn.normals, vertex).distance(normal) < 1e-4);
    }
}

#[test]
fn bent_body_is_drawn_at_its_cells() {
    // The touchable surface with all its points has the trilinear weights of the same cells.
    let shape = sphere(0.05, 10);
    let mesh = shape.close().unwrap();
    let lattice = CellLattice::fit(&mesh, CellSize::Along(6))
        .unwrap()
        .allow_unconstrained()
        .touch_spacing(0.0)
        .unwrap();
    let mut body = lattice.tissue(&Tissue::default()).unwrap();
    let bend = |x: DVec3| x + DVec3::new(4.0 * x.z * x.z, 3.0 * x.x * x.y, (40.0 * x.y).sin() * 0.01);
    let nodes: Vec<DVec3> = body.network.rest_m().iter().map(|x| bend(*x)).collect();
    let drawn = draw(&mut body.skin, &nodes, &DAffine3::IDENTITY);
    for (vertex, x) in shape.vertices.iter().enumerate() {
        let point =
            body.surface.points.iter().find(|p| p.of(body.network.rest_m()).distance(*x) < 1e-9).unwrap();
        assert!(at(&drawn.positions, vertex).distance(point.of(&nodes)) < 1e-7);
    }
}

#[test]
fn given_normals_keep_hard_edges_hard() {
    let split = cuboid(DVec3::splat(0.1), [2; 3]).split();
    let faces: Vec<DVec3> = normals(&split);
    let smooth = split.close().unwrap();
    let hard = split.close().unwrap().with_normals(faces.clone()).unwrap();
    let mut drawn = [smooth, hard].map(|mesh| {
        let mut body = made(&mesh, 4);
        let nodes = body.network.rest_m().to_vec();
        (draw(&mut body.skin, &nodes, &DAffine3::IDENTITY), nodes, body)
    });
    for (vertex, x) in split.vertices.iter().enumerate() {
        let [of_smooth, of_hard] = [0, 1].map(|i| at(&drawn[i].0.normals, vertex));
        assert!(of_hard.distance(faces[vertex]) < 1e-6);
        let is_corner = x.abs().min_element() > 0.049;
        // At the corners of a cube one or two triangles of each face meet.
        assert!(!is_corner || of_smooth.abs().min_element() > 0.3, "{of_smooth}");
        assert_eq!(drawn[0].0.positions[vertex], drawn[1].0.positions[vertex]);
    }
    // A mirroring frame keeps normals outward.
    let mirror = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
    let (_, nodes, body) = &mut drawn[1];
    let mirrored = draw(&mut body.skin, nodes, &mirror);
    for vertex in 0..split.vertices.len() {
        assert!(at(&mirrored.normals, vertex).dot(at(&mirrored.positions, vertex)) > 0.0);
    }
}

#[test]
fn inverted_mesh_is_drawn_outward_with_unused_vertices() {
    let mut shape = sphere(0.05, 6).inside_out();
    shape.vertices.push(DVec3::splat(3.0));
    let mesh = shape.close().unwrap();
    let mut body = made(&mesh, 5);
    let nodes = body.network.rest_m().to_vec();
    let drawn = draw(&mut body.skin, &nodes, &DAffine3::IDENTITY);
    for vertex in 0..shape.vertices.len() - 1 {
        assert!(at(&drawn.normals, vertex).dot(at(&drawn.positions, vertex)) > 0.0);
    }
    let loose = shape.vertices.len() - 1;
    assert!(at(&drawn.positions, loose).length() < 0.2 && at(&drawn.normals, loose) == DVec3::Y);
}

#[test]
fn rejects_lists_of_another_length() {
    let mesh = sphere(0.05, 4).close().unwrap();
    let mut body = made(&mesh, 4);
    let nodes = body.network.rest_m().to_vec();
    let vertices = body.skin.vertices();
    let (mut some, mut less) = (vec![[0.0; 3]; vertices], vec![[0.0; 3]; vertices - 1]);
    let same = &DAffine3::IDENTITY;
    assert!(body.skin.deform(&nodes[1..], same, &mut some.clone(), &mut some).is_err());
    assert!(body.skin.deform(&nodes, same, &mut some.clone(), &mut less).is_err());
    assert!(body.skin.deform(&nodes, same, &mut less, &mut some.clone()).is_err());
    assert!(body.skin.deform(&nodes, same, &mut some.clone(), &mut some).is_ok());
}
