//! A closed surface around the inside of any mesh.

use super::assumptions::MeshAssumptions;
use super::closed_surface::ClosedSurface;
use super::geometry::volume;
use super::inside::Inside;
use super::open_parts::OpenParts;
use super::surface_nets::{self, is_inside};
use super::thicken::thicken;
use super::winding_samples::WindingSamples;
use super::{MeshError, crossing};
use crate::triangle_bvh::triangle_bvh;
use glam::DVec3;
use parry3d_f64::partitioning::Bvh;

/// Number of samples of the winding number along the longest side, and for a thin mesh. Fewer leave time for more random meshes.
const SAMPLES_ALONG: usize = if cfg!(fuzzing) { 24 } else { 128 };
const MAX_SAMPLES_ALONG: usize = 2 * SAMPLES_ALONG;
/// Number of samples across a sheet, or across the mean thickness of a mesh.
const SAMPLES_ACROSS: f64 = 3.0;
/// Minimum share of the samples inside of a component that is kept; smaller ones are specks where triangles cross.
const MIN_COMPONENT: f64 = 1e-4;

/// A mesh that is not closed by itself.
pub(super) struct Enclosed {
    /// The given triangles, turned where needed.
    pub oriented: Vec<[usize; 3]>,
    pub surface: Enclosing,
    pub assumptions: MeshAssumptions,
}

/// An enclosing surface with its inside test.
pub(super) struct Enclosing {
    pub surface: ClosedSurface,
    pub inside: Inside,
}

impl Enclosing {
    fn of(surface: ClosedSurface, half_size_m: DVec3) -> Self {
        Self { inside: Inside::new(&surface.triangles, &surface.points_m, half_size_m), surface }
    }
}

/// A mesh to enclose.
pub(super) struct Given<'a> {
    /// Triangles without repeated corners.
    pub triangles: &'a [[usize; 3]],
    /// Points within ±`half_size_m`, relative to the centre.
    pub points_m: &'a [DVec3],
    pub center_m: DVec3,
    /// Half of the size, with the thickness.
    pub half_size_m: DVec3,
    /// Thickness of open parts, which then become sheets.
    pub thickness_m: Option<f64>,
    /// Tolerance of coincident points.
    pub tolerance_m: f64,
    /// Number of pairs of triangles that cross, if it is known.
    pub crossing_count: Option<usize>,
}

/// Encloses a mesh.
///
/// # Errors
/// [`MeshError::NoInside`] if no sample is inside, [`MeshError::Tangled`].
pub(super) fn enclose(given: &Given<'_>) -> Result<Enclosed, MeshError> {
    let &Given { triangles, points_m, center_m, half_size_m, thickness_m, tolerance_m, crossing_count } =
        given;
    let parts = OpenParts::new(triangles, points_m);
    let bounds = Bounds { center_m, half_size_m, tolerance_m };
    let bvh = triangle_bvh(parts.triangles.iter().map(|t| t.map(|point| points_m[point])));
    let mut assumptions = MeshAssumptions {
        hole_count: parts.holes.len(),
        open_edge_count: parts.open_edge_count,
        branching_edge_count: parts.branching_edge_count,
        crossing_count: crossing_count
            .unwrap_or_else(|| bounds.crossings(&bvh, &parts.triangles, 0, points_m)),
        part_count: parts.part_count,
        reoriented_part_count: parts.reoriented_parts,
        ..MeshAssumptions::default()
    };
    let size_m = 2.0 * half_size_m.max_element();
    let (coarsest_m, finest_m) = (size_m / SAMPLES_ALONG as f64, size_m / MAX_SAMPLES_ALONG as f64);
    let surface = match thickness_m.filter(|_| parts.open_edge_count > 0) {
        None => {
            let is_capped = parts.open_edge_count > 0
                && assumptions.crossing_count == 0
                && parts.cap_share(points_m) < MAX_CAP_SHARE;
            let capped = is_capped.then(|| parts.capped(points_m));
            let first_cap = parts.triangles.len();
            match capped.map(|capped| bounds.simple(capped, first_cap)) {
                Some(Ok(surface)) => {
                    let samples = sample(&parts, points_m, half_size_m, 4.0 * coarsest_m)?;
                    assumptions.uncertain_share = samples.uncertain_share();
                    surface
                }
                _ => {
                    let across_m = parts.mean_thickness_m(points_m) / SAMPLES_ACROSS;
                    // Triangles without area have no mean thickness: NaN becomes the finest spacing.
                    let spacing_m = across_m.max(finest_m).min(coarsest_m);
                    let surface = sampled(&parts, points_m, &bvh, half_size_m, spacing_m, &mut assumptions)?;
                    Enclosing::of(surface, half_size_m)
                }
            }
        }
        Some(thickness_m) => {
            (assumptions.hole_count, assumptions.thickness_m) = (0, Some(thickness_m));
            drop(bvh);
            let thickened = thicken(&parts, points_m, thickness_m);
            match bounds.simple(thickened, 0) {
                Ok(surface) => surface,
                Err(thickened) => {
                    let sheets = OpenParts::new(&thickened.triangles, &thickened.points_m);
                    let spacing_m = (thickness_m / SAMPLES_ACROSS).clamp(finest_m, coarsest_m);
                    let corners = |t: &[usize; 3]| t.map(|point| thickened.points_m[point]);
                    let bvh = triangle_bvh(sheets.triangles.iter().map(corners));
                    let surface = sampled(
                        &sheets,
                        &thickened.points_m,
                        &bvh,
                        half_size_m,
                        spacing_m,
                        &mut assumptions,
                    )?;
                    Enclosing::of(surface, half_size_m)
                }
            }
        }
    };
    Ok(Enclosed { oriented: parts.triangles, surface, assumptions })
}

/// Share of the caps in the area of a surface up to which its holes are closed by them. Beyond it the winding number closes them.
const MAX_CAP_SHARE: f64 = 0.2;

/// Bounds of the mesh, and the tolerance of coincident points.
struct Bounds {
    center_m: DVec3,
    half_size_m: DVec3,
    tolerance_m: f64,
}

impl Bounds {
    /// The triangles with an inside test, if they are closed and do not cross, and parts within others are cavities. Triangles before `first` do
    /// not cross one another.
    ///
    /// # Errors
    /// The triangles, otherwise.
    fn simple(&self, surface: ClosedSurface, first: usize) -> Result<Enclosing, ClosedSurface> {
        let ClosedSurface { points_m, triangles } = surface;
        let parts = OpenParts::new(&triangles, &points_m);
        if parts.open_edge_count > 0 || parts.branching_edge_count > 0 {
            return Err(ClosedSurface { points_m, triangles });
        }
        drop(triangles);
        let inside = Inside::new(&parts.triangles, &points_m, self.half_size_m);
        let is_simple = self.crossings(inside.bvh(), &parts.triangles, first, &points_m) == 0
            && inside
                .parts_to_turn(&parts.part, parts.part_count, self.center_m)
                .is_ok_and(|turned| !turned.contains(&true));
        if !is_simple {
            return Err(ClosedSurface { points_m, triangles: parts.triangles });
        }
        Ok(Enclosing { surface: ClosedSurface { points_m, triangles: parts.triangles }, inside })
    }

    /// Number of pairs of triangles that cross, as far as the search goes, without pairs before `first`.
    fn crossings(&self, bvh: &Bvh, triangles: &[[usize; 3]], first: usize, points_m: &[DVec3]) -> usize {
        match crossing::check(bvh, triangles, first, points_m, (self.center_m, self.tolerance_m)) {
            Err(MeshError::Crossing { pairs, .. }) => pairs,
            Err(_) => 1,
            Ok(()) => 0,
        }
    }
}

/// Samples the winding number at points `spacing_m` apart.
///
/// # Errors
/// [`MeshError::Tangled`].
fn sample(
    parts: &OpenParts,
    points_m: &[DVec3],
    half_size_m: DVec3,
    spacing_m: f64,
) -> Result<WindingSamples, MeshError> {
    let corners = parts.triangles.iter().map(|t| t.map(|point| points_m[point]));
    WindingSamples::new(corners, &parts.caps, half_size_m, spacing_m)
}

/// Extracts the surface from samples `spacing_m` apart. `bvh` has the boxes of the triangles.
fn sampled(
    parts: &OpenParts,
    points_m: &[DVec3],
    bvh: &Bvh,
    half_size_m: DVec3,
    spacing_m: f64,
    assumptions: &mut MeshAssumptions,
) -> Result<ClosedSurface, MeshError> {
    let mut samples = sample(parts, points_m, half_size_m, spacing_m)?;
    let spacing_m = samples.spacing_m;
    assumptions.uncertain_share = samples.uncertain_share();
    remove_specks(&mut samples);
    if !samples.winding.iter().any(|w| is_inside(*w)) {
        return Err(MeshError::NoInside { spacing_m });
    }
    let corners = |triangle: usize| parts.triangles[triangle].map(|point| points_m[point]);
    let mut surface = surface_nets::enclose(&samples, &corners, bvh);
    surface.points_m.iter_mut().for_each(|x| *x = x.clamp(-half_size_m, half_size_m));
    // A sheet has samples in its plane, and no volume.
    if volume(&surface.triangles, &surface.points_m) <= spacing_m.powi(3) {
        return Err(MeshError::NoInside { spacing_m });
    }
    Ok(surface)
}

/// Sets the winding number of small components of the inside to zero.
fn remove_specks(samples: &mut WindingSamples) {
    let [nx, ny, _] = samples.counts;
    let total = samples.winding.iter().filter(|w| is_inside(**w)).count();
    let mut is_left: Vec<bool> = samples.winding.iter().map(|w| is_inside(*w)).collect();
    for start in 0..is_left.len() {
        if !std::mem::take(&mut is_left[start]) {
            continue;
        }
        let mut component = vec![start];
        let mut next = 0;
        while let Some(&point) = component.get(next) {
            next += 1;
            // The outermost samples are outside.
            for other in [point - 1, point + 1, point - nx, point + nx, point - nx * ny, point + nx * ny] {
                if std::mem::take(&mut is_left[other]) {
                    component.push(other);
                }
            }
        }
        if (component.len() as f64) < MIN_COMPONENT * total as f64 {
            component.into_iter().for_each(|point| samples.winding[point] = 0.0);
        }
    }
}
