//! Hexahedral cells of a network and their volume barriers.

mod active_cells;

pub(crate) use active_cells::{ActiveCells, rate_bound};

use crate::Link;
use crate::incidence::Incidence;
use glam::{DMat3, DVec3};
use palpate_laws::VolumeBarrier;

/// The hexahedral cells of a network. Each of the ten tetrahedra of a cell of springs has a volume barrier; see
/// [`VolumeBarrier`]. Elements resist inversion by their own law, and their cells have none.
///
/// Corner c of a cell lies towards +x where bit 0 of c is set, +y with bit 1, +z with bit 2.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Cells {
    nodes: Vec<[usize; 8]>,
    /// Volume barriers of each cell of springs; these come first.
    barriers: Vec<[VolumeBarrier; TETRAHEDRA.len()]>,
    /// Cells of springs of each node.
    incidence: Incidence,
    /// Shortest edge of the cells of springs at rest, m.
    shortest_m: f64,
}

/// A tetrahedron of a cell with its volume barrier.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BarrierTetrahedron {
    /// Nodes; the edges lead from the first to the others.
    pub nodes: [usize; 4],
    /// Volume barrier.
    pub barrier: VolumeBarrier,
}

/// Tetrahedra of a cell with a barrier: those at its eight corners, and the two between alternate corners, which
/// alone change their volume when opposite faces twist. Together they form the two decompositions of a hexahedron
/// into five tetrahedra.
const TETRAHEDRA: [[usize; 4]; 10] = [
    [0, 1, 2, 4],
    [1, 0, 3, 5],
    [2, 3, 0, 6],
    [3, 2, 1, 7],
    [4, 5, 6, 0],
    [5, 4, 7, 1],
    [6, 7, 4, 2],
    [7, 6, 5, 3],
    [0, 3, 5, 6],
    [7, 4, 2, 1],
];

/// E V of cells of springs, J: (1/V) Σ k ℓ² = 6 E in an isotropic lattice. Cells share a spring equally.
pub(crate) fn spring_energies_j(
    cells: &[[usize; 8]],
    rest_m: &[DVec3],
    links: &[Link],
    incidence: &Incidence,
) -> Vec<f64> {
    let springs_of = |cell: &[usize; 8]| -> Vec<usize> {
        let mut inside: Vec<usize> = Vec::with_capacity(28);
        for &node in cell {
            // Each spring once, from its end a.
            inside.extend(
                incidence.of(node).iter().filter(|&&l| links[l].a == node && cell.contains(&links[l].b)),
            );
        }
        inside
    };
    let mut sharing = vec![0_u32; links.len()];
    cells.iter().flat_map(springs_of).for_each(|link| sharing[link] += 1);
    let energy = |cell: &[usize; 8]| {
        let k_l2 = springs_of(cell).into_iter().map(|l| {
            let length_m = rest_m[links[l].a].distance(rest_m[links[l].b]);
            let tension = links[l].spring.law().at(length_m - links[l].spring.rest_length_m());
            tension.stiffness_n_per_m * length_m * length_m / f64::from(sharing[l])
        });
        k_l2.sum::<f64>() / 6.0
    };
    cells.iter().map(energy).collect()
}

fn edges_m(x: &[DVec3], [o, a, b, c]: [usize; 4]) -> [DVec3; 3] {
    [x[a] - x[o], x[b] - x[o], x[c] - x[o]]
}

impl BarrierTetrahedron {
    /// Edges at the positions `x_m` of all nodes, m.
    #[must_use]
    pub fn edges_m(&self, x_m: &[DVec3]) -> [DVec3; 3] {
        edges_m(x_m, self.nodes)
    }

    /// Volume ratio at the positions `x_m` of all nodes.
    #[must_use]
    pub fn ratio(&self, x_m: &[DVec3]) -> f64 {
        self.barrier.ratio(self.edges_m(x_m))
    }

    /// Forces on the four nodes, N.
    #[must_use]
    pub fn forces_n(&self, x_m: &[DVec3]) -> [DVec3; 4] {
        let [a, b, c] = self.barrier.forces_n(self.edges_m(x_m));
        [-(a + b + c), a, b, c]
    }

    /// Stiffness of the four nodes in 3 × 3 blocks, N/m. With `clamped` it is positive semidefinite.
    #[must_use]
    pub fn stiffness(&self, x_m: &[DVec3], clamped: bool) -> [[DMat3; 4]; 4] {
        let edges = self.barrier.tangent(self.edges_m(x_m), clamped);
        let mut blocks = [[DMat3::ZERO; 4]; 4];
        for (i, row) in edges.iter().enumerate() {
            for (j, &block) in row.iter().enumerate() {
                blocks[i + 1][j + 1] += block;
                blocks[0][j + 1] -= block;
                blocks[i + 1][0] -= block;
                blocks[0][0] += block;
            }
        }
        blocks
    }
}

impl Cells {
    /// Creates cells of springs with the given nodes and energies E V, J, and those of elements. A cell of springs without volume at rest or
    /// without energy is omitted.
    ///
    /// The energy scales c of the tetrahedra of a cell sum to E V. The barrier then has a pressure of 1.04 E at J = 0 and of 2 E at J = −0.5;
    /// the springs of a flat cell pull with up to 0.55 E towards the inverted side.
    pub(crate) fn new(
        of_springs: impl Iterator<Item = ([usize; 8], f64)>,
        of_elements: impl Iterator<Item = [usize; 8]>,
        rest_m: &[DVec3],
    ) -> Self {
        let mut made = Self { shortest_m: f64::INFINITY, ..Self::default() };
        for (cell, energy_j) in of_springs {
            let energy_j = energy_j / TETRAHEDRA.len() as f64;
            let rest = |of: [usize; 4]| edges_m(rest_m, of.map(|corner| cell[corner]));
            let [Some(a), Some(b), Some(c), Some(d), Some(e), Some(f), Some(g), Some(h), Some(i), Some(j)] =
                TETRAHEDRA.map(|of| VolumeBarrier::new(rest(of), energy_j))
            else {
                continue;
            };
            made.barriers.push([a, b, c, d, e, f, g, h, i, j]);
            for edge in TETRAHEDRA.into_iter().flat_map(rest) {
                made.shortest_m = made.shortest_m.min(edge.length());
            }
            made.nodes.push(cell);
        }
        made.incidence = Incidence::new(rest_m.len(), made.nodes.iter().copied());
        made.nodes.extend(of_elements);
        made
    }

    /// Nodes of each cell.
    pub(crate) fn nodes(&self) -> &[[usize; 8]] {
        &self.nodes
    }

    /// Number of cells of springs, which have barriers and come first.
    pub(crate) fn with_barriers(&self) -> usize {
        self.barriers.len()
    }

    /// The other nodes of the cells of springs of `node`, with duplicates.
    pub(crate) fn cell_mates(&self, node: usize) -> impl Iterator<Item = usize> + '_ {
        self.cells_of(node).iter().flat_map(|&cell| self.nodes[cell]).filter(move |&other| other != node)
    }

    /// Indices of the cells of springs of `node`.
    fn cells_of(&self, node: usize) -> &[usize] {
        self.incidence.of(node)
    }

    fn tetrahedra(&self, cell: usize) -> impl Iterator<Item = BarrierTetrahedron> + '_ {
        let nodes = &self.nodes[cell];
        TETRAHEDRA
            .iter()
            .zip(&self.barriers[cell])
            .map(|(of, &barrier)| BarrierTetrahedron { nodes: of.map(|corner| nodes[corner]), barrier })
    }

    /// All tetrahedra with barriers, cell by cell.
    pub(crate) fn all_tetrahedra(&self) -> impl Iterator<Item = BarrierTetrahedron> + '_ {
        (0..self.with_barriers()).flat_map(|cell| self.tetrahedra(cell))
    }

    /// Tetrahedra whose volume ratio is below `ratio` at the positions `x`.
    pub(crate) fn tetrahedra_below<'a>(
        &'a self,
        ratio: f64,
        x: &'a [DVec3],
    ) -> impl Iterator<Item = BarrierTetrahedron> + 'a {
        self.all_tetrahedra().filter(move |tetrahedron| tetrahedron.ratio(x) < ratio)
    }

    /// Tetrahedra whose barriers act at the positions `x`.
    pub(crate) fn active_tetrahedra<'a>(
        &'a self,
        x: &'a [DVec3],
    ) -> impl Iterator<Item = BarrierTetrahedron> + 'a {
        self.tetrahedra_below(VolumeBarrier::ONSET, x)
    }

    /// Force of the barriers on `node`, N; `None` if no barrier acts.
    pub(crate) fn force_on_n(&self, x: &[DVec3], node: usize) -> Option<DVec3> {
        let mut sum = None;
        for tetrahedron in self.cells_of(node).iter().flat_map(|&cell| self.tetrahedra(cell)) {
            let place = tetrahedron.nodes.iter().position(|&other| other == node);
            if let Some(place) = place.filter(|_| VolumeBarrier::is_active(tetrahedron.ratio(x))) {
                *sum.get_or_insert(DVec3::ZERO) += tetrahedron.forces_n(x)[place];
            }
        }
        sum
    }

    /// Adds the forces of the barriers of `cell`, N.
    fn add_forces(&self, cell: usize, x: &[DVec3], force: &mut [DVec3]) {
        for tetrahedron in self.tetrahedra(cell) {
            if VolumeBarrier::is_active(tetrahedron.ratio(x)) {
                for (node, f) in tetrahedron.nodes.into_iter().zip(tetrahedron.forces_n(x)) {
                    force[node] += f;
                }
            }
        }
    }

    /// Adds the forces of all barriers, N.
    pub(crate) fn add_all_forces(&self, x: &[DVec3], force: &mut [DVec3]) {
        (0..self.with_barriers()).for_each(|cell| self.add_forces(cell, x, force));
    }

    /// Energy of all barriers, J.
    pub(crate) fn energy_j(&self, x: &[DVec3]) -> f64 {
        self.all_tetrahedra().map(|tetrahedron| tetrahedron.barrier.energy_j(tetrahedron.ratio(x))).sum()
    }

    /// Whether a tetrahedron of a cell of springs is flat or inverted.
    pub(crate) fn is_inverted(&self, cell: usize, x: &[DVec3]) -> bool {
        self.tetrahedra(cell).any(|tetrahedron| tetrahedron.ratio(x) <= 0.0)
    }
}
