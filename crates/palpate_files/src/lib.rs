//! Reads mesh files as plain triangles: glTF and GLB with their compressions, OBJ, STL and PLY.
//!
//! The crate has no vector types and no renderer. It reads what a body needs, positions, normals and triangles at their places in the
//! scene, and nothing else: pictures, animations and cameras may be missing.
//!
//! # Getting started
//!
//! ```
//! use palpate_files::{MeshFile, MeshFormat};
//!
//! # fn main() -> Result<(), palpate_files::MeshFileError> {
//! // A tetrahedron. A file is read with `MeshFile::read(path)`.
//! let obj = "
//!     v 0 0 0
//!     v 1 0 0
//!     v 0 1 0
//!     v 0 0 1
//!     f 1 3 2
//!     f 1 2 4
//!     f 2 3 4
//!     f 3 1 4
//! ";
//! let file = MeshFile::from_bytes(obj.as_bytes(), MeshFormat::Obj, None)?;
//! assert_eq!(file.triangle_count(), 4);
//! assert_eq!(file.pieces[0].vertices[1], [1.0, 0.0, 0.0]);
//! assert_eq!(file.bounds(), Some([[0.0; 3], [1.0; 3]]));
//! # Ok(())
//! # }
//! ```
//!
//! # Formats
//!
//! * glTF 2.0 and GLB: nodes, triangle lists, strips and fans, sparse accessors, weighted morph targets, and the extensions
//!   `KHR_mesh_quantization`, `EXT_meshopt_compression`, `KHR_meshopt_compression` and `KHR_draco_mesh_compression`. Skins, animations
//!   and instances by `EXT_mesh_gpu_instancing` are left out.
//! * OBJ: polygons, objects, groups, names of materials, and normals where each vertex has one. Lines, curves and material files are
//!   left out.
//! * STL, binary and text: equal corners become one vertex. Normals and colours are left out.
//! * PLY, text and binary of both orders: polygons, triangle strips and normals. Other elements are left out.
//!
//! Polygons become fans about their first vertex. The signed area of a plane polygon is exact, also where it is not convex.
//!
//! # Units and frames
//!
//! Coordinates have the unit and the axes of the file. glTF prescribes metres with y upward; the other formats prescribe nothing.
//! Transforms of nodes are computed in `f64` and rounded once. A mirror image keeps its surface outward: the order of corners is
//! reversed.
//!
//! # Limits
//!
//! * A file of more than 20 million vertices or triangles is rejected; each place of a mesh counts.
//! * Values that are not finite are passed on.
//! * Skinned meshes have the shape of their vertices, at the place of their node.
//!
//! # Features
//!
//! | feature | default | decoder |
//! | --- | --- | --- |
//! | `draco` | yes | `KHR_draco_mesh_compression`, by the crate `draco-core` |
//! | `meshopt` | yes | `EXT_meshopt_compression` and `KHR_meshopt_compression`, by the crate `meshoptimizer-rs` |
//!
//! Both decoders are Rust only. Without one of them, a file that needs it is rejected with the name of the feature.
//!
//! # Sources
//!
//! * glTF 2.0: Khronos, ISO/IEC 12113:2022, with the extensions of its registry.
//! * OBJ: Wavefront, Advanced Visualizer manual, appendix B1 (1991). STL: 3D Systems, Stereolithography Interface Specification (1989).
//! * PLY: G. Turk, The PLY polygon file format (1994).

#![forbid(unsafe_code)]

mod error;
mod format;
mod gltf;
mod mesh_file;
mod obj;
mod piece;
mod ply;
mod polygon;
mod selection;
mod stl;

pub use error::MeshFileError;
pub use format::MeshFormat;
pub use mesh_file::MeshFile;
pub use piece::MeshPiece;
pub use selection::MeshSelection;
