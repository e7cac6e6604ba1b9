//! Time within the model's schedule, its rate, and systems of an app in it.

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_palpate::prelude::*;
use bevy_palpate::{HapticFaultKind, HapticSystems, Model, ModelRate, ModelSchedule, ToolSettings, testing};
use palpate_tests::app::{collect_messages, lockstep_app, pressing_hand, spawn_scene, step, take_kinds};
use std::time::Duration;

/// Delta and elapsed time of `Res<Time>` in each model step, and of `Res<Time>` in the following frame, ms.
#[derive(Resource, Default)]
struct Times {
    model: Vec<(u128, u128)>,
    frames: Vec<u128>,
}

fn ms(time: &Time) -> (u128, u128) {
    (time.delta().as_millis(), time.elapsed().as_millis())
}

fn record_model(time: Res<Time>, mut times: ResMut<Times>) {
    times.model.push(ms(&time));
}

/// Kinds of the faults since the last call, except slow steps: on a busy machine even an empty step may take longer than its period.
fn kinds_but_slow_steps(app: &mut App) -> Vec<HapticFaultKind> {
    take_kinds(app).into_iter().filter(|kind| !matches!(kind, HapticFaultKind::SlowStep(_))).collect()
}

fn record_times(app: &mut App) {
    app.init_resource::<Times>()
        .add_systems(ModelSchedule, record_model.in_set(HapticSystems::First))
        .add_systems(Update, |time: Res<Time>, mut times: ResMut<Times>| {
            times.frames.push(time.delta().as_millis());
        });
}

#[test]
fn time_in_the_models_schedule_is_that_of_the_model() {
    let mut app = lockstep_app();
    record_times(&mut app);
    app.insert_resource(ModelRate::from_hz(40.0));
    step(&mut app, 4);
    let times = app.world().resource::<Times>();
    assert_eq!(times.model, [(25, 25), (25, 50), (25, 75), (25, 100)]);
    // The app's own time is unchanged by the steps. Its first update has no duration.
    assert_eq!(times.frames, [0, 50, 50]);
    assert_eq!(app.world().resource::<Time<Model>>().elapsed(), Duration::from_millis(100));
    assert_eq!(app.world().resource::<Time<Fixed>>().timestep(), Duration::from_millis(50));
}

/// An app with loops on threads, but without tools, whose frames take `frame_ms`.
fn threaded_app(frame_ms: u64) -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, PalpatePlugins))
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(frame_ms)));
    collect_messages(&mut app);
    record_times(&mut app);
    app
}

#[test]
fn model_time_follows_the_app_with_loops_on_threads() {
    let mut app = threaded_app(25);
    (0..=400).for_each(|_| app.update());
    let (last, elapsed_ms) = *app.world().resource::<Times>().model.last().unwrap();
    assert_eq!(last, 50);
    // Ten seconds, less what a step still waits for.
    assert!((9900..=10_000).contains(&elapsed_ms), "{elapsed_ms}");
    let kinds = kinds_but_slow_steps(&mut app);
    assert!(kinds.is_empty(), "{kinds:?}");
}

#[test]
fn late_step_simulates_two_periods_and_drops_the_rest() {
    let mut app = threaded_app(240);
    (0..=20).for_each(|_| app.update());
    let times = app.world().resource::<Times>();
    assert!(
        times.model.len() == 20 && times.model[5..].iter().all(|(delta, _)| *delta == 100),
        "{:?}",
        times.model
    );
}

#[test]
fn rate_above_the_fixed_main_loop_is_reported_once_with_both_rates() {
    let mut app = threaded_app(16);
    app.insert_resource(ModelRate::from_hz(1000.0));
    (0..20).for_each(|_| app.update());
    let kinds = kinds_but_slow_steps(&mut app);
    let [HapticFaultKind::ModelRateLimited { model_hz, fixed_hz }] = kinds[..] else { panic!("{kinds:?}") };
    assert_eq!((model_hz, fixed_hz), (1000.0, 64.0));
    // Each step covers a step of the fixed main loop: no time is lost.
    let elapsed_ms = app.world().resource::<Times>().model.last().unwrap().1;
    assert!((270..=304).contains(&elapsed_ms), "{elapsed_ms}");
    // The remedy of the text.
    app.insert_resource(Time::<Fixed>::from_hz(1000.0));
    (0..20).for_each(|_| app.update());
    let kinds = kinds_but_slow_steps(&mut app);
    assert!(kinds.is_empty(), "{kinds:?}");
}

#[test]
fn system_without_an_order_does_not_end_the_app() {
    #[derive(Resource, Default)]
    struct Forces(Vec<f64>);
    let mut app = testing::headless_app();
    app.init_resource::<Forces>().add_systems(
        ModelSchedule,
        (
            |tools: Query<&ToolForce>, mut forces: ResMut<Forces>| {
                forces.0.extend(tools.iter().map(|force| force.force_n.y));
            },
            |mut tools: Query<&mut ToolSettings>| tools.iter_mut().for_each(|mut tool| tool.set_changed()),
        ),
    );
    spawn_scene(&mut app, Scheme::NearFieldExact, pressing_hand);
    testing::advance_model_steps(&mut app, 12);
    let forces = &app.world().resource::<Forces>().0;
    assert!(forces.len() >= 11 && forces.iter().any(|force| *force > 0.1), "{forces:?}");
}
