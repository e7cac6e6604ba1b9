//! A region of a volume.

/// A part of a volume that its file marks: a tissue, a material or a component.
#[derive(Clone, Debug, Default, Eq, Hash, PartialEq)]
pub struct TetrahedralRegion {
    /// Number of the region in the file. 0 where the file marks nothing.
    pub number: i64,
    /// Name of the region. Only physical groups of Gmsh have names.
    pub name: Option<String>,
}
