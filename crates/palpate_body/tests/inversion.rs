//! Bodies pressed or pulled until cells invert: the volume barriers, and the return to rest.

mod barriers;
mod returns;

use glam::{DMat3, DQuat, DVec3};
use palpate_body::*;

fn block(nodes: [usize; 3], size_m: DVec3, tissue: &Tissue) -> Body {
    let block = Block::new(nodes, size_m).unwrap().fix(Face::NegY).tissue(tissue).unwrap();
    Body::new(block.network, block.surface).unwrap()
}

fn cube(n: usize) -> Body {
    block([n; 3], DVec3::splat(0.02 * (n - 1) as f64), &Tissue::default())
}

fn at_rest(body: &mut Body, x: &[DVec3]) {
    body.set_state(x, &vec![DVec3::ZERO; x.len()]).unwrap();
}

/// Maximum distance of a node from rest, m.
fn off_m(body: &Body) -> f64 {
    let rest = body.network().rest_m();
    body.positions_m().iter().zip(rest).map(|(x, rest)| x.distance(*rest)).fold(0.0, f64::max)
}

/// Volume ratios of the tetrahedra of every cell: at its corners, and between alternate corners.
fn ratios(network: &Network, x: &[DVec3]) -> Vec<f64> {
    let volume = |x: &[DVec3], cell: &[usize; 8], [o, a, b, c]: [usize; 4]| {
        let edge = |to: usize| x[cell[to]] - x[cell[o]];
        edge(a).dot(edge(b).cross(edge(c)))
    };
    let corners = (0..8).map(|c| [c, c ^ 1, c ^ 2, c ^ 4]);
    let all: Vec<[usize; 4]> = corners.chain([[0, 3, 5, 6], [1, 2, 4, 7]]).collect();
    let of = |cell: &[usize; 8]| {
        all.iter().map(|&t| volume(x, cell, t) / volume(network.rest_m(), cell, t)).collect::<Vec<_>>()
    };
    network.cells().iter().flat_map(of).collect()
}

/// The same springs without cells.
fn without_cells(network: &Network) -> Network {
    let fixed = (0..network.node_count()).map(|node| network.is_fixed(node)).collect();
    let (rest_m, mass_kg) = (network.rest_m().to_vec(), network.mass_kg().to_vec());
    Network::new(rest_m, mass_kg, fixed, network.links().to_vec()).unwrap()
}

/// Pseudo-random numbers between −1 and 1.
fn number(seed: u64) -> f64 {
    let mut z = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / 2f64.powi(52) - 1.0
}

fn noise(seed: u64, node: usize) -> DVec3 {
    let at = seed * 1_000_003 + 3 * node as u64;
    DVec3::new(number(at), number(at + 1), number(at + 2))
}

/// Free nodes displaced by up to `by_m`.
fn shaken(body: &Body, by_m: f64, seed: u64) -> Vec<DVec3> {
    let network = body.network();
    let moved = |node: usize| if network.is_fixed(node) { DVec3::ZERO } else { by_m * noise(seed, node) };
    (0..network.node_count()).map(|node| network.rest_m()[node] + moved(node)).collect()
}

fn internal_n(body: &Body) -> Vec<DVec3> {
    let mut force = vec![DVec3::ZERO; body.positions_m().len()];
    body.internal_forces_n(&mut force);
    force
}

/// Steps of 1 ms and of 10 ms.
fn integrators() -> [Integrator; 2] {
    let long = LinearlyImplicitEuler { ticks_per_step: 10, ..LinearlyImplicitEuler::default() };
    [SemiImplicitEuler::default().into(), long.into()]
}
