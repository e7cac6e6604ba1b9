//! A closed triangle mesh that encloses a body.

mod assumptions;
mod closed_surface;
mod coincident;
mod cracks;
mod crossing;
mod distance_transform;
mod edges;
mod enclose;
mod error;
mod geometry;
mod inside;
mod measured;
mod open_parts;
mod orient;
mod repairs;
mod surface_nets;
mod thicken;
mod thin_parts;
mod weld;
mod welded_mesh;
mod winding_samples;
mod winding_tree;

pub use assumptions::MeshAssumptions;
pub use error::MeshError;
pub use repairs::MeshRepairs;
pub use thin_parts::ThinParts;

use geometry::volume;
use glam::DVec3;
use measured::Measured;
use welded_mesh::{Closed, WeldedMesh};

/// A closed surface of triangles, created from a mesh that encloses a volume.
///
/// # Accepted and rejected meshes
///
/// | property of the mesh | result |
/// | --- | --- |
/// | coincident vertices, as glTF splits them along seams | welded within 1e-6 of its size ([`MeshRepairs::welded`]) |
/// | degenerate or repeated triangles | omitted |
/// | pairs of opposite triangles: an inner wall without thickness, or every triangle in both windings | omitted |
/// | inconsistent or inverted winding | flipped ([`MeshRepairs::turned`]) |
/// | several closed parts | accepted; they may touch |
/// | a closed part inside another, with opposite orientation | a cavity |
/// | an edge of four or more triangles with a consistent winding | accepted ([`MeshRepairs::pinched_edges`]) |
/// | holes, other edges of three or more triangles, one-sided, flat or self-intersecting parts | [`MeshError`] |
/// | a longest side below 1 mm or above 10 m; more than two million triangles | [`MeshError`] |
///
/// All computations are relative to the mesh's centre, so the mesh may lie anywhere. A single-precision mesh
/// ([`ClosedMesh::from_single`]) is limited by its digits. Triangles that only touch, or that intersect by less than
/// 1e-6 of the mesh's size, do not count as intersecting.
#[derive(Clone, Debug)]
pub struct ClosedMesh {
    closed: Closed,
    normals: Option<Vec<DVec3>>,
    volume_m3: f64,
    /// Spacing of the coordinate grid of the vertices, m, if it is known.
    grid_m: Option<f64>,
}

/// How a mesh becomes a closed surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MeshClosing {
    /// The mesh must be closed by itself, as for [`ClosedMesh::new`].
    Strict,
    /// The surface encloses the inside of the mesh, as of [`ClosedMesh::enclose`].
    Enclose {
        /// Thickness of open parts, m.
        thickness_m: Option<f64>,
    },
}

impl From<Closed> for ClosedMesh {
    fn from(closed: Closed) -> Self {
        let points_m = closed.enclosing_m.as_deref().unwrap_or(&closed.points_m);
        Self { volume_m3: volume(&closed.closed, points_m), closed, normals: None, grid_m: None }
    }
}

impl ClosedMesh {
    /// Maximum number of triangles of a mesh. The maximum number of vertices is three times as large.
    pub const MAX_TRIANGLES: usize = crate::limits::MAX_MESH_TRIANGLES;
    /// Minimum length of the longest side, m.
    pub const MIN_SIZE_M: f64 = crate::limits::MIN_MESH_SIZE_M;
    /// Maximum length of the longest side, m.
    pub const MAX_SIZE_M: f64 = crate::limits::MAX_MESH_SIZE_M;

    /// Creates the closed surface of `triangles`, given as indices into `vertices_m` (m).
    ///
    /// # Errors
    /// [`MeshError`] with the remedy; see the table above.
    pub fn new(vertices_m: Vec<DVec3>, triangles: Vec<[usize; 3]>) -> Result<Self, MeshError> {
        let measured = Measured::of(&vertices_m, &triangles)?;
        let grid_m = if measured.is_single { measured.distance_m() * f64::from(f32::EPSILON) } else { 0.0 };
        Self::close_measured(vertices_m, triangles, measured, grid_m)
    }

    /// Creates the closed surface of `triangles`, given as indices into the single-precision `vertices`, in units of
    /// `scale_m` metres.
    ///
    /// The precision of the vertices is then known for any scale. Fitting cells to a mesh too far from its origin
    /// fails with [`MeshError::CoarseGrid`].
    ///
    /// # Errors
    /// [`MeshError`], as [`ClosedMesh::new`].
    pub fn from_single(
        vertices: &[[f32; 3]],
        scale_m: f64,
        triangles: Vec<[usize; 3]>,
    ) -> Result<Self, MeshError> {
        let vertices_m = in_metres(vertices, scale_m);
        let measured = Measured::of(&vertices_m, &triangles)?;
        let grid_m = measured.distance_m() * f64::from(f32::EPSILON);
        let mut mesh = Self::close_measured(vertices_m, triangles, measured, grid_m)?;
        mesh.grid_m = Some(grid_m);
        Ok(mesh)
    }

    fn close_measured(
        vertices_m: Vec<DVec3>,
        triangles: Vec<[usize; 3]>,
        measured: Measured,
        grid_m: f64,
    ) -> Result<Self, MeshError> {
        let close = |mesh: WeldedMesh| mesh.close().map(Self::from).map_err(|failed| failed.0);
        WeldedMesh::new(vertices_m, triangles, measured.bounds_m)
            .and_then(close)
            .map_err(|error| measured.reason(error, grid_m))
    }

    /// Creates a closed surface around the inside of `triangles`, given as indices into `vertices_m` (m), whether or not they are closed: the
    /// inside is where the generalised winding number of the triangles is beyond 1/2. Holes count as closed, overlapping parts as united, and
    /// parts that face inward are turned.
    ///
    /// A mesh that [`ClosedMesh::new`] accepts gives the same result. Cracks of up to 1e-4 of the size are welded if this closes at least half
    /// of the open edges. Small holes of a mesh that does not pass through itself are closed by fans of triangles. Otherwise the surface is
    /// extracted from samples, 128 along the longest side, or up to 256 for a thin mesh, and moved onto the triangles.
    /// [`ClosedMesh::assumptions`] reports both. With `thickness_m`, open parts are sheets of that thickness, centred on their triangles, instead.
    ///
    /// # Errors
    /// [`MeshError`]: [`MeshError::NoInside`] if the triangles have no inside, [`MeshError::Tangled`] if they are so many and so large that samples
    /// would take too long, [`MeshError::Thickness`], and those about indices, coordinates and size.
    pub fn enclose(
        vertices_m: Vec<DVec3>,
        triangles: Vec<[usize; 3]>,
        thickness_m: Option<f64>,
    ) -> Result<Self, MeshError> {
        let measured = Measured::of(&vertices_m, &triangles)?;
        let grid_m = if measured.is_single { measured.distance_m() * f64::from(f32::EPSILON) } else { 0.0 };
        Self::enclose_measured(vertices_m, triangles, thickness_m, measured, grid_m)
    }

    /// [`ClosedMesh::enclose`] of single-precision `vertices` in units of `scale_m` metres; see [`ClosedMesh::from_single`].
    ///
    /// # Errors
    /// As [`ClosedMesh::enclose`].
    pub fn enclose_single(
        vertices: &[[f32; 3]],
        scale_m: f64,
        triangles: Vec<[usize; 3]>,
        thickness_m: Option<f64>,
    ) -> Result<Self, MeshError> {
        let vertices_m = in_metres(vertices, scale_m);
        let measured = Measured::of(&vertices_m, &triangles)?;
        let grid_m = measured.distance_m() * f64::from(f32::EPSILON);
        let mut mesh = Self::enclose_measured(vertices_m, triangles, thickness_m, measured, grid_m)?;
        mesh.grid_m = Some(grid_m);
        Ok(mesh)
    }

    fn enclose_measured(
        vertices_m: Vec<DVec3>,
        triangles: Vec<[usize; 3]>,
        thickness_m: Option<f64>,
        measured: Measured,
        grid_m: f64,
    ) -> Result<Self, MeshError> {
        let size_m = measured.size_m();
        if let Some(thickness_m) = thickness_m.filter(|thickness_m| !thicken::is_valid(*thickness_m, size_m))
        {
            return Err(MeshError::Thickness { thickness_m, size_m });
        }
        let mesh = WeldedMesh::new(vertices_m, triangles, measured.bounds_m)
            .map_err(|error| measured.reason(error, grid_m))?;
        let (error, mesh) = match mesh.close() {
            Ok(closed) => return Ok(closed.into()),
            Err(failed) => *failed,
        };
        let failure = match measured.reason(error, grid_m) {
            failure @ (MeshError::Holes { .. }
            | MeshError::NonManifold { .. }
            | MeshError::OneSided { .. }
            | MeshError::Crossing { .. }
            | MeshError::Tangled { .. }
            | MeshError::Nested { .. }
            | MeshError::Flat { .. }) => failure,
            error => return Err(error),
        };
        let closed = match mesh.weld_cracks() {
            (mesh, false) => mesh.enclose(&failure, thickness_m)?,
            (mesh, true) => mesh.close().or_else(|failed| failed.1.enclose(&failed.0, thickness_m))?,
        };
        Ok(closed.into())
    }

    /// Adds the normal of each vertex as drawn. Where coincident vertices have different normals, the drawn edge
    /// stays hard.
    ///
    /// # Errors
    /// [`MeshError::Length`] if the number of normals is not the number of vertices.
    pub fn with_normals(mut self, normals: Vec<DVec3>) -> Result<Self, MeshError> {
        let (found, vertices) = (normals.len(), self.closed.vertices_m.len());
        if found != vertices {
            return Err(MeshError::Length { what: "the list of normals", found, vertices });
        }
        self.normals = Some(normals);
        Ok(self)
    }

    /// Vertices as given, m.
    #[must_use]
    pub fn vertices_m(&self) -> &[DVec3] {
        &self.closed.vertices_m
    }

    /// Triangles to draw: as given, in the same order, with corrected winding.
    #[must_use]
    pub fn triangles(&self) -> &[[usize; 3]] {
        &self.closed.drawn
    }

    /// Enclosed volume without cavities, m³.
    #[must_use]
    pub fn volume_m3(&self) -> f64 {
        self.volume_m3
    }

    /// Minimum and maximum coordinates, m, with the thickness of sheets.
    #[must_use]
    pub fn bounds_m(&self) -> [DVec3; 2] {
        [self.closed.center_m - self.closed.half_size_m, self.closed.center_m + self.closed.half_size_m]
    }

    /// Number of closed surfaces, including cavities.
    #[must_use]
    pub fn parts(&self) -> usize {
        self.closed.parts
    }

    /// Repairs of the mesh.
    #[must_use]
    pub fn repairs(&self) -> MeshRepairs {
        self.closed.repairs
    }

    /// Assumptions about a mesh that is not closed by itself; `None` for one that is.
    #[must_use]
    pub fn assumptions(&self) -> Option<MeshAssumptions> {
        self.closed.assumptions
    }

    /// Whether `place_m` is inside. The test is exact after vertices and place are rounded to 2⁻²⁵ of the mesh's
    /// size.
    #[must_use]
    pub fn contains(&self, place_m: DVec3) -> bool {
        self.closed.inside.winding(place_m - self.closed.center_m) > 0
    }

    pub(crate) fn center_m(&self) -> DVec3 {
        self.closed.center_m
    }

    pub(crate) fn half_size_m(&self) -> DVec3 {
        self.closed.half_size_m
    }

    /// Welded vertices, relative to the centre, m.
    pub(crate) fn points_m(&self) -> &[DVec3] {
        &self.closed.points_m
    }

    /// Points of the enclosing surface, relative to the centre, m.
    pub(crate) fn enclosing_points_m(&self) -> &[DVec3] {
        self.closed.enclosing_m.as_deref().unwrap_or(&self.closed.points_m)
    }

    /// Triangles of the enclosing surface, counter-clockwise as seen from outside, as indices of
    /// [`ClosedMesh::enclosing_points_m`].
    pub(crate) fn closed_triangles(&self) -> &[[usize; 3]] {
        &self.closed.closed
    }

    /// Tree over the boxes of the triangles of the enclosing surface, which are slightly enlarged.
    pub(crate) fn enclosing_bvh(&self) -> &parry3d_f64::partitioning::Bvh {
        self.closed.inside.bvh()
    }

    /// Where the line along `axis` through `at_m` crosses a triangle of the enclosing surface: +1 or −1 as it leaves or enters, and the
    /// coordinate, m. Places are relative to the centre.
    pub(crate) fn line_crossing(&self, triangle: usize, axis: usize, at_m: DVec3) -> Option<(i64, f64)> {
        self.closed.inside.line_crossing(triangle, axis, at_m)
    }

    /// The welded vertex of a vertex; `None` for one that no triangle uses.
    pub(crate) fn point_of(&self, vertex: usize) -> Option<usize> {
        self.closed.point_of.of(vertex)
    }

    /// Maximum absolute coordinate, and the spacing of the coordinate grid of the vertices there, m; `None` if the
    /// spacing is unknown.
    pub(crate) fn grid_m(&self) -> Option<(f64, f64)> {
        let [low, high] = self.bounds_m();
        self.grid_m.map(|grid_m| (low.abs().max(high.abs()).max_element(), grid_m))
    }

    pub(crate) fn normals(&self) -> Option<&[DVec3]> {
        self.normals.as_deref()
    }
}

/// Single-precision `vertices` in units of `scale_m` metres, m.
fn in_metres(vertices: &[[f32; 3]], scale_m: f64) -> Vec<DVec3> {
    vertices.iter().map(|x| scale_m * DVec3::from_array(x.map(f64::from))).collect()
}
