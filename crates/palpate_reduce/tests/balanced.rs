//! Balanced truncation of the specimen of the seed paper's section 4, against reference values from scipy and SLICOT.

use faer::{Mat, c64};
use palpate_body::{Body, Lattice, Surface};
use palpate_reduce::*;
use serde_json::Value;
use std::f64::consts::TAU;
use std::sync::OnceLock;

fn reference() -> Value {
    serde_json::from_str(include_str!("../../../tests/data/lattice_2d_12.json")).unwrap()
}

/// 12 × 12 cells, left, right and bottom edges fixed, driven at the top middle node; x is tangential, y normal.
fn specimen() -> SecondOrderSystem {
    let (damping_ns_per_m, mass_kg) = (2.1213203435596424, 0.01);
    let lattice = Lattice::new([13, 13, 1], 0.1 / 12.0).unwrap();
    let is_fixed = |[i, j, _]: [usize; 3]| i == 0 || i == 12 || j == 0;
    let network = lattice.uniform(200.0, damping_ns_per_m, mass_kg, is_fixed).unwrap();
    assert_eq!((network.node_count(), network.links().len(), network.free().len()), (169, 600, 132));
    let body = Body::new(network, Surface::default()).unwrap();
    SecondOrderSystem::of_body(&body, &[lattice.node([6, 12, 0])], 2).unwrap()
}

fn balancing() -> &'static Balancing {
    static BALANCING: OnceLock<Balancing> = OnceLock::new();
    BALANCING.get_or_init(|| Balancing::new(specimen().state_space().unwrap()).unwrap())
}

fn close(here: f64, expected: &Value, tolerance: f64) {
    let expected = expected.as_f64().unwrap();
    assert!((here / expected - 1.0).abs() < tolerance, "{here}, reference {expected}");
}

fn rad_per_s(hz: f64) -> c64 {
    c64::new(0.0, TAU * hz)
}

#[test]
fn order_and_hankel_singular_values_match_the_reference() {
    assert_eq!(balancing().system().order(), 524);
    for (i, expected) in reference()["hankel_singular_values"].as_array().unwrap().iter().take(20).enumerate()
    {
        close(balancing().hankel_singular_values()[i], expected, 1e-9);
    }
    let gramians = balancing().gramians();
    assert!(gramians.controllability_residual < 1e-12 && gramians.observability_residual < 1e-12);
}

#[test]
fn static_stiffness_and_asymptotes_match_the_reference() {
    let (system, expected) = (balancing().system(), reference());
    let dc = system.dc_gain().unwrap();
    for axis in 0..2 {
        close(dc[(axis, axis)], &expected["static_stiffness_n_per_m"][axis], 1e-9);
        close(system.d[(axis, axis)], &expected["feedthrough_n_per_m"][axis], 1e-9);
        close(system.e[(axis, axis)], &expected["derivative_ns_per_m"][axis], 1e-9);
    }
}

#[test]
fn response_by_three_methods_matches_the_reference() {
    let expected = reference();
    let hz: Vec<f64> =
        expected["frequency_hz"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    let s: Vec<c64> = hz.iter().map(|&f| rad_per_s(f)).collect();
    let system = balancing().system();
    let sparse = specimen().response(&s).unwrap();
    let dense = system.response(&s);
    let fast = PoleResidue::new(system).unwrap();
    for (i, &s) in s.iter().enumerate() {
        let improper = Mat::from_fn(2, 2, |r, c| c64::new(system.d[(r, c)], 0.0) + s * system.e[(r, c)]);
        for response in [&sparse[i], &dense[i], &(fast.at(s) + improper)] {
            close(response[(1, 1)].norm(), &expected["normal_response_abs_n_per_m"][i], 1e-9);
            close(response[(1, 1)].arg(), &expected["normal_response_phase_rad"][i], 1e-9);
            close(response[(0, 0)].norm(), &expected["tangential_response_abs_n_per_m"][i], 1e-9);
            close(response[(0, 0)].arg(), &expected["tangential_response_phase_rad"][i], 1e-9);
            let cross = response[(0, 1)].norm().max(response[(1, 0)].norm()) / response[(1, 1)].norm();
            assert!(20.0 * cross.log10() < -200.0, "{cross}");
        }
    }
}

#[test]
fn truncation_errors_match_the_reference_and_stay_below_their_bound() {
    let expected = reference();
    let full = balancing().system();
    // The peak is at infinity; the peak of the reference is the maximum over a finite grid.
    let peak = HInf::new(full, 1e-6).unwrap();
    assert_eq!(peak.omega, f64::INFINITY);
    close(peak.norm, &expected["proper_norm_peak_n_per_m"], 1e-3);
    for order in [4, 6, 8, 10, 12, 16, 20] {
        let truncated = balancing().truncate(order).unwrap();
        let expected = &expected["balanced"][order.to_string()];
        close(truncated.error_bound, &expected["twice_hankel_tail"], 1e-6);
        let error = HInf::new(&full.minus(&truncated.system).unwrap(), 1e-4).unwrap();
        close(error.norm, &expected["hinf_error_n_per_m"], 0.01);
        assert!(error.norm <= truncated.error_bound);
        assert!(truncated.system.poles().unwrap().iter().all(|pole| pole.re < 0.0));
        if order == 10 {
            assert!(error.norm / peak.norm < 0.01, "{}", error.norm / peak.norm);
        }
    }
}

#[test]
fn truncation_to_bound_has_minimum_order() {
    for bound in [100.0, 9.0, 1.0, 1e-3] {
        let truncated = balancing().truncate_to_bound(bound).unwrap();
        let order = truncated.system.order();
        assert!(truncated.error_bound <= bound);
        assert!(order == 1 || balancing().truncate(order - 1).unwrap().error_bound > bound);
    }
    for bad in [0.0, -1.0, f64::NAN] {
        assert!(balancing().truncate_to_bound(bad).is_err());
    }
    assert!(balancing().truncate(0).is_err() && balancing().truncate(525).is_err());
}

#[test]
fn reduced_states_are_concentrated_near_the_tool() {
    // Fig. 6: the magnitude of the first state decreases with the distance from the driven node.
    let (system, states) = (specimen(), balancing().truncate(2).unwrap().states);
    let lattice = Lattice::new([13, 13, 1], 100.0 / 12.0).unwrap();
    let tool = lattice.position_m([6, 12, 0]);
    let weight = |near: bool| -> f64 {
        system
            .place
            .iter()
            .enumerate()
            .filter(|(_, (node, _))| {
                let at = lattice.position_m([node % 13, node / 13, 0]);
                (at.distance(tool) < 30.0) == near
            })
            .map(|(row, _)| states[(row, 0)].powi(2))
            .sum()
    };
    assert!(weight(true) > 3.0 * weight(false), "{} near, {} far", weight(true), weight(false));
}
