//! Placement of meshes by nodes.

use crate::cube;
use crate::gltf_builder::Builder;
use serde_json::json;

#[test]
fn transforms_of_a_node_and_its_parent_are_composed() {
    // A quarter turn about z maps x to y. It acts after the scale 2, 3, 4 and before the translation.
    let half = 0.5_f64.sqrt();
    let mut builder = Builder::cube();
    builder.add(
        "nodes",
        json!({ "children": [1], "translation": [10, 20, 30], "rotation": [0, 0, half, half] }),
    );
    builder.add("nodes", json!({ "mesh": 0, "name": "cube", "scale": [2, 3, 4], "translation": [1, 0, 0] }));
    builder.add("scenes", json!({ "nodes": [0] }));
    let piece = &builder.read().unwrap().pieces[0];
    let expected = cube::VERTICES.map(|[x, y, z]| [10.0 - 3.0 * y, 21.0 + 2.0 * x, 30.0 + 4.0 * z]);
    for (vertex, expected) in piece.vertices.iter().zip(expected) {
        assert!(vertex.iter().zip(expected).all(|(x, e)| (x - e).abs() <= 4e-6), "{vertex:?} {expected:?}");
    }
    assert_eq!(piece.node.as_deref(), Some("cube"));
    assert!((cube::volume(piece) - 24.0).abs() < 1e-3);
}

#[test]
fn rotation_does_not_scale() {
    let mut builder = Builder::cube();
    builder.add("nodes", json!({ "mesh": 0, "rotation": [0, 0, 3, 3] }));
    let piece = &builder.read().unwrap().pieces[0];
    assert!((cube::volume(piece) - 1.0).abs() < 1e-6);
    builder.json["nodes"][0]["rotation"] = json!([0, 0, 0, 0]);
    assert_eq!(builder.read().unwrap().pieces[0].vertices, cube::VERTICES);
}

#[test]
fn matrix_is_stored_by_columns() {
    let mut builder = Builder::cube();
    builder.add("nodes", json!({ "mesh": 0, "matrix": [2, 0, 0, 0, 0, 0, 2, 0, 0, -2, 0, 0, 1, 2, 3, 1] }));
    let piece = &builder.read().unwrap().pieces[0];
    assert_eq!(piece.vertices, cube::VERTICES.map(|[x, y, z]| [1.0 + 2.0 * x, 2.0 - 2.0 * z, 3.0 + 2.0 * y]));
    assert_eq!(piece.triangles, cube::triangles());
}

#[test]
fn mirror_image_stays_outward() {
    let mut builder = Builder::cube();
    let normals = builder.vectors(5126, &cube::position_bytes(&[[0.0, 3.0, 4.0]; 8]), 8);
    builder.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(normals);
    builder.add("nodes", json!({ "mesh": 0, "scale": [1, 1, -2] }));
    let piece = &builder.read().unwrap().pieces[0];
    assert_eq!(piece.vertices, cube::VERTICES.map(|[x, y, z]| [x, y, -2.0 * z]));
    assert_eq!(piece.triangles, cube::triangles().iter().map(|[a, b, c]| [*a, *c, *b]).collect::<Vec<_>>());
    assert_eq!(cube::volume(piece), 2.0);
    // The normal of the plane 3 y + 4 z = c becomes that of 3 y - 2 z = c.
    let length = 13.0_f64.sqrt();
    assert_eq!(piece.normals, Some(vec![[0.0, (3.0 / length) as f32, (-2.0 / length) as f32]; 8]));
}

#[test]
fn several_nodes_place_one_mesh() {
    let mut builder = Builder::cube();
    for x in 0..3 {
        builder.add("nodes", json!({ "mesh": 0, "name": format!("cube {x}"), "translation": [2 * x, 0, 0] }));
    }
    builder.add("scenes", json!({ "nodes": [0, 1, 2] }));
    let file = builder.read().unwrap();
    assert_eq!(file.pieces.len(), 3);
    assert_eq!(file.pieces[2].vertices[0], [4.0, 0.0, 0.0]);
    assert_eq!(file.bounds(), Some([[0.0; 3], [5.0, 1.0, 1.0]]));
}

#[test]
fn default_scene_is_read_and_otherwise_the_first() {
    let mut builder = Builder::cube();
    builder.add("nodes", json!({ "mesh": 0, "name": "a" }));
    builder.add("nodes", json!({ "mesh": 0, "name": "b" }));
    builder.add("scenes", json!({ "nodes": [0] }));
    builder.add("scenes", json!({ "nodes": [1] }));
    let name = |builder: &Builder| {
        let file = builder.read().unwrap();
        assert_eq!(file.pieces.len(), 1);
        file.pieces[0].node.clone().unwrap()
    };
    assert_eq!(name(&builder), "a");
    builder.json["scene"] = json!(1);
    assert_eq!(name(&builder), "b");
}

#[test]
fn scene_without_meshes_gives_those_of_all_nodes() {
    let mut builder = Builder::cube();
    builder.add("nodes", json!({ "name": "empty" }));
    builder.add("nodes", json!({ "children": [2], "translation": [1, 0, 0] }));
    builder.add("nodes", json!({ "mesh": 0, "name": "cube" }));
    builder.add("scenes", json!({ "nodes": [0] }));
    let file = builder.read().unwrap();
    assert_eq!(file.pieces.len(), 1);
    assert_eq!(file.pieces[0].vertices[0], [1.0, 0.0, 0.0]);
}

#[test]
fn deep_nodes_are_read() {
    let mut builder = Builder::cube();
    for child in 1..100_000 {
        builder.add("nodes", json!({ "children": [child], "translation": [1, 0, 0] }));
    }
    builder.add("nodes", json!({ "mesh": 0 }));
    builder.add("scenes", json!({ "nodes": [0] }));
    assert_eq!(builder.read().unwrap().pieces[0].vertices[0], [99_999.0, 0.0, 0.0]);
}
