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
use glam::DVec3;

/// Number of samples of the winding number along the longest side, and for a thin mesh.
const SAMPLES_ALONG: usize = 128;
const MAX_SAMPLES_ALONG: usize = 256;
/// Number of samples across a sheet, or across the mean thickness of a mesh.
const SAMPLES_ACROSS: f64 = 3.0;
/// Minimum share of the samples inside of a component that is kept; smaller ones are specks where triangles cross.
const MIN_COMPONENT: f64 = 1e-4;

/// A mesh that is not closed by itself.
pub(super) struct Enclosed {
    /// The given triangles, turned where needed.
    pub oriented: Vec<[usize; 3]>,
    pub surface: ClosedSurface,
    pub assumptions: MeshAssumptions,
}

/// Encloses `triangles` of `points_m`, which lie within ±`half_size_m` and have no repeated corners. Open parts become sheets of
/// `thickness_m`, if it is given; `half_size_m` includes it.
///
/// # Errors
/// [`MeshError::NoInside`] if no sample is inside.
pub(super) fn enclose(
    triangles: &[[usize; 3]],
    points_m: &[DVec3],
    (center_m, half_size_m): (DVec3, DVec3),
    thickness_m: Option<f64>,
    tolerance_m: f64,
) -> Result<Enclosed, MeshError> {
    let parts = OpenParts::new(triangles, points_m);
    let bounds = Bounds { center_m, half_size_m, tolerance_m };
    let mut assumptions = MeshAssumptions {
        hole_count: parts.holes.len(),
        open_edge_count: parts.open_edge_count,
        branching_edge_count: parts.branching_edge_count,
        crossing_count: bounds.crossings(&parts.triangles, 0, points_m),
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
            match capped.and_then(|capped| bounds.simple(&capped.triangles, first_cap, capped.points_m)) {
                Some(surface) => {
                    let samples = sample(&parts, points_m, half_size_m, 4.0 * coarsest_m);
                    assumptions.uncertain_share = samples.uncertain_share();
                    surface
                }
                None => {
                    let across_m = parts.mean_thickness_m(points_m) / SAMPLES_ACROSS;
                    // Triangles without area have no mean thickness: NaN becomes the finest spacing.
                    let spacing_m = across_m.max(finest_m).min(coarsest_m);
                    sampled(&parts, points_m, half_size_m, spacing_m, &mut assumptions)?
                }
            }
        }
        Some(thickness_m) => {
            (assumptions.hole_count, assumptions.thickness_m) = (0, Some(thickness_m));
            let thickened = thicken(&parts, points_m, thickness_m);
            match bounds.simple(&thickened.triangles, 0, thickened.points_m.clone()) {
                Some(surface) => surface,
                None => {
                    let sheets = OpenParts::new(&thickened.triangles, &thickened.points_m);
                    let spacing_m = (thickness_m / SAMPLES_ACROSS).clamp(finest_m, coarsest_m);
                    sampled(&sheets, &thickened.points_m, half_size_m, spacing_m, &mut assumptions)?
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
    /// The surface of `triangles`, if it is closed and does not pass through itself, and parts within others are cavities. Triangles before
    /// `first` do not cross one another.
    fn simple(&self, triangles: &[[usize; 3]], first: usize, points_m: Vec<DVec3>) -> Option<ClosedSurface> {
        let parts = OpenParts::new(triangles, &points_m);
        let is_simple = parts.open_edge_count == 0
            && parts.branching_edge_count == 0
            && self.crossings(&parts.triangles, first, &points_m) == 0
            && Inside::new(&parts.triangles, &points_m, self.half_size_m)
                .parts_to_turn(&parts.part, parts.part_count, self.center_m)
                .is_ok_and(|turned| !turned.contains(&true));
        is_simple.then_some(ClosedSurface { points_m, triangles: parts.triangles })
    }

    /// Number of pairs of triangles that cross, as far as the search goes, without pairs before `first`.
    fn crossings(&self, triangles: &[[usize; 3]], first: usize, points_m: &[DVec3]) -> usize {
        match crossing::check(triangles, first, points_m, self.center_m, self.tolerance_m) {
            Err(MeshError::Crossing { pairs, .. }) => pairs,
            Err(_) => 1,
            Ok(()) => 0,
        }
    }
}

/// Samples the winding number at points `spacing_m` apart.
fn sample(parts: &OpenParts, points_m: &[DVec3], half_size_m: DVec3, spacing_m: f64) -> WindingSamples {
    let corners = parts.triangles.iter().map(|t| t.map(|point| points_m[point]));
    WindingSamples::new(corners, &parts.caps, half_size_m, spacing_m)
}

/// Extracts the surface from samples `spacing_m` apart.
fn sampled(
    parts: &OpenParts,
    points_m: &[DVec3],
    half_size_m: DVec3,
    spacing_m: f64,
    assumptions: &mut MeshAssumptions,
) -> Result<ClosedSurface, MeshError> {
    let mut samples = sample(parts, points_m, half_size_m, spacing_m);
    let spacing_m = samples.spacing_m;
    assumptions.uncertain_share = samples.uncertain_share();
    remove_specks(&mut samples);
    if !samples.winding.iter().any(|w| is_inside(*w)) {
        return Err(MeshError::NoInside { spacing_m });
    }
    let corners: Vec<[DVec3; 3]> = parts.triangles.iter().map(|t| t.map(|point| points_m[point])).collect();
    let mut surface = surface_nets::enclose(&samples, &corners);
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
