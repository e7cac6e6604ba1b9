//! A closed surface around the inside of any mesh.

use super::assumptions::MeshAssumptions;
use super::geometry::volume;
use super::open_parts::OpenParts;
use super::surface_nets::{self, ClosedSurface, is_inside};
use super::thicken::thicken;
use super::winding_samples::WindingSamples;
use super::{MeshError, crossing};
use glam::DVec3;

/// Number of samples of the winding number along the longest side.
const SAMPLES_ALONG: usize = 128;
/// Winding numbers between these, in magnitude, are uncertain.
const UNCERTAIN: std::ops::Range<f32> = 0.1..0.9;
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
    let mut assumptions = MeshAssumptions {
        hole_count: parts.hole_count,
        open_edge_count: parts.open_edge_count,
        branching_edge_count: parts.branching_edge_count,
        crossing_count: crossings(&parts.triangles, points_m, center_m, tolerance_m),
        part_count: parts.part_count,
        reoriented_part_count: parts.reoriented_parts,
        ..MeshAssumptions::default()
    };
    let spacing_m = 2.0 * half_size_m.max_element() / SAMPLES_ALONG as f64;
    let surface = match thickness_m.filter(|_| parts.open_edge_count > 0) {
        None => sampled(&parts, points_m, half_size_m, spacing_m, &mut assumptions)?,
        Some(thickness_m) => {
            (assumptions.hole_count, assumptions.thickness_m) = (0, Some(thickness_m));
            let thickened = thicken(&parts, points_m, thickness_m);
            let sheets = OpenParts::new(&thickened.triangles, &thickened.points_m);
            let is_simple = sheets.open_edge_count == 0
                && sheets.branching_edge_count == 0
                && crossings(&sheets.triangles, &thickened.points_m, center_m, tolerance_m) == 0;
            if is_simple {
                ClosedSurface { points_m: thickened.points_m, triangles: sheets.triangles }
            } else {
                let finest_m = 2.0 * half_size_m.max_element() / MAX_SAMPLES_ALONG as f64;
                let spacing_m = (thickness_m / SAMPLES_ACROSS).clamp(finest_m, spacing_m);
                sampled(&sheets, &thickened.points_m, half_size_m, spacing_m, &mut assumptions)?
            }
        }
    };
    Ok(Enclosed { oriented: parts.triangles, surface, assumptions })
}

/// Number of samples across a sheet, and the maximum number along the longest side.
const SAMPLES_ACROSS: f64 = 3.0;
const MAX_SAMPLES_ALONG: usize = 256;

/// Number of pairs of triangles that cross, as far as the search goes.
fn crossings(triangles: &[[usize; 3]], points_m: &[DVec3], center_m: DVec3, tolerance_m: f64) -> usize {
    match crossing::check(triangles, points_m, center_m, tolerance_m) {
        Err(MeshError::Crossing { pairs, .. }) => pairs,
        Err(_) => 1,
        Ok(()) => 0,
    }
}

/// Extracts the surface from samples `spacing_m` apart.
fn sampled(
    parts: &OpenParts,
    points_m: &[DVec3],
    half_size_m: DVec3,
    spacing_m: f64,
    assumptions: &mut MeshAssumptions,
) -> Result<ClosedSurface, MeshError> {
    let corners: Vec<[DVec3; 3]> = parts.triangles.iter().map(|t| t.map(|point| points_m[point])).collect();
    let mut samples = WindingSamples::new(corners.iter().copied(), &parts.caps, half_size_m, spacing_m);
    let uncertain = samples.winding.iter().filter(|w| UNCERTAIN.contains(&w.abs())).count();
    assumptions.uncertain_share = uncertain as f64 / samples.winding.len() as f64;
    remove_specks(&mut samples);
    if !samples.winding.iter().any(|w| is_inside(*w)) {
        return Err(MeshError::NoInside { spacing_m });
    }
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
