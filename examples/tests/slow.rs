//! Slow motion in scenes that depend on when the hand does what: what comes of them is the same.

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

/// From `from_s` to `to_s` slowly.
fn slowly(app: &mut App, from_s: f64, to_s: f64) {
    until(app, from_s);
    set_slow(app.world_mut(), true);
    until(app, to_s);
    set_slow(app.world_mut(), false);
}

fn measured(slow: Option<(f64, f64)>) -> Vec<(Tip, Pressed)> {
    let options = indentation::Options::parse_from(["indentation", "--headless", "--seconds", "60"]);
    let mut app = indentation::app(&options);
    app.finish();
    app.cleanup();
    if let Some((from_s, to_s)) = slow {
        slowly(&mut app, from_s, to_s);
    }
    until(&mut app, 4.2);
    let measured = app.world().resource::<Measured>();
    measured.waited().map(|(tip, pressed)| (tip, *pressed)).collect()
}

#[test]
fn indentation_measures_the_same_after_slow_motion_in_mid_stroke() {
    let (whole, slowed) = (measured(None), measured(Some((1.2, 1.3))));
    let of = |tip, all: &[(Tip, Pressed)]| all.iter().filter(|(of, _)| *of == tip).count();
    assert!(of(Tip::Ball, &whole) == 4 && of(Tip::Punch, &whole) >= 1, "{whole:?}");
    assert_eq!(whole.len(), slowed.len());
    for ((tip, a), (_, b)) in whole.iter().zip(&slowed) {
        assert!((a.depth_m - b.depth_m).abs() < 1e-6, "{tip:?}: {a:?}, {b:?}");
        assert!((a.full_n / b.full_n - 1.0).abs() < 0.01, "{tip:?}: {a:?}, {b:?}");
    }
}

#[test]
fn a_wound_that_is_sewn_is_pulled_open_after_slow_motion_and_not_sewn_again() {
    let options = suture_pull::Options::parse_from(["suture_pull", "--headless", "--seconds", "60"]);
    let mut app = suture_pull::app(&options);
    app.finish();
    app.cleanup();
    let is_held = |app: &mut App| {
        let mut tools = app.world_mut().query::<&Grasping>();
        tools.single(app.world()).is_ok_and(|grasping| grasping.body.is_some())
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
    assert!(is_held(&mut app), "what was held is held again");
    set_slow(app.world_mut(), false);
    until(&mut app, 3.0);
    assert!(!is_held(&mut app) && threads(&mut app) == (3, 0), "{:?}", threads(&mut app));
    slowly(&mut app, 4.0, 4.1);
    until(&mut app, 5.2);
    assert_eq!(threads(&mut app), (3, 3));
}
