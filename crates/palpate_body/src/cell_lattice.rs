//! Cubic cells fitted to a closed mesh: a body of any shape.

mod automatic;
mod cell_grid;
mod cell_parts;
mod cell_samples;
mod embedding;
mod fill;
mod kept_cells;
mod material;
mod mesh_body;

pub(crate) use embedding::Embedding;
pub use kept_cells::MeshCells;
pub use mesh_body::MeshBody;

use crate::cell_tissue::CellTissue;
use crate::touch_surface::TouchSurface;
use crate::{
    BodyError, CellSize, ClosedMesh, Face, MeshError, NetworkBuilder, Region, Skin, ThinParts, Tissue,
};
use cell_grid::CellGrid;
use cell_parts::CellParts;
use embedding::trilinear_weights;
use glam::DVec3;
use kept_cells::KeptCells;
use material::FilledCells;
use std::sync::{Arc, OnceLock};

/// Depth below the bounds of a mesh of a layer with its outermost nodes, in cells: they lie at most half a cell outside, and the next ones at
/// least half a cell inside.
const OUTERMOST_CELLS: f64 = 0.49;
/// Tolerance of the filled share of a whole cell.
const WHOLE_CELL: f64 = 1e-9;

/// Cubic cells fitted to a closed mesh. [`CellLattice::tissue`] gives them a material.
///
/// # Cells
///
/// The cells are aligned with the axes and centred on the bounds of the mesh. φ of a cell is the exact share of its
/// volume that the mesh encloses. The body consists of the cells with φ > 0, and the surface moves with the trilinear
/// weights of its cell.
///
/// What is inside a cell may not be connected there: two fingers, or the lips of a cut. Each of its components is then a cell of its own
/// (M. Nesme et al., ACM Trans. Graph. 28 (2009) 52), with its share of φ. Cells share nodes where the inside continues from one into the
/// other, so that a gap stays a gap however thin it is. Components are found on 8 × 8 lines along each axis.
///
/// A cell with φ < 0.1 is removed if a fuller one, connected with it, can carry its surface from at most a quarter of a cell away
/// (with φ < 0.01, half a cell), and if its neighbours stay connected. Its φ is added to that one. Otherwise it
/// stays, so that a tip thinner than a cell is kept.
///
/// # Masses and springs
///
/// Every cell has the springs of [`Tissue`], shared as there, times φ, and gives each of its nodes the mass ρ φ h³/8.
/// The body has the mass of the mesh, and uniform strain costs the energy of an isotropic solid of its volume. A mesh
/// that is a block of whole cells gives the network of [`crate::Block::tissue`]. Springs and mass of a node shrink
/// together, so partly filled cells need no more substeps than full ones.
///
/// # Limits
///
/// * Where less than an eighth of a cell of two components is in a cell, points of one may move with the other.
/// * A wall thinner than a cell keeps its mass and its axial stiffness, but bends like a wall one cell thick. A third of a cell thick, it is
///   up to 27 % too soft along itself where it passes obliquely from one layer of cells into the next.
/// * Nodes lie up to a cell outside the mesh. Obstacles act on nodes.
/// * A cell that must stay counts as filled to at least 0.01 ([`MeshCells::raised`]).
///
/// ```
/// use glam::DVec3;
/// use palpate_body::{Body, CellLattice, CellSize, ClosedMesh, Region, Tissue};
///
/// # fn main() -> Result<(), palpate_body::BodyError> {
/// // An octahedron, 10 cm from corner to corner, with its lower tip fixed.
/// let corners = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z].map(|x| 0.05 * x);
/// let triangles = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
/// let mesh = ClosedMesh::new(corners.to_vec(), triangles.to_vec())?;
/// let made = CellLattice::fit(&mesh, CellSize::Along(8))?
///     .fix(Region::HalfSpace { point_m: DVec3::new(0.0, 0.0, -0.03), outward: DVec3::Z })
///     .region(Region::Sphere { center_m: DVec3::ZERO, radius_m: 0.01 }, Tissue { youngs_modulus_pa: 100e3, ..Tissue::default() })
///     .tissue(&Tissue::default())?;
/// let mass_kg: f64 = made.network.mass_kg().iter().sum();
/// assert!((mass_kg - 1000.0 * mesh.volume_m3()).abs() < 1e-12);
/// let body = Body::new(made.network, made.surface)?;
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct CellLattice<'a> {
    mesh: &'a ClosedMesh,
    grid: CellGrid,
    fixed: Vec<Region>,
    fixed_vertices: Vec<Vec<bool>>,
    regions: Vec<(Region, Tissue)>,
    allow_free: bool,
    touch_spacing: f64,
    computed: ComputedCells,
}

/// What has been computed of the cells of a lattice.
#[derive(Clone, Debug, Default)]
pub(crate) struct ComputedCells {
    /// The parts of the cells.
    parts: OnceLock<Arc<CellParts>>,
    /// Share of the volume that is thinner than two cells.
    thin_share: OnceLock<f64>,
}

impl<'a> CellLattice<'a> {
    /// Maximum number of cells along the longest side.
    pub const MAX_CELLS_ALONG: usize = crate::limits::MAX_CELLS_ALONG;
    /// Maximum number of nodes of a body. A body of that size takes about half a second for 50 ticks, half a gigabyte
    /// for its factorisations and seconds for a local model.
    pub const MAX_NODES: usize = 10_000;

    /// Fits cells of size `size` to `mesh`, without fixed nodes.
    ///
    /// # Errors
    /// [`MeshError::Cells`] for less than one cell along the longest side or more than
    /// [`CellLattice::MAX_CELLS_ALONG`]. [`MeshError::CoarseGrid`] for a single-precision mesh so far from its origin
    /// that its vertices are more than a hundredth of a cell apart.
    pub fn fit(mesh: &'a ClosedMesh, size: CellSize) -> Result<Self, MeshError> {
        let sides_m = 2.0 * mesh.half_size_m();
        let size_m = sides_m.max_element();
        let cell_m = match size {
            CellSize::Automatic { max_nodes } => return Self::automatic(mesh, max_nodes),
            CellSize::Along(cells) => size_m / cells as f64,
            CellSize::Side(cell_m) => cell_m,
        };
        let along = size_m / cell_m;
        if !(cell_m > 0.0
            && cell_m.is_finite()
            && along.is_finite()
            && along <= Self::MAX_CELLS_ALONG as f64 + WHOLE_TOLERANCE)
        {
            return Err(MeshError::Cells { cell_m, cells: along, size_m });
        }
        if let Some((distance_m, grid_m)) =
            mesh.grid_m().filter(|(_, grid_m)| *grid_m > MAX_GRID_CELLS * cell_m)
        {
            return Err(MeshError::CoarseGrid { distance_m, grid_m, cell_m });
        }
        // A side that is a whole number of cells up to rounding takes no more.
        let cells = (sides_m / cell_m - WHOLE_TOLERANCE).ceil().max(DVec3::ONE);
        let low_m = -0.5 * cell_m * cells;
        let grid = CellGrid { cells: cells.to_array().map(|n| n as usize), cell_m, low_m };
        Ok(Self {
            mesh,
            grid,
            fixed: Vec::new(),
            fixed_vertices: Vec::new(),
            regions: Vec::new(),
            allow_free: false,
            touch_spacing: 0.5,
            computed: ComputedCells::default(),
        })
    }

    /// What has been computed of the cells.
    pub(crate) fn computed(&self) -> ComputedCells {
        self.computed.clone()
    }

    /// Takes over what was computed with a lattice of the same mesh and size.
    pub(crate) fn with_computed(mut self, computed: ComputedCells) -> Self {
        self.computed = computed;
        self
    }

    /// The parts of the mesh that are thinner than two of the cells; see [`ClosedMesh::thin_parts`].
    #[must_use]
    pub fn thin_parts(&self) -> ThinParts {
        self.mesh.thin_parts_of(self.cell_m(), self.thin_share())
    }

    /// Whether at most [`ThinParts::MAX_SHARE`] of the volume is thinner than two cells.
    fn is_resolving(&self) -> bool {
        self.thin_share() <= ThinParts::MAX_SHARE
    }

    fn thin_share(&self) -> f64 {
        *self.computed.thin_share.get_or_init(|| self.mesh.thin_share(self.cell_m()))
    }

    /// Side of a cell, m.
    #[must_use]
    pub fn cell_m(&self) -> f64 {
        self.grid.cell_m
    }

    /// Number of cells along the longest side of the mesh.
    #[must_use]
    pub fn cells_along(&self) -> usize {
        self.grid.along()
    }

    /// Fixes the nodes in `region`.
    #[must_use]
    pub fn fix(mut self, region: Region) -> Self {
        self.fixed.push(region);
        self
    }

    /// Fixes the outermost nodes on the side `face` of the mesh: they lie outside its bounds, and the next ones inside.
    #[must_use]
    pub fn fix_outermost(self, face: Face) -> Self {
        let depth_m = OUTERMOST_CELLS * self.grid.cell_m;
        self.fix_layer(face, depth_m)
    }

    /// Fixes the nodes within `share` of the extent of the mesh from its side `face`, and at least those of
    /// [`CellLattice::fix_outermost`].
    #[must_use]
    pub fn fix_base(self, face: Face, share: f64) -> Self {
        let extent_m = 2.0 * self.mesh.half_size_m()[face.axis()];
        // A plane through nodes contains them.
        let depth_m = ((share + WHOLE_CELL) * extent_m).max(OUTERMOST_CELLS * self.grid.cell_m);
        self.fix_layer(face, depth_m)
    }

    fn fix_layer(self, face: Face, depth_m: f64) -> Self {
        let layer = Region::layer(self.mesh.bounds_m(), face, depth_m);
        self.fix(layer)
    }

    /// Fixes the nodes that carry the named `vertices` of the given mesh, and the nodes that carry triangles with
    /// three named corners. A node counts as carrying with a weight of at least 1/8, which at least one node always
    /// has.
    ///
    /// # Errors
    /// [`MeshError::Length`] if the list does not have one entry for each vertex.
    pub fn fix_vertices(mut self, vertices: &[bool]) -> Result<Self, MeshError> {
        let (found, needed) = (vertices.len(), self.mesh.vertices_m().len());
        if found != needed {
            return Err(MeshError::Length { what: "the list of fixed vertices", found, vertices: needed });
        }
        self.fixed_vertices.push(vertices.to_vec());
        Ok(self)
    }

    /// Fills `region` with `tissue`; later regions override earlier ones. A cell takes the mean over those of 4 × 4 × 4 places
    /// in it that are inside the mesh.
    #[must_use]
    pub fn region(mut self, region: Region, tissue: Tissue) -> Self {
        self.regions.push((region, tissue));
        self
    }

    /// Allows a body without fixed nodes, or in several pieces.
    #[must_use]
    pub fn allow_unconstrained(mut self) -> Self {
        self.allow_free = true;
        self
    }

    /// Sets the minimum distance of points of the touchable surface, in cells; half a cell by default. Closer points
    /// move with the same cell and add no detail.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] unless it is between 0 and 1. At 0 every vertex of the mesh is a point.
    pub fn touch_spacing(mut self, cells: f64) -> Result<Self, BodyError> {
        crate::error::check(
            "spacing of points of the touched surface, cells",
            cells,
            (0.0..=1.0).contains(&cells),
            "0 to 1",
        )?;
        self.touch_spacing = cells;
        Ok(self)
    }

    /// Creates the body with the cells filled with `tissue`, as springs.
    ///
    /// # Errors
    /// [`BodyError`] for an invalid tissue, if all nodes are fixed, or if none is without
    /// [`CellLattice::allow_unconstrained`]; [`MeshError::Pieces`] for more than one piece without it;
    /// [`MeshError::EmptyRegion`] for a region without any part of the body; [`MeshError::TooManyNodes`] beyond
    /// [`CellLattice::MAX_NODES`].
    pub fn tissue(&self, tissue: &Tissue) -> Result<MeshBody, BodyError> {
        self.body(tissue, |cells, means, rest_m, fixed| {
            let made = material::springs(cells, means, rest_m)?;
            let network = NetworkBuilder::of(rest_m.to_vec(), made.mass_kg, fixed, made.links);
            Ok(network.with_drag(made.drag_ns_per_m).with_cells(cells.embedding.cells().to_vec()))
        })
    }

    /// Creates the body with the cells filled with `tissue`, as hexahedral elements. The parameters of a partly filled cell are those of its
    /// tissue times φ.
    ///
    /// # Errors
    /// As [`CellLattice::tissue`].
    pub fn elements(&self, tissue: &Tissue) -> Result<MeshBody, BodyError> {
        self.body(tissue, |cells, means, rest_m, fixed| {
            let mut network = NetworkBuilder::of(rest_m.to_vec(), vec![0.0; rest_m.len()], fixed, Vec::new());
            for ((nodes, share), mean) in cells.embedding.cells().iter().zip(cells.share).zip(means) {
                network.cell(*nodes, mean, *share);
            }
            Ok(network)
        })
    }

    /// Creates the body with the network that `build` makes of the filled cells, their mean tissues, the nodes at rest and the fixed nodes.
    fn body(
        &self,
        tissue: &Tissue,
        build: impl FnOnce(
            &FilledCells<'_>,
            &[CellTissue],
            &[DVec3],
            Vec<bool>,
        ) -> Result<NetworkBuilder, BodyError>,
    ) -> Result<MeshBody, BodyError> {
        tissue.validate()?;
        self.regions.iter().try_for_each(|(_, other)| other.validate())?;
        let (mesh, grid) = (self.mesh, self.grid);
        let parts = self.parts()?;
        let kept = KeptCells::choose(&grid, &parts);
        let pieces = kept.pieces(&parts);
        let smallest = pieces.iter().filter(|_| pieces.len() > 1).min_by_key(|piece| piece.len());
        if let (false, Some(&index)) = (self.allow_free, smallest.and_then(|piece| piece.first())) {
            let middle =
                DVec3::from_array(grid.place(parts.parts[kept.cells[index].0].cell).map(|n| n as f64)) + 0.5;
            let at_m = mesh.center_m() + grid.at_m(middle);
            return Err(MeshError::Pieces { pieces: pieces.len(), at_m }.into());
        }
        let embedding = Embedding::new(grid, &parts, &kept);
        self.check_nodes(embedding.nodes().len())?;
        let at_m = |ijk: &[usize; 3]| mesh.center_m() + grid.at_m(DVec3::from_array(ijk.map(|n| n as f64)));
        let rest_m: Vec<DVec3> = embedding.nodes().iter().map(at_m).collect();
        let share: Vec<f64> = kept.cells.iter().map(|(_, share)| *share).collect();
        let filled = FilledCells { embedding: &embedding, share: &share };
        let means = material::mean_tissues(&filled, (tissue, &self.regions), mesh)?;
        let fixed = self.fixed(&embedding, &rest_m)?;
        let network = build(&filled, &means, &rest_m, fixed)?;
        let network = if self.allow_free { network.allow_unconstrained() } else { network }.build()?;
        let cells = crate::Grid::new(grid.cell_m, material::node_moduli_pa(&filled, &means));
        let is_whole = |share: &f64| (share - 1.0).abs() < WHOLE_CELL;
        let cells = if share.iter().all(is_whole) { cells } else { cells.partly_filled() };
        let cells =
            if network.hexahedra().is_empty() { cells } else { cells.of_elements(tissue.poissons_ratio) };
        let network = network.with_grid(cells);
        let touched = TouchSurface::new(
            mesh,
            |place_m, normal| embedding.point(place_m, normal),
            grid.cell_m,
            self.touch_spacing,
        );
        Ok(MeshBody {
            network,
            surface: touched.surface,
            skin: Skin::new(mesh, &embedding),
            cells: MeshCells { cell_m: grid.cell_m, along: grid.along(), ..kept.report },
            deviation_m: touched.deviation_m,
        })
    }

    /// Volume of each piece of the cells, m³, and the piece of each of `places`: positions relative to the mesh's centre, m, with the
    /// outward normals of the surface there.
    ///
    /// # Errors
    /// [`MeshError::TooManyNodes`].
    pub(crate) fn pieces(
        &self,
        places: impl Iterator<Item = (DVec3, DVec3)>,
    ) -> Result<(Vec<f64>, Vec<usize>), MeshError> {
        let parts = self.parts()?;
        let kept = KeptCells::choose(&self.grid, &parts);
        let pieces = kept.pieces(&parts);
        let embedding = Embedding::new(self.grid, &parts, &kept);
        let mut piece_of = vec![0; kept.cells.len()];
        for (piece, cells) in pieces.iter().enumerate() {
            cells.iter().for_each(|&cell| piece_of[cell] = piece);
        }
        let cell_m3 = self.grid.cell_m.powi(3);
        let volume = |cells: &Vec<usize>| cells.iter().map(|&cell| cell_m3 * kept.cells[cell].1).sum();
        let of_places = places.map(|(place_m, normal)| match pieces.len() {
            1 => 0,
            _ => piece_of[embedding.locate(place_m, normal).0],
        });
        Ok((pieces.iter().map(volume).collect(), of_places.collect()))
    }

    fn parts(&self) -> Result<Arc<CellParts>, MeshError> {
        if let Some(parts) = self.computed.parts.get() {
            return Ok(Arc::clone(parts));
        }
        let fill = fill::fill(self.mesh, &self.grid);
        // A lattice has at least as many nodes as cells, and few of its cells are slivers.
        let cells = fill.cells_above(WHOLE_CELL);
        if cells > 2 * Self::MAX_NODES {
            self.check_nodes(cells)?;
        }
        let parts = self.parts_of(fill)?;
        Ok(Arc::clone(self.computed.parts.get_or_init(|| parts)))
    }

    /// The parts of the cells that are filled as `fill`.
    fn parts_of(&self, fill: fill::Fill) -> Result<Arc<CellParts>, MeshError> {
        let parts = CellParts::new(self.mesh, &self.grid, fill);
        if parts.parts.is_empty() {
            // The mesh fills less of any cell than rounding leaves.
            let (cell_m, size_m) = (self.grid.cell_m, 2.0 * self.mesh.half_size_m().max_element());
            return Err(MeshError::Cells { cell_m, cells: size_m / cell_m, size_m });
        }
        Ok(Arc::new(parts))
    }

    fn check_nodes(&self, nodes: usize) -> Result<(), MeshError> {
        let most = Self::MAX_NODES;
        if nodes <= most {
            return Ok(());
        }
        // Assume the filled share of the corners of a box; with few cells slightly more lie at the surface.
        let along = self.grid.along();
        let shares = self.grid.cells.map(|cells| cells as f64 / along as f64);
        let corners =
            |cells: usize| shares.iter().map(|share| (share * cells as f64).ceil() + 1.0).product::<f64>();
        let filled = nodes as f64 / corners(along);
        let fits = |cells: &usize| (1.05 * filled).min(1.0) * corners(*cells) <= most as f64;
        let advised = (1..along).rev().find(fits).unwrap_or(1);
        Err(MeshError::TooManyNodes { along, nodes, most, advised })
    }

    fn fixed(&self, embedding: &Embedding<'_>, rest_m: &[DVec3]) -> Result<Vec<bool>, MeshError> {
        let mut fixed = vec![false; rest_m.len()];
        let empty = |what, index| MeshError::EmptyRegion { what, index, cell_m: self.grid.cell_m };
        for (index, region) in self.fixed.iter().enumerate() {
            let mut any = false;
            for (fixed, _) in fixed.iter_mut().zip(rest_m).filter(|(_, x)| region.contains(**x)) {
                (*fixed, any) = (true, true);
            }
            if !any {
                return Err(empty("fixed region", index));
            }
        }
        for (index, named) in self.fixed_vertices.iter().enumerate() {
            let places = self.named_positions_m(named);
            if places.is_empty() {
                return Err(empty("list of fixed vertices", index));
            }
            for place_m in places {
                let (cell, local) = embedding.locate(place_m, DVec3::ZERO);
                for (node, weight) in embedding.cells()[cell].into_iter().zip(trilinear_weights(local)) {
                    fixed[node] |= weight >= 0.125 - 1e-9;
                }
            }
        }
        Ok(fixed)
    }

    /// Positions of the named vertices, and of places at most half a cell apart on triangles with three named
    /// corners, relative to the mesh's centre, m.
    fn named_positions_m(&self, named: &[bool]) -> Vec<DVec3> {
        let mut points = vec![false; self.mesh.points_m().len()];
        let named = named.iter().enumerate().filter(|(_, is_named)| **is_named);
        for point in named.filter_map(|(vertex, _)| self.mesh.point_of(vertex)) {
            points[point] = true;
        }
        let at = self.mesh.points_m();
        let mut places: Vec<DVec3> =
            (0..at.len()).filter(|&point| points[point]).map(|point| at[point]).collect();
        let of_points =
            |t: &[usize; 3]| t.map(|vertex| self.mesh.point_of(vertex).filter(|&point| points[point]));
        for corners in self.mesh.triangles().iter().map(of_points) {
            let [Some(a), Some(b), Some(c)] = corners else { continue };
            let [a, b, c] = [a, b, c].map(|point| at[point]);
            let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
            let parts = (2.0 * longest / self.grid.cell_m).ceil() as usize;
            for (p, q) in (0..=parts).flat_map(|p| (0..=parts - p).map(move |q| (p, q))) {
                places.push(a + (b - a) * (p as f64 / parts as f64) + (c - a) * (q as f64 / parts as f64));
            }
        }
        places
    }
}

/// Tolerance of a whole number of cells.
const WHOLE_TOLERANCE: f64 = 1e-6;
/// Maximum spacing of the coordinate grid of vertices, in cells. With ten cells it is a thousandth of the body's
/// size. Beyond it, faces of a fine mesh are visibly rotated.
const MAX_GRID_CELLS: f64 = 0.01;
