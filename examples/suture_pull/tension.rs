//! Plot of the threads' tension over time.

use bevy::prelude::*;
use bevy_egui::{EguiContexts, EguiPrimaryContextPass};
use bevy_palpate::prelude::*;
use bevy_palpate::{HapticSystems, ModelSchedule};
use palpate_stage::{Plot, SceneTime, SetUpScene, plot_window};

pub struct TensionPlugin;

impl Plugin for TensionPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Curves>()
            .add_systems(SetUpScene, |mut curves: ResMut<Curves>| *curves = Curves::default())
            .add_systems(ModelSchedule, record.in_set(HapticSystems::Last))
            .add_systems(EguiPrimaryContextPass, show);
    }
}

/// Force on the hand and sum of the threads' tensions on each side of the wound, N, over time, s.
#[derive(Resource, Default)]
struct Curves {
    hand: Vec<[f64; 2]>,
    sides: [Vec<[f64; 2]>; 2],
}

fn record(
    time: Res<SceneTime>,
    tools: Query<&ToolForce>,
    sutures: Query<&SutureForce>,
    mut curves: ResMut<Curves>,
) {
    curves.hand.push([time.0, tools.iter().map(|force| force.force_n.length()).sum()]);
    for side in [0, 1] {
        let pull_n =
            sutures.iter().filter(|force| force.tension_n > 0.0).map(|force| force.pull_n[side].x).sum();
        curves.sides[side].push([time.0, pull_n]);
    }
}

fn show(mut contexts: EguiContexts, curves: Res<Curves>) -> Result {
    let [left, right] = curves.sides.clone();
    plot_window(
        &mut contexts,
        &Plot {
            title: "forces of threads and hand",
            axes: ["time, s", "force, N"],
            lines: &[
                ("hand", [90, 170, 255], curves.hand.clone()),
                ("left edge", [255, 140, 105], left),
                ("right edge", [240, 228, 66], right),
            ],
            points: &[],
        },
    )
}
