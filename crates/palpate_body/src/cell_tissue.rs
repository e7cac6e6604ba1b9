//! Tissue of the cells of a lattice with regions of other tissue.

use crate::error::{check_damping_ratio, check_positive};
use crate::{BodyError, MeshError, Region, Tissue};
use glam::DVec3;

/// Number of samples of the tissue along each side of a cell.
const SAMPLES: usize = 4;

/// Checks the parameters of a tissue.
pub(crate) fn check_tissue(tissue: &Tissue) -> Result<(), BodyError> {
    check_positive("density, kg/m3", tissue.density_kg_per_m3)?;
    check_positive("Young's modulus, Pa", tissue.youngs_modulus_pa)?;
    check_damping_ratio(tissue.damping_ratio).map(drop)
}

/// Mean tissue of each cell over those of 4 × 4 × 4 samples that are inside the body, or over all if none is. The last region that contains
/// a sample applies.
///
/// `places` are the lowest corners of the cells, `at_m` maps a place in units of cells to its position, m, `is_inside` tests a position in a
/// cell with this number, and `cell_m` is the size of a cell for error texts.
pub(crate) fn cell_tissues(
    places: impl Iterator<Item = [usize; 3]>,
    at_m: impl Fn(DVec3) -> DVec3,
    is_inside: impl Fn(usize, DVec3) -> bool,
    tissue: &Tissue,
    regions: &[(Region, Tissue)],
    cell_m: f64,
) -> Result<Vec<Tissue>, BodyError> {
    let mut held = vec![false; regions.len()];
    let mean = |(cell, place): (usize, [usize; 3])| {
        if regions.is_empty() {
            return *tissue;
        }
        let at_sample = |sample: [usize; 3]| {
            let within = DVec3::from_array(sample.map(|s| (s as f64 + 0.5) / SAMPLES as f64));
            at_m(DVec3::from_array(place.map(|n| n as f64)) + within)
        };
        let all = || crate::lattice::grid([SAMPLES; 3]).map(at_sample);
        let inside: Vec<DVec3> = all().filter(|at_m| is_inside(cell, *at_m)).collect();
        let samples = if inside.is_empty() { all().collect() } else { inside };
        let total = samples.len() as f64;
        let mut sum = Tissue { youngs_modulus_pa: 0.0, density_kg_per_m3: 0.0, damping_ratio: 0.0 };
        for at_m in samples {
            let mut own = tissue;
            for (index, (region, other)) in regions.iter().enumerate() {
                if region.contains(at_m) {
                    held[index] = true;
                    own = other;
                }
            }
            sum.youngs_modulus_pa += own.youngs_modulus_pa / total;
            sum.density_kg_per_m3 += own.density_kg_per_m3 / total;
            sum.damping_ratio += own.damping_ratio / total;
        }
        sum
    };
    let tissues = places.enumerate().map(mean).collect();
    match held.iter().position(|held| !held) {
        Some(index) => Err(MeshError::EmptyRegion { what: "region of tissue", index, cell_m }.into()),
        None => Ok(tissues),
    }
}

/// Cells that have both the node at `ijk` and the node one `step` from it.
pub(crate) fn cells_beside(
    ijk: [usize; 3],
    step: [i32; 3],
    cells: [usize; 3],
) -> impl Iterator<Item = [usize; 3]> {
    (0..8).filter_map(move |c| {
        let mut place = [0; 3];
        for axis in 0..3 {
            let back = match step[axis] {
                1 if c >> axis & 1 == 1 => return None,
                1 => 0,
                -1 if c >> axis & 1 == 0 => return None,
                -1 => 1,
                _ => c >> axis & 1,
            };
            place[axis] = ijk[axis].checked_sub(back).filter(|&n| n < cells[axis])?;
        }
        Some(place)
    })
}
