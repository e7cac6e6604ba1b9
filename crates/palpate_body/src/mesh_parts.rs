//! A closed mesh in several parts, for example the primitives of a glTF mesh.

use crate::cell_lattice::ComputedCells;
use crate::triangle_bvh::triangle_bvh;
use crate::{CellLattice, CellSize, ClosedMesh, MeshClosing, MeshError, PieceSelection, Region};
use glam::DVec3;
use parry3d_f64::partitioning::{Bvh, BvhNode};
use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::Triangle;
use std::sync::Arc;

/// Triangles of a part of a mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshPart {
    /// Vertices, in the unit of the mesh.
    pub vertices: Vec<[f32; 3]>,
    /// Triangles, as indices of the vertices.
    pub triangles: Vec<[usize; 3]>,
    /// Normals of the vertices, if there are any.
    pub normals: Option<Vec<DVec3>>,
}

/// A closed mesh joined of parts, with the region of each part.
#[derive(Clone, Debug)]
pub struct JoinedMesh {
    /// The surface of the body: the vertices of the joined parts, one part after the other.
    pub mesh: ClosedMesh,
    /// Region of each part after the first. The first part is the rest of the body.
    pub regions: Vec<Region>,
    /// Indices of the parts that belong to the surface. The others lie inside.
    pub joined: Vec<usize>,
    /// Number of pieces of the joined surface that are not connected.
    pub piece_count: usize,
    /// Share of the selected pieces in the volume, from 0 to 1.
    pub piece_share: f64,
    /// Size of the cells for the selected pieces: [`JoinOptions::cells`], where [`CellSize::Automatic`] is replaced by the chosen
    /// [`CellSize::Along`].
    pub cells: CellSize,
    computed: ComputedCells,
}

/// How parts are joined to the surface of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JoinOptions {
    /// Length of a unit of the parts, m.
    pub scale_m: f64,
    /// How the surface is closed.
    pub closing: MeshClosing,
    /// Pieces of the surface that are kept.
    pub pieces: PieceSelection,
    /// Size of the cells with which pieces are found, and of those of the body.
    pub cells: CellSize,
}

/// Number of samples along each side of a part's bounds, which show whether it lies inside the others.
const SAMPLES: usize = 8;

impl JoinedMesh {
    /// Joins `parts`.
    ///
    /// A part with holes belongs to the surface; together such parts must close it. Its region contains the places that are
    /// nearer to its triangles than to those of the other parts of the surface. A closed part that lies inside, with at
    /// least half of its volume, is an inclusion: its region is its inside, with its boundary. Another closed part belongs to
    /// the surface, and its region is its inside too. The surface has normals if all its parts have them.
    ///
    /// # Errors
    /// [`MeshError`] of the joined surface; indices of triangles and vertices count through the joined parts.
    pub fn new(parts: &[MeshPart], options: JoinOptions) -> Result<Self, MeshError> {
        let JoinOptions { scale_m, .. } = options;
        let close = |indices: &[usize]| close(join(indices.iter().map(|&index| &parts[index])), &options);
        let closed: Vec<Option<Arc<ClosedPart>>> = (0..parts.len())
            .map(
                |index| if index == 0 { None } else { ClosedPart::new(&parts[index], scale_m).map(Arc::new) },
            )
            .collect();
        let mut joined: Vec<usize> = (0..parts.len()).filter(|&index| closed[index].is_none()).collect();
        let mut mesh = close(&joined)?;
        let beside = |(index, part): (usize, &Option<Arc<ClosedPart>>)| {
            part.as_ref().filter(|part| !part.is_inside(&mesh)).map(|_| index)
        };
        let beside: Vec<usize> = closed.iter().enumerate().filter_map(beside).collect();
        if !beside.is_empty() {
            joined.extend(beside);
            joined.sort_unstable();
            mesh = close(&joined)?;
        }
        let mut nearest = None;
        let mut region = |index: usize| match &closed[index] {
            Some(part) => {
                let part = Arc::clone(part);
                Region::from_fn(move |x| part.contains(x))
            }
            None => {
                let nearest =
                    nearest.get_or_insert_with(|| Arc::new(PartTriangles::new(parts, &joined, scale_m)));
                let nearest = Arc::clone(nearest);
                Region::from_fn(move |x| nearest.nearest_part(x, f64::INFINITY) == Some(index))
            }
        };
        let regions = (1..parts.len()).map(&mut region).collect();
        let Selected { mesh, piece_count, piece_share, cells, computed } =
            select(mesh, &joined, parts, &options)?;
        Ok(Self { mesh, regions, joined, piece_count, piece_share, cells, computed })
    }

    /// Cells of the size [`JoinedMesh::cells`], fitted to [`JoinedMesh::mesh`]. What was computed of them to find the pieces is not computed
    /// again.
    ///
    /// # Errors
    /// As [`CellLattice::fit`].
    pub fn lattice(&self) -> Result<CellLattice<'_>, MeshError> {
        Ok(CellLattice::fit(&self.mesh, self.cells)?.with_computed(self.computed.clone()))
    }
}

fn close(joined: MeshPart, options: &JoinOptions) -> Result<ClosedMesh, MeshError> {
    let MeshPart { vertices, triangles, normals } = joined;
    let mesh = match options.closing {
        MeshClosing::Strict => ClosedMesh::from_single(&vertices, options.scale_m, triangles)?,
        MeshClosing::Enclose { thickness_m } => {
            ClosedMesh::enclose_single(&vertices, options.scale_m, triangles, thickness_m)?
        }
    };
    match normals {
        Some(normals) => mesh.with_normals(normals),
        None => Ok(mesh),
    }
}

/// The selected pieces of a mesh.
struct Selected {
    mesh: ClosedMesh,
    /// Number of pieces of the whole mesh.
    piece_count: usize,
    /// Share of the selected pieces in the volume.
    piece_share: f64,
    cells: CellSize,
    computed: ComputedCells,
}

/// Maximum number of times that a piece is selected: the selected triangles alone have finer cells and samples, and may be several pieces.
const MAX_SELECTIONS: usize = 2;

/// Selects pieces of `mesh`. Errors of the cells are those of the body.
fn select(
    mut mesh: ClosedMesh,
    joined: &[usize],
    parts: &[MeshPart],
    options: &JoinOptions,
) -> Result<Selected, MeshError> {
    let mut selected: Option<MeshPart> = None;
    let (mut piece_count, mut piece_share) = (1, 1.0);
    let mut selections = 0;
    loop {
        let (pieces, cells, computed) = match CellLattice::fit(&mesh, options.cells) {
            Ok(lattice) => {
                let pieces = mesh.pieces_of_cells(&lattice).unwrap_or_default();
                (pieces, chosen(&lattice, options), lattice.computed())
            }
            Err(_) => (Vec::new(), options.cells, ComputedCells::default()),
        };
        let wanted = if selections == 0 { options.pieces } else { PieceSelection::Largest };
        let index = wanted.index(pieces.len().max(1))?.filter(|_| pieces.len() > 1);
        if selections == 0 {
            piece_count = pieces.len();
        }
        let Some(index) = index.filter(|_| selections < MAX_SELECTIONS) else {
            return Ok(Selected { mesh, piece_count, piece_share, cells, computed });
        };
        piece_share *= pieces[index].volume_m3 / pieces.iter().map(|piece| piece.volume_m3).sum::<f64>();
        let part = selected.get_or_insert_with(|| join(joined.iter().map(|&index| &parts[index])));
        part.triangles = pieces[index].triangles.iter().map(|&triangle| part.triangles[triangle]).collect();
        mesh = close(part.clone(), options)?;
        selections += 1;
    }
}

/// The size of the cells of `lattice`, which was fitted with the size of `options`.
fn chosen(lattice: &CellLattice<'_>, options: &JoinOptions) -> CellSize {
    match options.cells {
        CellSize::Automatic { .. } => CellSize::Along(lattice.cells_along()),
        given => given,
    }
}

/// A part that is closed by itself.
struct ClosedPart {
    /// The part, magnified by `factor` if it is too small or too large for a body.
    mesh: ClosedMesh,
    factor: f64,
    triangles: PartTriangles,
    tolerance_m: f64,
}

/// Distance from the boundary of a part, relative to its size, up to which a place is in it.
const ON_BOUNDARY: f64 = 1e-6;

impl ClosedPart {
    /// `None` for a part that is not closed.
    fn new(part: &MeshPart, scale_m: f64) -> Option<Self> {
        let close =
            |factor: f64| ClosedMesh::from_single(&part.vertices, factor * scale_m, part.triangles.clone());
        let (mesh, factor) = match close(1.0) {
            Ok(mesh) => (mesh, 1.0),
            Err(MeshError::Size { size_m, .. }) => {
                let factor = 0.1 / size_m;
                (close(factor).ok()?, factor)
            }
            Err(_) => return None,
        };
        let [low, high] = mesh.bounds_m();
        let tolerance_m = ON_BOUNDARY * (high - low).max_element() / factor;
        let triangles = PartTriangles::new(std::slice::from_ref(part), &[0], scale_m);
        Some(Self { mesh, factor, triangles, tolerance_m })
    }

    /// Whether `x_m` is inside or on the boundary.
    fn contains(&self, x_m: DVec3) -> bool {
        self.mesh.contains(self.factor * x_m) || self.triangles.nearest_part(x_m, self.tolerance_m).is_some()
    }

    /// Whether at least half of the volume lies inside `mesh`.
    fn is_inside(&self, mesh: &ClosedMesh) -> bool {
        let [low, high] = self.mesh.bounds_m();
        let places = crate::lattice::grid([SAMPLES; 3]).map(|place| {
            let within = DVec3::from_array(place.map(|n| (n as f64 + 0.5) / SAMPLES as f64));
            low + within * (high - low)
        });
        let (inside, total) =
            places.filter(|place| self.mesh.contains(*place)).fold((0, 0), |(inside, total), place| {
                (inside + usize::from(mesh.contains(place / self.factor)), total + 1)
            });
        total > 0 && 2 * inside >= total
    }
}

/// The triangles of several parts, with the vertices one part after the other.
fn join<'a>(parts: impl Iterator<Item = &'a MeshPart>) -> MeshPart {
    let mut joined = MeshPart { normals: Some(Vec::new()), ..MeshPart::default() };
    for MeshPart { vertices, triangles, normals } in parts {
        // An index beyond the part's own vertices stays out of range, and is rejected.
        let (first, count) = (joined.vertices.len(), vertices.len());
        let shifted = |vertex: usize| if vertex < count { first + vertex } else { usize::MAX };
        joined.triangles.extend(triangles.iter().map(|t| t.map(shifted)));
        joined.vertices.extend(vertices);
        joined.normals = joined.normals.zip(normals.as_ref()).map(|(mut joined, normals)| {
            joined.extend(normals);
            joined
        });
    }
    joined
}

/// Triangles with the part to which each belongs.
struct PartTriangles {
    triangles: Vec<(Triangle, usize)>,
    bvh: Bvh,
}

impl PartTriangles {
    fn new(parts: &[MeshPart], joined: &[usize], scale_m: f64) -> Self {
        let of_part = |&index: &usize| {
            let MeshPart { vertices, triangles, .. } = &parts[index];
            let at_m = |vertex: usize| scale_m * DVec3::from_array(vertices[vertex].map(f64::from));
            triangles.iter().map(move |&[a, b, c]| (Triangle::new(at_m(a), at_m(b), at_m(c)), index))
        };
        let triangles: Vec<(Triangle, usize)> = joined.iter().flat_map(of_part).collect();
        let bvh = triangle_bvh(triangles.iter().map(|(Triangle { a, b, c }, _)| [*a, *b, *c]));
        Self { bvh, triangles }
    }

    /// Part of the triangle nearest to `x_m`; `None` if none is within `within_m`.
    fn nearest_part(&self, x_m: DVec3, within_m: f64) -> Option<usize> {
        let (_, (_, part)) = self.bvh.find_best(
            within_m,
            |node: &BvhNode, _| node.aabb().distance_to_local_point(x_m, true),
            |leaf, _| {
                let (triangle, part) = &self.triangles[leaf as usize];
                let distance_m = triangle.distance_to_local_point(x_m, false);
                Some((distance_m, *part))
            },
        )?;
        Some(part)
    }
}
