//! Surfaces with inward triangles, some or all of them: they are flipped when the body is created.

use glam::DVec3;
use palpate_body::*;
use palpate_laws::ForceLaw;
use proptest::prelude::*;
use std::collections::{HashMap, HashSet};

const RADIUS: f64 = 0.005;

fn block(nodes: [usize; 3], is_tissue: bool) -> (Network, Surface) {
    let size = DVec3::from_array(nodes.map(|n| 0.02 * (n - 1) as f64));
    let block = Block::new(nodes, size).unwrap().fix(Face::NegZ);
    let lattice = UniformLattice { stiffness_n_per_m: 100.0, damping_ratio: 0.7, mass_kg: 1.0 };
    let tissue = Tissue {
        youngs_modulus_pa: 20e3,
        density_kg_per_m3: 1000.0,
        damping: Damping::Ratio(0.5),
        ..Tissue::SOFT
    };
    let made = if is_tissue { block.tissue(&tissue) } else { block.uniform(&lattice) }.unwrap();
    (made.network, made.surface)
}

fn body(network: &Network, surface: Surface) -> Body {
    Body::new(network.clone(), surface).unwrap()
}

/// `surface` with the winding of the triangles flipped for which `turns` holds.
fn turned(surface: &Surface, turns: impl Fn(usize) -> bool) -> Surface {
    let mut surface = surface.clone();
    surface.triangles.iter_mut().enumerate().filter(|(t, _)| turns(*t)).for_each(|(_, t)| t.swap(1, 2));
    surface
}

/// Forces on a ball that moves 4 mm deep into the top at (x, y).
fn press(mut body: Body, top_m: f64, [x, y]: [f64; 2]) -> Vec<DVec3> {
    let mut tool = ToolContact::touch(ToolShape::Sphere { radius_m: RADIUS }, 0.3).unwrap();
    let depth = |i: usize| (2e-4 * i as f64 - 1e-3).min(4e-3);
    let at = |i: usize| ToolPoint::at_rest(DVec3::new(x, y, top_m + RADIUS - depth(i)));
    let (path, mut forces): (Vec<_>, _) = ((0..=40).map(at).collect(), Vec::new());
    let integrator = SemiImplicitEuler::default();
    body.advance_observed(Some((&mut tool, &path)), 40, integrator, |_, f| forces.push(f)).unwrap();
    forces
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    /// Each triangle with any order of its corners.
    #[test]
    fn block_forces_do_not_depend_on_the_winding(
        nodes in prop::array::uniform3(3_usize..6),
        orders in prop::collection::vec(0_usize..6, 300),
        inward in 0_usize..4,
        is_tissue: bool,
        place in prop::array::uniform2(-0.015..0.015),
    ) {
        let (network, surface) = block(nodes, is_tissue);
        let top_m = 0.01 * (nodes[2] - 1) as f64;
        let expected = press(body(&network, surface.clone()), top_m, place);
        let mut given = surface.clone();
        for (t, order) in given.triangles.iter_mut().zip(orders.iter().cycle()) {
            t.rotate_left(order % 3);
            // In one of four cases all triangles face inward.
            if inward == 0 || order / 3 == 1 {
                t.swap(1, 2);
            }
        }
        let made = body(&network, given.clone());
        for ((made, given), surface) in made.surface().triangles.iter().zip(&given.triangles).zip(&surface.triangles) {
            prop_assert_eq!(made[0], given[0]);
            let first = surface.iter().position(|vertex| *vertex == made[0]).unwrap();
            prop_assert_eq!([0, 1, 2].map(|i| surface[(first + i) % 3]), *made);
        }
        let peak = expected.iter().map(|f| f.length()).fold(0.0, f64::max);
        prop_assert!(peak > 0.05, "{peak} N");
        for (force, expected) in press(made, top_m, place).iter().zip(&expected) {
            prop_assert!(force.distance(*expected) <= 1e-9 * peak, "{force} N, not {expected} N");
        }
    }
}

/// An inverted surface used to give 0 N.
#[test]
fn inverted_surface_gives_the_same_forces() {
    let (network, surface) = block([6; 3], true);
    let given = turned(&surface, |_| true);
    assert_eq!(body(&network, given.clone()).surface(), &surface);
    assert_eq!(body(&network, surface.clone()).surface(), &surface);
    let force = press(body(&network, given), 0.05, [0.004, 0.001])[39];
    assert!(force.z > 0.4, "{force} N");
}

fn all(size: i32) -> impl Iterator<Item = [i32; 3]> {
    let line = move || 0..size;
    line().flat_map(move |x| line().flat_map(move |y| line().map(move |z| [x, y, z])))
}

/// Whether two cubes adjacent to the gap `c`, in a grid of 4, share nothing but an edge.
fn touches_along_an_edge(c: [i32; 3], is_cube: impl Fn([i32; 3]) -> bool) -> bool {
    let is_in = |c: [i32; 3]| c.iter().all(|i| (0..4).contains(i)) && is_cube(c);
    let steps = || [(0, 1), (0, -1), (1, 1), (1, -1), (2, 1), (2, -1)].into_iter();
    let to = |mut c: [i32; 3], (axis, by): (usize, i32)| {
        c[axis] += by;
        c
    };
    steps()
        .any(|i| steps().any(|j| i.0 != j.0 && is_in(to(c, i)) && is_in(to(c, j)) && !is_in(to(to(c, i), j))))
}

/// A hand-made body of cubes on a grid of 1 cm: a node at every corner, springs between all corners of a cube, and
/// the faces without an adjacent cube, counter-clockwise as seen from outside.
struct Cubes {
    network: Network,
    surface: Surface,
    /// Centre of the face of each triangle, in halves of a cube.
    faces: Vec<[i32; 3]>,
}

impl Cubes {
    fn new(size: i32, is_cube: impl Fn([i32; 3]) -> bool) -> Self {
        let is_in = |c: [i32; 3]| c.iter().all(|i| (0..size).contains(i)) && is_cube(c);
        let (mut builder, mut nodes, mut springs) = (NetworkBuilder::new(), HashMap::new(), HashSet::new());
        let (mut triangles, mut faces) = (Vec::new(), Vec::new());
        for [x, y, z] in all(size).filter(|c| is_in(*c)) {
            let mut node = |at: [i32; 3]| {
                let place = 0.01 * DVec3::from_array(at.map(f64::from));
                *nodes.entry(at).or_insert_with(|| builder.node(place, 1e-3))
            };
            let corner =
                [0, 1, 2, 3, 4, 5, 6, 7].map(|c| node([x + (c & 1), y + (c >> 1 & 1), z + (c >> 2)]));
            for (a, b) in (0..8).flat_map(|a| (0..a).map(move |b| (corner[a], corner[b]))) {
                if springs.insert((a.min(b), a.max(b))) {
                    builder.spring(a, b, ForceLaw::Linear { stiffness_n_per_m: 30.0 }, 0.05);
                }
            }
            for axis in 0..3 {
                for side in [0, 1] {
                    let mut beside = [x, y, z];
                    beside[axis] += 2 * side - 1;
                    if is_in(beside) {
                        continue;
                    }
                    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                    let around = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[p, q]| {
                        let mut at = [0; 3];
                        (at[axis], at[u], at[v]) = (side as usize, p, q);
                        corner[at[0] + 2 * at[1] + 4 * at[2]]
                    });
                    let [a, b, c, d] =
                        if side == 1 { around } else { [around[3], around[2], around[1], around[0]] };
                    triangles.extend([[a, b, c], [a, c, d]]);
                    let mut middle = [x, y, z].map(|i| 2 * i + 1);
                    middle[axis] += 2 * side - 1;
                    faces.extend([middle; 2]);
                }
            }
        }
        let fixed: Vec<usize> = nodes.iter().filter(|(at, _)| at[2] == 0).map(|(_, &node)| node).collect();
        let points: Vec<_> = (0..nodes.len()).map(BodyPoint::node).collect();
        let surface = Surface { vertices: (0..points.len()).collect(), points, triangles };
        Self { network: builder.fix(fixed).allow_unconstrained().build().unwrap(), surface, faces }
    }

    /// The surface of the triangles whose face centres are `within`.
    fn part(&self, within: impl Fn([i32; 3]) -> bool) -> Surface {
        let kept = self.surface.triangles.iter().zip(&self.faces).filter(|(_, face)| within(**face));
        Surface { triangles: kept.map(|(t, _)| *t).collect(), ..self.surface.clone() }
    }

    /// Checks that the triangles of `surface` face outward again after those with `turns` are flipped.
    #[track_caller]
    fn check(&self, surface: &Surface, turns: impl Fn(usize) -> bool) {
        let made = body(&self.network, turned(surface, turns));
        assert_eq!(made.surface(), surface);
    }
}

/// Faces of the cavity of one cube in a hollow cube of 5.
fn is_in_cavity(face: [i32; 3]) -> bool {
    face.iter().all(|i| (4..=6).contains(i))
}

fn hollow() -> Cubes {
    Cubes::new(5, |cube| cube != [2; 3])
}

#[test]
fn flips_any_single_triangle() {
    let cubes = Cubes::new(3, |_| true);
    (0..cubes.surface.triangles.len()).for_each(|t| cubes.check(&cubes.surface, |other| other == t));
}

#[test]
fn flips_one_of_two_shells() {
    let cubes = Cubes::new(5, |[x, ..]| x != 2);
    for side in [true, false] {
        cubes.check(&cubes.surface, |t| (cubes.faces[t][0] < 5) == side);
    }
    // A cube connected by only two of its nodes: their edge has four triangles.
    let cubes = Cubes::new(2, |[x, y, z]| z == 0 && x == y);
    for side in [true, false] {
        cubes.check(&cubes.surface, |t| (cubes.faces[t][0] <= 2) == side);
    }
}

#[test]
fn cavity_faces_inward_with_and_without_outer_surface() {
    let cubes = hollow();
    cubes.check(&cubes.surface, |_| true);
    cubes.check(&cubes.surface, |t| is_in_cavity(cubes.faces[t]));
    cubes.check(&cubes.surface, |t| !is_in_cavity(cubes.faces[t]));
    let cavity = cubes.part(is_in_cavity);
    assert_eq!(cavity.triangles.len(), 12);
    cubes.check(&cavity, |_| false);
    cubes.check(&cavity, |_| true);
    // In a wall one cube thick all nodes are on the surface.
    let thin = Cubes::new(3, |cube| cube != [1; 3]);
    thin.check(&thin.surface, |t| t % 3 == 0);
}

/// The points of a part lie inside cells, with nodes on both sides: the enclosed volume decides.
#[test]
fn nested_shells_alternate_their_orientation() {
    let (network, _) = block([9; 3], false);
    let shell = |half: f64, first: usize| {
        let corner = |c: usize| half * DVec3::new(sign(c & 1), sign(c >> 1 & 1), sign(c >> 2));
        let points: Vec<BodyPoint> = (0..8).map(|c| embedded(&network, corner(c))).collect();
        let sides = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let triangles: Vec<[usize; 3]> = sides
            .iter()
            .flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]])
            .map(|t| t.map(|v| v + first))
            .collect();
        (points, triangles)
    };
    let mut surface = Surface::default();
    for (index, half) in [0.075, 0.055, 0.031].into_iter().enumerate() {
        let (points, mut triangles) = shell(half, 8 * index);
        surface.points.extend(points);
        if index == 1 {
            triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        surface.triangles.extend(triangles);
    }
    surface.vertices = (0..24).collect();
    for turns in 0..8 {
        assert_eq!(body(&network, turned(&surface, |t| turns >> (t / 12) & 1 == 1)).surface(), &surface);
    }
}

fn sign(bit: usize) -> f64 {
    if bit == 0 { -1.0 } else { 1.0 }
}

/// A point in a block of cells of 2 cm, carried by the nodes of its cell.
fn embedded(network: &Network, place_m: DVec3) -> BodyPoint {
    let weight = |x: DVec3| {
        let t = DVec3::ONE - ((x - place_m) / 0.02).abs();
        if t.min_element() > 0.0 { t.element_product() } else { 0.0 }
    };
    let nodes = network.rest_m().iter().map(|x| weight(*x)).enumerate().filter(|(_, w)| *w > 0.0);
    BodyPoint::new(nodes.collect()).unwrap()
}

#[test]
fn an_open_sheet_faces_away_from_the_tissue() {
    let cubes = Cubes::new(4, |_| true);
    let top = cubes.part(|face| face[2] == 8);
    for turns in [|_| true, |t| t % 2 == 0, |t| t == 3, |_| false] {
        cubes.check(&top, turns);
    }
    // All faces but the bottom, with a hole.
    let open = cubes.part(|face| face[2] != 0 && face != [8, 3, 3]);
    cubes.check(&open, |_| true);
    // Carried by the nodes of cells, some above it and more below.
    let (network, _) = block([6, 6, 4], true);
    let at = |i: usize, j: usize| DVec3::new(0.03 * i as f64 - 0.03, 0.03 * j as f64 - 0.03, 0.019);
    let points: Vec<_> = (0..9).map(|n| embedded(&network, at(n % 3, n / 3))).collect();
    let fields = [0, 1, 3, 4].map(|a| [[a, a + 1, a + 4], [a, a + 4, a + 3]]);
    let sheet = Surface { vertices: (0..9).collect(), points, triangles: fields.concat() };
    assert_eq!(body(&network, turned(&sheet, |_| true)).surface(), &sheet);
    assert_eq!(body(&network, turned(&sheet, |t| t == 0)).surface(), &sheet);
}

/// A sheet of one layer of nodes, curved as a dome: either side may be touched.
#[test]
fn membrane_keeps_the_majority_of_its_windings() {
    let mut builder = NetworkBuilder::new();
    for (i, j) in (0..5).flat_map(|i| (0..5).map(move |j| (i, j))) {
        let (x, y) = (0.01 * f64::from(i) - 0.02, 0.01 * f64::from(j) - 0.02);
        builder.node(DVec3::new(x, y, -20.0 * (x * x + y * y)), 1e-3);
    }
    let law = ForceLaw::Linear { stiffness_n_per_m: 30.0 };
    let mut triangles = Vec::new();
    for (i, j) in (0..5).flat_map(|i| (0..5).map(move |j| (i, j))) {
        let at = 5 * i + j;
        if i < 4 {
            builder.spring(at, at + 5, law, 0.05);
        }
        if j < 4 {
            builder.spring(at, at + 1, law, 0.05);
        }
        if i < 4 && j < 4 {
            triangles.extend([[at, at + 5, at + 6], [at, at + 6, at + 1]]);
        }
    }
    // The dome hangs on a rope.
    let hook = builder.node(DVec3::Z * 0.1, 1e-3);
    builder.spring(0, hook, law, 0.05);
    let network = builder.fix([hook]).build().unwrap();
    let up =
        Surface { points: (0..25).map(BodyPoint::node).collect(), vertices: (0..25).collect(), triangles };
    let down = turned(&up, |_| true);
    for side in [&up, &down] {
        assert_eq!(body(&network, side.clone()).surface(), side);
        assert_eq!(body(&network, turned(side, |t| t % 4 == 1)).surface(), side);
    }
    // Both sides at once.
    let both = Surface { triangles: [&up.triangles[..], &down.triangles[..]].concat(), ..up.clone() };
    assert_eq!(body(&network, both.clone()).surface(), &both);
}

/// Repeated corners, coincident points and slivers have no orientation of their own.
#[test]
fn degenerate_triangles_stay_and_have_no_effect() {
    let cubes = Cubes::new(3, |_| true);
    let mut surface = cubes.surface.clone();
    let [a, b, c] = surface.triangles[0];
    surface.triangles.extend([[a, a, b], [c; 3], [b, c, b]]);
    cubes.check(&surface, |t| t < 50);
    // Separate points for every vertex: still one surface.
    let mut split = cubes.surface.clone();
    split.points = split.triangles.iter().flatten().map(|&v| BodyPoint::node(v)).collect();
    split.vertices = (0..split.points.len()).collect();
    split.triangles = (0..split.triangles.len()).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    cubes.check(&split, |t| t % 5 < 2);
    // A repeated triangle: the edges around it have three triangles.
    let mut twice = cubes.surface.clone();
    twice.triangles.push(twice.triangles[7]);
    cubes.check(&twice, |_| true);
    assert_eq!(body(&cubes.network, Surface::default()).surface(), &Surface::default());
}

/// All nodes lie on the surface, as in a balloon.
#[test]
fn shell_without_inner_nodes_faces_outward() {
    let mut builder = NetworkBuilder::new();
    let nodes: Vec<usize> = (0..6)
        .map(|i| builder.node(DVec3::AXES[i / 2] * if i % 2 == 0 { 0.02 } else { -0.02 }, 1e-3))
        .collect();
    let law = ForceLaw::Linear { stiffness_n_per_m: 30.0 };
    for (a, b) in (0..6).flat_map(|a| (0..a).map(move |b| (a, b))).filter(|(a, b)| a / 2 != b / 2) {
        builder.spring(nodes[a], nodes[b], law, 0.05);
    }
    let network = builder.fix([0]).build().unwrap();
    let octants = (0..8_usize).map(|o| {
        let [a, b, c] = [o & 1, 2 + (o >> 1 & 1), 4 + (o >> 2)];
        if o.count_ones() % 2 == 0 { [a, b, c] } else { [a, c, b] }
    });
    let points = (0..6).map(BodyPoint::node).collect();
    let surface = Surface { points, vertices: (0..6).collect(), triangles: octants.collect() };
    for turns in 0..256 {
        assert_eq!(body(&network, turned(&surface, |t| turns >> t & 1 == 1)).surface(), &surface);
    }
}

#[test]
fn rejects_a_moebius_strip() {
    let mut builder = NetworkBuilder::new();
    let law = ForceLaw::Linear { stiffness_n_per_m: 30.0 };
    for i in 0..10 {
        let (angle, half) =
            (0.2 * std::f64::consts::PI * f64::from(i / 2 * 2), if i % 2 == 0 { 0.005 } else { -0.005 });
        let (sin, cos) = angle.sin_cos();
        let (lift, out) = (0.5 * angle).sin_cos();
        builder.node(DVec3::new((0.03 + half * out) * cos, (0.03 + half * out) * sin, half * lift), 1e-3);
    }
    (0..9).for_each(|i| {
        builder.spring(i, i + 1, law, 0.05);
    });
    let network = builder.fix([0]).build().unwrap();
    // After one turn the two edges are exchanged.
    let strip: Vec<[usize; 3]> = vec![
        [0, 1, 2],
        [2, 1, 3],
        [2, 3, 4],
        [4, 3, 5],
        [4, 5, 6],
        [6, 5, 7],
        [6, 7, 8],
        [8, 7, 9],
        [8, 9, 1],
        [1, 9, 0],
    ];
    let points: Vec<_> = (0..10).map(BodyPoint::node).collect();
    let surface = Surface { points, vertices: (0..10).collect(), triangles: strip };
    let error = Body::new(network.clone(), surface.clone()).unwrap_err();
    assert!(matches!(error, BodyError::OneSidedSurface { triangle } if triangle < 10), "{error:?}");
    // Cut open, the strip has two sides.
    let cut = Surface { triangles: surface.triangles[..9].to_vec(), ..surface };
    assert_eq!(body(&network, cut.clone()).surface(), &cut);
}

proptest! {
    /// Any set of cubes in which no two share an edge alone, where adjacency would be ambiguous: thin walls, nested
    /// cavities, cubes that touch at a corner.
    #[test]
    fn any_union_of_cubes_faces_outward(
        cubes in prop::collection::vec(prop::bool::weighted(0.6), 64),
        turns in prop::collection::vec(any::<bool>(), 400),
    ) {
        let mut cubes = cubes;
        cubes[0] = true;
        let index = |c: [i32; 3]| (c[0] + 4 * c[1] + 16 * c[2]) as usize;
        while let Some(gap) = all(4).find(|c| !cubes[index(*c)] && touches_along_an_edge(*c, |c| cubes[index(c)])) {
            cubes[index(gap)] = true;
        }
        let heap = Cubes::new(4, |c| cubes[index(c)]);
        let made = body(&heap.network, turned(&heap.surface, |t| turns[t % 400]));
        prop_assert_eq!(made.surface(), &heap.surface);
    }
}
