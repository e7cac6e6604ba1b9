//! Bodies of meshes under the clock of threads, where they are made beside the app.

use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{HapticFaultKind, ModelStepCount, SimulatedBody, SlowStep, StepPart};
use palpate_tests::app::{listen, take_faults, update_until};
use palpate_tests::mesh::{add, ball, body, replace, shown, spawn_of, torn};

fn app() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, PalpatePlugins, AssetPlugin::default(), MeshPlugin));
    listen(&mut app);
    app
}

/// Faults that are no matter of the machine's load.
fn faults(app: &mut App) -> Vec<String> {
    take_faults(app).into_iter().filter(|fault| !fault.starts_with("a model step takes")).collect()
}

/// Updates until `done`, ten thousand times at most; whether it came to that.
fn until(app: &mut App, mut done: impl FnMut(&mut App) -> bool) -> bool {
    (0..10_000).any(|_| {
        app.update();
        std::thread::yield_now();
        done(app)
    })
}

fn of_balls(app: &mut App) -> (Handle<Mesh>, Entity) {
    let mesh = add(app, ball());
    let entity = spawn_of(app, mesh.clone());
    assert!(until(app, |app| body(app, entity).is_some()));
    (mesh, entity)
}

/// The reports of slow steps, and how long they took at most, in ticks of the body.
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

/// A sphere of ten cells along, at a rate at which no machine can step it under a tool.
#[test]
fn a_body_too_large_for_its_rate_is_reported_once_with_the_cells_that_would_do() {
    let mut app = App::new();
    let schedule = HapticSchedulePlugin { rate: ModelRate::try_from_hz(100.0).unwrap(), ..default() };
    app.add_plugins((MinimalPlugins, PalpatePlugins.set(schedule), AssetPlugin::default(), MeshPlugin));
    app.init_resource::<Slow>().add_systems(Last, collect_slow);
    let mesh = add(&mut app, Sphere::new(0.05).into());
    let fixed = FixedRegion::Face(BoxFace::Bottom);
    let entity = app.world_mut().spawn((DeformableBody::from_mesh(mesh), fixed)).id();
    assert!(until(&mut app, |app| body(app, entity).is_some()));
    let press = || Ok(ScriptedDevice::new(|_, _| Ok(Reading::at(DVec3::new(0.001, 0.052, 0.002)))));
    app.world_mut().resource_mut::<HapticDevices>().register("hand", press);
    app.world_mut().spawn(HapticTool { device: DeviceSelector::named("hand"), ..default() });
    let steps = |app: &App| app.world().resource::<ModelStepCount>().0;
    let begin = steps(&app);
    update_until(&mut app, "forty steps", |app| steps(app) > begin + 40);
    let Slow(told, ticks) = app.world().resource::<Slow>();
    let [slow] = told[..] else { panic!("{told:?}") };
    assert!(slow.nodes > 900 && slow.cells_along.is_some_and(|cells| (1..10).contains(&cells)), "{slow}");
    assert!(slow.largest() != StepPart::Other && slow.step_ms > slow.period_ms, "{slow}");
    assert!(*ticks <= 20, "{ticks} ticks");
}

fn mass_kg(app: &App, entity: Entity) -> f64 {
    body(app, entity).unwrap().body().network().mass_kg().iter().sum()
}

#[test]
fn a_body_is_made_beside_the_app_and_what_is_refused_is_said() {
    let mut app = app();
    let (mesh, entity) = of_balls(&mut app);
    assert_eq!(faults(&mut app), [""; 0]);
    replace(&mut app, &mesh, torn(ball()));
    let mut said = Vec::new();
    assert!(until(&mut app, |app| {
        said.extend(faults(app));
        !said.is_empty()
    }));
    assert!(said.len() == 1 && said[0].contains("holes"), "{said:?}");
    (0..50).for_each(|_| app.update());
    assert_eq!(faults(&mut app), [""; 0]);
    assert!(body(&app, entity).is_some());
}

/// As with a slider that is dragged: the body follows, though no value lasts until it has been made.
#[test]
fn a_body_follows_a_tissue_that_changes_at_every_frame() {
    let mut app = app();
    let (_, entity) = of_balls(&mut app);
    let (first, epoch) = (mass_kg(&app, entity), body(&app, entity).unwrap().epoch());
    let mut density = 1000.0;
    let follows = until(&mut app, |app| {
        density += 0.01;
        app.world_mut().get_mut::<Tissue>(entity).unwrap().density_kg_per_m3 = density;
        body(app, entity).unwrap().epoch() > epoch + 5
    });
    assert!(follows && mass_kg(&app, entity) > first);
    // And is made of the last one in the end.
    app.world_mut().get_mut::<Tissue>(entity).unwrap().density_kg_per_m3 = 2000.0;
    assert!(until(&mut app, |app| (mass_kg(app, entity) / (2.0 * first) - 1.0).abs() < 1e-9));
    assert_eq!(faults(&mut app), [""; 0]);
}

#[test]
fn a_mesh_that_changes_is_not_lost_when_something_else_changes_with_it() {
    let mut app = app();
    let (mesh, entity) = of_balls(&mut app);
    let vertices = |app: &App| shown(app, entity, false).len();
    let other = Sphere::new(0.06).mesh().ico(12).unwrap();
    assert_ne!(vertices(&app), other.count_vertices());
    replace(&mut app, &mesh, other.clone());
    // At every frame from the one in which the change is made to that in which it can be seen.
    for density in 1..5 {
        app.world_mut().get_mut::<Tissue>(entity).unwrap().density_kg_per_m3 = 1000.0 + f64::from(density);
        app.update();
    }
    assert!(until(&mut app, |app| vertices(app) == other.count_vertices()));
    assert_eq!(faults(&mut app), [""; 0]);
}
