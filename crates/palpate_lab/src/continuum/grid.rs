//! Grids of the cases, refined towards the edges of a punch.

use super::options::{Case, Continuum};
use crate::element_options::ElementOption;
use crate::error::LabError;
use glam::DVec3;
use palpate_body::{Block, Face, Network, NetworkBuilder, cell_tetrahedra};

/// Half the edge of a punch over the longest edge of the top.
const PUNCH: f64 = 0.1;

/// Half the edge of the punch of a case, m; `None` without a punch.
pub(super) fn punch_m(options: &Continuum) -> Option<f64> {
    let size = options.size_m();
    match options.case {
        Case::Punch => Some(PUNCH * size.x.max(size.y)),
        // As wide as the layer is thick.
        Case::Layer => Some(0.5 * size.z),
        _ => None,
    }
}

/// The network of a case with `cells` cells along the longest edge, centred in x and y with its bottom at z = 0, or with its clamped end at
/// x = 0. The nodes of the bonded faces are fixed.
pub(super) fn network(options: &Continuum, cells: usize) -> Result<Network, LabError> {
    let (size, punch_m) = (options.size_m(), punch_m(options));
    let along = |axis: usize| -> Vec<f64> {
        let (low, high) = (-0.5 * size[axis], 0.5 * size[axis]);
        let count = ((size[axis] / size.max_element() * cells as f64).round() as usize).max(1);
        match punch_m.filter(|_| options.element != ElementOption::Spring) {
            Some(half) if axis < 2 && 2.0 * half < size[axis] => around_punch(high, half, count),
            Some(_) if axis == 2 => {
                // Finer towards the top.
                let count = count.max(cells / 2) as f64;
                let up = |i: f64| high - (high - low) * (1.0 - i / count).powf(GRADE);
                (0..=count as usize).map(|i| up(i as f64)).collect()
            }
            _ => lines(low, high, count).collect(),
        }
    };
    let low = if options.case == Case::Cantilever {
        DVec3::new(0.5 * size.x, 0.0, 0.0)
    } else {
        DVec3::new(0.0, 0.0, 0.5 * size.z)
    };
    let tissue = options.tissue();
    let axes = [0, 1, 2].map(along);
    let network = match options.element {
        ElementOption::Spring => {
            // The springs of a lattice are those of equal cells.
            let nodes = axes.each_ref().map(Vec::len);
            let block = Block::new(nodes, size)?.centered_at(low)?.allow_unconstrained();
            block.tissue(&tissue)?.network.edit()
        }
        ElementOption::Hex => grid_of_cells(&axes, low, |network, corners| {
            network.hexahedron(corners, &tissue, 1.0);
        }),
        ElementOption::Tet => grid_of_cells(&axes, low, |network, corners| {
            network.tetrahedra(&cell_tetrahedra(corners), &tissue);
        }),
    };
    let is_low = |face: Face, x: DVec3| (x - low)[face.axis()] < -0.5 * size[face.axis()] + 1e-9;
    let is_top = |x: DVec3| (x - low).z > 0.5 * size.z - 1e-9;
    let is_fixed = |x: DVec3| match options.case {
        Case::BondedCube | Case::Twist => is_low(Face::NegZ, x) || is_top(x),
        Case::Punch | Case::Layer | Case::Modes => is_low(Face::NegZ, x),
        Case::Cantilever => is_low(Face::NegX, x),
    };
    Ok(network.fix_where(is_fixed).build()?)
}

/// Exponent of the distances of nodes from the edge of a punch, where the stress is singular.
const GRADE: f64 = 2.0;

/// Number of cells under a punch of `cells` along an axis; even.
fn under_punch(cells: usize) -> usize {
    2 * ((UNDER * cells as f64 / 2.0).round() as usize).max(1)
}

/// Share of the cells along an axis that are under a punch.
const UNDER: f64 = 0.25;

/// Places of nodes from -`high_m` to `high_m`, of which about `cells` cells are between them, with nodes at ± `half_m` and finer cells there.
fn around_punch(high_m: f64, half_m: f64, cells: usize) -> Vec<f64> {
    let under = under_punch(cells) / 2;
    let outside = (cells / 2).saturating_sub(under).max(1);
    // From the middle outwards.
    let inner = (0..=under).map(|i| half_m * (1.0 - (1.0 - i as f64 / under as f64).powf(GRADE)));
    let outer = (1..=outside).map(|i| half_m + (high_m - half_m) * (i as f64 / outside as f64).powf(GRADE));
    let right: Vec<f64> = inner.chain(outer).collect();
    right.iter().skip(1).rev().map(|x| -x).chain(right.iter().copied()).collect()
}

fn lines(from: f64, to: f64, cells: usize) -> impl Iterator<Item = f64> {
    (0..=cells).map(move |i| from + (to - from) * i as f64 / cells as f64)
}

/// Nodes at all places of the axes relative to `center`, with elements in the cells between them that `add` adds.
fn grid_of_cells(
    axes: &[Vec<f64>; 3],
    center: DVec3,
    mut add: impl FnMut(&mut NetworkBuilder, [usize; 8]),
) -> NetworkBuilder {
    let mut network = NetworkBuilder::new();
    let [x, y, z] = axes;
    for &z in z {
        for &y in y {
            for &x in x {
                network.node(center + DVec3::new(x, y, z), 0.0);
            }
        }
    }
    let node = |i: usize, j: usize, k: usize| i + x.len() * (j + y.len() * k);
    for k in 0..z.len() - 1 {
        for j in 0..y.len() - 1 {
            for i in 0..x.len() - 1 {
                let corner = |c: usize| node(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2));
                add(&mut network, std::array::from_fn(corner));
            }
        }
    }
    network.allow_unconstrained()
}
