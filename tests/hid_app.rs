//! Devices over HID in a Bevy app: chosen, touched with, lost and found again, refused.

use bevy::prelude::*;
use bevy_palpate::prelude::*;
use palpate_haptics::DeviceFrame;
use palpate_hid::simulated::{BoardFirmware, Firmware, SimulatedBus};
use palpate_hid::{BoardForm, BoardKinematics, BoardOptions, HidInfo, HidOptions, SpaceMouseOptions, Usage};
use palpate_tests::app::{listen, take_faults, update_until};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

/// A cap that while it is told to is pushed down, and up again, and down: a machine so busy that the app sleeps through one touch
/// sees the next.
#[derive(Clone, Default)]
struct Cap {
    pushes: Arc<AtomicBool>,
    asked: u64,
}

impl Firmware for Cap {
    fn input(&mut self, report: &mut [u8]) -> usize {
        // One report for each look at it.
        self.asked += 1;
        if self.asked.is_multiple_of(2) {
            return 0;
        }
        let push: i16 = match self.pushes.load(Ordering::Relaxed) {
            true if (self.asked / 2000).is_multiple_of(2) => 350,
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

fn scene(choice: HidSelector) -> (App, Arc<SimulatedBus>, Entity) {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, PalpatePlugins));
    listen(&mut app);
    let bus = Arc::new(SimulatedBus::default());
    let mut devices = app.world_mut().resource_mut::<HapticDevices>();
    devices.set_hid_bus(Arc::clone(&bus));
    // Slowly, and to 5 mm below the surface at most.
    let half_size_m = DVec3::splat(0.015);
    let space_mouse = SpaceMouseOptions { full_speed_m_per_s: 0.02, half_size_m, ..Default::default() };
    devices.set_hid_options(HidOptions { space_mouse, ..Default::default() });
    app.world_mut().spawn((DeformableBody::block([6, 6, 6], 0.1), FixedRegion::Face(BoxFace::Bottom)));
    let frame = DeviceFrame { offset_m: DVec3::new(0.012, 0.06, 0.009), ..default() };
    let tool = HapticTool { device: DeviceSelector::Hid(choice), ..default() };
    let tool = app.world_mut().spawn((tool, ToolSettings { frame, ..default() })).id();
    (app, bus, tool)
}

fn fault(app: &mut App, part: &str) -> bool {
    take_faults(app).iter().any(|fault| fault.contains(part))
}

#[test]
fn a_cap_touches_is_lost_and_found_again() {
    let (mut app, bus, tool) = scene(HidSelector { serial: Some("1".into()), ..default() });
    // Nothing is plugged in.
    app.update();
    assert!(fault(&mut app, "no supported device with serial number 1 is plugged in"));
    let (cap, other) = (Cap::default(), Cap::default());
    bus.plug(info("1"), Vec::new(), cap.clone());
    bus.plug(info("2"), Vec::new(), other);
    // It is looked for again by itself.
    cap.pushes.store(true, Ordering::Relaxed);
    let felt = |app: &App| app.world().get::<ToolForce>(tool).unwrap().model_force_n.y;
    update_until(&mut app, "touch", |app| felt(app) > 0.05);
    cap.pushes.store(false, Ordering::Relaxed);
    // It has no motors: what the model says is not what it is given.
    assert_eq!(app.world().get::<ToolForce>(tool).unwrap().force_n, DVec3::ZERO);

    // Unplugged in the touch, plugged in elsewhere.
    take_faults(&mut app);
    bus.unplug("cap 1");
    update_until(&mut app, "the fault", |app| fault(app, "the device is disconnected; plug it in again"));
    bus.plug(HidInfo { path: "elsewhere".into(), ..info("1") }, Vec::new(), cap.clone());
    cap.pushes.store(true, Ordering::Relaxed);
    // Its point begins above the body again.
    update_until(&mut app, "no touch", |app| felt(app) == 0.0);
    update_until(&mut app, "touch again", |app| felt(app) > 0.05);
}

/// A hand on a board's arm presses the body, is told where home is first, and feels what the app says.
#[test]
fn a_board_is_calibrated_and_its_hand_feels_the_body() {
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
    let DeviceSelector::Hid(choice) = app.world().get::<HapticTool>(tool).unwrap().device.clone() else {
        panic!("a choice")
    };
    let calibration = app.world().resource::<HapticDevices>().hid_calibration(&choice).unwrap();
    // Nobody has said where home is: no force, wherever the hand is.
    let felt = || board.lock().unwrap().applied_force_n();
    update_until(&mut app, "reports", |_| board.lock().unwrap().exchanged() > 50);
    assert!(!calibration.is_done() && felt() == DVec3::ZERO);
    calibration.request();
    update_until(&mut app, "calibration", |_| calibration.is_done());
    update_until(&mut app, "a body", |app| app.world().get::<ToolForce>(tool).unwrap().model_age_s < 0.2);
    // The hand goes down, slowly, until it feels half a newton.
    let mut depth_m = 0.0;
    update_until(&mut app, "half a newton", |_| {
        depth_m += 1e-4;
        board.lock().unwrap().hold_at(home - depth_m * DVec3::Y);
        felt().y > 0.5
    });
    assert!(depth_m > 0.005, "{depth_m}");
    // It rests: what it feels is what the app says that it is given.
    update_until(&mut app, "rest", |app| {
        let told = app.world().get::<ToolForce>(tool).unwrap().force_n;
        (felt() - told).length() < 0.02 * told.length()
    });
    // Away with the tool: no force.
    app.world_mut().despawn(tool);
    app.update();
    assert_eq!(board.lock().unwrap().currents_ma(), [0; 3]);
}

#[test]
fn what_is_plugged_in_is_listed_and_two_alike_are_a_fault() {
    let (mut app, bus, tool) = scene(HidSelector { kind: Some(HidDeviceKind::SpaceMouse), ..default() });
    bus.plug(info("1"), Vec::new(), Cap::default());
    bus.plug(info("2"), Vec::new(), Cap::default());
    app.update();
    assert!(fault(&mut app, "2 devices match SpaceMouse: SpaceMouse Compact (256f:c635, serial 1) at "));
    let present = app.world().resource::<HapticDevices>().hid_present().unwrap();
    let [_, (second, label)] = &present[..] else { panic!("{present:?}") };
    assert_eq!((second.serial.as_deref(), label.ends_with("serial 2)")), (Some("2"), true));
    let second = second.clone();
    // Clones with the same serial number are told apart by where they are.
    bus.plug(HidInfo { path: "clone".into(), ..info("2") }, Vec::new(), Cap::default());
    let present = app.world().resource::<HapticDevices>().hid_present().unwrap();
    let [_, (a, of_a), (b, of_b)] = &present[..] else { panic!("{present:?}") };
    assert!(a != b && of_a.ends_with(" at cap 2") && of_b.ends_with(" at clone"), "{of_a}, {of_b}");
    bus.unplug("clone");
    app.world_mut().get_mut::<HapticTool>(tool).unwrap().device = DeviceSelector::Hid(second.clone());
    app.update();
    assert!(take_faults(&mut app).is_empty());
    let counters = app.world().resource::<HapticDevices>().hid_counters(&second).unwrap();
    update_until(&mut app, "reports", |_| counters.read() > 20);
    // Two tools on one device.
    app.world_mut().spawn(HapticTool { device: DeviceSelector::Hid(second), ..default() });
    app.update();
    assert!(fault(&mut app, "already in use by another program or HapticTool"));
}

#[test]
fn options_out_of_bounds_are_a_fault_and_lose_nothing() {
    let (mut app, bus, tool) = scene(HidSelector::first());
    bus.plug(info("1"), Vec::new(), Cap::default());
    let bad = SpaceMouseOptions { full_speed_m_per_s: f64::NAN, ..Default::default() };
    let options = HidOptions { space_mouse: bad, ..Default::default() };
    app.world_mut().resource_mut::<HapticDevices>().set_hid_options(options);
    app.update();
    assert!(fault(&mut app, "full speed of the cap, m/s is NaN; it must be above 0 and at most 10"));
    app.world_mut().resource_mut::<HapticDevices>().set_hid_options(HidOptions::default());
    // The registry has changed: tools without a loop ask again by themselves.
    update_until(&mut app, "a loop", |app| app.world().get::<bevy_palpate::ToolLoop>(tool).is_some());
}
