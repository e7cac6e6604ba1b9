//! Errors of reading a mesh file.

use std::path::PathBuf;
use thiserror::Error;

/// The reason why a mesh file is rejected.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum MeshFileError {
    /// The file does not exist or cannot be read.
    #[error("mesh file `{path}` cannot be read ({cause}); give the path of a file that exists and may be read", path = path.display())]
    CannotBeRead {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        #[source]
        cause: std::io::Error,
    },
    /// Neither the extension nor the first bytes belong to a format of [`MeshFormat`](crate::MeshFormat).
    #[error(
        "format of `{path}` is not known; the extension must be glb, gltf, obj, stl or ply, or the file must begin like a GLB, glTF or \
         PLY file; convert the file to GLB",
        path = path.display()
    )]
    FormatNotKnown {
        /// The file.
        path: PathBuf,
    },
    /// The content contradicts the format.
    #[error("{format} file is not valid: {problem}; export the mesh again, or convert it to GLB")]
    NotValid {
        /// Name of the format.
        format: &'static str,
        /// What is wrong, and where.
        problem: String,
    },
    /// A buffer of a glTF file is a file of its own, and that file is missing.
    #[error(
        "buffer {buffer} of the glTF file is the file `{path}`, which cannot be read ({cause}); copy that file beside the glTF file, or \
         export the mesh as a GLB file, which contains its buffers",
        path = path.display()
    )]
    MissingBuffer {
        /// Index of the buffer.
        buffer: usize,
        /// The missing file.
        path: PathBuf,
        /// The error of the operating system.
        #[source]
        cause: std::io::Error,
    },
    /// A buffer of a glTF file is at an address that is not read.
    #[error(
        "buffer {buffer} of the glTF file is at `{uri}`; it must be a data URI or a file with a path relative to the glTF file; export the \
         mesh as a GLB file, which contains its buffers"
    )]
    BufferNotReachable {
        /// Index of the buffer.
        buffer: usize,
        /// The address, of at most 80 characters.
        uri: String,
    },
    /// The file is compressed, and the decoder is not part of this build.
    #[error(
        "the glTF file is compressed with {extension}; enable the feature `{feature}` of palpate_files to decode it"
    )]
    NeedsDecoder {
        /// Name of the glTF extension.
        extension: &'static str,
        /// Feature of this crate that contains the decoder.
        feature: &'static str,
    },
    /// Compressed data cannot be decoded.
    #[error(
        "data that are compressed with {extension} cannot be decoded ({problem}); export the mesh again, or without compression"
    )]
    CannotBeDecoded {
        /// Name of the glTF extension.
        extension: &'static str,
        /// What the decoder reports.
        problem: String,
    },
    /// The file requires a glTF extension that is not read.
    #[error(
        "the glTF file requires the extension {extension}, which is not read; export the mesh without it"
    )]
    ExtensionNotKnown {
        /// Name of the glTF extension.
        extension: String,
    },
    /// A triangle refers to a vertex that does not exist.
    #[error(
        "a triangle of {of} has the vertex {index}; it must be below {vertex_count}; export the mesh again"
    )]
    IndexOutOfRange {
        /// The part of the file.
        of: String,
        /// Index of the vertex.
        index: u64,
        /// Vertices of that part.
        vertex_count: usize,
    },
    /// The file describes more than is read.
    #[error("{what} is {value}; it must be at most {max}; reduce the mesh before it is read")]
    TooLarge {
        /// The quantity.
        what: &'static str,
        /// Its value.
        value: u64,
        /// Its maximum.
        max: u64,
    },
    /// The file is valid and has no triangles.
    #[error(
        "{format} file has no triangles; it must have at least one; export a surface, not points, lines or an empty scene"
    )]
    NoTriangles {
        /// Name of the format.
        format: &'static str,
    },
    /// The file has pieces, and none of them is selected.
    #[error("nothing in the file is {selection}; change --mesh or --node, or list the content with --list")]
    NothingSelected {
        /// What is selected.
        selection: String,
    },
    /// Neither the extension nor the first bytes belong to a format of [`TetrahedralFormat`](crate::TetrahedralFormat).
    #[error(
        "format of `{path}` is not known; the extension must be msh, vtk, vtu, node or ele, or the file must begin like a Gmsh or VTK \
         file; convert the volume mesh to one of these formats",
        path = path.display()
    )]
    VolumeFormatNotKnown {
        /// The file.
        path: PathBuf,
    },
    /// The content contradicts the format.
    #[error("{format} file is not valid: {problem}; export the volume mesh again")]
    VolumeNotValid {
        /// Name of the format.
        format: &'static str,
        /// What is wrong, and where.
        problem: String,
    },
    /// The file has a version that is not read.
    #[error(
        "version of the {format} file is {version}; it must be {allowed}; export the volume mesh in such a version"
    )]
    VersionNotRead {
        /// Name of the format.
        format: &'static str,
        /// The version.
        version: String,
        /// Versions that are read.
        allowed: &'static str,
    },
    /// The reader of a format is not part of this build.
    #[error(
        "{format} files need the feature `{feature}` of palpate_files; enable it, or convert the file to Gmsh or legacy VTK"
    )]
    NeedsReader {
        /// Name of the format.
        format: &'static str,
        /// Feature of this crate that contains the reader.
        feature: &'static str,
    },
    /// The data are compressed in a way that is not read.
    #[error(
        "the compressor of the VTU file is `{compressor}`; it must be vtkZLibDataCompressor or vtkLZ4DataCompressor; export the volume \
         mesh with one of these, or without compression"
    )]
    CompressorNotRead {
        /// Name of the compressor.
        compressor: String,
    },
    /// The second file of a volume is missing beside the first.
    #[error(
        "the volume needs the file `{path}`, which cannot be read ({cause}); copy that file beside the other, or export the volume mesh \
         as one Gmsh or VTK file",
        path = path.display()
    )]
    MissingCompanion {
        /// The missing file.
        path: PathBuf,
        /// The error of the operating system.
        #[source]
        cause: std::io::Error,
    },
    /// The second file of a volume is not given.
    #[error(
        "the file .{given} of TetGen is given without the file .{needed}; give the content of both files"
    )]
    NeedsCompanion {
        /// Extension of the file that is given.
        given: &'static str,
        /// Extension of the file that is needed.
        needed: &'static str,
    },
    /// The file has something else than elements.
    #[error(
        "{format} file has the data set {content}; it must be an unstructured grid; export a mesh of tetrahedra"
    )]
    OtherDataSet {
        /// Name of the format.
        format: &'static str,
        /// The data set, as the file names it.
        content: String,
    },
    /// The file has elements of a type that is not read.
    #[error(
        "{format} file has {count} elements of the type {element}; solid elements must be tetrahedra, hexahedra, prisms or pyramids; \
         divide the others before they are exported"
    )]
    ElementNotRead {
        /// Name of the format.
        format: &'static str,
        /// Number and name of the type.
        element: String,
        /// Elements of this type, as far as they are known.
        count: u64,
    },
    /// An element refers to a node that does not exist.
    #[error(
        "an element of the {format} file has the node {node}, which is none of its {node_count} nodes; export the volume mesh again"
    )]
    NodeNotFound {
        /// Name of the format.
        format: &'static str,
        /// Number of the node, as the file counts.
        node: u64,
        /// Nodes of the file.
        node_count: usize,
    },
    /// The file is valid and has no tetrahedra.
    #[error(
        "{format} file has no tetrahedra, but {content}; it must have at least one tetrahedron, hexahedron, prism or pyramid; export a \
         volume mesh, or read the surface from a GLB, OBJ, STL or PLY file"
    )]
    NoTetrahedra {
        /// Name of the format.
        format: &'static str,
        /// What the file contains.
        content: String,
    },
}
