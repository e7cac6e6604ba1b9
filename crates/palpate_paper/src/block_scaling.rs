//! Stiffness of a block of fixed size over the density of its mesh.

use faer::{Mat, c64};
use palpate_body::{Body, Lattice, Surface};
use palpate_reduce::{ReduceError, SecondOrderSystem};

/// Stiffness of a block of fixed size with `density` cells along each edge, relative to a single cell, with equal springs: the seed
/// paper's Fig. 16.
///
/// A block of `dimension` dimensions is attached to its surroundings by its 2^dimension corners; no force acts on its other nodes. Its
/// stiffness matrix, forces on the corners over their displacements, is that of the whole block condensed on the corners. The factor
/// is the ratio of the largest singular values. A single cell with springs scaled by it is as stiff as `density`^dimension cells. In
/// one dimension, springs in series, the factor is 1/density, the rule of section 5.1. The paper states no definition; this one
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

/// Largest singular value of the stiffness matrix on the corners of a block of springs of 1 N/m.
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

/// Largest singular value; zero where the decomposition fails, which only numbers that are not finite cause.
fn largest_singular_value(m: &Mat<f64>) -> f64 {
    let complex = Mat::from_fn(m.nrows(), m.ncols(), |i, j| c64::new(m[(i, j)], 0.0));
    complex.singular_values().ok().and_then(|values| values.first().copied()).unwrap_or(0.0)
}
