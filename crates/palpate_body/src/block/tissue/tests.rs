use crate::*;
use glam::{DMat3, DVec3};
use palpate_laws::ForceLaw;

const SOFT: Tissue = Tissue {
    youngs_modulus_pa: 10e3,
    density_kg_per_m3: 1000.0,
    damping: Damping::Ratio(0.5),
    ..Tissue::SOFT
};
const HARD: Tissue = Tissue {
    youngs_modulus_pa: 40e3,
    density_kg_per_m3: 1100.0,
    damping: Damping::Ratio(0.7),
    ..Tissue::SOFT
};

/// The points with x above `x_m`.
fn right_of(x_m: f64) -> Region {
    Region::HalfSpace { point_m: DVec3::X * x_m, outward: DVec3::NEG_X }
}

fn block() -> Block {
    Block::new([5, 6, 11], DVec3::new(0.08, 0.1, 0.2)).unwrap().allow_unconstrained()
}

fn stiffness_n_per_m(link: &Link) -> f64 {
    let ForceLaw::Linear { stiffness_n_per_m } = link.spring.law() else { unreachable!() };
    stiffness_n_per_m
}

/// Elastic energy under the infinitesimal affine displacement x → x + ε x, J.
fn energy_j(network: &Network, strain: DMat3) -> f64 {
    let x = network.rest_m();
    let energy = |link: &Link| {
        let d = x[link.b] - x[link.a];
        let k = stiffness_n_per_m(link);
        0.5 * k * (d.dot(strain * d) / d.length()).powi(2)
    };
    network.links().iter().map(energy).sum()
}

fn mass_kg(body: &BlockBody) -> f64 {
    body.network.mass_kg().iter().sum()
}

fn assert_close(found: f64, expected: f64) {
    assert!((found / expected - 1.0).abs() < 1e-12, "{found}, expected {expected}");
}

#[test]
fn regions_have_the_strain_energy_and_mass_of_their_shares() {
    let strain = DMat3::from_cols(
        DVec3::new(0.01, 0.02, 0.0),
        DVec3::new(0.02, -0.01, 0.004),
        DVec3::new(0.0, 0.004, 0.03),
    );
    let of = |tissue: &Tissue| block().tissue(tissue).unwrap();
    // The plane lies halfway in a cell: its cells are a mean of both tissues.
    for (x_m, share) in [(0.0, 0.5), (0.01, 0.375), (0.02, 0.25)] {
        let mixed = block().region(right_of(x_m), HARD).tissue(&SOFT).unwrap();
        let mix = |amount: &dyn Fn(&BlockBody) -> f64| {
            share * amount(&of(&HARD)) + (1.0 - share) * amount(&of(&SOFT))
        };
        let energy = |body: &BlockBody| energy_j(&body.network, strain);
        assert_close(energy(&mixed), mix(&energy));
        assert_close(mass_kg(&mixed), mix(&mass_kg));
    }
    // The last region applies.
    let all = block().region(right_of(0.0), SOFT).region(right_of(-1.0), HARD).tissue(&SOFT).unwrap();
    assert_close(energy_j(&all.network, strain), energy_j(&of(&HARD).network, strain));
}

#[test]
fn lips_of_a_slit_between_two_tissues_have_their_own_tissue() {
    let slit = Slit { length_m: 0.12, depth_m: 0.04, opening_m: 0.0 };
    let whole = block().region(right_of(0.0), HARD).tissue(&SOFT).unwrap();
    let cut = block().region(right_of(0.0), HARD).slit(slit).tissue(&SOFT).unwrap();
    assert_close(mass_kg(&cut), mass_kg(&whole));
    let strain = DMat3::from_diagonal(DVec3::new(0.0, 0.01, -0.02));
    assert_close(energy_j(&cut.network, strain), energy_j(&whole.network, strain));
    // The open nodes, the left lip first; the right lips follow all nodes of the block.
    let (x, lattice) = (cut.network.rest_m(), whole.network.node_count());
    for right in lattice..cut.network.node_count() {
        let left = (0..lattice).find(|&node| x[node] == x[right]).unwrap();
        let mass = cut.network.mass_kg();
        assert_close(mass[right] / mass[left], 1.1);
        let stiffness = |node: usize| -> f64 {
            let links = cut.network.links().iter().filter(|link| link.a == node || link.b == node);
            links.map(stiffness_n_per_m).sum()
        };
        assert_close(stiffness(right) / stiffness(left), 4.0);
    }
}

#[test]
fn region_outside_the_block_and_invalid_tissue_of_a_region_are_errors() {
    let outside = block().region(right_of(0.2), HARD).tissue(&SOFT);
    assert!(matches!(outside, Err(BodyError::Mesh(MeshError::EmptyRegion { index: 0, .. }))), "{outside:?}");
    let invalid = block().region(right_of(0.0), Tissue { youngs_modulus_pa: -1.0, ..HARD }).tissue(&SOFT);
    assert!(matches!(invalid, Err(BodyError::Parameter { .. })), "{invalid:?}");
}

#[test]
fn lump_in_a_block_is_that_of_a_box_of_cells() {
    let lump = Region::Sphere { center_m: DVec3::new(0.01, 0.02, 0.03), radius_m: 0.025 };
    let block = Block::new([6; 3], DVec3::splat(0.1)).unwrap().allow_unconstrained();
    let block = block.region(lump.clone(), HARD).tissue(&SOFT).unwrap();
    let corner = |c: usize| {
        DVec3::new((c & 1) as f64, (c >> 1 & 1) as f64, (c >> 2) as f64) * 0.1 - DVec3::splat(0.05)
    };
    let triangles = [
        [0, 2, 3],
        [0, 3, 1],
        [4, 5, 7],
        [4, 7, 6],
        [0, 1, 5],
        [0, 5, 4],
        [2, 6, 7],
        [2, 7, 3],
        [0, 4, 6],
        [0, 6, 2],
        [1, 3, 7],
        [1, 7, 5],
    ];
    let mesh = ClosedMesh::new((0..8).map(corner).collect(), triangles.to_vec()).unwrap();
    let cells = CellLattice::fit(&mesh, CellSize::Along(5)).unwrap().allow_unconstrained();
    let mesh = cells.region(lump, HARD).tissue(&SOFT).unwrap();
    assert_eq!(mesh.network.node_count(), 216);
    for (node, x) in block.network.rest_m().iter().enumerate() {
        let other = mesh.network.rest_m().iter().position(|y| (*x - *y).length() < 1e-9).unwrap();
        assert_close(block.network.mass_kg()[node], mesh.network.mass_kg()[other]);
        let stiffness = |network: &Network, node: usize| -> f64 {
            let links = network.links().iter().filter(|link| link.a == node || link.b == node);
            links.map(|link| stiffness_n_per_m(link) + link.spring.damping_ns_per_m()).sum()
        };
        assert_close(stiffness(&block.network, node), stiffness(&mesh.network, other));
    }
}
