//! A tool that renders no force says why: every cause, in lock step. Ordinary use says nothing.

use bevy::asset::{AssetPlugin, Handle};
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{HapticFaultKind, NoForceCause};
use glam::DQuat;
use palpate_haptics::{DeviceDescription, DeviceError};
use palpate_tests::app::{lockstep_app, pressing_hand, spawn_scene, step, take_causes, take_faults};
use std::time::Duration;

/// A device whose hand is `at(t)`, t in seconds, and that moves a tool.
fn tool(
    app: &mut App,
    describe: impl Fn(&mut DeviceDescription) + Send + Sync + 'static,
    at: fn(f64) -> DVec3,
) -> Entity {
    let make = move || {
        let device = ScriptedDevice::new(move |n, _| Ok(Reading::at(at(n as f64 * 1e-3))));
        let mut description = device.describe();
        describe(&mut description);
        Ok(device.with_description(description))
    };
    app.world_mut().resource_mut::<HapticDevices>().register("hand", make);
    app.world_mut().spawn(HapticTool { device: DeviceSelector::named("hand"), ..default() }).id()
}

fn block(app: &mut App) -> Entity {
    app.world_mut().spawn((DeformableBody::block([6, 6, 6], 0.1), FixedRegion::Face(BoxFace::Bottom))).id()
}

/// From 7 mm above the top of the block to 4 mm deep within 0.3 s, to stay.
fn presses(t: f64) -> DVec3 {
    DVec3::new(0.012, 0.062 - 0.011 * (t / 0.3).min(1.0), 0.009)
}

/// On the top, for ever 4 mm deep, its centre outside.
fn rests_on_top(_: f64) -> DVec3 {
    presses(1.0)
}

fn set(app: &mut App, tool: Entity, set: impl Fn(&mut ToolSettings)) {
    set(&mut app.world_mut().get_mut::<ToolSettings>(tool).unwrap());
}

fn settings(app: &App, tool: Entity) -> SafetySettings {
    app.world().get::<ToolSettings>(tool).unwrap().safety
}

/// The one cause that is reported within three seconds, half a second after it could have been.
fn only_cause(app: &mut App, tool: Entity) -> NoForceCause {
    step(app, 9);
    assert_eq!(take_causes(app), [], "not before half a second");
    step(app, 51);
    let causes = take_causes(app);
    assert!(causes.len() == 1 && causes[0].0 == tool, "{causes:?}");
    let faults = take_faults(app);
    assert_eq!(faults.len(), 1, "{faults:?}");
    assert!(app.world().get::<ToolForce>(tool).unwrap().force_n.length() < 0.01);
    causes[0].1
}

#[test]
fn a_device_without_motors_is_named() {
    let mut app = lockstep_app();
    block(&mut app);
    let tool = tool(&mut app, |description| description.max_force_n = 0.0, presses);
    assert_eq!(only_cause(&mut app, tool), NoForceCause::DeviceLimit { max_force_n: 0.0 });
}

#[test]
fn a_limit_of_no_force_is_named() {
    let mut app = lockstep_app();
    block(&mut app);
    let tool = tool(&mut app, |_| (), presses);
    set(&mut app, tool, |settings| settings.safety.max_force_n = 0.0);
    assert_eq!(only_cause(&mut app, tool), NoForceCause::ForceLimit { max_force_n: 0.0 });
}

#[test]
fn a_ramp_without_an_end_is_named_and_again_once_there_was_force() {
    let mut app = lockstep_app();
    block(&mut app);
    let tool = tool(&mut app, |_| (), presses);
    set(&mut app, tool, |settings| settings.safety.ramp_s = 1e9);
    assert_eq!(only_cause(&mut app, tool), NoForceCause::StartRamp { ramp_s: 1e9 });
    let safety = settings(&app, tool);
    set(&mut app, tool, |settings| settings.safety.ramp_s = 0.1);
    step(&mut app, 20);
    assert!(app.world().get::<ToolForce>(tool).unwrap().force_n.y > 0.5);
    set(&mut app, tool, |settings| settings.safety = SafetySettings { max_force_n: 0.0, ..safety });
    step(&mut app, 20);
    assert_eq!(take_causes(&mut app), [(tool, NoForceCause::ForceLimit { max_force_n: 0.0 })]);
}

#[test]
fn a_growth_of_next_to_nothing_is_named() {
    let mut app = lockstep_app();
    block(&mut app);
    let tool = tool(&mut app, |_| (), presses);
    set(&mut app, tool, |settings| settings.safety.max_slew_n_per_s = 1e-9);
    assert_eq!(only_cause(&mut app, tool), NoForceCause::GrowthLimit { max_slew_n_per_s: 1e-9 });
}

/// Far from the body, because the device's workspace lies elsewhere in the scene.
#[test]
fn a_frame_that_is_turned_away_is_named() {
    let mut app = lockstep_app();
    let body = block(&mut app);
    // Where the hand can be, in its own frame, is all above its origin.
    let above = |description: &mut DeviceDescription| {
        description.workspace_m = [DVec3::new(-0.1, 0.051, -0.1), DVec3::splat(0.2)];
    };
    let tool = tool(&mut app, above, presses);
    set(&mut app, tool, |settings| settings.frame.rotation = DQuat::from_rotation_x(std::f64::consts::PI));
    set(&mut app, tool, |settings| settings.frame.offset_m = DVec3::Y * -0.03);
    let NoForceCause::OutOfWorkspace { body: told, distance_m } = only_cause(&mut app, tool) else {
        panic!()
    };
    // It ends at -81 mm, 31 mm below the block, and has a radius of 5 mm.
    assert!(told == body && (distance_m - 0.026).abs() < 1e-3, "{distance_m} m");
}

/// A device with motors along its x and y only.
struct Planar(ScriptedDevice);

impl HapticDevice for Planar {
    fn describe(&self) -> DeviceDescription {
        self.0.describe()
    }
    fn open(&mut self) -> Result<(), DeviceError> {
        self.0.open()
    }
    fn read(&mut self, within: Duration) -> Result<Reading, DeviceError> {
        self.0.read(within)
    }
    fn write(&mut self, force_n: DVec3) -> Result<(), DeviceError> {
        self.0.write(force_n)
    }
    fn quantized_force_n(&self, force_n: DVec3) -> DVec3 {
        force_n.with_z(0.0)
    }
    fn close(&mut self) -> Result<(), DeviceError> {
        self.0.close()
    }
}

/// A planar device whose hand does the same in the scene, however its frame is turned.
fn planar(app: &mut App, rotation: DQuat) -> Entity {
    let make = move || {
        let at = move |n: u64| rotation.conjugate() * presses(n as f64 * 1e-3);
        Ok(Planar(ScriptedDevice::new(move |n, _| Ok(Reading::at(at(n))))))
    };
    app.world_mut().resource_mut::<HapticDevices>().register("planar", make);
    let asked = HapticTool { device: DeviceSelector::named("planar"), friction: 0.0, ..default() };
    let tool = app.world_mut().spawn(asked).id();
    set(app, tool, |settings| settings.frame.rotation = rotation);
    tool
}

#[test]
fn a_force_along_axes_without_a_motor_is_named() {
    let mut app = lockstep_app();
    block(&mut app);
    let tool = planar(&mut app, DQuat::IDENTITY);
    step(&mut app, 60);
    assert_eq!(take_causes(&mut app), []);
    let along = app.world().get::<ToolForce>(tool).unwrap().force_n.normalize();
    app.world_mut().despawn(tool);
    // The device's z lies in the scene where the force did.
    let tool = planar(&mut app, DQuat::from_rotation_arc(DVec3::Z, along));
    step(&mut app, 60);
    let causes = take_causes(&mut app);
    let [(told, NoForceCause::MissingAxes { force_n })] = causes[..] else { panic!("{causes:?}") };
    assert!(told == tool && force_n.z > 0.5 && force_n.truncate().length() < 0.01 * force_n.z, "{force_n}");
}

#[test]
fn a_hand_that_starts_inside_is_named_until_it_has_left() {
    let mut app = lockstep_app();
    let body = block(&mut app);
    let tool = tool(&mut app, |_| (), |t| DVec3::new(0.012, if t < 4.0 { 0.0 } else { 0.06 }, 0.009));
    assert_eq!(only_cause(&mut app, tool), NoForceCause::Inside { body });
    assert_eq!(app.world().get::<TouchedBody>(tool).unwrap().state, ContactState::Inside);
    step(&mut app, 30);
    assert_eq!(app.world().get::<TouchedBody>(tool).unwrap().state, ContactState::Clear);
    assert_eq!(take_causes(&mut app), []);
}

/// The body feels the tool at once, and the safety chain waits for a small force.
#[test]
fn a_hand_that_starts_in_a_touch_is_named() {
    let mut app = lockstep_app();
    let body = block(&mut app);
    app.world_mut().entity_mut(body).insert(Tissue { youngs_modulus_pa: 600e3, ..Tissue::default() });
    let tool = tool(&mut app, |_| (), rests_on_top);
    let cause = only_cause(&mut app, tool);
    let NoForceCause::StartThreshold { force_n, start_below_n } = cause else { panic!("{cause:?}") };
    assert!(start_below_n == 0.5 && (0.5..50.0).contains(&force_n), "{force_n} N");
}

/// Onto the bottom from below: with its radius only, and with its centre.
#[test]
fn a_fixed_surface_is_named_however_deep_the_tool_is() {
    for depth_m in [0.003, 0.03] {
        let mut app = lockstep_app();
        let body = block(&mut app);
        let rises = match depth_m {
            0.003 => |t: f64| DVec3::new(0.012, -0.06 + 0.008 * (t / 0.2).min(1.0), 0.009),
            _ => |t: f64| DVec3::new(0.012, -0.06 + 0.035 * (t / 0.2).min(1.0), 0.009),
        };
        let tool = tool(&mut app, |_| (), rises);
        let cause = only_cause(&mut app, tool);
        let NoForceCause::FixedSurface { body: told, point_m } = cause else { panic!("{cause:?}") };
        assert!(told == body && (point_m - DVec3::new(0.012, -0.05, 0.009)).length() < 1e-3, "{point_m}");
    }
}

#[test]
fn a_world_without_a_body_is_named_again_when_the_next_is_gone() {
    let mut app = lockstep_app();
    let tool = tool(&mut app, |_| (), presses);
    assert_eq!(only_cause(&mut app, tool), NoForceCause::NoBody);
    let body = block(&mut app);
    step(&mut app, 20);
    assert!(app.world().get::<ToolForce>(tool).unwrap().force_n.y > 0.5);
    assert_eq!(take_causes(&mut app), []);
    app.world_mut().despawn(body);
    step(&mut app, 9);
    assert_eq!(take_causes(&mut app), []);
    step(&mut app, 30);
    assert_eq!(take_causes(&mut app), [(tool, NoForceCause::NoBody)]);
}

#[test]
fn a_tool_for_what_is_no_body_is_told_at_once_and_that_is_all() {
    let mut app = lockstep_app();
    block(&mut app);
    let tool = tool(&mut app, |_| (), presses);
    app.world_mut().get_mut::<HapticTool>(tool).unwrap().body = Some(tool);
    app.add_systems(Last, move |mut faults: MessageReader<HapticFault>| {
        for fault in faults.read() {
            let is_it = matches!(fault.kind, HapticFaultKind::NotABody { body } if body == tool);
            assert!(is_it && fault.entity == Some(tool), "{fault:?}");
        }
    });
    step(&mut app, 40);
    assert_eq!(take_faults(&mut app).len(), 1);
}

#[test]
fn a_rejected_body_is_named() {
    for is_asked_for in [false, true] {
        let mut app = lockstep_app();
        let body = app.world_mut().spawn(DeformableBody::block([1, 6, 6], 0.1)).id();
        app.update();
        assert_eq!(take_faults(&mut app).len(), 1, "its own fault");
        let tool = tool(&mut app, |_| (), presses);
        if is_asked_for {
            block(&mut app);
            app.world_mut().get_mut::<HapticTool>(tool).unwrap().body = Some(body);
        }
        assert_eq!(only_cause(&mut app, tool), NoForceCause::BodyRejected { body });
    }
}

#[test]
fn a_mesh_that_does_not_come_is_named_after_five_seconds() {
    let mut app = lockstep_app();
    app.add_plugins((AssetPlugin::default(), MeshPlugin));
    let mesh: Handle<Mesh> = app.world().resource::<Assets<Mesh>>().reserve_handle();
    let body = app.world_mut().spawn(DeformableBody::from_mesh(mesh)).id();
    let tool = tool(&mut app, |_| (), presses);
    step(&mut app, 99);
    assert_eq!(take_faults(&mut app), [""; 0]);
    step(&mut app, 100);
    let causes = take_causes(&mut app);
    let [(told, NoForceCause::BodyNotReady { body: waiting, waited_s })] = causes[..] else {
        panic!("{causes:?}")
    };
    assert!((told, waiting) == (tool, body) && (waited_s - 5.0).abs() < 0.051, "{waited_s} s");
}

#[test]
fn ordinary_use_has_no_cause() {
    type At = fn(f64) -> DVec3;
    let hands: [(&str, At); 6] = [
        ("touching and leaving", |t| presses(t).with_y(0.058 + 0.01 * (3.0 * t).cos())),
        ("staying", presses),
        ("hovering", |t| DVec3::new(0.012, 0.0551 + 1e-3 * (9.0 * t).sin().abs(), 0.009)),
        ("beside it", |t| DVec3::new(0.06 + 0.01 * t.sin(), 0.0, 0.0)),
        ("grazing", |_| DVec3::new(0.012, 0.05499, 0.009)),
        ("far away", |_| DVec3::splat(0.19)),
    ];
    for (what, at) in hands {
        for scheme in [Scheme::NearFieldExact, Scheme::Hold] {
            let mut app = lockstep_app();
            block(&mut app);
            let tool = tool(&mut app, |_| (), at);
            app.world_mut().get_mut::<HapticTool>(tool).unwrap().scheme = scheme;
            step(&mut app, 40);
            app.world_mut().resource_mut::<Time<Virtual>>().pause();
            (0..40).for_each(|_| app.update());
            app.world_mut().resource_mut::<Time<Virtual>>().unpause();
            step(&mut app, 20);
            assert_eq!(take_faults(&mut app), [""; 0], "{what}, {}", scheme.name());
        }
    }
}

/// A device that fails, a device that is not there and a pause are reported as what they are.
#[test]
fn what_has_a_fault_of_its_own_is_no_cause_beside_it() {
    let mut app = lockstep_app();
    let failing = || {
        ScriptedDevice::new(|n, _| {
            if n < 800 { Ok(Reading::at(presses(n as f64 * 1e-3))) } else { Err(DeviceError::TimedOut) }
        })
    };
    spawn_scene(&mut app, Scheme::NearFieldExact, failing);
    step(&mut app, 60);
    assert_eq!(take_causes(&mut app), []);
    let mut app = lockstep_app();
    let (_, tool) = spawn_scene(&mut app, Scheme::NearFieldExact, pressing_hand);
    app.world_mut().get_mut::<HapticTool>(tool).unwrap().device = DeviceSelector::named("none");
    step(&mut app, 60);
    assert_eq!(take_causes(&mut app), []);
}
