//! A layer, a pressing tool, and the measurement.

use super::{hand, theory};
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{HapticSystems, ModelSchedule, SimulatedBody, TickRecording, ToolCoupling, ToolLoop};
use clap::ValueEnum;
use palpate_stage::{HandTime, SetUpHands, SetUpScene, StageOptions, register_hand};
use std::io::Write;

/// Thickness of the layer, m.
pub const THICKNESS_M: f64 = 0.06;
/// Width of the layer, m.
const WIDTH_M: f64 = 0.18;
/// Number of cells through the layer.
const CELLS: usize = 4;
/// Young's modulus, Pa.
pub const YOUNGS_MODULUS_PA: f64 = 20e3;
/// Poisson's ratio of the layer.
pub const POISSONS_RATIO: f64 = 0.45;

/// Tip of the tool.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Tip {
    /// A ball of radius 40 mm.
    Ball,
    /// The flat end of a cylinder of radius 20 mm.
    Punch,
}

impl Tip {
    /// Name of the tip.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ball => "ball",
            Self::Punch => "flat punch",
        }
    }

    /// Radius of the tip, m.
    pub fn radius_m(self) -> f64 {
        match self {
            Self::Ball => 0.04,
            Self::Punch => 0.02,
        }
    }

    /// Distance of the lowest point below the position of the tip, m.
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

/// Adds the layer, the tool and the measurement.
pub struct ScenePlugin {
    /// Tips, one after the other.
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
            .add_systems(Last, report.pipe(palpate_stage::exit_on_error).run_if(on_message::<AppExit>));
    }
}

/// The measurement.
#[derive(Resource, Default)]
pub struct Measured {
    tips: Vec<Tip>,
    /// Time of the device.
    hand: HandTime,
    /// Index of the present tip.
    now: usize,
    /// Values of each tip at every model step on the way down.
    curves: Vec<Vec<Pressed>>,
    /// Last values of each tip at rest on each step.
    waited: Vec<[Option<Pressed>; hand::DEPTHS_M.len()]>,
}

/// Depth and forces of a tip.
#[derive(Clone, Copy, Debug)]
pub struct Pressed {
    /// Depth, m.
    pub depth_m: f64,
    /// Force on the hand, N: rendered by the scheme, after the safety chain.
    pub rendered_n: f64,
    /// Force of the full body, N.
    pub full_n: f64,
}

impl Measured {
    /// The present tip.
    pub fn tip(&self) -> Tip {
        self.tips[self.now]
    }

    /// The values at rest, by tip and step.
    pub fn waited(&self) -> impl Iterator<Item = (Tip, &Pressed)> {
        let of_tips = self.tips.iter().zip(&self.waited);
        of_tips.flat_map(|(tip, waited)| waited.iter().flatten().map(|pressed| (*tip, pressed)))
    }

    /// The curve of the present tip on the way down.
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
        Tissue { youngs_modulus_pa: YOUNGS_MODULUS_PA, poissons_ratio: POISSONS_RATIO, ..default() },
        FixedRegion::Face(BoxFace::Bottom),
    ));
}

fn set_up_hand(mut commands: Commands, options: Res<StageOptions>, measured: Res<Measured>) {
    // With a rigid coupling the depth of the tool is that of the device.
    let tool = HapticTool::new("stairs")
        .with_scheme(options.scheme)
        .with_shape(measured.tip().shape())
        .with_friction(0.0)
        .with_coupling(ToolCoupling::Rigid);
    commands.spawn((tool, TickRecording { keep: 1000, ..default() }));
}

fn change_tip(mut measured: ResMut<Measured>, mut tools: Query<&mut HapticTool>) {
    // Changes before the next tip starts.
    let turns = (measured.hand.s() + 0.5 * hand::CHANGE_S) / hand::SECONDS;
    let now = (turns as usize).min(measured.tips.len() - 1);
    if std::mem::replace(&mut measured.now, now) != now {
        tools.iter_mut().for_each(|mut tool| tool.shape = measured.tip().shape());
    }
}

/// Records depth and forces of the tip.
fn measure(
    tools: Query<(&ToolLoop, &ToolForce, &TickRecording)>,
    bodies: Query<&SimulatedBody>,
    mut measured: ResMut<Measured>,
) {
    let (Ok((tool, force, recording)), Ok(body)) = (tools.single(), bodies.single()) else { return };
    let Some(sample) = recording.samples.last() else { return };
    let tip = measured.tip();
    let now = measured.now;
    let (rendered_n, full_n) = (force.force_n.y, tool.contact().displayed_force_n(body.body()).y);
    let t = measured.hand.s() - now as f64 * hand::SECONDS;
    let depth_m = 0.5 * THICKNESS_M + tip.low_m() - sample.position_m.y;
    if depth_m <= 0.0 {
        return;
    }
    let pressed = Pressed { depth_m, rendered_n, full_n };
    let deepest = measured.curves[now].last().map_or(0.0, |before| before.depth_m);
    if depth_m > deepest + 2e-5 {
        measured.curves[now].push(pressed);
    }
    if let Some(stair) = hand::waited_on(t) {
        measured.waited[now][stair] = Some(pressed);
    }
}

/// Prints a table, and the same values as a line of JSON.
fn report(measured: Res<Measured>, mut done: Local<bool>) -> Result {
    if std::mem::replace(&mut *done, true) {
        return Ok(());
    }
    let mut out = std::io::stdout().lock();
    let modulus = theory::reduced_modulus_pa(YOUNGS_MODULUS_PA);
    writeln!(
        out,
        "tip         depth, mm   rendered, N   force, N   half-space, N   ratio   layer, N   ratio"
    )?;
    let mut json = Vec::new();
    for (tip, &Pressed { depth_m, rendered_n, full_n: force_n }) in measured.waited() {
        let half_space_n = theory::half_space_n(tip, modulus, depth_m);
        let layer_n = half_space_n * theory::layer(tip, THICKNESS_M, depth_m);
        let (ratio, of_layer) = (force_n / half_space_n, force_n / layer_n);
        writeln!(
            out,
            "{:10}  {:9.2}   {rendered_n:11.3}   {force_n:8.3}   {half_space_n:13.3}   {ratio:5.3}   {layer_n:8.3}   {of_layer:5.3}",
            tip.name(),
            1e3 * depth_m
        )?;
        json.push(format!(
            r#"{{"tip":"{}","depth_m":{depth_m:.6},"rendered_n":{rendered_n:.5},"force_n":{force_n:.5},"to_half_space":{ratio:.4},"to_layer":{of_layer:.4}}}"#,
            tip.name()
        ));
    }
    writeln!(
        out,
        "\nThe layer is stiffer than the half-space of the formulas because its bottom is fixed.\n[{}]",
        json.join(",")
    )?;
    Ok(())
}
