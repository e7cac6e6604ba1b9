//! Validation of networks, each error with its own variant.

use glam::DVec3;
use palpate_body::*;
use palpate_laws::{ForceLaw, Spring};

fn link(a: usize, b: usize) -> Link {
    Link { a, b, spring: Spring::linear(1.0, 0.1, 0.0).unwrap() }
}

/// Nodes on a line, the first fixed.
fn network(nodes: usize, links: Vec<Link>) -> Result<Network, BodyError> {
    let rest = (0..nodes).map(|i| DVec3::X * i as f64).collect();
    Network::new(rest, vec![1.0; nodes], (0..nodes).map(|i| i == 0).collect(), links)
}

#[test]
fn rejects_invalid_links() {
    assert_eq!(network(2, vec![link(0, 2)]), Err(BodyError::NodeOutOfRange { link: 0, node: 2, nodes: 2 }));
    assert_eq!(network(2, vec![link(1, 1)]), Err(BodyError::SelfLink { link: 0, node: 1 }));
    let twice = network(3, vec![link(0, 1), link(1, 2), link(1, 0)]);
    assert_eq!(twice, Err(BodyError::DuplicateLink { link: 2, earlier: 0, a: 1, b: 0 }));
    assert!(network(3, vec![link(0, 1), link(1, 2)]).is_ok());
}

#[test]
fn rejects_unconstrained_and_disconnected_parts() {
    assert_eq!(network(4, vec![link(0, 1), link(2, 3)]), Err(BodyError::Unconstrained { node: 2, nodes: 2 }));
    assert_eq!(network(3, vec![link(0, 1)]), Err(BodyError::Unconstrained { node: 2, nodes: 1 }));
    // Constrained, but in two parts connected by fixed nodes only.
    let rest: Vec<DVec3> = (0..4).map(|i| DVec3::X * f64::from(i)).collect();
    let fixed = vec![true, false, false, true];
    let links = vec![link(0, 1), link(2, 3)];
    let parts = Network::new(rest.clone(), vec![1.0; 4], fixed.clone(), links.clone());
    assert_eq!(parts, Err(BodyError::Disconnected { node: 2, first: 1 }));
    assert_eq!(
        parts.unwrap_err().to_string(),
        "no springs connect node 2 to node 1; connect them, make two bodies, or allow separate parts \
         (`allow_unconstrained`, or `FixedRegion::None` of a component)"
    );
    let mut builder = NetworkBuilder::new();
    for x in rest {
        builder.node(x, 1.0);
    }
    for link in links {
        builder.link(link);
    }
    let builder = builder.fix([0, 3]);
    assert_eq!(builder.clone().build(), Err(BodyError::Disconnected { node: 2, first: 1 }));
    assert_eq!(builder.allow_unconstrained().build().unwrap().free(), [1, 2]);
}

#[test]
fn builder_reports_its_first_error_with_the_index() {
    let linear = ForceLaw::Linear { stiffness_n_per_m: 10.0 };
    let two = || {
        let mut builder = NetworkBuilder::new();
        builder.node(DVec3::ZERO, 1.0);
        builder.node(DVec3::X, 1.0);
        builder.spring(0, 1, linear, 0.1);
        builder.fix([0])
    };
    assert!(two().build().is_ok());
    let with = |change: &dyn Fn(&mut NetworkBuilder)| {
        let mut builder = two();
        change(&mut builder);
        builder.build()
    };
    let spring = |a, b, law, damping| {
        with(&|builder| {
            builder.spring(a, b, law, damping);
        })
    };
    assert_eq!(spring(0, 5, linear, 0.0), Err(BodyError::NodeOutOfRange { link: 1, node: 5, nodes: 2 }));
    assert_eq!(spring(1, 1, linear, 0.0), Err(BodyError::SelfLink { link: 1, node: 1 }));
    assert_eq!(spring(1, 0, linear, 0.0), Err(BodyError::DuplicateLink { link: 1, earlier: 0, a: 1, b: 0 }));
    let negative = ForceLaw::Linear { stiffness_n_per_m: -1.0 };
    assert!(matches!(spring(0, 1, negative, 0.0), Err(BodyError::Law { link: 1, .. })));
    assert!(matches!(spring(0, 1, linear, f64::NAN), Err(BodyError::Law { link: 1, .. })));
    let together = with(&|builder| {
        let third = builder.node(DVec3::X, 1.0);
        builder.spring(1, third, linear, 0.0);
        builder.spring(9, third, linear, 0.0);
    });
    assert_eq!(together, Err(BodyError::ZeroLength { link: 1, a: 1, b: 2 }));
    assert_eq!(two().fix([0, 7]).build(), Err(BodyError::Fixed { node: 7, nodes: 2 }));
    for (k, b, m) in [(0.0, 1.0, 1.0), (1.0, -1.0, 1.0), (1.0, 1.0, f64::NAN)] {
        assert!(matches!(two().region(|_| true, k, b, m).build(), Err(BodyError::Parameter { .. })));
    }
}

#[test]
fn regions_fixed_nodes_and_laws_apply_where_given() {
    let lattice = Lattice::new([5, 3, 3], 0.1).unwrap();
    let network = lattice.uniform(100.0, 0.5, 0.01, |[i, ..]| i == 0).unwrap();
    let stiff = network.clone().edit().region(|x| x.x > 0.25, 4.0, 2.0, 3.0).fix_where(|x| x.y > 0.15);
    let stiff = stiff
        .law_where(|x| x.x < 0.05, |_| ForceLaw::Exponential { stiffness_n_per_m: 7.0, rate_per_m: 20.0 });
    let stiff = stiff.build().unwrap();
    for (before, after) in network.links().iter().zip(stiff.links()) {
        let middle = 0.5 * (network.rest_m()[after.a].x + network.rest_m()[after.b].x);
        let (law, damping) = (after.spring.law(), after.spring.damping_ns_per_m());
        let expected = if middle > 0.25 {
            (before.spring.law().scaled(4.0), 1.0)
        } else if middle < 0.05 {
            (ForceLaw::Exponential { stiffness_n_per_m: 7.0, rate_per_m: 20.0 }, 0.5)
        } else {
            (before.spring.law(), 0.5)
        };
        assert_eq!((law, damping), expected, "at {middle}");
        assert_eq!(after.spring.rest_length_m(), before.spring.rest_length_m());
    }
    for (node, x) in network.rest_m().iter().enumerate() {
        assert_eq!(stiff.is_fixed(node), x.x == 0.0 || x.y > 0.15);
        assert!((stiff.mass_kg()[node] - if x.x > 0.25 { 0.03 } else { 0.01 }).abs() < 1e-18);
    }
}

#[test]
fn lattice_has_the_chosen_neighbours() {
    for (nodes, lateral, all) in [([4, 1, 1], 2, 2), ([4, 4, 1], 4, 8), ([4, 4, 4], 6, 26)] {
        let lattice = Lattice::new(nodes, 1.0).unwrap();
        let inner = lattice.node(nodes.map(|n| if n > 1 { 1 } else { 0 }));
        for (neighbours, expected) in [(Neighbours::Lateral, lateral), (Neighbours::LateralAndDiagonal, all)]
        {
            let network = lattice.joined_to(neighbours).uniform(1.0, 0.0, 1.0, |[i, ..]| i == 0).unwrap();
            assert_eq!(network.neighbours(inner).count(), expected, "{nodes:?}, {neighbours:?}");
        }
    }
}

#[test]
fn rejects_invalid_nodes() {
    assert_eq!(network(0, vec![]), Err(BodyError::NoNodes));
    let make = |x: f64, m: f64, fixed: Vec<bool>| Network::new(vec![DVec3::X * x], vec![m], fixed, vec![]);
    assert_eq!(make(f64::NAN, 1.0, vec![false]), Err(BodyError::Position { node: 0 }));
    assert_eq!(make(0.0, 0.0, vec![false]), Err(BodyError::Mass { node: 0, mass_kg: 0.0 }));
    assert_eq!(make(0.0, 1.0, vec![true]), Err(BodyError::AllFixed(1)));
    let error = make(0.0, 1.0, vec![]).unwrap_err();
    assert_eq!(error, BodyError::Length { what: "the list of fixed nodes", found: 0, nodes: 1 });
}

#[test]
fn rejects_a_state_of_another_size_and_keeps_the_old_one() {
    let mut body = Body::new(network(2, vec![link(0, 1)]).unwrap(), Surface::default()).unwrap();
    let before = body.positions_m().to_vec();
    let still = [DVec3::ZERO; 2];
    assert!(matches!(
        body.set_state(&before[..1], &still),
        Err(BodyError::Length { found: 1, nodes: 2, .. })
    ));
    assert_eq!(body.set_state(&before, &[DVec3::ZERO, DVec3::NAN]), Err(BodyError::Position { node: 1 }));
    assert_eq!(body.positions_m(), before);
}

#[test]
fn rejects_a_surface_of_another_network() {
    let with = |surface| Body::new(network(2, vec![link(0, 1)]).unwrap(), surface).map(|_| ());
    let points = [0, 1].map(BodyPoint::node).to_vec();
    let of = |vertices, triangles| Surface { points: points.clone(), vertices, triangles };
    assert_eq!(with(of(vec![0, 1, 2], vec![])), Err(BodyError::Surface { index: 2, below: 2 }));
    assert_eq!(with(of(vec![0, 1], vec![[0, 1, 2]])), Err(BodyError::Surface { index: 2, below: 2 }));
    assert_eq!(with(of(vec![0, 1, 1], vec![[0, 1, 2]])), Ok(()));
    let elsewhere = Surface { points: vec![BodyPoint::node(2)], ..Surface::default() };
    assert_eq!(with(elsewhere), Err(BodyError::Surface { index: 2, below: 2 }));
}
