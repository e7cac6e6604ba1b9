//! Whether the counters are right: calibration, and boards that were gone.

use crate::bench::*;
use glam::DVec3;
use palpate_haptics::*;
use palpate_hid::simulated::*;
use palpate_hid::*;
use palpate_local::{Contact, Scheme};
use std::sync::{Arc, Mutex};
use std::time::Duration;

#[test]
fn nothing_is_shown_before_somebody_has_put_it_home() {
    for form in BoardForm::ALL {
        let mut bench = Bench::open(at_home(form), BoardOptions::default());
        let calibration = bench.device().board_calibration().unwrap();
        for _ in 0..50 {
            bench.tick(DVec3::Y);
            assert_eq!(bench.applied_force_n(), DVec3::ZERO);
        }
        assert!(!calibration.is_done());
        // The arm is at home, and the app says so.
        calibration.request();
        let reading = bench.ticks(4, DVec3::ZERO);
        assert!(calibration.is_done(), "{form:?}");
        assert!((reading.position_m - DVec3::new(0.0, 0.205, 0.025)).length() < 1e-12, "{form:?}");
        bench.ticks(30, DVec3::Y);
        assert!((bench.applied_force_n() - DVec3::Y).length() < ROUNDING_N, "{form:?}");
    }
}

#[test]
fn the_board_s_own_button_calibrates_it_also_in_use() {
    let mut bench = Bench::open(at_home(BoardForm::Bytes14).calibrated(), kept());
    bench.ticks(40, DVec3::Y);
    bench.ticks(500, DVec3::ZERO);
    // Something has slipped: the counters are wrong.
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
fn force_begins_from_nothing_after_a_calibration_in_use() {
    for form in BoardForm::ALL {
        let mut bench = Bench::open(at_home(form), homed());
        bench.ticks(40, DVec3::Y);
        assert!((bench.applied_force_n() - DVec3::Y).length() < ROUNDING_N);
        let home_m = kinematics().position_m(kinematics().home_rad());
        bench.board(|it| it.hold_at(home_m - DVec3::Y / 400.0));
        bench.device().board_calibration().unwrap().request();
        // By a twentieth of 5 N with each force, once the board has been told.
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
fn unplugged_in_a_touch_and_plugged_in_again() {
    let mut bench = Bench::open(moving(BoardForm::Bytes14), homed());
    bench.ticks(500, DVec3::Y);
    assert!((bench.applied_force_n() - DVec3::Y).length() < ROUNDING_N);
    bench.bus.unplug(PATH);
    assert_eq!(bench.device().read(Duration::ZERO), Err(DeviceError::Disconnected));
    assert_eq!(bench.device().write(DVec3::Y), Err(DeviceError::Disconnected), "it has not taken it");
    bench.board(|it| it.advance(0.6));
    assert!(!bench.board(|it| it.are_motors_on()), "its own watchdog");
    assert_eq!(bench.device().close(), Err(DeviceError::Disconnected));
    assert_eq!(bench.device().open(), Err(DeviceError::Disconnected));
    // It had no power meanwhile, so that its counters mean nothing: no force, wherever the arm is.
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
fn a_request_from_while_it_was_unplugged_is_forgotten() {
    for form in BoardForm::ALL {
        let mut bench = Bench::open(at_home(form), homed());
        bench.ticks(40, DVec3::ZERO);
        let calibration = bench.device().board_calibration().unwrap();
        // Before the loop has noticed, and when the device is closed.
        bench.bus.unplug(PATH);
        calibration.request();
        assert_eq!(bench.device().close(), Err(DeviceError::Disconnected));
        calibration.request();
        // It comes back with its arm somewhere else.
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
        // One that is made now is heard.
        let home_m = kinematics().position_m(kinematics().home_rad());
        bench.board(|it| it.hold_at(home_m));
        bench.ticks(2000, DVec3::ZERO);
        calibration.request();
        bench.ticks(4, DVec3::ZERO);
        assert!(calibration.is_done(), "{form:?}");
    }
}

/// Opens it again, its arm somewhere else, and counts on no force.
fn opens_without_force(bench: &mut Bench) {
    let calibration = bench.device().board_calibration().unwrap();
    assert!(!calibration.is_done(), "it is known before");
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
fn what_was_kept_is_believed_until_the_board_is_gone() {
    let begin = || {
        let mut bench = Bench::open(at_home(BoardForm::Bytes14).calibrated(), kept());
        bench.ticks(40, DVec3::Y);
        assert!((bench.applied_force_n() - DVec3::Y).length() < ROUNDING_N);
        bench
    };
    // Gone while it is read.
    let mut bench = begin();
    bench.bus.unplug(PATH);
    assert_eq!(bench.device().read(Duration::ZERO), Err(DeviceError::Disconnected));
    let _ = bench.device().close();
    bench.plug();
    opens_without_force(&mut bench);
    // Closed, and opened again as nothing has happened; then gone while it is closed.
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
    // Gone while it is closed, and somewhere else when it is opened again.
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
    // Once it is calibrated there is force again.
    calibration.request();
    bench.ticks(4, DVec3::ZERO);
    bench.ticks(40, DVec3::Y);
    assert!((bench.applied_force_n() - DVec3::Y).length() < ROUNDING_N, "{}", bench.applied_force_n());
}

/// The loop's own thread, with a bus that was loose for a moment while the board had power from elsewhere.
#[test]
fn a_loop_finds_its_board_again() {
    #[expect(clippy::disallowed_methods, reason = "the other thread has to do something")]
    fn wait_for(mut what: impl FnMut() -> bool) {
        for _ in 0..20_000 {
            if what() {
                return;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        panic!("it has not happened within 20 s");
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
    // A hold without an age limit, so that the other thread may be late.
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
    let is_felt = || (firmware.lock().unwrap().applied_force_n() - DVec3::Y).length() < ROUNDING_N;
    wait_for(is_felt);
    bus.unplug(PATH);
    let events = |handle: &mut HapticHandle| -> Vec<LoopEventKind> {
        std::iter::from_fn(|| handle.next_event()).map(|event| event.kind).collect()
    };
    let lost = LoopEventKind::DeviceFailed(DeviceError::Disconnected);
    wait_for(|| events(&mut handle).contains(&lost));
    firmware.lock().unwrap().advance(0.6);
    assert!(!firmware.lock().unwrap().are_motors_on());
    plug();
    // What was kept is believed no longer: the loop goes on without force until somebody says that the arm is at home.
    wait_for(|| events(&mut handle).contains(&LoopEventKind::Reconnected));
    let taken = firmware.lock().unwrap().exchanged();
    wait_for(|| firmware.lock().unwrap().exchanged() > taken + 100);
    assert!(!calibration.is_done());
    assert_eq!(firmware.lock().unwrap().currents_ma(), [0; 3]);
    calibration.request();
    wait_for(|| calibration.is_done() && is_felt());
    assert!(matches!(thread.stop(), StopOutcome::Joined));
    assert_eq!(firmware.lock().unwrap().currents_ma(), [0; 3]);
}

/// A board of which two reports from before it was opened come first, one after the other.
struct Stale {
    board: BoardFirmware,
    kept: Vec<Vec<u8>>,
    is_due: bool,
}

impl Firmware for Stale {
    fn input(&mut self, report: &mut [u8]) -> usize {
        // One for each report that it gets.
        if !std::mem::take(&mut self.is_due) {
            return 0;
        }
        let Some(old) = self.kept.pop() else { return self.board.input(report) };
        report[..old.len()].copy_from_slice(&old);
        old.len()
    }
    fn output(&mut self, report: &[u8]) -> bool {
        self.is_due = true;
        self.board.output(report)
    }
}

#[test]
fn old_reports_do_not_say_where_home_is() {
    for form in BoardForm::ALL {
        let mut bench = Bench::new(at_home(form), homed());
        let old = BoardInput { encoders: [500, -500, 3000, 0, 0, 0], ..BoardInput::default() }.encode(form);
        let stale = Stale { board: at_home(form), kept: vec![old.as_slice().to_vec(); 2], is_due: false };
        bench.bus.plug(bench.board(|it| it.info(PATH)), bench.board(|it| it.descriptor()), stale);
        bench.device().open().unwrap();
        let reading = bench.ticks(4, DVec3::ZERO);
        assert!((reading.position_m - DVec3::new(0.0, 0.205, 0.025)).length() < 1e-12, "{form:?}");
    }
}
