//! Contact in the loop against the oracle: near fixed nodes, at edges, with fast and small tools, and behind a virtual coupling.

use glam::DVec3;
use palpate_body::*;
use palpate_local::{Sample, Scheme};
use palpate_reduce::*;
use palpate_tests_without_bevy::{peak, samples};

const NEAR: Scheme = Scheme::NearFieldExact;
const EXPLICIT: LocalIntegrator = LocalIntegrator::Explicit;
const IMPLICIT: LocalIntegrator = LocalIntegrator::Implicit { substeps: 2 };

fn block(nodes: [usize; 3], size: DVec3, fixed: Face, mass_kg: f64) -> Body {
    let lattice = UniformLattice { stiffness_n_per_m: 100.0, damping_ratio: 0.7, mass_kg };
    let made = Block::new(nodes, size).unwrap().fix(fixed).uniform(&lattice).unwrap();
    Body::new(made.network, made.surface).unwrap()
}

/// A cube of default tissue.
fn tissue_cube() -> Body {
    let block = Block::new([6; 3], DVec3::splat(0.1)).unwrap().fix(Face::NegZ);
    let made = block.tissue(&Tissue::default()).unwrap();
    Body::new(made.network, made.surface).unwrap()
}

fn cube(fixed: Face) -> Body {
    block([6; 3], DVec3::splat(0.1), fixed, 1.0)
}

fn ball(radius_m: f64) -> ToolContact {
    ToolContact::touch(ToolShape::Sphere { radius_m }, 0.3).unwrap()
}

fn compare(
    body: &Body,
    contact: &ToolContact,
    samples: &[Sample],
    integrator: LocalIntegrator,
) -> (f64, Comparison) {
    let builder = BuilderOptions { integrator, ..BuilderOptions::default() };
    let options = ComparisonOptions { builder, ..ComparisonOptions::default() };
    let comparison = Comparison::run(body, contact, samples, &[NEAR], &options).unwrap();
    (comparison.relative_rms_error(NEAR, 100).unwrap(), comparison)
}

#[test]
fn contact_near_fixed_nodes_matches_the_oracle() {
    let body = cube(Face::NegX);
    for integrator in [EXPLICIT, IMPLICIT] {
        // The side at x = -0.05 is fixed; S has nodes of it.
        for x in [-0.043, -0.04, -0.035, -0.025, 0.0] {
            let path = samples(500, |t| DVec3::new(x, 0.004, 0.0555 - 0.0045 * (t / 0.2).min(1.0)));
            let (error, _) = compare(&body, &ball(0.005), &path, integrator);
            assert!(error < 1e-3, "{error} at {x}, {integrator:?}");
        }
        // A grip of three nodes, one of them fixed.
        let node_at = |x: DVec3| body.positions_m().iter().position(|at| at.distance(x) < 1e-9).unwrap();
        let nodes = [(-0.05, 0.4), (-0.03, 0.3), (-0.01, 0.3)]
            .map(|(x, w)| (node_at(DVec3::new(x, 0.01, 0.05)), w))
            .to_vec();
        let start = DVec3::new(-0.03, 0.01, 0.05);
        let contact = ToolContact::hold_point(&body, BodyPoint::new(nodes).unwrap(), start).unwrap();
        let press = |t: f64| start - DVec3::Z * 0.004 * (t / 0.1).min(1.0) * (1.0 + 0.3 * (30.0 * t).sin());
        let (error, _) = compare(&body, &contact, &samples(500, press), integrator);
        assert!(error < 1e-3, "{error} for a grip, {integrator:?}");
    }
}

#[test]
fn contact_near_fixed_nodes_does_not_flicker() {
    let body = cube(Face::NegX);
    for x in [-0.044, -0.0435, -0.043, -0.042] {
        let path = samples(500, |t| DVec3::new(x, 0.004, 0.0555 - 0.0045 * (t / 0.2).min(1.0)));
        let (_, comparison) = compare(&body, &ball(0.005), &path, EXPLICIT);
        let has_force =
            |forces: &[DVec3]| -> Vec<bool> { forces.iter().map(|f| *f != DVec3::ZERO).collect() };
        for forces in [&comparison.oracle_n[..], &comparison.displayed(NEAR).unwrap()[100..]] {
            let changes = has_force(forces).windows(2).filter(|pair| pair[0] != pair[1]).count();
            assert!(changes <= 2, "{changes} changes at {x}");
        }
    }
}

/// Number of ticks in which only one of the two is in contact, and the relative RMS error over all other ticks.
fn error_in_common_contact(displayed_n: &[DVec3], oracle_n: &[DVec3]) -> (usize, f64) {
    let pairs = || displayed_n.iter().zip(oracle_n);
    let is_contact = |f: &DVec3| *f != DVec3::ZERO;
    let differs = pairs().filter(|(a, b)| is_contact(a) != is_contact(b)).count();
    let both = pairs().filter(|(a, b)| is_contact(a) == is_contact(b));
    let (error, reference) = both.fold((0.0, 0.0), |(error, reference), (a, b)| {
        (error + (*a - *b).length_squared(), reference + b.length_squared())
    });
    (differs, (error / reference).sqrt())
}

#[test]
fn fast_tool_is_displayed_at_first_contact_at_any_place() {
    let (cube, tissue) = (cube(Face::NegZ), tissue_cube());
    // One centimetre thick, clamped at a side.
    let plate = block([11, 11, 2], DVec3::new(0.1, 0.1, 0.01), Face::NegX, 0.3);
    for (name, body, top, max_error) in
        [("cube", &cube, 0.05, 0.02), ("tissue", &tissue, 0.05, 0.005), ("plate", &plate, 0.005, 0.15)]
    {
        for speed in [0.2, 0.5, 1.0] {
            for x in [0.0, 0.03, 0.04, 0.045] {
                // Between two model steps.
                let down =
                    move |t: f64| (0.005 + speed * (0.12 - t)).max(if top > 0.01 { -0.005 } else { -0.002 });
                let path = samples(400, |t| DVec3::new(x, 0.003, top + down(t)));
                let (_, comparison) = compare(body, &ball(0.005), &path, EXPLICIT);
                let shown = comparison.displayed(NEAR).unwrap();
                let first = |forces: &[DVec3]| forces.iter().position(|f| f.z > 0.02).unwrap();
                let case = format!("{name} at {speed} m/s, x = {x}");
                assert!(first(shown).abs_diff(first(&comparison.oracle_n)) <= 1, "{case}");
                assert!((peak(shown) / peak(&comparison.oracle_n) - 1.0).abs() < 0.1, "{case}");
                // A surface that bounces off the tool may separate a tick earlier or later, at full force.
                let (differs, error) = error_in_common_contact(shown, &comparison.oracle_n);
                assert!(
                    error < max_error && differs <= if name == "plate" { 8 } else { 2 },
                    "{error}, {differs} ticks, {case}"
                );
            }
        }
    }
}

#[test]
fn small_tools_do_not_pass_through_the_surface() {
    let body = cube(Face::NegZ);
    for radius in [0.0002, 0.0005, 0.001, 0.002] {
        for speed in [0.5, 1.0] {
            let down = |t: f64| (0.05 + radius + speed * (0.1203 - t)).max(0.044);
            let path = samples(300, |t| DVec3::new(0.004, 0.003, down(t)));
            for (integrator, max_error) in
                [(EXPLICIT, 0.012), (IMPLICIT, 0.1), (LocalIntegrator::Implicit { substeps: 1 }, 0.1)]
            {
                let (error, _) = compare(&body, &ball(radius), &path, integrator);
                assert!(error < max_error, "{error} at {radius} m, {speed} m/s, {integrator:?}");
            }
        }
    }
}

#[test]
fn virtual_coupling_yields_in_the_loop_as_in_the_body() {
    let body = cube(Face::NegZ);
    for (integrator, max_error) in [(EXPLICIT, 0.03), (IMPLICIT, 0.06)] {
        for max_force_n in [1.0, 4.0] {
            let coupling = VirtualCoupling { stiffness_n_per_m: 20e3, max_force_n };
            // Through the whole block and back, with lateral motion.
            let path = samples(1200, |t| {
                let depth = (0.3 * (t - 0.12)).clamp(-0.01, 0.12) - 0.4 * (t - 0.8).clamp(0.0, 0.35);
                DVec3::new(0.004 + 0.01 * (9.0 * t).sin(), 0.003, 0.055 - depth)
            });
            let (error, comparison) =
                compare(&body, &ball(0.005).with_coupling(coupling).unwrap(), &path, integrator);
            let shown = comparison.displayed(NEAR).unwrap();
            assert!(peak(shown) <= max_force_n * (1.0 + 1e-9) && peak(shown) > 0.99 * max_force_n);
            assert!(error < max_error, "{error}, {max_force_n} N, {integrator:?}");
        }
    }
    // A held node that is pulled beyond the limit of the coupling.
    let start = DVec3::new(0.01, 0.01, 0.05);
    let node = body.positions_m().iter().position(|x| x.distance(start) < 1e-9).unwrap();
    let coupling = VirtualCoupling { stiffness_n_per_m: 20e3, max_force_n: 1.5 };
    let contact = ToolContact::hold(&body, node, start).unwrap().with_coupling(coupling).unwrap();
    let pull = |t: f64| start + DVec3::new(0.6, 0.0, 0.8) * 0.05 * (1.0 - (6.0 * t).cos());
    for integrator in [EXPLICIT, IMPLICIT] {
        let (error, comparison) = compare(&body, &contact, &samples(1000, pull), integrator);
        assert!(peak(comparison.displayed(NEAR).unwrap()) <= 1.5 * (1.0 + 1e-9));
        assert!(error < 0.03, "{error}, {integrator:?}");
    }
}
