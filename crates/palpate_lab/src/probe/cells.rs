//! Cells of a lattice that are inside out.

use glam::DVec3;
use palpate_body::{Body, Network, StepReport};
use std::collections::HashMap;

/// The nodes at the eight corners of every cubic cell of a lattice, x fastest, then y, then z.
pub(super) struct Cells(Vec<[usize; 8]>);

impl Cells {
    /// The cells of side `cell_m` of `network`, which lies along the axes: eight nodes with a spring through the middle.
    pub(super) fn of(network: &Network, cell_m: f64) -> Self {
        let low = network.rest_m().iter().copied().reduce(DVec3::min).unwrap_or_default();
        let key = |x: DVec3| ((x - low) / cell_m).round().to_array().map(|n| n as i64);
        let at: HashMap<[i64; 3], usize> =
            network.rest_m().iter().enumerate().map(|(node, x)| (key(*x), node)).collect();
        let corners = |node: usize| -> Option<[usize; 8]> {
            let [x, y, z] = key(network.rest_m()[node]);
            let mut cell = [node; 8];
            for (corner, node) in (0_i64..).zip(&mut cell) {
                *node = *at.get(&[x + (corner & 1), y + (corner >> 1 & 1), z + (corner >> 2)])?;
            }
            let is_joined = |&link: &usize| {
                let link = &network.links()[link];
                (link.a.min(link.b), link.a.max(link.b)) == (cell[0].min(cell[7]), cell[0].max(cell[7]))
            };
            network.incident_links(node).iter().any(is_joined).then_some(cell)
        };
        Self((0..network.node_count()).filter_map(corners).collect())
    }

    /// Number of cells whose volume at their middle is negative where `body` is now.
    fn inverted(&self, body: &Body) -> usize {
        let x = body.positions_m();
        let is_inverted = |cell: &&[usize; 8]| {
            // Mean of the four edges along an axis, times 4.
            let edge = |bit: usize| -> DVec3 {
                let sign = |corner: usize| if corner >> bit & 1 == 1 { 1.0 } else { -1.0 };
                cell.iter().enumerate().map(|(corner, &node)| sign(corner) * x[node]).sum()
            };
            edge(0).cross(edge(1)).dot(edge(2)) <= 0.0
        };
        self.0.iter().filter(is_inverted).count()
    }
}

/// Number of inverted cells after a step: the one place to read it from the report once that has it.
pub(super) fn inverted_cells(_report: &StepReport, cells: &Cells, body: &Body) -> usize {
    cells.inverted(body)
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_body::{Block, Face, Tissue};

    #[test]
    fn cell_turned_inside_out_is_counted() {
        let block = Block::new([3, 4, 5], DVec3::new(0.02, 0.03, 0.04)).unwrap().fix(Face::NegY);
        let made = block.tissue(&Tissue::default()).unwrap();
        let cells = Cells::of(&made.network, 0.01);
        assert_eq!(cells.0.len(), 2 * 3 * 4);
        let mut body = Body::new(made.network, made.surface).unwrap();
        assert_eq!(cells.inverted(&body), 0);
        // A corner cell's layer pushed below the layer under it.
        let mut x = body.positions_m().to_vec();
        for [i, k] in [[0, 0], [1, 0], [0, 1], [1, 1]] {
            x[block.node([i, 3, k])].y -= 0.015;
        }
        body.set_state(&x, &vec![DVec3::ZERO; x.len()]).unwrap();
        assert_eq!(cells.inverted(&body), 1);
    }
}
