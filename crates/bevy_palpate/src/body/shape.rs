//! What the user asks of a body's shape: a block or a mesh, and what of it is fixed.

use bevy::prelude::*;
use glam::DVec3;

/// A body that can be touched. Its partners [`Tissue`](crate::Tissue), [`FixedRegion`] and [`Transform`] come by themselves.
///
/// The body is built where its transform places it. Moving the transform of its entity, or of a parent, later carries it along,
/// fixed parts and all, as it is and at once: what touches it lets go, as if it had been put there again. A body that appears where a
/// tool is (spawned, replaced, moved or chosen by [`HapticTool::body`](crate::HapticTool::body)) is touched at once by a tool
/// whose centre is outside of it; a tool whose centre is inside waits until it has left. See [`Touching`](crate::Touching). It has the size that
/// it is given here; a scaled transform is refused ([`HapticFaultKind::Scaled`](crate::HapticFaultKind::Scaled)), and the body
/// built once it is put right.
///
/// Its entity is given a [`Mesh3d`] that shows it deformed. Where the entity shows the very mesh that the body is made of, that
/// is replaced, and comes back when this component is taken away. A [`Mesh3d`] of another mesh is left alone: it is drawn as it
/// is, and the body's motion is not to be seen but in [`SimulatedBody::drawn_m`](crate::SimulatedBody::drawn_m).
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[component(immutable)]
#[require(crate::Tissue, FixedRegion, Transform)]
#[reflect(Component, Debug, PartialEq, Clone)]
pub enum DeformableBody {
    /// A block round the entity's origin.
    Block {
        /// Nodes along x, y, z.
        nodes: [usize; 3],
        /// Size along x, y, z, m.
        size_m: DVec3,
    },
    /// A closed mesh, filled.
    Mesh(MeshShape),
}

/// A closed mesh as the shape of a body.
///
/// It is filled with cubic cells ([`palpate_body::CellLattice`]), which carry its surface; its own picture, with its colours
/// and textures, follows. Built beside the app, as soon as the mesh is loaded; anew whenever the mesh changes. What is wrong with
/// a mesh (holes, crossings, odd units) is a [`HapticFault`](crate::HapticFault) that says what to do.
///
/// It is one mesh: of a glTF file one primitive, as it is stored, without the transforms of the file's nodes. A file of several parts, or
/// of placed ones, is joined first; `examples/stage/mesh_file.rs` shows how.
#[derive(Clone, Debug, PartialEq, Reflect)]
#[reflect(Debug, PartialEq, Clone)]
pub struct MeshShape {
    /// The mesh, of triangles, in metres once scaled; near its origin, or single precision is too coarse for its cells.
    pub mesh: Handle<Mesh>,
    /// Metres to a unit of the mesh: 0.001 for one in millimetres.
    pub metres_per_unit: f64,
    /// Cells along its longest side. A model step takes longer than proportional to the number of cells: ten make some hundred
    /// cells of an organ, twenty some thousand; beyond [`palpate_body::CellLattice::MOST_NODES`] they are refused.
    pub cells_along_longest_axis: usize,
}

impl MeshShape {
    /// `mesh` in metres, ten cells along its longest side.
    #[must_use]
    pub fn new(mesh: Handle<Mesh>) -> Self {
        Self { mesh, metres_per_unit: 1.0, cells_along_longest_axis: 10 }
    }
}

impl DeformableBody {
    /// A cube of `nodes` nodes along x, y, z and `edge_m` wide, round the entity's origin.
    #[must_use]
    pub fn block(nodes: [usize; 3], edge_m: f64) -> Self {
        Self::Block { nodes, size_m: DVec3::splat(edge_m) }
    }

    /// A block of `nodes` nodes along x, y, z and of size `size_m`, round the entity's origin.
    #[must_use]
    pub fn block_of_size(nodes: [usize; 3], size_m: DVec3) -> Self {
        Self::Block { nodes, size_m }
    }

    /// The inside of a closed mesh in metres, ten cells along its longest side. For other units or cells see [`MeshShape`].
    #[must_use]
    pub fn from_mesh(mesh: Handle<Mesh>) -> Self {
        Self::Mesh(MeshShape::new(mesh))
    }

    /// The mesh that it is made of, if it is.
    pub(super) fn mesh(&self) -> Option<&MeshShape> {
        if let Self::Mesh(shape) = self { Some(shape) } else { None }
    }
}

/// Which part of a body cannot move.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub enum FixedRegion {
    /// Nothing: the body floats.
    #[default]
    None,
    /// One side: of a block the nodes of its face, of a mesh the outermost nodes on that side of its bounds.
    Face(BoxFace),
    /// Several sides.
    Faces(Vec<BoxFace>),
    /// The nodes within one of these, in the body's own frame.
    Regions(Vec<BodyRegion>),
    /// Of a mesh: the nodes that carry the vertices for which this is true, one for each vertex.
    Vertices(Vec<bool>),
}

/// A cut into the top of a block, in its middle plane across x, along z: see [`palpate_body::Slit`]. Without it the block is
/// whole; taking it away later does not heal a cut.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Debug, PartialEq, Clone)]
pub struct Slit {
    /// Length along z, m, in whole cells.
    pub length_m: f64,
    /// Depth, m, in whole cells.
    pub depth_m: f64,
    /// Distance of its lips from each other at rest, m: a cell's width at most.
    pub opening_m: f64,
}

/// A side of a body, in its own frame, named as in Bevy: y is up, −z is forward.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Reflect)]
#[reflect(Debug, PartialEq, Hash, Clone)]
pub enum BoxFace {
    /// −x.
    Left,
    /// +x.
    Right,
    /// −y.
    Bottom,
    /// +y.
    Top,
    /// −z.
    Front,
    /// +z.
    Back,
}

/// A region of space in a body's own frame, m.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Debug, PartialEq, Clone)]
pub enum BodyRegion {
    /// A ball.
    Sphere {
        /// Its centre, m.
        center_m: DVec3,
        /// Its radius, m.
        radius_m: f64,
    },
    /// A box along the axes.
    Cuboid {
        /// Its centre, m.
        center_m: DVec3,
        /// Half its sides, m.
        half_m: DVec3,
    },
    /// What is within a radius of a line.
    Capsule {
        /// One end of the line, m.
        from_m: DVec3,
        /// The other, m.
        to_m: DVec3,
        /// The radius, m.
        radius_m: f64,
    },
    /// Everything on one side of a plane.
    HalfSpace {
        /// A point of the plane, m.
        point_m: DVec3,
        /// Away from the region; of any length.
        outward: DVec3,
    },
}

impl From<BodyRegion> for palpate_body::Region {
    fn from(region: BodyRegion) -> Self {
        match region {
            BodyRegion::Sphere { center_m, radius_m } => Self::Sphere { center_m, radius_m },
            BodyRegion::Cuboid { center_m, half_m } => Self::Cuboid { center_m, half_m },
            BodyRegion::Capsule { from_m, to_m, radius_m } => Self::Capsule { from_m, to_m, radius_m },
            BodyRegion::HalfSpace { point_m, outward } => Self::HalfSpace { point_m, outward },
        }
    }
}

impl From<BoxFace> for palpate_body::Face {
    fn from(face: BoxFace) -> Self {
        match face {
            BoxFace::Left => Self::NegX,
            BoxFace::Right => Self::PosX,
            BoxFace::Bottom => Self::NegY,
            BoxFace::Top => Self::PosY,
            BoxFace::Front => Self::NegZ,
            BoxFace::Back => Self::PosZ,
        }
    }
}

impl FixedRegion {
    pub(super) fn faces(&self) -> &[BoxFace] {
        match self {
            Self::Face(face) => std::slice::from_ref(face),
            Self::Faces(faces) => faces,
            Self::None | Self::Regions(_) | Self::Vertices(_) => &[],
        }
    }

    pub(super) fn regions(&self) -> &[BodyRegion] {
        if let Self::Regions(regions) = self { regions } else { &[] }
    }

    /// Whether nothing is asked to be fixed.
    pub(super) fn is_nothing(&self) -> bool {
        let is_vertices = matches!(self, Self::Vertices(_));
        self.faces().is_empty() && self.regions().is_empty() && !is_vertices
    }
}
