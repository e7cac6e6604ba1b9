//! Bodies from mesh files of an asset source in memory, with loops in lock step.

use bevy::asset::{AssetLoader, LoadState};
use bevy::prelude::*;
use bevy_palpate::palpate_files::MeshSelection;
use bevy_palpate::prelude::*;
use bevy_palpate::testing::{wait_for_body, wait_for_rejection};
use bevy_palpate::{
    BodyRegion, HapticFaultKind, Inclusion, Inclusions, MeshCellSize, MeshFault, MeshFileLoader,
    MeshFileSettings, MeshShape,
};
use palpate_tests::app::{assert_no_faults, step, take_kinds, update_until_done};
use palpate_tests::glb::glb;
use palpate_tests::mesh::{BOX, body, cuboid};
use palpate_tests::mesh_files::{Files, HALF, app_in, bounds, corners, folder, gltf_boxes, load};
use std::fmt::Write;
use std::path::Path;

/// Mass of the box, kg.
const MASS_KG: f64 = 0.128;

fn app_of(files: Files) -> App {
    app_in(&folder(files), |_| {}, |_| {})
}

fn select(app: &App, path: &str, selection: MeshSelection) -> Handle<Mesh> {
    let settings = move |settings: &mut MeshFileSettings| settings.selection = selection.clone();
    app.world().resource::<AssetServer>().load_builder().with_settings(settings).load(path.to_owned())
}

/// Spawns a body of eight cells along its longest side.
fn spawn(app: &mut App, mesh: Handle<Mesh>) -> Entity {
    let shape = MeshShape { cells: MeshCellSize::Along(8), ..MeshShape::new(mesh) };
    app.world_mut().spawn(DeformableBody::Mesh(shape)).id()
}

fn mass_kg(app: &App, entity: Entity) -> f64 {
    body(app, entity).unwrap().body().network().mass_kg().iter().sum()
}

/// The reason why the body of the mesh at `path` is rejected, and the fault, which is reported once.
fn rejection(app: &mut App, mesh: Handle<Mesh>) -> (String, MeshFault) {
    let entity = spawn(app, mesh);
    let reason = wait_for_rejection(app, entity);
    step(app, 3);
    let mut kinds = take_kinds(app);
    let (Some(HapticFaultKind::Mesh(fault)), true) = (kinds.pop(), kinds.is_empty()) else {
        panic!("{kinds:?}, {reason}")
    };
    (reason, fault)
}

/// A box as OBJ: the material `shell`, and a smaller box in it of the material `lump`.
fn obj(has_lump: bool) -> Vec<u8> {
    let boxes = [("shell", Vec3::ZERO, HALF), ("lump", Vec3::X * 0.01, Vec3::splat(0.01))];
    let mut text = String::new();
    for (index, (material, center, half)) in boxes.into_iter().enumerate().take(1 + usize::from(has_lump)) {
        for x in corners(center, half) {
            writeln!(text, "v {} {} {}", x.x, x.y, x.z).unwrap();
        }
        writeln!(text, "usemtl {material}").unwrap();
        for [a, b, c] in BOX.map(|t| t.map(|corner| corner as usize + 8 * index + 1)) {
            writeln!(text, "f {a} {b} {c}").unwrap();
        }
    }
    text.into_bytes()
}

fn stl() -> Vec<u8> {
    let corners: Vec<Vec3> = corners(Vec3::ZERO, HALF).collect();
    let mut file = vec![0; 80];
    file.extend(12_u32.to_le_bytes());
    for triangle in BOX {
        file.extend([0; 12]);
        let numbers = triangle.into_iter().flat_map(|corner| corners[corner as usize].to_array());
        file.extend(numbers.flat_map(f32::to_le_bytes));
        file.extend([0; 2]);
    }
    file
}

fn ply() -> Vec<u8> {
    let mut text = String::from(
        "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n\
         element face 12\nproperty list uchar int vertex_indices\nend_header\n",
    );
    for x in corners(Vec3::ZERO, HALF) {
        writeln!(text, "{} {} {}", x.x, x.y, x.z).unwrap();
    }
    for [a, b, c] in BOX {
        writeln!(text, "3 {a} {b} {c}").unwrap();
    }
    text.into_bytes()
}

#[test]
fn each_format_becomes_the_same_body() {
    let glb = glb(&cuboid(-HALF, HALF), &[]);
    let files = [("box.obj", obj(false)), ("box.stl", stl()), ("box.ply", ply()), ("box.glb", glb)];
    let mut app = app_of(&files);
    for (name, _) in &files {
        let mesh = load(&app, name);
        let entity = spawn(&mut app, mesh);
        wait_for_body(&mut app, entity);
        assert_no_faults(&mut app);
        let mass_kg = mass_kg(&app, entity);
        assert!((mass_kg - MASS_KG).abs() < 1e-6, "{name}: {mass_kg} kg");
    }
}

#[test]
fn gltf_with_a_buffer_beside_it_has_the_transforms_of_its_nodes() {
    let [text, binary] = gltf_boxes();
    let files = [("organs/boxes.gltf", text), ("organs/cube data.bin", binary)];
    let mut app = app_of(&files);
    let all = load(&app, "organs/boxes.gltf");
    let (center, size) = bounds(&mut app, &all);
    // From −0.14 to 0.18 m.
    assert!((center - 0.02 * Vec3::X).length() < 1e-6, "{center}");
    assert!((size - Vec3::new(0.32, 0.08, 0.08)).length() < 1e-6, "{size}");
    // The labels name what the nodes place.
    let right = load(&app, "organs/boxes.gltf#Piece1");
    let (center, size) = bounds(&mut app, &right);
    assert!((center - 0.1 * Vec3::X).length() < 1e-6, "{center}");
    assert!((size - 4.0 * HALF).length() < 1e-6, "{size}");
    let entity = spawn(&mut app, right);
    wait_for_body(&mut app, entity);
    assert!((mass_kg(&app, entity) - 8.0 * MASS_KG).abs() < 1e-5);
}

#[test]
fn settings_select_a_node() {
    let [text, binary] = gltf_boxes();
    let files = [("boxes.gltf", text.clone()), ("other.gltf", text), ("cube data.bin", binary)];
    let mut app = app_of(&files);
    let left = select(&app, "boxes.gltf", MeshSelection::Node("left".into()));
    let (center, size) = bounds(&mut app, &left);
    assert!((center + 0.1 * Vec3::X).length() < 1e-6, "{center}");
    assert!((size - 2.0 * HALF).length() < 1e-6, "{size}");
    // What the file does not contain is rejected with what it contains.
    let none = select(&app, "other.gltf", MeshSelection::Node("middle".into()));
    let (reason, fault) = rejection(&mut app, none);
    assert!(matches!(fault, MeshFault::NotLoaded(_)), "{fault}");
    for part in ["other.gltf", "MeshFileSettings::selection is a node with the name middle", "node left"] {
        assert!(reason.contains(part), "{reason}");
    }
}

#[test]
fn two_materials_have_two_tissues() {
    const SOFT: Tissue = Tissue { youngs_modulus_pa: 10e3, ..Tissue::SOFT };
    let mut app = app_of(&[("breast.obj", obj(true))]);
    let shape = MeshShape {
        parts: vec![load(&app, "breast.obj#Piece1")],
        cells: MeshCellSize::Along(8),
        ..MeshShape::new(load(&app, "breast.obj#Piece0"))
    };
    let hard = Tissue { youngs_modulus_pa: 100e3, density_kg_per_m3: 2000.0, ..SOFT };
    let inclusion = Inclusion { region: BodyRegion::Part(0), tissue: hard };
    let entity = app.world_mut().spawn((DeformableBody::Mesh(shape), SOFT, Inclusions(vec![inclusion]))).id();
    wait_for_body(&mut app, entity);
    assert_no_faults(&mut app);
    // The lump of 8 ml is twice as dense.
    assert!((mass_kg(&app, entity) - MASS_KG - 0.008).abs() < 1e-6, "{}", mass_kg(&app, entity));
}

/// A body whose file cannot be used does not stay loading: it is rejected, with one fault that names file and remedy.
#[test]
fn unusable_files_are_rejected_with_the_reason() {
    let [text, _] = gltf_boxes();
    let files = [
        ("boxes.gltf", text),
        ("cut.stl", stl()[..300].to_vec()),
        ("scan.dcm", b"DICM".to_vec()),
        ("box.stl", stl()),
    ];
    let mut app = app_of(&files);
    for (path, parts) in [
        ("boxes.gltf", &["boxes.gltf", "buffer 0", "cube data.bin"][..]),
        ("boxes.gltf#Piece0", &["cube data.bin"]),
        ("cut.stl", &["cut.stl", "STL file is not valid"]),
        ("scan.dcm", &["scan.dcm", "the extension must be glb, gltf, obj, stl or ply"]),
        ("box.stl#Piece1", &["box.stl", "'Piece1'", "'Piece0'"]),
        ("nothing.ply", &["nothing.ply"]),
    ] {
        let mesh = load(&app, path);
        let (reason, fault) = rejection(&mut app, mesh);
        assert!(matches!(fault, MeshFault::NotLoaded(_)), "{fault}");
        assert!(parts.iter().all(|part| reason.contains(part)), "{path}: {reason}");
    }
    // A label of a file whose extension no loader claims.
    let mesh = load(&app, "scan.dcm#Piece0");
    let (reason, fault) = rejection(&mut app, mesh);
    assert!(matches!(&fault, MeshFault::NoLoader(path) if path == "scan.dcm#Piece0"), "{fault}");
    assert!(reason.contains("feature `mesh_files`"), "{reason}");
}

/// A file that was rejected becomes a body once it is repaired and loaded again.
#[test]
fn repaired_file_becomes_a_body() {
    let root = folder(&[("box.stl", stl()[..300].to_vec())]);
    let mut app = app_in(&root, |_| {}, |_| {});
    let mesh = load(&app, "box.stl");
    let entity = spawn(&mut app, mesh.clone());
    wait_for_rejection(&mut app, entity);
    let state = app.world().resource::<AssetServer>().load_state(&mesh);
    assert!(matches!(state, LoadState::Failed(_)), "{state:?}");
    root.insert_asset(Path::new("box.stl"), stl());
    app.world().resource::<AssetServer>().reload("box.stl");
    assert!(update_until_done(&mut app, |app| body(app, entity).is_some()));
    assert!((mass_kg(&app, entity) - MASS_KG).abs() < 1e-6);
}

#[test]
fn loader_claims_what_no_other_loader_claims() {
    assert_eq!(MeshFileLoader::default().extensions(), ["glb", "gltf", "obj", "stl", "ply"]);
}
