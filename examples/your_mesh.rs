//! This example demonstrates a body of your own: any closed mesh from a glTF or GLB file, tapped by a hand from above. What is wrong
//! with a mesh is said with what to do about it.

use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{MeshShape, SimulatedBody};
use clap::Parser;
use palpate_stage::{SetUpHands, SetUpScene, Stage, StageOptions};
use std::io::Write;
use std::path::PathBuf;

/// A closed mesh of your own becomes a soft body, which a hand taps from above.
#[derive(Clone, Debug, Parser, Resource)]
#[command(
    after_help = "Examples:\n  your_mesh assets/meshes/organ.glb\n  your_mesh cup.glb --scale 0.001 --cells 14 --youngs-modulus 5000"
)]
struct Options {
    #[command(flatten)]
    stage: StageOptions,
    /// A .glb or .gltf file; its first mesh is taken, unless --mesh says otherwise
    #[arg(value_parser = mesh_file)]
    file: PathBuf,
    /// Which of its meshes
    #[arg(long, default_value_t = 0)]
    mesh: usize,
    /// Metres to a unit of the mesh: 0.001 for one in millimetres
    #[arg(long, default_value_t = 1.0)]
    scale: f64,
    /// Cells along its longest side
    #[arg(long, default_value_t = 10)]
    cells: usize,
    /// Young's modulus, Pa
    #[arg(long, default_value_t = 10e3)]
    youngs_modulus: f64,
}

fn mesh_file(path: &str) -> Result<PathBuf, String> {
    std::path::absolute(path).and_then(|path| path.canonicalize()).map_err(|error| format!("{path}: {error}"))
}

fn main() -> AppExit {
    let options = Options::parse();
    let stage = Stage {
        name: "your_mesh",
        title: "A closed mesh of your own is a soft body",
        seconds: 3.0,
        ..default()
    };
    let mut app = stage.app(&options.stage);
    app.insert_resource(options)
        .init_resource::<Tapped>()
        .add_systems(SetUpScene, set_up)
        .add_systems(SetUpHands, set_up_hand)
        .add_systems(ModelStep, listen.in_set(HapticSystems::Last))
        .add_systems(Last, report.run_if(on_message::<AppExit>))
        .run()
}

/// The largest force on the hand, N, and its error there.
#[derive(Resource, Default)]
struct Tapped {
    most_n: f64,
    largest_error: f64,
}

fn set_up(mut commands: Commands, assets: Res<AssetServer>, options: Res<Options>) {
    let mesh = assets.load(format!("{}#Mesh{}/Primitive0", options.file.display(), options.mesh));
    commands.spawn((
        DeformableBody::Mesh(MeshShape {
            scale: options.scale,
            cells_along: options.cells,
            ..MeshShape::new(mesh)
        }),
        Tissue { youngs_modulus_pa: options.youngs_modulus, ..default() },
        FixedRegion::Face(Face::Bottom),
    ));
}

/// A hand as large as a twelfth of the body, which taps its top from above, a tenth of the body deep.
fn set_up_hand(
    mut commands: Commands,
    bodies: Query<&SimulatedBody>,
    options: Res<Options>,
    mut devices: ResMut<HapticDevices>,
) {
    let Ok(body) = bodies.single() else { return };
    let points = || body.body().surface().points.iter().map(|point| point.of(body.body().positions_m()));
    let Some(top) = points().max_by(|a, b| a.y.total_cmp(&b.y)) else { return };
    let low = points().map(|point| point.y).fold(f64::INFINITY, f64::min);
    let height = top.y - low;
    let radius_m = height / 12.0;
    devices.register("tapping", move || {
        Ok(ScriptedDevice::new(move |n, _| {
            let down = (std::f64::consts::PI * n as f64 * 1e-3 / 1.5).sin().powi(2);
            Ok(Reading::at(top + DVec3::Y * (radius_m + height * (0.15 - 0.25 * down))))
        }))
    });
    commands.spawn(HapticTool {
        device: DeviceSelector::named("tapping"),
        scheme: options.stage.scheme,
        shape: ToolShape::Sphere { radius_m },
        ..default()
    });
}

fn listen(tools: Query<(&ToolForce, &LocalModelError)>, mut tapped: ResMut<Tapped>) {
    for (force, error) in &tools {
        tapped.most_n = tapped.most_n.max(force.force_n.length());
        tapped.largest_error = tapped.largest_error.max(error.relative.unwrap_or(0.0));
    }
}

fn report(bodies: Query<&SimulatedBody>, tapped: Res<Tapped>, mut done: Local<bool>) -> Result {
    let Ok(body) = bodies.single() else { return Ok(()) };
    if std::mem::replace(&mut *done, true) {
        return Ok(());
    }
    let network = body.body().network();
    let mass_kg: f64 = network.mass_kg().iter().sum();
    let mut out = std::io::stdout().lock();
    writeln!(
        out,
        "nodes                    {}, of which {} are fixed",
        network.node_count(),
        network.node_count() - network.free().len()
    )?;
    writeln!(out, "points of its surface    {}", body.body().surface().points.len())?;
    writeln!(out, "mass, kg                 {mass_kg:.4}")?;
    writeln!(out, "largest force, N         {:.3}", tapped.most_n)?;
    writeln!(out, "largest error            {:.2} % of a model step's force", 100.0 * tapped.largest_error)?;
    Ok(())
}
