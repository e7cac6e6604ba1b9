//! Allocations of a frame with a body, compared with a bare Bevy app.

use allocation_counter::measure;
use bevy::ecs::schedule::SingleThreadedExecutor;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_palpate::ModelStepCount;
use bevy_palpate::prelude::*;
use palpate_haptics::{Reading, ScriptedDevice};
use palpate_tests::app::{assert_no_faults, step};
use palpate_tests::mesh::{RADIUS, add, ball, count_writes, force, mesh_app, spawn, take_writes};
use std::time::Duration;

/// Minimum number of allocations in a frame without a model step; each frame writes one mesh.
fn allocations_of_a_frame(app: &mut App) -> u64 {
    count_writes(app);
    // The executor with threads allocates for each system.
    for (_, schedule) in app.world_mut().resource_mut::<Schedules>().iter_mut() {
        schedule.set_executor(SingleThreadedExecutor::new());
    }
    // Shorter than a tick of the fixed main loop: some frames have none.
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(7)));
    let steps = |app: &App| app.world().get_resource::<ModelStepCount>().map(|steps| steps.0);
    // Lets the buffers grow.
    (0..300).for_each(|_| app.update());
    let mut least = u64::MAX;
    for _ in 0..40 {
        let before = steps(app);
        take_writes(app);
        let allocations = measure(|| app.update()).count_total;
        if steps(app) == before {
            assert_eq!(take_writes(app), 1, "a mesh is written in every frame");
            least = least.min(allocations);
        }
    }
    least
}

/// An app with a ball under a pressing tool.
fn touched_app() -> App {
    let mut app = mesh_app();
    spawn(&mut app, ball());
    // Never at rest: 2 to 6 mm deep, three times a second.
    let device = || {
        let depth = |n: u64| 0.004 - 0.004 * (0.02 * n as f64).cos().min(0.5);
        Ok(ScriptedDevice::new(move |n, _| Ok(Reading::at(DVec3::Y * (RADIUS + 0.005 - depth(n))))))
    };
    app.world_mut().resource_mut::<HapticDevices>().register("hand", device);
    let tool = HapticTool::new("hand");
    let tool = app.world_mut().spawn(tool).id();
    step(&mut app, 12);
    assert!(force(&app, tool).y > 0.1);
    assert_no_faults(&mut app);
    app
}

/// A Bevy app without palpate that writes a mesh as often.
fn bare_app() -> App {
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
fn moving_body_allocates_nothing_between_model_steps() {
    let of_bevy = allocations_of_a_frame(&mut bare_app());
    assert_eq!(allocations_of_a_frame(&mut touched_app()), of_bevy);
}
