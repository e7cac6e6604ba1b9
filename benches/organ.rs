//! Cost of an organ of 10,000 vertices in an app: time from its GLB file to the first touch, time of palpate's systems in every frame on
//! the main thread, and missed deadlines of the loop with and without the body.
//!
//! `cargo bench -p palpate_benches --bench organ`: one run of ten seconds after the first touch, and ten more without the organ.

use bevy::app::ScheduleRunnerPlugin;
use bevy::diagnostic::{DiagnosticPath, DiagnosticsPlugin, DiagnosticsStore};
use bevy::gltf::{GltfAssetLabel, GltfPlugin};
use bevy::image::ImagePlugin;
use bevy::log::LogPlugin;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::world_serialization::WorldSerializationPlugin;
use bevy_palpate::prelude::*;
use bevy_palpate::{
    DeviceSelector, ForceError, HapticDiagnosticsPlugin, LocalModelStats, LoopTiming, SimulatedBody,
    ToolCoupling,
};
use palpate_haptics::{Reading, ScriptedDevice};
use std::time::Duration;

/// Frames per second.
const FRAMES: f64 = 60.0;
/// Duration of the touch, and of the run without the organ, s.
const SECONDS: f64 = 10.0;
/// Force at which the hand stops moving down, N.
const ENOUGH_N: f64 = 1.0;

fn main() -> AppExit {
    let frame = ScheduleRunnerPlugin::run_loop(Duration::from_secs_f64(1.0 / FRAMES));
    let assets = concat!(env!("CARGO_MANIFEST_DIR"), "/../assets");
    App::new()
        .add_plugins((
            MinimalPlugins.set(frame),
            LogPlugin::default(),
            TransformPlugin,
            DiagnosticsPlugin,
            AssetPlugin { file_path: assets.into(), ..default() },
            MeshPlugin,
            ImagePlugin::default(),
            WorldSerializationPlugin,
            GltfPlugin::default(),
            PalpatePlugins,
        ))
        .init_resource::<Run>()
        .add_systems(Startup, setup)
        .add_systems(Last, (note, take_away, end).chain())
        .run()
}

/// Measurements of the run.
#[derive(Resource, Default)]
struct Run {
    built_s: Option<f64>,
    touched_s: Option<f64>,
    frame_ms: Vec<f64>,
    step_ms: Vec<f64>,
    steps: u64,
    /// Ticks and missed deadlines at the removal of the organ, and its time, s.
    alone: Option<(u64, u64, f64)>,
}

fn setup(mut commands: Commands, assets: Res<AssetServer>, mut devices: ResMut<HapticDevices>) {
    devices.register("hand", || {
        let mut height = 0.06;
        let mut ticks = 0.0_f64;
        Ok(ScriptedDevice::new(move |_, force_n| {
            ticks += 1.0;
            if force_n.y < ENOUGH_N && height > 0.0 {
                height -= 1e-4;
            }
            let stir = 0.003 * DVec3::new((0.004 * ticks).sin(), 0.0, (0.003 * ticks).cos());
            Ok(Reading::at(DVec3::Y * height + stir))
        }))
    });
    let mesh =
        assets.load(GltfAssetLabel::Primitive { mesh: 0, primitive: 0 }.from_asset("meshes/organ.glb"));
    commands.spawn((DeformableBody::from_mesh(mesh), FixedRegion::Face(BoxFace::Bottom)));
    let coupling = ToolCoupling::Virtual { stiffness_n_per_m: 20e3, max_force_n: 3.0 };
    commands.spawn(HapticTool { device: DeviceSelector::named("hand"), coupling, ..default() });
}

fn note(
    mut run: ResMut<Run>,
    bodies: Query<&SimulatedBody>,
    tools: Query<&ToolForce>,
    diagnostics: Res<DiagnosticsStore>,
    steps: Res<bevy_palpate::ModelStepCount>,
    time: Res<Time<Real>>,
) {
    let now = time.elapsed_secs_f64();
    if !bodies.is_empty() {
        run.built_s.get_or_insert(now);
    }
    if tools.iter().any(|force| force.force_n.length() > 0.0) {
        run.touched_s.get_or_insert(now);
    }
    if run.touched_s.is_none() || run.alone.is_some() {
        return;
    }
    let newest = |path: &DiagnosticPath| diagnostics.get(path).and_then(|diagnostic| diagnostic.value());
    run.frame_ms.extend(newest(&HapticDiagnosticsPlugin::FRAME_COST));
    if std::mem::replace(&mut run.steps, steps.0) != steps.0 {
        run.step_ms.extend(newest(&HapticDiagnosticsPlugin::MODEL_STEP_COST));
    }
}

/// Prints the measurements after the touch and removes the organ.
#[expect(clippy::print_stdout, reason = "a benchmark prints its results")]
fn take_away(
    mut commands: Commands,
    mut run: ResMut<Run>,
    bodies: Query<(Entity, &SimulatedBody)>,
    tool: Single<(&LoopTiming, &ForceError, &LocalModelStats)>,
    time: Res<Time<Real>>,
) {
    let now = time.elapsed_secs_f64();
    if run.alone.is_some() || run.touched_s.is_none_or(|touched| now < touched + SECONDS) {
        return;
    }
    let (timing, error, build) = *tool;
    run.alone = Some((timing.ticks, timing.missed_deadlines, now));
    let Run { built_s, touched_s, frame_ms, step_ms, .. } = &mut *run;
    for (entity, body) in &bodies {
        let network = body.body().network();
        let vertices = body.closed_mesh().map_or(0, |mesh| mesh.vertices_m().len());
        println!("organ                    {vertices} vertices, {} nodes", network.node_count());
        commands.entity(entity).despawn();
    }
    println!("from start to body       {:.2} s", built_s.unwrap_or(f64::NAN));
    println!("from start to touch      {:.2} s", touched_s.unwrap_or(f64::NAN));
    for (name, values) in [("palpate in a frame", frame_ms), ("a model step", step_ms)] {
        values.sort_unstable_by(f64::total_cmp);
        let at = |share: f64| values.get((share * values.len() as f64) as usize).copied().unwrap_or(f64::NAN);
        println!("{name:<24} p50 {:.2} ms   p99 {:.2} ms   ({})", at(0.5), at(0.99), values.len());
    }
    println!("ticks                    {} and {} missed", timing.ticks, timing.missed_deadlines);
    println!(
        "wake-up lateness         p50 {:.0} us   p99 {:.0} us",
        timing.lateness_p50_us, timing.lateness_p99_us
    );
    println!("tick cost                p50 {:.0} us   p99 {:.0} us", timing.cost_p50_us, timing.cost_p99_us);
    println!("local model              {} states, built in {:.1} ms", build.states, 1e3 * build.time_s);
    println!("error of the last step   {:.3} %", 100.0 * error.relative.unwrap_or(f64::NAN));
}

#[expect(clippy::print_stdout, reason = "a benchmark prints its results")]
fn end(run: Res<Run>, timing: Single<&LoopTiming>, time: Res<Time<Real>>, mut exit: MessageWriter<AppExit>) {
    let now = time.elapsed_secs_f64();
    if run.touched_s.is_none() && now > 60.0 {
        println!("not touched within a minute");
        exit.write(AppExit::error());
    }
    if let Some((ticks, missed, since)) = run.alone.filter(|(_, _, since)| now >= since + SECONDS) {
        let (ticks, missed) = (timing.ticks - ticks, timing.missed_deadlines - missed);
        println!("without the organ        {ticks} ticks and {missed} missed in {:.1} s", now - since);
        exit.write(AppExit::Success);
    }
}
