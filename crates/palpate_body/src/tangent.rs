//! The exact sparse tangent of internal forces.

use crate::network::NetworkState;
use crate::relaxed_stress::relaxed_of;
use crate::{Hexahedron, Network, SmoothedDomain};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat, SymbolicSparseColMatRef};
use glam::{DMat3, DVec3};
use palpate_laws::{HexahedronBlocks, stress_block, stress_change};

/// Sparsity pattern of a network's tangent. It is computed once, since the links and elements of a body never change. Degree of
/// freedom 3 f + c is component c of node `network.free()[f]`.
#[derive(Clone, Debug)]
pub struct TangentPattern {
    symbolic: SymbolicSparseColMat<usize>,
    links: Vec<LinkSlots>,
    /// First entries of the blocks of each hexahedron, by columns; [`NO_ENTRY`] where a corner is fixed.
    hexahedra: Vec<[[u32; 8]; 8]>,
    /// The same of each smoothed domain, one after the other.
    domains: Vec<u32>,
}

/// No entry of the matrix.
const NO_ENTRY: u32 = u32::MAX;

/// Stiffness K and damping B over the free nodes of a body in one state: the internal force changes by −K δx − B δv.
///
/// Both are symmetric; both triangles are stored, column by column. B is positive semidefinite, and so is K unless a
/// spring or a cell is compressed. The damper's geometric term (∂/∂x of b u·ḋ u) is omitted.
#[derive(Clone, Debug)]
pub struct Tangent {
    symbolic: SymbolicSparseColMat<usize>,
    stiffness: Vec<f64>,
    damping: Vec<f64>,
}

/// A 3 × 3 block in compressed columns: entry (r, c) is at `first + c * stride + r`.
#[derive(Clone, Copy, Debug)]
struct Slot {
    first: usize,
    stride: usize,
}

/// The blocks to which a link contributes; `None` where an end is fixed.
#[derive(Clone, Copy, Debug, Default)]
struct LinkSlots {
    aa: Option<Slot>,
    bb: Option<Slot>,
    /// Rows of a and columns of b, and vice versa.
    ab_ba: Option<(Slot, Slot)>,
}

impl TangentPattern {
    /// Creates the pattern of a network.
    pub(crate) fn of_network(network: &Network) -> Self {
        let columns: Vec<Vec<usize>> = network
            .free()
            .iter()
            .map(|&node| {
                let mut rows: Vec<usize> =
                    network.neighbours(node).filter_map(|other| network.free_index(other)).collect();
                rows.extend(network.free_index(node));
                rows.extend(
                    network.barriers().cell_mates(node).filter_map(|other| network.free_index(other)),
                );
                rows.sort_unstable();
                rows.dedup();
                rows
            })
            .collect();
        let dofs = 3 * columns.len();
        let (mut starts, mut rows) = (vec![0], Vec::new());
        let mut first = Vec::with_capacity(columns.len());
        for column in &columns {
            first.push(rows.len());
            for _ in 0..3 {
                rows.extend(column.iter().flat_map(|&row| [3 * row, 3 * row + 1, 3 * row + 2]));
                starts.push(rows.len());
            }
        }
        let slot = |row: usize, column: usize| {
            let place =
                columns[column].binary_search(&row).expect("the pattern holds every pair of neighbours");
            Slot { first: first[column] + 3 * place, stride: 3 * columns[column].len() }
        };
        let links = network
            .links()
            .iter()
            .map(|link| {
                let (a, b) = (network.free_index(link.a), network.free_index(link.b));
                LinkSlots {
                    aa: a.map(|a| slot(a, a)),
                    bb: b.map(|b| slot(b, b)),
                    ab_ba: a.zip(b).map(|(a, b)| (slot(a, b), slot(b, a))),
                }
            })
            .collect();
        let first = |column: Option<usize>, row: Option<usize>| {
            row.zip(column).map_or(NO_ENTRY, |(row, column)| slot(row, column).first as u32)
        };
        let of_element = |element: Hexahedron<'_>| {
            let free = element.nodes.map(|node| network.free_index(node));
            free.map(|column| free.map(|row| first(column, row)))
        };
        let hexahedra = network.hexahedra().iter().map(of_element).collect();
        let mut domains = Vec::new();
        for SmoothedDomain { nodes, .. } in network.tetrahedra().domains().iter() {
            let free = || nodes.iter().map(|node| network.free_index(*node as usize));
            domains.extend(
                free().flat_map(|column| free().map(move |row| (column, row))).map(|(c, r)| first(c, r)),
            );
        }
        let symbolic = SymbolicSparseColMat::new_checked(dofs, dofs, starts, None, rows);
        Self { symbolic, links, hexahedra, domains }
    }

    /// Creates a zero tangent with this pattern.
    #[must_use]
    pub fn zero(&self) -> Tangent {
        let entries = self.symbolic.row_idx().len();
        Tangent {
            symbolic: self.symbolic.clone(),
            stiffness: vec![0.0; entries],
            damping: vec![0.0; entries],
        }
    }

    /// [`TangentPattern::fill`] in a given state, with separate clamping for springs and elements, and for volume barriers.
    pub(crate) fn fill_at(
        &self,
        state: NetworkState<'_>,
        (springs_clamped, barriers_clamped): (bool, bool),
        tangent: &mut Tangent,
    ) {
        let NetworkState { network, x, relaxed, .. } = state;
        let of_hexahedra = network.split_relaxed(relaxed).0;
        assert_eq!(self.links.len(), network.links().len(), "the pattern is of another network");
        assert_eq!(
            self.symbolic.row_idx().len(),
            tangent.stiffness.len(),
            "the tangent is of another network"
        );
        tangent.stiffness.fill(0.0);
        tangent.damping.fill(0.0);
        for (link, slots) in network.links().iter().zip(&self.links) {
            let t = link.spring.tangent(x[link.b] - x[link.a], springs_clamped);
            for (values, block) in [(&mut tangent.stiffness, t.stiffness), (&mut tangent.damping, t.damping)]
            {
                for slot in [slots.aa, slots.bb].into_iter().flatten() {
                    slot.add(block, values);
                }
                if let Some((ab, ba)) = slots.ab_ba {
                    ab.add(-block, values);
                    ba.add(-block, values);
                }
            }
        }
        for ((index, element), first) in network.hexahedra().iter().enumerate().zip(&self.hexahedra) {
            let strides = element.nodes.map(|node| {
                network.free_index(node).map_or(0, |column| self.symbolic.col_range(3 * column).len())
            });
            let add = |blocks: &HexahedronBlocks, values: &mut [f64]| {
                for (column, (of_column, stride)) in first.iter().zip(strides).enumerate() {
                    for (row, first) in of_column.iter().enumerate().filter(|(_, first)| **first != NO_ENTRY)
                    {
                        Slot { first: *first as usize, stride }.add(blocks[row][column], values);
                    }
                }
            };
            let stiffness = element.stiffness_n_per_m(x, relaxed_of(of_hexahedra, index), springs_clamped);
            add(&stiffness, &mut tangent.stiffness);
            if let Some(blocks) = element.damping_ns_per_m(x) {
                add(&blocks, &mut tangent.damping);
            }
        }
        for (column, &node) in network.free().iter().enumerate() {
            let Some(drag) = network.drag_ns_per_m().get(node) else { break };
            if let Some(slot) = Slot::of(&self.symbolic, column, column) {
                slot.add(DMat3::from_diagonal(DVec3::splat(*drag)), &mut tangent.damping);
            }
        }
        self.add_domains(state, springs_clamped, tangent);
        for tetrahedron in network.barriers().active_tetrahedra(x) {
            let free = tetrahedron.nodes.map(|node| network.free_index(node));
            for (row, blocks) in free.into_iter().zip(tetrahedron.stiffness(x, barriers_clamped)) {
                for (column, block) in free.into_iter().zip(blocks) {
                    let nodes = row.zip(column);
                    if let Some(slot) = nodes.and_then(|(row, column)| Slot::of(&self.symbolic, row, column))
                    {
                        slot.add(block, &mut tangent.stiffness);
                    }
                }
            }
        }
    }

    /// Adds the blocks of the smoothed domains.
    fn add_domains(&self, state: NetworkState<'_>, clamped: bool, tangent: &mut Tangent) {
        let NetworkState { network, x, relaxed, .. } = state;
        let relaxed = network.split_relaxed(relaxed).1;
        let domains = network.tetrahedra().domains();
        let shares = domains.volume_shares(x);
        let mut first = self.domains.as_slice();
        for index in 0..domains.len() {
            let domain = domains.at_shares(index, &shares);
            let count = domain.nodes.len();
            let (of_domain, rest) = first.split_at(count * count);
            first = rest;
            let f = domain.gradient(x);
            let relaxed = relaxed_of(relaxed, index);
            let stiffness = domain.material.tangent_j(&f, relaxed, clamped);
            let damping = domain.material.viscous_tangent_js(&f);
            let parts = [(Some(stiffness), &mut tangent.stiffness), (damping, &mut tangent.damping)];
            for (of_stress, values) in parts {
                let Some(of_stress) = of_stress else { continue };
                let columns =
                    domain.nodes.iter().zip(domain.gradients_per_m).zip(of_domain.chunks_exact(count));
                for ((node, b), rows) in columns {
                    let Some(column) = network.free_index(*node as usize) else { continue };
                    let stride = self.symbolic.col_range(3 * column).len();
                    let change = stress_change(&of_stress, *b);
                    for (first, b) in
                        rows.iter().zip(domain.gradients_per_m).filter(|(first, _)| **first != NO_ENTRY)
                    {
                        Slot { first: *first as usize, stride }.add(stress_block(&change, *b), values);
                    }
                }
            }
        }
    }

    /// Positions of the entries, for a symbolic factorisation.
    #[must_use]
    pub fn symbolic(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.symbolic.as_ref()
    }
}

impl Slot {
    /// Location of the block of two free nodes; `None` if the pattern has none.
    fn of(symbolic: &SymbolicSparseColMat<usize>, row: usize, column: usize) -> Option<Self> {
        let range = (column < symbolic.ncols() / 3).then(|| symbolic.col_range(3 * column))?;
        let place = symbolic.row_idx()[range.clone()].binary_search(&(3 * row)).ok()?;
        Some(Self { first: range.start + place, stride: range.len() })
    }

    fn add(self, block: DMat3, values: &mut [f64]) {
        for c in 0..3 {
            let column = block.col(c);
            let at = self.first + c * self.stride;
            for r in 0..3 {
                values[at + r] += column[r];
            }
        }
    }
}

impl Tangent {
    /// Stiffness K over the degrees of freedom of the free nodes, N/m.
    #[must_use]
    pub fn stiffness(&self) -> SparseColMatRef<'_, usize, f64> {
        SparseColMatRef::new(self.symbolic.as_ref(), &self.stiffness)
    }

    /// Damping B over the degrees of freedom of the free nodes, N s/m.
    #[must_use]
    pub fn damping(&self) -> SparseColMatRef<'_, usize, f64> {
        SparseColMatRef::new(self.symbolic.as_ref(), &self.damping)
    }

    /// Adds `block` to K at the free nodes `row` and `column`, given as indices of `network.free()`. Nodes that are neither
    /// linked nor in a common cell have no entries: then nothing is added.
    pub fn add_to_stiffness(&mut self, row: usize, column: usize, block: DMat3) {
        if let Some(slot) = Slot::of(&self.symbolic, row, column) {
            slot.add(block, &mut self.stiffness);
        }
    }

    /// Adds `shift_n_per_m[i]` to entry (i, i) of K.
    ///
    /// # Panics
    /// If there are fewer shifts than degrees of freedom.
    pub fn add_to_stiffness_diagonal(&mut self, shift_n_per_m: &[f64]) {
        for (column, shift) in shift_n_per_m.iter().enumerate().take(self.symbolic.ncols()) {
            let range = self.symbolic.col_range(column);
            let rows = &self.symbolic.row_idx()[range.clone()];
            if let Ok(place) = rows.binary_search(&column) {
                self.stiffness[range.start + place] += shift;
            }
        }
    }
}
