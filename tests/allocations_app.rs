//! What a frame allocates because of a body.

use allocation_counter::measure;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_palpate::ModelStepCount;
use bevy_palpate::prelude::*;
use palpate_tests::app::{step, take_faults};
use palpate_tests::mesh::{RADIUS, add, ball, count_writes, force, mesh_app, spawn, take_writes};
use std::time::Duration;

/// The fewest allocations in a frame without a model step, at each of which one mesh is written to.
fn of_a_frame(app: &mut App) -> u64 {
    count_writes(app);
    // Shorter than a step of the fixed clock, so that there is a frame without one.
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(7)));
    let steps = |app: &App| app.world().get_resource::<ModelStepCount>().map(|steps| steps.0);
    // Buffers grow to their size.
    (0..300).for_each(|_| app.update());
    let mut least = u64::MAX;
    for _ in 0..40 {
        let before = steps(app);
        take_writes(app);
        let allocations = measure(|| app.update()).count_total;
        if steps(app) == before {
            assert_eq!(take_writes(app), 1, "a mesh is written at every frame");
            least = least.min(allocations);
        }
    }
    least
}

/// A ball under a tool that presses.
fn touched() -> App {
    let mut app = mesh_app();
    spawn(&mut app, ball());
    // Never at rest: 2 to 6 mm deep, three times a second.
    let device = || {
        let depth = |n: u64| 0.004 - 0.004 * (0.02 * n as f64).cos().min(0.5);
        Ok(ScriptedDevice::new(move |n, _| Ok(Reading::at(DVec3::Y * (RADIUS + 0.005 - depth(n))))))
    };
    app.world_mut().resource_mut::<HapticDevices>().register("hand", device);
    let tool = HapticTool { device: DeviceSelector::named("hand"), ..default() };
    let tool = app.world_mut().spawn(tool).id();
    step(&mut app, 12);
    assert!(force(&app, tool).y > 0.1);
    assert_eq!(take_faults(&mut app), [""; 0]);
    app
}

/// Bevy alone, and a mesh that is written to as often.
fn bare() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), MeshPlugin));
    let mesh = add(&mut app, ball());
    app.world_mut().spawn(Mesh3d(mesh.clone()));
    app.add_systems(Update, move |mut meshes: ResMut<Assets<Mesh>>| {
        meshes.get_mut(&mesh).unwrap().attribute_mut(Mesh::ATTRIBUTE_POSITION).unwrap();
    });
    app
}

#[test]
fn a_body_that_moves_allocates_nothing_between_model_steps() {
    let of_bevy = of_a_frame(&mut bare());
    assert_eq!(of_a_frame(&mut touched()), of_bevy);
}
