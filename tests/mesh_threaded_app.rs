//! Bodies from meshes with loops on threads, where background tasks build them.

use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{
    FaultSeverity, HapticFaultKind, HapticSchedulePlugin, MeshCellSize, MeshShape, ModelRate, ModelStepCount,
    SimulatedBody, SlowStep, StepPart,
};
use palpate_body::{BodyError, MeshError};
use palpate_haptics::{Reading, ScriptedDevice};
use palpate_tests::app::{collect_messages, spawn_tool, take_kinds, update_until, update_until_done};
use palpate_tests::mesh::{add, ball, body, replace, shown, spawn_of, torn};

fn app() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, PalpatePlugins, AssetPlugin::default(), MeshPlugin));
    collect_messages(&mut app);
    app
}

/// Kinds of the faults since the last call that do not depend on the machine's load.
fn kinds(app: &mut App) -> Vec<HapticFaultKind> {
    take_kinds(app).into_iter().filter(|kind| kind.severity() > FaultSeverity::Load).collect()
}

/// Spawns a body of a ball and waits until it is built.
fn spawn_ball(app: &mut App) -> (Handle<Mesh>, Entity) {
    let mesh = add(app, ball());
    let entity = spawn_of(app, mesh.clone());
    assert!(update_until_done(app, |app| body(app, entity).is_some()));
    (mesh, entity)
}

/// Reported slow steps, and the maximum number of a body's ticks in a step.
#[derive(Resource, Default)]
struct Slow(Vec<SlowStep>, usize);

fn collect_slow(
    mut faults: MessageReader<HapticFault>,
    bodies: Query<&SimulatedBody>,
    mut slow: ResMut<Slow>,
) {
    for fault in faults.read() {
        if let HapticFaultKind::SlowStep(step) = fault.kind {
            slow.0.push(step);
        }
    }
    let ticks = bodies.iter().map(|body| body.last_step().ticks).max();
    slow.1 = slow.1.max(ticks.unwrap_or(0));
}

/// A sphere with ten cells along its diameter, at a rate at which no machine can step it under a tool.
#[test]
fn body_too_large_for_its_rate_is_reported_once_with_a_suggested_number_of_cells() {
    let mut app = App::new();
    let schedule = HapticSchedulePlugin { rate: ModelRate::try_from_hz(100.0).unwrap(), ..default() };
    app.add_plugins((MinimalPlugins, PalpatePlugins.set(schedule), AssetPlugin::default(), MeshPlugin));
    app.init_resource::<Slow>().add_systems(Last, collect_slow);
    let mesh = add(&mut app, Sphere::new(0.05).into());
    let fixed = FixedRegion::Face(BoxFace::Bottom);
    let shape = MeshShape { cells: MeshCellSize::Along(10), ..MeshShape::new(mesh) };
    let entity = app.world_mut().spawn((DeformableBody::Mesh(shape), fixed)).id();
    assert!(update_until_done(&mut app, |app| body(app, entity).is_some()));
    spawn_tool(&mut app, || ScriptedDevice::new(|_, _| Ok(Reading::at(DVec3::new(0.001, 0.052, 0.002)))));
    let steps = |app: &App| app.world().resource::<ModelStepCount>().0;
    let start = steps(&app);
    update_until(&mut app, "twenty steps", |app| steps(app) > start + 20);
    let Slow(reported, ticks) = app.world().resource::<Slow>();
    let [slow] = reported[..] else { panic!("{reported:?}") };
    assert!(
        slow.nodes > 900 && slow.suggested_cells_along.is_some_and(|cells| (1..10).contains(&cells)),
        "{slow}"
    );
    assert!(slow.largest() != StepPart::Other && slow.step_ms > slow.period_ms, "{slow}");
    // Two steps of the fixed main loop of 64 Hz at most, each in whole periods of 10 ms.
    assert!(*ticks <= 40, "{ticks} ticks");
}

fn mass_kg(app: &App, entity: Entity) -> f64 {
    body(app, entity).unwrap().body().network().mass_kg().iter().sum()
}

#[test]
fn rejected_background_build_is_reported_once() {
    let mut app = app();
    let (mesh, entity) = spawn_ball(&mut app);
    let none = kinds(&mut app);
    assert!(none.is_empty(), "{none:?}");
    replace(&mut app, &mesh, torn(ball()));
    let mut reported = Vec::new();
    assert!(update_until_done(&mut app, |app| {
        reported.extend(kinds(app));
        !reported.is_empty()
    }));
    let is_holes =
        matches!(reported[..], [HapticFaultKind::BuildBody(BodyError::Mesh(MeshError::Holes { .. }))]);
    assert!(is_holes, "{reported:?}");
    (0..50).for_each(|_| app.update());
    let none = kinds(&mut app);
    assert!(none.is_empty() && body(&app, entity).is_some(), "{none:?}");
}

/// As with a dragged slider: no value lasts until the body has been built with it.
#[test]
fn body_follows_a_tissue_that_changes_in_every_frame() {
    let mut app = app();
    let (_, entity) = spawn_ball(&mut app);
    let (first, epoch) = (mass_kg(&app, entity), body(&app, entity).unwrap().epoch());
    let mut density = 1000.0;
    let follows = update_until_done(&mut app, |app| {
        density += 0.01;
        app.world_mut().get_mut::<Tissue>(entity).unwrap().density_kg_per_m3 = density;
        body(app, entity).unwrap().epoch() > epoch + 5
    });
    assert!(follows && mass_kg(&app, entity) > first);
    // Finally the body has the last value.
    app.world_mut().get_mut::<Tissue>(entity).unwrap().density_kg_per_m3 = 2000.0;
    assert!(update_until_done(&mut app, |app| (mass_kg(app, entity) / (2.0 * first) - 1.0).abs() < 1e-9));
    let none = kinds(&mut app);
    assert!(none.is_empty(), "{none:?}");
}

#[test]
fn mesh_change_is_built_although_the_tissue_changes_too() {
    let mut app = app();
    let (mesh, entity) = spawn_ball(&mut app);
    let vertices = |app: &App| shown(app, entity, false).len();
    let other = Sphere::new(0.06).mesh().ico(12).unwrap();
    assert_ne!(vertices(&app), other.count_vertices());
    replace(&mut app, &mesh, other.clone());
    // In every frame from the change to its detection.
    for density in 1..5 {
        app.world_mut().get_mut::<Tissue>(entity).unwrap().density_kg_per_m3 = 1000.0 + f64::from(density);
        app.update();
    }
    assert!(update_until_done(&mut app, |app| vertices(app) == other.count_vertices()));
    let none = kinds(&mut app);
    assert!(none.is_empty(), "{none:?}");
}
