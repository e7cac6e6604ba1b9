//! Calibration of the counters, also after the board was unplugged.

use super::bench::*;
use glam::DVec3;
use palpate_haptics::*;
use palpate_hid::simulated::*;
use palpate_hid::*;
use palpate_local::{Contact, Scheme};
use std::sync::{Arc, Mutex};
use std::time::Duration;

#[test]
fn force_is_zero_until_calibrated() {
    for form in BoardForm::ALL {
        let mut bench = Bench::open(at_home(form), BoardOptions::default());
        let calibration = bench.device().board_calibration().unwrap();
        for _ in 0..50 {
            bench.tick(DVec3::Y);
            assert_eq!(bench.applied_force_n(), DVec3::ZERO);
        }
        assert!(!calibration.is_done());
        // The app requests calibration with the arm at home.
        calibration.request();
        let reading = bench.ticks(4, DVec3::ZERO);
        assert!(calibration.is_done(), "{form:?}");
        assert!((reading.position_m - DVec3::new(0.0, 0.205, 0.025)).length() < 1e-12, "{form:?}");
        bench.ticks(30, DVec3::Y);
        assert!((bench.applied_force_n() - DVec3::Y).length() < ROUNDING_N, "{form:?}");
    }
}

#[test]
fn board_button_calibrates_in_use() {
    let mut bench = Bench::open(at_home(BoardForm::Bytes14).calibrated(), kept());
    bench.ticks(40, DVec3::Y);
    bench.ticks(500, DVec3::ZERO);
    // The counters become invalid.
    bench.board(|it| it.cut_power());
    let wrong_m = bench.ticks(3, DVec3::ZERO).position_m;
    assert!((wrong_m - bench.board(|it| it.tip_m())).length() > 0.1);
    bench.board(|it| it.request_calibration());
    bench.tick(DVec3::Y);
    assert_eq!(bench.applied_force_n(), DVec3::ZERO);
    let calibration = bench.device().board_calibration().unwrap();
    assert!(!calibration.is_done());
    let right_m = bench.ticks(3, DVec3::ZERO).position_m;
    assert!(calibration.is_done());
    assert!((right_m - bench.board(|it| it.tip_m())).length() < 2e-4);
}

#[test]
fn force_grows_from_zero_after_calibration_in_use() {
    for form in BoardForm::ALL {
        let mut bench = Bench::open(at_home(form), homed());
        bench.ticks(40, DVec3::Y);
        assert!((bench.applied_force_n() - DVec3::Y).length() < ROUNDING_N);
        let home_m = kinematics().position_m(kinematics().home_rad());
        bench.board(|it| it.hold_at(home_m - DVec3::Y / 400.0));
        bench.device().board_calibration().unwrap().request();
        // By at most a twentieth of 5 N per force, once the counters were sent.
        let mut last_n = 0.0;
        for tick in 0..20 {
            bench.tick(DVec3::Y);
            let now_n = bench.applied_force_n().length();
            assert!(now_n - last_n < 0.25 + ROUNDING_N, "{form:?} {tick}: {last_n} {now_n}");
            last_n = now_n;
        }
        assert!((bench.applied_force_n() - DVec3::Y).length() < 0.1, "{form:?}: {}", bench.applied_force_n());
    }
}

#[test]
fn reconnected_board_needs_calibration() {
    let mut bench = Bench::open(moving(BoardForm::Bytes14), homed());
    bench.ticks(500, DVec3::Y);
    assert!((bench.applied_force_n() - DVec3::Y).length() < ROUNDING_N);
    bench.bus.unplug(PATH);
    assert_eq!(bench.device().read(Duration::ZERO), Err(DeviceError::Disconnected));
    assert_eq!(bench.device().write(DVec3::Y), Err(DeviceError::Disconnected), "not sent");
    bench.board(|it| it.advance(0.6));
    assert!(!bench.board(|it| it.are_motors_on()), "switched off by its watchdog");
    assert_eq!(bench.device().close(), Err(DeviceError::Disconnected));
    assert_eq!(bench.device().open(), Err(DeviceError::Disconnected));
    // The board had no power, so its counters are invalid and the force is zero in any pose.
    bench.board(|it| it.cut_power());
    bench.plug();
    bench.device().open().unwrap();
    bench.ticks(50, DVec3::Y);
    assert_eq!(bench.applied_force_n(), DVec3::ZERO);
    let home_m = kinematics().position_m(kinematics().home_rad());
    bench.board(|it| it.hold_at(home_m));
    bench.ticks(2000, DVec3::ZERO);
    bench.device().board_calibration().unwrap().request();
    bench.ticks(4, DVec3::ZERO);
    bench.ticks(40, DVec3::Y);
    assert!((bench.applied_force_n() - DVec3::Y).length() < ROUNDING_N, "{}", bench.applied_force_n());
}

#[test]
fn requests_while_unplugged_are_discarded() {
    for form in BoardForm::ALL {
        let mut bench = Bench::open(at_home(form), homed());
        bench.ticks(40, DVec3::ZERO);
        let calibration = bench.device().board_calibration().unwrap();
        // Before the driver has detected it, and while the device is closed.
        bench.bus.unplug(PATH);
        calibration.request();
        assert_eq!(bench.device().close(), Err(DeviceError::Disconnected));
        calibration.request();
        // The board returns with its arm in another pose.
        bench.board(|it| {
            it.hold_at(0.5 * it.tip_m());
            it.advance(2.0);
            it.cut_power();
        });
        bench.plug();
        bench.device().open().unwrap();
        for _ in 0..50 {
            bench.tick(DVec3::Y);
            assert_eq!(bench.applied_force_n(), DVec3::ZERO, "{form:?}");
        }
        assert!(!calibration.is_done(), "{form:?}");
        // A request in this opening takes effect.
        let home_m = kinematics().position_m(kinematics().home_rad());
        bench.board(|it| it.hold_at(home_m));
        bench.ticks(2000, DVec3::ZERO);
        calibration.request();
        bench.ticks(4, DVec3::ZERO);
        assert!(calibration.is_done(), "{form:?}");
    }
}

/// Opens the board with its arm in another pose and asserts zero force.
fn opens_without_force(bench: &mut Bench) {
    let calibration = bench.device().board_calibration().unwrap();
    assert!(!calibration.is_done(), "calibration is invalid before the opening");
    bench.board(|it| {
        it.hold_at(0.5 * it.tip_m());
        it.advance(2.0);
        it.cut_power();
    });
    bench.device().open().unwrap();
    for _ in 0..50 {
        bench.tick(DVec3::Y);
        assert_eq!(bench.applied_force_n(), DVec3::ZERO);
    }
    assert!(!calibration.is_done());
}

#[test]
fn kept_counters_are_valid_until_the_board_is_unplugged() {
    let begin = || {
        let mut bench = Bench::open(at_home(BoardForm::Bytes14).calibrated(), kept());
        bench.ticks(40, DVec3::Y);
        assert!((bench.applied_force_n() - DVec3::Y).length() < ROUNDING_N);
        bench
    };
    // Unplugged while reading.
    let mut bench = begin();
    bench.bus.unplug(PATH);
    assert_eq!(bench.device().read(Duration::ZERO), Err(DeviceError::Disconnected));
    let _ = bench.device().close();
    bench.plug();
    opens_without_force(&mut bench);
    // Closed and opened again, then unplugged while closed.
    let mut bench = begin();
    bench.device().close().unwrap();
    bench.device().open().unwrap();
    bench.ticks(40, DVec3::Y);
    assert!((bench.applied_force_n() - DVec3::Y).length() < ROUNDING_N);
    bench.device().close().unwrap();
    bench.bus.unplug(PATH);
    assert_eq!(bench.device().open(), Err(DeviceError::Disconnected));
    bench.plug();
    opens_without_force(&mut bench);
    // Unplugged while closed, and at another path when opened again.
    let mut bench = begin();
    bench.device().close().unwrap();
    bench.bus.unplug(PATH);
    bench.bus.plug(
        bench.board(|it| it.info("elsewhere")),
        bench.board(|it| it.descriptor()),
        bench.firmware.clone(),
    );
    let calibration = bench.device().board_calibration().unwrap();
    bench.device().open().unwrap();
    bench.ticks(40, DVec3::Y);
    assert!(!calibration.is_done());
    assert_eq!(bench.applied_force_n(), DVec3::ZERO);
    // Force after calibration.
    calibration.request();
    bench.ticks(4, DVec3::ZERO);
    bench.ticks(40, DVec3::Y);
    assert!((bench.applied_force_n() - DVec3::Y).length() < ROUNDING_N, "{}", bench.applied_force_n());
}

/// Loop on its own thread; the connection breaks for a moment while the board keeps its power.
#[test]
fn loop_thread_reconnects_a_board() {
    #[expect(clippy::disallowed_methods, reason = "the test waits for another thread")]
    fn wait_for(mut what: impl FnMut() -> bool) {
        for _ in 0..20_000 {
            if what() {
                return;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        panic!("timeout after 20 s");
    }
    let bus = Arc::new(SimulatedBus::default());
    let firmware = Arc::new(Mutex::new(at_home(BoardForm::Bytes14).calibrated()));
    let plug = || {
        let (info, descriptor) = {
            let board = firmware.lock().unwrap();
            (board.info(PATH), board.descriptor())
        };
        bus.plug(info, descriptor, firmware.clone());
    };
    plug();
    let device = find(bus.clone(), kept()).unwrap();
    let calibration = device.board_calibration().unwrap();
    // No age limit for the held model, as the other thread may be late.
    let safety = SafetySettings {
        arm_below_n: f64::MAX,
        ramp_s: 0.0,
        stale_after_periods: 1e9,
        ..device.describe().safety(1e-3)
    };
    let settings = LoopSettings { safety, ..LoopSettings::default() };
    let config = LoopConfig { device: device.describe().limits(), ..LoopConfig::default() };
    let (mut handle, haptic_loop) = haptic_loop(config, settings).unwrap();
    let mut thread = haptic_loop.spawn(Box::new(device)).unwrap();
    let model = handle.model_slot();
    (model.scheme, model.contact, model.force_n) = (Scheme::Hold, Contact::Held, DVec3::Y);
    handle.publish_model();
    let is_applied = || (firmware.lock().unwrap().applied_force_n() - DVec3::Y).length() < ROUNDING_N;
    wait_for(is_applied);
    bus.unplug(PATH);
    let events = |handle: &mut HapticHandle| -> Vec<LoopEventKind> {
        std::iter::from_fn(|| handle.next_event()).map(|event| event.kind).collect()
    };
    let lost = LoopEventKind::DeviceFailed(DeviceError::Disconnected);
    wait_for(|| events(&mut handle).contains(&lost));
    firmware.lock().unwrap().advance(0.6);
    assert!(!firmware.lock().unwrap().are_motors_on());
    plug();
    // The counters are no longer valid: the loop runs without force until calibration is requested.
    wait_for(|| events(&mut handle).contains(&LoopEventKind::Reconnected));
    let processed = firmware.lock().unwrap().exchanged();
    wait_for(|| firmware.lock().unwrap().exchanged() > processed + 100);
    assert!(!calibration.is_done());
    assert_eq!(firmware.lock().unwrap().currents_ma(), [0; 3]);
    calibration.request();
    wait_for(|| calibration.is_done() && is_applied());
    assert!(matches!(thread.stop(), StopOutcome::Joined));
    assert_eq!(firmware.lock().unwrap().currents_ma(), [0; 3]);
}

/// A board that first sends two stale reports, one for each report that it receives.
struct StaleReports {
    board: BoardFirmware,
    queued: Vec<Vec<u8>>,
    is_due: bool,
}

impl Firmware for StaleReports {
    fn input(&mut self, report: &mut [u8]) -> usize {
        // One for each received report.
        if !std::mem::take(&mut self.is_due) {
            return 0;
        }
        let Some(old) = self.queued.pop() else { return self.board.input(report) };
        report[..old.len()].copy_from_slice(&old);
        old.len()
    }
    fn output(&mut self, report: &[u8]) -> bool {
        self.is_due = true;
        self.board.output(report)
    }
}

#[test]
fn stale_reports_do_not_affect_calibration() {
    for form in BoardForm::ALL {
        let mut bench = Bench::new(at_home(form), homed());
        let old = BoardInput { encoders: [500, -500, 3000, 0, 0, 0], ..BoardInput::default() }.encode(form);
        let stale =
            StaleReports { board: at_home(form), queued: vec![old.as_slice().to_vec(); 2], is_due: false };
        bench.bus.plug(bench.board(|it| it.info(PATH)), bench.board(|it| it.descriptor()), stale);
        bench.device().open().unwrap();
        let reading = bench.ticks(4, DVec3::ZERO);
        assert!((reading.position_m - DVec3::new(0.0, 0.205, 0.025)).length() < 1e-12, "{form:?}");
    }
}
