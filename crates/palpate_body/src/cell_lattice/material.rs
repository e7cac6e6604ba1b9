//! Masses and springs of partly filled cells.

use super::embedding::{Embedding, corner};
use crate::error::{check_damping_ratio, check_positive};
use crate::lattice::steps;
use crate::{BodyError, CellStiffness, Link, MeshError, Region, Tissue};
use glam::DVec3;
use palpate_laws::Spring;

/// Number of samples of the tissue along each side of a cell.
const SAMPLES: usize = 4;

/// Mean material parameters of a cell.
#[derive(Clone, Copy)]
struct Mean {
    youngs_modulus_pa: f64,
    density_kg_per_m3: f64,
    damping_ratio: f64,
}

pub(super) struct Material {
    pub mass_kg: Vec<f64>,
    pub links: Vec<Link>,
    /// Young's modulus at each node: the mean over its cells, weighted by their filled shares.
    pub youngs_modulus_pa: Vec<f64>,
}

/// Checks the parameters of a tissue.
pub(super) fn check_tissue(tissue: &Tissue) -> Result<(), BodyError> {
    check_positive("density, kg/m3", tissue.density_kg_per_m3)?;
    check_positive("Young's modulus, Pa", tissue.youngs_modulus_pa)?;
    check_damping_ratio(tissue.damping_ratio).map(drop)
}

/// Masses and springs of cells with the filled shares `share`, made of `tissue`, or of another tissue in `regions`.
pub(super) fn material(
    embedding: &Embedding,
    share: &[f64],
    tissue: &Tissue,
    regions: &[(Region, Tissue)],
    center_m: DVec3,
    rest_m: &[DVec3],
) -> Result<Material, BodyError> {
    let means = means(embedding, tissue, regions, center_m)?;
    let grid = embedding.grid();
    let mut mass_kg = vec![0.0; embedding.nodes().len()];
    for ((nodes, share), mean) in embedding.cells().iter().zip(share).zip(&means) {
        let eighth = mean.density_kg_per_m3 * share * grid.cell_m.powi(3) / 8.0;
        nodes.iter().for_each(|&node| mass_kg[node] += eighth);
    }
    // For a modulus of 1 Pa: springs are proportional to it.
    let springs = CellStiffness::isotropic(1.0, DVec3::splat(grid.cell_m))?;
    let mut of_cell = vec![None; grid.cell_total()];
    embedding.places().iter().enumerate().for_each(|(cell, place)| of_cell[grid.index(*place)] = Some(cell));
    let mut links = Vec::with_capacity(13 * rest_m.len());
    for (a, &ijk) in embedding.nodes().iter().enumerate() {
        for step in steps() {
            let (mut k, mut ratio) = (0.0, 0.0);
            let along = springs.along(step) / f64::from(1 << step.iter().filter(|s| **s == 0).count());
            for cell in beside(ijk, step, grid.cells).filter_map(|place| of_cell[grid.index(place)]) {
                let part = share[cell] * means[cell].youngs_modulus_pa * along;
                k += part;
                ratio += part * means[cell].damping_ratio;
            }
            if k == 0.0 {
                continue;
            }
            let Some(b) = embedding.node(stepped(ijk, step)) else { continue };
            let (m_a, m_b) = (mass_kg[a], mass_kg[b]);
            let c = ratio / k * (k * 2.0 * m_a * m_b / (m_a + m_b)).sqrt();
            let spring = Spring::linear(k, rest_m[a].distance(rest_m[b]), c)
                .map_err(|source| BodyError::Law { link: links.len(), source })?;
            links.push(Link { a, b, spring });
        }
    }
    let (mut modulus, mut filled) = (vec![0.0; mass_kg.len()], vec![0.0; mass_kg.len()]);
    for ((nodes, share), mean) in embedding.cells().iter().zip(share).zip(&means) {
        for &node in nodes {
            modulus[node] += share * mean.youngs_modulus_pa;
            filled[node] += share;
        }
    }
    let youngs_modulus_pa = modulus.iter().zip(&filled).map(|(sum, filled)| sum / filled).collect();
    Ok(Material { mass_kg, links, youngs_modulus_pa })
}

/// Mean tissue of each cell over 4 × 4 × 4 samples. The last region that contains a sample applies.
fn means(
    embedding: &Embedding,
    tissue: &Tissue,
    regions: &[(Region, Tissue)],
    center_m: DVec3,
) -> Result<Vec<Mean>, BodyError> {
    let mut held = vec![false; regions.len()];
    let grid = embedding.grid();
    let total = SAMPLES.pow(3) as f64;
    let mean = |place: &[usize; 3]| {
        let mut sum = Mean { youngs_modulus_pa: 0.0, density_kg_per_m3: 0.0, damping_ratio: 0.0 };
        let mut add = |of: &Tissue, times: f64| {
            sum.youngs_modulus_pa += times * of.youngs_modulus_pa;
            sum.density_kg_per_m3 += times * of.density_kg_per_m3;
            sum.damping_ratio += times * of.damping_ratio;
        };
        if regions.is_empty() {
            add(tissue, 1.0);
            return sum;
        }
        for sample in crate::lattice::grid([SAMPLES; 3]) {
            let within = DVec3::from_array(sample.map(|s| (s as f64 + 0.5) / SAMPLES as f64));
            let at_m = center_m + grid.at_m(DVec3::from_array(place.map(|n| n as f64)) + within);
            let mut own = tissue;
            for (index, (region, other)) in regions.iter().enumerate() {
                if region.contains(at_m) {
                    held[index] = true;
                    own = other;
                }
            }
            add(own, 1.0 / total);
        }
        sum
    };
    let means = embedding.places().iter().map(mean).collect();
    match held.iter().position(|held| !held) {
        Some(index) => {
            Err(MeshError::EmptyRegion { what: "region of tissue", index, cell_m: grid.cell_m }.into())
        }
        None => Ok(means),
    }
}

/// Cells that have both the node at `ijk` and the node one `step` from it.
fn beside(ijk: [usize; 3], step: [i32; 3], cells: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
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
        debug_assert!((0..8).any(|c| corner(place, c) == ijk), "the cell has the node");
        Some(place)
    })
}

fn stepped(ijk: [usize; 3], step: [i32; 3]) -> [usize; 3] {
    std::array::from_fn(|axis| ijk[axis].wrapping_add_signed(step[axis] as isize))
}
