//! Reads mesh files as plain triangles: glTF and GLB with their compressions, OBJ, STL and PLY. Reads volume files as plain tetrahedra:
//! Gmsh, VTK, VTU and TetGen.
//!
//! The crate has no vector types and no renderer. It reads what a body needs, positions, normals and triangles at their places in the
//! scene, or tetrahedra and their regions, and nothing else: pictures, animations, cameras and fields may be missing.
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
//! A volume with two regions:
//!
//! ```
//! use palpate_files::{TetrahedralFile, TetrahedralFormat};
//!
//! # fn main() -> Result<(), palpate_files::MeshFileError> {
//! // Files of TetGen. A file is read with `TetrahedralFile::read(path)`, which finds the second file.
//! let nodes = "5 3 0 0\n 1 0 0 0\n 2 1 0 0\n 3 0 1 0\n 4 0 0 1\n 5 0 0 -1\n";
//! let elements = "2 4 1\n 1 1 2 3 4 10\n 2 1 3 2 5 20\n";
//! let file = TetrahedralFile::from_bytes(nodes.as_bytes(), TetrahedralFormat::TetGenNode, Some(elements.as_bytes()))?;
//! assert_eq!(file.tetrahedra, [[0, 1, 2, 3], [0, 2, 1, 4]]);
//! assert_eq!(file.region_list[file.regions[1] as usize].number, 20);
//! # Ok(())
//! # }
//! ```
//!
//! # Formats of meshes
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
//! # Formats of volumes
//!
//! * Gmsh (`.msh`), versions 2.0 to 2.2, 4.0 and 4.1, text and binary of both orders. The region of an element is the first physical group
//!   of its volume, with its name. Without groups of volumes it is the entity; with some, elements without a group have the region 0. A
//!   partition belongs to the group that it states, otherwise to its parent.
//! * Legacy VTK (`.vtk`), unstructured grids of versions 1 to 5, text and binary.
//! * VTU (`.vtu`), unstructured grids of VTK in XML: text, base64 or appended, also with zlib or LZ4. All pieces are read.
//! * TetGen (`.node` and `.ele`), with 4 or 10 nodes an element. The region is the first attribute, which must be a whole number. Either
//!   file is the first; [`TetrahedralFormat::companion_path`] names the second.
//!
//! The region of a cell of VTK and VTU is its value in an array of whole numbers with one component, otherwise 0. Arrays of these names are
//! regions, the first one that exists; case and signs do not count, so `Region_ID` is `regionid`: `gmsh:physical`, `physical`,
//! `physicalid`, `physicalids`, `CellEntityIds`, `region`, `regions`, `regionid`, `regionids`, `material`, `materials`, `materialid`,
//! `materialids`, `mat`, `matid`, `tissue`, `label`, `labels`, `labelid`, `subdomain`, `subdomains`, `cell_tags`, `attribute`,
//! `gmsh:geometrical`.
//!
//! Elements of second and higher order are read by their corners. Hexahedra, voxels, prisms and pyramids are split into tetrahedra. Each of
//! their faces is divided by the diagonal from its lowest node, so the tetrahedra of neighbours have common faces. Other solid elements,
//! such as polyhedra, are rejected. Points, lines and faces, tetrahedra that have a node twice, and nodes that no tetrahedron has are left
//! out. [`ElementCounts`] has their numbers.
//!
//! # Units and frames
//!
//! Coordinates have the unit and the axes of the file. glTF prescribes metres with y upward; the other formats prescribe nothing.
//! Transforms of nodes are computed in `f64` and rounded once. A mirror image keeps its surface outward: the order of corners is
//! reversed.
//!
//! Vertices of volumes are `f64`, because their formats are. Tetrahedra have the order of corners of the file; inverted ones are passed on.
//!
//! # Limits
//!
//! * A file of more than 20 million vertices, triangles or tetrahedra is rejected; each place of a mesh counts, and a hexahedron is six
//!   tetrahedra.
//! * Values of meshes that are not finite are passed on. Volumes with a vertex that is not finite are rejected.
//! * Memory is bounded by the size of the file, of compressed VTU files by a thousand times their size.
//! * Skinned meshes have the shape of their vertices, at the place of their node.
//!
//! # Features
//!
//! | feature | default | reads |
//! | --- | --- | --- |
//! | `draco` | yes | `KHR_draco_mesh_compression`, by the crate `draco-core` |
//! | `meshopt` | yes | `EXT_meshopt_compression` and `KHR_meshopt_compression`, by the crate `meshoptimizer-rs` |
//! | `vtu` | yes | VTU files, by the crates `roxmltree`, `miniz_oxide` and `lz4_flex` |
//!
//! These crates are Rust only. Without one of the features, a file that needs it is rejected with the name of the feature.
//!
//! # Sources
//!
//! * glTF 2.0: Khronos, ISO/IEC 12113:2022, with the extensions of its registry.
//! * OBJ: Wavefront, Advanced Visualizer manual, appendix B1 (1991). STL: 3D Systems, Stereolithography Interface Specification (1989).
//! * PLY: G. Turk, The PLY polygon file format (1994).
//! * Gmsh: C. Geuzaine and J.-F. Remacle, Gmsh Reference Manual, MSH file format and its legacy versions.
//! * VTK and VTU: Kitware, VTK File Formats. TetGen: H. Si, TetGen User's Manual, file formats (2020).
//! * Division of elements: J. Dompierre, P. Labbé, M.-G. Vallet and R. Camarero, How to subdivide pyramids, prisms, and hexahedra into
//!   tetrahedra, 8th International Meshing Roundtable (1999).

#![forbid(unsafe_code)]

mod error;
mod format;
mod gltf;
mod gmsh;
mod mesh_file;
mod obj;
mod piece;
mod ply;
mod polygon;
mod scanner;
mod selection;
mod stl;
mod tetgen;
mod tetrahedral_file;
mod tetrahedral_format;
mod volume;
mod vtk;
#[cfg(feature = "vtu")]
mod vtu;

pub use error::MeshFileError;
pub use format::MeshFormat;
pub use mesh_file::MeshFile;
pub use piece::MeshPiece;
pub use selection::MeshSelection;
pub use tetrahedral_file::TetrahedralFile;
pub use tetrahedral_format::TetrahedralFormat;
pub use volume::{ElementCounts, TetrahedralRegion};
