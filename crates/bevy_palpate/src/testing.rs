//! Helpers for headless tests of scenes: an app in lock step that advances by model steps.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_palpate::palpate_haptics::{Reading, ScriptedDevice};
//! use bevy_palpate::{FaultSeverity, prelude::*, testing};
//!
//! // A test of a scene: a tool presses 5 mm into a block, and the block pushes back.
//! let mut app = testing::headless_app();
//! app.world_mut().resource_mut::<HapticDevices>().register("script", || {
//!     Ok(ScriptedDevice::new(|n, _| Ok(Reading::at(DVec3::Y * (0.06 - 1e-5 * n.min(1000) as f64)))))
//! });
//! let body = app.world_mut().spawn((DeformableBody::block([6; 3], 0.1), FixedRegion::Face(BoxFace::Bottom))).id();
//! let tool = app.world_mut().spawn(HapticTool::new("script")).id();
//! testing::wait_for_body(&mut app, body);
//! testing::advance_model_steps(&mut app, 30);
//! let force = app.world().get::<ToolForce>(tool).unwrap();
//! assert!(force.force_n.y > 0.1, "{force:?}");
//! testing::assert_no_faults(&mut app, FaultSeverity::Load);
//!
//! // A body of no nodes is rejected.
//! let body = app.world_mut().spawn(DeformableBody::block([0; 3], 0.1)).id();
//! let reason = testing::wait_for_rejection(&mut app, body);
//! let faults = testing::take_faults(&mut app);
//! assert_eq!((faults[0].entity, faults[0].kind.report()), (Some(body), reason));
//! ```

use crate::body::{BodyState, DeformableBody};
use crate::fault::{FaultSeverity, HapticFault};
use crate::model_time::{LoopMode, ModelStepCount};
use crate::plugins::PalpatePlugins;
use crate::schedule::HapticSchedulePlugin;
use bevy::app::PluginsState;
use bevy::asset::AssetPlugin;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use std::time::Duration;

/// Simulated time of an update, ms: below the 15.6 ms of Bevy's fixed main loop, so at most one model step falls into an update.
const UPDATE_MS: u64 = 10;

/// Maximum number of updates to the next model step.
const MAX_UPDATES: usize = 1000;

/// Maximum number of updates until a body is built.
const MAX_BUILD_UPDATES: usize = 100_000;

/// Returns an app for tests: Bevy's `MinimalPlugins`, assets and meshes, and [`PalpatePlugins`] in [`LoopMode::Lockstep`] with simulated
/// time. It has no window and no threads for loops, gives the same bits in every run, and collects faults for [`take_faults`].
///
/// Bodies of primitives that Bevy's loader of glTF reads also need `ImagePlugin`, `WorldSerializationPlugin` and `GltfPlugin` (feature
/// `gltf`).
pub fn headless_app() -> App {
    let schedule = HapticSchedulePlugin::default().with_mode(LoopMode::Lockstep);
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), MeshPlugin, PalpatePlugins.set(schedule)))
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(UPDATE_MS)));
    collect_faults(&mut app);
    app
}

/// Faults of the app since the last [`take_faults`].
#[derive(Resource, Default)]
struct CollectedFaults(Vec<HapticFault>);

/// Collects the faults of an app that is not made by [`headless_app`], for [`take_faults`]. A second call has no effect.
pub fn collect_faults(app: &mut App) {
    if app.world().contains_resource::<CollectedFaults>() {
        return;
    }
    app.add_message::<HapticFault>().init_resource::<CollectedFaults>().add_systems(
        Last,
        |mut messages: MessageReader<HapticFault>, mut faults: ResMut<CollectedFaults>| {
            faults.0.extend(messages.read().cloned());
        },
    );
}

/// Returns the faults of all updates since the last call, in order.
///
/// # Panics
/// If the app does not collect faults ([`collect_faults`]).
pub fn take_faults(app: &mut App) -> Vec<HapticFault> {
    let faults = app.world_mut().get_resource_mut::<CollectedFaults>();
    let mut faults = faults.expect("the app does not collect faults; call testing::collect_faults first");
    std::mem::take(&mut faults.0)
}

/// Takes the faults since the last call, and asserts that none of them has the severity `from` or a higher one.
///
/// # Panics
/// With the reports of those faults. If the app does not collect faults ([`collect_faults`]).
#[track_caller]
pub fn assert_no_faults(app: &mut App, from: FaultSeverity) {
    let faults = take_faults(app);
    let found: Vec<String> =
        faults.iter().filter(|fault| fault.severity() >= from).map(HapticFault::report).collect();
    assert!(found.is_empty(), "faults of severity {from:?} or above: {found:#?}");
}

/// Updates `app` until `steps` more model steps have run. Finishes its plugins first if necessary.
///
/// # Panics
/// If no model step runs within 1000 updates: time is paused, or the app has no [`PalpatePlugins`].
pub fn advance_model_steps(app: &mut App, steps: u64) {
    finish_plugins(app);
    let count = |app: &App| app.world().get_resource::<ModelStepCount>().map_or(0, |count| count.0);
    for _ in 0..steps {
        let before = count(app);
        let has_run = (0..MAX_UPDATES).any(|_| {
            app.update();
            count(app) > before
        });
        assert!(
            has_run,
            "no model step in {MAX_UPDATES} updates; is the app's time paused, or PalpatePlugins missing?"
        );
    }
}

/// Updates `app` until the body of `entity` is simulated. Finishes the app's plugins first if necessary.
///
/// # Panics
/// If the entity has no [`DeformableBody`], if the body is rejected, or if it is not built within 100,000 updates.
#[track_caller]
pub fn wait_for_body(app: &mut App, entity: Entity) {
    if let BodyState::Rejected(reason) = built_state(app, entity) {
        panic!("the body of {entity} is rejected: {reason}");
    }
}

/// Updates `app` until the body of `entity` is rejected, and returns the reason ([`BodyState::Rejected`]). Finishes the app's plugins first
/// if necessary.
///
/// # Panics
/// If the entity has no [`DeformableBody`], if the body is built, or if it is not rejected within 100,000 updates.
#[track_caller]
pub fn wait_for_rejection(app: &mut App, entity: Entity) -> String {
    match built_state(app, entity) {
        BodyState::Rejected(reason) => reason,
        _ => panic!("the body of {entity} is built; it was expected to be rejected"),
    }
}

/// Updates the app at least once, until the body is built or rejected.
#[track_caller]
fn built_state(app: &mut App, entity: Entity) -> BodyState {
    finish_plugins(app);
    assert!(app.world().get::<DeformableBody>(entity).is_some(), "{entity} has no DeformableBody");
    let state = (0..MAX_BUILD_UPDATES).find_map(|_| {
        app.update();
        let state = app.world().get::<BodyState>(entity).cloned();
        let is_built = matches!(state, Some(BodyState::Ready | BodyState::Rejected(_)));
        if !is_built {
            std::thread::yield_now();
        }
        state.filter(|_| is_built)
    });
    state.unwrap_or_else(|| panic!("the body of {entity} is not built after {MAX_BUILD_UPDATES} updates"))
}

/// Finishes the plugins of an app that has not run, like its runner.
fn finish_plugins(app: &mut App) {
    if app.plugins_state() == PluginsState::Cleaned {
        return;
    }
    while app.plugins_state() == PluginsState::Adding {
        bevy::tasks::tick_global_task_pools_on_main_thread();
    }
    app.finish();
    app.cleanup();
}
