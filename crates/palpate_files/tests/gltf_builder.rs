//! Small glTF files, built part by part.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use palpate_files::{MeshFile, MeshFileError, MeshFormat};
use serde_json::{Value, json};

use crate::cube;

/// A glTF file with one buffer.
pub struct Builder {
    pub json: Value,
    pub binary: Vec<u8>,
}

impl Builder {
    pub fn new() -> Self {
        let json = json!({
            "asset": { "version": "2.0" },
            "accessors": [], "bufferViews": [], "meshes": [], "nodes": [], "scenes": [],
        });
        Self { json, binary: Vec::new() }
    }

    /// The cube as mesh 0, without nodes: positions are accessor 0, indices accessor 1.
    pub fn cube() -> Self {
        let mut builder = Self::new();
        let positions = builder.vectors(5126, &cube::position_bytes(&cube::VERTICES), 8);
        let corners: Vec<u8> =
            cube::triangles().iter().flatten().flat_map(|corner| (*corner as u16).to_le_bytes()).collect();
        let indices = builder.indices(5123, &corners, 36);
        builder.mesh(json!({ "attributes": { "POSITION": positions }, "indices": indices }));
        builder
    }

    /// Adds `value` to the list `list`, and returns its index.
    pub fn add(&mut self, list: &str, value: Value) -> usize {
        let list = self.json[list].as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    pub fn view(&mut self, bytes: &[u8]) -> usize {
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        let offset = self.binary.len();
        self.binary.extend_from_slice(bytes);
        self.add("bufferViews", json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len() }))
    }

    /// An accessor of vectors of the component type `code`.
    pub fn vectors(&mut self, code: u32, bytes: &[u8], count: usize) -> usize {
        let view = self.view(bytes);
        let accessor = json!({ "bufferView": view, "componentType": code, "count": count, "type": "VEC3" });
        self.add("accessors", accessor)
    }

    pub fn indices(&mut self, code: u32, bytes: &[u8], count: usize) -> usize {
        let view = self.view(bytes);
        let accessor = json!({ "bufferView": view, "componentType": code, "count": count, "type": "SCALAR" });
        self.add("accessors", accessor)
    }

    /// A mesh of one primitive.
    pub fn mesh(&mut self, primitive: Value) -> usize {
        self.add("meshes", json!({ "name": "mesh", "primitives": [primitive] }))
    }

    pub fn glb(&self) -> Vec<u8> {
        let mut document = self.json.clone();
        let mut buffers = vec![json!({ "byteLength": self.binary.len() })];
        buffers.extend(document["buffers"].as_array().cloned().unwrap_or_default());
        document["buffers"] = Value::Array(buffers);
        let mut json = document.to_string().into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        let mut binary = self.binary.clone();
        binary.resize(binary.len().next_multiple_of(4), 0);
        let number = |number: usize| u32::try_from(number).unwrap().to_le_bytes();
        let parts: [&[u8]; 9] = [
            b"glTF",
            &number(2),
            &number(28 + json.len() + binary.len()),
            &number(json.len()),
            b"JSON",
            &json,
            &number(binary.len()),
            b"BIN\0",
            &binary,
        ];
        parts.concat()
    }

    /// JSON whose buffer is at `uri`.
    pub fn gltf(&self, uri: &str) -> Vec<u8> {
        let mut document = self.json.clone();
        document["buffers"] = json!([{ "byteLength": self.binary.len(), "uri": uri }]);
        document.to_string().into_bytes()
    }

    pub fn gltf_with_data(&self) -> Vec<u8> {
        self.gltf(&format!("data:application/octet-stream;base64,{}", STANDARD.encode(&self.binary)))
    }

    pub fn read(&self) -> Result<MeshFile, MeshFileError> {
        MeshFile::from_bytes(&self.glb(), MeshFormat::Gltf, None)
    }
}
