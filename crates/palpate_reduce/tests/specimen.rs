//! The specimen of the seed paper and its local models.

use faer::{Mat, c64};
use palpate_reduce::*;
use std::f64::consts::TAU;

fn specimen(dimension: usize, cells: usize) -> Specimen {
    let (stiffness_n_per_m, mass_kg) = (200.0, 0.01);
    Specimen { dimension, cells, stiffness_n_per_m, damping_ns_per_m: 1.5 * 2f64.sqrt(), mass_kg }
}

fn relative_error(full: &Mat<f64>, reduced: &Mat<f64>) -> f64 {
    (full - reduced).norm_l2() / full.norm_l2()
}

#[test]
fn order_matches_the_count_of_free_nodes() {
    // Free nodes are inside and in the top; all but the driven one are unknowns, one for each axis.
    for (dimension, cells, free) in
        [(1, 4, 4), (1, 12, 12), (2, 2, 2), (2, 12, 11 * 12), (3, 4, 9 * 4), (3, 5, 16 * 5)]
    {
        let system = specimen(dimension, cells).system().unwrap();
        assert_eq!(system.unknowns(), dimension * (free - 1), "{dimension}-D, {cells} cells");
        assert_eq!(system.inputs(), dimension);
    }
}

#[test]
fn neighbourhoods_contain_the_nodes_of_their_rings() {
    // Half a square or cube of nodes around the middle of the top.
    for (dimension, rings, nodes) in [(1, 1, 1), (1, 3, 3), (2, 1, 5), (2, 2, 14), (3, 1, 17), (3, 2, 74)] {
        let specimen = specimen(dimension, 8);
        for system in [specimen.neighbourhood(rings).unwrap(), specimen.scaled(rings).unwrap()] {
            assert_eq!(system.unknowns(), dimension * nodes, "{dimension}-D, {rings} rings");
        }
    }
    // With enough rings, a neighbourhood is the whole body.
    for dimension in 1..=3 {
        let specimen = specimen(dimension, 4);
        let (full, all) = (specimen.system().unwrap(), specimen.neighbourhood(9).unwrap());
        assert_eq!(all.unknowns(), full.unknowns());
        assert_eq!(specimen.scaled(9).unwrap().unknowns(), full.unknowns());
    }
}

#[test]
fn scaled_chains_have_the_static_stiffness_of_all_their_springs() {
    // Springs in series: the scaled last one represents all omitted ones, with half of their masses.
    for (cells, rings) in [(4, 1), (4, 2), (9, 1), (9, 5)] {
        let scaled = specimen(1, cells).scaled(rings).unwrap();
        let expected = 200.0 / cells as f64;
        assert!((scaled.static_stiffness().unwrap()[(0, 0)] / expected - 1.0).abs() < 1e-12);
        let masses: f64 = scaled.mass.iter().sum();
        assert!((masses - 0.01 * (rings as f64 + 0.5 * (cells - rings - 1) as f64)).abs() < 1e-15);
    }
}

#[test]
fn more_rings_and_scaling_reduce_the_error_of_static_stiffness() {
    for (dimension, cells) in [(2, 12), (3, 8)] {
        let specimen = specimen(dimension, cells);
        let full = specimen.system().unwrap().static_stiffness().unwrap();
        let mut last = f64::INFINITY;
        for rings in 1..=3 {
            let near =
                relative_error(&full, &specimen.neighbourhood(rings).unwrap().static_stiffness().unwrap());
            let scaled = relative_error(&full, &specimen.scaled(rings).unwrap().static_stiffness().unwrap());
            assert!(
                near < last && scaled < 0.5 * near,
                "{dimension}-D, {rings} rings: {near}, scaled {scaled}"
            );
            last = near;
        }
    }
}

#[test]
fn neighbourhood_is_accurate_in_the_band_and_inaccurate_at_zero() {
    // Section 5: "its DC gain is significantly off", but close to the full model in 10-1000 Hz.
    let specimen = specimen(2, 12);
    let (full, near) = (specimen.system().unwrap(), specimen.neighbourhood(1).unwrap());
    let s: Vec<c64> = [0.0, 10.0, 30.0, 100.0, 300.0, 1000.0].map(|hz| c64::new(0.0, TAU * hz)).to_vec();
    let (full, near) = (full.response(&s).unwrap(), near.response(&s).unwrap());
    let error: Vec<f64> = (0..s.len()).map(|i| (&full[i] - &near[i]).norm_l2() / full[i].norm_l2()).collect();
    assert!(error[0] > 0.5, "{error:?}");
    assert!(error[3..].iter().all(|error| *error < 0.05), "{error:?}");
}

/// The largest eigenvalue, by power iteration, of the stiffness matrix of a block of unit springs condensed onto its corners. It uses no
/// code of the crate.
fn corner_stiffness(dimension: usize, density: usize) -> f64 {
    let n = density + 1;
    let count = n.pow(dimension as u32);
    let at = |node: usize, axis: usize| (node / n.pow(axis as u32) % n) as f64;
    let mut k = vec![vec![0.0; dimension * count]; dimension * count];
    for (a, b) in (0..count).flat_map(|a| (0..a).map(move |b| (a, b))) {
        let d: Vec<f64> = (0..dimension).map(|axis| at(a, axis) - at(b, axis)).collect();
        if d.iter().any(|d| d.abs() > 1.0) {
            continue;
        }
        let squared: f64 = d.iter().map(|d| d * d).sum();
        for (i, j) in (0..dimension).flat_map(|i| (0..dimension).map(move |j| (i, j))) {
            for (p, q, sign) in [(a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)] {
                k[dimension * p + i][dimension * q + j] += sign * d[i] * d[j] / squared;
            }
        }
    }
    let is_corner = |node: usize| (0..dimension).all(|axis| [0.0, density as f64].contains(&at(node, axis)));
    // Gaussian elimination of all nodes that are not corners.
    for pivot in (0..dimension * count).filter(|dof| !is_corner(dof / dimension)) {
        let row = k[pivot].clone();
        for (_, other) in k.iter_mut().enumerate().filter(|(i, _)| *i != pivot) {
            let factor = other[pivot] / row[pivot];
            other.iter_mut().zip(&row).for_each(|(x, r)| *x -= factor * r);
        }
    }
    let kept: Vec<usize> = (0..dimension * count).filter(|dof| is_corner(dof / dimension)).collect();
    let mut x: Vec<f64> = (0..kept.len()).map(|i| (1.0 + i as f64).sin()).collect();
    let mut norm = 0.0;
    for _ in 0..5000 {
        let y: Vec<f64> =
            kept.iter().map(|&i| kept.iter().zip(&x).map(|(&j, x)| k[i][j] * x).sum()).collect();
        norm = y.iter().map(|y| y * y).sum::<f64>().sqrt();
        x = y.iter().map(|y| y / norm).collect();
    }
    norm
}

#[test]
fn block_scaling_equals_that_of_the_condensed_block() {
    for density in 1..=40 {
        assert!((block_scaling(1, density).unwrap() * density as f64 - 1.0).abs() < 1e-12);
    }
    for (dimension, max_density) in [(2, 6), (3, 3)] {
        for density in 1..=max_density {
            let expected = corner_stiffness(dimension, density) / corner_stiffness(dimension, 1);
            let here = block_scaling(dimension, density).unwrap();
            assert!((here / expected - 1.0).abs() < 1e-9, "{dimension}-D, {density}: {here}, {expected}");
        }
    }
}

/// The poles of a symmetric specimen of three dimensions occur in equal pairs.
#[test]
fn norms_of_symmetric_specimens_agree_with_a_grid_and_stay_below_their_bounds() {
    for (dimension, cells, ratio) in [(2, 6, 0.3), (3, 2, 0.5), (3, 4, 0.5), (3, 4, 1.0), (3, 4, 2.0)] {
        let (k, m) = (120.0_f64, 0.02);
        let damping_ns_per_m = ratio * (k * m).sqrt();
        let specimen = Specimen { dimension, cells, stiffness_n_per_m: k, damping_ns_per_m, mass_kg: m };
        let system = specimen.system().unwrap();
        let full = system.state_space().unwrap();
        let balancing = Balancing::new(full.clone()).unwrap();
        let krylov = system.krylov_basis(&[30.0, 120.0]).unwrap();
        let krylov = system.project(krylov.as_ref()).unwrap().state_space().unwrap();
        let balanced = balancing.truncate(balancing.rank().min(8)).unwrap();
        for (reduced, bound) in [(&krylov, f64::INFINITY), (&balanced.system, balanced.error_bound)] {
            let error = full.minus(reduced).unwrap();
            let norm = HInf::new(&error, 1e-6).unwrap().norm;
            let omega = |i: i32| 10f64.powf(f64::from(i) / 60.0 - 1.0);
            let omegas: Vec<c64> = (0..300).map(|i| c64::new(0.0, omega(i))).collect();
            let gain = |g: &Mat<c64>| {
                let with_d = Mat::from_fn(g.nrows(), g.ncols(), |i, j| g[(i, j)] + error.d[(i, j)]);
                with_d.singular_values().unwrap()[0]
            };
            let grid =
                error.proper_response(&omegas).iter().map(gain).fold(error.d.norm_l2() * 1e-9, f64::max);
            let label = format!("{dimension}-D, {cells} cells, ratio {ratio}: norm {norm}, grid {grid}");
            // The error of an exact model is rounding.
            let rounding = 1e-9 * full.d.norm_l2();
            let low = grid * (1.0 - 1e-6) - rounding;
            assert!(norm >= low && norm <= bound * (1.0 + 1e-6) + 1e-9, "{label}, bound {bound}");
            // The norm may be reached at infinity.
            let at_infinity = error.d.norm_l2();
            assert!(
                norm <= (grid * 1.01).max(at_infinity * (1.0 + 1e-9)) + rounding,
                "{label}, at infinity {at_infinity}"
            );
        }
    }
}

#[test]
fn modes_and_poles_match_closed_forms_for_any_damping() {
    // A chain with both ends fixed and equal springs: w_n = 2 sqrt(k/m) sin(n pi/(2 (N + 1))), N masses.
    let chain = specimen(1, 9);
    let system = chain.system().unwrap();
    let reduced = system.project(system.modal_basis(3).unwrap().as_ref()).unwrap();
    for n in 1..=3 {
        let omega = 2.0 * (200.0_f64 / 0.01).sqrt() * (n as f64 * std::f64::consts::PI / 18.0).sin();
        assert!((system.natural_frequencies_rad_per_s().unwrap()[n - 1] / omega - 1.0).abs() < 1e-12);
        assert!((reduced.stiffness[(n - 1, n - 1)] / (omega * omega) - 1.0).abs() < 1e-10);
        assert!((reduced.mass[(n - 1, n - 1)] - 1.0).abs() < 1e-12);
    }
    // Up to an overdamped chain whose fast poles are a billion times the slow ones.
    for damping in [0.1, 30.0, 1e4, 1e6] {
        let system = Specimen { damping_ns_per_m: damping, ..chain }.system().unwrap().to_dense();
        let poles = system.poles().unwrap();
        for n in 1..=8 {
            // Each mode: m s^2 + c (b s + k) with c = 4 sin^2(...).
            let c = 4.0 * (f64::from(n) * std::f64::consts::PI / 18.0).sin().powi(2);
            let (half, k) = (c64::new(0.5 * c * damping / 0.01, 0.0), c * 200.0 / 0.01);
            let fast = -half - (half * half - k).sqrt();
            for expected in [fast, k / fast] {
                let error = poles.iter().map(|p| (p - expected).norm()).fold(f64::INFINITY, f64::min)
                    / expected.norm();
                assert!(error < 1e-9, "mode {n}, damping {damping}: relative error {error}");
            }
        }
    }
}

#[test]
fn scaled_specimen_has_the_springs_and_masses_of_its_rules() {
    // 6 cells, 1 ring: columns 2 to 4 and rows 5 and 6 move; 2 cells to either side, 5 to the bottom.
    let specimen = specimen(2, 6);
    let (scaled, lattice) = (specimen.scaled(1).unwrap(), specimen.lattice().unwrap());
    let row = |ijk, axis| {
        let node = lattice.node(ijk);
        scaled.place.iter().position(|&at| at == (node, axis)).unwrap()
    };
    let [side, below] = [2, 5].map(|n| block_scaling(2, n).unwrap());
    // (2, 6) in the top has two outer springs to the side, one lateral in the top and one diagonal. To the right and below it are the
    // springs of the specimen: lateral, diagonal, vertical.
    let (x, y) = (row([2, 6, 0], 0), row([2, 6, 0], 1));
    let k = |i, j| scaled.stiffness.as_ref().get(i, j).copied().unwrap_or(0.0);
    assert!((k(x, x) - 200.0 * (side.sqrt() + 0.5 * side + 1.0 + 0.5)).abs() < 1e-10);
    assert!((k(y, y) - 200.0 * (0.5 * side + 0.5 + 1.0)).abs() < 1e-10);
    assert!((scaled.mass[x] - 0.01 * 0.5 * (1.0 + 2.0)).abs() < 1e-15);
    // (3, 5) under the tool has three outer springs down to an end 5 cells away; the nearer end of the diagonals is the side, 3 cells away.
    let y = row([3, 5, 0], 1);
    let diagonal = block_scaling(2, 3).unwrap();
    assert!((k(y, y) - 200.0 * (below + diagonal + 1.0 + 0.5 + 0.5)).abs() < 1e-10);
    assert!((scaled.mass[y] - 0.01 * 0.5 * (1.0 + (5.0 + 3.0 + 3.0) / 3.0)).abs() < 1e-15);
}

#[test]
fn rejects_invalid_specimens_rings_shifts_modes_and_bases() {
    let good = specimen(2, 4);
    for bad in [
        Specimen { dimension: 0, ..good },
        Specimen { dimension: 4, ..good },
        Specimen { cells: 1, ..good },
        Specimen { cells: usize::MAX, ..good },
        Specimen { stiffness_n_per_m: -1.0, ..good },
        Specimen { damping_ns_per_m: f64::NAN, ..good },
        Specimen { mass_kg: 0.0, ..good },
    ] {
        assert!(bad.system().is_err(), "{bad:?}");
        // The driven node does not depend on the material.
        assert!(bad.driven().is_ok() == bad.lattice().is_ok(), "{bad:?}");
    }
    let is_rejected =
        |result: Result<SecondOrderSystem, ReduceError>| matches!(result, Err(ReduceError::Option { .. }));
    assert!(is_rejected(good.neighbourhood(0)) && is_rejected(good.scaled(0)));
    for (dimension, density) in [(0, 1), (4, 1), (2, 0)] {
        assert!(matches!(block_scaling(dimension, density), Err(ReduceError::Option { .. })));
    }
    let system = good.system().unwrap();
    for shifts in [[0.0], [-1.0], [f64::NAN], [f64::INFINITY]] {
        assert!(matches!(system.krylov_basis(&shifts), Err(ReduceError::Option { .. })));
    }
    // The square of the shift overflows.
    assert!(system.krylov_basis(&[1e200]).is_err());
    for modes in [0, system.unknowns() + 1] {
        assert!(matches!(system.modal_basis(modes), Err(ReduceError::Option { .. })));
    }
    let zeros = |rows, columns| Mat::<f64>::zeros(rows, columns);
    assert!(matches!(system.project(zeros(3, 2).as_ref()), Err(ReduceError::Option { .. })));
    assert!(matches!(system.project(zeros(system.unknowns(), 0).as_ref()), Err(ReduceError::Option { .. })));
    let flat = system.project(zeros(system.unknowns(), 2).as_ref()).unwrap();
    assert!(matches!(flat.state_space(), Err(ReduceError::Mass { .. })));
}
