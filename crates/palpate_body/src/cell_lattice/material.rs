//! Tissue, masses and springs of partly filled cells.

use super::embedding::{Embedding, corner};
use crate::cell_tissue::CellTissue;
use crate::damping::DampingCoefficients;
use crate::lattice::steps;
use crate::tissue_sampling::{cell_tissues, cells_beside};
use crate::{BodyError, CellStiffness, ClosedMesh, Link, Region, Tissue};
use glam::DVec3;
use palpate_laws::Spring;

/// Cells with the shares of them that are filled.
pub(super) struct FilledCells<'a> {
    pub embedding: &'a Embedding<'a>,
    pub share: &'a [f64],
}

pub(super) struct Springs {
    pub mass_kg: Vec<f64>,
    pub drag_ns_per_m: Vec<f64>,
    pub links: Vec<Link>,
}

/// Filled share of a cell above which all of it is inside.
const WHOLE: f64 = 1.0 - 1e-9;

/// Mean tissue of each cell, of `tissue` or of another one in `regions`.
pub(super) fn mean_tissues(
    &FilledCells { embedding, share }: &FilledCells<'_>,
    (tissue, regions): (&Tissue, &[(Region, Tissue)]),
    mesh: &ClosedMesh,
) -> Result<Vec<CellTissue>, BodyError> {
    let grid = embedding.grid();
    let at_m = |place: DVec3| mesh.center_m() + grid.at_m(place);
    let is_inside = |cell: usize, at_m: DVec3| share[cell] > WHOLE || mesh.contains(at_m);
    cell_tissues(embedding.places().iter().copied(), at_m, is_inside, tissue, regions, grid.cell_m)
}

/// Young's modulus at each node, Pa: the mean over its cells, weighted by their filled shares.
pub(super) fn node_moduli_pa(
    &FilledCells { embedding, share }: &FilledCells<'_>,
    means: &[CellTissue],
) -> Vec<f64> {
    let nodes = embedding.nodes().len();
    let (mut modulus, mut filled) = (vec![0.0; nodes], vec![0.0; nodes]);
    for ((nodes, share), mean) in embedding.cells().iter().zip(share).zip(means) {
        for &node in nodes {
            modulus[node] += share * mean.youngs_modulus_pa;
            filled[node] += share;
        }
    }
    modulus.iter().zip(&filled).map(|(sum, filled)| sum / filled).collect()
}

/// Masses and springs of cells with the mean tissues `means`.
pub(super) fn springs(
    &FilledCells { embedding, share }: &FilledCells<'_>,
    means: &[CellTissue],
    rest_m: &[DVec3],
) -> Result<Springs, BodyError> {
    let grid = embedding.grid();
    let mut mass_kg = vec![0.0; embedding.nodes().len()];
    let mut drag_ns_per_m = mass_kg.clone();
    for ((nodes, share), mean) in embedding.cells().iter().zip(share).zip(means) {
        let eighth = mean.density_kg_per_m3 * share * grid.cell_m.powi(3) / 8.0;
        for &node in nodes {
            mass_kg[node] += eighth;
            drag_ns_per_m[node] += mean.drag_ns_per_m(eighth);
        }
    }
    // For a modulus of 1 Pa: springs are proportional to it.
    let springs = CellStiffness::isotropic(1.0, DVec3::splat(grid.cell_m))?;
    let mut links = Vec::with_capacity(13 * rest_m.len());
    for (a, &ijk) in embedding.nodes().iter().enumerate() {
        for step in steps() {
            let along = springs.along(step) / f64::from(1 << step.iter().filter(|s| **s == 0).count());
            // Stiffness, and its product with the damping, of the springs to each other end.
            let mut springs: Vec<(usize, f64, DampingCoefficients)> = Vec::with_capacity(1);
            for (cell, corner, other) in cells_of_spring(embedding, ijk, step) {
                let nodes = &embedding.cells()[cell];
                if nodes[corner] != a {
                    continue;
                }
                let part = share[cell] * means[cell].youngs_modulus_pa * along;
                let damping = &means[cell].damping;
                match springs.iter_mut().find(|(b, ..)| *b == nodes[other]) {
                    Some((_, k, sum)) => (*k, *sum) = (*k + part, sum.plus(part, damping)),
                    None => springs.push((nodes[other], part, damping.scaled(part))),
                }
            }
            for (b, k, damping) in springs.into_iter().filter(|(_, k, _)| *k > 0.0) {
                let c = damping.scaled(1.0 / k).of_spring(k, (mass_kg[a], mass_kg[b]));
                let spring = Spring::linear(k, rest_m[a].distance(rest_m[b]), c)
                    .map_err(|source| BodyError::Law { link: links.len(), source })?;
                links.push(Link { a, b, spring });
            }
        }
    }
    Ok(Springs { mass_kg, drag_ns_per_m, links })
}

/// Kept parts of the cells that have both the corner of the grid at `ijk` and the one a `step` from it, with the numbers of these corners.
fn cells_of_spring(
    embedding: &Embedding<'_>,
    ijk: [usize; 3],
    step: [i32; 3],
) -> impl Iterator<Item = (usize, usize, usize)> {
    cells_beside(ijk, step, embedding.grid().cells).flat_map(move |place| {
        let number = |at: [usize; 3]| (0..8).find(|&c| corner(place, c) == at);
        let stepped = std::array::from_fn(|axis| ijk[axis].wrapping_add_signed(step[axis] as isize));
        let ends = number(ijk).zip(number(stepped));
        embedding.kept_in(place).iter().filter_map(move |&cell| ends.map(|(a, b)| (cell, a, b)))
    })
}
