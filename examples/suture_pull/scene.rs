//! The scene, and its report.

use super::{hand, wound};
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{HapticSystems, ModelSchedule, SimulatedBody};
use palpate_stage::{SetUpHands, SetUpScene, StageOptions, register_hand};
use std::io::Write;

/// Distance of the edges at which the wound is sewn, m.
const SEWN_AT_M: f64 = 0.004;

/// Adds the slab, the tool and the threads.
pub struct ScenePlugin {
    /// Tension at which a thread tears, N.
    pub tear_limit_n: f64,
}

impl Plugin for ScenePlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(Outcome { tear_limit_n: self.tear_limit_n, ..default() })
            .add_systems(SetUpScene, set_up)
            .add_systems(SetUpHands, set_up_hand)
            .add_systems(ModelSchedule, (wound::tighten, sew).chain().in_set(HapticSystems::First))
            .add_systems(ModelSchedule, record.in_set(HapticSystems::Last))
            .add_systems(Last, report.pipe(palpate_stage::exit_on_error).run_if(on_message::<AppExit>));
        register_hand(app.world_mut(), "surgeon", hand::reading);
    }
}

/// Data of the report.
#[derive(Resource, Clone, Debug, Default)]
struct Outcome {
    tear_limit_n: f64,
    is_sewn: bool,
    /// Distance of the edges before, m.
    before_m: f64,
    /// Distance of the edges when they are sewn, m.
    sewn_m: f64,
    /// Distance of the sewn edges at rest, m.
    at_rest_m: f64,
    /// Maximum force on the hand during a grasp, N.
    max_n: f64,
    /// Length, m, and force of every thread, last without a grasp.
    at_rest: Vec<(f64, SutureForce)>,
    torn: Vec<SutureTorn>,
}

fn set_up(mut commands: Commands, mut outcome: ResMut<Outcome>) {
    *outcome = Outcome { tear_limit_n: outcome.tear_limit_n, ..default() };
    commands.spawn(wound::slab());
}

fn set_up_hand(mut commands: Commands, options: Res<StageOptions>) {
    let shape = ToolShape::Sphere { radius_m: hand::RADIUS_M };
    let tool = HapticTool::new("surgeon").with_scheme(options.scheme).with_shape(shape);
    commands.spawn((tool, ToolGrasp::default()));
}

/// Sews when the tool has moved the edges together.
fn sew(
    mut commands: Commands,
    bodies: Query<(Entity, &SimulatedBody)>,
    tools: Query<&GraspedPoint>,
    mut outcome: ResMut<Outcome>,
) {
    let Ok((entity, body)) = bodies.single() else { return };
    let [left, right] = wound::edges_m(body, 0.0);
    let apart_m = left.distance(right);
    if outcome.before_m == 0.0 {
        outcome.before_m = apart_m;
    }
    let is_held = tools.iter().any(|grasped| grasped.body.is_some());
    if is_held && !outcome.is_sewn && apart_m < SEWN_AT_M {
        (outcome.is_sewn, outcome.sewn_m) = (true, apart_m);
        commands.spawn_batch(wound::stitches(entity, body, outcome.tear_limit_n));
    }
}

fn record(
    tools: Query<(&GraspedPoint, &ToolForce)>,
    sutures: Query<(&Suture, &SutureForce)>,
    bodies: Query<&SimulatedBody>,
    mut torn: MessageReader<SutureTorn>,
    mut outcome: ResMut<Outcome>,
) {
    outcome.torn.extend(torn.read());
    let is_held = tools.iter().any(|(grasped, _)| grasped.body.is_some());
    for (_, force) in tools.iter().filter(|(grasped, _)| grasped.body.is_some()) {
        outcome.max_n = outcome.max_n.max(force.force_n.length());
    }
    if outcome.is_sewn && !is_held && outcome.torn.is_empty() {
        outcome.at_rest = sutures.iter().map(|(suture, force)| (suture.length_m, *force)).collect();
        if let Ok(body) = bodies.single() {
            let [left, right] = wound::edges_m(body, 0.0);
            outcome.at_rest_m = left.distance(right);
        }
    }
}

/// Prints a table, and the same values as a line of JSON.
fn report(outcome: Res<Outcome>, mut done: Local<bool>) -> Result {
    if std::mem::replace(&mut *done, true) {
        return Ok(());
    }
    let mut out = std::io::stdout().lock();
    let Outcome { tear_limit_n, before_m, sewn_m, at_rest_m, max_n, at_rest, torn, .. } = &*outcome;
    writeln!(
        out,
        "distance of edges, mm    {:.2}   pulled to {:.2}   sewn {:.2}",
        1e3 * before_m,
        1e3 * sewn_m,
        1e3 * at_rest_m
    )?;
    writeln!(out, "maximum force, N         {max_n:.3}")?;
    writeln!(
        out,
        "threads at rest          tension, N   left edge, N   right edge, N         sum, N   extension, mm"
    )?;
    let mut json = Vec::new();
    for (index, (length_m, force)) in at_rest.iter().enumerate() {
        let SutureForce { tension_n, pull_n: [left, right], ends_m: [from, to], .. } = force;
        let extension_m = from.distance(*to) - length_m;
        let (left_n, right_n, sum_n) = (left.length(), right.length(), (*left + *right).length());
        writeln!(
            out,
            "  {:22} {tension_n:10.4}   {left_n:12.4}   {right_n:13.4}   {sum_n:12.5}   {:13.3}",
            index + 1,
            1e3 * extension_m
        )?;
        json.push(format!(
            r#"{{"tension_n":{tension_n:.5},"left_n":{left_n:.5},"right_n":{right_n:.5},"sum_n":{sum_n:.6},"extension_m":{extension_m:.7}}}"#
        ));
    }
    let torn_at: Vec<String> = torn.iter().map(|torn| format!("{:.3}", torn.tension_n)).collect();
    writeln!(
        out,
        "torn                     {} of {}, with a limit of {tear_limit_n} N   at tensions, N: {}",
        torn.len(),
        at_rest.len(),
        torn_at.join(", ")
    )?;
    writeln!(
        out,
        r#"{{"apart_m":{before_m:.5},"sewn_m":{at_rest_m:.5},"hand_n":{max_n:.4},"threads":[{}],"torn_at_n":[{}]}}"#,
        json.join(","),
        torn_at.join(",")
    )?;
    Ok(())
}
