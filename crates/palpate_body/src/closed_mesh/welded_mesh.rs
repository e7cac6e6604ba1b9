//! A mesh with welded vertices, before it is closed.

use super::closed_surface::ClosedSurface;
use super::coincident::{self, Distinct};
use super::enclose::{self, Enclosing, Given};
use super::geometry::{TOLERANCE, same_winding};
use super::inside::Inside;
use super::measured::check_size;
use super::weld::{self, PointOfVertex, Welded};
use super::{MeshAssumptions, MeshError, MeshRepairs, cracks, crossing, orient};
use glam::DVec3;

/// A mesh whose coincident vertices are welded.
pub(super) struct WeldedMesh {
    vertices_m: Vec<DVec3>,
    /// Triangles as given.
    drawn: Vec<[usize; 3]>,
    center_m: DVec3,
    half_size_m: DVec3,
    welded: Welded,
}

/// A triangle by its index in the mesh, and its points.
type OfPoints = (usize, [usize; 3]);

impl WeldedMesh {
    /// Welds the vertices that are within [`TOLERANCE`] of each other.
    ///
    /// # Errors
    /// [`MeshError::Size`], [`MeshError::Flat`].
    pub(super) fn new(
        vertices_m: Vec<DVec3>,
        drawn: Vec<[usize; 3]>,
        (low_m, high_m): (DVec3, DVec3),
    ) -> Result<Self, MeshError> {
        let size_m = (high_m - low_m).max_element();
        let center_m = 0.5 * (low_m + high_m);
        check_size(size_m, center_m)?;
        let welded = weld::weld(&vertices_m, &drawn, center_m, TOLERANCE * size_m);
        let half_size_m = 0.5 * (high_m - low_m);
        Ok(Self { vertices_m, drawn, center_m, half_size_m, welded })
    }

    fn size_m(&self) -> f64 {
        2.0 * self.half_size_m.max_element()
    }

    /// The triangles with three different points.
    fn of_points(&self) -> Vec<OfPoints> {
        let points = |(index, corners): (usize, &[usize; 3])| {
            (index, corners.map(|vertex| self.welded.point_of.of(vertex).unwrap_or_default()))
        };
        self.drawn
            .iter()
            .enumerate()
            .map(points)
            .filter(|(_, [a, b, c])| a != b && b != c && c != a)
            .collect()
    }

    /// The mesh as a closed surface, or the error with the mesh.
    pub(super) fn close(mut self) -> Result<Closed, Box<(MeshError, Self)>> {
        match self.oriented() {
            Ok(surface) => Ok(self.closed(surface)),
            Err(error) => Err(Box::new((error, self))),
        }
    }

    /// The triangles as a closed surface that faces outward.
    fn oriented(&mut self) -> Result<Oriented, MeshError> {
        let (center_m, tolerance_m) = (self.center_m, TOLERANCE * self.size_m());
        let of_points = self.of_points();
        let points_m = &self.welded.points_m;
        let surface = coincident::without_coincident(&of_points, |triangles| {
            orient::orient(triangles, points_m, center_m)
        })?;
        let orient::Oriented { mut triangles, part, parts, pinched_edges } = surface.oriented;
        orient::check_thickness(&triangles, &part, parts, points_m, center_m, tolerance_m)?;
        let mut inside = Inside::new(&triangles, points_m, self.half_size_m);
        crossing::check(inside.bvh(), &triangles, 0, points_m, (center_m, tolerance_m))?;
        let looks_in = inside.parts_to_turn(&part, parts, center_m)?;
        if looks_in.contains(&true) {
            for (triangle, _) in triangles.iter_mut().zip(&part).filter(|(_, part)| looks_in[**part]) {
                triangle.swap(1, 2);
            }
            inside.turn(&part, &looks_in);
        }
        let repairs = MeshRepairs {
            welded: self.welded.count,
            collapsed: self.drawn.len() - of_points.len(),
            duplicates: surface.duplicates,
            back_to_back: surface.back_to_back,
            // The drawn triangles follow. Omitted ones keep their winding.
            turned: turn(&mut self.drawn, surface.kept.iter().map(|&k| of_points[k]), &triangles),
            pinched_edges,
        };
        Ok(Oriented { triangles, parts, inside, repairs })
    }

    fn closed(self, surface: Oriented) -> Closed {
        Closed {
            vertices_m: self.vertices_m,
            drawn: self.drawn,
            point_of: self.welded.point_of,
            center_m: self.center_m,
            half_size_m: self.half_size_m,
            points_m: self.welded.points_m,
            closed: surface.triangles,
            enclosing_m: None,
            assumptions: None,
            parts: surface.parts,
            repairs: surface.repairs,
            inside: surface.inside,
        }
    }

    /// Welds the vertices along cracks, and returns whether there are any.
    pub(super) fn weld_cracks(mut self) -> (Self, bool) {
        let size_m = self.size_m();
        let (welded, tolerance) =
            cracks::weld_cracks(self.welded, &self.vertices_m, &self.drawn, self.center_m, size_m);
        self.welded = welded;
        (self, tolerance > TOLERANCE)
    }

    /// A closed surface around the inside of the mesh, whose closing failed with `failure`; open parts have `thickness_m`, if it is given.
    ///
    /// # Errors
    /// [`MeshError::NoInside`], [`MeshError::Tangled`].
    pub(super) fn enclose(
        mut self,
        failure: &MeshError,
        thickness_m: Option<f64>,
    ) -> Result<Closed, MeshError> {
        let of_points = self.of_points();
        let Distinct { kept, duplicates, back_to_back } = coincident::distinct(&of_points, true);
        let collapsed = self.drawn.len() - of_points.len();
        let (kept, triangles): (Vec<usize>, Vec<[usize; 3]>) = kept.iter().map(|&k| of_points[k]).unzip();
        drop(of_points);
        let tolerance_m = TOLERANCE * self.size_m();
        let half_size_m = self.half_size_m + 0.5 * thickness_m.unwrap_or(0.0);
        let enclosed = enclose::enclose(&Given {
            triangles: &triangles,
            points_m: &self.welded.points_m,
            center_m: self.center_m,
            half_size_m,
            thickness_m,
            tolerance_m,
            // Closing may have kept one of two opposite triangles.
            crossing_count: crossing_count(failure).filter(|_| back_to_back == 0),
        })?;
        let Enclosing { surface: ClosedSurface { points_m: enclosing_m, triangles: closed }, inside } =
            enclosed.surface;
        let repairs = MeshRepairs {
            welded: self.welded.count,
            collapsed,
            duplicates,
            back_to_back,
            turned: turn(&mut self.drawn, kept.into_iter().zip(triangles), &enclosed.oriented),
            pinched_edges: enclosed.assumptions.branching_edge_count,
        };
        Ok(Closed {
            vertices_m: self.vertices_m,
            drawn: self.drawn,
            point_of: self.welded.point_of,
            center_m: self.center_m,
            half_size_m,
            points_m: self.welded.points_m,
            closed,
            enclosing_m: Some(enclosing_m),
            parts: enclosed.assumptions.part_count,
            assumptions: Some(enclosed.assumptions),
            repairs,
            inside,
        })
    }
}

/// Number of pairs of triangles that cross, if it is known from the error of closing a mesh.
fn crossing_count(error: &MeshError) -> Option<usize> {
    match *error {
        MeshError::Crossing { pairs, .. } => Some(pairs),
        MeshError::Tangled { .. } => Some(1),
        MeshError::Nested { .. } => Some(0),
        _ => None,
    }
}

/// A surface that is closed by itself.
struct Oriented {
    /// Triangles that face outward.
    triangles: Vec<[usize; 3]>,
    parts: usize,
    inside: Inside,
    repairs: MeshRepairs,
}

/// A mesh with the closed surface around its inside.
#[derive(Clone, Debug)]
pub(super) struct Closed {
    /// Vertices as given.
    pub vertices_m: Vec<DVec3>,
    /// Triangles as given, flipped where needed; includes those omitted from the volume.
    pub drawn: Vec<[usize; 3]>,
    pub point_of: PointOfVertex,
    pub center_m: DVec3,
    pub half_size_m: DVec3,
    /// Welded vertices, relative to the centre, m.
    pub points_m: Vec<DVec3>,
    /// The enclosing surface: triangles, counter-clockwise as seen from outside, and its own points if they are not the welded vertices.
    pub closed: Vec<[usize; 3]>,
    pub enclosing_m: Option<Vec<DVec3>>,
    pub assumptions: Option<MeshAssumptions>,
    pub parts: usize,
    pub repairs: MeshRepairs,
    pub inside: Inside,
}

/// Turns the `drawn` triangles whose winding differs from `oriented`, and returns their number. `given` has the index of each and its corners
/// before.
fn turn(drawn: &mut [[usize; 3]], given: impl Iterator<Item = OfPoints>, oriented: &[[usize; 3]]) -> usize {
    let mut turned = 0;
    for ((index, given), now) in given.zip(oriented) {
        if !same_winding(given, *now) {
            drawn[index].swap(1, 2);
            turned += 1;
        }
    }
    turned
}
