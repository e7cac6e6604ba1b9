//! Networks that make no sense are refused, each with its own error.

use glam::DVec3;
use palpate_body::*;
use palpate_laws::Spring;

fn link(a: usize, b: usize) -> Link {
    Link { a, b, spring: Spring::linear(1.0, 0.1, 0.0).unwrap() }
}

fn network(nodes: usize, links: Vec<Link>) -> Result<Network, BodyError> {
    let rest = (0..nodes).map(|i| DVec3::X * i as f64).collect();
    Network::new(rest, vec![1.0; nodes], vec![false; nodes], links)
}

#[test]
fn links_are_checked() {
    assert_eq!(network(2, vec![link(0, 2)]), Err(BodyError::NodeOutOfRange { link: 0, node: 2, nodes: 2 }));
    assert_eq!(network(2, vec![link(1, 1)]), Err(BodyError::SelfLink { link: 0, node: 1 }));
    let twice = network(3, vec![link(0, 1), link(1, 2), link(1, 0)]);
    assert_eq!(twice, Err(BodyError::DuplicateLink { link: 2, earlier: 0, a: 1, b: 0 }));
    assert!(network(3, vec![link(0, 1), link(1, 2)]).is_ok());
}

#[test]
fn nodes_are_checked() {
    assert_eq!(network(0, vec![]), Err(BodyError::NoNodes));
    let make = |x: f64, m: f64, fixed: Vec<bool>| Network::new(vec![DVec3::X * x], vec![m], fixed, vec![]);
    assert_eq!(make(f64::NAN, 1.0, vec![false]), Err(BodyError::Position { node: 0 }));
    assert_eq!(make(0.0, 0.0, vec![false]), Err(BodyError::Mass { node: 0, mass_kg: 0.0 }));
    assert_eq!(make(0.0, 1.0, vec![true]), Err(BodyError::AllFixed(1)));
    let error = make(0.0, 1.0, vec![]).unwrap_err();
    assert_eq!(
        error.to_string(),
        "the list of fixed nodes has 0 entries for 1 nodes; it needs exactly one for each"
    );
}

#[test]
fn a_state_that_does_not_fit_is_refused_and_the_old_one_kept() {
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
fn a_surface_that_does_not_fit_is_refused() {
    let with = |surface| Body::new(network(2, vec![link(0, 1)]).unwrap(), surface).map(|_| ());
    let node = |node, normal| SurfaceNode { node, normals: vec![normal] };
    let nodes = |nodes| Surface { nodes, ..Surface::default() };
    assert_eq!(with(nodes(vec![node(2, DVec3::X)])), Err(BodyError::Surface { index: 2, below: 2 }));
    assert!(matches!(with(nodes(vec![node(1, DVec3::X * 2.0)])), Err(BodyError::Parameter { .. })));
    assert!(matches!(with(nodes(vec![node(1, DVec3::NAN)])), Err(BodyError::Parameter { .. })));
    let triangle = Surface { vertices: vec![0, 1], triangles: vec![[0, 1, 2]], ..Surface::default() };
    assert_eq!(with(triangle), Err(BodyError::Surface { index: 2, below: 2 }));
    assert_eq!(with(nodes(vec![node(1, DVec3::X)])), Ok(()));
}
