//! A layer, a tool that presses, and what is measured.

use super::{hand, theory};
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{ModelSchedule, SimulatedBody, TickRecording, ToolLoop};
use clap::ValueEnum;
use palpate_stage::{HandTime, SetUpHands, SetUpScene, StageOptions, register_hand};
use std::io::Write;

/// Thickness of the layer and its width, m, and the cells through it.
pub const THICKNESS_M: f64 = 0.06;
const WIDTH_M: f64 = 0.18;
const CELLS: usize = 4;
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
        let lows: Vec<f64> = tips.iter().map(|tip| tip.low_m()).collect();
        let hand =
            register_hand(app.world_mut(), "stairs", move |t| hand::reading(t, 0.5 * THICKNESS_M, &lows));
        app.insert_resource(Measured { tips, hand, ..default() })
            .add_systems(SetUpScene, set_up)
            .add_systems(SetUpHands, set_up_hand)
            .add_systems(
                ModelSchedule,
                (change_tip.in_set(HapticSystems::First), measure.in_set(HapticSystems::Last)),
            )
            .add_systems(Last, report.pipe(fail).run_if(on_message::<AppExit>));
    }
}

/// What has been measured so far.
#[derive(Resource, Default)]
pub struct Measured {
    tips: Vec<Tip>,
    /// When the hand does what.
    hand: HandTime,
    /// Which of them presses now.
    now: usize,
    /// Of every tip at every model step on the way down.
    curves: Vec<Vec<Pressed>>,
    /// Where it waited, by tip and stair: the last there.
    waited: Vec<[Option<Pressed>; hand::DEPTHS_M.len()]>,
}

/// How a tip presses.
#[derive(Clone, Copy, Debug)]
pub struct Pressed {
    /// Its depth, m.
    pub depth_m: f64,
    /// The force on the hand, N: what the scheme makes of it, and the safety chain lets through.
    pub felt_n: f64,
    /// What the full body answers, N.
    pub full_n: f64,
}

impl Measured {
    /// The tip that presses now.
    pub fn tip(&self) -> Tip {
        self.tips[self.now]
    }

    /// What was measured where a tip waited, by tips and the hand's stairs.
    pub fn waited(&self) -> impl Iterator<Item = (Tip, &Pressed)> {
        let of_tips = self.tips.iter().zip(&self.waited);
        of_tips.flat_map(|(tip, waited)| waited.iter().flatten().map(|pressed| (*tip, pressed)))
    }

    /// Its curve, on the way down.
    #[cfg(feature = "panel")]
    pub fn curve(&self) -> &[Pressed] {
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
        FixedRegion::Face(BoxFace::Bottom),
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

fn change_tip(mut measured: ResMut<Measured>, mut tools: Query<&mut HapticTool>) {
    // Before the next one's turn begins.
    let turns = (measured.hand.s() + 0.5 * hand::CHANGE_S) / hand::SECONDS;
    let now = (turns as usize).min(measured.tips.len() - 1);
    if std::mem::replace(&mut measured.now, now) != now {
        tools.iter_mut().for_each(|mut tool| tool.shape = measured.tip().shape());
    }
}

/// Notes how deep the tip is, what is felt and what the full body answers.
fn measure(
    tools: Query<(&ToolLoop, &ToolForce, &TickRecording)>,
    bodies: Query<&SimulatedBody>,
    mut measured: ResMut<Measured>,
) {
    let (Ok((tool, force, recording)), Ok(body)) = (tools.single(), bodies.single()) else { return };
    let Some(sample) = recording.samples.last() else { return };
    let tip = measured.tip();
    let now = measured.now;
    let (felt_n, full_n) = (force.force_n.y, tool.contact().displayed_force_n(body.body()).y);
    let t = measured.hand.s() - now as f64 * hand::SECONDS;
    let depth_m = 0.5 * THICKNESS_M + tip.low_m() - sample.position_m.y;
    if depth_m <= 0.0 {
        return;
    }
    let pressed = Pressed { depth_m, felt_n, full_n };
    let deepest = measured.curves[now].last().map_or(0.0, |before| before.depth_m);
    if depth_m > deepest + 2e-5 {
        measured.curves[now].push(pressed);
    }
    if let Some(stair) = hand::waited_on(t) {
        measured.waited[now][stair] = Some(pressed);
    }
}

/// A table, and the same as one line of JSON.
fn report(measured: Res<Measured>, mut done: Local<bool>) -> Result {
    if std::mem::replace(&mut *done, true) {
        return Ok(());
    }
    let mut out = std::io::stdout().lock();
    let modulus = theory::reduced_modulus_pa(YOUNGS_MODULUS_PA);
    writeln!(out, "tip         depth, mm   felt, N   force, N   half-space, N   ratio   layer, N   ratio")?;
    let mut json = Vec::new();
    for (tip, &Pressed { depth_m, felt_n, full_n: force_n }) in measured.waited() {
        let half_space_n = theory::half_space_n(tip, modulus, depth_m);
        let layer_n = half_space_n * theory::layer(tip, THICKNESS_M, depth_m);
        let (ratio, of_layer) = (force_n / half_space_n, force_n / layer_n);
        writeln!(
            out,
            "{:10}  {:9.2}   {felt_n:7.3}   {force_n:8.3}   {half_space_n:13.3}   {ratio:5.3}   {layer_n:8.3}   {of_layer:5.3}",
            tip.name(),
            1e3 * depth_m
        )?;
        json.push(format!(
            r#"{{"tip":"{}","depth_m":{depth_m:.6},"felt_n":{felt_n:.5},"force_n":{force_n:.5},"to_half_space":{ratio:.4},"to_layer":{of_layer:.4}}}"#,
            tip.name()
        ));
    }
    writeln!(
        out,
        "\nThe layer is stiffer than the half-space of the formulas because its bottom is held.\n[{}]",
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
