//! This example demonstrates a body from a file. Meshes are joined to one mesh, whose inside becomes the body; a volume of tetrahedra becomes the
//! body as it is. A tool taps it from above. A mesh that cannot be used is reported with the remedy.

use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{
    ForceError, HapticSystems, MeshCellSize, MeshPieces, MeshShape, ModelSchedule, SimulatedBody,
    TetrahedralShape, TetrahedralVolume, TickRecording, ToolCoupling,
};
use clap::Parser;
use glam::DVec2;
use palpate_files::MeshSelection;
use palpate_haptics::{Reading, TickRecord};
use palpate_stage::{MeshFile, SetUpHands, SetUpScene, Stage, StageOptions, VolumeFile, register_hand};
use std::collections::BTreeSet;
use std::io::Write;
use std::path::PathBuf;

/// A mesh or a volume of tetrahedra from a file becomes a soft body, which a tool taps from above.
#[derive(Clone, Debug, Parser, Resource)]
#[command(
    after_help = "All meshes of the file's scene are joined, with the transforms of their nodes. The body is their inside: where \
    their winding number exceeds 1/2, which closes holes and unites parts that cross. A file of tetrahedra is the body itself. The body is moved to the centre of the stage.\n\nExamples:\n  your_mesh assets/meshes/organ.glb\n  your_mesh cup.glb --size-m 0.1 --cells 14 --youngs-modulus 5000"
)]
struct Options {
    #[command(flatten)]
    stage: StageOptions,
    /// A .glb, .gltf, .obj, .stl or .ply file, or one of tetrahedra: .msh, .vtk, .vtu, .node or .ele
    file: PathBuf,
    /// List the primitives of the file, or the regions of a volume, and end
    #[arg(long)]
    list: bool,
    /// Use only the mesh with this index, from 0
    #[arg(long, conflicts_with = "node")]
    mesh: Option<usize>,
    /// Use only the nodes with this name
    #[arg(long, value_name = "NAME")]
    node: Option<String>,
    /// Metres per unit of the mesh: 0.001 for millimetres
    #[arg(long, default_value_t = 1.0)]
    scale: f64,
    /// Longest extent of the selected primitives, m: they are scaled to it
    #[arg(long, value_name = "L", conflicts_with = "scale")]
    size_m: Option<f64>,
    /// Accept only a mesh that is closed and does not cross itself
    #[arg(long)]
    strict: bool,
    /// Thickness of parts with holes, m: they become sheets; without it their holes are closed
    #[arg(long, value_name = "M")]
    thickness_m: Option<f64>,
    /// Use only the piece with this index, from 0, in the order of descending volumes, instead of the largest
    #[arg(long)]
    piece: Option<usize>,
    /// Make a body of each piece; the largest is tapped
    #[arg(long, conflicts_with = "piece")]
    each_piece: bool,
    /// Number of cells along the longest side [default: 10; more where parts are thin, and at most 400 nodes]
    #[arg(long)]
    cells: Option<usize>,
    /// Place of the tap: x and z from the centre of mass, mm; by default the top above it
    #[arg(long, value_name = "X,Z", value_parser = place, allow_hyphen_values = true)]
    tap: Option<DVec2>,
    /// Young's modulus, Pa
    #[arg(long, default_value_t = 10e3)]
    youngs_modulus: f64,
}

/// The content of the file, and its centre, m.
#[derive(Resource)]
struct Shown {
    content: Content,
    middle_m: DVec3,
    metres_per_unit: f64,
}

/// Content of a file.
enum Content {
    Mesh(Mesh),
    Volume(TetrahedralVolume),
}

/// Marks the body that is tapped.
#[derive(Component)]
struct TappedBody;

/// A tapping motion.
#[derive(Clone, Copy)]
struct Tap {
    /// Highest point of the body, m.
    top_m: DVec3,
    /// Radius of the tool, m.
    radius_m: f64,
    /// Initial height over the top, m.
    above_m: f64,
    /// Amplitude of the motion, m.
    down_m: f64,
}

fn main() -> AppExit {
    let options = Options::parse();
    let volume = match VolumeFile::read(&options.file) {
        Ok(volume) => volume,
        Err(error) => return failed(error),
    };
    if let Some(VolumeFile { volume, bounds, list }) = volume {
        if options.list {
            let _ = write!(std::io::stdout(), "{list}");
            return AppExit::Success;
        }
        let Options { mesh, ref node, strict, thickness_m, piece, each_piece, cells, .. } = options;
        let is_of_meshes = mesh.is_some() || node.is_some() || thickness_m.is_some() || piece.is_some();
        if is_of_meshes || cells.is_some() || strict || each_piece {
            return failed(
                "--mesh, --node, --strict, --thickness-m, --piece, --each-piece and --cells are for meshes; leave them out for a file of tetrahedra",
            );
        }
        return run(options, Content::Volume(volume), bounds, 1);
    }
    if options.list {
        return match MeshFile::list(&options.file) {
            Ok(list) => {
                let _ = write!(std::io::stdout(), "{list}");
                AppExit::Success
            }
            Err(error) => failed(error),
        };
    }
    let selection = MeshSelection::new(options.mesh, options.node.as_deref());
    match MeshFile::read(&options.file, &selection) {
        Ok(MeshFile { mesh, bounds, parts }) => run(options, Content::Mesh(mesh), bounds, parts),
        Err(error) => failed(error),
    }
}

/// Runs the scene with the content of a file, whose bounds have its unit, and which was joined of `parts`.
fn run(options: Options, content: Content, bounds: [DVec3; 2], parts: usize) -> AppExit {
    let metres_per_unit =
        options.size_m.map_or(options.scale, |size_m| size_m / (bounds[1] - bounds[0]).max_element());
    let [low_m, high_m] = bounds.map(|corner| metres_per_unit * corner);
    let (middle_m, half_m) = (0.5 * (low_m + high_m), 0.5 * (high_m - low_m));
    let stage = Stage { name: "your_mesh", title: "A file becomes a soft body", seconds: 3.0, ..default() };
    let stage = if half_m.is_finite() { stage.around([-half_m, half_m].map(|m| m.as_vec3())) } else { stage };
    let mut app = stage.app(&options.stage);
    if parts > 1 {
        let _ = writeln!(std::io::stderr(), "{parts} parts of the file are joined to one mesh");
    }
    app.insert_resource(options)
        .insert_resource(Shown { content, middle_m, metres_per_unit })
        .init_resource::<Tapped>()
        .add_systems(SetUpScene, set_up)
        .add_systems(SetUpHands, set_up_hand)
        .add_systems(Update, spawn_other_pieces)
        .add_systems(ModelSchedule, record.in_set(HapticSystems::Last))
        .add_systems(Last, (record_ticks, report.run_if(on_message::<AppExit>)).chain())
        .run()
}

/// Prints the reason, and returns the exit that reports it.
fn failed(reason: impl std::fmt::Display) -> AppExit {
    let _ = writeln!(std::io::stderr(), "error: {reason}");
    AppExit::error()
}

/// What was recorded.
#[derive(Resource, Default)]
struct Tapped {
    /// Maximum force on the hand, N.
    max_n: f64,
    /// RMS of the error of each model step, N, and relative to the RMS of the force.
    errors: Vec<(f64, f64)>,
    /// Limits that the force has reached.
    limits: BTreeSet<String>,
}

/// RMS of the force in a model step, relative to the maximum force, below which its relative error does not count: only its last ticks touch.
const LEAST_FORCE: f64 = 0.01;

impl Tapped {
    /// Maximum relative error.
    fn max_error(&self) -> f64 {
        let counts = |&&(rms_n, error): &&(f64, f64)| rms_n >= error * LEAST_FORCE * self.max_n;
        self.errors.iter().filter(counts).map(|(_, error)| *error).fold(0.0, f64::max)
    }
}

fn set_up(
    mut commands: Commands,
    (mut meshes, mut volumes): (ResMut<Assets<Mesh>>, ResMut<Assets<TetrahedralVolume>>),
    (shown, options): (Res<Shown>, Res<Options>),
    mut tapped: ResMut<Tapped>,
) {
    *tapped = Tapped::default();
    let mesh = match &shown.content {
        Content::Mesh(mesh) => meshes.add(mesh.clone()),
        Content::Volume(volume) => {
            let volume = volumes.add(volume.clone());
            let shape = TetrahedralShape { volume, metres_per_unit: shown.metres_per_unit };
            commands.spawn((body(DeformableBody::Tetrahedra(shape), &shown, &options), TappedBody));
            return;
        }
    };
    let shape = MeshShape {
        metres_per_unit: shown.metres_per_unit,
        cells: options.cells.map_or_else(MeshCellSize::default, MeshCellSize::Along),
        strict: options.strict,
        thickness_m: options.thickness_m,
        pieces: options.piece.map_or(MeshPieces::Largest, MeshPieces::Index),
        ..MeshShape::new(mesh)
    };
    commands.spawn((body(DeformableBody::Mesh(shape), &shown, &options), TappedBody));
}

/// A body of `shape`.
fn body(shape: DeformableBody, shown: &Shown, options: &Options) -> impl Bundle {
    (
        shape,
        Tissue { youngs_modulus_pa: options.youngs_modulus, ..default() },
        FixedRegion::Base { side: BoxFace::Bottom, share: BASE },
        Transform::from_translation(-shown.middle_m.as_vec3()),
    )
}

/// Spawns a body for each other piece, once the largest is built and its report has their number.
fn spawn_other_pieces(
    mut commands: Commands,
    largest: Query<(&DeformableBody, &SimulatedBody), (With<TappedBody>, Added<SimulatedBody>)>,
    (shown, options): (Res<Shown>, Res<Options>),
) {
    let Ok((DeformableBody::Mesh(shape), simulated)) = largest.single() else { return };
    let Some(report) = simulated.mesh_report().filter(|_| options.each_piece) else { return };
    for index in 1..report.piece_count {
        let shape = MeshShape { pieces: MeshPieces::Index(index), ..shape.clone() };
        commands.spawn(body(DeformableBody::Mesh(shape), &shown, &options));
    }
}

/// Share of the height that is fixed.
const BASE: f64 = 0.2;

/// Reads two numbers, mm.
fn place(text: &str) -> Result<DVec2, String> {
    let numbers: Vec<f64> = text.split(',').filter_map(|number| number.trim().parse().ok()).collect();
    match numbers[..] {
        [x, z] if x.is_finite() && z.is_finite() => Ok(DVec2::new(x, z)),
        _ => Err("it must be two numbers with a comma between them, mm: 12,-5".into()),
    }
}

/// Spawns a ball with a radius of a twelfth of the body's smallest side, which taps the top to a depth of a tenth of that side.
fn set_up_hand(world: &mut World) {
    let mut bodies = world.query_filtered::<&SimulatedBody, With<TappedBody>>();
    let Ok(body) = bodies.single(world) else { return };
    let body = body.body();
    let points = || body.surface().points.iter().map(|point| point.of(body.positions_m()));
    let corner = |pick: fn(DVec3, DVec3) -> DVec3| points().reduce(pick).unwrap_or_default();
    let (low_m, high_m) = (corner(DVec3::min), corner(DVec3::max));
    let side_m = (high_m - low_m).min_element();
    let masses = body.network().mass_kg();
    let moment: DVec3 = body.positions_m().iter().zip(masses).map(|(x, mass_kg)| *mass_kg * *x).sum();
    let middle_m = (moment / masses.iter().sum::<f64>()).xz();
    let found = match world.resource::<Options>().tap {
        Some(at_mm) => top_at(body, middle_m + 1e-3 * at_mm),
        // There may be a hole.
        None => top_at(body, middle_m).or_else(|| {
            let distance = |x: &DVec3| x.xz().distance(middle_m);
            points()
                .filter(|x| x.y > 0.5 * (low_m.y + high_m.y))
                .min_by(|a, b| distance(a).total_cmp(&distance(b)))
        }),
    };
    let Some(top_m) = found else {
        world.write_message(failed("no part of the body is at this place; change --tap"));
        return;
    };
    let tap = Tap { top_m, radius_m: side_m / 12.0, above_m: 0.15 * side_m, down_m: 0.25 * side_m };
    let scheme = world.resource::<StageOptions>().scheme;
    register_hand(world, "tapping", move |t| tap.reading(t));
    let shape = ToolShape::Sphere { radius_m: tap.radius_m };
    let tool = HapticTool::new("tapping").with_scheme(scheme).with_shape(shape);
    world.spawn((tool, TickRecording::default()));
}

/// The highest point of the surface of `body` at `at_m`, x and z.
fn top_at(body: &palpate_body::Body, at_m: DVec2) -> Option<DVec3> {
    let surface = body.surface();
    let point_m = |point: usize| surface.points[point].of(body.positions_m());
    let on_line = (0..surface.triangles.len()).filter_map(|triangle| {
        let [a, b, c] = surface.corners(triangle).map(point_m);
        let area = |p: DVec2, q: DVec2, r: DVec2| (q - p).perp_dot(r - p);
        let [p, q, r] = [a.xz(), b.xz(), c.xz()];
        let weights = [area(at_m, q, r), area(p, at_m, r), area(p, q, at_m)].map(|part| part / area(p, q, r));
        let is_inside = weights.iter().all(|weight| *weight >= -1e-9);
        is_inside.then(|| weights[0] * a + weights[1] * b + weights[2] * c)
    });
    on_line.max_by(|a, b| a.y.total_cmp(&b.y))
}

impl Tap {
    fn reading(&self, t: f64) -> Reading {
        let down = (std::f64::consts::PI * t / 1.5).sin().powi(2);
        Reading::at(self.top_m + DVec3::Y * (self.radius_m + self.above_m - self.down_m * down))
    }
}

fn record(tools: Query<&ForceError>, mut tapped: ResMut<Tapped>) {
    for error in &tools {
        tapped.errors.push((error.rms_n, error.relative.unwrap_or(0.0)));
    }
}

fn record_ticks(mut tools: Query<(&HapticTool, &mut TickRecording)>, mut tapped: ResMut<Tapped>) {
    for (tool, mut recording) in &mut tools {
        for tick in recording.records.drain(..) {
            tapped.max_n = tapped.max_n.max(tick.force_n.length());
            tapped.limits.extend(limits(&tool.coupling, &tick));
        }
    }
}

/// The limits that the force has reached at a tick, with the fields to change.
fn limits(coupling: &ToolCoupling, tick: &TickRecord) -> impl Iterator<Item = String> {
    let safety = &tick.safety;
    let coupling = match *coupling {
        ToolCoupling::Virtual { max_force_n, .. }
            if tick.rendered.force_n.length() >= (1.0 - 1e-6) * max_force_n =>
        {
            Some(format!("{max_force_n} N, the limit of the virtual coupling: change HapticTool::coupling"))
        }
        _ => None,
    };
    let magnitude = safety.magnitude_limited.then(|| {
        let limit_n = safety.after.magnitude_n.length();
        format!(
            "{limit_n:.1} N, the limit of the safety chain or the device: change SafetyOverrides::max_force_n"
        )
    });
    let slew = safety.slew_limited.then(|| {
        "the limit of its growth in the safety chain: change SafetyOverrides::max_slew_n_per_s".to_owned()
    });
    let speed = safety.speed_guarded.then(|| {
        "the velocity guard of the safety chain: change SafetyOverrides::max_speed_m_per_s".to_owned()
    });
    [coupling, magnitude, slew, speed].into_iter().flatten()
}

fn report(
    bodies: Query<&SimulatedBody, With<TappedBody>>,
    others: Query<(), (With<SimulatedBody>, Without<TappedBody>)>,
    tapped: Res<Tapped>,
    mut done: Local<bool>,
) -> Result {
    let Ok(body) = bodies.single() else { return Ok(()) };
    if std::mem::replace(&mut *done, true) {
        return Ok(());
    }
    let network = body.body().network();
    let mass_kg: f64 = network.mass_kg().iter().sum();
    let max_error = tapped.max_error();
    let mut out = std::io::stdout().lock();
    if !others.is_empty() {
        writeln!(out, "bodies of other pieces   {}", others.iter().len())?;
    }
    writeln!(
        out,
        "nodes                    {}, {} of them fixed",
        network.node_count(),
        network.node_count() - network.free().len()
    )?;
    writeln!(out, "points of the surface    {}", body.body().surface().points.len())?;
    writeln!(out, "mass, kg                 {mass_kg:.4}")?;
    if let Some(report) = body.mesh_report() {
        writeln!(out, "deviation of surface, m  {:.5}", report.deviation_m)?;
        if let Some(size) = report.implausible_size {
            writeln!(out, "implausible size         {size}; change --scale or --size-m")?;
        }
        if let Some(thin) = report.thin_parts {
            writeln!(out, "thin parts               {thin}; --cells changes them")?;
        }
        if let Some(assumptions) = report.assumptions {
            writeln!(out, "assumed                  {assumptions}")?;
        }
    }
    if let Some(report) = body.tetrahedral_report() {
        writeln!(out, "volume                   {report}")?;
    }
    writeln!(out, "maximum force, N         {:.3}", tapped.max_n)?;
    for limit in &tapped.limits {
        writeln!(out, "the force reached        {limit}")?;
    }
    writeln!(out, "maximum error            {:.2} % of the force in a model step", 100.0 * max_error)?;
    writeln!(
        out,
        r#"{{"nodes":{},"mass_kg":{mass_kg:.5},"force_n":{:.4},"error":{:.5}}}"#,
        network.node_count(),
        tapped.max_n,
        max_error
    )?;
    Ok(())
}
