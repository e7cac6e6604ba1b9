//! The wait of a scene's tools for its bodies, without a window.

use super::*;
use clap::Parser;

#[derive(Parser)]
struct Options {
    #[command(flatten)]
    stage: StageOptions,
}

/// Number of times that the tools were set up.
#[derive(Resource, Default)]
struct SetUps(usize);

/// A block that falls by `height_m` onto a table, a model step in each update.
fn scene(settles: bool, height_m: f32) -> App {
    let stage = Stage { name: "test", settles, ..default() };
    let mut app = stage.app(&Options::parse_from(["test", "--headless", "--seconds", "3600"]).stage);
    app.insert_resource(Gravity::EARTH)
        .init_resource::<SetUps>()
        .add_systems(SetUpScene, move |mut commands: Commands| {
            commands.spawn(Obstacle::half_space());
            let place = Transform::from_xyz(0.0, 0.03 + height_m, 0.0);
            commands.spawn((DeformableBody::block([4; 3], 0.06), place));
        })
        .add_systems(SetUpHands, |mut set_ups: ResMut<SetUps>| set_ups.0 += 1);
    app.finish();
    app.cleanup();
    app
}

/// Updates until the tools have been set up `times` times; returns the model time that this takes, s.
fn wait_s(app: &mut App, times: usize) -> f64 {
    let now_s = |app: &App| app.world().resource::<Time<Model>>().elapsed_secs_f64();
    let start_s = now_s(app);
    while app.world().resource::<SetUps>().0 < times {
        app.update();
        assert!(now_s(app) < start_s + 2.0 * MAX_SETTLING_S, "the tools are not set up");
    }
    now_s(app) - start_s
}

fn is_settled(app: &mut App) -> bool {
    app.world_mut().query::<&SimulatedBody>().single(app.world()).unwrap().body().is_settled()
}

#[test]
fn tools_wait_until_the_bodies_are_at_rest() {
    let mut app = scene(true, 0.005);
    let waited_s = wait_s(&mut app, 1);
    assert!(is_settled(&mut app) && (0.1..MAX_SETTLING_S - 0.5).contains(&waited_s), "{waited_s} s");
    // The scene's time counts from the update that sets up the tools.
    let time_s = |app: &App| app.world().resource::<SceneTime>().0;
    assert!((time_s(&app) - 0.05).abs() < 1e-9, "{} s", time_s(&app));
    // A restarted scene waits again, on one table.
    app.world_mut().write_message(ResetScene);
    app.update();
    assert_eq!(app.world().resource::<SetUps>().0, 1);
    let again_s = wait_s(&mut app, 2);
    assert!(is_settled(&mut app) && (again_s - waited_s).abs() < 0.2, "{again_s} s, {waited_s} s");
    assert_eq!(app.world_mut().query::<&Obstacle>().iter(app.world()).count(), 1);
    assert!((time_s(&app) - 0.05).abs() < 1e-9, "{} s", time_s(&app));
}

#[test]
fn tools_wait_in_slow_motion_for_the_same_time() {
    let mut app = scene(true, 0.005);
    let waited_s = wait_s(&mut app, 1);
    let mut app = scene(true, 0.005);
    app.update();
    time::set_slow(app.world_mut(), true);
    let slow_s = wait_s(&mut app, 1);
    assert!(is_settled(&mut app) && (slow_s - waited_s).abs() < 0.2, "{slow_s} s, {waited_s} s");
}

#[test]
fn tools_wait_at_most_5_s() {
    // On the way down for 5.5 s.
    let mut app = scene(true, 150.0);
    let waited_s = wait_s(&mut app, 1);
    assert!(!is_settled(&mut app) && (waited_s - MAX_SETTLING_S).abs() < 0.15, "{waited_s} s");
}

#[test]
fn tools_of_other_scenes_do_not_wait_for_rest() {
    let mut app = scene(false, 0.005);
    assert!(wait_s(&mut app, 1) < 0.1 && !is_settled(&mut app));
}
