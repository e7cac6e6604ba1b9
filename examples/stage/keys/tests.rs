//! Keys in a scene without a window.

use super::*;
use crate::{HandTime, SceneTime, SetUpHands, SetUpScene, Stage, register_hand};
use bevy::input::mouse::AccumulatedMouseScroll;
use bevy_palpate::{HidSelector, LoopMode, ModelRate, ModelStepCount, ToolLoop};
use clap::Parser;
use palpate_haptics::{DeviceFrame, Reading};

#[derive(Parser)]
struct Options {
    #[command(flatten)]
    stage: StageOptions,
}

/// A device that descends onto a block within 1 s, presses to a depth of 10 mm within another, and stays; each update is a model step.
fn scene() -> (App, HandTime) {
    scene_with(&["test", "--headless", "--seconds", "3600"])
}

fn scene_with(options: &[&str]) -> (App, HandTime) {
    let stage = Stage { name: "test", seconds: 3600.0, ..default() };
    let mut app = stage.app(&Options::parse_from(options).stage);
    app.init_resource::<ButtonInput<KeyCode>>()
        .init_resource::<ButtonInput<MouseButton>>()
        .init_resource::<AccumulatedMouseScroll>()
        .add_plugins((MouseDevicePlugin::default(), KeysPlugin))
        .add_systems(SetUpScene, |mut commands: Commands| {
            commands.spawn((DeformableBody::block([4; 3], 0.1), FixedRegion::Face(BoxFace::Bottom)));
        })
        .add_systems(SetUpHands, |mut commands: Commands, options: Res<StageOptions>| {
            commands.spawn(HapticTool::new("hand").with_scheme(options.scheme));
        });
    let hand =
        register_hand(app.world_mut(), "hand", |t| Reading::at(DVec3::Y * (0.065 - 0.01 * t.min(2.0))));
    app.finish();
    app.cleanup();
    // The first update only starts the clock.
    app.update();
    (app, hand)
}

fn tap(app: &mut App, key: KeyCode) {
    app.world_mut().resource_mut::<ButtonInput<KeyCode>>().press(key);
    app.update();
    let mut keys = app.world_mut().resource_mut::<ButtonInput<KeyCode>>();
    keys.release(key);
    keys.clear();
}

fn pass(app: &mut App, updates: usize) {
    (0..updates).for_each(|_| app.update());
}

fn single<T: Component + Clone>(app: &mut App) -> T {
    app.world_mut().query::<&T>().single(app.world()).unwrap().clone()
}

fn tool_m(app: &mut App) -> Vec3 {
    let mut tools = app.world_mut().query_filtered::<&Transform, With<HapticTool>>();
    tools.single(app.world()).unwrap().translation
}

fn body(app: &mut App) -> Entity {
    app.world_mut().query_filtered::<Entity, With<DeformableBody>>().single(app.world()).unwrap()
}

#[test]
fn slow_motion_continues_the_motion_of_body_and_tool() {
    let (mut app, hand) = scene();
    pass(&mut app, 30);
    assert!((hand.s() - 1.5).abs() < 1e-9 && (app.world().resource::<SceneTime>().0 - 1.5).abs() < 1e-9);
    let (before_m, at) = (tool_m(&mut app), body(&mut app));
    tap(&mut app, KeyCode::KeyS);
    pass(&mut app, 21);
    // The first update is still at full speed, the others are steps of 5 ms.
    let slow_s = hand.s() - 1.55;
    assert!((slow_s - 0.105).abs() < 0.006, "{slow_s} s");
    assert!((app.world().resource::<SceneTime>().0 - hand.s()).abs() < 0.006);
    let moved_m = tool_m(&mut app) - before_m;
    // The drawn tool lags by up to a model step.
    assert!((-2.1e-3..-1.5e-3).contains(&moved_m.y), "{moved_m}: it neither jumps nor restarts");
    assert!(single::<TouchedBody>(&mut app).body == Some(at), "the contact starts again");
    tap(&mut app, KeyCode::KeyS);
    pass(&mut app, 4);
    let fast_s = hand.s() - 1.55 - slow_s;
    assert!((fast_s - 0.2).abs() < 0.06, "{fast_s} s");
    let world = app.world();
    assert_eq!(*world.resource::<LoopMode>(), LoopMode::Lockstep, "the previous mode");
    assert_eq!(world.resource::<ModelRate>().ticks(), 50);
    assert_eq!(world.resource::<Time<Fixed>>().timestep().as_millis(), 50);
}

#[test]
fn slow_motion_keeps_a_changed_rate() {
    let (mut app, _) = scene();
    pass(&mut app, 2);
    app.insert_resource(ModelRate::every_ticks(25).unwrap());
    tap(&mut app, KeyCode::KeyS);
    assert_eq!(app.world().resource::<ModelRate>().ticks(), 5);
    tap(&mut app, KeyCode::KeyS);
    pass(&mut app, 2);
    assert_eq!(app.world().resource::<ModelRate>().ticks(), 25);
    tap(&mut app, KeyCode::KeyS);
    app.insert_resource(ModelRate::every_ticks(10).unwrap());
    tap(&mut app, KeyCode::KeyS);
    pass(&mut app, 2);
    assert_eq!(app.world().resource::<ModelRate>().ticks(), 10);
    // Off and on in the same frame.
    tap(&mut app, KeyCode::KeyS);
    time::set_slow(app.world_mut(), false);
    time::set_slow(app.world_mut(), true);
    tap(&mut app, KeyCode::KeyS);
    pass(&mut app, 2);
    assert_eq!(app.world().resource::<ModelRate>().ticks(), 10);
}

#[test]
fn restarted_scene_keeps_the_selected_scheme() {
    let (mut app, hand) = scene();
    for (key, scheme) in SCHEME_KEYS.into_iter().zip(Scheme::ALL) {
        tap(&mut app, key);
        assert_eq!(single::<HapticTool>(&mut app).scheme, scheme);
    }
    tap(&mut app, KeyCode::Digit2);
    pass(&mut app, 30);
    let before = body(&mut app);
    tap(&mut app, KeyCode::KeyR);
    // The scene is set up in the next update.
    pass(&mut app, 3);
    assert_ne!(body(&mut app), before);
    assert!(hand.s() < 0.16 && app.world().resource::<SceneTime>().0 < 0.16, "{} s", hand.s());
    assert!(tool_m(&mut app).y > 0.063);
    assert_eq!(single::<HapticTool>(&mut app).scheme, Scheme::LowPass);
}

#[test]
fn pause_stops_the_model_steps() {
    let (mut app, hand) = scene();
    pass(&mut app, 5);
    tap(&mut app, KeyCode::Space);
    pass(&mut app, 1);
    let (steps, then_s) = (app.world().resource::<ModelStepCount>().0, hand.s());
    pass(&mut app, 10);
    assert_eq!((app.world().resource::<ModelStepCount>().0, hand.s()), (steps, then_s));
    tap(&mut app, KeyCode::Space);
    pass(&mut app, 10);
    assert!(app.world().resource::<ModelStepCount>().0 >= steps + 9);
}

#[test]
fn mouse_replaces_the_scene_s_device_and_back() {
    let (mut app, hand) = scene();
    pass(&mut app, 3);
    tap(&mut app, KeyCode::KeyM);
    pass(&mut app, 3);
    assert_eq!(single::<HapticTool>(&mut app).device, DeviceSelector::named(MouseDevicePlugin::NAME));
    assert_eq!(single::<ToolGrasp>(&mut app), ToolGrasp::default());
    let mut loops = app.world_mut().query::<&ToolLoop>();
    assert!(
        loops.single(app.world()).is_ok() && hand.s() == 0.0,
        "the scene has restarted, without its own device"
    );
    tap(&mut app, KeyCode::KeyM);
    pass(&mut app, 3);
    assert_eq!(single::<HapticTool>(&mut app).device, DeviceSelector::named("hand"));
    assert!(hand.s() > 0.0 && !grasps(&mut app));
}

/// Whether the tool can grasp.
fn grasps(app: &mut App) -> bool {
    app.world_mut().query::<&ToolGrasp>().iter(app.world()).next().is_some()
}

fn set_device(app: &mut App, device: DeviceSelector) {
    app.world_mut().query::<&mut HapticTool>().single_mut(app.world_mut()).unwrap().device = device;
    pass(app, 2);
}

#[test]
fn tool_grasps_only_with_the_mouse() {
    let (mut app, _) = scene();
    pass(&mut app, 2);
    // As by a selection in the panel.
    let mouse = DeviceSelector::named(MouseDevicePlugin::NAME);
    set_device(&mut app, mouse.clone());
    assert!(grasps(&mut app));
    set_device(&mut app, DeviceSelector::replay(Handle::default()));
    assert!(grasps(&mut app), "a recording of the mouse keeps the grasp");
    set_device(&mut app, DeviceSelector::named("hand"));
    assert!(!grasps(&mut app));
    // A tool with its own grasp keeps it.
    let own = ToolGrasp { reach_m: 0.02, ..default() };
    let tool = app.world_mut().query_filtered::<Entity, With<HapticTool>>().single(app.world()).unwrap();
    app.world_mut().entity_mut(tool).insert(own);
    for device in [mouse, DeviceSelector::named("hand")] {
        set_device(&mut app, device);
        assert_eq!(single::<ToolGrasp>(&mut app), own);
    }
}

#[test]
fn mouse_replaces_a_hid_device_and_back() {
    let (mut app, _) = scene_with(&["test", "--headless", "--seconds", "3600", "--hid", "nowhere"]);
    let hid = DeviceSelector::Hid(HidSelector { serial: Some("nowhere".into()), ..default() });
    let frame = |app: &mut App| single::<ToolSettings>(app).frame;
    // With a HID device the loops run on threads.
    let wait = |app: &mut App, device: &DeviceSelector| {
        for _ in 0..200 {
            app.update();
            if single::<HapticTool>(app).device == *device {
                return;
            }
        }
        panic!("the device is {:?}", single::<HapticTool>(app).device);
    };
    wait(&mut app, &hid);
    assert!(frame(&mut app) != DeviceFrame::default());
    for _ in 0..5 {
        tap(&mut app, KeyCode::KeyM);
        wait(&mut app, &DeviceSelector::named(MouseDevicePlugin::NAME));
        assert_eq!(frame(&mut app), DeviceFrame::default(), "the mouse has the default frame");
        tap(&mut app, KeyCode::KeyM);
        wait(&mut app, &hid);
    }
}

#[cfg(feature = "panel")]
#[test]
fn typing_into_a_field_has_no_effect_on_the_scene() {
    use bevy_egui::EguiContext;
    use bevy_egui::input::{EguiWantsInput, write_egui_wants_input_system};
    let (mut app, _) = scene();
    let context = EguiContext::default();
    let egui = context.clone().get_mut().clone();
    app.world_mut().spawn(context);
    app.init_resource::<EguiWantsInput>().add_systems(PostUpdate, write_egui_wants_input_system);
    pass(&mut app, 2);
    let before = body(&mut app);
    let field = bevy_egui::egui::Id::new("field");
    egui.memory_mut(|memory| memory.request_focus(field));
    pass(&mut app, 1);
    for key in [KeyCode::KeyR, KeyCode::KeyM, KeyCode::KeyS, KeyCode::Space, KeyCode::Digit2] {
        tap(&mut app, key);
        pass(&mut app, 2);
    }
    let time = app.world().resource::<Time<Virtual>>();
    assert!(!time.is_paused() && !time::is_slow(time));
    assert_eq!(body(&mut app), before);
    let tool = single::<HapticTool>(&mut app);
    assert_eq!((tool.scheme, tool.device), (Scheme::default(), DeviceSelector::named("hand")));
    egui.memory_mut(|memory| memory.surrender_focus(field));
    pass(&mut app, 1);
    tap(&mut app, KeyCode::Digit2);
    assert_eq!(single::<HapticTool>(&mut app).scheme, Scheme::LowPass);
}
