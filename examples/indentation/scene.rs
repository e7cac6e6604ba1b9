//! A layer, a tool that presses, and what is measured.

use crate::{hand, theory};
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{ModelStep, SimulatedBody, TickRecording, ToolLoop};
use clap::ValueEnum;
use palpate_stage::{SceneTime, SetUpHands, SetUpScene, StageOptions};
use std::io::Write;

/// Thickness of the layer and its width, m, and the cells through it.
pub const THICKNESS_M: f64 = 0.06;
const WIDTH_M: f64 = 0.18;
const CELLS: usize = 6;
/// Young's modulus, Pa.
pub const YOUNGS_MODULUS_PA: f64 = 20e3;

/// What presses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Tip {
    /// A ball of radius 40 mm.
    Ball,
    /// The flat end of a cylinder of radius 20 mm.
    Punch,
}

impl Tip {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ball => "ball",
            Self::Punch => "flat punch",
        }
    }

    /// Its radius, m.
    pub fn radius_m(self) -> f64 {
        match self {
            Self::Ball => 0.04,
            Self::Punch => 0.02,
        }
    }

    /// How far its lowest point is below its position, m.
    pub fn low_m(self) -> f64 {
        match self {
            Self::Ball => self.radius_m(),
            Self::Punch => 0.0,
        }
    }

    fn shape(self) -> ToolShape {
        match self {
            Self::Ball => ToolShape::Sphere { radius_m: self.radius_m() },
            Self::Punch => ToolShape::FlatPunch { radius_m: self.radius_m(), axis: -DVec3::Y },
        }
    }
}

/// The layer, the tool, the measurement.
pub struct ScenePlugin {
    /// What presses, one after the other.
    pub tips: Vec<Tip>,
}

impl Plugin for ScenePlugin {
    fn build(&self, app: &mut App) {
        let tips = self.tips.clone();
        app.insert_resource(Measured { tips, ..default() })
            .add_systems(SetUpScene, set_up)
            .add_systems(SetUpHands, set_up_hand)
            .add_systems(
                ModelStep,
                (change_tip.in_set(HapticSystems::First), measure.in_set(HapticSystems::Last)),
            )
            .add_systems(Last, report.pipe(fail).run_if(on_message::<AppExit>));
        let lows: Vec<f64> = self.tips.iter().map(|tip| tip.low_m()).collect();
        app.world_mut()
            .resource_mut::<HapticDevices>()
            .register("stairs", move || Ok(hand::device(0.5 * THICKNESS_M, lows.clone())));
    }
}

/// What has been measured so far.
#[derive(Resource, Default)]
pub struct Measured {
    tips: Vec<Tip>,
    /// Which of them presses now.
    now: usize,
    /// Depth, m, and force, N, of every tip at every model step.
    pub curves: Vec<Vec<[f64; 2]>>,
    /// Where it waited, by tip and stair: the last depth and force there.
    waited: Vec<[Option<[f64; 2]>; hand::DEPTHS_M.len()]>,
}

impl Measured {
    /// The tip that presses now.
    pub fn tip(&self) -> Tip {
        self.tips[self.now]
    }

    /// Its curve, depth (m) and force (N), on the way down.
    #[cfg(feature = "panel")]
    pub fn curve(&self) -> &[[f64; 2]] {
        self.curves.get(self.now).map_or(&[], Vec::as_slice)
    }
}

fn set_up(mut commands: Commands, mut measured: ResMut<Measured>) {
    measured.now = 0;
    measured.curves = vec![Vec::new(); measured.tips.len()];
    measured.waited = vec![Default::default(); measured.tips.len()];
    let across = (WIDTH_M / THICKNESS_M) as usize * CELLS + 1;
    commands.spawn((
        DeformableBody::block_of_size([across, CELLS + 1, across], DVec3::new(WIDTH_M, THICKNESS_M, WIDTH_M)),
        Tissue { youngs_modulus_pa: YOUNGS_MODULUS_PA, damping_ratio: 0.5, ..default() },
        FixedRegion::Face(Face::Bottom),
    ));
}

fn set_up_hand(mut commands: Commands, options: Res<StageOptions>, measured: Res<Measured>) {
    let tool = HapticTool {
        device: DeviceSelector::named("stairs"),
        scheme: options.scheme,
        shape: measured.tip().shape(),
        friction: 0.0,
        // The depth is to be the hand's.
        coupling: ToolCoupling::Rigid,
        ..default()
    };
    commands.spawn((tool, TickRecording { keep: 1000, ..default() }));
}

fn change_tip(time: Res<SceneTime>, mut measured: ResMut<Measured>, mut tools: Query<&mut HapticTool>) {
    // Before the next one's turn begins.
    let now = (((time.0 + 0.5 * hand::CHANGE_S) / hand::SECONDS) as usize).min(measured.tips.len() - 1);
    if std::mem::replace(&mut measured.now, now) != now {
        tools.iter_mut().for_each(|mut tool| tool.shape = measured.tip().shape());
    }
}

/// Notes how deep the tip is and what the full body answers.
fn measure(
    tools: Query<(&ToolLoop, &TickRecording)>,
    bodies: Query<&SimulatedBody>,
    time: Res<SceneTime>,
    mut measured: ResMut<Measured>,
) {
    let (Ok((tool, recording)), Ok(body)) = (tools.single(), bodies.single()) else { return };
    let Some(sample) = recording.samples.last() else { return };
    let tip = measured.tip();
    let now = measured.now;
    let force_n = tool.contact().displayed_force_n(body.body()).y;
    let t = time.0 - now as f64 * hand::SECONDS;
    let depth_m = 0.5 * THICKNESS_M + tip.low_m() - sample.position_m.y;
    if depth_m <= 0.0 {
        return;
    }
    let deepest = measured.curves[now].last().map_or(0.0, |[depth, _]| *depth);
    if depth_m > deepest + 2e-5 {
        measured.curves[now].push([depth_m, force_n]);
    }
    if let Some(stair) = hand::waited_on(t) {
        measured.waited[now][stair] = Some([depth_m, force_n]);
    }
}

/// A table, and the same as one line of JSON.
fn report(measured: Res<Measured>, mut done: Local<bool>) -> Result {
    if std::mem::replace(&mut *done, true) {
        return Ok(());
    }
    let mut out = std::io::stdout().lock();
    let modulus = theory::reduced_modulus_pa(YOUNGS_MODULUS_PA);
    writeln!(out, "tip         depth, mm   force, N   half-space, N   ratio   layer, N   ratio")?;
    let mut json = Vec::new();
    for (tip, waited) in measured.tips.iter().zip(&measured.waited) {
        for [depth_m, force_n] in waited.iter().flatten() {
            let half_space_n = theory::half_space_n(*tip, modulus, *depth_m);
            let layer_n = half_space_n * theory::layer(*tip, THICKNESS_M, *depth_m);
            let (ratio, of_layer) = (force_n / half_space_n, force_n / layer_n);
            writeln!(
                out,
                "{:10}  {:9.2}   {force_n:8.3}   {half_space_n:13.3}   {ratio:5.3}   {layer_n:8.3}   {of_layer:5.3}",
                tip.name(),
                1e3 * depth_m
            )?;
            json.push(format!(
                r#"{{"tip":"{}","depth_m":{depth_m:.6},"force_n":{force_n:.5},"to_half_space":{ratio:.4},"to_layer":{of_layer:.4}}}"#,
                tip.name()
            ));
        }
    }
    writeln!(
        out,
        "\nThe layer is stiffer than the half-space of the formulas because its bottom is held, and stiffer under a punch\n\
        of two cells' radius than the formula for layers: its rim is that of a lattice. With three cells it is 1 % off\n\
        (crates/palpate_body/tests/indentation.rs).\n[{}]",
        json.join(",")
    )?;
    Ok(())
}

/// Ends the app with an error if there is no report.
fn fail(In(result): In<Result>, mut exit: MessageWriter<AppExit>) {
    if let Err(error) = result {
        error!("the report cannot be made: {error}");
        exit.write(AppExit::error());
    }
}
