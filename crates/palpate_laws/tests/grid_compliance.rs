//! The surface compliance of the lattice against its generator, a finite lattice and the continuum.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};
use palpate_laws::{
    hexahedra_compliance, lattice_compliance, normal_compliance_at, tangential_compliance_at,
};
use proptest::prelude::*;

#[path = "../examples/grid_compliance.rs"]
#[expect(dead_code, reason = "the test needs no main")]
mod generator;

#[test]
fn table_is_what_the_generator_prints() {
    let printed = generator::file().expect("two resolutions of the quadrature agree");
    assert_eq!(printed, include_str!("../src/grid_compliance/table.rs"));
}

#[test]
fn table_of_hexahedra_is_what_the_generator_prints() {
    let printed = generator::file_of_hexahedra().expect("two resolutions of the quadrature agree");
    assert_eq!(printed, include_str!("../src/grid_compliance/hexahedra.rs"));
}

#[test]
fn hexahedra_yield_like_the_continuum_far_from_the_load() {
    for nu in [0.0, 0.1, 0.23, 0.25, 0.33, 0.42, 0.45, 0.48, 0.49] {
        let far = |distance: f64| (1.0 - nu * nu) / (PI * distance);
        for (i, j) in [(8, 0), (0, -8), (7, 4), (-6, 6), (8, 8)] {
            let ratio = hexahedra_compliance(nu, i, j) / far(f64::from(i).hypot(f64::from(j)));
            assert!((ratio - 1.0).abs() < 0.03, "{nu} {i} {j}: {ratio}");
            assert_eq!(hexahedra_compliance(nu, i, j), hexahedra_compliance(nu, -j, i));
        }
        // Beyond the table.
        assert!((hexahedra_compliance(nu, 12, 5) / far(13.0) - 1.0).abs() < 1e-12);
        // Between the ratios of the table the compliance changes smoothly.
        let [before, here, after] = [nu - 0.004, nu, nu + 0.004].map(|nu| hexahedra_compliance(nu, 0, 0));
        assert!((here - 0.5 * (before + after)).abs() < 2e-4, "{nu}: {before} {here} {after}");
    }
}

/// A block of cells with a free top; sides and bottom are held `reach` cells away from the middle of the top.
struct Block {
    reach: usize,
    /// Springs between nodes, with the stiffness in all of their cells together.
    springs: Vec<(usize, usize, DVec3, f64)>,
    diagonal: Vec<DVec3>,
}

impl Block {
    fn new(reach: usize) -> Self {
        let mut block = Self { reach, springs: Vec::new(), diagonal: Vec::new() };
        let (across, deep) = (2 * reach, reach);
        let corners = [0, 1, 2, 3, 4, 5, 6, 7].map(|c: usize| [c & 1, c >> 1 & 1, c >> 2]);
        // Every cell brings its share of each spring: a side is shared by four cells, a face by two.
        let mut stiffness = std::collections::BTreeMap::new();
        for x in 0..across {
            for y in 0..across {
                for z in 0..deep {
                    for (at, a) in corners.iter().enumerate() {
                        for b in &corners[at + 1..] {
                            let axes = (0..3).filter(|&axis| a[axis] != b[axis]).count();
                            let share = [2.0 / 15.0, 2.0 / 15.0, 0.1][axes - 1];
                            let [from, to] = [a, b].map(|c| block.node(x + c[0], y + c[1], z + c[2]));
                            *stiffness.entry((from.min(to), from.max(to))).or_insert(0.0) += share;
                        }
                    }
                }
            }
        }
        block.diagonal = vec![DVec3::ZERO; block.node_count()];
        for ((from, to), stiffness) in stiffness {
            let axis = (block.place(to) - block.place(from)).normalize();
            block.springs.push((from, to, axis, stiffness));
            block.diagonal[from] += stiffness * axis * axis;
            block.diagonal[to] += stiffness * axis * axis;
        }
        block
    }

    fn node_count(&self) -> usize {
        (2 * self.reach + 1).pow(2) * (self.reach + 1)
    }

    /// Depth is counted from the top.
    fn node(&self, x: usize, y: usize, depth: usize) -> usize {
        (depth * (2 * self.reach + 1) + y) * (2 * self.reach + 1) + x
    }

    fn place(&self, node: usize) -> DVec3 {
        let across = 2 * self.reach + 1;
        let (x, y, depth) = (node % across, node / across % across, node / across / across);
        DVec3::new(x as f64, y as f64, -(depth as f64))
    }

    fn is_held(&self, node: usize) -> bool {
        let (place, end) = (self.place(node), 2.0 * self.reach as f64);
        place.x == 0.0 || place.y == 0.0 || place.x == end || place.y == end || -place.z == self.reach as f64
    }

    /// Displacements under a force on the middle of the top, by conjugate gradients.
    fn displacements(&self, force: DVec3) -> Vec<DVec3> {
        let held: Vec<bool> = (0..self.node_count()).map(|node| self.is_held(node)).collect();
        let dot = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum::<f64>();
        let precondition =
            |r: &[DVec3]| r.iter().zip(&self.diagonal).map(|(r, d)| *r / *d).collect::<Vec<_>>();
        let mut u = vec![DVec3::ZERO; self.node_count()];
        let mut residual = u.clone();
        residual[self.node(self.reach, self.reach, 0)] = force;
        let mut step = precondition(&residual);
        let mut norm = dot(&residual, &step);
        let end = 1e-18 * norm;
        while norm > end {
            let mut pull = vec![DVec3::ZERO; u.len()];
            for &(from, to, axis, stiffness) in &self.springs {
                let tension = axis * (stiffness * axis.dot(step[to] - step[from]));
                pull[from] -= tension;
                pull[to] += tension;
            }
            for (pull, _) in pull.iter_mut().zip(&held).filter(|(_, held)| **held) {
                *pull = DVec3::ZERO;
            }
            let length = norm / dot(&step, &pull);
            for ((u, residual), (step, pull)) in u.iter_mut().zip(&mut residual).zip(step.iter().zip(&pull)) {
                *u += length * *step;
                *residual -= length * *pull;
            }
            let next = precondition(&residual);
            let next_norm = dot(&residual, &next);
            for (step, next) in step.iter_mut().zip(next) {
                *step = next + *step * (next_norm / norm);
            }
            norm = next_norm;
        }
        u
    }

    /// Compliances of nodes at offsets from the middle of the top.
    fn compliances(&self, offsets: &[(usize, usize)]) -> Vec<DMat3> {
        let columns = [DVec3::X, DVec3::Y, DVec3::Z].map(|force| self.displacements(force));
        let at = |&(i, j): &(usize, usize)| {
            let node = self.node(self.reach + i, self.reach + j, 0);
            let [x, y, z] = columns.each_ref().map(|u| u[node]);
            DMat3::from_cols(x, y, z)
        };
        offsets.iter().map(at).collect()
    }
}

/// The compliance of a block falls short of the half-space's by a series in the inverse of the size: three sizes give the limit.
#[test]
fn table_is_the_limit_of_finite_lattices() {
    let offsets = [(0, 0), (1, 0), (0, 1), (1, 1), (2, 0), (2, 1), (1, 3)];
    let sizes = [8, 12, 18];
    let blocks = sizes.map(|reach| Block::new(reach).compliances(&offsets));
    // Lagrange's weights of the polynomial of second degree in the inverse of the size, at zero.
    let weight = |own: usize| {
        let others = sizes.iter().filter(|&&other| other != own);
        others.map(|&other| own as f64 / (own as f64 - other as f64)).product::<f64>()
    };
    for (at, &(i, j)) in offsets.iter().enumerate() {
        let terms = sizes.iter().zip(&blocks).map(|(&size, block)| block[at] * weight(size));
        let limit = terms.fold(DMat3::ZERO, |sum, term| sum + term);
        let table = lattice_compliance(i as i32, j as i32);
        assert!(limit.abs_diff_eq(table, 1e-3), "at ({i}, {j}): {limit} instead of {table}");
    }
}

/// Boussinesq and Cerruti for Poisson's ratio 1/4, after K. L. Johnson, Contact Mechanics, 1985, equations 3.18, 3.19 and 3.75.
/// His z points into the body.
fn half_space(x: f64, y: f64) -> DMat3 {
    let (nu, mu, r) = (0.25, 0.4, x.hypot(y));
    let scale = 1.0 / (4.0 * PI * mu);
    let normal =
        DVec3::new((1.0 - 2.0 * nu) * x / (r * r), (1.0 - 2.0 * nu) * y / (r * r), 2.0 * (1.0 - nu) / r);
    let tangential = |a: f64, b: f64| {
        let along = 1.0 / r + a * a / r.powi(3) + (1.0 - 2.0 * nu) * (1.0 / r - a * a / r.powi(3));
        let across = a * b / r.powi(3) - (1.0 - 2.0 * nu) * a * b / r.powi(3);
        (along, across, -(1.0 - 2.0 * nu) * a / (r * r))
    };
    let ((xx, yx, zx), (yy, xy, zy)) = (tangential(x, y), tangential(y, x));
    DMat3::from_cols(DVec3::new(xx, yx, zx), DVec3::new(xy, yy, zy), normal) * scale
}

/// Largest difference from the continuum over the largest entry of the continuum.
fn continuum_error(i: i32, j: i32) -> f64 {
    let continuum = half_space(f64::from(i), f64::from(j));
    let largest = |m: DMat3| m.to_cols_array().iter().fold(0.0, |most: f64, entry| most.max(entry.abs()));
    largest(lattice_compliance(i, j) - continuum) / largest(continuum)
}

#[test]
fn lattice_tends_to_the_continuum() {
    let error_from = |reach: i32| (0..=reach).map(|j| continuum_error(reach, j)).fold(0.0, f64::max);
    assert!(error_from(4) < 0.026);
    assert!(error_from(6) < 0.01);
    assert!(error_from(8) < 0.0055);
    // It falls with the square of the distance.
    assert!(error_from(8) < error_from(4) / 4.0);
}

#[test]
fn continuum_takes_over_beyond_the_table() {
    for (i, j) in [(9, 0), (-4, 9), (100, -70), (i32::MIN, i32::MAX), (0, i32::MIN)] {
        assert!(continuum_error(i, j) < 1e-12, "at ({i}, {j})");
    }
}

#[test]
fn compliance_has_the_symmetry_of_the_square() {
    let turn = DMat3::from_cols(DVec3::Y, DVec3::NEG_X, DVec3::Z);
    let mirror = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
    for i in -10..=10 {
        for j in -10..=10 {
            let compliance = lattice_compliance(i, j);
            let turned = turn * compliance * turn.transpose();
            assert!(lattice_compliance(-j, i).abs_diff_eq(turned, 1e-15), "turned ({i}, {j})");
            assert!(
                lattice_compliance(-i, j).abs_diff_eq(mirror * compliance * mirror, 1e-15),
                "mirrored ({i}, {j})"
            );
            // Reciprocity: node and force change places.
            assert!(
                lattice_compliance(-i, -j).abs_diff_eq(compliance.transpose(), 1e-15),
                "reciprocal ({i}, {j})"
            );
        }
    }
}

/// Work that `loads` do on the displacements that they cause, with `compliance` between two of them, and the sum of their squares.
fn work(loads: &[f64], compliance: impl Fn(usize, usize) -> f64) -> (f64, f64) {
    let rows = loads.iter().enumerate().map(|(a, load)| {
        load * loads.iter().enumerate().map(|(b, other)| other * compliance(a, b)).sum::<f64>()
    });
    (rows.sum(), loads.iter().map(|load| load * load).sum())
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn normal_loads_on_a_patch_do_positive_work(loads in prop::collection::vec(-1.0..1.0_f64, 64)) {
        let offset = |a: usize, b: usize| (a as i32 / 8 - b as i32 / 8, a as i32 % 8 - b as i32 % 8);
        let (work, square) = work(&loads, |a, b| {
            let (i, j) = offset(a, b);
            lattice_compliance(i, j).z_axis.z
        });
        prop_assert!(work > 0.4 * square, "{work} from {square}");
    }

    /// Nodes anywhere, half a cell apart or more.
    #[test]
    fn loads_on_scattered_nodes_do_positive_work(
        places in prop::collection::vec(prop::array::uniform3(0.0..3.0_f64), 200),
        loads in prop::collection::vec(-1.0..1.0_f64, 200),
    ) {
        let mut nodes: Vec<DVec3> = Vec::new();
        for place in places.into_iter().map(DVec3::from_array) {
            if nodes.iter().all(|node| node.distance(place) >= 0.5) {
                nodes.push(place);
            }
        }
        let loads = &loads[..nodes.len()];
        for compliance in [normal_compliance_at, tangential_compliance_at] {
            let (work, square) = work(loads, |a, b| compliance(nodes[a].distance(nodes[b])));
            prop_assert!(work > 0.1 * square, "{work} from {square}");
        }
    }

    #[test]
    fn radial_interpolations_fall_and_stay_positive(distance in 0.0..15.0_f64, step in 1e-6..0.1_f64) {
        for compliance in [normal_compliance_at, tangential_compliance_at] {
            let (here, farther) = (compliance(distance), compliance(distance + step));
            prop_assert!(0.0 < farther && farther < here, "{here} at {distance}, then {farther}");
            // C1: the slope of the reciprocal is continuous.
            let slope = |at: f64| (compliance(at + 1e-5).recip() - compliance(at - 1e-5).recip()) / 2e-5;
            prop_assert!((slope(distance) - slope(distance + 1e-4)).abs() < 5e-3);
        }
    }
}

#[test]
fn radial_interpolations_have_no_kink_at_their_knots() {
    for compliance in [normal_compliance_at, tangential_compliance_at] {
        for knot in [1.0, 2f64.sqrt(), 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0] {
            let value = |at: f64| compliance(at).recip();
            let step = 1e-5;
            let (left, right) = (value(knot) - value(knot - step), value(knot + step) - value(knot));
            assert!((left - right).abs() / step < 1e-3, "slopes at {knot}");
        }
    }
}

#[test]
fn radial_interpolations_are_the_means_of_the_table() {
    let own = lattice_compliance(0, 0);
    assert!((normal_compliance_at(0.0) - own.z_axis.z).abs() < 1e-9);
    assert!((tangential_compliance_at(0.0) - own.x_axis.x).abs() < 1e-9);
    for i in 1..=12 {
        for j in 0..=i {
            let table = lattice_compliance(i, j);
            let distance = f64::from(i).hypot(f64::from(j));
            let normal = normal_compliance_at(distance) / table.z_axis.z - 1.0;
            let tangential =
                tangential_compliance_at(distance) / (0.5 * (table.x_axis.x + table.y_axis.y)) - 1.0;
            assert!(normal.abs() < 0.01, "normal at ({i}, {j}): {normal}");
            assert!(tangential.abs() < 0.02, "tangential at ({i}, {j}): {tangential}");
        }
    }
}

#[test]
fn radial_interpolations_accept_any_number() {
    for compliance in [normal_compliance_at, tangential_compliance_at] {
        assert_eq!(compliance(f64::INFINITY), 0.0);
        assert_eq!(compliance(-1.5), compliance(1.5));
        assert!(compliance(f64::NAN).is_nan());
    }
    assert!((normal_compliance_at(20.0) - half_space(20.0, 0.0).z_axis.z).abs() < 1e-15);
    let both = half_space(20.0, 0.0).x_axis.x + half_space(20.0, 0.0).y_axis.y;
    assert!((tangential_compliance_at(20.0) - 0.5 * both).abs() < 1e-15);
}
