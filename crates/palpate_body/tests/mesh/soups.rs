//! Random triangle soups: each gives a body of the enclosed mass or an error, without a panic or a hang.
//!
//! ```sh
//! RUSTFLAGS="--cfg fuzzing" SOUPS=100000 cargo test --release -p palpate_body --test suite soups -- --ignored --nocapture
//! ```
//!
//! `SEED` is the seed of the first one; the others follow.

use glam::DVec3;
use palpate_body::*;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// A generator of `SplitMix64`.
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, bound: usize) -> usize {
        (self.bits() % bound.max(1) as u64) as usize
    }

    /// True in one of `of` cases.
    fn one_in(&mut self, of: usize) -> bool {
        self.below(of) == 0
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn of<T: Copy>(&mut self, values: &[T]) -> T {
        values[self.below(values.len())]
    }

    /// A coordinate around 0, on a grid in half of the cases.
    fn coordinate(&mut self, is_on_grid: bool) -> f64 {
        if is_on_grid { (self.below(9) as f64 - 4.0) / 4.0 } else { self.between(-1.0, 1.0) }
    }

    fn vector(&mut self, is_on_grid: bool) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|_| self.coordinate(is_on_grid)))
    }
}

#[derive(Default)]
struct Soup {
    vertices: Vec<DVec3>,
    triangles: Vec<[usize; 3]>,
}

impl Soup {
    /// Triangles of the grid of n × m quadrilaterals that `at` maps, with `closed_around` its last row joined with the first.
    fn grid(&mut self, [n, m]: [usize; 2], is_closed_around: bool, at: impl Fn(f64, f64) -> DVec3) {
        let first = self.vertices.len();
        for j in 0..=m {
            for i in 0..=n {
                self.vertices.push(at(i as f64 / n as f64, j as f64 / m as f64));
            }
        }
        for j in 0..m {
            for i in 0..n {
                let index = |i: usize, j: usize| {
                    let j = if is_closed_around { j % m } else { j };
                    first + i + (n + 1) * j
                };
                let [a, b, c, d] = [index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)];
                self.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
    }

    fn cuboid(&mut self, center: DVec3, half: DVec3) {
        let first = self.vertices.len();
        let sign = |i: usize, axis: usize| if i >> axis & 1 == 1 { 1.0 } else { -1.0 };
        self.vertices.extend((0..8).map(|i| center + half * DVec3::new(sign(i, 0), sign(i, 1), sign(i, 2))));
        let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        for [a, b, c, d] in faces {
            self.triangles.extend([[a, b, c], [a, c, d]].map(|t| t.map(|corner| first + corner)));
        }
    }

    fn add(&mut self, random: &mut Random) {
        let is_on_grid = random.one_in(2);
        let (begin, center) = (self.triangles.len(), random.vector(is_on_grid));
        let half = DVec3::from_array(std::array::from_fn(|_| {
            if is_on_grid { (1 + random.below(4)) as f64 / 4.0 } else { random.between(0.001, 1.0) }
        }));
        match random.below(9) {
            0 => {
                let first = self.vertices.len();
                let count = 3 + random.below(30);
                self.vertices.extend((0..count).map(|_| random.vector(is_on_grid)));
                for _ in 0..=random.below(60) {
                    self.triangles.push(std::array::from_fn(|_| first + random.below(count)));
                }
            }
            // The same cuboids several times: side by side, edge to edge, within each other, and opposite.
            1 | 2 => {
                for _ in 0..=random.below(3) {
                    let beside =
                        DVec3::from_array(std::array::from_fn(|_| random.of(&[-2.0, -1.0, 0.0, 0.0, 2.0])));
                    self.cuboid(center + beside * half, random.of(&[1.0, 1.0, 0.5, 0.999]) * half);
                }
            }
            3 => {
                let (n, m) = (2 + random.below(10), 3 + random.below(12));
                self.grid([n, m], true, |u, v| {
                    let (sin, cos) = (std::f64::consts::PI * u).sin_cos();
                    let (east, north) = (std::f64::consts::TAU * v).sin_cos();
                    center + half * DVec3::new(sin * north, cos, sin * east)
                });
            }
            // A tube without ends, a flat or curved sheet, and a cone that ends in a needle.
            4 => self.grid([1 + random.below(6), 3 + random.below(9)], true, |u, v| {
                let (sin, cos) = (std::f64::consts::TAU * v).sin_cos();
                center + half * DVec3::new(cos, 2.0 * u - 1.0, sin)
            }),
            5 => {
                let bend = random.of(&[0.0, 0.3, 2.0]);
                self.grid([1 + random.below(9), 1 + random.below(9)], false, |u, v| {
                    center + half * DVec3::new(2.0 * u - 1.0, bend * (5.0 * u * v).sin(), 2.0 * v - 1.0)
                });
            }
            6 => {
                let thin = random.of(&[1e-9, 1e-6, 1e-4, 1e-2]);
                self.cuboid(center, half * DVec3::new(1.0, thin, 1.0));
            }
            7 => {
                let thin = random.of(&[1e-9, 1e-6, 1e-3]);
                self.cuboid(center, half * DVec3::new(thin, thin, 1.0));
            }
            _ => {
                let first = self.vertices.len();
                self.vertices.extend((0..4).map(|_| random.vector(is_on_grid)));
                self.triangles.extend(
                    [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]].map(|t| t.map(|corner| first + corner)),
                );
            }
        }
        if random.one_in(4) {
            self.triangles[begin..].iter_mut().for_each(|t| t.swap(1, 2));
        }
    }

    /// Damages some triangles and vertices.
    fn damage(&mut self, random: &mut Random) {
        for _ in 0..random.below(4) {
            let (triangle, vertex) = (random.below(self.triangles.len()), random.below(self.vertices.len()));
            match random.below(10) {
                0 => self.triangles.truncate(triangle + 1),
                1 => drop(self.triangles.swap_remove(triangle)),
                2 => self.triangles.push(self.triangles[triangle]),
                3 => self.triangles[triangle].swap(0, 1),
                4 => self.triangles[triangle][random.below(3)] = vertex,
                5 => self.vertices[vertex] = self.vertices[random.below(self.vertices.len())],
                6 => self.vertices[vertex] += 1e-6 * random.vector(false),
                7 => self.vertices[vertex] += 0.3 * random.vector(false),
                // A mirrored copy.
                8 if self.triangles.len() < 250 => {
                    let (axis, first) = (random.below(3), self.vertices.len());
                    let mirrored: Vec<DVec3> = self
                        .vertices
                        .iter()
                        .map(|x| {
                            let mut x = *x;
                            x[axis] = -x[axis];
                            x
                        })
                        .collect();
                    self.vertices.extend(mirrored);
                    let copies: Vec<[usize; 3]> =
                        self.triangles.iter().map(|[a, b, c]| [first + a, first + c, first + b]).collect();
                    self.triangles.extend(copies);
                }
                // Separate corners.
                _ => {
                    self.vertices =
                        self.triangles.iter().flatten().map(|vertex| self.vertices[*vertex]).collect();
                    self.triangles =
                        (0..self.triangles.len()).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
                }
            }
            if self.triangles.is_empty() {
                return;
            }
        }
        if random.one_in(60) {
            let value = random.of(&[f64::NAN, f64::INFINITY, -0.0, 1e-30, 1e30, -1e38, 1e7]);
            let vertex = random.below(self.vertices.len());
            self.vertices[vertex][random.below(3)] = value;
        }
        if random.one_in(60) {
            let triangle = random.below(self.triangles.len());
            self.triangles[triangle][random.below(3)] = random.of(&[self.vertices.len(), usize::MAX]);
        }
    }
}

fn parts(random: &mut Random) -> Vec<MeshPart> {
    let size = match random.below(12) {
        0 => 10_f64.powf(random.between(-30.0, 30.0)),
        1 => 10.0,
        2 => 1e-3,
        _ => random.of(&[0.1, 0.125, 0.05]),
    };
    let far = if random.one_in(20) { size * 10_f64.powf(random.between(0.0, 7.0)) } else { 0.0 };
    let count = 1 + random.below(12).saturating_sub(9);
    let part = |_| {
        let mut soup = Soup::default();
        for _ in 0..=random.below(4) {
            soup.add(random);
        }
        soup.damage(random);
        MeshPart {
            vertices: soup.vertices.iter().map(|x| (size * *x + far).as_vec3().to_array()).collect(),
            triangles: soup.triangles,
            normals: None,
        }
    };
    (0..count).map(part).collect()
}

fn options(random: &mut Random) -> JoinOptions {
    let thickness_m = match random.below(8) {
        0..4 => None,
        4..7 => Some(10_f64.powf(random.between(-3.5, -0.5))),
        _ => Some(random.of(&[f64::NAN, -0.01, 0.0, -0.0, 1e-30, 1e30, f64::INFINITY])),
    };
    let closing = if random.one_in(8) { MeshClosing::Strict } else { MeshClosing::Enclose { thickness_m } };
    let pieces = match random.below(4) {
        0 => PieceSelection::All,
        1 => PieceSelection::Index(random.below(3)),
        _ => PieceSelection::Largest,
    };
    let cells = match random.below(20) {
        0 => CellSize::Along(random.of(&[0, 50, 100, 1000, usize::MAX])),
        1 => CellSize::Side(random.of(&[f64::NAN, 0.0, -1.0, 1e-30, 1e30, f64::INFINITY])),
        2..4 => CellSize::Side(10_f64.powf(random.between(-3.0, 0.0))),
        _ => CellSize::Along(1 + random.below(20)),
    };
    let scale_m =
        if random.one_in(40) { random.of(&[0.0, -1.0, f64::NAN, f64::INFINITY, 1e-3, 1e3]) } else { 1.0 };
    JoinOptions { scale_m, closing, pieces, cells }
}

/// Builds the body of the soup `seed`, and checks it.
pub fn build(seed: u64) -> Result<(), BodyError> {
    let random = &mut Random(seed);
    let parts = parts(random);
    let options = options(random);
    let joined = JoinedMesh::new(&parts, options)?;
    let mesh = &joined.mesh;
    let volume_m3 = mesh.volume_m3();
    assert!(volume_m3 > 0.0 && volume_m3.is_finite(), "the volume is {volume_m3} m³");
    assert!(joined.piece_share > 0.0 && joined.piece_share <= 1.0, "{}", joined.piece_share);
    let lattice = CellLattice::fit(mesh, options.cells)?;
    let face = random.of(&[Face::NegX, Face::PosX, Face::NegY, Face::PosY, Face::NegZ, Face::PosZ]);
    let mut lattice =
        if random.one_in(3) { lattice.allow_unconstrained() } else { lattice.fix_base(face, 0.2) };
    if random.one_in(3) {
        for region in &joined.regions {
            lattice = lattice.region(region.clone(), Tissue { youngs_modulus_pa: 50e3, ..Tissue::default() });
        }
    }
    let tissue = Tissue::default();
    let made = lattice.tissue(&tissue)?;
    let masses_kg = made.network.mass_kg();
    assert!(masses_kg.iter().all(|mass_kg| *mass_kg > 0.0 && mass_kg.is_finite()));
    let expected_kg = tissue.density_kg_per_m3 * volume_m3 * (1.0 + made.cells.raised_share);
    let mass_kg: f64 = masses_kg.iter().sum();
    // A surface that is extracted from samples may fold over by less than their spacing. Fuzzing has too few samples to check it.
    let folded = if cfg!(fuzzing) { f64::INFINITY } else { 5e-3 };
    let tolerance = if mesh.assumptions().is_none() { 1e-9 } else { folded };
    assert!((mass_kg / expected_kg - 1.0).abs() < tolerance, "{mass_kg} kg instead of {expected_kg} kg");
    for point in &made.surface.points {
        let sum: f64 = point.nodes().iter().map(|(_, weight)| weight).sum();
        assert!((sum - 1.0).abs() < 1e-9, "the weights of a point sum to {sum}");
    }
    let mut edges: BTreeMap<[usize; 2], i64> = BTreeMap::new();
    for triangle in 0..made.surface.triangles.len() {
        let [a, b, c] = made.surface.corners(triangle);
        for (from, to) in [(a, b), (b, c), (c, a)] {
            *edges.entry([from.min(to), from.max(to)]).or_default() += if from < to { 1 } else { -1 };
        }
    }
    assert!(edges.values().all(|sum| *sum == 0), "the touched surface has holes");
    assert!(made.deviation_m.is_finite());
    let body = Body::new(made.network, made.surface)?;
    assert!(body.positions_m().iter().all(|x| x.is_finite()));
    Ok(())
}

/// Builds `count` soups from `first` on.
///
/// # Panics
/// If one of them does, or makes a body that is not right.
#[expect(
    clippy::disallowed_methods,
    clippy::print_stdout,
    reason = "reports the slowest input; nothing depends on it"
)]
pub fn run(first: u64, count: u64) {
    let (mut slowest, mut failed) = ((Duration::ZERO, 0), Vec::new());
    let mut results: BTreeMap<String, usize> = BTreeMap::new();
    for seed in first..first + count {
        let start = Instant::now();
        let result = match std::panic::catch_unwind(|| build(seed)) {
            Ok(Ok(())) => "a body".into(),
            Ok(Err(error)) => {
                let name = format!("{error:?}");
                name.split([' ', '{']).next().unwrap_or_default().to_owned()
            }
            Err(_) => {
                println!("seed {seed}");
                failed.push(seed);
                "a panic".into()
            }
        };
        *results.entry(result).or_default() += 1;
        slowest = slowest.max((start.elapsed(), seed));
    }
    println!(
        "{count} soups: {results:?}; the slowest took {:.2} s, seed {}",
        slowest.0.as_secs_f64(),
        slowest.1
    );
    assert_eq!(failed, [] as [u64; 0]);
}

#[test]
fn soups_give_a_body_of_the_enclosed_mass_or_an_error() {
    run(11, 12);
}

#[test]
#[ignore = "takes hours; a smaller number is SOUPS=…"]
fn many_soups_give_a_body_of_the_enclosed_mass_or_an_error() {
    let number = |name: &str, default: u64| std::env::var(name).map_or(default, |text| text.parse().unwrap());
    run(number("SEED", 1_000_000), number("SOUPS", 100_000));
}
