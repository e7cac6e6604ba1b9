//! Slow motion in scenes that depend on the time of the device: the results are the same.

#[expect(dead_code, reason = "its main is not called")]
#[path = "../indentation/main.rs"]
mod indentation;
#[expect(dead_code, reason = "its main is not called")]
#[path = "../suture_pull/main.rs"]
mod suture_pull;

use bevy::prelude::*;
use bevy_palpate::prelude::*;
use clap::Parser;
use indentation::scene::{Measured, Pressed, Tip};
use palpate_stage::{SceneTime, time::set_slow};

fn time_s(app: &App) -> f64 {
    app.world().resource::<SceneTime>().0
}

fn until(app: &mut App, end_s: f64) {
    while time_s(app) < end_s - 1e-9 {
        app.update();
    }
}

#[test]
fn indentation_is_unchanged_by_slow_motion() {
    let options = indentation::Options::parse_from(["indentation", "--headless", "--seconds", "60"]);
    let mut app = indentation::app(&options);
    app.finish();
    app.cleanup();
    // From the way down to the second step until the rest on it.
    until(&mut app, 1.05);
    set_slow(app.world_mut(), true);
    until(&mut app, 1.3);
    assert_eq!(app.world().resource::<Measured>().tip(), Tip::Ball);
    set_slow(app.world_mut(), false);
    until(&mut app, 2.9);
    assert_eq!(app.world().resource::<Measured>().tip(), Tip::Ball);
    until(&mut app, 3.05);
    let measured = app.world().resource::<Measured>();
    assert_eq!(measured.tip(), Tip::Punch, "the tip changes with the device's time");
    let waited: Vec<(Tip, Pressed)> = measured.waited().map(|(tip, pressed)| (tip, *pressed)).collect();
    assert_eq!(waited.len(), 4, "{waited:?}");
    for ((tip, pressed), depth_m) in waited.iter().zip([0.002, 0.004, 0.006, 0.008]) {
        assert!(*tip == Tip::Ball && (pressed.depth_m - depth_m).abs() < 1e-6, "{waited:?}");
        // Hertz on a half-space; the layer is stiffer at larger depths.
        let hertz_n = 4.0 / 3.0 * (20e3 / (1.0 - 0.0625)) * 0.04_f64.sqrt() * depth_m.powf(1.5);
        assert!((1.05..1.7).contains(&(pressed.full_n / hertz_n)), "{pressed:?}, {hertz_n} N");
    }
    #[cfg(feature = "panel")]
    assert!(measured.curve().is_empty(), "the punch has not pressed yet");
}

#[test]
fn slow_motion_keeps_the_threads_of_a_sewn_wound() {
    let options = suture_pull::Options::parse_from(["suture_pull", "--headless", "--seconds", "60"]);
    let mut app = suture_pull::app(&options);
    app.finish();
    app.cleanup();
    let is_held = |app: &mut App| {
        let mut tools = app.world_mut().query::<&GraspedPoint>();
        tools.single(app.world()).is_ok_and(|grasped| grasped.body.is_some())
    };
    let threads = |app: &mut App| {
        let mut sutures = app.world_mut().query::<&SutureForce>();
        let torn = sutures.iter(app.world()).filter(|force| force.is_torn).count();
        (sutures.iter(app.world()).count(), torn)
    };
    until(&mut app, 1.45);
    assert!(is_held(&mut app) && threads(&mut app) == (3, 0), "{:?}", threads(&mut app));
    set_slow(app.world_mut(), true);
    until(&mut app, 1.48);
    assert!(is_held(&mut app), "the grasp closes again");
    set_slow(app.world_mut(), false);
    until(&mut app, 3.0);
    assert!(!is_held(&mut app) && threads(&mut app) == (3, 0), "{:?}", threads(&mut app));
    until(&mut app, 4.0);
    set_slow(app.world_mut(), true);
    until(&mut app, 4.05);
    set_slow(app.world_mut(), false);
    until(&mut app, 5.2);
    let (sewn, torn) = threads(&mut app);
    assert!(sewn == 3 && torn >= 1, "{torn} of {sewn}");
}
