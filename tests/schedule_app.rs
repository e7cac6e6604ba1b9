//! The schedule of the model steps, its place and its rate.

use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{
    HapticSchedulePlugin, HapticSystems, LoopMode, ModelRate, ModelSchedule, ModelStepCount, SimulatedBody,
    ToolPlugin,
};
use palpate_haptics::HapticsError;
use palpate_tests::app::{lockstep_app, pressing_hand, spawn_block, spawn_scene, step};
use std::time::Duration;

#[test]
fn model_steps_run_in_the_selected_schedule() {
    #[derive(Resource, Default)]
    struct Order(Vec<&'static str>);
    for is_post in [false, true] {
        let mut app = App::new();
        let mut schedule = HapticSchedulePlugin::default().with_mode(LoopMode::Lockstep);
        if is_post {
            schedule = schedule.in_schedule(FixedPostUpdate);
        }
        let step_s = Duration::from_millis(50);
        app.add_plugins((MinimalPlugins, PalpatePlugins.set(schedule)))
            .insert_resource(Time::<Fixed>::from_hz(20.0))
            .insert_resource(bevy::time::TimeUpdateStrategy::ManualDuration(step_s))
            .init_resource::<Order>()
            .add_systems(FixedPreUpdate, |mut order: ResMut<Order>| order.0.push("pre"))
            .add_systems(FixedPostUpdate, |mut order: ResMut<Order>| order.0.push("post"))
            .add_systems(FixedLast, |mut order: ResMut<Order>| order.0.push("last"))
            .add_systems(ModelSchedule, |mut order: ResMut<Order>| order.0.push("model"));
        (0..3).for_each(|_| app.update());
        let order = &app.world().resource::<Order>().0;
        let place = |name: &str| order.iter().position(|other| *other == name).unwrap();
        assert_eq!(order.iter().filter(|name| **name == "model").count(), 2, "{order:?}");
        assert!(place("pre") < place("model") && place("model") < place("last"), "{order:?}");
        if !is_post {
            assert!(place("model") < place("post"), "{order:?}");
        }
    }
}

/// A system ordered after all of [`FixedUpdate`] precedes the model step in [`FixedPostUpdate`].
#[test]
fn model_step_in_fixed_post_update_reads_the_results_of_fixed_update() {
    #[derive(Resource, Default)]
    struct Order(Vec<&'static str>);
    let schedule = HapticSchedulePlugin::default().with_mode(LoopMode::Lockstep).in_schedule(FixedPostUpdate);
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, PalpatePlugins.set(schedule)))
        .insert_resource(Time::<Fixed>::from_hz(20.0))
        .insert_resource(bevy::time::TimeUpdateStrategy::ManualDuration(Duration::from_millis(50)))
        .init_resource::<Order>()
        .add_systems(FixedUpdate, |mut order: ResMut<Order>| order.0.push("update"))
        .add_systems(ModelSchedule, |mut order: ResMut<Order>| order.0.push("model"));
    (0..3).for_each(|_| app.update());
    assert_eq!(app.world().resource::<Order>().0, ["update", "model", "update", "model"]);
}

#[test]
fn tool_plugin_adds_the_schedule_plugin() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, PalpatePlugins.build().disable::<HapticSchedulePlugin>()));
    app.finish();
    app.cleanup();
    assert!(app.is_plugin_added::<HapticSchedulePlugin>() && app.is_plugin_added::<ToolPlugin>());
    assert_eq!(*app.world().resource::<ModelRate>(), ModelRate::default());
    assert_eq!(*app.world().resource::<LoopMode>(), LoopMode::Threaded);
    app.insert_resource(bevy::time::TimeUpdateStrategy::ManualDuration(Duration::from_millis(50)));
    let body = spawn_block(&mut app);
    (0..10).for_each(|_| app.update());
    assert!(app.world().resource::<ModelStepCount>().0 > 3);
    assert!(app.world().get::<SimulatedBody>(body).is_some());
}

#[test]
fn second_of_app_time_has_twenty_model_steps_at_every_fixed_rate() {
    for hz in [64.0, 20.0, 100.0, 7.0] {
        let mut app = lockstep_app();
        app.insert_resource(Time::<Fixed>::from_hz(hz));
        for _ in 0..=200 {
            app.update();
        }
        let steps = app.world().resource::<ModelStepCount>().0;
        let expected = (10.0 - 1.0 / hz) * 20.0;
        assert!((steps as f64) > expected - 1.0 && steps <= 200, "{steps} steps at {hz} Hz");
        assert_eq!(
            app.world().resource::<Time<Fixed>>().timestep().as_secs_f64(),
            Time::<Fixed>::from_hz(hz).timestep().as_secs_f64()
        );
    }
}

#[test]
fn model_rate_is_a_whole_number_of_ticks() {
    for (hz, ticks) in [(20.0, 50), (25.0, 40), (100.0, 10), (1000.0, 1), (5.0, 200)] {
        assert_eq!(ModelRate::try_from_hz(hz).unwrap().ticks(), ticks);
        assert_eq!(ModelRate::every_ticks(ticks).unwrap(), ModelRate::try_from_hz(hz).unwrap());
    }
    for hz in [0.0, -20.0, 30.0, 4.0, 2000.0, f64::NAN, f64::INFINITY] {
        let error = ModelRate::try_from_hz(hz).unwrap_err();
        let HapticsError::Setting { value, .. } = error else { panic!("{error}") };
        assert_eq!(value.to_bits(), hz.to_bits());
    }
    assert!(ModelRate::every_ticks(0).is_err() && ModelRate::every_ticks(201).is_err());
}

#[test]
fn systems_added_before_the_plugin_run() {
    #[derive(Resource, Default)]
    struct Runs(u32);
    let mut app = App::new();
    let count = |mut runs: ResMut<Runs>| runs.0 += 1;
    app.init_resource::<Runs>().add_systems(ModelSchedule, count.in_set(HapticSystems::Last));
    let lockstep = HapticSchedulePlugin::default().with_mode(LoopMode::Lockstep);
    let step_s = Duration::from_millis(50);
    app.add_plugins((MinimalPlugins, PalpatePlugins.set(lockstep)))
        .insert_resource(bevy::time::TimeUpdateStrategy::ManualDuration(step_s));
    step(&mut app, 3);
    assert_eq!(app.world().resource::<Runs>().0, 3);
}

#[test]
#[should_panic(expected = "TimePlugin")]
fn tool_plugin_without_time_plugin_panics() {
    let mut app = App::new();
    app.add_plugins(PalpatePlugins);
    app.finish();
}

#[test]
#[should_panic(expected = "ambigu")]
fn ambiguous_systems_in_a_model_step_are_an_error() {
    let mut app = lockstep_app();
    app.add_systems(
        ModelSchedule,
        (|_: Query<&mut ToolForce>| (), |_: Query<&mut ToolForce>| ()).in_set(HapticSystems::Last),
    );
    spawn_scene(&mut app, Scheme::Hold, pressing_hand);
    step(&mut app, 1);
}
