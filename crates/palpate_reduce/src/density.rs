//! How the stiffness of a block of fixed size changes with the density of its mesh.

use crate::hinf::largest_singular_value;
use crate::{ReduceError, SecondOrderSystem};
use faer::{Mat, c64};
use palpate_body::{Body, Lattice, Surface};

/// The stiffness of a block with `density` cells along each edge, relative to that of one cell, when all springs have
/// the same stiffness: the seed's Fig. 16.
///
/// A block of `dimension` dimensions has one face held and the opposite one moved as a rigid plate; its stiffness matrix
/// is the force on that plate over its translation (dimension × dimension), all other nodes at rest where
/// they have no force. What is compared is its largest singular value, the stiffness in compression. In one dimension,
/// springs in a row, it is 1/density, which section 5.1 rests on. The paper leaves the definition open; this is the one that
/// contains that case.
///
/// # Errors
/// [`ReduceError::Option`] when `dimension` is not 1 to 3 or `density` is zero; [`ReduceError::Body`] when there are too
/// many nodes.
pub fn block_scaling(dimension: usize, density: usize) -> Result<f64, ReduceError> {
    for (what, value, ok, allowed) in [
        ("dimension of the block", dimension, (1..=3).contains(&dimension), "1, 2 or 3"),
        ("density of the mesh", density, density > 0, "at least 1"),
    ] {
        if !ok {
            return Err(ReduceError::Option { what, value: value as f64, allowed });
        }
    }
    Ok(block_stiffness(dimension, density)? / block_stiffness(dimension, 1)?)
}

/// The stiffness in compression of a block of springs of 1 N/m.
fn block_stiffness(dimension: usize, density: usize) -> Result<f64, ReduceError> {
    let mut nodes = [1; 3];
    nodes[..dimension].fill(density.saturating_add(1));
    let lattice = Lattice::new(nodes, 1.0)?;
    let normal = dimension - 1;
    let network = lattice.uniform(1.0, 0.0, 1.0, |ijk| ijk[normal] == 0)?;
    let plate: Vec<usize> =
        lattice.grid().filter(|ijk| ijk[normal] == density).map(|ijk| lattice.node(ijk)).collect();
    let body = Body::new(network, Surface::default())?;
    let stiffness =
        SecondOrderSystem::of_body(&body, &plate, dimension)?.driven_as_one().static_stiffness()?;
    let complex = Mat::from_fn(dimension, dimension, |i, j| c64::new(stiffness[(i, j)], 0.0));
    Ok(largest_singular_value(&complex))
}
