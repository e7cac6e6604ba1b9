//! HID devices in a Bevy app: selected, disconnected and connected again, rejected.

use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{DeviceFault, DeviceSelector, FaultSeverity, HapticFaultKind, HidDeviceKind, HidSelector};
use palpate_haptics::{DeviceError, DeviceFrame, LoopEventKind};
use palpate_hid::simulated::{BoardFirmware, Firmware, SimulatedBus};
use palpate_hid::{
    BoardForm, BoardKinematics, BoardOptions, HidError, HidInfo, HidOptions, SpaceMouseOptions, Usage,
};
use palpate_tests::app::{
    assert_no_faults, collect_messages, spawn_block, take_faults, take_kinds, update_until,
};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

/// A SpaceMouse that is pushed down and up repeatedly while `pushes` is set. On a busy machine that misses one contact, the next is seen.
#[derive(Clone, Default)]
struct Cap {
    pushes: Arc<AtomicBool>,
    reads: u64,
}

impl Firmware for Cap {
    fn input(&mut self, report: &mut [u8]) -> usize {
        // One report for every second read.
        self.reads += 1;
        if self.reads.is_multiple_of(2) {
            return 0;
        }
        let push: i16 = match self.pushes.load(Ordering::Relaxed) {
            true if (self.reads / 2000).is_multiple_of(2) => 350,
            true => -350,
            false => 0,
        };
        let [low, high] = push.to_le_bytes();
        report[..7].copy_from_slice(&[1, 0, 0, 0, 0, low, high]);
        7
    }

    fn output(&mut self, _: &[u8]) -> bool {
        true
    }
}

fn info(serial: &str) -> HidInfo {
    HidInfo {
        path: format!("cap {serial}"),
        vendor: 0x256F,
        product: 0xC635,
        serial: serial.into(),
        name: "SpaceMouse Compact".into(),
        interface: None,
        applications: vec![Usage::new(1, 8)],
    }
}

fn scene(selector: HidSelector) -> (App, Arc<SimulatedBus>, Entity) {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, PalpatePlugins));
    collect_messages(&mut app);
    let bus = Arc::new(SimulatedBus::default());
    let mut devices = app.world_mut().resource_mut::<HapticDevices>();
    devices.set_hid_bus(Arc::clone(&bus));
    // Slow, and at most 5 mm below the surface.
    let half_size_m = DVec3::splat(0.015);
    let space_mouse = SpaceMouseOptions { full_speed_m_per_s: 0.02, half_size_m, ..Default::default() };
    devices.set_hid_options(HidOptions { space_mouse, ..Default::default() });
    spawn_block(&mut app);
    let frame = DeviceFrame { offset_m: DVec3::new(0.012, 0.06, 0.009), ..default() };
    let tool = (HapticTool::new(selector), ToolSettings { frame, ..default() });
    let tool = app.world_mut().spawn(tool).id();
    (app, bus, tool)
}

/// The HID error of the only fault since the last call that is no matter of the machine's load, as text with its kind checked by `is_expected`.
fn hid_error(app: &mut App, is_expected: impl Fn(&HidError) -> bool) -> String {
    let mut kinds = take_kinds(app);
    kinds.retain(|kind| kind.severity() > FaultSeverity::Load);
    let [HapticFaultKind::Device(fault)] = &kinds[..] else { panic!("{kinds:?}") };
    let DeviceFault::Hid(error) = &**fault else { panic!("{fault}") };
    assert!(is_expected(error), "{error}");
    error.to_string()
}

/// Whether the loop has reported since the last call that the device is disconnected.
fn is_disconnected(app: &mut App) -> bool {
    let is_it = |kind: &HapticFaultKind| {
        matches!(
            kind,
            HapticFaultKind::Loop(
                LoopEventKind::DeviceFailed(DeviceError::Disconnected)
                    | LoopEventKind::ReopenFailed(DeviceError::Disconnected)
            )
        )
    };
    take_kinds(app).iter().any(is_it)
}

#[test]
fn space_mouse_touches_is_disconnected_and_connected_again() {
    let (mut app, bus, tool) = scene(HidSelector { serial: Some("1".into()), ..default() });
    // Without any device.
    app.update();
    let error =
        hid_error(&mut app, |e| matches!(e, HidError::NotFound { present, .. } if present.is_empty()));
    assert!(error.contains("serial number 1"), "{error}");
    let (cap, other) = (Cap::default(), Cap::default());
    bus.plug(info("1"), Vec::new(), cap.clone());
    bus.plug(info("2"), Vec::new(), other);
    // The plugin searches for it again by itself.
    cap.pushes.store(true, Ordering::Relaxed);
    let model_n = |app: &App| app.world().get::<ToolForce>(tool).unwrap().model_force_n.y;
    update_until(&mut app, "contact", |app| model_n(app) > 0.05);
    cap.pushes.store(false, Ordering::Relaxed);
    // A SpaceMouse has no motors: the force of the model is not written.
    assert_eq!(app.world().get::<ToolForce>(tool).unwrap().force_n, DVec3::ZERO);

    // Disconnected in contact, connected at another path.
    take_faults(&mut app);
    bus.unplug("cap 1");
    update_until(&mut app, "the fault", is_disconnected);
    bus.plug(HidInfo { path: "elsewhere".into(), ..info("1") }, Vec::new(), cap.clone());
    cap.pushes.store(true, Ordering::Relaxed);
    // The tool starts above the body again.
    update_until(&mut app, "no contact", |app| model_n(app) == 0.0);
    update_until(&mut app, "contact again", |app| model_n(app) > 0.05);
}

/// A hand on the arm of a 3-DOF board presses the body: no force before the calibration, then the force of [`ToolForce`].
#[test]
fn board_renders_force_after_its_calibration() {
    let (mut app, bus, tool) = scene(HidSelector { kind: Some(HidDeviceKind::Board), ..default() });
    let kinematics = BoardKinematics::default();
    let home = BoardFirmware::at_home(BoardForm::Bytes14, &kinematics).tip_m();
    let board = BoardFirmware::at_home(BoardForm::Bytes14, &kinematics);
    let (info, descriptor) = (board.info("board"), board.descriptor());
    let board = Arc::new(Mutex::new(board));
    bus.plug(info, descriptor, Arc::clone(&board));
    // Home is 10 mm above the body.
    let frame = DeviceFrame { offset_m: DVec3::new(0.012, 0.06, 0.009) - home, ..default() };
    app.world_mut().get_mut::<ToolSettings>(tool).unwrap().frame = frame;
    let options = BoardOptions { reach_m: 0.5, ..Default::default() };
    app.world_mut()
        .resource_mut::<HapticDevices>()
        .set_hid_options(HidOptions { board: options, ..default() });
    app.update();
    let DeviceSelector::Hid(selector) = app.world().get::<HapticTool>(tool).unwrap().device.clone() else {
        panic!("a HID device")
    };
    let calibration = app.world().resource::<HapticDevices>().hid_calibration(&selector).unwrap();
    // Not calibrated: no force at any position.
    let applied_n = || board.lock().unwrap().applied_force_n();
    update_until(&mut app, "reports", |_| board.lock().unwrap().exchanged() > 50);
    assert!(!calibration.is_done() && applied_n() == DVec3::ZERO);
    calibration.request();
    update_until(&mut app, "calibration", |_| calibration.is_done());
    update_until(&mut app, "a body", |app| app.world().get::<ToolForce>(tool).unwrap().model_age_s < 0.2);
    // The hand descends slowly until the force is half a newton.
    let mut depth_m = 0.0;
    update_until(&mut app, "half a newton", |_| {
        depth_m += 1e-4;
        board.lock().unwrap().hold_at(home - depth_m * DVec3::Y);
        applied_n().y > 0.5
    });
    assert!(depth_m > 0.005, "{depth_m}");
    // At rest the force on the hand is that of the component.
    update_until(&mut app, "rest", |app| {
        let written_n = app.world().get::<ToolForce>(tool).unwrap().force_n;
        (applied_n() - written_n).length() < 0.02 * written_n.length()
    });
    // Without the tool there is no force.
    app.world_mut().despawn(tool);
    app.update();
    assert_eq!(board.lock().unwrap().currents_ma(), [0; 3]);
}

#[test]
fn connected_devices_are_listed_and_two_matching_ones_are_a_fault() {
    let (mut app, bus, tool) = scene(HidSelector { kind: Some(HidDeviceKind::SpaceMouse), ..default() });
    bus.plug(info("1"), Vec::new(), Cap::default());
    bus.plug(info("2"), Vec::new(), Cap::default());
    app.update();
    hid_error(&mut app, |e| matches!(e, HidError::Several { found, .. } if found.len() == 2));
    let present = app.world().resource::<HapticDevices>().hid_present().unwrap();
    let [_, (second, label)] = &present[..] else { panic!("{present:?}") };
    assert_eq!((second.serial.as_deref(), label.ends_with("serial 2)")), (Some("2"), true));
    let second = second.clone();
    // Devices with the same serial number are distinguished by their paths.
    bus.plug(HidInfo { path: "clone".into(), ..info("2") }, Vec::new(), Cap::default());
    let present = app.world().resource::<HapticDevices>().hid_present().unwrap();
    let [_, (a, of_a), (b, of_b)] = &present[..] else { panic!("{present:?}") };
    assert!(a != b && of_a.ends_with(" at cap 2") && of_b.ends_with(" at clone"), "{of_a}, {of_b}");
    bus.unplug("clone");
    app.world_mut().get_mut::<HapticTool>(tool).unwrap().device = DeviceSelector::Hid(second.clone());
    app.update();
    assert_no_faults(&mut app);
    let counters = app.world().resource::<HapticDevices>().hid_counters(&second).unwrap();
    update_until(&mut app, "reports", |_| counters.read() > 20);
    // Two tools with one device.
    app.world_mut().spawn(HapticTool::new(second));
    app.update();
    hid_error(&mut app, |e| matches!(e, HidError::Busy { .. }));
}

#[test]
fn options_out_of_range_are_a_fault_until_they_are_corrected() {
    let (mut app, bus, tool) = scene(HidSelector::first());
    bus.plug(info("1"), Vec::new(), Cap::default());
    let bad = SpaceMouseOptions { full_speed_m_per_s: f64::NAN, ..Default::default() };
    let options = HidOptions { space_mouse: bad, ..Default::default() };
    app.world_mut().resource_mut::<HapticDevices>().set_hid_options(options);
    app.update();
    hid_error(&mut app, |e| matches!(e, HidError::Option { found, .. } if found == "NaN"));
    app.world_mut().resource_mut::<HapticDevices>().set_hid_options(HidOptions::default());
    // The registry has changed: tools without a loop start again by themselves.
    update_until(&mut app, "a loop", |app| app.world().get::<bevy_palpate::ToolLoop>(tool).is_some());
}
