//! A lattice of springs against the theory of elasticity: E, Poisson's ratio 1/4, beams.

use glam::DVec3;
use palpate_body::*;

const E: f64 = 20e3;

/// A bar of tissue along z with `n` nodes across, cubic cells and a fixed lower end.
struct Bar {
    body: Body,
    /// Nodes along x, y, z.
    nodes: [usize; 3],
    width: f64,
    length: f64,
}

impl Bar {
    fn new(n: usize, slenderness: usize, width: f64) -> Self {
        let nodes = [n, n, slenderness * (n - 1) + 1];
        let length = width * slenderness as f64;
        let block = Block::new(nodes, DVec3::new(width, width, length)).unwrap().fix(Face::NegZ);
        let tissue = Tissue { youngs_modulus_pa: E, ..Tissue::default() };
        let block = block.tissue(&tissue).unwrap();
        Self { body: Body::new(block.network, block.surface).unwrap(), nodes, width, length }
    }

    fn layer(&self, k: usize) -> impl Iterator<Item = usize> + use<> {
        let across = self.nodes[0] * self.nodes[1];
        k * across..(k + 1) * across
    }

    /// Distributes `force`, N, over the upper end as a uniform stress: a corner gets a quarter of an inner node's
    /// share.
    fn pull(&mut self, force: DVec3) {
        let top = self.nodes[2] - 1;
        let n = self.nodes[0];
        let mut loads = vec![DVec3::ZERO; self.body.network().node_count()];
        for (i, node) in self.layer(top).enumerate() {
            let edge = |j: usize| if j == 0 || j + 1 == n { 0.5 } else { 1.0 };
            loads[node] = force * (edge(i % n) * edge(i / n) / ((n - 1) * (n - 1)) as f64);
        }
        self.body.set_loads(&loads).unwrap();
    }

    /// Solves for the state of rest by Newton's method.
    fn rest(&mut self) {
        let solver = LinearSolver::Cholesky;
        let newton = LinearlyImplicitEuler { tick_s: 1e4, solver, ..LinearlyImplicitEuler::default() };
        self.body.advance(None, 12, newton).unwrap();
    }

    fn mean(&self, k: usize, of: impl Fn(DVec3) -> f64) -> f64 {
        let x = self.body.positions_m();
        self.layer(k).map(|node| of(x[node])).sum::<f64>() / (self.nodes[0] * self.nodes[1]) as f64
    }

    /// Root mean square width of a layer of nodes along x.
    fn spread(&self, k: usize) -> f64 {
        let middle = self.mean(k, |x| x.x);
        self.mean(k, |x| (x.x - middle).powi(2)).sqrt()
    }
}

#[test]
fn bar_in_tension_has_the_given_modulus_and_poissons_ratio_one_quarter() {
    let strain = 1e-4;
    let mut errors = Vec::new();
    for n in [3, 4, 6] {
        let mut bar = Bar::new(n, 5, 0.02);
        let cells = bar.nodes[2] - 1;
        // Between 2/5 and 4/5 of the length, away from the fixed end.
        let (low, high) = (2 * cells / 5, 4 * cells / 5);
        let (length, spread) =
            (bar.mean(high, |x| x.z) - bar.mean(low, |x| x.z), bar.spread((low + high) / 2));
        bar.pull(DVec3::Z * (E * strain * bar.width * bar.width));
        bar.rest();
        let along = (bar.mean(high, |x| x.z) - bar.mean(low, |x| x.z)) / length - 1.0;
        let across = bar.spread((low + high) / 2) / spread - 1.0;
        errors.push(along / strain - 1.0);
        assert!((along / strain - 1.0).abs() < 0.03, "{n} nodes across: {along} for a strain of {strain}");
        assert!((-across / along - 0.25).abs() < 0.25 * 0.03, "{n} nodes across: ratio {}", -across / along);
    }
    // The remaining error is due to the nonlinearity in the strain.
    assert!(errors.iter().all(|error| error.abs() < 0.03), "{errors:?}");
}

#[test]
fn cantilever_converges_to_timoshenko_beam() {
    // P L^3/3 E I and the beam's shear, P L/(kappa G A) with kappa = 10 (1 + nu)/(12 + 11 nu) (G. R. Cowper, J. Appl. Mech.
    // 33 (1966) 335).
    let mut errors = Vec::new();
    for n in [3, 4, 6, 8] {
        let mut bar = Bar::new(n, 8, 0.02);
        let (w, l, nu) = (bar.width, bar.length, 0.25);
        let (inertia, area, g) = (w.powi(4) / 12.0, w * w, E / (2.0 * (1.0 + nu)));
        let kappa = 10.0 * (1.0 + nu) / (12.0 + 11.0 * nu);
        let flexibility = l.powi(3) / (3.0 * E * inertia) + l / (kappa * g * area);
        let p = 1e-3 * l / flexibility;
        let top = bar.nodes[2] - 1;
        let before = bar.mean(top, |x| x.x);
        bar.pull(DVec3::X * p);
        bar.rest();
        errors.push((bar.mean(top, |x| x.x) - before) / (p * flexibility) - 1.0);
    }
    // The excess stiffness falls with the square of the cell size, for 2, 3, 5 and 7 cells across.
    let [two, three, five, seven] = errors[..] else { unreachable!() };
    let rate = |fine: f64, coarse: f64, cells: (f64, f64)| (coarse / fine).ln() / (cells.1 / cells.0).ln();
    for (fine, coarse, cells) in
        [(three, two, (2.0, 3.0)), (five, three, (3.0, 5.0)), (seven, five, (5.0, 7.0))]
    {
        let order = rate(fine, coarse, cells);
        assert!((1.4..2.3).contains(&order), "of order {order}: {errors:?}");
    }
    assert!(seven.abs() < 0.035, "{errors:?}");
    let limit = (49.0 * seven - 25.0 * five) / (49.0 - 25.0);
    assert!(limit.abs() < 0.01, "extrapolated {limit}, {errors:?}");
}

#[test]
fn hanging_bar_stretches_by_the_closed_form() {
    let mut bar = Bar::new(4, 5, 0.02);
    let g = 0.5;
    bar.body.set_gravity(DVec3::Z * g).unwrap();
    let cells = bar.nodes[2] - 1;
    let (low, high) = (2 * cells / 5, 4 * cells / 5);
    let before = bar.mean(high, |x| x.z) - bar.mean(low, |x| x.z);
    bar.rest();
    // u(z) = rho g (L z - z^2/2)/E; the node masses approximate the distributed weight.
    let u = |k: usize| {
        let z = bar.length * k as f64 / cells as f64;
        1000.0 * g * (bar.length * z - 0.5 * z * z) / E
    };
    let stretched = bar.mean(high, |x| x.z) - bar.mean(low, |x| x.z) - before;
    assert!((stretched / (u(high) - u(low)) - 1.0).abs() < 0.03, "{stretched} m, not {} m", u(high) - u(low));
}

#[test]
fn rejects_invalid_loads() {
    let mut bar = Bar::new(3, 2, 0.02);
    let nodes = bar.body.network().node_count();
    bar.pull(DVec3::X);
    let before = bar.body.loads_n().to_vec();
    assert!(matches!(bar.body.set_loads(&before[1..]), Err(BodyError::Length { .. })));
    let mut bad = before.clone();
    bad[nodes - 1] = DVec3::NAN;
    assert_eq!(bar.body.set_loads(&bad), Err(BodyError::Load { node: nodes - 1 }));
    assert_eq!(bar.body.loads_n(), before);
}
