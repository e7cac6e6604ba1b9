//! Static compliance of the surface of the spring lattice: how far a node moves under a force on another node.
//!
//! The lattice is that of isotropic tissue (Poisson's ratio 1/4) on a half-space, in cubic cells of side `h` with Young's
//! modulus `E`: springs of `8/15 E h` along the sides of the cells, `4/15 E h` across their faces, `1/10 E h` through them.
//! The surface is a plane of nodes. Springs in it have half of these stiffnesses, as on the surface of a block: they belong to
//! half as many cells.
//!
//! Compliances are dimensionless: a force `F` gives the displacement `G F / (E h)`. Axes: x and y along the cells in the
//! surface, z along the outward normal.
//!
//! # Accuracy
//!
//! The table has ten decimals, all of them valid; `examples/grid_compliance.rs` generates it and
//! describes the method. Beyond the table, from nine cells on, [`lattice_compliance`] is the compliance of the elastic
//! half-space (K. L. Johnson, Contact Mechanics, 1985, sections 3.2 and 3.6). The difference between the two falls at least
//! with the square of the distance: 2.5 % of the largest entry at four cells, 1 % at six, 0.5 % at eight.
//!
//! The radial interpolations differ from the table by at most 0.6 % (normal) and 1.6 % (tangential): the lattice is not quite
//! alike in all directions. Their matrices over scattered nodes are positive definite in all arrangements tried with nodes half
//! a cell apart or more: random, square, hexagonal, cubic.
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use std::f64::consts::PI;

use glam::{DMat3, DVec3};

mod hexahedra;
mod table;

/// Compliance of the surface node at offset (`i`, `j`) from the node that carries the force.
///
/// The matrix `G` gives the displacement `G F / (E h)` of the node at `i` cells along x and `j` along y from the force `F`.
/// It is the lattice's up to eight cells in both directions and the continuum's beyond.
///
/// ```
/// use glam::DVec3;
/// use palpate_laws::lattice_compliance;
///
/// // 20 kPa, cells of 10 mm; a push of 0.1 N on a node moves the node itself and its neighbour down.
/// let give_m = |i, j| lattice_compliance(i, j) * DVec3::new(0.0, 0.0, -0.1) / (20e3 * 0.010);
/// assert!((give_m(0, 0).z + 0.61e-3).abs() < 0.01e-3);
/// assert!((give_m(1, 0).z + 0.14e-3).abs() < 0.01e-3);
/// // The neighbour also moves towards the push.
/// assert!(give_m(1, 0).x < 0.0);
/// ```
#[must_use]
pub fn lattice_compliance(i: i32, j: i32) -> DMat3 {
    let (along_x, along_y) = (i.unsigned_abs(), j.unsigned_abs());
    let (far, near) = (along_x.max(along_y), along_x.min(along_y));
    // Within `REACH` the index is small.
    let entries = (far <= table::REACH).then(|| table::COMPLIANCE.get((far * (far + 1) / 2 + near) as usize));
    let Some(&[mut xx, xy, mut xz, mut yy, mut yz, zz]) = entries.flatten() else {
        return continuum_compliance(f64::from(i), f64::from(j));
    };
    if along_y > along_x {
        (xx, yy, xz, yz) = (yy, xx, yz, xz);
    }
    let (x_sign, y_sign) = (f64::from(i.signum()), f64::from(j.signum()));
    from_entries([xx, xy * x_sign * y_sign, xz * x_sign, yy, yz * y_sign, zz])
}

/// Normal compliance between two nodes of the surface, for any distance between them.
///
/// A C1 interpolation of the angular mean of the `zz` entry of [`lattice_compliance`]: exact at 0, positive, falling, equal to
/// the continuum's from ten cells on. It suits pairs of nodes that do not lie in one plane of a lattice. A distance that is not
/// a number gives NaN.
#[must_use]
pub fn normal_compliance_at(distance_cells: f64) -> f64 {
    interpolate(&table::NORMAL, NORMAL_FAR, distance_cells.abs())
}

/// Tangential compliance between two nodes of the surface, for any distance between them.
///
/// As [`normal_compliance_at`], for the mean of the `xx` and `yy` entries: displacement along a tangential force, averaged over
/// its directions.
#[must_use]
pub fn tangential_compliance_at(distance_cells: f64) -> f64 {
    interpolate(&table::TANGENTIAL, TANGENTIAL_FAR, distance_cells.abs())
}

/// Normal compliance between two nodes of the surface of cubic hexahedral elements ([`crate::HexahedronShape`]) with Poisson's ratio
/// `poissons_ratio`, at an offset of `i` and `j` cells along their sides.
///
/// It is that of the elements up to eight cells in both directions, with a cubic interpolation between the ten ratios of the table, and the
/// continuum's beyond. Elements with one integration point yield more than the continuum to loads that alternate from node to node, so the
/// entries fall unevenly with the distance: the load on a single node moves it by up to twice as much as springs do.
///
/// ```
/// use palpate_laws::hexahedra_compliance;
///
/// // The mean over a face and its four corners is close to that of a lattice of springs.
/// let of_face = |c: fn(i32, i32) -> f64| 0.25 * (c(0, 0) + 2.0 * c(1, 0) + c(1, 1));
/// let hexahedra = of_face(|i, j| hexahedra_compliance(0.25, i, j));
/// let springs = of_face(|i, j| palpate_laws::lattice_compliance(i, j).z_axis.z);
/// assert!((hexahedra / springs - 1.0).abs() < 0.25);
/// ```
#[must_use]
pub fn hexahedra_compliance(poissons_ratio: f64, i: i32, j: i32) -> f64 {
    let (along_x, along_y) = (i.unsigned_abs(), j.unsigned_abs());
    let (far, near) = (along_x.max(along_y), along_x.min(along_y));
    if far > hexahedra::REACH {
        let distance = f64::from(i).hypot(f64::from(j));
        return (1.0 - poissons_ratio * poissons_ratio) / (PI * distance);
    }
    let at = (far * (far + 1) / 2 + near) as usize;
    let table = &hexahedra::NORMAL;
    // The four ratios around the given one.
    let above = table.iter().position(|(ratio, _)| *ratio > poissons_ratio).unwrap_or(table.len());
    let first = above.saturating_sub(2).min(table.len() - 4);
    let around = table.get(first..first + 4).unwrap_or_default();
    let term = |(k, (ratio, values)): (usize, &(f64, [f64; 45]))| {
        let others = around.iter().enumerate().filter(|(other, _)| *other != k);
        let weight: f64 = others.map(|(_, (other, _))| (poissons_ratio - other) / (ratio - other)).product();
        weight * values.get(at).copied().unwrap_or_default()
    };
    around.iter().enumerate().map(term).sum()
}

/// Normal compliance of the continuum at a distance of one cell: `(1 - nu²) / pi`.
const NORMAL_FAR: f64 = 15.0 / (16.0 * PI);
/// Tangential compliance of the continuum at a distance of one cell, mean over directions: `(1 + nu) (2 - nu) / (2 pi)`.
const TANGENTIAL_FAR: f64 = 35.0 / (32.0 * PI);

/// Compliance of the elastic half-space (Boussinesq, Cerruti) with Poisson's ratio 1/4 at an offset in cells.
fn continuum_compliance(x: f64, y: f64) -> DMat3 {
    let distance = x.hypot(y);
    // 1 / (4 pi mu r), with the shear modulus mu = 2/5 E.
    let scale = 1.0 / (1.6 * PI * distance);
    let (cos, sin) = (x / distance, y / distance);
    from_entries([
        scale * (1.5 + 0.5 * cos * cos),
        scale * 0.5 * cos * sin,
        scale * 0.5 * cos,
        scale * (1.5 + 0.5 * sin * sin),
        scale * 0.5 * sin,
        scale * 1.5,
    ])
}

/// The matrix of the entries `xx, xy, xz, yy, yz, zz`. Coupling between normal and tangential directions is antisymmetric:
/// the offset from the second node to the first is the opposite one.
fn from_entries([xx, xy, xz, yy, yz, zz]: [f64; 6]) -> DMat3 {
    DMat3::from_cols(DVec3::new(xx, xy, -xz), DVec3::new(xy, yy, -yz), DVec3::new(xz, yz, zz))
}

/// Reciprocal of the cubic Hermite interpolation of `knots`; `far / distance` beyond the last one.
fn interpolate(knots: &[[f64; 3]], far: f64, distance: f64) -> f64 {
    for (&[start, from, slope_from], &[end, to, slope_to]) in knots.iter().zip(knots.iter().skip(1)) {
        if distance < end {
            let width = end - start;
            let t = (distance - start) / width;
            let (rise, bend_from, bend_to) = (to - from, slope_from * width, slope_to * width);
            let quadratic = 3.0 * rise - 2.0 * bend_from - bend_to;
            let cubic = bend_from + bend_to - 2.0 * rise;
            return 1.0 / (from + t * (bend_from + t * (quadratic + t * cubic)));
        }
    }
    far / distance
}
