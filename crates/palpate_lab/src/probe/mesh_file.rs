//! Positions and triangles of a glTF file.

use crate::error::LabError;
use glam::{DMat4, DVec3};
use std::path::Path;

/// All triangles of a file's default scene, in the units of the file.
pub(super) struct Triangles {
    pub(super) positions: Vec<DVec3>,
    pub(super) triangles: Vec<[usize; 3]>,
}

/// Reads the triangles of the default scene of a .glb or .gltf file, with the transforms of its nodes applied.
pub(super) fn read(path: &Path) -> Result<Triangles, LabError> {
    let failed = |why: String| LabError::Mesh { path: path.to_owned(), why };
    let bytes = std::fs::read(path).map_err(|error| failed(format!("the file cannot be read: {error}")))?;
    let file = gltf::Gltf::from_slice(&bytes).map_err(|error| failed(invalid(&error)))?;
    let buffers = buffers(&file, path)?;
    let mut all = Triangles { positions: Vec::new(), triangles: Vec::new() };
    let scene = file.default_scene().or_else(|| file.scenes().next());
    let roots =
        scene.ok_or_else(|| failed("the file has no scene; export one with the mesh in it".into()))?;
    let mut open: Vec<(gltf::Node<'_>, DMat4)> = roots.nodes().map(|node| (node, DMat4::IDENTITY)).collect();
    while let Some((node, parent)) = open.pop() {
        let own = node.transform().matrix().map(|column| column.map(f64::from));
        let place = parent * DMat4::from_cols_array_2d(&own);
        for primitive in node.mesh().iter().flat_map(gltf::Mesh::primitives) {
            all.add(&primitive, &buffers, place).map_err(failed)?;
        }
        open.extend(node.children().map(|child| (child, place)));
    }
    if all.triangles.is_empty() {
        return Err(failed("the scene has no triangles".into()));
    }
    Ok(all)
}

/// The contents of every buffer: inside a .glb file, or in files next to a .gltf file.
fn buffers(file: &gltf::Gltf, path: &Path) -> Result<Vec<Vec<u8>>, LabError> {
    let failed = |why: String| LabError::Mesh { path: path.to_owned(), why };
    let read = |buffer: gltf::Buffer<'_>| match buffer.source() {
        gltf::buffer::Source::Bin => {
            file.blob.clone().ok_or_else(|| failed("the file ends before its binary part".into()))
        }
        gltf::buffer::Source::Uri(uri) if uri.starts_with("data:") => {
            Err(failed("a buffer is embedded as text; export the mesh as .glb".into()))
        }
        gltf::buffer::Source::Uri(uri) => {
            let external = path.with_file_name(uri);
            std::fs::read(&external)
                .map_err(|error| failed(format!("{} cannot be read: {error}", external.display())))
        }
    };
    file.buffers().map(read).collect()
}

impl Triangles {
    fn add(
        &mut self,
        primitive: &gltf::Primitive<'_>,
        buffers: &[Vec<u8>],
        place: DMat4,
    ) -> Result<(), String> {
        if primitive.mode() != gltf::mesh::Mode::Triangles {
            return Err(format!("a part is made of {:?}; export it as triangles", primitive.mode()));
        }
        let reader = primitive.reader(|buffer| buffers.get(buffer.index()).map(Vec::as_slice));
        let positions =
            reader.read_positions().ok_or("a part has no positions of three numbers in single precision")?;
        let first = self.positions.len();
        self.positions.extend(positions.map(|x| place.transform_point3(DVec3::from_array(x.map(f64::from)))));
        let count = self.positions.len() - first;
        let corners: Vec<usize> = match reader.read_indices() {
            Some(indices) => indices.into_u32().map(|index| index as usize).collect(),
            None if primitive.indices().is_some() => {
                return Err("the indices of a part lie outside its buffer".into());
            }
            None => (0..count).collect(),
        };
        if let Some(index) = corners.iter().find(|&&index| index >= count) {
            return Err(format!("a triangle has vertex {index} of {count}"));
        }
        let whole = corners.chunks_exact(3);
        if !whole.remainder().is_empty() {
            return Err(format!(
                "a part has {} corners, which is no whole number of triangles",
                corners.len()
            ));
        }
        self.triangles.extend(whole.map(|t| [first + t[0], first + t[1], first + t[2]]));
        Ok(())
    }
}

/// Reason why a file cannot be read, in one line.
fn invalid(error: &gltf::Error) -> String {
    let text = error.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
    let text = text.trim_end_matches([';', ' ']);
    if text.contains("extensionsRequired") {
        format!(
            "the file requires an unsupported extension ({text}); export it uncompressed, in single precision"
        )
    } else {
        format!("the file is not valid glTF ({text})")
    }
}
