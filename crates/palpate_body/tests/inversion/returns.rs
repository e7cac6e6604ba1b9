//! Bodies pressed, drawn or folded through themselves return to rest after release.

use super::*;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

fn returns_within(body: &mut Body, integrator: Integrator, ticks: usize, within_m: f64) {
    let mut inverted = 0;
    for _ in 0..ticks / 500 {
        inverted = body.advance(None, 500, integrator).unwrap().inverted_cells;
        if body.is_settled() {
            break;
        }
    }
    assert_eq!(inverted, 0, "{integrator:?}");
    assert!(off_m(body) < within_m, "{} m from rest, {integrator:?}", off_m(body));
    assert!(body.active_barriers().next().is_none());
}

#[test]
fn bar_stretched_to_150_percent_returns_to_rest() {
    for integrator in integrators() {
        let mut body = block([5, 13, 5], DVec3::new(0.04, 0.12, 0.04), &Tissue::default());
        let stretched: Vec<DVec3> =
            body.network().rest_m().iter().map(|x| DVec3::new(x.x, 1.5 * x.y + 0.03, x.z)).collect();
        at_rest(&mut body, &stretched);
        // The bar contracts beyond its rest length.
        let mut active = 0;
        for _ in 0..200 {
            body.advance(None, 1, integrator).unwrap();
            active = active.max(body.active_barriers().count());
        }
        assert!(active > 100, "{active}");
        assert!(!body.is_settled());
        returns_within(&mut body, integrator, 5500, 1e-4);
    }
}

#[test]
fn bar_pulled_and_pushed_at_its_end_returns_to_rest() {
    for (integrator, length) in integrators().into_iter().flat_map(|i| [1.5, 0.6].map(|length| (i, length))) {
        let mut body = block([5, 13, 5], DVec3::new(0.04, 0.12, 0.04), &Tissue::default());
        let end = |x: &DVec3| if x.y > 0.0599 { DVec3::new(x.x, 0.12 * length - 0.06, x.z) } else { *x };
        let moved: Vec<DVec3> = body.network().rest_m().iter().map(end).collect();
        at_rest(&mut body, &moved);
        assert_eq!(body.inverted_cells().count(), if length < 1.0 { 16 } else { 0 });
        returns_within(&mut body, integrator, 5500, 1e-4);
        let shrunk = body.network().rest_m().iter();
        let shrunk: Vec<DVec3> = shrunk.map(|x| DVec3::new(x.x, length * (x.y + 0.06) - 0.06, x.z)).collect();
        at_rest(&mut body, &shrunk);
        returns_within(&mut body, integrator, 5500, 1e-4);
    }
}

/// Moves the end of the bar to `length` within a second, holds it there, and releases it.
fn drawn_to(length: f64, network: Network, integrator: Integrator) -> Body {
    let mut body = Body::new(network, Surface::default()).unwrap();
    let rest = body.network().rest_m().to_vec();
    let ends: Vec<usize> = (0..rest.len()).filter(|&node| rest[node].y > 0.0599).collect();
    let tie = |&node: &usize| Tie::grasp(BodyPoint::node(node), rest[node]).unwrap();
    body.set_ties(ends.iter().map(tie).collect()).unwrap();
    for step in 1..=75 {
        let share = (f64::from(step) / 50.0).min(1.0);
        for (index, &node) in ends.iter().enumerate() {
            body.move_tie(index, rest[node] + DVec3::Y * (0.12 * (length - 1.0) * share)).unwrap();
        }
        body.advance(None, 20, integrator).unwrap();
    }
    body.set_ties(Vec::new()).unwrap();
    body
}

#[test]
fn bar_drawn_slowly_to_150_or_60_percent_and_released_returns_to_rest() {
    let bar = |nodes| block(nodes, DVec3::new(0.04, 0.12, 0.04), &Tissue::default()).network().clone();
    for (integrator, length) in integrators().into_iter().flat_map(|i| [1.5, 0.6].map(|length| (i, length))) {
        // The compressed bar buckles and oscillates for a long time; it has fewer nodes.
        let (nodes, ticks) = if length < 1.0 { ([4, 10, 4], 60_000) } else { ([5, 13, 5], 4_000) };
        let mut body = drawn_to(length, bar(nodes), integrator);
        returns_within(&mut body, integrator, ticks, 1e-4);
    }
    // Springs alone settle 40 mm from rest.
    let mut alone = drawn_to(1.5, without_cells(&bar([5, 13, 5])), integrators()[0]);
    alone.advance(None, 4_000, integrators()[0]).unwrap();
    assert!(alone.is_settled() && off_m(&alone) > 0.039);
}

#[test]
fn block_pressed_30_mm_by_a_held_node_or_a_ball_returns_to_rest() {
    for (integrator, holds) in integrators().into_iter().flat_map(|i| [true, false].map(|holds| (i, holds))) {
        let mut body = block([11; 3], DVec3::splat(0.1), &Tissue::default());
        let radius_m = if holds { 0.0 } else { 0.01 };
        let place = |i: usize| ToolPoint {
            position_m: DVec3::Y * (0.05 + radius_m - 0.03 * i as f64 / 500.0),
            velocity_m_per_s: DVec3::NEG_Y * 0.06,
        };
        let path: Vec<ToolPoint> = (0..=500).map(place).collect();
        let mut tool = if holds {
            ToolContact::hold(&body, 5 + 11 * (10 + 11 * 5), path[0].position_m).unwrap()
        } else {
            ToolContact::touch(ToolShape::Sphere { radius_m }, 0.3).unwrap()
        };
        let report = body.advance(Some((&mut tool, &path)), 500, integrator).unwrap();
        assert!(off_m(&body) >= 0.0299);
        // The node is drawn through the cells below it.
        assert!(report.inverted_cells > 0 || !holds, "{report:?}");
        returns_within(&mut body, integrator, 2500, 1e-4);
    }
}

#[test]
fn fully_mirrored_cells_return() {
    for (n, integrator) in [2, 3].into_iter().flat_map(|n| integrators().map(|integrator| (n, integrator))) {
        // Folded through its fixed face.
        let mut body = cube(n);
        let bottom = body.network().rest_m()[0].y;
        let mirrored: Vec<DVec3> =
            body.network().rest_m().iter().map(|x| DVec3::new(x.x, 2.0 * bottom - x.y, x.z)).collect();
        at_rest(&mut body, &mirrored);
        assert_eq!(body.inverted_cells().count(), (n - 1).pow(3));
        returns_within(&mut body, integrator, 4000, 1e-4);
        // Unconstrained and inverted about its middle plane and about its centre: it returns to its shape.
        for mirror in [DVec3::new(-1.0, 1.0, 1.0), DVec3::NEG_ONE] {
            let block =
                Block::new([n; 3], DVec3::splat(0.02 * (n - 1) as f64)).unwrap().allow_unconstrained();
            let mut body =
                Body::new(block.tissue(&Tissue::default()).unwrap().network, Surface::default()).unwrap();
            let mirrored: Vec<DVec3> = body.network().rest_m().iter().map(|x| mirror * *x).collect();
            at_rest(&mut body, &mirrored);
            let report = body.advance(None, 4000, integrator).unwrap();
            assert_eq!(report.inverted_cells, 0, "{n}, {mirror}, {integrator:?}");
            for link in body.network().links() {
                let length = body.positions_m()[link.a].distance(body.positions_m()[link.b]);
                assert!((length - link.spring.rest_length_m()).abs() < 1e-5, "{n}, {mirror}, {integrator:?}");
            }
        }
    }
}

/// A deformation: stretched to `stretch` along the normal of the fixed face, or mirrored; sheared; with noise.
fn violent(body: &Body, stretch: f64, shear: &[f64], by: f64, cell_m: f64, seed: u64) -> Vec<DVec3> {
    let network = body.network();
    let low = network.rest_m()[0];
    let f = DMat3::from_cols_slice(shear) + DMat3::from_diagonal(DVec3::new(1.0, stretch, 1.0));
    let place = |node: usize| {
        let x = network.rest_m()[node];
        if network.is_fixed(node) { x } else { low + f * (x - low) + by * cell_m * noise(seed, node) }
    };
    (0..network.node_count()).map(place).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 32, failure_persistence: None, rng_seed: RngSeed::Fixed(1), ..ProptestConfig::default() })]

    #[test]
    fn any_deformed_block_returns_to_rest_once_released(
        n in prop::array::uniform3(2usize..=4),
        stretch in -0.5..2.0f64,
        shear in prop::collection::vec(-0.3..0.3f64, 9),
        noise in 0.0..1.0f64,
        seed in 0u64..1000,
        log_e in 3.0..6.0f64,
        log_cell in -3.0..-1.3f64,
        damping_ratio in 0.5..1.0f64,
    ) {
        let (e, cell_m) = (10f64.powf(log_e), 10f64.powf(log_cell));
        let tissue = Tissue { youngs_modulus_pa: e, damping: Damping::Ratio(damping_ratio), ..Tissue::default() };
        let size = cell_m * DVec3::from_array(n.map(|n| (n - 1) as f64));
        // A fifth of the time in which sound crosses a cell; longer steps would need more substeps.
        let tick_s = 0.2 * cell_m / (e / 1000.0).sqrt();
        let explicit = SemiImplicitEuler { tick_s, min_substeps: 1, ..SemiImplicitEuler::default() };
        let implicit = LinearlyImplicitEuler { tick_s, ticks_per_step: 5, ..LinearlyImplicitEuler::default() };
        for integrator in [Integrator::from(explicit), implicit.into()] {
            let mut body = block(n, size, &tissue);
            let x = violent(&body, stretch, &shear, noise, cell_m, seed);
            at_rest(&mut body, &x);
            // A slender body oscillates for a long time.
            let ticks = if integrator == implicit.into() { 6_000 } else { 12_000 };
            let report = body.advance(None, ticks, integrator).unwrap();
            prop_assert_eq!(report.inverted_cells, 0);
            prop_assert!(off_m(&body) < 1e-3 * cell_m, "{} cells, {:?}", off_m(&body) / cell_m, integrator);
        }
    }
}
