//! Reports about a missing force, in lock step: every cause, and none in ordinary use.

use bevy::asset::{AssetPlugin, Handle};
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{ContactState, DeviceSelector, HapticFaultKind, NoForceCause, SafetyOverrides};
use glam::DQuat;
use palpate_haptics::{DeviceDescription, DeviceError, HapticDevice, Reading, ScriptedDevice};
use palpate_tests::app::{
    assert_no_faults, force_n, lockstep_app, pressing_hand, spawn_block, spawn_scene, spawn_tool, step,
    take_causes, take_faults, take_kinds,
};
use std::time::Duration;

/// Spawns a tool with a device at `at(t)`, t in seconds, and a description changed by `describe`.
fn tool(
    app: &mut App,
    describe: impl Fn(&mut DeviceDescription) + Send + Sync + 'static,
    at: fn(f64) -> DVec3,
) -> Entity {
    spawn_tool(app, move || {
        let device = ScriptedDevice::new(move |n, _| Ok(Reading::at(at(n as f64 * 1e-3))));
        let mut description = device.describe();
        describe(&mut description);
        device.with_description(description)
    })
}

/// From 7 mm above the top of the block to a depth of 4 mm within 0.3 s.
fn presses(t: f64) -> DVec3 {
    DVec3::new(0.012, 0.062 - 0.011 * (t / 0.3).min(1.0), 0.009)
}

/// On the top, always at a depth of 4 mm, with the centre outside.
fn rests_on_top(_: f64) -> DVec3 {
    presses(1.0)
}

fn set(app: &mut App, tool: Entity, set: impl Fn(&mut ToolSettings)) {
    set(&mut app.world_mut().get_mut::<ToolSettings>(tool).unwrap());
}

fn settings(app: &App, tool: Entity) -> SafetyOverrides {
    app.world().get::<ToolSettings>(tool).unwrap().safety
}

/// The only cause that is reported within three seconds, and not before half a second.
fn only_cause(app: &mut App, tool: Entity) -> NoForceCause {
    step(app, 9);
    assert_eq!(take_causes(app), [], "not before half a second");
    step(app, 51);
    let causes = take_causes(app);
    assert!(causes.len() == 1 && causes[0].0 == tool, "{causes:?}");
    let faults = take_faults(app);
    assert_eq!(faults.len(), 1, "{faults:?}");
    assert!(force_n(app, tool).length() < 0.01);
    causes[0].1
}

#[test]
fn reports_a_device_without_motors() {
    let mut app = lockstep_app();
    spawn_block(&mut app);
    let tool = tool(&mut app, |description| description.max_force_n = 0.0, presses);
    assert_eq!(only_cause(&mut app, tool), NoForceCause::DeviceLimit { max_force_n: 0.0 });
}

#[test]
fn reports_a_force_limit_of_zero() {
    let mut app = lockstep_app();
    spawn_block(&mut app);
    let tool = tool(&mut app, |_| (), presses);
    set(&mut app, tool, |settings| settings.safety.max_force_n = Some(0.0));
    assert_eq!(only_cause(&mut app, tool), NoForceCause::ForceLimit { max_force_n: 0.0 });
}

#[test]
fn reports_an_endless_ramp_and_another_cause_after_a_force() {
    let mut app = lockstep_app();
    spawn_block(&mut app);
    let tool = tool(&mut app, |_| (), presses);
    set(&mut app, tool, |settings| settings.safety.ramp_s = Some(1e9));
    assert_eq!(only_cause(&mut app, tool), NoForceCause::StartRamp { ramp_s: 1e9 });
    let safety = settings(&app, tool);
    set(&mut app, tool, |settings| settings.safety.ramp_s = Some(0.1));
    step(&mut app, 20);
    assert!(force_n(&app, tool).y > 0.5);
    set(&mut app, tool, |settings| settings.safety = SafetyOverrides { max_force_n: Some(0.0), ..safety });
    step(&mut app, 20);
    assert_eq!(take_causes(&mut app), [(tool, NoForceCause::ForceLimit { max_force_n: 0.0 })]);
}

#[test]
fn reports_a_slew_rate_of_nearly_zero() {
    let mut app = lockstep_app();
    spawn_block(&mut app);
    let tool = tool(&mut app, |_| (), presses);
    set(&mut app, tool, |settings| settings.safety.max_slew_n_per_s = Some(1e-9));
    assert_eq!(only_cause(&mut app, tool), NoForceCause::GrowthLimit { max_slew_n_per_s: 1e-9 });
}

#[test]
fn reports_a_device_frame_that_maps_the_workspace_away_from_the_body() {
    let mut app = lockstep_app();
    let body = spawn_block(&mut app);
    // The workspace lies above the origin of the device frame.
    let above = |description: &mut DeviceDescription| {
        description.workspace_m = [DVec3::new(-0.1, 0.051, -0.1), DVec3::splat(0.2)];
    };
    let tool = tool(&mut app, above, presses);
    set(&mut app, tool, |settings| settings.frame.rotation = DQuat::from_rotation_x(std::f64::consts::PI));
    set(&mut app, tool, |settings| settings.frame.offset_m = DVec3::Y * -0.03);
    let NoForceCause::OutOfWorkspace { body: nearest, distance_m } = only_cause(&mut app, tool) else {
        panic!()
    };
    // The workspace ends at -81 mm, 31 mm below the block; the tool has a radius of 5 mm.
    assert!(nearest == body && (distance_m - 0.026).abs() < 1e-3, "{distance_m} m");
}

/// A device with motors along x and y only.
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
    fn displayable_force_n(&self, force_n: DVec3) -> DVec3 {
        force_n.with_z(0.0)
    }
    fn close(&mut self) -> Result<(), DeviceError> {
        self.0.close()
    }
}

/// Spawns a tool with a planar device that moves in the same way in the scene for every `rotation` of its frame.
fn planar(app: &mut App, rotation: DQuat) -> Entity {
    let make = move || {
        let at = move |n: u64| rotation.conjugate() * presses(n as f64 * 1e-3);
        Ok(Planar(ScriptedDevice::new(move |n, _| Ok(Reading::at(at(n))))))
    };
    app.world_mut().resource_mut::<HapticDevices>().register("planar", make);
    let tool = app.world_mut().spawn(HapticTool::new("planar").with_friction(0.0)).id();
    set(app, tool, |settings| settings.frame.rotation = rotation);
    tool
}

#[test]
fn reports_a_force_along_an_axis_without_motor() {
    let mut app = lockstep_app();
    spawn_block(&mut app);
    let tool = planar(&mut app, DQuat::IDENTITY);
    step(&mut app, 60);
    assert_eq!(take_causes(&mut app), []);
    let along = force_n(&app, tool).normalize();
    app.world_mut().despawn(tool);
    // The z axis of the device is mapped to the direction of the force.
    let tool = planar(&mut app, DQuat::from_rotation_arc(DVec3::Z, along));
    step(&mut app, 60);
    let causes = take_causes(&mut app);
    let [(reported, NoForceCause::MissingAxes { force_n })] = causes[..] else { panic!("{causes:?}") };
    assert!(
        reported == tool && force_n.z > 0.5 && force_n.truncate().length() < 0.01 * force_n.z,
        "{force_n}"
    );
}

#[test]
fn reports_a_tool_that_starts_inside_the_body() {
    let mut app = lockstep_app();
    let body = spawn_block(&mut app);
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
    let body = spawn_block(&mut app);
    app.world_mut().entity_mut(body).insert(Tissue { youngs_modulus_pa: 600e3, ..Tissue::default() });
    let tool = tool(&mut app, |_| (), rests_on_top);
    let cause = only_cause(&mut app, tool);
    let NoForceCause::StartThreshold { force_n, arm_below_n } = cause else { panic!("{cause:?}") };
    assert!(arm_below_n == 0.5 && (0.5..50.0).contains(&force_n), "{force_n} N");
}

/// Into the bottom from below: with the radius only, and with the centre.
#[test]
fn reports_a_fixed_surface_at_every_depth() {
    for depth_m in [0.003, 0.03] {
        let mut app = lockstep_app();
        let body = spawn_block(&mut app);
        let rises = match depth_m {
            0.003 => |t: f64| DVec3::new(0.012, -0.06 + 0.008 * (t / 0.2).min(1.0), 0.009),
            _ => |t: f64| DVec3::new(0.012, -0.06 + 0.035 * (t / 0.2).min(1.0), 0.009),
        };
        let tool = tool(&mut app, |_| (), rises);
        let cause = only_cause(&mut app, tool);
        let NoForceCause::FixedSurface { body: reported, point_m } = cause else { panic!("{cause:?}") };
        assert!(reported == body && (point_m - DVec3::new(0.012, -0.05, 0.009)).length() < 1e-3, "{point_m}");
    }
}

#[test]
fn reports_a_world_without_body_again_after_a_body() {
    let mut app = lockstep_app();
    let tool = tool(&mut app, |_| (), presses);
    assert_eq!(only_cause(&mut app, tool), NoForceCause::NoBody);
    let body = spawn_block(&mut app);
    step(&mut app, 20);
    assert!(force_n(&app, tool).y > 0.5);
    assert_eq!(take_causes(&mut app), []);
    app.world_mut().despawn(body);
    step(&mut app, 9);
    assert_eq!(take_causes(&mut app), []);
    step(&mut app, 30);
    assert_eq!(take_causes(&mut app), [(tool, NoForceCause::NoBody)]);
}

#[test]
fn reports_a_selected_entity_without_body_only_once() {
    let mut app = lockstep_app();
    spawn_block(&mut app);
    let tool = tool(&mut app, |_| (), presses);
    app.world_mut().get_mut::<HapticTool>(tool).unwrap().body = Some(tool);
    step(&mut app, 40);
    let faults = take_faults(&mut app);
    let [HapticFault { entity: Some(entity), kind: HapticFaultKind::NotABody { body }, .. }] = faults[..]
    else {
        panic!("{faults:?}")
    };
    assert_eq!((entity, body), (tool, tool));
}

#[test]
fn reports_a_rejected_body() {
    for is_selected in [false, true] {
        let mut app = lockstep_app();
        let body = app.world_mut().spawn(DeformableBody::block([1, 6, 6], 0.1)).id();
        app.update();
        let kinds = take_kinds(&mut app);
        assert!(matches!(kinds[..], [HapticFaultKind::BuildBody(_)]), "the body's own fault: {kinds:?}");
        let tool = tool(&mut app, |_| (), presses);
        if is_selected {
            spawn_block(&mut app);
            app.world_mut().get_mut::<HapticTool>(tool).unwrap().body = Some(body);
        }
        assert_eq!(only_cause(&mut app, tool), NoForceCause::BodyRejected { body });
    }
}

#[test]
fn reports_a_mesh_that_is_not_loaded_after_five_seconds() {
    let mut app = lockstep_app();
    app.add_plugins((AssetPlugin::default(), MeshPlugin));
    let mesh: Handle<Mesh> = app.world().resource::<Assets<Mesh>>().reserve_handle();
    let body = app.world_mut().spawn(DeformableBody::from_mesh(mesh)).id();
    let tool = tool(&mut app, |_| (), presses);
    step(&mut app, 99);
    assert_no_faults(&mut app);
    step(&mut app, 100);
    let causes = take_causes(&mut app);
    let [(reported, NoForceCause::BodyNotReady { body: waiting, waited_s })] = causes[..] else {
        panic!("{causes:?}")
    };
    assert!((reported, waiting) == (tool, body) && (waited_s - 5.0).abs() < 0.051, "{waited_s} s");
}

#[test]
fn ordinary_use_is_not_reported() {
    type At = fn(f64) -> DVec3;
    let hands: [(&str, At); 6] = [
        ("touching and leaving", |t| presses(t).with_y(0.058 + 0.01 * (3.0 * t).cos())),
        ("staying", presses),
        ("hovering", |t| DVec3::new(0.012, 0.0551 + 1e-3 * (9.0 * t).sin().abs(), 0.009)),
        ("beside it", |t| DVec3::new(0.06 + 0.01 * t.sin(), 0.0, 0.0)),
        ("grazing", |_| DVec3::new(0.012, 0.05499, 0.009)),
        ("far away", |_| DVec3::splat(0.19)),
    ];
    for (name, at) in hands {
        let mut app = lockstep_app();
        spawn_block(&mut app);
        // On the two halves of the block.
        for (device, scheme, side) in [("right", Scheme::NearFieldExact, 1.0), ("left", Scheme::Hold, -1.0)] {
            let scripted = move || {
                let place = move |t| at(t) * DVec3::new(side, 1.0, 1.0);
                ScriptedDevice::new(move |n, _| Ok(Reading::at(place(n as f64 * 1e-3))))
            };
            app.world_mut().resource_mut::<HapticDevices>().register(device, move || Ok(scripted()));
            app.world_mut().spawn(HapticTool { scheme, ..HapticTool::new(device) });
        }
        step(&mut app, 40);
        app.world_mut().resource_mut::<Time<Virtual>>().pause();
        (0..40).for_each(|_| app.update());
        app.world_mut().resource_mut::<Time<Virtual>>().unpause();
        step(&mut app, 20);
        let faults = take_faults(&mut app);
        assert!(faults.is_empty(), "{name}: {faults:?}");
    }
}

/// A failing device and a missing device have faults of their own.
#[test]
fn device_faults_are_not_reported_as_missing_force() {
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
