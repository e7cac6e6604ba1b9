//! A mesh from a glTF or GLB file: everything that the file shows, as one.

use crate::assets;
use bevy::app::ScheduleRunnerPlugin;
use bevy::asset::{AssetPath, LoadState, RenderAssetUsages};
use bevy::gltf::{Gltf, GltfLoaderSettings, GltfMesh};
use bevy::mesh::{Indices, PrimitiveTopology, VertexAttributeValues};
use bevy::prelude::*;
use glam::DVec3;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// What is in a file.
#[derive(Clone, Debug)]
pub struct MeshFile {
    /// All triangles, where the file's nodes place them.
    pub mesh: Mesh,
    /// The corners of the box round them, in the file's units.
    pub bounds: [DVec3; 2],
    /// How many meshes with how many parts of one material were put together.
    pub parts: usize,
}

/// Why a file gives no mesh, with what to do about it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeshFileError(String);

impl std::fmt::Display for MeshFileError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for MeshFileError {}

/// How long a file may take, s.
const PATIENCE: Duration = Duration::from_secs(60);

impl MeshFile {
    /// Reads the file at `path`: its default scene, or only the mesh of index `only` in it. Textures are left out.
    ///
    /// # Errors
    /// [`MeshFileError`] when there is no such file, it is no glTF, or it holds no triangles.
    #[expect(
        clippy::disallowed_methods,
        reason = "a file is waited for before the app that has loops begins"
    )]
    pub fn read(path: &Path, only: Option<usize>) -> Result<Self, MeshFileError> {
        let refused = |why: String| MeshFileError(format!("{}: {why}", path.display()));
        let is_gltf = path
            .extension()
            .is_some_and(|ending| ending.eq_ignore_ascii_case("glb") || ending.eq_ignore_ascii_case("gltf"));
        if !is_gltf {
            return Err(refused("a mesh is read from a .glb or .gltf file; export it as one".into()));
        }
        let path: PathBuf =
            path.canonicalize().map_err(|error| refused(format!("it cannot be read: {error}")))?;
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
        // Of the path as it is: one that is read as text may hold a # or what else means something in it.
        let builder = app.world().resource::<AssetServer>().load_builder().with_settings(settings);
        let file: Handle<Gltf> = builder.load(AssetPath::from_path_buf(path));
        let began = Instant::now();
        loop {
            app.update();
            match app.world().resource::<AssetServer>().load_state(&file) {
                LoadState::Failed(error) => {
                    return Err(refused(format!("it is no glTF that can be read: {error}")));
                }
                LoadState::Loaded if app.world().resource::<Assets<Gltf>>().contains(&file) => break,
                _ if began.elapsed() > PATIENCE => {
                    return Err(refused("it takes too long to be read".into()));
                }
                _ => std::thread::sleep(Duration::from_millis(1)),
            }
        }
        put_together(app.world(), &file, only).map_err(refused)
    }
}

/// The triangles of the nodes of a file, where they are.
fn put_together(world: &World, file: &Handle<Gltf>, only: Option<usize>) -> Result<MeshFile, String> {
    let gltf = world.resource::<Assets<Gltf>>().get(file).ok_or("it is gone")?;
    let source = gltf.source.as_ref().ok_or("its nodes are not known")?;
    if let Some(index) = only.filter(|index| *index >= gltf.meshes.len()) {
        return Err(format!("there is no mesh {index}; it has {}, counted from 0", gltf.meshes.len()));
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
    // Meshes that no node shows are where they are.
    if placed.is_empty() {
        placed.extend((0..gltf.meshes.len()).map(|index| (index, Mat4::IDENTITY)));
    }
    placed.retain(|(index, _)| only.is_none_or(|only| only == *index));
    let mut whole = Whole::default();
    for (index, at) in placed {
        let mesh = gltf.meshes.get(index).and_then(|mesh| world.resource::<Assets<GltfMesh>>().get(mesh));
        for part in mesh.map_or(&[][..], |mesh| &mesh.primitives) {
            let part = world.resource::<Assets<Mesh>>().get(&part.mesh).ok_or("a part of it is gone")?;
            whole.add(part, at).map_err(|why| format!("mesh {index} {why}"))?;
        }
    }
    whole.finish()
}

/// The parts so far.
#[derive(Default)]
struct Whole {
    positions: Vec<[f32; 3]>,
    /// As many, or none where a part has none.
    normals: Vec<[f32; 3]>,
    corners: Vec<u32>,
    parts: usize,
}

impl Whole {
    fn add(&mut self, part: &Mesh, at: Mat4) -> Result<(), String> {
        if part.primitive_topology() != PrimitiveTopology::TriangleList {
            return Err(format!("is a {:?}; a body is made of triangles", part.primitive_topology()));
        }
        let Some(VertexAttributeValues::Float32x3(positions)) = part.attribute(Mesh::ATTRIBUTE_POSITION)
        else {
            return Err("has no positions of three numbers each".into());
        };
        let first = self.positions.len() as u32;
        self.positions.extend(positions.iter().map(|p| at.transform_point3((*p).into()).to_array()));
        if let Some(VertexAttributeValues::Float32x3(normals)) = part.attribute(Mesh::ATTRIBUTE_NORMAL) {
            let turn = Mat3::from_mat4(at).inverse().transpose();
            self.normals
                .extend(normals.iter().map(|n| (turn * Vec3::from(*n)).normalize_or_zero().to_array()));
        }
        let begin = self.corners.len();
        match part.indices() {
            Some(Indices::U16(indices)) => self.corners.extend(indices.iter().map(|&i| first + u32::from(i))),
            Some(Indices::U32(indices)) => self.corners.extend(indices.iter().map(|&i| first + i)),
            None => self.corners.extend((0..positions.len() as u32).map(|i| first + i)),
        }
        // A mirrored part is wound the other way.
        if at.determinant() < 0.0 {
            self.corners[begin..].chunks_exact_mut(3).for_each(|triangle| triangle.swap(1, 2));
        }
        self.parts += 1;
        Ok(())
    }

    fn finish(self) -> Result<MeshFile, String> {
        if self.corners.is_empty() {
            return Err("it holds no triangles; export a closed mesh".into());
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
