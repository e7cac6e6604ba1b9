//! The shape of a body: a block or a mesh, its fixed region, and a slit.

use super::element_family::ElementFamily;
use super::region::{BodyRegion, BoxFace};
use super::state::BodyState;
use super::tetrahedral_volume::{TetrahedralShape, TetrahedralVolume};
use super::tissue::Tissue;
use bevy::prelude::*;
use glam::DVec3;
use palpate_body::{CellSize, PieceSelection};

/// A deformable body that tools can touch: a block, the inside of a mesh, or a volume of tetrahedra. Requires [`Tissue`], [`ElementFamily`],
/// [`FixedRegion`], [`BodyState`] and [`Transform`].
///
/// The body is built at the pose of its transform, in the size given here. A scaled transform is rejected
/// ([`HapticFaultKind::NonUnitScale`](crate::HapticFaultKind::NonUnitScale)), and the body is built once the scale is 1. Moving the
/// transform of the entity or of a parent later moves the whole body at once, its fixed region included; tools in contact release it. With
/// [`KinematicBody`] only the fixed region follows the transform, and the tissue and its contacts follow the fixed region.
///
/// A body can appear where a tool is: it is spawned, replaced, moved, or selected by [`HapticTool::body`](crate::HapticTool::body). A tool
/// whose centre is outside of it is in contact at once; one whose centre is inside is in contact after it has left. See
/// [`TouchedBody`](crate::TouchedBody).
///
/// The entity receives a [`Mesh3d`] that shows it deformed. If the entity shows the mesh of which the body is made, that
/// handle is replaced, and restored when this component is removed. A [`Mesh3d`] of another mesh is not changed; the nodes are then
/// available in [`SimulatedBody::drawn_m`](crate::SimulatedBody::drawn_m).
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[component(immutable)]
#[require(Tissue, ElementFamily, FixedRegion, BodyState, Transform)]
#[reflect(Component, Debug, PartialEq, Clone)]
pub enum DeformableBody {
    /// A block centred on the entity's origin.
    Block {
        /// Nodes along x, y, z.
        nodes: [usize; 3],
        /// Size along x, y, z, m.
        size_m: DVec3,
    },
    /// A mesh, filled.
    Mesh(MeshShape),
    /// A volume of tetrahedra.
    Tetrahedra(TetrahedralShape),
}

/// A mesh as the shape of a body.
///
/// The inside of the mesh is filled with cubic cells ([`palpate_body::CellLattice`]), which carry its surface. Its own vertices follow, with their
/// colours and textures. A background task builds the body once the mesh is loaded, and again whenever the mesh changes. A mesh that cannot
/// be used (wrong units, no inside) is reported as a [`HapticFault`](crate::HapticFault) with the remedy.
///
/// With the feature `mesh_files`, which is on by default, a handle such as `assets.load("liver.stl")` is the whole of a GLB, glTF, OBJ, STL
/// or PLY file, and the label `Piece0` its first piece; `MeshFileLoader` has the details. Further pieces are its [`parts`](Self::parts).
/// A file that cannot be loaded is a [`MeshFault`](crate::MeshFault), and the body is [`BodyState::Rejected`].
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_palpate::{BodyRegion, Inclusion, Inclusions, MeshShape, prelude::*};
/// fn setup(mut commands: Commands, assets: Res<AssetServer>) {
///     // A liver with a tumour: the second material of the file has its own tissue.
///     let shape = MeshShape {
///         parts: vec![assets.load("liver.obj#Piece1")],
///         metres_per_unit: 0.001,
///         ..MeshShape::new(assets.load("liver.obj#Piece0"))
///     };
///     let tumour = Tissue { youngs_modulus_pa: 100e3, ..default() };
///     let inclusion = Inclusion { region: BodyRegion::Part(0), tissue: tumour };
///     commands.spawn((DeformableBody::Mesh(shape), Inclusions(vec![inclusion])));
/// }
/// ```
#[derive(Clone, Debug, PartialEq, Reflect)]
#[reflect(Debug, PartialEq, Clone)]
pub struct MeshShape {
    /// The mesh: a triangle list near its origin, where single precision resolves its cells.
    pub mesh: Handle<Mesh>,
    /// Further parts of the body in the same unit and frame, for example the other pieces of a file. [`BodyRegion::Part`] names
    /// the region of a part, for a tissue, a fixed part or a load.
    ///
    /// A part with holes belongs to the surface: it closes the mesh, and its region is what is nearer to it than to the other parts of the
    /// surface. A closed part that lies inside, with at least half of its volume, is an inclusion: its region is its inside, and it is not
    /// drawn. Another closed part belongs to the surface, and its region is its inside too. The body is drawn as one mesh with one
    /// material: the vertices of the mesh, then those of the parts of its surface.
    pub parts: Vec<Handle<Mesh>>,
    /// Length of a unit of the mesh, m: 0.001 for a mesh in millimetres.
    pub metres_per_unit: f64,
    /// Whether the mesh must be closed, without crossings: otherwise its inside is where its winding number exceeds 1/2, so that it may have
    /// holes, overlapping parts and parts that face inward. [`MeshReport::assumptions`](crate::MeshReport::assumptions) states what was
    /// assumed, which is also logged.
    pub strict: bool,
    /// Thickness that open parts get, m: sheets such as skin or a diaphragm. With `None` their holes count as closed. Parts without holes are
    /// unaffected.
    pub thickness_m: Option<f64>,
    /// Which pieces become the body, of a mesh of several that are not connected.
    pub pieces: MeshPieces,
    /// Size of the cells.
    pub cells: MeshCellSize,
}

/// Size of the cells of a mesh.
///
/// Smaller cells give a finer deformation, and the time of a model step grows faster than their number. More than
/// [`palpate_body::CellLattice::MAX_NODES`] nodes are rejected. [`MeshReport::cells`](crate::MeshReport::cells) states the size that a body has.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Debug, Default, PartialEq, Clone)]
pub enum MeshCellSize {
    /// Ten cells along the longest side of the mesh; fewer where these have more than `max_nodes` nodes; otherwise more, up to that number of
    /// nodes, where over a tenth of the volume is thinner than two cells. The default has [`CellSize::DEFAULT_MAX_NODES`], which hold 20 model
    /// steps per second.
    Automatic {
        /// Maximum number of nodes.
        max_nodes: usize,
    },
    /// Number of cells along the longest side of the mesh: ten divide an organ into some hundred cells, twenty into some thousand.
    Along(usize),
    /// Side of a cell, m.
    Side(f64),
}

impl Default for MeshCellSize {
    fn default() -> Self {
        Self::Automatic { max_nodes: CellSize::DEFAULT_MAX_NODES }
    }
}

impl From<MeshCellSize> for CellSize {
    fn from(size: MeshCellSize) -> Self {
        match size {
            MeshCellSize::Automatic { max_nodes } => Self::Automatic { max_nodes },
            MeshCellSize::Along(cells) => Self::Along(cells),
            MeshCellSize::Side(cell_m) => Self::Side(cell_m),
        }
    }
}

/// Which pieces of a mesh become the body. Pieces are not connected, however near they are: two kidneys in one file.
///
/// [`MeshReport::piece_count`](crate::MeshReport::piece_count) counts them. The other pieces are neither touched nor drawn, unless they are bodies
/// of their own:
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_palpate::{MeshPieces, MeshShape, SimulatedBody, prelude::*};
/// #[derive(Component)]
/// struct Largest;
///
/// /// Spawns a body for each further piece, once the largest is built.
/// fn spawn_other_pieces(
///     mut commands: Commands,
///     largest: Query<(&DeformableBody, &SimulatedBody), (With<Largest>, Added<SimulatedBody>)>,
/// ) {
///     for (body, simulated) in &largest {
///         let (DeformableBody::Mesh(shape), Some(report)) = (body, simulated.mesh_report()) else { continue };
///         for index in 1..report.piece_count {
///             let shape = MeshShape { pieces: MeshPieces::Index(index), ..shape.clone() };
///             commands.spawn((DeformableBody::Mesh(shape), FixedRegion::Face(BoxFace::Bottom)));
///         }
///     }
/// }
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Debug, Default, PartialEq, Clone)]
pub enum MeshPieces {
    /// The piece of the largest volume.
    #[default]
    Largest,
    /// The piece with this index, from 0, in the order of descending volumes.
    Index(usize),
    /// All pieces, as one body; with a fixed region this is rejected, because it would not hold them all.
    All,
}

impl From<MeshPieces> for PieceSelection {
    fn from(pieces: MeshPieces) -> Self {
        match pieces {
            MeshPieces::Largest => Self::Largest,
            MeshPieces::Index(index) => Self::Index(index),
            MeshPieces::All => Self::All,
        }
    }
}

impl MeshShape {
    /// `mesh` in metres, with its holes closed, and cells of a size chosen for it.
    #[must_use]
    pub fn new(mesh: Handle<Mesh>) -> Self {
        Self {
            mesh,
            parts: Vec::new(),
            metres_per_unit: 1.0,
            strict: false,
            thickness_m: None,
            pieces: MeshPieces::Largest,
            cells: MeshCellSize::default(),
        }
    }

    /// The mesh, then its parts.
    pub(super) fn handles(&self) -> impl Iterator<Item = &Handle<Mesh>> {
        std::iter::once(&self.mesh).chain(&self.parts)
    }
}

impl DeformableBody {
    /// A cube with edges of `edge_m`, m, and `nodes` nodes along x, y, z, centred on the entity's origin.
    #[must_use]
    pub fn block(nodes: [usize; 3], edge_m: f64) -> Self {
        Self::Block { nodes, size_m: DVec3::splat(edge_m) }
    }

    /// A block of size `size_m`, m, with `nodes` nodes along x, y, z, centred on the entity's origin.
    #[must_use]
    pub fn block_of_size(nodes: [usize; 3], size_m: DVec3) -> Self {
        Self::Block { nodes, size_m }
    }

    /// The inside of a mesh in metres, with cells of a size chosen for it ([`MeshCellSize`]). [`MeshShape`] has other units and cell sizes.
    #[must_use]
    pub fn from_mesh(mesh: Handle<Mesh>) -> Self {
        Self::Mesh(MeshShape::new(mesh))
    }

    /// A volume of tetrahedra in metres. [`TetrahedralShape`] has other units.
    #[must_use]
    pub fn from_volume(volume: Handle<TetrahedralVolume>) -> Self {
        Self::Tetrahedra(TetrahedralShape::new(volume))
    }

    /// Whether the body is built from an asset.
    pub(super) fn has_source(&self) -> bool {
        !matches!(self, Self::Block { .. })
    }

    /// Whether the body is made of the volume asset `id`.
    pub(super) fn is_volume(&self, id: AssetId<TetrahedralVolume>) -> bool {
        matches!(self, Self::Tetrahedra(shape) if shape.volume.id() == id)
    }

    /// The mesh of [`Self::Mesh`].
    pub(super) fn mesh(&self) -> Option<&MeshShape> {
        if let Self::Mesh(shape) = self { Some(shape) } else { None }
    }

    /// Whether the body is made of the mesh asset `id`, alone or with others.
    pub(super) fn is_made_of(&self, id: AssetId<Mesh>) -> bool {
        self.mesh().is_some_and(|shape| shape.handles().any(|mesh| mesh.id() == id))
    }
}

/// Marks a body whose fixed region follows the entity's transform, for example on a moving tray.
///
/// The fixed region moves to the new pose during the next model step, at constant velocity; the free tissue follows by its springs, and
/// contacts persist. A move faster than 25 m/s, and every move of a body without a fixed region, moves the whole body at once, as without
/// this component. A tool feels the motion from the next local model on.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct KinematicBody;

/// The part of a body that cannot move.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub enum FixedRegion {
    /// No part: the body floats, or falls with [`Gravity`](crate::Gravity).
    #[default]
    None,
    /// One side: of a block the nodes of its face, of a mesh the outermost nodes on that side of its bounds.
    Face(BoxFace),
    /// Several sides.
    Faces(Vec<BoxFace>),
    /// The nodes within a share of the extent from one side, at least those of [`Self::Face`]: the lowest fifth of an organ in a mould. The
    /// outermost nodes of a round body are few, and hold it at a point.
    Base {
        /// The side.
        side: BoxFace,
        /// Share of the extent of the body between this side and the opposite one, above 0 and below 1.
        share: f64,
    },
    /// The nodes within one of these, in the body's own frame.
    Regions(Vec<BodyRegion>),
    /// Of a mesh: the nodes that carry the vertices for which this is true, one for each vertex of the mesh and of the parts of its surface. Of a
    /// volume: the vertices themselves.
    Vertices(Vec<bool>),
}

/// A cut into the top of a block, in its middle plane across x, along z; see [`palpate_body::Slit`]. Without the component the
/// block is whole.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Debug, PartialEq, Clone)]
pub struct Slit {
    /// Length along z, m, in whole cells.
    pub length_m: f64,
    /// Depth, m, in whole cells.
    pub depth_m: f64,
    /// Distance between its lips at rest, m, at most the width of a cell.
    pub opening_m: f64,
}

impl FixedRegion {
    pub(super) fn faces(&self) -> &[BoxFace] {
        match self {
            Self::Face(face) => std::slice::from_ref(face),
            Self::Faces(faces) => faces,
            Self::None | Self::Base { .. } | Self::Regions(_) | Self::Vertices(_) => &[],
        }
    }

    pub(super) fn regions(&self) -> &[BodyRegion] {
        if let Self::Regions(regions) = self { regions } else { &[] }
    }

    /// Whether no part is fixed.
    pub(super) fn is_none(&self) -> bool {
        let is_other = matches!(self, Self::Base { .. } | Self::Vertices(_));
        self.faces().is_empty() && self.regions().is_empty() && !is_other
    }
}
