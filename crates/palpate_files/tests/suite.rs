//! All tests of the crate.

mod broken;
mod broken_volumes;
mod compressed;
mod cube;
mod errors;
mod gltf_builder;
mod gltf_forms;
mod gltf_nodes;
mod gmsh;
mod grid;
mod obj;
mod ply;
mod selection;
mod stl;
mod tetgen;
mod volume_formats;
mod vtk;
#[cfg(feature = "vtu")]
mod vtu;
