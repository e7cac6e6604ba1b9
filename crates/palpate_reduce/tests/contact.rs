//! Contact in the loop as in the body: at symmetric places, turned, fast from far away, on tissue as an app has it.

use glam::{DQuat, DVec3};
use palpate_body::*;
use palpate_local::{Sample, Scheme};
use palpate_reduce::*;

const NEAR: Scheme = Scheme::NearFieldExact;

fn block(nodes: usize, rotation: DQuat) -> Body {
    let block = Block::new([nodes; 3], DVec3::splat(0.1)).unwrap().fix(Face::NegZ);
    let made = block.tissue(&Tissue::default()).unwrap().placed(rotation, DVec3::ZERO).unwrap();
    Body::new(made.network, made.surface).unwrap()
}

fn ball(radius_m: f64, friction: f64) -> ToolContact {
    ToolContact::touch(ToolShape::Sphere { radius_m }, friction).unwrap()
}

/// Samples of a hand at `at` (s), a tick apart, their velocity the difference.
fn samples(ticks: u64, at: impl Fn(f64) -> DVec3) -> Vec<Sample> {
    let place = |i: u64| at(i as f64 * 1e-3);
    (0..ticks)
        .map(|i| Sample {
            sequence: i,
            position_m: place(i),
            velocity_m_per_s: (place(i) - place(i.saturating_sub(1))) / 1e-3,
            ..Sample::default()
        })
        .collect()
}

fn compare(
    body: &Body,
    contact: &ToolContact,
    samples: &[Sample],
    integrator: LocalIntegrator,
) -> Comparison {
    let builder = BuilderOptions { integrator, ..BuilderOptions::of(body) };
    let options = ComparisonOptions { builder, ..ComparisonOptions::default() };
    Comparison::run(body, contact, samples, &[NEAR], &options).unwrap()
}

#[test]
fn tissue_is_felt_within_a_thousandth_wherever_it_is_pressed() {
    // The middle, where triangles meet, a node, an edge of a cell, near the side, with small and large tools.
    for (nodes, radius, x, y) in [
        (6, 0.005, 0.0, 0.0),
        (6, 0.005, 0.01, 0.01),
        (6, 0.001, 0.01, 0.003),
        (6, 0.005, 0.042, 0.003),
        (6, 0.02, 0.003, -0.002),
        (9, 0.02, 0.0, 0.0),
    ] {
        let body = block(nodes, DQuat::IDENTITY);
        let path = samples(500, |t| {
            let stir = 0.004 * (t - 0.3).max(0.0) * DVec3::new((20.0 * t).sin(), (13.0 * t).cos(), 0.0);
            DVec3::new(x, y, 0.0505 + radius - 0.0045 * (t / 0.2).min(1.0)) + stir
        });
        for integrator in [LocalIntegrator::Explicit, LocalIntegrator::Implicit { substeps: 2 }] {
            let error =
                compare(&body, &ball(radius, 0.3), &path, integrator).relative_rms_error(NEAR, 100).unwrap();
            // The implicit tick has the tangent of the model step.
            let is_implicit = integrator != LocalIntegrator::Explicit;
            let most = if radius > 0.01 || is_implicit { 0.01 } else { 0.002 };
            assert!(error < most, "{error} on {nodes} nodes, {radius} m at ({x}, {y}), {integrator:?}");
        }
    }
}

#[test]
fn a_turned_body_and_hand_are_felt_turned() {
    let forces = |rotation: DQuat| {
        let body = block(6, rotation);
        let path = samples(400, |t| {
            rotation
                * DVec3::new(0.004 + 0.05 * (t - 0.2).max(0.0), 0.003, 0.0555 - 0.0045 * (t / 0.2).min(1.0))
        });
        let comparison = compare(&body, &ball(0.005, 0.3), &path, LocalIntegrator::Explicit);
        let shown = comparison.displayed(NEAR).unwrap();
        shown.iter().map(|f| rotation.inverse() * *f).collect::<Vec<_>>()
    };
    let straight = forces(DQuat::IDENTITY);
    let largest = straight.iter().map(|f| f.length()).fold(0.0, f64::max);
    for rotation in [DQuat::from_rotation_z(0.4), DQuat::from_rotation_x(1.0), DQuat::from_rotation_y(2.0)] {
        let worst = straight.iter().zip(forces(rotation)).map(|(a, b)| (*a - b).length()).fold(0.0, f64::max);
        assert!(worst < 1e-9 * largest, "{rotation}: {worst} N of {largest} N");
    }
}

#[test]
fn a_hand_that_comes_fast_from_far_away_is_felt_in_the_tick_in_which_it_crosses_the_surface() {
    let cube = block(6, DQuat::IDENTITY);
    let slab = {
        let made = Block::new([6, 6, 2], DVec3::new(0.1, 0.1, 0.02)).unwrap().fix(Face::NegZ);
        let made = made.tissue(&Tissue::default()).unwrap();
        Body::new(made.network, made.surface).unwrap()
    };
    for (name, body, top) in [("cube", &cube, 0.05), ("slab", &slab, 0.01)] {
        for (speed, aside) in [(8.3, 0.0), (8.3, 0.02), (15.0, 0.0), (2.0, 0.0)] {
            // At rest 60 mm away, just after a model step; then to 10 mm depth.
            let start = top + 0.005 + 0.06;
            let path = samples(400, |t| {
                let gone = (speed * (t - 0.2014).max(0.0)).min(0.07);
                DVec3::new(0.004 + aside * gone / 0.07, 0.003, start - gone)
            });
            let comparison = compare(body, &ball(0.005, 0.3), &path, LocalIntegrator::Auto);
            let crossing = path.iter().position(|s| s.position_m.z < top + 0.005).unwrap();
            let first = |forces: &[DVec3]| forces.iter().position(|f| f.length() > 0.0);
            let (full, shown) = (first(&comparison.oracle_n), first(comparison.displayed(NEAR).unwrap()));
            assert_eq!(
                (full, shown),
                (Some(crossing), Some(crossing)),
                "{name} at {speed} m/s, aside {aside} m"
            );
            // Until the next model step the surface gives way as a half-space does: felt by and large as by the body.
            let last = crossing + 40;
            let (a, b) = (comparison.oracle_n[last].z, comparison.displayed(NEAR).unwrap()[last].z);
            assert!(b > 0.3 * a && b < 3.0 * a, "{name} at {speed} m/s: {a} N, {b} N in the loop");
        }
    }
}
