//! Bodies of volumes of tetrahedra, from an app's own data and from files of an asset source in memory.

use bevy::prelude::*;
use bevy_palpate::palpate_haptics::{Reading, ScriptedDevice};
use bevy_palpate::prelude::*;
use bevy_palpate::testing::{wait_for_body, wait_for_rejection};
use bevy_palpate::{
    BodyRegion, HapticFaultKind, Inclusion, Inclusions, MeshFault, SimulatedBody, Slit, TetrahedralShape,
    TetrahedralVolume,
};
use palpate_body::TetrahedralMeshError;
use palpate_tests::app::{assert_no_faults, step, take_kinds};
use palpate_tests::mesh_files::{Files, app_in, folder};
use std::fmt::Write;

/// Cells of the cube along each side, and its edge, mm.
const CELLS: usize = 5;
const EDGE: f64 = 100.0;

fn app_of(files: Files) -> App {
    app_in(&folder(files), |_| {}, |_| {})
}

/// A cube of six tetrahedra a cell, in millimetres. The upper part is region 1.
fn cube() -> TetrahedralVolume {
    let side = CELLS + 1;
    let place = |n: usize| EDGE * (n as f64 / CELLS as f64 - 0.5);
    let mut volume = TetrahedralVolume { region_names: vec!["lower".into(), "upper".into()], ..default() };
    for (i, j, k) in grid(side) {
        volume.vertices.push(DVec3::new(place(i), place(j), place(k)));
    }
    for (i, j, k) in grid(CELLS) {
        let corners = std::array::from_fn(|c| {
            let [i, j, k] = [i + (c & 1), j + (c >> 1 & 1), k + (c >> 2)];
            (k * side + j) * side + i
        });
        for nodes in palpate_body::cell_tetrahedra(corners) {
            volume.tetrahedra.push(nodes.map(|node| node as u32));
            volume.regions.push(u32::from(j >= 3));
        }
    }
    volume
}

fn grid(n: usize) -> impl Iterator<Item = (usize, usize, usize)> {
    (0..n * n * n).map(move |index| (index % n, index / n % n, index / (n * n)))
}

/// The cube as a file of Gmsh 2.2, with names of its regions.
fn msh(volume: &TetrahedralVolume) -> Vec<u8> {
    let mut text = String::from(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n3 1 \"lower\"\n3 2 \"upper\"\n$EndPhysicalNames\n",
    );
    writeln!(text, "$Nodes\n{}", volume.vertices.len()).unwrap();
    for (index, x) in volume.vertices.iter().enumerate() {
        writeln!(text, "{} {} {} {}", index + 1, x.x, x.y, x.z).unwrap();
    }
    writeln!(text, "$EndNodes\n$Elements\n{}", volume.tetrahedra.len()).unwrap();
    for (index, (nodes, region)) in volume.tetrahedra.iter().zip(&volume.regions).enumerate() {
        let [a, b, c, d] = nodes.map(|node| node + 1);
        writeln!(text, "{} 4 2 {} 1 {a} {b} {c} {d}", index + 1, region + 1).unwrap();
    }
    writeln!(text, "$EndElements").unwrap();
    text.into_bytes()
}

/// The cube as the two files of TetGen.
fn tetgen(volume: &TetrahedralVolume) -> [Vec<u8>; 2] {
    let mut node = format!("{} 3 0 0\n", volume.vertices.len());
    for (index, x) in volume.vertices.iter().enumerate() {
        writeln!(node, "{index} {} {} {}", x.x, x.y, x.z).unwrap();
    }
    let mut ele = format!("{} 4 1\n", volume.tetrahedra.len());
    for (index, ([a, b, c, d], region)) in volume.tetrahedra.iter().zip(&volume.regions).enumerate() {
        writeln!(ele, "{index} {a} {b} {c} {d} {region}").unwrap();
    }
    [node.into_bytes(), ele.into_bytes()]
}

fn shape(volume: Handle<TetrahedralVolume>) -> DeformableBody {
    DeformableBody::Tetrahedra(TetrahedralShape { volume, metres_per_unit: 0.001 })
}

fn add(app: &mut App, volume: TetrahedralVolume) -> Handle<TetrahedralVolume> {
    app.world_mut().resource_mut::<Assets<TetrahedralVolume>>().add(volume)
}

fn body(app: &App, entity: Entity) -> &SimulatedBody {
    app.world().get::<SimulatedBody>(entity).unwrap()
}

/// The only fault.
fn fault(app: &mut App) -> MeshFault {
    step(app, 2);
    let mut kinds = take_kinds(app);
    match (kinds.pop(), kinds.is_empty()) {
        (Some(HapticFaultKind::Mesh(fault)), true) => fault,
        other => panic!("{other:?}, {kinds:?}"),
    }
}

#[test]
fn files_and_data_become_the_same_body_with_two_tissues() {
    let volume = cube();
    let [node, ele] = tetgen(&volume);
    let files = [("organs/cube.msh", msh(&volume)), ("organs/cube.node", node), ("organs/cube.ele", ele)];
    let mut app = app_of(&files);
    let mut handles = vec![add(&mut app, volume)];
    for path in ["organs/cube.msh", "organs/cube.node", "organs/cube.ele"] {
        handles.push(app.world().resource::<AssetServer>().load(path));
    }
    let hard = Tissue { youngs_modulus_pa: 100e3, density_kg_per_m3: 2000.0, ..Tissue::SOFT };
    let mut first = None;
    for handle in handles {
        let inclusions = Inclusions(vec![Inclusion { region: BodyRegion::Part(1), tissue: hard }]);
        let entity =
            app.world_mut().spawn((shape(handle), inclusions, FixedRegion::Face(BoxFace::Bottom))).id();
        wait_for_body(&mut app, entity);
        assert_no_faults(&mut app);
        let simulated = body(&app, entity);
        let network = simulated.body().network();
        assert_eq!((network.node_count(), network.tetrahedra().len()), (216, 750));
        assert_eq!(network.node_count() - network.free().len(), 36);
        let mass_kg: f64 = network.mass_kg().iter().sum();
        assert!((mass_kg - (0.6 * 1.0 + 0.4 * 2.0)).abs() < 1e-9, "{mass_kg} kg");
        assert!(simulated.tetrahedral_report().unwrap().is_clean());
        // Of the edges of a cell: three sides, three diagonals and the one through it, fewer at the surface.
        assert!((0.020..0.030).contains(&simulated.cell_m()), "{}", simulated.cell_m());
        let masses = network.mass_kg().to_vec();
        assert_eq!(*first.get_or_insert_with(|| masses.clone()), masses);
    }
}

#[test]
fn tool_feels_a_volume_and_the_tissue_below_it_is_stressed() {
    let mut app = app_of(&[]);
    let handle = add(&mut app, cube());
    let entity =
        app.world_mut().spawn((shape(handle), FixedRegion::Base { side: BoxFace::Bottom, share: 0.1 })).id();
    wait_for_body(&mut app, entity);
    app.world_mut().resource_mut::<HapticDevices>().register("script", || {
        Ok(ScriptedDevice::new(|n, _| {
            let down_m = 0.01 * (n as f64 / 500.0).min(1.0);
            Ok(Reading::at(DVec3::new(0.003, 0.056 - down_m, -0.002)))
        }))
    });
    let tool = app.world_mut().spawn(HapticTool::new("script")).id();
    step(&mut app, 40);
    assert_no_faults(&mut app);
    let force = app.world().get::<ToolForce>(tool).unwrap().force_n;
    assert!(force.y > 0.1 && force.x.hypot(force.z) < 0.5 * force.y, "{force}");
    let place_m = DVec3::new(0.003, 0.035, -0.002);
    let mut state = app.world_mut().run_system_cached_with(
        |In(at): In<(Entity, DVec3)>, bodies: bevy_palpate::BodyQuery| {
            (bodies.stress(at.0, at.1), bodies.deformation(at.0, at.1))
        },
        (entity, place_m),
    );
    let (stress, deformation) = state.as_mut().unwrap();
    let (stress, deformation) = (stress.take().unwrap(), deformation.take().unwrap());
    // Compressed along y.
    assert!(stress.principal_stresses_pa()[2] < -200.0 && stress.von_mises_pa() > 100.0, "{stress:?}");
    assert!(
        stress.green_strain.y_axis.y < -0.005 && deformation.strain().y_axis.y < -0.005,
        "{deformation:?}"
    );
}

#[test]
fn fixed_vertices_and_regions_hold() {
    let mut app = app_of(&[]);
    let volume = cube();
    let left: Vec<bool> = volume.vertices.iter().map(|x| x.x < -0.499 * EDGE).collect();
    let handle = add(&mut app, volume);
    for (fixed, count) in [
        (FixedRegion::Vertices(left), 36),
        (FixedRegion::Regions(vec![BodyRegion::Part(1)]), 3 * 36),
        (FixedRegion::Faces(vec![BoxFace::Bottom, BoxFace::Top]), 72),
        (FixedRegion::Base { side: BoxFace::Left, share: 0.25 }, 72),
        (FixedRegion::None, 0),
    ] {
        let entity = app.world_mut().spawn((shape(handle.clone()), fixed.clone())).id();
        wait_for_body(&mut app, entity);
        let network = body(&app, entity).body().network();
        assert_eq!(network.node_count() - network.free().len(), count, "{fixed:?}");
        assert_no_faults(&mut app);
    }
}

#[test]
fn changed_asset_is_built_again() {
    let mut app = app_of(&[]);
    let handle = add(&mut app, cube());
    let entity = app.world_mut().spawn(shape(handle.clone())).id();
    wait_for_body(&mut app, entity);
    let epoch = body(&app, entity).epoch();
    let mut volumes = app.world_mut().resource_mut::<Assets<TetrahedralVolume>>();
    volumes.get_mut(&handle).unwrap().vertices.iter_mut().for_each(|x| *x *= 1.2);
    step(&mut app, 3);
    assert!(body(&app, entity).epoch() > epoch);
    let mass_kg: f64 = body(&app, entity).body().network().mass_kg().iter().sum();
    assert!((mass_kg - 1.2_f64.powi(3)).abs() < 1e-9, "{mass_kg} kg");
}

#[test]
fn invalid_volumes_are_rejected_with_the_reason() {
    let bad_index = {
        let mut volume = cube();
        volume.tetrahedra[7][2] = 999;
        volume
    };
    let flat =
        TetrahedralVolume { vertices: vec![DVec3::ZERO; 4], tetrahedra: vec![[0, 1, 2, 3]], ..default() };
    let mut app = app_of(&[
        ("broken.msh", b"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n".to_vec()),
        ("alone.ele", b"0 4 0\n".to_vec()),
    ]);
    for (volume, is_expected) in [
        (
            bad_index,
            (|fault| matches!(fault, TetrahedralMeshError::Vertex { element: 7, vertex: 999, vertices: 216 }))
                as fn(&_) -> bool,
        ),
        (flat, |fault| matches!(fault, TetrahedralMeshError::NoVolume { elements: 1 })),
    ] {
        let handle = add(&mut app, volume);
        let entity = app.world_mut().spawn(shape(handle)).id();
        wait_for_rejection(&mut app, entity);
        let MeshFault::Tetrahedra(error) = fault(&mut app) else { panic!("not of the volume") };
        assert!(is_expected(&error), "{error}");
        app.world_mut().despawn(entity);
    }
    for (path, part) in
        [("broken.msh", "$Elements"), ("alone.ele", "alone.node"), ("missing.vtk", "missing.vtk")]
    {
        let handle = app.world().resource::<AssetServer>().load(path);
        let entity = app.world_mut().spawn(shape(handle)).id();
        let reason = wait_for_rejection(&mut app, entity);
        assert!(matches!(fault(&mut app), MeshFault::NotLoaded(_)) && reason.contains(part), "{reason}");
        app.world_mut().despawn(entity);
    }
    let handle = add(&mut app, cube());
    let zero = DeformableBody::Tetrahedra(TetrahedralShape { volume: handle.clone(), metres_per_unit: 0.0 });
    let entity = app.world_mut().spawn(zero).id();
    wait_for_rejection(&mut app, entity);
    assert_eq!(fault(&mut app), MeshFault::Scale(0.0));
    app.world_mut().despawn(entity);
    let slit = Slit { length_m: 0.04, depth_m: 0.02, opening_m: 0.01 };
    let entity = app.world_mut().spawn((shape(handle.clone()), slit)).id();
    assert!(wait_for_rejection(&mut app, entity).contains("only a block can have a Slit"));
    app.world_mut().despawn(entity);
    take_kinds(&mut app);
    let inclusion = Inclusion { region: BodyRegion::Part(2), tissue: Tissue::SOFT };
    let entity = app.world_mut().spawn((shape(handle), Inclusions(vec![inclusion]))).id();
    assert!(wait_for_rejection(&mut app, entity).contains("number of regions of the volume"));
    take_kinds(&mut app);
}
