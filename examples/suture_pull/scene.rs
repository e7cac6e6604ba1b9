//! What happens to the wound, and what is told of it.

use super::{hand, wound};
use bevy::prelude::*;
use bevy_palpate::SimulatedBody;
use bevy_palpate::prelude::*;
use palpate_stage::{SetUpHands, SetUpScene, StageOptions, register_hand};
use std::io::Write;

/// The wound is sewn when its edges are so near, m.
const SEWN_AT_M: f64 = 0.004;

/// The slab, the hand, the threads.
pub struct ScenePlugin {
    /// Tension at which a thread tears, N.
    pub tear_limit_n: f64,
}

impl Plugin for ScenePlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(Told { tear_limit_n: self.tear_limit_n, ..default() })
            .add_systems(SetUpScene, set_up)
            .add_systems(SetUpHands, set_up_hand)
            .add_systems(ModelSchedule, (wound::tighten, sew).chain().in_set(HapticSystems::First))
            .add_systems(ModelSchedule, listen.in_set(HapticSystems::Last))
            .add_systems(Last, report.pipe(fail).run_if(on_message::<AppExit>));
        register_hand(app.world_mut(), "surgeon", hand::reading);
    }
}

/// What is to be told in the end.
#[derive(Resource, Clone, Debug, Default)]
struct Told {
    tear_limit_n: f64,
    is_sewn: bool,
    /// Distance of the edges before, when sewn, and at rest, m.
    before_m: f64,
    sewn_m: f64,
    at_rest_m: f64,
    /// The largest force on the hand while it grasped, N.
    most_n: f64,
    /// Every thread while nobody held the wound, last: its length without tension, m, and what it did.
    at_rest: Vec<(f64, SutureForce)>,
    torn: Vec<SutureTorn>,
}

fn set_up(mut commands: Commands, mut told: ResMut<Told>) {
    *told = Told { tear_limit_n: told.tear_limit_n, ..default() };
    commands.spawn(wound::slab());
}

fn set_up_hand(mut commands: Commands, options: Res<StageOptions>) {
    commands.spawn((
        HapticTool {
            device: DeviceSelector::named("surgeon"),
            scheme: options.scheme,
            shape: ToolShape::Sphere { radius_m: hand::RADIUS_M },
            ..default()
        },
        ToolGrasp::default(),
    ));
}

/// Sews when the hand has brought the edges together.
fn sew(
    mut commands: Commands,
    bodies: Query<(Entity, &SimulatedBody)>,
    tools: Query<&GraspedPoint>,
    mut told: ResMut<Told>,
) {
    let Ok((entity, body)) = bodies.single() else { return };
    let [left, right] = wound::edges_m(body, 0.0);
    let apart_m = left.distance(right);
    if told.before_m == 0.0 {
        told.before_m = apart_m;
    }
    let is_held = tools.iter().any(|grasping| grasping.body.is_some());
    if is_held && !told.is_sewn && apart_m < SEWN_AT_M {
        (told.is_sewn, told.sewn_m) = (true, apart_m);
        commands.spawn_batch(wound::stitches(entity, body, told.tear_limit_n));
    }
}

fn listen(
    tools: Query<(&GraspedPoint, &ToolForce)>,
    sutures: Query<(&Suture, &SutureForce)>,
    bodies: Query<&SimulatedBody>,
    mut torn: MessageReader<SutureTorn>,
    mut told: ResMut<Told>,
) {
    told.torn.extend(torn.read());
    let is_held = tools.iter().any(|(grasping, _)| grasping.body.is_some());
    for (_, force) in tools.iter().filter(|(grasping, _)| grasping.body.is_some()) {
        told.most_n = told.most_n.max(force.force_n.length());
    }
    if told.is_sewn && !is_held && told.torn.is_empty() {
        told.at_rest = sutures.iter().map(|(suture, force)| (suture.length_m, *force)).collect();
        if let Ok(body) = bodies.single() {
            let [left, right] = wound::edges_m(body, 0.0);
            told.at_rest_m = left.distance(right);
        }
    }
}

/// A table, and the same as one line of JSON.
fn report(told: Res<Told>, mut done: Local<bool>) -> Result {
    if std::mem::replace(&mut *done, true) {
        return Ok(());
    }
    let mut out = std::io::stdout().lock();
    let Told { tear_limit_n, before_m, sewn_m, at_rest_m, most_n, at_rest, torn, .. } = &*told;
    writeln!(
        out,
        "edges apart, mm          {:.2}   pulled to {:.2}   sewn {:.2}",
        1e3 * before_m,
        1e3 * sewn_m,
        1e3 * at_rest_m
    )?;
    writeln!(out, "largest force on hand, N {most_n:.3}")?;
    writeln!(
        out,
        "threads at rest          tension, N   left edge, N   right edge, N   their sum, N   longer by, mm"
    )?;
    let mut json = Vec::new();
    for (index, (length_m, force)) in at_rest.iter().enumerate() {
        let SutureForce { tension_n, pull_n: [left, right], ends_m: [from, to], .. } = force;
        let longer_m = from.distance(*to) - length_m;
        let (left_n, right_n, sum_n) = (left.length(), right.length(), (*left + *right).length());
        writeln!(
            out,
            "  {:22} {tension_n:10.4}   {left_n:12.4}   {right_n:13.4}   {sum_n:12.5}   {:13.3}",
            index + 1,
            1e3 * longer_m
        )?;
        json.push(format!(
            r#"{{"tension_n":{tension_n:.5},"left_n":{left_n:.5},"right_n":{right_n:.5},"sum_n":{sum_n:.6},"longer_m":{longer_m:.7}}}"#
        ));
    }
    let tore: Vec<String> = torn.iter().map(|torn| format!("{:.3}", torn.tension_n)).collect();
    writeln!(
        out,
        "torn                     {} of {}, at a limit of {tear_limit_n} N   tension then, N: {}",
        torn.len(),
        at_rest.len(),
        tore.join(", ")
    )?;
    writeln!(
        out,
        r#"{{"apart_m":{before_m:.5},"sewn_m":{at_rest_m:.5},"hand_n":{most_n:.4},"threads":[{}],"torn_at_n":[{}]}}"#,
        json.join(","),
        tore.join(",")
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
