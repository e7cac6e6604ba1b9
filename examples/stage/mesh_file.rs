//! Reads a glTF or GLB file as one mesh.

use crate::assets;
use bevy::app::ScheduleRunnerPlugin;
use bevy::asset::{AssetPath, LoadState, RenderAssetUsages};
use bevy::gltf::{Gltf, GltfLoaderSettings, GltfMesh};
use bevy::mesh::{Indices, PrimitiveTopology, VertexAttributeValues};
use bevy::prelude::*;
use glam::DVec3;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Content of a file.
#[derive(Clone, Debug)]
pub struct MeshFile {
    /// All triangles, transformed by the nodes of the file.
    pub mesh: Mesh,
    /// Corners of the bounding box, in the units of the file.
    pub bounds: [DVec3; 2],
    /// Number of joined primitives.
    pub parts: usize,
}

/// Reason why a file cannot be read as a mesh, with the remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeshFileError(String);

impl std::fmt::Display for MeshFileError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for MeshFileError {}

/// Maximum time to load a file.
const TIMEOUT: Duration = Duration::from_secs(60);

impl MeshFile {
    /// Reads the default scene of the file at `path`, or only the mesh with index `only` in it, without textures.
    ///
    /// # Errors
    /// [`MeshFileError`] if the file does not exist, is no glTF, or has no triangles.
    #[expect(
        clippy::disallowed_methods,
        reason = "the file is loaded before the start of the app with loops"
    )]
    pub fn read(path: &Path, only: Option<usize>) -> Result<Self, MeshFileError> {
        let error = |reason: String| MeshFileError(format!("{}: {reason}", path.display()));
        let is_gltf = path
            .extension()
            .is_some_and(|ending| ending.eq_ignore_ascii_case("glb") || ending.eq_ignore_ascii_case("gltf"));
        if !is_gltf {
            return Err(error("the file must end in .glb or .gltf; export the mesh in this format".into()));
        }
        let path: PathBuf =
            path.canonicalize().map_err(|source| error(format!("the file cannot be read: {source}")))?;
        let mut app = App::new();
        app.add_plugins(MinimalPlugins.set(ScheduleRunnerPlugin::run_once()));
        assets::add_without_window(&mut app);
        app.finish();
        app.cleanup();
        let settings = |settings: &mut GltfLoaderSettings| {
            settings.load_meshes = RenderAssetUsages::MAIN_WORLD;
            settings.load_materials = RenderAssetUsages::empty();
            (settings.load_cameras, settings.load_lights, settings.load_animations) = (false, false, false);
            settings.include_source = true;
        };
        // Parsing the path as text would give a # in it a special meaning.
        let builder = app.world().resource::<AssetServer>().load_builder().with_settings(settings);
        let file: Handle<Gltf> = builder.load(AssetPath::from_path_buf(path));
        let start = Instant::now();
        loop {
            app.update();
            match app.world().resource::<AssetServer>().load_state(&file) {
                LoadState::Failed(source) => {
                    return Err(error(format!("the file is not a valid glTF file: {source}")));
                }
                LoadState::Loaded if app.world().resource::<Assets<Gltf>>().contains(&file) => break,
                _ if start.elapsed() > TIMEOUT => {
                    return Err(error(format!("the file is not loaded after {} s", TIMEOUT.as_secs())));
                }
                _ => std::thread::sleep(Duration::from_millis(1)),
            }
        }
        join(app.world(), &file, only).map_err(error)
    }
}

/// Joins the meshes of the nodes of a file.
fn join(world: &World, file: &Handle<Gltf>, only: Option<usize>) -> Result<MeshFile, String> {
    let gltf = world.resource::<Assets<Gltf>>().get(file).ok_or("the asset was removed")?;
    let source = gltf.source.as_ref().ok_or("the file has no nodes")?;
    if let Some(index) = only.filter(|index| *index >= gltf.meshes.len()) {
        return Err(format!("mesh {index} does not exist; the index must be below {}", gltf.meshes.len()));
    }
    let mut nodes: Vec<_> = match source.default_scene().or(source.scenes().next()) {
        Some(scene) => scene.nodes().map(|node| (node, Mat4::IDENTITY)).collect(),
        None => Vec::new(),
    };
    let mut placed = Vec::new();
    while let Some((node, above)) = nodes.pop() {
        let at = above * Mat4::from_cols_array_2d(&node.transform().matrix());
        placed.extend(node.mesh().map(|mesh| (mesh.index(), at)));
        nodes.extend(node.children().map(|child| (child, at)));
    }
    // Without nodes with meshes, all meshes are used untransformed.
    if placed.is_empty() {
        placed.extend((0..gltf.meshes.len()).map(|index| (index, Mat4::IDENTITY)));
    }
    placed.retain(|(index, _)| only.is_none_or(|only| only == *index));
    let mut whole = Whole::default();
    for (index, at) in placed {
        let mesh = gltf.meshes.get(index).and_then(|mesh| world.resource::<Assets<GltfMesh>>().get(mesh));
        for part in mesh.map_or(&[][..], |mesh| &mesh.primitives) {
            let part = world.resource::<Assets<Mesh>>().get(&part.mesh).ok_or("a mesh asset was removed")?;
            whole.add(part, at).map_err(|reason| format!("mesh {index} {reason}"))?;
        }
    }
    whole.finish()
}

/// The joined mesh.
#[derive(Default)]
struct Whole {
    positions: Vec<[f32; 3]>,
    /// Normals of the parts that have some.
    normals: Vec<[f32; 3]>,
    corners: Vec<u32>,
    parts: usize,
}

impl Whole {
    fn add(&mut self, part: &Mesh, at: Mat4) -> Result<(), String> {
        if part.primitive_topology() != PrimitiveTopology::TriangleList {
            return Err(format!("is a {:?}; it must be a TriangleList", part.primitive_topology()));
        }
        let Some(VertexAttributeValues::Float32x3(positions)) = part.attribute(Mesh::ATTRIBUTE_POSITION)
        else {
            return Err("has no positions of three numbers each".into());
        };
        let first = self.positions.len() as u32;
        self.positions.extend(positions.iter().map(|p| at.transform_point3((*p).into()).to_array()));
        if let Some(VertexAttributeValues::Float32x3(normals)) = part.attribute(Mesh::ATTRIBUTE_NORMAL) {
            let transform = Mat3::from_mat4(at).inverse().transpose();
            self.normals
                .extend(normals.iter().map(|n| (transform * Vec3::from(*n)).normalize_or_zero().to_array()));
        }
        let start = self.corners.len();
        match part.indices() {
            Some(Indices::U16(indices)) => self.corners.extend(indices.iter().map(|&i| first + u32::from(i))),
            Some(Indices::U32(indices)) => self.corners.extend(indices.iter().map(|&i| first + i)),
            None => self.corners.extend((0..positions.len() as u32).map(|i| first + i)),
        }
        // Reverses the winding of a mirrored part.
        if at.determinant() < 0.0 {
            self.corners[start..].chunks_exact_mut(3).for_each(|triangle| triangle.swap(1, 2));
        }
        self.parts += 1;
        Ok(())
    }

    fn finish(self) -> Result<MeshFile, String> {
        if self.corners.is_empty() {
            return Err("the file has no triangles; export a closed mesh".into());
        }
        let corner = |pick: fn(DVec3, DVec3) -> DVec3| {
            self.positions.iter().map(|p| Vec3::from(*p).as_dvec3()).reduce(pick).unwrap_or_default()
        };
        let bounds = [corner(DVec3::min), corner(DVec3::max)];
        let mut mesh = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default());
        if self.normals.len() == self.positions.len() {
            mesh.insert_attribute(Mesh::ATTRIBUTE_NORMAL, self.normals);
        }
        mesh.insert_attribute(Mesh::ATTRIBUTE_POSITION, self.positions);
        mesh.insert_indices(Indices::U32(self.corners));
        Ok(MeshFile { mesh, bounds, parts: self.parts })
    }
}

#[cfg(test)]
mod tests;
