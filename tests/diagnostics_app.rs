//! Bevy's diagnostics of a headless app, in lock step.

use bevy::diagnostic::{Diagnostic, DiagnosticPath, DiagnosticsStore};
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{
    ForceError, HapticDiagnosticsPlugin as Of, HapticSchedulePlugin, LocalModelStats, LoopMode,
    ModelStepCount,
};
use palpate_tests::app::{lockstep_app, pressing_hand, spawn_scene, step};

fn of<'a>(app: &'a App, path: &DiagnosticPath) -> &'a Diagnostic {
    app.world().resource::<DiagnosticsStore>().get(path).unwrap()
}

fn value(app: &App, path: &DiagnosticPath) -> f64 {
    of(app, path).value().unwrap_or_else(|| panic!("{path} has not been measured"))
}

#[test]
fn diagnostics_agree_with_the_components() {
    let mut app = lockstep_app();
    let (_, tool) = spawn_scene(&mut app, Scheme::Tangent, pressing_hand);
    step(&mut app, 12);
    let world = app.world();
    let built = world.get::<LocalModelStats>(tool).unwrap();
    assert_eq!(value(&app, &Of::LOCAL_MODEL_BUILD), 1e3 * built.time_s);
    let force = world.get::<ToolForce>(tool).unwrap().force_n.length();
    assert!(force > 0.1 && value(&app, &Of::FORCE) == force);
    let error = world.get::<ForceError>(tool).unwrap();
    assert_eq!(value(&app, &Of::FORCE_ERROR), error.rms_n);
    let share = 100.0 * error.jnd_ratio.unwrap();
    assert_eq!(value(&app, &Of::FORCE_JND_RATIO), share);
    // Lock step has no deadlines, and reads no clock in a tick.
    for path in [Of::MISSED_DEADLINES, Of::LATENESS_P99, Of::TICK_COST_P99] {
        assert_eq!(value(&app, &path), 0.0, "{path}");
    }
    for path in [
        Of::FRAME_COST,
        Of::MODEL_STEP_COST,
        Of::LOCAL_MODEL_BUILD,
        Of::FORCE,
        Of::FORCE_ERROR,
        Of::FORCE_JND_RATIO,
        Of::LATENESS_P99,
        Of::TICK_COST_P99,
    ] {
        assert!(path.as_str().starts_with("palpate/") && !of(&app, &path).suffix.is_empty(), "{path}");
    }
}

#[test]
fn frame_cost_includes_the_model_step() {
    let mut app = lockstep_app();
    spawn_scene(&mut app, Scheme::NearFieldExact, pressing_hand);
    // The first update runs no model step.
    let steps = app.world().resource::<ModelStepCount>().0;
    assert_eq!(steps, 0);
    for _ in 0..10 {
        step(&mut app, 1);
        let [frame, step, build] =
            [Of::FRAME_COST, Of::MODEL_STEP_COST, Of::LOCAL_MODEL_BUILD].map(|path| of(&app, &path).value());
        let (frame, step) = (frame.unwrap(), step.unwrap());
        assert!(frame > step && step > 0.0, "a frame {frame} ms, its model step {step} ms");
        assert!(
            build.is_none_or(|build| build < step),
            "a local model {build:?} ms, its model step {step} ms"
        );
    }
    let measured = of(&app, &Of::MODEL_STEP_COST).history_len();
    assert_eq!(measured as u64, app.world().resource::<ModelStepCount>().0);
}

#[test]
fn app_runs_without_the_diagnostics_plugin() {
    let mut app = App::new();
    app.add_plugins(MinimalPlugins).add_plugins(
        PalpatePlugins.set(HapticSchedulePlugin::default().with_mode(LoopMode::Lockstep)).disable::<Of>(),
    );
    (0..5).for_each(|_| app.update());
    let store = app.world().get_resource::<DiagnosticsStore>();
    assert!(store.is_none_or(|store| store.get(&Of::FRAME_COST).is_none()));
}
