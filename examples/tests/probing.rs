//! The organ of the scene `probing` on its table, at rest and under the hand.

#[expect(dead_code, reason = "its main is not called")]
#[path = "../probing/main.rs"]
mod probing;

use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{LoopMode, ObstacleForce, SimulatedBody};
use clap::Parser;
use palpate_stage::{SceneTime, Stage, time::set_slow};

/// The scene in lock step, a model step in each update.
fn app() -> App {
    let folder = std::env::temp_dir().join("palpate-probing");
    let arguments = ["probing", "--headless", "--seconds", "60", "--out", &folder.display().to_string()];
    let options = probing::Options::parse_from(arguments);
    let mut app = probing::app(Stage { mode: LoopMode::Lockstep, ..probing::stage() }, options);
    app.finish();
    app.cleanup();
    app
}

fn single<T: Component + Clone>(app: &mut App) -> T {
    app.world_mut().query::<&T>().single(app.world()).unwrap().clone()
}

/// The organ's body.
fn body(app: &mut App) -> &palpate_body::Body {
    app.world_mut().query::<&SimulatedBody>().single(app.world()).unwrap().body()
}

/// Centre of mass of the organ, m.
fn center_m(app: &mut App) -> DVec3 {
    let body = body(app);
    let mass_kg = body.network().mass_kg();
    let moment: DVec3 = mass_kg.iter().zip(body.positions_m()).map(|(m, x)| *m * *x).sum();
    moment / mass_kg.iter().sum::<f64>()
}

/// Updates until the hand is there; returns the time in which the organ has come to rest, s.
fn until_hand(app: &mut App) -> f64 {
    let mut settling_s = 0.0;
    while app.world_mut().query::<&HapticTool>().iter(app.world()).next().is_none() {
        let has_body = app.world_mut().query::<&SimulatedBody>().iter(app.world()).next().is_some();
        app.update();
        settling_s += if has_body { 0.05 } else { 0.0 };
        assert!(settling_s < 6.0, "there is no hand");
    }
    settling_s
}

#[test]
fn table_alone_holds_the_organ() {
    let mut app = app();
    let settling_s = until_hand(&mut app);
    assert!((0.5..2.5).contains(&settling_s), "{settling_s} s");
    let organ = body(&mut app);
    assert!(organ.is_settled(), "asleep before the hand comes");
    let nodes = organ.network();
    assert_eq!(nodes.free().len(), nodes.node_count(), "nothing is fixed");
    let weight_n = nodes.mass_kg().iter().sum::<f64>() * Gravity::EARTH.0.length();
    let on_table_n = single::<ObstacleForce>(&mut app).force_n;
    assert!((on_table_n + weight_n * DVec3::Y).length() < 0.01 * weight_n, "{on_table_n} N, {weight_n} N");

    // The hand does not push the organ across the table.
    let start_m = center_m(&mut app);
    let (mut max_n, mut farthest_m) = (0.0_f64, 0.0_f64);
    while app.world().resource::<SceneTime>().0 < 5.0 - 1e-9 {
        app.update();
        max_n = max_n.max(single::<ToolForce>(&mut app).force_n.length());
        farthest_m = farthest_m.max(center_m(&mut app).distance(start_m));
    }
    let way_m = center_m(&mut app).distance(start_m);
    assert!(max_n > 0.5 && farthest_m < 4e-3 && way_m < 5e-4, "{max_n} N, {farthest_m} m, {way_m} m");
}

#[test]
fn hand_comes_in_slow_motion_and_presses_after_it() {
    let mut app = app();
    while app.world_mut().query::<&SimulatedBody>().iter(app.world()).next().is_none() {
        app.update();
    }
    set_slow(app.world_mut(), true);
    while app.world_mut().query::<&HapticTool>().iter(app.world()).next().is_none() {
        app.update();
    }
    assert!(body(&mut app).is_settled());
    while app.world().resource::<SceneTime>().0 < 0.1 - 1e-9 {
        app.update();
    }
    set_slow(app.world_mut(), false);
    let mut max_n = 0.0_f64;
    while app.world().resource::<SceneTime>().0 < 1.0 - 1e-9 {
        app.update();
        max_n = max_n.max(single::<ToolForce>(&mut app).force_n.length());
    }
    assert!(max_n > 0.15, "{max_n} N");
}
