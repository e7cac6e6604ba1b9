//! Cells that hold several parts, and parts thinner than a cell.

use super::shapes::{Shape, cube, cuboid, sphere};
use faer::linalg::solvers::Solve;
use glam::{DMat3, DQuat, DVec3};
use palpate_body::*;
use palpate_laws::ForceLaw;
use proptest::prelude::*;

const TISSUE: Tissue = Tissue {
    youngs_modulus_pa: 20e3,
    density_kg_per_m3: 1000.0,
    damping: Damping::Ratio(0.5),
    ..Tissue::SOFT
};

fn free(mesh: &ClosedMesh, cells: usize) -> MeshBody {
    CellLattice::fit(mesh, CellSize::Along(cells)).unwrap().allow_unconstrained().tissue(&TISSUE).unwrap()
}

fn mass(network: &Network) -> f64 {
    network.mass_kg().iter().sum()
}

/// A fork 0.1 m wide, 0.1 m deep and 0.1 m high, open at its top, with a gap from `gap.0` to `gap.1` along x above z = `base`.
fn fork(gap: (f64, f64), base: f64) -> Shape {
    let (w, h) = (0.1, 0.1);
    let outline =
        [[0.0, 0.0], [w, 0.0], [w, h], [gap.1, h], [gap.1, base], [gap.0, base], [gap.0, h], [0.0, h]];
    let face = [[0, 1, 4], [0, 4, 5], [1, 2, 4], [2, 3, 4], [0, 5, 7], [5, 6, 7]];
    let mut shape = Shape::default();
    for y in [0.0, 0.1] {
        shape.vertices.extend(outline.map(|[x, z]| DVec3::new(x, y, z)));
    }
    shape.triangles.extend(face);
    shape.triangles.extend(face.map(|[a, b, c]| [a + 8, c + 8, b + 8]));
    for i in 0..8 {
        let j = (i + 1) % 8;
        shape.triangles.extend([[i, i + 8, j], [j, i + 8, j + 8]]);
    }
    shape
}

/// The piece of each node of `network` without the nodes for which `is_removed` holds, and the number of pieces.
fn pieces_without(network: &Network, is_removed: impl Fn(DVec3) -> bool) -> (Vec<Option<usize>>, usize) {
    let x = network.rest_m();
    let (mut piece_of, mut pieces) = (vec![None; x.len()], 0);
    for start in (0..x.len()).filter(|&node| !is_removed(x[node])) {
        let mut front = vec![start];
        let is_new = piece_of[start].is_none();
        while let Some(node) = front.pop() {
            if piece_of[node].is_none() && !is_removed(x[node]) {
                piece_of[node] = Some(pieces);
                front.extend(network.neighbours(node));
            }
        }
        pieces += usize::from(is_new);
    }
    (piece_of, pieces)
}

fn piece_count(network: &Network) -> usize {
    pieces_without(network, |_| false).1
}

#[test]
fn gap_thinner_than_a_cell_stays_a_gap() {
    // Within a column of cells, on a plane of nodes, across a plane, and a hundredth of a cell wide.
    for gap in [(0.044, 0.046), (0.05, 0.052), (0.048, 0.05), (0.0495, 0.0505), (0.0449, 0.045)] {
        let mesh = fork(gap, 0.03).close().unwrap();
        for cells in [5, 8, 10] {
            let made = free(&mesh, cells);
            let ratio = mass(&made.network) / (1000.0 * mesh.volume_m3());
            assert!((ratio - 1.0).abs() < 1e-9, "{gap:?} in {cells} cells: {ratio}, {:?}", made.cells);
            assert_eq!(piece_count(&made.network), 1, "{gap:?} in {cells} cells");
            let (_, prongs) = pieces_without(&made.network, |x| x.z < 0.03 + 1e-9 + 0.1 / cells as f64);
            assert_eq!(prongs, 2, "{gap:?} in {cells} cells");
        }
    }
    // Without the gap it is a cube.
    let (_, whole) = pieces_without(&free(&cube(0.1).close().unwrap(), 10).network, |x| x.z < -0.01);
    assert_eq!(whole, 1);
}

#[test]
fn surface_of_each_prong_moves_with_its_own_prong() {
    let gap = (0.044, 0.046);
    let mesh = fork(gap, 0.03).close().unwrap();
    let mut made = free(&mesh, 8);
    // The prongs move apart.
    let x: Vec<DVec3> = made.network.rest_m().to_vec();
    let right: Vec<bool> = {
        let start = x.iter().position(|x| x.x > 0.09 && x.z > 0.09).unwrap();
        let mut is_right = vec![false; x.len()];
        let mut front = vec![start];
        while let Some(node) = front.pop() {
            if x[node].z > 0.045 && !std::mem::replace(&mut is_right[node], true) {
                front.extend(made.network.neighbours(node));
            }
        }
        is_right
    };
    let moved: Vec<DVec3> =
        x.iter().zip(&right).map(|(x, right)| *x + if *right { 0.01 } else { 0.0 } * DVec3::X).collect();
    let expected = |x: DVec3| x.x + if x.x > 0.045 { 0.01 } else { 0.0 };
    for point in &made.surface.points {
        let (rest, now) = (point.of(&x), point.of(&moved));
        if rest.z > 0.065 {
            assert!((now.x - expected(rest)).abs() < 1e-12, "{rest} moves to {now}");
        }
    }
    let vertices = mesh.vertices_m().len();
    let (mut positions, mut normals) = (vec![[0.0; 3]; vertices], vec![[0.0; 3]; vertices]);
    made.skin.deform(&moved, &glam::DAffine3::IDENTITY, &mut positions, &mut normals).unwrap();
    for (rest, now) in mesh.vertices_m().iter().zip(&positions).filter(|(rest, _)| rest.z > 0.065) {
        assert!((f64::from(now[0]) - expected(*rest)).abs() < 1e-6, "{rest} moves to {now:?}");
    }
}

#[test]
fn pieces_closer_than_a_cell_are_separate() {
    for gap in [1e-4, 0.003, 0.02] {
        let two = cube(0.05).and(&cube(0.04).moved(DVec3::X * (0.045 + gap)));
        let mesh = two.close().unwrap();
        let pieces = mesh.pieces(CellSize::Along(4)).unwrap();
        assert_eq!(pieces.len(), 2, "{gap}");
        // Cells that both share are divided by lines.
        assert!((pieces[0].volume_m3 / 0.05_f64.powi(3) - 1.0).abs() < 0.03, "{}", pieces[0].volume_m3);
        assert!(
            (pieces.iter().map(|piece| piece.volume_m3).sum::<f64>() / mesh.volume_m3() - 1.0).abs() < 1e-9
        );
        assert_eq!(piece_count(&free(&mesh, 4).network), 2);
    }
}

#[test]
fn boxes_that_meet_at_an_edge_are_one_piece() {
    // The edge in the middle of a cell, and on a side of cells.
    for (offset, cells) in [(DVec3::ZERO, 5), (DVec3::ZERO, 4), (DVec3::new(0.003, 0.0, 0.0), 6)] {
        let (a, b) = (cube(0.05), cube(0.05).moved(DVec3::new(0.05, 0.0, 0.05)));
        let mut both = a.and(&b).moved(offset);
        // The vertices on the common edge are the same.
        both.vertices.iter_mut().for_each(|x| *x = (*x * 1e6).round() / 1e6);
        let mesh = both.close().unwrap();
        assert_eq!(mesh.pieces(CellSize::Along(cells)).unwrap().len(), 1, "{offset} {cells}");
        assert_eq!(piece_count(&free(&mesh, cells).network), 1);
    }
}

#[test]
fn octahedron_is_one_piece() {
    // Its faces pass through corners of cells.
    let vertices = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z].map(|x| 0.06 * x);
    let triangles = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    let mesh = Shape { vertices: vertices.to_vec(), triangles: triangles.to_vec() }.close().unwrap();
    for cells in 1..12 {
        let pieces = mesh.pieces(CellSize::Along(cells)).unwrap();
        assert_eq!(
            pieces.len(),
            1,
            "{cells} cells: {:?}",
            pieces.iter().map(|p| (p.volume_m3, p.triangles.len())).collect::<Vec<_>>()
        );
        assert_eq!(piece_count(&free(&mesh, cells).network), 1);
    }
}

#[test]
fn hollow_ball_with_a_thin_wall_is_one_piece_with_its_own_mass() {
    for wall in [0.0005, 0.002, 0.006] {
        let shell = sphere(0.05, 16).and(&sphere(0.05 - wall, 16).inside_out());
        let mesh = shell.close().unwrap();
        let made = free(&mesh, 10);
        assert_eq!(piece_count(&made.network), 1, "{wall}");
        assert!((mass(&made.network) / (1000.0 * mesh.volume_m3()) - 1.0).abs() < 1e-9, "{wall}");
        assert_eq!(made.cells.raised, 0);
    }
}

/// Elastic energy under the infinitesimal affine displacement x → x + ε x.
fn energy(network: &Network, strain: DMat3) -> f64 {
    let x = network.rest_m();
    let of = |link: &Link| {
        let ForceLaw::Linear { stiffness_n_per_m } = link.spring.law() else { unreachable!() };
        let d = x[link.b] - x[link.a];
        0.5 * stiffness_n_per_m * (d.dot(strain * d) / d.length()).powi(2)
    };
    network.links().iter().map(of).sum()
}

#[test]
fn plate_thinner_than_a_cell_has_its_axial_stiffness() {
    let cell = 0.01;
    for (thickness, turned) in [(1.0 / 3.0, 0.0), (0.05, 0.0), (0.9, 0.0), (1.0 / 3.0, 0.3)] {
        let size = DVec3::new(0.12, 0.05, thickness * cell);
        let shape = cuboid(size, [1; 3]).turned(DQuat::from_rotation_z(turned));
        let mesh = shape.close().unwrap();
        let lattice = CellLattice::fit(&mesh, CellSize::Side(cell)).unwrap().allow_unconstrained();
        let network = lattice.tissue(&TISSUE).unwrap().network;
        // Uniaxial stress along the plate, with Poisson's ratio 1/4: E A L ε²/2.
        let axes = DMat3::from_quat(DQuat::from_rotation_z(turned));
        let strain = axes * DMat3::from_diagonal(0.01 * DVec3::new(1.0, -0.25, -0.25)) * axes.transpose();
        let expected = 0.5 * TISSUE.youngs_modulus_pa * size.element_product() * 1e-4;
        let ratio = energy(&network, strain) / expected;
        assert!((ratio - 1.0).abs() < 1e-9, "{thickness} of a cell: {ratio}");
    }
}

/// Axial stiffness of a plate relative to E A/L: a traction on one end, the mean displacement there, and the other end fixed within a cell.
fn axial_stiffness(turned: DQuat, thickness_cells: f64) -> f64 {
    let cell = 0.01;
    let size = DVec3::new(0.16, 0.05, cell * thickness_cells);
    let mesh = cuboid(size, [32, 10, 1]).turned(turned).close().unwrap();
    let along = turned * DVec3::X;
    let lattice = CellLattice::fit(&mesh, CellSize::Side(cell)).unwrap().allow_unconstrained();
    let made = lattice.touch_spacing(0.0).unwrap().tissue(&TISSUE).unwrap();
    let x = made.network.rest_m();
    let count = 3 * x.len();
    let mut k = faer::Mat::<f64>::zeros(count, count);
    for link in made.network.links() {
        let ForceLaw::Linear { stiffness_n_per_m } = link.spring.law() else { unreachable!() };
        let d = (x[link.b] - x[link.a]).normalize();
        for (i, j) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))) {
            let part = stiffness_n_per_m * d[i] * d[j];
            for (p, q, sign) in
                [(link.a, link.a, 1.0), (link.b, link.b, 1.0), (link.a, link.b, -1.0), (link.b, link.a, -1.0)]
            {
                k[(3 * p + i, 3 * q + j)] += sign * part;
            }
        }
    }
    // Both ends are pulled evenly; weak springs hold the plate.
    (0..count).for_each(|i| k[(i, i)] += 1e-6);
    let mut force = faer::Mat::<f64>::zeros(count, 1);
    let (mut ends, mut areas) = ([0.0, 0.0], [0.0, 0.0]);
    let at_ends: Vec<(f64, usize, f64)> = made
        .surface
        .triangles
        .iter()
        .flat_map(|t| {
            let points = t.map(|vertex| made.surface.vertices[vertex]);
            let [a, b, c] = points.map(|point| made.surface.points[point].of(x));
            let area = 0.5 * (b - a).cross(c - a);
            let facing = area.normalize().dot(along);
            points.map(|point| {
                (if facing.abs() > 0.99 { facing.round() } else { 0.0 }, point, area.length() / 3.0)
            })
        })
        .filter(|(side, ..)| *side != 0.0)
        .collect();
    for &(side, point, area) in &at_ends {
        for &(node, weight) in made.surface.points[point].nodes() {
            (0..3).for_each(|i| force[(3 * node + i, 0)] += side * area * weight * along[i]);
        }
    }
    let u = k.llt(faer::Side::Lower).unwrap().solve(&force);
    for &(side, point, area) in &at_ends {
        let end = usize::from(side > 0.0);
        areas[end] += area;
        for &(node, weight) in made.surface.points[point].nodes() {
            (0..3).for_each(|i| ends[end] += area * weight * along[i] * u[(3 * node + i, 0)]);
        }
    }
    let stretch = ends[1] / areas[1] - ends[0] / areas[0];
    // A traction of 1 Pa.
    size.x / TISSUE.youngs_modulus_pa / stretch
}

#[test]
fn pulled_plate_thinner_than_a_cell_yields_as_it_should() {
    for angle in [0.0, 0.3, 0.785] {
        let ratio = axial_stiffness(DQuat::from_rotation_z(angle), 1.0 / 3.0);
        assert!((ratio - 1.0).abs() < 0.02, "turned by {angle} in its plane: {ratio}");
    }
    // A wall that passes from one layer of cells into the next is too soft there.
    let ratio = axial_stiffness(DQuat::from_rotation_y(0.2), 1.0 / 3.0);
    assert!((0.7..1.0).contains(&ratio), "{ratio}");
}

#[test]
fn region_outside_the_mesh_does_not_count() {
    // The right half is ten times as heavy. Its surface cells are partly outside, where the region is not.
    let mesh = cuboid(DVec3::new(0.1, 0.033, 0.033), [1; 3]).close().unwrap();
    let heavy = Tissue { density_kg_per_m3: 10_000.0, ..TISSUE };
    let inside = Region::from_fn(|x| x.x > 0.0 && x.y.abs() < 0.0165 && x.z.abs() < 0.0165);
    let lattice = CellLattice::fit(&mesh, CellSize::Along(10)).unwrap().allow_unconstrained();
    let made = lattice.region(inside, heavy).tissue(&TISSUE).unwrap();
    assert!((mass(&made.network) / (5500.0 * mesh.volume_m3()) - 1.0).abs() < 1e-9);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn convex_mesh_on_the_grid_is_one_piece(
        half in prop::array::uniform3(1..24_u32),
        cells in 1..12usize,
        is_octahedron in any::<bool>(),
        turn in 0..3usize,
    ) {
        // Sizes in eighths of a number of cells, so that faces, edges and corners lie on the grid.
        let half = DVec3::from_array(half.map(|n| 0.0025 * f64::from(n)));
        let shape = if is_octahedron {
            let corners = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
            let faces = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
            Shape { vertices: corners.map(|x| half * x).to_vec(), triangles: faces.to_vec() }
        } else {
            let angle = [0.0, std::f64::consts::FRAC_PI_4, std::f64::consts::FRAC_PI_2][turn];
            cuboid(2.0 * half, [1; 3]).turned(DQuat::from_rotation_z(angle))
        };
        let mesh = shape.close().unwrap();
        let made = free(&mesh, cells);
        prop_assert_eq!(piece_count(&made.network), 1);
        let ratio = mass(&made.network) / (1000.0 * mesh.volume_m3());
        prop_assert!((ratio - 1.0 - made.cells.raised_share).abs() < 1e-9, "{}", ratio);
    }

    #[test]
    fn any_gap_separates_the_prongs(from in 0.02..0.07f64, width in 1e-5..0.01f64, cells in 5..12usize, turned in prop::array::uniform3(-3.0..3.0f64)) {
        let turn = DQuat::from_scaled_axis(DVec3::from_array(turned));
        let mesh = fork((from, from + width), 0.03).turned(turn).close().unwrap();
        let made = free(&mesh, cells);
        prop_assert!((mass(&made.network) / (1000.0 * mesh.volume_m3()) - 1.0 - made.cells.raised_share).abs() < 1e-9);
        prop_assert_eq!(piece_count(&made.network), 1);
        // Above the base a piece carries the surface of one prong, except where less than a sixteenth of a cell of the other is in a cell.
        let base = 0.03 + 3.0_f64.sqrt() * made.cells.cell_m;
        let own = |x: DVec3| turn.inverse() * x;
        let (piece_of, pieces) = pieces_without(&made.network, |x| own(x).z < base);
        let mut sides = vec![[0.0_f64; 2]; pieces];
        for point in &made.surface.points {
            let at = own(point.of(made.network.rest_m()));
            for piece in point.nodes().iter().filter_map(|(node, _)| piece_of[*node]) {
                sides[piece][usize::from(at.x > from + 0.5 * width)] += 1.0;
            }
        }
        let (few, all) = sides.iter().fold((0.0, 0.0), |(few, all), [a, b]| (few + a.min(*b), all + a + b));
        prop_assert!(few <= 0.15 * all, "{:?}", sides);
    }
}

#[test]
fn parts_are_thin_where_no_ball_with_a_radius_of_a_cell_is_near() {
    let thin = |shape: &Shape, cell_m: f64| shape.close().unwrap().thin_parts(cell_m);
    for thick in [cube(0.1), sphere(0.05, 16), cuboid(DVec3::new(0.1, 0.05, 0.02), [1; 3])] {
        let found = thin(&thick, 0.01);
        assert!(found.share < 0.02 && found.resolving_cell_m.is_none(), "{found:?}");
    }
    let plate = cuboid(DVec3::new(0.1, 0.1, 0.012), [1; 3]);
    let found = thin(&plate, 0.01);
    assert!(found.share > 0.99, "{found:?}");
    // Two of these cells are as thick as the plate.
    assert!((0.0045..0.0066).contains(&found.resolving_cell_m.unwrap()), "{found:?}");
    assert!(
        found
            .to_string()
            .starts_with("100 % of the volume is thinner than two cells of 0.0100 m; it keeps its mass")
    );
    // A wall between samples.
    let sheet = cuboid(DVec3::new(0.1, 0.1, 0.0003), [1; 3]);
    assert!(thin(&sheet, 0.01).share > 0.99);
    // A plate beside a cube: its share of the volume.
    let (wide, small) = (cuboid(DVec3::new(0.1, 0.1, 0.004), [1; 3]), cube(0.06).moved(DVec3::Z * 0.05));
    let share = wide.volume() / (wide.volume() + small.volume());
    let found = thin(&wide.and(&small), 0.01);
    assert!((found.share - share).abs() < 0.05, "{found:?}, {share}");
}
