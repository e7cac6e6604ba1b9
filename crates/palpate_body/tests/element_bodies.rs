//! Bodies of elements for tests, their statics and their natural frequencies.

use glam::DVec3;
use palpate_body::*;

/// A family of elements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Family {
    Hexahedra,
    Tetrahedra,
}

impl Family {
    /// A body of a block filled with `tissue`.
    pub fn body(self, block: &Block, tissue: &Tissue) -> Body {
        let made = match self {
            Self::Hexahedra => block.elements(tissue),
            Self::Tetrahedra => block.tetrahedra(tissue),
        };
        let made = made.unwrap();
        Body::new(made.network, made.surface).unwrap()
    }
}

pub const E: f64 = 20e3;

pub fn tissue(law: ElasticLaw, poissons_ratio: f64) -> Tissue {
    Tissue { youngs_modulus_pa: E, poissons_ratio, law, ..Tissue::default() }
}

pub const LINEAR: ElasticLaw = ElasticLaw::CorotationalLinear;

pub fn newton(body: &mut Body, steps: usize) {
    let solver = LinearSolver::Cholesky;
    let newton = LinearlyImplicitEuler { tick_s: 1e4, solver, ..LinearlyImplicitEuler::default() };
    body.advance(None, steps, newton).unwrap();
}

/// Case 2 and 6a: a cube of 0.1 m, bonded at its bottom and at its top, which is lowered by `down_m`. The force on the top, N.
pub fn bonded_cube(family: Family, cells: usize, tissue: &Tissue, down_m: f64) -> f64 {
    let block = Block::new([cells + 1; 3], DVec3::splat(0.1)).unwrap().fix(Face::NegZ).fix(Face::PosZ);
    let mut body = family.body(&block, tissue);
    let rest = body.positions_m().to_vec();
    let is_top = |x: &DVec3| x.z > 0.05 - 1e-9;
    let steps = if down_m < 2e-3 { 1 } else { 4 };
    for step in 1..=steps {
        let share = f64::from(step) / f64::from(steps);
        let before = body.positions_m().to_vec();
        let x: Vec<DVec3> = rest
            .iter()
            .zip(before)
            .map(|(rest, now)| if is_top(rest) { *rest - share * down_m * DVec3::Z } else { now })
            .collect();
        body.set_state(&x, &vec![DVec3::ZERO; x.len()]).unwrap();
        newton(&mut body, 6);
    }
    let mut force = vec![DVec3::ZERO; rest.len()];
    body.internal_forces_n(&mut force);
    rest.iter().zip(force).filter(|(x, _)| is_top(x)).map(|(_, f)| f.z).sum()
}

/// The cantilever of cases 3 and 6b: 0.1 m × 0.02 m × 0.02 m along x, clamped at its lower end.
pub fn cantilever(family: Family, cells: usize, tissue: &Tissue) -> (Body, Vec<(usize, f64)>) {
    let across = (cells as f64 / 5.0).round() as usize;
    let block = Block::new([cells + 1, across + 1, across + 1], DVec3::new(0.1, 0.02, 0.02)).unwrap();
    let body = family.body(&block.fix(Face::NegX), tissue);
    let on_edge = |x: f64| if x.abs() > 0.01 - 1e-9 { 0.5 } else { 1.0 };
    // Weights of the nodes of the end face in its mean.
    let end = body.network().rest_m().iter().enumerate().filter(|(_, x)| x.x > 0.05 - 1e-9);
    let total = (across * across) as f64;
    let weights = end.map(|(node, x)| (node, on_edge(x.y) * on_edge(x.z) / total)).collect();
    (body, weights)
}

/// Mean displacement of the end of a cantilever under `load_n`, applied in `steps`, m.
pub fn end_deflection(family: Family, cells: usize, tissue: &Tissue, load_n: DVec3, steps: usize) -> DVec3 {
    let (mut body, end) = cantilever(family, cells, tissue);
    for step in 1..=steps {
        let mut loads = vec![DVec3::ZERO; body.network().node_count()];
        end.iter().for_each(|&(node, w)| loads[node] = load_n * (w * step as f64 / steps as f64));
        body.set_loads(&loads).unwrap();
        newton(&mut body, 6);
    }
    let moved = |node: usize| body.positions_m()[node] - body.network().rest_m()[node];
    end.iter().map(|&(node, w)| w * moved(node)).sum()
}

/// Lowest natural frequency, Hz, by inverse iteration with static solutions from `start`.
pub fn frequency_hz(body: &mut Body, start: impl Fn(DVec3) -> DVec3) -> f64 {
    const SIZE_M: f64 = 1e-9;
    let (rest, mass) = (body.network().rest_m().to_vec(), body.network().mass_kg().to_vec());
    let mut u: Vec<DVec3> = rest.iter().map(|x| start(*x)).collect();
    let mut rate2 = 0.0_f64;
    for _ in 0..6 {
        let form = |u: &[DVec3]| u.iter().zip(&mass).map(|(u, m)| m * u.length_squared()).sum::<f64>();
        let size = SIZE_M / u.iter().map(|u| u.length()).fold(0.0, f64::max);
        // About the square of the frequency: the response is as small as the shape.
        let scale = size * rate2.max(10.0);
        let loads: Vec<DVec3> = u.iter().zip(&mass).map(|(u, m)| scale * *m * *u).collect();
        body.set_state(&rest, &vec![DVec3::ZERO; rest.len()]).unwrap();
        body.set_loads(&loads).unwrap();
        newton(body, 1);
        let next: Vec<DVec3> =
            body.positions_m().iter().zip(&rest).map(|(x, rest)| (*x - *rest) / scale).collect();
        let between: f64 = next.iter().zip(&u).zip(&mass).map(|((a, b), m)| m * a.dot(*b)).sum();
        rate2 = between / form(&next);
        u = next;
    }
    rate2.sqrt() / std::f64::consts::TAU
}

/// A block of cells of 1 cm with the given nodes, its bottom fixed.
pub fn block(family: Family, nodes: [usize; 3], tissue: &Tissue) -> Body {
    let size = DVec3::from_array(nodes.map(|n| 0.01 * (n - 1) as f64));
    family.body(&Block::new(nodes, size).unwrap().fix(Face::NegZ), tissue)
}

/// Numbers from 0 to 1.
pub struct Random(pub u64);

impl Random {
    pub fn number(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn vector(&mut self) -> DVec3 {
        DVec3::new(self.number(), self.number(), self.number())
    }
}

/// Every law with every ratio.
pub fn tissues() -> impl Iterator<Item = Tissue> {
    let laws = [LINEAR, ElasticLaw::NeoHookean].into_iter();
    laws.flat_map(|law| [0.0, 0.25, 0.45, 0.49].map(|nu| tissue(law, nu)))
}

/// Moves all free nodes of `body` to places that depend on their place at rest.
pub fn set_places(body: &mut Body, mut place: impl FnMut(DVec3) -> DVec3) {
    let network = body.network();
    let places = network.rest_m().iter().enumerate();
    let x: Vec<DVec3> = places.map(|(node, x)| if network.is_fixed(node) { *x } else { place(*x) }).collect();
    body.set_state(&x, &vec![DVec3::ZERO; x.len()]).unwrap();
}

pub fn off_m(body: &Body) -> f64 {
    let pairs = body.positions_m().iter().zip(body.network().rest_m());
    pairs.map(|(x, rest)| x.distance(*rest)).fold(0.0, f64::max)
}

/// Releases `body` and advances by at most 10 s, until it is within `within_m` of rest.
pub fn returns(body: &mut Body, within_m: f64) {
    for _ in 0..100 {
        let report = body.advance(None, 100, SemiImplicitEuler::default()).unwrap();
        if report.inverted_cells == 0 && off_m(body) < within_m {
            return;
        }
    }
    let inverted = body.inverted_cells().count() + body.inverted_tetrahedra().count();
    panic!("{} m from rest, {inverted} inverted", off_m(body));
}

pub fn relaxing(nu: f64) -> Tissue {
    let relaxation =
        Relaxation::new(&[PronyTerm { share: 0.3, time_s: 0.05 }, PronyTerm { share: 0.2, time_s: 0.4 }]);
    Tissue { relaxation: relaxation.unwrap(), ..tissue(ElasticLaw::NeoHookean, nu) }
}
