//! A closed triangle mesh: what encloses a body.

mod coincident;
mod crossing;
mod error;
mod geometry;
mod inside;
mod orient;
mod weld;

pub use error::MeshError;

use geometry::{TOLERANCE, same_winding, volume};
use glam::DVec3;
use inside::Inside;

/// A closed surface of triangles, made from any mesh that encloses a volume.
///
/// # What is taken, and what is not
///
/// | the mesh has | what becomes of it |
/// | --- | --- |
/// | vertices at one place, as glTF splits them along seams | welded, within 1e-6 of its size ([`MeshRepairs::welded`]) |
/// | triangles with two corners at one place, or named twice | left out |
/// | triangles back to back: a wall of no thickness within it, or every triangle in both windings | left out |
/// | triangles of mixed winding, or all inside out | turned ([`MeshRepairs::turned`]) |
/// | several closed parts | taken; they may touch |
/// | a closed part inside another that looks the other way | a cavity |
/// | an edge at which four triangles or more meet, in a winding that closes | taken ([`MeshRepairs::pinched_edges`]) |
/// | holes, other edges with three triangles or more, one side only, no thickness, parts that cross | [`MeshError`] |
/// | a longest side below 1 mm or above 10 m; more than two million triangles | [`MeshError`] |
///
/// Everything is computed relative to the mesh's centre, so that it may lie anywhere; in single precision
/// ([`ClosedMesh::from_single`]) as far from the origin as its digits last. Triangles that only touch, or cross
/// by less than 1e-6 of the mesh's size, do not count as crossing.
#[derive(Clone, Debug)]
pub struct ClosedMesh {
    /// As given.
    vertices_m: Vec<DVec3>,
    normals: Option<Vec<DVec3>>,
    /// The triangles given, turned where needed; those that were left out for the volume included.
    triangles: Vec<[usize; 3]>,
    /// The point of each vertex, if a triangle has it.
    point_of: Vec<Option<usize>>,
    center_m: DVec3,
    /// Welded vertices, relative to the centre, m.
    points_m: Vec<DVec3>,
    /// Of points, counter-clockwise seen from outside.
    closed: Vec<[usize; 3]>,
    parts: usize,
    volume_m3: f64,
    half_size_m: DVec3,
    repairs: MeshRepairs,
    inside: Inside,
    /// The least difference of two coordinates that its vertices could have, m, if they are known to be on such a grid.
    grid_m: Option<f64>,
}

/// What was put right in a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MeshRepairs {
    /// Vertices that were at the place of another.
    pub welded: usize,
    /// Triangles with two corners at one place.
    pub collapsed: usize,
    /// Triangles that repeated another.
    pub duplicates: usize,
    /// Triangles that lay back to back with another, and went with it.
    pub back_to_back: usize,
    /// Triangles whose winding was turned.
    pub turned: usize,
    /// Edges with four triangles or more.
    pub pinched_edges: usize,
}

/// Coordinates beyond that have no digits left for a body.
const FARTHEST_M: f64 = 1e15;

impl ClosedMesh {
    /// The most triangles of a mesh; of vertices there may be three times as many.
    pub const MAX_TRIANGLES: usize = 2_000_000;
    /// The least longest side, m.
    pub const MIN_SIZE_M: f64 = crate::limits::MIN_MESH_SIZE_M;
    /// The largest longest side, m.
    pub const MAX_SIZE_M: f64 = crate::limits::MAX_MESH_SIZE_M;

    /// The closed surface of `triangles`, which name `vertices_m` (m).
    ///
    /// # Errors
    /// [`MeshError`], which says what to do: see the table above.
    pub fn new(vertices_m: Vec<DVec3>, triangles: Vec<[usize; 3]>) -> Result<Self, MeshError> {
        let measured = Measured::of(&vertices_m, &triangles)?;
        let grid_m = if measured.is_single { measured.distance_m() * f64::from(f32::EPSILON) } else { 0.0 };
        Self::close_measured(vertices_m, triangles, measured, grid_m)
    }

    /// The closed surface of `triangles`, which name `vertices` in single precision, a unit of which is `scale_m` metres. How
    /// many digits they have is then known whatever the scale: a mesh too far from its origin for its cells is refused
    /// ([`MeshError::CoarseGrid`]) when cells are fitted to it.
    ///
    /// # Errors
    /// [`MeshError`], as [`ClosedMesh::new`].
    pub fn from_single(
        vertices: &[[f32; 3]],
        scale_m: f64,
        triangles: Vec<[usize; 3]>,
    ) -> Result<Self, MeshError> {
        let wide = |x: &[f32; 3]| scale_m * DVec3::from_array(x.map(f64::from));
        let vertices_m: Vec<DVec3> = vertices.iter().map(wide).collect();
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
        let (low, high) = measured.bounds_m;
        match Self::close(vertices_m, triangles, low, high) {
            // Holes, needles and crossings are the consequence there, not the fault.
            Err(_) if grid_m > 1e-3 * measured.size_m().max(Self::MIN_SIZE_M) => {
                Err(MeshError::LostDigits { distance_m: measured.distance_m(), grid_m })
            }
            made => made,
        }
    }

    fn close(
        vertices_m: Vec<DVec3>,
        mut drawn: Vec<[usize; 3]>,
        low_m: DVec3,
        high_m: DVec3,
    ) -> Result<Self, MeshError> {
        let size_m = (high_m - low_m).max_element();
        let center_m = 0.5 * (low_m + high_m);
        check_size(size_m, center_m)?;
        let tolerance_m = TOLERANCE * size_m;
        let welded = weld::weld(&vertices_m, &drawn, center_m, tolerance_m);
        let points_m = welded.points_m;
        let mut repairs = MeshRepairs { welded: welded.count, ..MeshRepairs::default() };
        let mut of_points: Vec<(usize, [usize; 3])> = Vec::with_capacity(drawn.len());
        for (index, corners) in drawn.iter().enumerate() {
            let [a, b, c] = corners.map(|vertex| welded.point_of[vertex].unwrap_or_default());
            if a == b || b == c || c == a {
                repairs.collapsed += 1;
            } else {
                of_points.push((index, [a, b, c]));
            }
        }
        let surface = coincident::without_coincident(&of_points, |triangles| {
            orient::orient(triangles, &points_m, center_m)
        })?;
        (repairs.duplicates, repairs.back_to_back) = (surface.duplicates, surface.back_to_back);
        repairs.pinched_edges = surface.oriented.pinched_edges;
        let mut triangles = surface.oriented.triangles;
        let part = surface.oriented.part;
        let parts = surface.oriented.parts;
        orient::check_thickness(&triangles, &part, parts, &points_m, center_m, tolerance_m)?;
        crossing::check(&triangles, &points_m, center_m, tolerance_m)?;
        let half_size_m = 0.5 * (high_m - low_m);
        let mut inside = Inside::new(&triangles, &points_m, half_size_m);
        let looks_in = inside.parts_to_turn(&part, parts, center_m)?;
        if looks_in.contains(&true) {
            for (triangle, part) in triangles.iter_mut().zip(&part) {
                if looks_in[*part] {
                    triangle.swap(1, 2);
                }
            }
            inside = Inside::new(&triangles, &points_m, half_size_m);
        }
        // Drawn triangles follow: those left out keep the winding they had.
        for ((index, given), now) in surface.kept.iter().map(|&k| of_points[k]).zip(&triangles) {
            if !same_winding(given, *now) {
                drawn[index].swap(1, 2);
                repairs.turned += 1;
            }
        }
        let volume_m3 = volume(&triangles, &points_m);
        Ok(Self {
            vertices_m,
            normals: None,
            triangles: drawn,
            point_of: welded.point_of,
            center_m,
            points_m,
            closed: triangles,
            parts,
            volume_m3,
            half_size_m,
            repairs,
            inside,
            grid_m: None,
        })
    }

    /// The same mesh with the normal at each vertex that it is drawn with: where vertices at one place have different
    /// normals, there is an edge that stays hard.
    ///
    /// # Errors
    /// [`MeshError::Length`] when there is not one normal for each vertex.
    pub fn with_normals(mut self, normals: Vec<DVec3>) -> Result<Self, MeshError> {
        let (found, vertices) = (normals.len(), self.vertices_m.len());
        if found != vertices {
            return Err(MeshError::Length { what: "the list of normals", found, vertices });
        }
        self.normals = Some(normals);
        Ok(self)
    }

    /// The vertices given, m.
    #[must_use]
    pub fn vertices_m(&self) -> &[DVec3] {
        &self.vertices_m
    }

    /// The triangles given, as indices of the vertices given and in the same order, turned where their winding was wrong:
    /// what to draw.
    #[must_use]
    pub fn triangles(&self) -> &[[usize; 3]] {
        &self.triangles
    }

    /// The volume it encloses, without its cavities, m³.
    #[must_use]
    pub fn volume_m3(&self) -> f64 {
        self.volume_m3
    }

    /// Its lowest and its highest coordinates, m.
    #[must_use]
    pub fn bounds_m(&self) -> [DVec3; 2] {
        [self.center_m - self.half_size_m, self.center_m + self.half_size_m]
    }

    /// How many closed surfaces it has, cavities among them.
    #[must_use]
    pub fn parts(&self) -> usize {
        self.parts
    }

    /// What was put right.
    #[must_use]
    pub fn repairs(&self) -> MeshRepairs {
        self.repairs
    }

    /// Whether `place_m` is inside: exact but for a rounding of vertices and place to 2⁻²⁵ of the mesh's size.
    #[must_use]
    pub fn contains(&self, place_m: DVec3) -> bool {
        self.inside.winding(place_m - self.center_m) > 0
    }

    pub(crate) fn center_m(&self) -> DVec3 {
        self.center_m
    }

    pub(crate) fn half_size_m(&self) -> DVec3 {
        self.half_size_m
    }

    /// Welded vertices, relative to the centre, m.
    pub(crate) fn points_m(&self) -> &[DVec3] {
        &self.points_m
    }

    /// Triangles of the welded vertices, counter-clockwise seen from outside.
    pub(crate) fn closed_triangles(&self) -> &[[usize; 3]] {
        &self.closed
    }

    /// The welded vertex of each vertex given, if a triangle has it.
    pub(crate) fn point_of(&self) -> &[Option<usize>] {
        &self.point_of
    }

    /// How far from the origin it reaches along an axis, and the least difference of two coordinates that its vertices could have
    /// there, m; `None` where that is not known to be more than rounding.
    pub(crate) fn grid_m(&self) -> Option<(f64, f64)> {
        let [low, high] = self.bounds_m();
        self.grid_m.map(|grid_m| (low.abs().max(high.abs()).max_element(), grid_m))
    }

    pub(crate) fn normals(&self) -> Option<&[DVec3]> {
        self.normals.as_deref()
    }
}

/// What is known of a mesh before anything is computed with it.
struct Measured {
    /// Of the vertices that triangles have.
    bounds_m: (DVec3, DVec3),
    /// Whether all of their coordinates are single-precision numbers.
    is_single: bool,
}

impl Measured {
    /// Of a mesh whose numbers can be computed with.
    fn of(vertices_m: &[DVec3], triangles: &[[usize; 3]]) -> Result<Self, MeshError> {
        if triangles.is_empty() {
            return Err(MeshError::Empty);
        }
        let most = ClosedMesh::MAX_TRIANGLES;
        for (what, found, most) in
            [("triangles", triangles.len(), most), ("vertices", vertices_m.len(), 3 * most)]
        {
            if found > most {
                return Err(MeshError::TooLarge { what, found, most });
            }
        }
        let vertices = vertices_m.len();
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|vertex| **vertex >= vertices) {
                return Err(MeshError::Index { triangle, vertex, vertices });
            }
        }
        let taken = |x: &DVec3| x.is_finite() && x.abs().max_element() < FARTHEST_M;
        if let Some(vertex) = vertices_m.iter().position(|x| !taken(x)) {
            return Err(MeshError::NotFinite { vertex });
        }
        let (mut low, mut high, mut is_single) = (DVec3::INFINITY, DVec3::NEG_INFINITY, true);
        for &vertex in triangles.iter().flatten() {
            let x = vertices_m[vertex];
            (low, high) = (low.min(x), high.max(x));
            is_single &= x.as_vec3().as_dvec3() == x;
        }
        Ok(Self { bounds_m: (low, high), is_single })
    }

    fn size_m(&self) -> f64 {
        (self.bounds_m.1 - self.bounds_m.0).max_element()
    }

    /// How far from the origin it reaches along an axis.
    fn distance_m(&self) -> f64 {
        let (low, high) = self.bounds_m;
        low.abs().max(high.abs()).max_element()
    }
}

fn check_size(size_m: f64, center_m: DVec3) -> Result<(), MeshError> {
    if (ClosedMesh::MIN_SIZE_M..=ClosedMesh::MAX_SIZE_M).contains(&size_m) {
        return Ok(());
    }
    if size_m < 1e-12 {
        return Err(MeshError::Flat { at_m: center_m });
    }
    // Millimetres, centimetres, inches taken for metres, and metres for something smaller; else a decimetre.
    let usual = [1e-3, 1e-2, 1e3, 1e-6, 1e6].into_iter().find(|f| (0.01..=2.0).contains(&(f * size_m)));
    let factor = usual.unwrap_or(0.1 / size_m);
    Err(MeshError::Size { size_m, factor })
}
