//! The helpers of `bevy_palpate::testing`.

use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{BodyState, FaultSeverity, ModelStepCount, testing};
use palpate_tests::app::{force_n, resting_hand, spawn_block, spawn_tool};

#[test]
fn testing_collects_faults_and_waits_for_rejections() {
    let mut app = testing::headless_app();
    let body = spawn_block(&mut app);
    testing::wait_for_body(&mut app, body);
    testing::assert_no_faults(&mut app, FaultSeverity::Load);
    let empty = app.world_mut().spawn(DeformableBody::block([0; 3], 0.1)).id();
    let reason = testing::wait_for_rejection(&mut app, empty);
    // The faults of several model steps are collected.
    let tool = app.world_mut().spawn(HapticTool::new("missing")).id();
    testing::advance_model_steps(&mut app, 10);
    let faults = testing::take_faults(&mut app);
    assert_eq!(faults.iter().map(|fault| fault.entity).collect::<Vec<_>>(), [Some(empty), Some(tool)]);
    assert_eq!((faults[0].kind.report(), faults[0].report()), (reason.clone(), reason));
    assert_eq!(testing::take_faults(&mut app).len(), 0);
    testing::assert_no_faults(&mut app, FaultSeverity::Load);
}

#[test]
#[should_panic(expected = "faults of severity Warning or above")]
fn testing_asserts_the_severity() {
    let mut app = testing::headless_app();
    app.world_mut().spawn(HapticTool::new("missing"));
    testing::advance_model_steps(&mut app, 1);
    testing::assert_no_faults(&mut app, FaultSeverity::Warning);
}

#[test]
#[should_panic(expected = "expected to be rejected")]
fn testing_waits_for_a_rejection_only() {
    let mut app = testing::headless_app();
    let body = spawn_block(&mut app);
    testing::wait_for_rejection(&mut app, body);
}

#[test]
fn testing_helpers_wait_for_the_body_and_count_model_steps() {
    let mut app = testing::headless_app();
    let body = spawn_block(&mut app);
    let tool = spawn_tool(&mut app, resting_hand);
    testing::wait_for_body(&mut app, body);
    assert_eq!(app.world().get::<BodyState>(body), Some(&BodyState::Ready));
    let count = |app: &App| app.world().resource::<ModelStepCount>().0;
    for steps in [1, 3, 20] {
        let before = count(&app);
        testing::advance_model_steps(&mut app, steps);
        assert_eq!(count(&app), before + steps);
    }
    assert!(force_n(&app, tool).y > 0.5, "{}", force_n(&app, tool));
}

#[test]
#[should_panic(expected = "has no DeformableBody")]
fn wait_for_body_panics_without_deformable_body() {
    let mut app = testing::headless_app();
    let entity = app.world_mut().spawn_empty().id();
    testing::wait_for_body(&mut app, entity);
}

#[test]
#[should_panic(expected = "is rejected")]
fn wait_for_body_panics_if_the_body_is_rejected() {
    let mut app = testing::headless_app();
    let body = app.world_mut().spawn(DeformableBody::block([1, 6, 6], 0.1)).id();
    testing::wait_for_body(&mut app, body);
}

#[test]
#[should_panic(expected = "no model step")]
fn advance_model_steps_panics_if_the_time_is_paused() {
    let mut app = testing::headless_app();
    app.world_mut().resource_mut::<Time<Virtual>>().pause();
    testing::advance_model_steps(&mut app, 1);
}

#[test]
#[should_panic(expected = "no model step")]
fn advance_model_steps_panics_without_palpate() {
    let mut app = App::new();
    app.add_plugins(MinimalPlugins);
    testing::advance_model_steps(&mut app, 1);
}
