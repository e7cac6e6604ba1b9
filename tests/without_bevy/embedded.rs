//! Contact on a surface that is embedded in cells, in the loop against the oracle.

use glam::DVec3;
use palpate_body::*;
use palpate_local::{Sample, Scheme};
use palpate_reduce::*;
use palpate_tests_without_bevy::{peak, samples};

const NEAR: Scheme = Scheme::NearFieldExact;
const EXPLICIT: LocalIntegrator = LocalIntegrator::Explicit;
const IMPLICIT: LocalIntegrator = LocalIntegrator::Implicit { substeps: 2 };
/// Side of a cell, m.
const CELL: f64 = 0.02;
const RADIUS: f64 = 0.005;

/// Height of the surface over (x, y), m: a hill within the uppermost cells, whose nodes are at 0.05 m.
fn height(x: f64, y: f64) -> f64 {
    0.046 - 12.0 * (x * x + y * y)
}

/// The point (x, y, z) in a lattice of 6 × 6 × 6 nodes around the origin: the nodes of its cell with their weights.
fn embedded(at: DVec3) -> BodyPoint {
    let grid = (at + 0.05) / CELL;
    let cell = grid.floor().min(DVec3::splat(4.0));
    let part = grid - cell;
    let corner = |i: usize| DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64);
    let node = |n: DVec3| n.x as usize + 6 * (n.y as usize + 6 * n.z as usize);
    let weight = |c: DVec3| (c * part + (1.0 - c) * (1.0 - part)).element_product();
    let carriers = (0..8).map(corner).map(|c| (node(cell + c), weight(c))).filter(|(_, w)| *w != 0.0);
    BodyPoint::new(carriers.collect()).unwrap()
}

/// The block of the fidelity reference with a hill as its surface, whose points are `spacing` apart, m.
fn hill(spacing: f64) -> Body {
    let lattice = UniformLattice { stiffness_n_per_m: 100.0, damping_ratio: 0.7, mass_kg: 1.0 };
    let made = Block::new([6; 3], DVec3::splat(0.1)).unwrap().fix(Face::NegZ).uniform(&lattice).unwrap();
    let count = (0.08 / spacing).round() as usize + 1;
    let along = |i: usize| -0.04 + 0.08 * i as f64 / (count - 1) as f64;
    let mut surface = Surface::default();
    for (i, j) in (0..count).flat_map(|j| (0..count).map(move |i| (i, j))) {
        let (x, y) = (along(i), along(j));
        surface.points.push(embedded(DVec3::new(x, y, height(x, y))));
        if i + 1 < count && j + 1 < count {
            let [a, b, c, d] =
                [i + count * j, i + 1 + count * j, i + 1 + count * (j + 1), i + count * (j + 1)];
            surface.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    surface.vertices = (0..surface.points.len()).collect();
    Body::new(made.network, surface).unwrap()
}

fn compare(body: &Body, path: &[Sample], integrator: LocalIntegrator) -> (f64, Comparison) {
    let builder = BuilderOptions { integrator, ..BuilderOptions::of(body) };
    let options = ComparisonOptions { builder, ..ComparisonOptions::default() };
    let contact = ToolContact::touch(ToolShape::Sphere { radius_m: RADIUS }, 0.3).unwrap();
    let comparison = Comparison::run(body, &contact, path, &[NEAR], &options).unwrap();
    (comparison.relative_rms_error(NEAR, 100).unwrap(), comparison)
}

/// A press 4 mm deep at (x, y), with lateral motion.
fn press(x: f64, y: f64) -> Vec<Sample> {
    let top = height(x, y) + RADIUS;
    samples(800, |t| {
        let stir = 0.004 * (t - 0.3).max(0.0) * DVec3::new((20.0 * t).sin(), (13.0 * t).cos(), 0.0);
        let depth = 0.004 * (t / 0.2).min(1.0) * (1.0 + 0.3 * (30.0 * t).sin());
        DVec3::new(x, y, top + 0.0005 - depth) + stir
    })
}

#[test]
fn embedded_surface_matches_the_oracle_within_a_tenth_of_a_per_cent() {
    for spacing in [0.007, 0.004] {
        let body = hill(spacing);
        for (x, y) in [(0.001, 0.002), (0.011, -0.008), (0.02, 0.01)] {
            for integrator in [EXPLICIT, IMPLICIT] {
                let (error, comparison) = compare(&body, &press(x, y), integrator);
                let (local, full) = (peak(comparison.displayed(NEAR).unwrap()), peak(&comparison.oracle_n));
                let case = format!("{spacing} m at ({x}, {y}), {integrator:?}");
                assert!(full > 2.0 && (local / full - 1.0).abs() < 1e-3, "{local} N, {full} N, {case}");
                assert!(error < 1e-3, "{error}, {case}");
            }
        }
    }
}

#[test]
fn sliding_across_cells_and_taps_between_model_steps_match_the_oracle() {
    let body = hill(0.005);
    // 60 mm in half a second, over three cells.
    let slide = samples(700, |t| {
        let x = -0.03 + 0.12 * (t - 0.15).clamp(0.0, 0.5);
        DVec3::new(x, 0.004, height(x, 0.004) + RADIUS + 0.0005 - 0.003 * (t / 0.1).min(1.0))
    });
    let (error, _) = compare(&body, &slide, EXPLICIT);
    assert!(error < 5e-3, "{error}");
    for speed in [0.1, 0.3] {
        let down = |t: f64| (RADIUS + speed * (0.1723 - t)).max(RADIUS - 0.004);
        let tap = samples(400, |t| DVec3::new(0.008, 0.003, height(0.008, 0.003) + down(t)));
        let (error, comparison) = compare(&body, &tap, EXPLICIT);
        let first = |forces: &[DVec3]| forces.iter().position(|f| f.z > 0.02).unwrap();
        let shown = comparison.displayed(NEAR).unwrap();
        assert!(first(shown).abs_diff(first(&comparison.oracle_n)) <= 1, "{speed} m/s");
        assert!(error < 0.02, "{error} at {speed} m/s");
    }
}

/// On a surface at rest, the displayed force balances the contact impulses over the length of a step.
#[test]
fn displayed_force_at_rest_equals_impulse_over_step() {
    let mut body = hill(0.007);
    let mut contact = ToolContact::touch(ToolShape::Sphere { radius_m: RADIUS }, 0.0).unwrap();
    let at = DVec3::new(0.011, -0.008, height(0.011, -0.008) + RADIUS - 0.003);
    let above = at + DVec3::Z * 0.004;
    let down: Vec<ToolPoint> =
        (0..=40).map(|i| ToolPoint::at_rest(above.lerp(at, f64::from(i) / 40.0))).collect();
    body.advance(Some((&mut contact, &down)), 40, SemiImplicitEuler::default()).unwrap();
    let hold = vec![ToolPoint::at_rest(at); 3001];
    let report = body.advance(Some((&mut contact, &hold)), 3000, SemiImplicitEuler::default()).unwrap();
    let h = 1e-3 / report.substeps as f64;
    let impulse: DVec3 = contact.touched().iter().map(|t| t.impulse_ns).sum();
    let shown = contact.displayed_force_n(&body);
    assert!(
        shown.z > 1.0 && (shown + impulse / h).length() < 1e-3 * shown.length(),
        "{shown} {}",
        impulse / h
    );
    // The fixed nodes at the bottom carry the force.
    let held: DVec3 = (0..36).map(|node| body.internal_force_on_n(node)).sum();
    assert!((held + shown).length() < 1e-3 * shown.length(), "{held} {shown}");
}
