//! All tests of the crate.

mod broken;
mod compressed;
mod cube;
mod errors;
mod gltf_builder;
mod gltf_forms;
mod gltf_nodes;
mod obj;
mod ply;
mod selection;
mod stl;
