//! Contact in the loop against the oracle: at symmetric places, with a rotated body, and with a fast tool from far away.

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

/// Samples of the path `at` (argument in s), one a tick, with velocities by differences.
fn samples(ticks: u64, at: impl Fn(f64) -> DVec3) -> Vec<Sample> {
    let position = |i: u64| at(i as f64 * 1e-3);
    (0..ticks)
        .map(|i| Sample {
            sequence: i,
            position_m: position(i),
            velocity_m_per_s: (position(i) - position(i.saturating_sub(1))) / 1e-3,
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
fn pressed_tissue_matches_the_oracle_at_any_place() {
    // At the middle of a cell, a node, an edge of a cell, and near the side, with small and large tools.
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
            // The implicit tick uses the tangent of the model step.
            let is_implicit = integrator != LocalIntegrator::Explicit;
            let max_error = if radius > 0.01 || is_implicit { 0.01 } else { 0.002 };
            assert!(error < max_error, "{error} on {nodes} nodes, {radius} m at ({x}, {y}), {integrator:?}");
        }
    }
}

#[test]
fn rotated_body_and_path_give_rotated_force() {
    let forces = |rotation: DQuat| {
        let body = block(6, rotation);
        let path = samples(400, |t| {
            rotation
                * DVec3::new(0.004 + 0.05 * (t - 0.2).max(0.0), 0.003, 0.0555 - 0.0045 * (t / 0.2).min(1.0))
        });
        let comparison = compare(&body, &ball(0.005, 0.3), &path, LocalIntegrator::Explicit);
        let displayed = comparison.displayed(NEAR).unwrap();
        displayed.iter().map(|f| rotation.inverse() * *f).collect::<Vec<_>>()
    };
    let upright = forces(DQuat::IDENTITY);
    let largest = upright.iter().map(|f| f.length()).fold(0.0, f64::max);
    for rotation in [DQuat::from_rotation_z(0.4), DQuat::from_rotation_x(1.0), DQuat::from_rotation_y(2.0)] {
        let worst = upright.iter().zip(forces(rotation)).map(|(a, b)| (*a - b).length()).fold(0.0, f64::max);
        assert!(worst < 1e-9 * largest, "{rotation}: {worst} N of {largest} N");
    }
}

#[test]
fn fast_tool_from_far_away_is_displayed_in_the_tick_of_first_contact() {
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
                let travelled = (speed * (t - 0.2014).max(0.0)).min(0.07);
                DVec3::new(0.004 + aside * travelled / 0.07, 0.003, start - travelled)
            });
            let comparison = compare(body, &ball(0.005, 0.3), &path, LocalIntegrator::Auto);
            let crossing = path.iter().position(|s| s.position_m.z < top + 0.005).unwrap();
            let first = |forces: &[DVec3]| forces.iter().position(|f| f.length() > 0.0);
            let (full, local) = (first(&comparison.oracle_n), first(comparison.displayed(NEAR).unwrap()));
            assert_eq!(
                (full, local),
                (Some(crossing), Some(crossing)),
                "{name} at {speed} m/s, aside {aside} m"
            );
            // Until the next model step the surface yields like a half-space, which matches the body roughly.
            let last = crossing + 40;
            let (a, b) = (comparison.oracle_n[last].z, comparison.displayed(NEAR).unwrap()[last].z);
            assert!(b > 0.3 * a && b < 3.0 * a, "{name} at {speed} m/s: {a} N, {b} N in the loop");
        }
    }
}

#[test]
fn contact_above_an_edge_matches_the_oracle() {
    // The ball's middle lies above the edge of two faces, so that rounding decides which of them is nearer.
    let body = block(6, DQuat::IDENTITY);
    for offset in [-1e-12, 0.0, 1e-12] {
        for (edge, aside) in [(DVec3::new(1.0, 0.26, 1.0), DVec3::X), (DVec3::ONE, DVec3::new(1.0, 1.0, 0.0))]
        {
            for out in [DVec3::Z, (DVec3::Z + 0.1 * aside).normalize()] {
                let path = samples(400, |t| {
                    let slide = 0.01 * (t - 0.2).max(0.0) * DVec3::NEG_Y;
                    let depth = 0.004 * (t / 0.2).min(1.0) - 5e-4;
                    0.05 * edge + offset * DVec3::X + (0.005 - depth) * out + slide
                });
                let comparison = compare(&body, &ball(0.005, 0.3), &path, LocalIntegrator::Explicit);
                let error = comparison.relative_rms_error(NEAR, 100).unwrap();
                assert!(error < 0.002, "{error} with {offset} at {edge} along {out}");
            }
        }
    }
}
