//! The maximum sizes of a near field.

/// Maximum sizes of a near field, fixed at construction. Larger near fields are rejected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NearFieldCapacity {
    /// Maximum number of nodes of the support set S.
    pub nodes: usize,
    /// Maximum number p of columns of the far field's basis V.
    pub order: usize,
    /// Maximum number of ring nodes: nodes outside S that share a near spring, tetrahedron, element or domain with S.
    pub ring: usize,
    /// Maximum number of near springs. The maximum number of near tetrahedra is twice that.
    pub springs: usize,
    /// Maximum number of near hexahedra, and of their shapes.
    pub hexahedra: usize,
    /// Maximum number of near smoothed domains of tetrahedra.
    pub domains: usize,
    /// Maximum number of the nodes of near domains, each counted once in each of its domains.
    pub domain_nodes: usize,
    /// Maximum number of surface points.
    pub points: usize,
    /// Maximum number of surface triangles.
    pub triangles: usize,
}

impl NearFieldCapacity {
    /// No near field.
    pub const NONE: Self = Self {
        nodes: 0,
        order: 0,
        ring: 0,
        springs: 0,
        hexahedra: 0,
        domains: 0,
        domain_nodes: 0,
        points: 0,
        triangles: 0,
    };
}

impl Default for NearFieldCapacity {
    /// Sizes for sixteen nodes of a lattice in which each node has 26 neighbours. There are no tetrahedra.
    fn default() -> Self {
        Self {
            nodes: 16,
            order: 64,
            ring: 112,
            springs: 400,
            hexahedra: 64,
            points: 96,
            triangles: 192,
            ..Self::NONE
        }
    }
}
