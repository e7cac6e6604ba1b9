//! Motion of bodies made of meshes: stiffness, stable step, gravity and a poke.

use super::shapes::{Shape, cuboid, sphere, torus};
use glam::{DQuat, DVec3};
use palpate_body::*;

const TISSUE: Tissue = Tissue {
    youngs_modulus_pa: 20e3,
    density_kg_per_m3: 1000.0,
    damping: Damping::Ratio(0.5),
    ..Tissue::SOFT
};

fn turn() -> DQuat {
    DQuat::from_euler(glam::EulerRot::XYZ, 0.4, 0.7, -0.5)
}

/// Young's modulus of an oblique bar from its extension under a pull, fitted to the displacements of its middle half.
fn modulus_of_bar(cells: usize) -> f64 {
    let (width, length, force) = (0.03, 0.12, 0.2);
    let axis = turn() * DVec3::Z;
    let shape = cuboid(DVec3::new(width, width, length), [12, 12, 48]).turned(turn());
    let mesh = shape.close().unwrap();
    let held = Region::HalfSpace { point_m: -0.05 * axis, outward: axis };
    let made = CellLattice::fit(&mesh, CellSize::Along(cells)).unwrap().fix(held).tissue(&TISSUE).unwrap();
    let mut body = Body::new(made.network, made.surface).unwrap();
    let (rest, mass) = (body.network().rest_m().to_vec(), body.network().mass_kg().to_vec());
    let pulled: Vec<usize> = (0..rest.len()).filter(|&n| rest[n].dot(axis) > 0.05).collect();
    let total: f64 = pulled.iter().map(|&n| mass[n]).sum();
    let mut loads = vec![DVec3::ZERO; rest.len()];
    pulled.iter().for_each(|&n| loads[n] = axis * (force * mass[n] / total));
    body.set_loads(&loads).unwrap();
    let newton = LinearlyImplicitEuler { tick_s: 1e4, solver: LinearSolver::Cholesky, ..Default::default() };
    body.advance(None, 12, newton).unwrap();
    // Least squares of the displacement along the bar over the position along it.
    let (mut n, mut s, mut u, mut ss, mut su) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for point in &body.surface().points {
        let at = point.of(&rest).dot(axis);
        if at.abs() < 0.25 * length {
            let by = point.of(body.positions_m()).dot(axis) - at;
            (n, s, u, ss, su) = (n + 1.0, s + at, u + by, ss + at * at, su + at * by);
        }
    }
    let strain = (n * su - s * u) / (n * ss - s * s);
    force / (width * width * strain)
}

#[test]
fn oblique_bar_has_the_given_modulus() {
    // Three, five and eight cells across; the bar extends by 1 %.
    for (cells, within) in [(11, 0.01), (18, 0.01), (29, 0.005)] {
        let found = modulus_of_bar(cells) / TISSUE.youngs_modulus_pa;
        assert!((found - 1.0).abs() < within, "{found} of E with {cells} cells along");
    }
}

fn stable_step(network: Network, surface: Surface) -> f64 {
    SemiImplicitEuler::stable_step_s(&Body::new(network, surface).unwrap())
}

#[test]
fn partly_filled_cells_need_no_shorter_step() {
    let needle = cuboid(DVec3::new(0.1, 4e-4, 4e-4), [30, 1, 1]).turned(turn());
    let mut least = 1.0_f64;
    for (shape, cells) in
        [(sphere(0.05, 24), 9), (sphere(0.05, 24), 16), (torus(0.05, 0.02, 48, 24), 12), (needle, 20)]
    {
        let mesh = shape.turned(turn()).close().unwrap();
        let made = CellLattice::fit(&mesh, CellSize::Along(cells))
            .unwrap()
            .allow_unconstrained()
            .tissue(&TISSUE)
            .unwrap();
        let lightest = made.network.mass_kg().iter().fold(f64::INFINITY, |a, b| a.min(*b));
        let eighth = 1000.0 * made.cells.cell_m.powi(3) / 8.0;
        assert!(lightest < 0.2 * eighth);
        let block = Block::new([5; 3], DVec3::splat(4.0 * made.cells.cell_m)).unwrap().allow_unconstrained();
        let block = block.tissue(&TISSUE).unwrap();
        let share = stable_step(made.network, made.surface) / stable_step(block.network, block.surface);
        least = least.min(share);
        assert!(share > 0.7, "{share} of a block's step");
    }
    assert!(least < 1.0);
}

/// A ball of tissue, its lower part fixed, rotated relative to the cells.
fn ball() -> (Body, MeshCells) {
    let shape: Shape = sphere(0.04, 20).turned(turn());
    let mesh = shape.close().unwrap();
    let held = Region::HalfSpace { point_m: -0.025 * DVec3::Z, outward: DVec3::Z };
    let made = CellLattice::fit(&mesh, CellSize::Along(9)).unwrap().fix(held).tissue(&TISSUE).unwrap();
    (Body::new(made.network, made.surface).unwrap(), made.cells)
}

fn both() -> [Integrator; 2] {
    let implicit =
        LinearlyImplicitEuler { solver: LinearSolver::Cholesky, ticks_per_step: 10, ..Default::default() };
    [SemiImplicitEuler::default().into(), implicit.into()]
}

#[test]
fn body_at_rest_has_its_weight_on_fixed_nodes() {
    for integrator in both() {
        let (mut body, _) = ball();
        body.set_gravity(-9.81 * DVec3::Z).unwrap();
        body.advance(None, 1500, integrator).unwrap();
        assert!(body.is_settled());
        let free = body.network().free().to_vec();
        let weight: f64 = 9.81 * free.iter().map(|&n| body.network().mass_kg()[n]).sum::<f64>();
        let holds: f64 = (0..body.network().node_count())
            .filter(|n| body.network().is_fixed(*n))
            .map(|n| body.internal_force_on_n(n).z)
            .sum();
        assert!((holds / -weight - 1.0).abs() < 1e-2, "{holds} N, not {}", -weight);
        let sunk =
            free.iter().map(|&n| body.network().rest_m()[n].z - body.positions_m()[n].z).fold(0.0, f64::max);
        assert!(sunk > 1e-4 && sunk < 4e-3, "{sunk} m");
    }
}

/// Presses a ball of 15 mm radius 4 mm into the top of a body at (1, 2) mm within 0.1 s, waits for 0.2 s, and removes
/// it. Returns the force while waiting, and the body 2 s later.
fn poke(mut body: Body, top_m: f64, integrator: Integrator) -> (DVec3, Body) {
    let mut tool = ToolContact::touch(ToolShape::Sphere { radius_m: 0.015 }, 0.2).unwrap();
    let at = |tick: usize| {
        let t = tick as f64 * 1e-3;
        let up = 0.001 - 0.05 * (t.min(0.1) - 2.0 * (t - 0.3).max(0.0));
        ToolPoint::at_rest(DVec3::new(0.001, 0.002, top_m + 0.015 + up))
    };
    let mut waiting = DVec3::ZERO;
    for tick in (0..400).step_by(10) {
        let path: Vec<ToolPoint> = (tick..=tick + 10).map(at).collect();
        body.advance(Some((&mut tool, &path)), 10, integrator).unwrap();
        if tick == 290 {
            waiting = tool.displayed_force_n(&body);
        }
    }
    assert_eq!(tool.displayed_force_n(&body), DVec3::ZERO);
    body.advance(None, 2000, integrator).unwrap();
    (waiting, body)
}

#[test]
fn poke_force_does_not_depend_on_the_cut_of_cells() {
    let size = DVec3::new(0.06, 0.06, 0.04);
    let block = Block::new([9, 9, 6], size).unwrap().fix(Face::NegZ).tissue(&TISSUE).unwrap();
    let block = Body::new(block.network, block.surface).unwrap();
    let (of_block, _) = poke(block, 0.02, SemiImplicitEuler::default().into());
    for integrator in both() {
        // Cells of 7.5 mm: 5 1/3 of them through the thickness, and rotated.
        let held = Region::HalfSpace { point_m: -0.0199 * DVec3::Z, outward: DVec3::Z };
        for turn in [0.0, 0.6] {
            let shape = cuboid(size, [30, 30, 20]).turned(DQuat::from_rotation_z(turn));
            let mesh = shape.close().unwrap();
            let lattice = CellLattice::fit(&mesh, CellSize::Side(0.0075)).unwrap();
            let bottom: Vec<bool> = shape.vertices.iter().map(|x| held.contains(*x)).collect();
            let made = lattice.fix_vertices(&bottom).unwrap().tissue(&TISSUE).unwrap();
            let (of_mesh, body) = poke(Body::new(made.network, made.surface).unwrap(), 0.02, integrator);
            assert!((of_mesh.z / of_block.z - 1.0).abs() < 0.15, "{of_mesh}, not {of_block}");
            for (x, rest) in body.positions_m().iter().zip(body.network().rest_m()) {
                assert!(x.distance(*rest) < 1e-5);
            }
        }
    }
}
