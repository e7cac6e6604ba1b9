//! What the scene reports: the forces on the tray, and the way of the lump.

use super::hand;
use super::scene::Piece;
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{HapticSystems, ModelSchedule, ObstacleForce, SimulatedBody};
use palpate_stage::{SceneTime, SetUpScene};
use std::io::Write;

/// Records the scene, and reports it at its end.
pub struct OutcomePlugin;

impl Plugin for OutcomePlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Outcome>()
            .add_systems(SetUpScene, |mut outcome: ResMut<Outcome>| *outcome = Outcome::default())
            .add_systems(ModelSchedule, record.in_set(HapticSystems::Last))
            .add_systems(Last, report.pipe(palpate_stage::exit_on_error).run_if(on_message::<AppExit>));
    }
}

/// Data of the report.
#[derive(Resource, Clone, Debug, Default)]
struct Outcome {
    /// Weight of the organ, N.
    organ_n: f64,
    /// Mean force of the organ on the tray, N, downward: before the hand presses, and while it presses at its lowest place.
    on_tray_n: [Mean; 2],
    /// Mean force of the hand on the organ, N, downward, while it presses at its lowest place.
    hand_n: Mean,
    /// Height of the lump, m, and its distance across from its start.
    lump_m: [f32; 2],
    lump_start: Option<Vec3>,
    /// Distance of the tray from its start, m.
    tray_m: f32,
    tray_start: Option<Vec3>,
}

/// A mean of values.
#[derive(Clone, Copy, Debug, Default)]
struct Mean {
    sum: f64,
    count: f64,
}

impl Mean {
    fn add(&mut self, value: f64) {
        (self.sum, self.count) = (self.sum + value, self.count + 1.0);
    }

    fn value(self) -> f64 {
        self.sum / self.count.max(1.0)
    }
}

fn record(
    time: Res<SceneTime>,
    gravity: Res<Gravity>,
    bodies: Query<&SimulatedBody>,
    tools: Query<&ToolForce>,
    pieces: Query<(&Piece, &Transform, Option<&ObstacleForce>), Without<ChildOf>>,
    mut outcome: ResMut<Outcome>,
) {
    let Ok(body) = bodies.single() else { return };
    outcome.organ_n = gravity.0.length() * body.body().network().mass_kg().iter().sum::<f64>();
    let [from_s, to_s] = hand::PRESSES_S;
    // The tool is on its way between them.
    let phase = if (from_s - 1.0..from_s - 0.7).contains(&time.0) {
        Some(0)
    } else if (from_s + 0.3..to_s).contains(&time.0) {
        Some(1)
    } else {
        None
    };
    for (piece, transform, force) in &pieces {
        let at = transform.translation;
        match (piece, phase, force) {
            (Piece::Tray, phase, Some(force)) => {
                let start = *outcome.tray_start.get_or_insert(at);
                outcome.tray_m = at.distance(start);
                if let Some(phase) = phase {
                    outcome.on_tray_n[phase].add(-force.force_n.y);
                }
            }
            (Piece::Lump, ..) => {
                let start = *outcome.lump_start.get_or_insert(at);
                outcome.lump_m = [at.y, (at - start).with_y(0.0).length()];
            }
            _ => {}
        }
    }
    if let (Some(1), Ok(force)) = (phase, tools.single()) {
        outcome.hand_n.add(force.force_n.y);
    }
}

/// Prints a table, and the same values as a line of JSON.
fn report(outcome: Res<Outcome>, mut done: Local<bool>) -> Result {
    if std::mem::replace(&mut *done, true) {
        return Ok(());
    }
    let Outcome { organ_n, on_tray_n, hand_n, lump_m: [height_m, way_m], tray_m, .. } = *outcome;
    let ([rest_n, pressed_n], hand_n) = (on_tray_n.map(Mean::value), hand_n.value());
    let mut out = std::io::stdout().lock();
    writeln!(out, "weight of the organ, N             {organ_n:.3}")?;
    writeln!(out, "on the tray, N                     {rest_n:.3}   pressed {pressed_n:.3}")?;
    writeln!(out, "on the hand, N                     {hand_n:.3}")?;
    writeln!(out, "lump: height, way, mm              {:.1}   {:.1}", 1e3 * height_m, 1e3 * way_m)?;
    writeln!(out, "way of the tray, mm                {:.2}", 1e3 * tray_m)?;
    writeln!(
        out,
        r#"{{"organ_n":{organ_n:.4},"rest_n":{rest_n:.4},"pressed_n":{pressed_n:.4},"hand_n":{hand_n:.4},"lump_height_m":{height_m:.5},"lump_way_m":{way_m:.5},"tray_way_m":{tray_m:.6}}}"#
    )?;
    Ok(())
}
