//! How the stiffness of a block of fixed size changes with the density of its mesh.

use faer::{Mat, c64};
use palpate_body::{Body, Lattice, Surface};
use palpate_reduce::{ReduceError, SecondOrderSystem};

/// How stiff a block of fixed size is when it is meshed with `density` cells along each edge, relative to a single cell,
/// if all springs have the same stiffness: the seed's Fig. 16.
///
/// A block of `dimension` dimensions is joined to what is around it by its corners, 2^dimension of them; all other nodes
/// are at rest where they have no force. Its stiffness matrix, the forces on the corners over their displacements, is
/// the whole block's condensed on them, and what is compared is its largest singular value. So a single cell whose
/// springs are scaled by this factor is as stiff as `density`^dimension cells. In one dimension, springs in a row, the
/// factor is 1/density: that is what section 5.1 rests on. The paper states no definition; this one contains that case.
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
    Ok(largest_singular_value(&stiffness))
}

/// Zero where it is not found, which happens for numbers that are not finite only.
fn largest_singular_value(m: &Mat<f64>) -> f64 {
    let complex = Mat::from_fn(m.nrows(), m.ncols(), |i, j| c64::new(m[(i, j)], 0.0));
    complex.singular_values().ok().and_then(|values| values.first().copied()).unwrap_or(0.0)
}
