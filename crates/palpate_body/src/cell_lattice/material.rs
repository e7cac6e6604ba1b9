//! Masses and springs of partly filled cells.

use super::embedding::Embedding;
use crate::cell_tissue::{cell_tissues, cells_beside};
use crate::lattice::steps;
use crate::{BodyError, CellStiffness, Link, Region, Tissue};
use glam::DVec3;
use palpate_laws::Spring;

pub(super) struct Material {
    pub mass_kg: Vec<f64>,
    pub links: Vec<Link>,
    /// Young's modulus at each node: the mean over its cells, weighted by their filled shares.
    pub youngs_modulus_pa: Vec<f64>,
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
    let grid = embedding.grid();
    let at_m = |place: DVec3| center_m + grid.at_m(place);
    let means = cell_tissues(embedding.places().iter().copied(), at_m, tissue, regions, grid.cell_m)?;
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
            for cell in cells_beside(ijk, step, grid.cells).filter_map(|place| of_cell[grid.index(place)]) {
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

fn stepped(ijk: [usize; 3], step: [i32; 3]) -> [usize; 3] {
    std::array::from_fn(|axis| ijk[axis].wrapping_add_signed(step[axis] as isize))
}
