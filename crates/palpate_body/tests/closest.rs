//! The nearest point of a surface against a search over all triangles.

use glam::DVec3;
use palpate_body::*;
use proptest::prelude::*;

fn block(n: usize) -> Body {
    let lattice = UniformLattice { stiffness_n_per_m: 200.0, damping_ratio: 0.6, mass_kg: 0.5 };
    let block = Block::new([n, n + 1, n + 2], DVec3::new(0.05, 0.06, 0.07)).unwrap();
    let block = block.fix(Face::NegZ).uniform(&lattice).unwrap();
    Body::new(block.network, block.surface).unwrap()
}

/// The minimum distance to a triangle by sampling, without case distinctions.
fn walked(corners: [DVec3; 3], place: DVec3) -> f64 {
    let [a, b, c] = corners;
    let steps = 60;
    let mut least = f64::INFINITY;
    for (i, j) in (0..=steps).flat_map(|i| (0..=steps - i).map(move |j| (i, j))) {
        let (u, v) = (f64::from(i) / f64::from(steps), f64::from(j) / f64::from(steps));
        least = least.min((a + u * (b - a) + v * (c - a)).distance(place));
    }
    least
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn closest_point_is_nearest_of_all_triangles(
        place in prop::array::uniform3(-0.06..0.06f64),
        bend in prop::array::uniform3(-0.3..0.3f64),
    ) {
        let mut body = block(4);
        let mut tree = SurfaceTree::new(&body);
        // Bent after the tree was built, so that it has to be refitted.
        let x: Vec<DVec3> = body
            .network()
            .rest_m()
            .iter()
            .map(|x| *x + DVec3::new(bend[0] * x.z, bend[1] * x.x, bend[2] * x.x * x.z / 0.05))
            .collect();
        body.set_state(&x, &vec![DVec3::ZERO; x.len()]).unwrap();
        tree.refit(&body);
        let place = DVec3::from_array(place);
        let found = tree.closest(place, 1.0).unwrap();
        prop_assert!(((found.point_m - place).length() - found.distance_m.abs()).abs() < 1e-15);
        let (sum, least) = found.corners.iter().fold((0.0, f64::INFINITY), |(s, l), (_, w)| (s + w, l.min(*w)));
        prop_assert!((sum - 1.0).abs() < 1e-12 && least >= 0.0);
        prop_assert!(found.body_point(body.surface()).of(&x).distance(found.point_m) < 1e-15);
        let surface = body.surface();
        let nearest = surface
            .triangles
            .iter()
            .map(|t| walked(t.map(|v| surface.points[surface.vertices[v]].of(&x)), place))
            .fold(f64::INFINITY, f64::min);
        // Sampling misses the nearest point by less than its step, and finds no nearer one.
        prop_assert!(found.distance_m.abs() <= nearest + 1e-12 && nearest < found.distance_m.abs() + 5e-4);
        prop_assert!((found.normal.length() - 1.0).abs() < 1e-12);
        let nothing = tree.closest(place, 0.99 * found.distance_m.abs());
        prop_assert!(nothing.is_none());
    }

    /// The distance to a block is known in closed form, including edges and corners.
    #[test]
    fn distance_is_negative_exactly_inside(place in prop::array::uniform3(-0.08..0.08f64)) {
        let body = block(3);
        let half = DVec3::new(0.025, 0.03, 0.035);
        let place = DVec3::from_array(place);
        let beyond = (place.abs() - half).max(DVec3::ZERO).length();
        let within = (half - place.abs()).min_element();
        let expected = if beyond > 0.0 { beyond } else { -within };
        let found = SurfaceTree::new(&body).closest(place, 1.0).unwrap();
        prop_assert!((found.distance_m - expected).abs() < 1e-12, "{found:?}, expected {expected}");
        // Outside, the direction to the surface is opposite to its normal, or nearly so at an edge.
        prop_assert!(expected <= 1e-9 || found.normal.dot(place - found.point_m) > 0.5 * expected);
    }
}

#[test]
fn surface_without_triangles_has_no_closest_point() {
    let network = Lattice::new([3, 1, 1], 0.1).unwrap().uniform(1.0, 0.1, 1.0, |[i, ..]| i == 0).unwrap();
    let body = Body::new(network, Surface::default()).unwrap();
    assert!(SurfaceTree::new(&body).closest(DVec3::ZERO, 1.0).is_none());
}
