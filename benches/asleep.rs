//! Cost of an organ in an app while it falls on a table, and after it has come to rest there.
//!
//! `cargo bench -p palpate_benches --bench asleep`: 500 frames of each, at 60 frames per second of simulated time.

use bevy::diagnostic::{DiagnosticsPlugin, DiagnosticsStore};
use bevy::gltf::{GltfAssetLabel, GltfPlugin};
use bevy::image::ImagePlugin;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy::world_serialization::WorldSerializationPlugin;
use bevy_palpate::prelude::*;
use bevy_palpate::{HapticDiagnosticsPlugin, HapticSchedulePlugin, LoopMode, SimulatedBody};
use std::time::{Duration, Instant};

const FRAMES: usize = 500;
/// Time within which the organ must come to rest, s.
const PATIENCE_S: usize = 60;

#[expect(clippy::print_stdout, reason = "a benchmark prints its results")]
fn main() {
    let assets = concat!(env!("CARGO_MANIFEST_DIR"), "/../assets");
    let mut app = App::new();
    app.add_plugins((
        MinimalPlugins,
        TransformPlugin,
        DiagnosticsPlugin,
        AssetPlugin { file_path: assets.into(), ..default() },
        MeshPlugin,
        ImagePlugin::default(),
        WorldSerializationPlugin,
        GltfPlugin::default(),
        PalpatePlugins.set(HapticSchedulePlugin::default().with_mode(LoopMode::Lockstep)),
    ))
    .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f64(1.0 / 60.0)))
    .insert_resource(Gravity::EARTH);
    app.finish();
    app.cleanup();
    app.world_mut().spawn(Obstacle::half_space());
    let mesh = app
        .world()
        .resource::<AssetServer>()
        .load(GltfAssetLabel::Primitive { mesh: 0, primitive: 0 }.from_asset("meshes/organ.glb"));
    let organ =
        app.world_mut().spawn((DeformableBody::from_mesh(mesh), Transform::from_xyz(0.0, 0.04, 0.0))).id();
    while app.world().get::<SimulatedBody>(organ).is_none() {
        app.update();
        std::thread::yield_now();
    }
    print("falling", measure(&mut app));
    let is_asleep =
        |app: &App| app.world().get::<SimulatedBody>(organ).is_some_and(|body| body.body().is_settled());
    let mut frames = 0;
    while !is_asleep(&app) && frames < 60 * PATIENCE_S {
        app.update();
        frames += 1;
    }
    println!("at rest after {:.1} s more: {}", frames as f64 / 60.0, is_asleep(&app));
    (0..60).for_each(|_| app.update());
    print("asleep", measure(&mut app));
    app.world_mut().despawn(organ);
    (0..60).for_each(|_| app.update());
    print("without", measure(&mut app));
}

/// Time of the plugin's systems in each frame, and of the whole frame, µs.
fn measure(app: &mut App) -> [Vec<f64>; 2] {
    let mut costs = [Vec::new(), Vec::new()];
    for _ in 0..FRAMES {
        #[expect(clippy::disallowed_methods, reason = "a benchmark measures time")]
        let start = Instant::now();
        app.update();
        costs[1].push(1e6 * start.elapsed().as_secs_f64());
        let store = app.world().resource::<DiagnosticsStore>();
        let newest =
            store.get(&HapticDiagnosticsPlugin::FRAME_COST).and_then(|diagnostic| diagnostic.value());
        costs[0].extend(newest.map(|cost_ms| 1e3 * cost_ms));
    }
    costs
}

#[expect(clippy::print_stdout, reason = "a benchmark prints its results")]
fn print(name: &str, costs: [Vec<f64>; 2]) {
    for (what, mut costs) in ["palpate", "frame"].into_iter().zip(costs) {
        costs.sort_unstable_by(f64::total_cmp);
        let at = |share: f64| costs.get((share * costs.len() as f64) as usize).copied().unwrap_or(f64::NAN);
        println!("{name:<8} {what:<8} p50 {:8.1} us   p99 {:8.1} us   ({})", at(0.5), at(0.99), costs.len());
    }
}
