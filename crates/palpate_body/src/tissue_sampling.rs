//! Tissues of the cells of a lattice with regions of other tissue.

use crate::cell_tissue::CellTissue;
use crate::damping::DampingCoefficients;
use crate::{BodyError, MeshError, Region, Tissue};
use glam::DVec3;
use palpate_laws::LameParameters;

/// Number of samples of the tissue along each side of a cell.
const SAMPLES: usize = 4;

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
) -> Result<Vec<CellTissue>, BodyError> {
    let mut held = vec![false; regions.len()];
    let mean = |(cell, place): (usize, [usize; 3])| {
        if regions.is_empty() {
            return CellTissue::of(tissue);
        }
        let at_sample = |sample: [usize; 3]| {
            let within = DVec3::from_array(sample.map(|s| (s as f64 + 0.5) / SAMPLES as f64));
            at_m(DVec3::from_array(place.map(|n| n as f64)) + within)
        };
        let all = || crate::lattice::grid([SAMPLES; 3]).map(at_sample);
        let inside: Vec<DVec3> = all().filter(|at_m| is_inside(cell, *at_m)).collect();
        let samples = if inside.is_empty() { all().collect() } else { inside };
        let mut counts = vec![0_usize; regions.len() + 1];
        for at_m in samples {
            let mut own = 0;
            for (index, (region, _)) in regions.iter().enumerate() {
                if region.contains(at_m) {
                    held[index] = true;
                    own = index + 1;
                }
            }
            counts[own] += 1;
        }
        let of = |index: usize| index.checked_sub(1).map_or(tissue, |region| &regions[region].1);
        mean_tissue(
            counts.iter().enumerate().filter(|(_, n)| **n > 0).map(|(index, n)| (of(index), *n as f64)),
        )
    };
    let tissues = places.enumerate().map(mean).collect();
    match held.iter().position(|held| !held) {
        Some(index) => Err(MeshError::EmptyRegion { what: "region of tissue", index, cell_m }.into()),
        None => Ok(tissues),
    }
}

/// Mean of tissues with weights. Elastic moduli are averaged, as for a common strain; law and relaxation are those of the greatest weight.
fn mean_tissue<'a>(parts: impl Iterator<Item = (&'a Tissue, f64)> + Clone) -> CellTissue {
    let total: f64 = parts.clone().map(|(_, weight)| weight).sum();
    let mean =
        |value: fn(&Tissue) -> f64| parts.clone().map(|(of, weight)| weight / total * value(of)).sum::<f64>();
    let mut heaviest = (Tissue::default(), 0.0);
    let mut is_one_ratio = true;
    let mut damping = DampingCoefficients::default();
    for (of, weight) in parts.clone() {
        is_one_ratio &= heaviest.1 == 0.0 || of.poissons_ratio == heaviest.0.poissons_ratio;
        damping = damping.plus(weight / total, &of.damping.coefficients());
        if weight > heaviest.1 {
            heaviest = (*of, weight);
        }
    }
    let mut tissue = CellTissue {
        youngs_modulus_pa: mean(|of| of.youngs_modulus_pa),
        density_kg_per_m3: mean(|of| of.density_kg_per_m3),
        damping,
        ..CellTissue::of(&heaviest.0)
    };
    if !is_one_ratio {
        // The tissues have been validated.
        fn parameters_pa(of: &Tissue) -> LameParameters {
            LameParameters::new(of.youngs_modulus_pa, of.poissons_ratio).unwrap_or_default()
        }
        let (mu, lambda) = (mean(|of| parameters_pa(of).mu), mean(|of| parameters_pa(of).lambda));
        tissue.poissons_ratio = lambda / (2.0 * (lambda + mu));
        tissue.youngs_modulus_pa = LameParameters { mu, lambda }.youngs_modulus();
    }
    tissue
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
