//! Selection of pieces.

use crate::gltf_builder::Builder;
use palpate_files::{MeshFileError, MeshSelection};
use serde_json::json;

#[test]
fn pieces_are_selected_by_mesh_and_by_node() {
    let mut builder = Builder::cube();
    builder.json["materials"] = json!([{ "name": "skin" }]);
    let two = json!({ "attributes": { "POSITION": 0 }, "indices": 1, "material": 0 });
    builder.add("meshes", json!({ "primitives": [two, two] }));
    builder.add("nodes", json!({ "mesh": 0, "name": "left" }));
    builder.add("nodes", json!({ "mesh": 1, "name": "right" }));
    builder.add("nodes", json!({ "mesh": 1 }));
    let file = builder.read().unwrap();
    let places = |pieces: Vec<&palpate_files::MeshPiece>| {
        pieces.iter().map(|piece| (piece.mesh, piece.primitive)).collect::<Vec<_>>()
    };
    assert_eq!(places(file.of_mesh(0).collect()), [(0, 0)]);
    assert_eq!(places(file.of_mesh(1).collect()), [(1, 0), (1, 1), (1, 0), (1, 1)]);
    assert_eq!(places(file.of_node("right").collect()), [(1, 0), (1, 1)]);
    assert_eq!(file.of_node("middle").count(), 0);
    assert_eq!(file.pieces[1].material.as_deref(), Some("skin"));
    assert_eq!(file.triangle_count(), 60);
    let selected = |mesh, node| file.select(&MeshSelection::new(mesh, node)).map(places);
    assert_eq!(selected(None, None).unwrap().len(), 5);
    assert_eq!(selected(Some(0), None).unwrap(), [(0, 0)]);
    assert_eq!(selected(None, Some("right")).unwrap(), [(1, 0), (1, 1)]);
    for (mesh, node, expected) in
        [(Some(2), None, "mesh 2"), (None, Some("middle"), "a node with the name middle")]
    {
        let error = selected(mesh, node).unwrap_err();
        assert!(
            matches!(&error, MeshFileError::NothingSelected { selection } if selection == expected),
            "{error}"
        );
    }
    assert_eq!(
        file.pieces[1].to_string(),
        "mesh 1 primitive 0  node right  mesh name -  material skin  12 triangles"
    );
}
