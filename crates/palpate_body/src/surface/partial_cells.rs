//! Static compliance of the surface of partly filled cells.
//!
//! [`palpate_laws::normal_compliance_at`] tabulates the compliance of whole cells below a plane of nodes. Where a
//! mesh cuts cells, springs are softer and the surface lies between nodes. The difference is local. It is computed
//! with every node held in place by a weak spring, which removes the far field of partly filled and whole cells
//! alike. For hexahedra ([`hexahedra_compliance`]) it replaces the table, which is uneven from node to node.

use super::ContactSurface;
use crate::conjugate_gradients::ConjugateGradients;
use crate::parallel;
use crate::weights::add_weight;
use crate::{Block, Link, Network, Tissue};
use glam::{DMat3, DVec3};
use palpate_laws::{RelaxedStress, hexahedra_compliance};
use std::sync::OnceLock;

/// Radius in cells beyond which nodes are held.
const REACH_CELLS: f64 = 3.2;
/// Stiffness of the springs that hold nodes in place, as a fraction of a node's own stiffness.
const HOLD: f64 = 0.2;
/// Relative residual of the solution, and maximum number of conjugate gradient iterations.
const TOLERANCE: f64 = 1e-4;
const MAX_ITERATIONS: usize = 60;

/// Excess compliance of nodes compared with whole cells below a plane of nodes, along the surface normals.
#[derive(Clone, Debug)]
pub(crate) struct PartialCells {
    /// For each node that carries the surface: other nodes in ascending order, with the difference in 1/(E h).
    rows: Vec<Vec<(usize, f64)>>,
}

impl PartialCells {
    /// Excess compliance of a body; `None` without a grid or with whole cells only.
    pub(crate) fn new(network: &Network, surface: &ContactSurface) -> Option<Self> {
        let grid = network.grid().filter(|grid| grid.has_partial_cells())?;
        let normals = node_normals(network, surface);
        let moduli = grid.youngs_modulus_pa();
        let stiffness = stiffness(network, |a, b| 0.5 * (moduli[a] + moduli[b]) * grid.cell_m());
        let of_whole = match grid.elements_ratio() {
            None => springs_in_whole_cells().to_vec(),
            Some(ratio) => beyond_patches(ratio),
        };
        let carrying: Vec<usize> =
            (0..network.node_count()).filter(|&node| normals[node] != DVec3::ZERO).collect();
        let patches = parallel::map_long(carrying.len(), |range| {
            let mut around = Around::new(network);
            let moved = |&node: &usize| {
                let patch = Patch::new(&mut around, node, grid.cell_m(), &stiffness);
                let moved = patch.displacements(normals[node]);
                (node, patch.nodes, moved)
            };
            carrying[range].iter().map(moved).collect()
        });
        let mut rows: Vec<Vec<(usize, f64)>> = vec![Vec::new(); network.node_count()];
        for (node, nodes, moved) in patches {
            for (&other, u) in nodes.iter().zip(moved).filter(|(other, _)| normals[**other] != DVec3::ZERO) {
                let cells = network.rest_m()[node].distance(network.rest_m()[other]) / grid.cell_m();
                let excess = u.dot(normals[other]) - at_distance(&of_whole, cells);
                // The patches of two nodes differ at their rims: average the two values.
                add_weight(&mut rows[node], other, 0.5 * excess);
                add_weight(&mut rows[other], node, 0.5 * excess);
            }
        }
        rows.iter_mut().for_each(|row| row.sort_unstable_by_key(|(node, _)| *node));
        Some(Self { rows })
    }

    /// Excess compliance between two nodes of springs, or compliance of elements, in 1/(E h); `None` for nodes that are far apart.
    pub(crate) fn between(&self, i: usize, j: usize) -> Option<f64> {
        let row = &self.rows[i];
        row.binary_search_by_key(&j, |(node, _)| *node).ok().map(|at| row[at].1)
    }
}

/// Outward unit normal at rest of the surface that each node carries; 0 without one.
fn node_normals(network: &Network, surface: &ContactSurface) -> Vec<DVec3> {
    let at = |point: usize| surface.points()[point].of(network.rest_m());
    let mut normals = vec![DVec3::ZERO; network.node_count()];
    for corners in surface.triangles() {
        let [a, b, c] = corners.map(at);
        let area = (b - a).cross(c - a);
        for &(node, w) in corners.iter().flat_map(|&point| surface.points()[point].nodes()) {
            normals[node] += w * area;
        }
    }
    normals.iter().map(|normal| normal.normalize_or_zero()).collect()
}

/// Stiffness at rest between each node and its neighbours, in the order of [`Network::neighbours`], over the unit E h for its ends: the
/// force that pulls the node back for a displacement relative to the neighbour.
fn stiffness(network: &Network, unit_n_per_m: impl Fn(usize, usize) -> f64) -> Vec<DMat3> {
    let rest = network.rest_m();
    let end = network.neighbour_range(network.node_count() - 1).end;
    let mut blocks = vec![DMat3::ZERO; end];
    for node in 0..network.node_count() {
        let range = network.neighbour_range(node);
        let neighbours: Vec<usize> = network.neighbours(node).collect();
        // The first neighbours are those of the links, in their order.
        for (block, &link) in blocks[range.clone()].iter_mut().zip(network.incident_links(node)) {
            let Link { a, b, spring } = &network.links()[link];
            *block += spring.tangent(rest[*b] - rest[*a], false).stiffness;
        }
        for &index in network.hexahedra().incident(node) {
            let element = network.hexahedra().get(index);
            let own = element.nodes.iter().position(|other| *other == node);
            let of_element = element.stiffness_n_per_m(rest, &RelaxedStress::default(), false);
            for (column, &other) in element.nodes.iter().enumerate() {
                let place = neighbours.iter().position(|neighbour| *neighbour == other);
                if let (Some(own), Some(place)) = (own, place) {
                    blocks[range.start + place] -= of_element[own][column];
                }
            }
        }
        for (block, other) in blocks[range].iter_mut().zip(neighbours) {
            *block *= unit_n_per_m(node, other).recip();
        }
    }
    blocks
}

/// A network, and the places of nodes in a patch.
struct Around<'a> {
    network: &'a Network,
    place: Vec<Option<u32>>,
}

impl<'a> Around<'a> {
    fn new(network: &'a Network) -> Self {
        Self { network, place: vec![None; network.node_count()] }
    }
}

/// The nodes around a node, with their stiffness in units of E h.
struct Patch {
    /// Indices of the nodes; the first is the middle.
    nodes: Vec<usize>,
    /// Diagonal block of each node, and blocks between entries of `nodes`.
    diagonal: Vec<DMat3>,
    links: Vec<(usize, usize, DMat3)>,
}

impl Patch {
    /// `stiffness` is that between each node and its neighbours.
    fn new(around: &mut Around<'_>, middle: usize, cell_m: f64, stiffness: &[DMat3]) -> Self {
        let Around { network, place } = around;
        let rest = network.rest_m();
        let mut nodes = vec![middle];
        place[middle] = Some(0);
        let mut next = 0;
        while let Some(&node) = nodes.get(next) {
            for other in network.neighbours(node) {
                let is_near = rest[other].distance(rest[middle]) < REACH_CELLS * cell_m;
                if is_near && place[other].is_none() {
                    place[other] = Some(nodes.len() as u32);
                    nodes.push(other);
                }
            }
            next += 1;
        }
        let mut diagonal = vec![DMat3::ZERO; nodes.len()];
        let mut links = Vec::new();
        for (at, &node) in nodes.iter().enumerate() {
            for (other, block) in network.neighbours(node).zip(&stiffness[network.neighbour_range(node)]) {
                diagonal[at] += *block;
                if let Some(to) = place[other].map(|to| to as usize).filter(|to| *to > at) {
                    links.push((at, to, *block));
                }
            }
        }
        nodes.iter().for_each(|node| place[*node] = None);
        for own in &mut diagonal {
            let mean = (own.x_axis.x + own.y_axis.y + own.z_axis.z) / 3.0;
            *own += HOLD * mean * DMat3::IDENTITY;
        }
        Self { nodes, diagonal, links }
    }

    /// Displacements of its nodes under a unit force on the middle one, by conjugate gradients.
    fn displacements(&self, force: DVec3) -> Vec<DVec3> {
        let scale: Vec<DMat3> = self.diagonal.iter().map(DMat3::inverse).collect();
        let mut u = vec![DVec3::ZERO; self.nodes.len()];
        let mut residual = u.clone();
        residual[0] = force;
        let precondition = |residual: &[DVec3], z: &mut [DVec3]| {
            for ((z, r), m) in z.iter_mut().zip(residual).zip(&scale) {
                *z = *m * *r;
            }
        };
        let multiply = |direction: &[DVec3], product: &mut [DVec3]| {
            for ((product, k), d) in product.iter_mut().zip(&self.diagonal).zip(direction) {
                *product = *k * *d;
            }
            for &(a, b, k) in &self.links {
                product[a] -= k * direction[b];
                product[b] -= k.transpose() * direction[a];
            }
        };
        let enough = TOLERANCE * TOLERANCE * force.dot(scale[0] * force);
        let method = ConjugateGradients {
            multiply,
            precondition,
            dot,
            is_converged: |_: &[DVec3], size: f64| size.is_nan() || size <= enough,
            max_iterations: MAX_ITERATIONS,
        };
        // The last approximation suffices: the matrix is positive definite, and the tolerance is coarse.
        let _ = method.solve(&mut u, &mut residual);
        u
    }
}

fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}

/// The same compliance for springs in whole cells below a plane of nodes.
fn springs_in_whole_cells() -> &'static [(f64, f64)] {
    static TABLE: OnceLock<Vec<(f64, f64)>> = OnceLock::new();
    TABLE.get_or_init(|| {
        let tissue = Tissue { youngs_modulus_pa: 1.0, ..Tissue::default() };
        let made = whole_block().and_then(|block| block.tissue(&tissue));
        made.map_or_else(|_| Vec::new(), |made| in_whole_cells(&made.network, |_| 0.0))
    })
}

/// The compliance of patches of hexahedra in whole cells minus that of the half-space, by distance. It changes little from node to node.
fn beyond_patches(poissons_ratio: f64) -> Vec<(f64, f64)> {
    let tissue = Tissue { youngs_modulus_pa: 1.0, poissons_ratio, ..Tissue::default() };
    let made = whole_block().and_then(|block| block.elements(&tissue));
    let of_half_space = |offset: DVec3| {
        hexahedra_compliance(poissons_ratio, offset.x.round() as i32, offset.y.round() as i32)
    };
    made.map_or_else(|_| Vec::new(), |made| in_whole_cells(&made.network, of_half_space))
}

/// A block of unit cells with its bottom fixed.
fn whole_block() -> Result<Block, crate::BodyError> {
    Ok(Block::new([9, 9, 5], DVec3::new(8.0, 8.0, 4.0))?.fix(crate::Face::NegZ))
}

/// Compliance of the patch around the middle of the top of a block, minus `without` of the offset of a node: means over the rings of nodes
/// around the middle, by distance.
fn in_whole_cells(network: &Network, without: impl Fn(DVec3) -> f64) -> Vec<(f64, f64)> {
    let rest = network.rest_m();
    let top = DVec3::new(0.0, 0.0, 2.0);
    let Some(middle) = rest.iter().position(|x| x.distance(top) < 0.1) else { return Vec::new() };
    let patch = Patch::new(&mut Around::new(network), middle, 1.0, &stiffness(network, |_, _| 1.0));
    let moved = patch.displacements(DVec3::Z);
    let mut rings: Vec<(f64, f64, f64)> = Vec::new();
    for (&node, u) in patch.nodes.iter().zip(moved) {
        let off = rest[node] - rest[middle];
        if off.z != 0.0 {
            continue;
        }
        let u = u.z - without(off);
        match rings.iter_mut().find(|(distance, ..)| (distance - off.length()).abs() < 1e-9) {
            Some((_, sum, count)) => (*sum, *count) = (*sum + u, *count + 1.0),
            None => rings.push((off.length(), u, 1.0)),
        }
    }
    rings.sort_by(|a, b| a.0.total_cmp(&b.0));
    rings.into_iter().map(|(distance, sum, count)| (distance, sum / count)).collect()
}

/// Interpolates a table linearly at a distance in cells.
fn at_distance(table: &[(f64, f64)], cells: f64) -> f64 {
    let next = table.partition_point(|(distance, _)| *distance <= cells);
    match (next.checked_sub(1).and_then(|before| table.get(before)), table.get(next)) {
        (Some(&(from, a)), Some(&(to, b))) => a + (b - a) * (cells - from) / (to - from),
        (Some(&(from, a)), None) if cells - from < 1e-9 => a,
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Block, Face};
    use palpate_laws::normal_compliance_at;

    #[test]
    fn whole_cells_have_no_excess_and_half_the_stiffness_doubles_the_compliance() {
        let tissue = Tissue { youngs_modulus_pa: 2e3, ..Tissue::default() };
        let made =
            Block::new([9, 9, 5], DVec3::new(0.08, 0.08, 0.04)).unwrap().fix(Face::NegZ).tissue(&tissue);
        let made = made.unwrap();
        let surface = ContactSurface::new(&made.surface, &made.network);
        let grid = made.network.grid().unwrap().clone();
        for soft in [1.0, 2.0] {
            // As if the tissue were stiffer than its springs.
            let moduli = grid.youngs_modulus_pa().iter().map(|e| soft * e).collect();
            let network =
                made.network.clone().with_grid(crate::Grid::new(grid.cell_m(), moduli).partly_filled());
            let cells = PartialCells::new(&network, &surface).unwrap();
            let at = |x: f64, y: f64| {
                let place = DVec3::new(0.01 * x, 0.01 * y, 0.02);
                network.rest_m().iter().position(|x| x.distance(place) < 1e-6).unwrap()
            };
            let own = cells.between(at(0.0, 0.0), at(0.0, 0.0)).unwrap();
            let expected = (soft - 1.0) * springs_in_whole_cells()[0].1;
            assert!((own - expected).abs() < 1e-6, "{own}, {expected}");
            // All nodes of a ring have their mean.
            let (along, across) =
                (cells.between(at(0.0, 0.0), at(1.0, 0.0)), cells.between(at(0.0, 0.0), at(0.0, 1.0)));
            assert!((along.unwrap() - across.unwrap()).abs() < 1e-9);
            assert_eq!(cells.between(at(0.0, 0.0), at(4.0, 4.0)), None);
        }
    }

    #[test]
    fn holding_springs_remove_only_the_far_field() {
        // The remaining compliance changes little from node to node.
        let rest = |cells: f64| normal_compliance_at(cells) - at_distance(springs_in_whole_cells(), cells);
        let (near, beside, far) = (rest(0.0), rest(1.0), rest(2.0));
        assert!(near > beside && beside > far && far > 0.0, "{near}, {beside}, {far}");
        assert!(near < 0.35 * normal_compliance_at(0.0), "{near}");
    }
}
