//! Meshes of tetrahedra: checks, repairs and bodies.

use glam::DVec3;
use palpate_body::*;

/// Vertices and tetrahedra of a block of `cells` cells of 1 cm.
fn block(cells: [usize; 3]) -> (Vec<DVec3>, Vec<[usize; 4]>) {
    let [x, y, z] = cells;
    let (nx, ny) = (x + 1, y + 1);
    let node = |i: usize, j: usize, k: usize| i + nx * (j + ny * k);
    let mut vertices = Vec::new();
    for (k, j, i) in (0..=z).flat_map(|k| (0..=y).flat_map(move |j| (0..=x).map(move |i| (k, j, i)))) {
        vertices.push(0.01 * DVec3::new(i as f64, j as f64, k as f64));
    }
    let mut elements = Vec::new();
    for (k, j, i) in (0..z).flat_map(|k| (0..y).flat_map(move |j| (0..x).map(move |i| (k, j, i)))) {
        let corner = |c: usize| node(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2));
        elements.extend(cell_tetrahedra(std::array::from_fn(corner)));
    }
    (vertices, elements)
}

#[test]
fn clean_mesh_becomes_a_body_with_its_volume_and_surface() {
    let (vertices, elements) = block([2, 3, 4]);
    let mesh = TetrahedralMesh::new(vertices.clone(), &elements, &[]).unwrap();
    let report = *mesh.report();
    assert!(report.is_clean(), "{report:?}");
    assert_eq!((report.elements, report.nodes, report.parts, report.face_parts), (144, 60, 1, 1));
    assert!((report.volume_m3 / 24e-6 - 1.0).abs() < 1e-12);
    let made = mesh.fix_face(Face::NegZ, 0.0).build(&Tissue::SOFT).unwrap();
    // Two triangles on each of the 52 faces of cells.
    assert_eq!((made.surface.triangles.len(), made.surface.points.len()), (104, 54));
    assert_eq!(made.network.free().len(), 48);
    let mass: f64 = made.network.mass_kg().iter().sum();
    assert!((mass / 0.024 - 1.0).abs() < 1e-12);
    let given = made.surface.clone();
    let body = Body::new(made.network, made.surface).unwrap();
    // The triangles faced outward already.
    assert_eq!(*body.surface(), given);
    let at =
        |triangle: &[usize; 3]| triangle.map(|vertex| given.points[given.vertices[vertex]].of(&vertices));
    let volume: f64 = given.triangles.iter().map(at).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum();
    assert!((volume / 24e-6 - 1.0).abs() < 1e-12);
}

#[test]
fn repairs_are_made_and_counted() {
    let (mut vertices, mut elements) = block([2, 2, 2]);
    let clean = TetrahedralMesh::new(vertices.clone(), &elements, &[]).unwrap();
    for index in [3, 7, 20] {
        elements[index].swap(0, 1);
    }
    let [a, b, c, d] = elements[5];
    elements.push([b, c, a, d]);
    elements.push([a, b, b, c]);
    vertices.insert(0, DVec3::splat(9.0));
    elements.iter_mut().flatten().for_each(|vertex| *vertex += 1);
    let mesh = TetrahedralMesh::new(vertices, &elements, &[]).unwrap();
    let report = *mesh.report();
    assert_eq!((report.reoriented, report.duplicates, report.degenerate), (3, 1, 1));
    assert_eq!((report.unused_vertices, report.elements), (1, clean.report().elements));
    assert!(!report.is_clean() && report.volume_m3 == clean.report().volume_m3);
    assert_eq!(mesh.boundary().len(), clean.boundary().len());
    let made = mesh.fix_vertices([1, 2, 3]).build(&Tissue::SOFT).unwrap();
    assert!(made.network.is_fixed(0) && made.given_vertex[0] == 1);
}

#[test]
fn flat_elements_are_left_out_at_the_boundary_and_rejected_inside() {
    let (mut vertices, mut elements) = block([2, 2, 2]);
    // A flat element on the top: its four corners lie in the plane, and one of its faces is new.
    let top: Vec<usize> = (0..vertices.len()).filter(|&node| vertices[node].z > 0.0199).collect();
    let clean = TetrahedralMesh::new(vertices.clone(), &elements, &[]).unwrap();
    let with_flat = [elements.clone(), vec![[top[0], top[1], top[4], top[3]]]].concat();
    let mesh = TetrahedralMesh::new(vertices.clone(), &with_flat, &[]).unwrap();
    assert_eq!((mesh.report().flat, mesh.boundary().len()), (1, clean.boundary().len()));
    // An element whose corners are all inside, with one of them in the plane of the others.
    (vertices, elements) = block([3, 3, 3]);
    let is_inside = |node: &usize| {
        vertices[*node].cmpgt(DVec3::splat(0.001)).all() && vertices[*node].cmplt(DVec3::splat(0.029)).all()
    };
    let [a, b, c, d] = *elements.iter().find(|nodes| nodes.iter().all(is_inside)).unwrap();
    vertices[a] = (vertices[b] + vertices[c] + vertices[d]) / 3.0;
    let error = TetrahedralMesh::new(vertices.clone(), &elements, &[]).unwrap_err();
    assert!(matches!(error, TetrahedralMeshError::Flat { .. }), "{error}");
    elements.truncate(1);
    vertices[elements[0][0]] = vertices[elements[0][1]];
    let error = TetrahedralMesh::new(vertices, &elements, &[]).unwrap_err();
    assert_eq!(error, TetrahedralMeshError::NoVolume { elements: 1 });
}

#[test]
fn slivers_overlaps_parts_and_edges_are_reported() {
    let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|x| 0.01 * x).to_vec();
    let mut sliver = corners.clone();
    sliver[3] = DVec3::new(0.003, 0.003, 2e-5);
    let report = *TetrahedralMesh::new(sliver, &[[0, 1, 2, 3]], &[]).unwrap().report();
    assert!(report.slivers == 1 && report.min_quality < 0.1 && !report.is_clean(), "{report:?}");
    let regular = [DVec3::ONE, DVec3::new(-1.0, 1.0, -1.0), DVec3::new(1.0, -1.0, -1.0)];
    let regular = [regular.to_vec(), vec![DVec3::new(-1.0, -1.0, 1.0)]].concat();
    let report = *TetrahedralMesh::new(regular, &[[0, 1, 2, 3]], &[]).unwrap().report();
    assert!((report.min_quality - 1.0).abs() < 1e-12 && report.is_clean(), "{report:?}");
    // Two tetrahedra that share an edge, and a third one apart.
    let mut vertices = corners;
    vertices.extend([DVec3::new(-0.01, -0.01, 0.0), DVec3::new(-0.01, 0.0, 0.005)]);
    vertices.extend([DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|x| 0.01 * x + DVec3::ONE));
    let elements = [[0, 1, 2, 3], [0, 3, 4, 5], [6, 7, 8, 9]];
    let mesh = TetrahedralMesh::new(vertices.clone(), &elements, &[]).unwrap();
    let report = *mesh.report();
    assert_eq!((report.parts, report.face_parts, report.nonmanifold_edges), (2, 3, 1));
    let error = mesh.clone().fix_vertices([0]).build(&Tissue::SOFT).unwrap_err();
    assert!(matches!(error, BodyError::Unconstrained { .. } | BodyError::Disconnected { .. }), "{error}");
    assert!(mesh.fix_vertices([0]).allow_unconstrained().build(&Tissue::SOFT).is_ok());
    // Three elements on one face.
    let above = [[0, 1, 2, 3], [0, 1, 2, 5], [0, 2, 1, 4]];
    vertices[5] = DVec3::new(0.002, 0.002, 0.02);
    vertices[4] = DVec3::new(0.002, 0.002, -0.02);
    let report = *TetrahedralMesh::new(vertices, &above, &[]).unwrap().report();
    assert_eq!(report.overlapping_faces, 1);
}

#[test]
fn regions_have_their_tissues_and_can_be_fixed() {
    let (vertices, elements) = block([2, 2, 4]);
    let is_upper = |nodes: &[usize; 4]| nodes.iter().map(|node| vertices[*node].z).sum::<f64>() > 0.08;
    let regions: Vec<u32> = elements.iter().map(|nodes| if is_upper(nodes) { 7 } else { 2 }).collect();
    let mesh = TetrahedralMesh::new(vertices.clone(), &elements, &regions).unwrap();
    let heavy = Tissue { density_kg_per_m3: 3000.0, ..Tissue::SOFT };
    let made = mesh.clone().region(7, heavy).fix_region(2).build(&Tissue::SOFT).unwrap();
    let mass: f64 = made.network.mass_kg().iter().sum();
    assert!((mass / (8e-6 * 1000.0 + 8e-6 * 3000.0) - 1.0).abs() < 1e-12, "{mass}");
    let rest = made.network.rest_m();
    assert!((0..rest.len()).all(|node| made.network.is_fixed(node) == (rest[node].z < 0.0201)));
    // Nodes between two tissues have a domain for each.
    let domains = made.network.tetrahedra().domains();
    assert_eq!(domains.of_nodes(), rest.len() + 9);
    let error = TetrahedralMesh::new(vertices, &elements, &[1, 2]).unwrap_err();
    assert_eq!(error, TetrahedralMeshError::Regions { found: 2, elements: 96 });
    assert!(mesh.fix_vertices([999]).build(&Tissue::SOFT).is_err());
}

#[test]
fn invalid_lists_are_rejected() {
    let (mut vertices, elements) = block([1, 1, 1]);
    let wrong = [elements.clone(), vec![[0, 1, 2, 8]]].concat();
    let error = TetrahedralMesh::new(vertices.clone(), &wrong, &[]).unwrap_err();
    assert_eq!(error, TetrahedralMeshError::Vertex { element: 6, vertex: 8, vertices: 8 });
    vertices[2].y = f64::NAN;
    let error = TetrahedralMesh::new(vertices.clone(), &elements, &[]).unwrap_err();
    assert_eq!(error, TetrahedralMeshError::Position { vertex: 2 });
    let error = TetrahedralMesh::new(vec![], &[], &[]).unwrap_err();
    assert_eq!(error, TetrahedralMeshError::NoVolume { elements: 0 });
}
