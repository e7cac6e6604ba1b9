//! The stiffness of a block of fixed size as a function of its mesh density.

use crate::hinf::{largest_singular_value, real};
use crate::{ReduceError, SecondOrderSystem};
use palpate_body::{Body, Lattice, Surface};

/// Stiffness of a block of fixed size with `density` cells along each edge, relative to a single cell with springs of the same stiffness:
/// the seed paper's Fig. 16.
///
/// A block of `dimension` dimensions is attached by its 2^dimension corners; all other nodes are in equilibrium. Its stiffness matrix is
/// that of the whole block condensed onto the corners, and the result compares its largest singular value. A single cell whose springs
/// are scaled by the result is as stiff as `density`^dimension cells. In one dimension, springs in series, the result is 1/density as
/// section 5.1 requires. The paper states no definition; this one includes that case.
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

/// The largest singular value of the stiffness matrix on the corners of a block of springs of 1 N/m.
fn block_stiffness(dimension: usize, density: usize) -> Result<f64, ReduceError> {
    let mut nodes = [1; 3];
    nodes[..dimension].fill(density.saturating_add(1));
    let lattice = Lattice::new(nodes, 1.0)?.allow_unconstrained();
    let corner = |ijk: [usize; 3]| ijk[..dimension].iter().all(|&n| n == 0 || n == density);
    let corners: Vec<usize> =
        lattice.grid().filter(|&ijk| corner(ijk)).map(|ijk| lattice.node(ijk)).collect();
    let body = Body::new(lattice.uniform(1.0, 0.0, 1.0, |_| false)?, Surface::default())?;
    let stiffness = SecondOrderSystem::of_body(&body, &corners, dimension)?.static_stiffness()?;
    Ok(largest_singular_value(&real(&stiffness)))
}
