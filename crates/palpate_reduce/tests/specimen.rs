//! The seed paper's specimen and the local models that are made for it.

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
fn it_has_the_order_that_counting_gives() {
    // Free nodes: in the inside, and in the top; each but the driven one is a position and a velocity for each axis.
    for (dimension, cells, free) in
        [(1, 4, 4), (1, 12, 12), (2, 2, 2), (2, 12, 11 * 12), (3, 4, 9 * 4), (3, 5, 16 * 5)]
    {
        let system = specimen(dimension, cells).system().unwrap();
        assert_eq!(system.unknowns(), dimension * (free - 1), "{dimension}-D, {cells} cells");
        assert_eq!(system.inputs(), dimension);
    }
}

#[test]
fn neighbourhoods_have_the_nodes_of_their_rings() {
    // Half a square or cube of nodes round the one in the middle of the top.
    for (dimension, rings, nodes) in [(1, 1, 1), (1, 3, 3), (2, 1, 5), (2, 2, 14), (3, 1, 17), (3, 2, 74)] {
        let specimen = specimen(dimension, 8);
        for system in [specimen.neighbourhood(rings).unwrap(), specimen.scaled(rings).unwrap()] {
            assert_eq!(system.unknowns(), dimension * nodes, "{dimension}-D, {rings} rings");
        }
    }
    // Enough rings are the whole body.
    for dimension in 1..=3 {
        let specimen = specimen(dimension, 4);
        let (full, all) = (specimen.system().unwrap(), specimen.neighbourhood(9).unwrap());
        assert_eq!(all.unknowns(), full.unknowns());
        assert_eq!(specimen.scaled(9).unwrap().unknowns(), full.unknowns());
    }
}

#[test]
fn scaled_chains_have_the_static_stiffness_of_all_their_springs() {
    // Springs in a row: the scaled last one stands for all that are left out, and half their masses hang on it.
    for (cells, rings) in [(4, 1), (4, 2), (9, 1), (9, 5)] {
        let scaled = specimen(1, cells).scaled(rings).unwrap();
        let expected = 200.0 / cells as f64;
        assert!((scaled.static_stiffness().unwrap()[(0, 0)] / expected - 1.0).abs() < 1e-12);
        let masses: f64 = scaled.mass.iter().sum();
        assert!((masses - 0.01 * (rings as f64 + 0.5 * (cells - rings - 1) as f64)).abs() < 1e-15);
    }
}

#[test]
fn more_rings_come_closer_and_scaling_mends_the_static_stiffness() {
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
fn a_neighbourhood_is_close_in_the_band_and_off_at_zero() {
    // Section 5: "its DC gain is significantly off", but close to the full model in 10-1000 Hz.
    let specimen = specimen(2, 12);
    let (full, near) = (specimen.system().unwrap(), specimen.neighbourhood(1).unwrap());
    let s: Vec<c64> = [0.0, 10.0, 30.0, 100.0, 300.0, 1000.0].map(|hz| c64::new(0.0, TAU * hz)).to_vec();
    let (full, near) = (full.response(&s).unwrap(), near.response(&s).unwrap());
    let off: Vec<f64> = (0..s.len()).map(|i| (&full[i] - &near[i]).norm_l2() / full[i].norm_l2()).collect();
    assert!(off[0] > 0.5, "{off:?}");
    assert!(off[3..].iter().all(|off| *off < 0.05), "{off:?}");
}

/// The stiffness matrix of a block of unit springs on its corners, from nothing but its springs, and its largest
/// eigenvalue by power iteration.
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
    // Gauss: what is not a corner is eliminated, row by row.
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
fn block_scaling_is_that_of_the_condensed_block() {
    for density in 1..=40 {
        assert!((block_scaling(1, density).unwrap() * density as f64 - 1.0).abs() < 1e-12);
    }
    for (dimension, most) in [(2, 6), (3, 3)] {
        for density in 1..=most {
            let expected = corner_stiffness(dimension, density) / corner_stiffness(dimension, 1);
            let here = block_scaling(dimension, density).unwrap();
            assert!((here / expected - 1.0).abs() < 1e-9, "{dimension}-D, {density}: {here}, {expected}");
        }
    }
}

#[test]
fn what_makes_no_sense_is_refused() {
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
    }
    let refused =
        |result: Result<SecondOrderSystem, ReduceError>| matches!(result, Err(ReduceError::Option { .. }));
    assert!(refused(good.neighbourhood(0)) && refused(good.scaled(0)));
    for (dimension, density) in [(0, 1), (4, 1), (2, 0)] {
        assert!(matches!(block_scaling(dimension, density), Err(ReduceError::Option { .. })));
    }
    let system = good.system().unwrap();
    for shifts in [[0.0], [-1.0], [f64::NAN], [f64::INFINITY]] {
        assert!(matches!(system.krylov_basis(&shifts), Err(ReduceError::Option { .. })));
    }
    for modes in [0, system.unknowns() + 1] {
        assert!(matches!(system.modal_basis(modes), Err(ReduceError::Option { .. })));
    }
    let zeros = |rows, columns| Mat::<f64>::zeros(rows, columns);
    assert!(matches!(system.project(zeros(3, 2).as_ref()), Err(ReduceError::Option { .. })));
    assert!(matches!(system.project(zeros(system.unknowns(), 0).as_ref()), Err(ReduceError::Option { .. })));
    let flat = system.project(zeros(system.unknowns(), 2).as_ref()).unwrap();
    assert!(matches!(flat.state_space(), Err(ReduceError::Mass { .. })));
}
