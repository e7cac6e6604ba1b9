//! Who speaks when: numbers, silences, zero when it ends, what a broken board sends.

use crate::bench::*;
use glam::DVec3;
use palpate_haptics::*;
use palpate_hid::simulated::*;
use palpate_hid::*;
use proptest::{collection, prelude::*};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

#[test]
fn every_report_is_numbered_and_what_comes_again_has_the_same_number() {
    let mut bench = Bench::open(at_home(BoardForm::Bytes14).calibrated(), kept());
    let first = bench.tick(DVec3::ZERO).sequence.unwrap();
    assert_eq!(bench.tick(DVec3::ZERO).sequence, Some(first + 1));
    // Nothing is written: the board waits.
    bench.device().read(Duration::ZERO).unwrap();
    for _ in 0..9 {
        bench.pass_ms(1);
        assert_eq!(bench.device().read(Duration::ZERO).unwrap().sequence, Some(first + 2));
    }
}

#[test]
fn a_board_that_is_not_answered_is_woken_up_after_10_ms_and_its_silence_told() {
    let mut bench = Bench::open(at_home(BoardForm::Bytes14).calibrated(), kept());
    bench.ticks(40, DVec3::X);
    assert!((bench.applied_force_n() - DVec3::X).length() < ROUNDING_N);
    bench.pass_ms(1);
    // A report is read and its answer lost: the board waits for it.
    bench.device().read(Duration::ZERO).unwrap();
    let exchanged = bench.board(|it| it.exchanged());
    for _ in 0..9 {
        bench.pass_ms(1);
        bench.device().read(Duration::ZERO).unwrap();
    }
    assert_eq!(bench.board(|it| it.exchanged()), exchanged);
    bench.pass_ms(1);
    assert_eq!(bench.device().read(Duration::ZERO), Err(DeviceError::TimedOut));
    assert_eq!(bench.board(|it| it.exchanged()), exchanged + 1, "woken up");
    assert_eq!(bench.applied_force_n(), DVec3::ZERO);
    assert_eq!(bench.device().write(DVec3::X), Err(DeviceError::TimedOut), "nobody has asked");
    assert_eq!(bench.device().write(DVec3::ZERO), Ok(()), "and there is none");
    // From nothing, by a twentieth of 5 N with each force.
    for tick in 0..6 {
        bench.tick(DVec3::X);
        let expected_n = (0.25 * f64::from(tick)).min(1.0);
        assert!(
            (bench.applied_force_n().x - expected_n).abs() < ROUNDING_N,
            "{tick}: {}",
            bench.applied_force_n()
        );
    }
}

/// The board's own: half a second without a report.
#[test]
fn the_firmware_switches_its_motors_off_when_the_driver_is_silent() {
    let mut bench = Bench::open(at_home(BoardForm::Bytes14).calibrated(), kept());
    bench.ticks(40, DVec3::X);
    bench.board(|it| it.advance(0.49));
    assert!(bench.board(|it| it.are_motors_on() && it.currents_ma() != [0; 3]));
    bench.board(|it| it.advance(0.02));
    assert!(!bench.board(|it| it.are_motors_on()));
    assert_eq!(bench.board(|it| it.currents_ma()), [0; 3]);
}

#[test]
fn a_force_waits_until_it_is_asked_for_but_zero_and_much_less_do_not() {
    let mut bench = Bench::open(at_home(BoardForm::Bytes14).calibrated(), kept());
    bench.ticks(40, DVec3::X);
    let shown = bench.board(|it| it.currents_ma());
    let exchanged = |bench: &Bench| bench.board(|it| it.exchanged());
    let before = exchanged(&bench);
    for more in [1.5, 1.0, 0.9, 0.6] {
        bench.device().write(more * DVec3::X).unwrap();
    }
    assert_eq!((exchanged(&bench), bench.board(|it| it.currents_ma())), (before, shown));
    // It has sent its report and listens; the answer to that comes early.
    let mut report = [0; 64];
    bench.board(|it| it.input(&mut report));
    bench.device().write(0.4 * DVec3::X).unwrap();
    assert_eq!(exchanged(&bench), before + 1);
    assert!((bench.applied_force_n() - 0.4 * DVec3::X).length() < ROUNDING_N);
    // Once for each report.
    bench.board(|it| it.input(&mut report));
    bench.device().write(DVec3::ZERO).unwrap();
    assert_eq!(exchanged(&bench), before + 1);
}

#[test]
fn another_thread_can_stop_it() {
    let mut bench = Bench::open(at_home(BoardForm::Bytes64).calibrated(), kept());
    bench.ticks(40, DVec3::X);
    let mut stop = bench.device().emergency_stop().unwrap();
    // The board has sent its report, and the loop hangs.
    bench.pass_ms(1);
    bench.device().read(Duration::ZERO).unwrap();
    stop.stop().unwrap();
    assert_eq!(bench.applied_force_n(), DVec3::ZERO);
    assert_eq!(bench.board(|it| it.currents_ma()), [0; 3]);
}

#[test]
fn dropping_leaves_zero_currents() {
    let mut bench = Bench::open(at_home(BoardForm::Bytes14).calibrated(), kept());
    bench.ticks(40, DVec3::X);
    assert!(bench.board(|it| it.currents_ma()) != [0; 3]);
    drop(bench.device.take());
    assert_eq!(bench.board(|it| it.currents_ma()), [0; 3]);
}

/// A board that speaks at every second tick only.
struct Slow {
    board: Arc<Mutex<BoardFirmware>>,
    is_awake: bool,
}

impl Firmware for Slow {
    fn input(&mut self, report: &mut [u8]) -> usize {
        let length = if self.is_awake { self.board.input(report) } else { 0 };
        if length == 0 {
            self.is_awake = !self.is_awake;
        }
        length
    }
    fn output(&mut self, report: &[u8]) -> bool {
        self.board.output(report)
    }
}

#[test]
fn a_slow_board_gets_one_report_for_each_of_its_own() {
    let mut bench = Bench::new(at_home(BoardForm::Bytes14).calibrated(), kept());
    let slow = Slow { board: bench.firmware.clone(), is_awake: false };
    bench.bus.plug(bench.board(|it| it.info(PATH)), bench.board(|it| it.descriptor()), slow);
    bench.device().open().unwrap();
    bench.ticks(50, DVec3::X);
    let (exchanged, first) = (bench.board(|it| it.exchanged()), bench.tick(DVec3::X).sequence.unwrap());
    let mut greatest_ahead = 0;
    for tick in 0..100_u64 {
        let number = bench.tick((1.0 + 0.01 * tick as f64) * DVec3::X).sequence.unwrap();
        greatest_ahead = greatest_ahead.max(bench.board(|it| it.exchanged()) - exchanged - (number - first));
    }
    let taken = bench.board(|it| it.exchanged()) - exchanged;
    assert!((45..=55).contains(&taken) && greatest_ahead <= 1, "{taken} {greatest_ahead}");
}

/// A board on a bus that takes its time: a report every so many milliseconds.
struct Paced {
    board: Arc<Mutex<BoardFirmware>>,
    ms: Arc<AtomicU64>,
    period_ms: u64,
    next_ms: u64,
}

impl Firmware for Paced {
    fn input(&mut self, report: &mut [u8]) -> usize {
        let now_ms = self.ms.load(Ordering::Relaxed);
        let length = if now_ms < self.next_ms { 0 } else { self.board.input(report) };
        if length > 0 {
            self.next_ms = now_ms + self.period_ms;
        }
        length
    }
    fn output(&mut self, report: &[u8]) -> bool {
        self.board.output(report)
    }
}

/// A calibrated board whose reports come every `period_ms`, opened and heard.
fn open_at_pace(period_ms: u64) -> Bench {
    let mut bench = Bench::new(at_home(BoardForm::Bytes14).calibrated(), kept());
    let paced = Paced { board: bench.firmware.clone(), ms: bench.ms.clone(), period_ms, next_ms: 0 };
    bench.bus.plug(bench.board(|it| it.info(PATH)), bench.board(|it| it.descriptor()), paced);
    bench.device().open().unwrap();
    // Before its first report there is nothing to be read.
    for _ in 0..8 {
        bench.pass_ms(1);
        let _ = bench.device().read(Duration::ZERO);
        let _ = bench.device().write(DVec3::ZERO);
    }
    bench
}

#[test]
fn forces_that_nobody_asked_for_do_not_pile_up_at_a_slow_board() {
    let mut bench = open_at_pace(4);
    bench.ticks(200, DVec3::X);
    let (mut most, mut shown) = (0, 0);
    for _ in 0..50 {
        // Less than half, which does not wait until it is asked for; then all of it, which does.
        for force_n in [0.4 * DVec3::X, DVec3::X] {
            for _ in 0..12 {
                bench.tick(force_n);
                most = most.max(bench.board(|it| it.waiting()));
            }
            shown += u32::from((bench.applied_force_n() - force_n).length() < ROUNDING_N);
        }
    }
    assert!(most == 1 && shown == 100, "{most} reports waited at the board, {shown} forces were shown");
    assert_eq!(bench.board(|it| it.waiting()), 0);
}

/// Whenever it comes, each report is answered once, by the force of its own tick. The bus brings one report each millisecond.
#[test]
fn after_a_stop_from_another_thread_no_force_comes_a_report_late() {
    for (stops, is_read) in [(1, true), (1, false), (3, true), (3, false)] {
        let mut bench = open_at_pace(1);
        bench.ticks(50, DVec3::X);
        assert!((bench.applied_force_n() - DVec3::X).length() < ROUNDING_N, "{}", bench.applied_force_n());
        let mut stop = bench.device().emergency_stop().unwrap();
        bench.pass_ms(1);
        if is_read {
            // The board has sent its report, and the loop hangs before it answers.
            bench.device().read(Duration::ZERO).unwrap();
        }
        (0..stops).for_each(|_| stop.stop().unwrap());
        bench.device().write(DVec3::X).unwrap();
        // What was sent ahead is taken, and the rest begins with little.
        bench.ticks(stops, DVec3::X);
        assert!(bench.applied_force_n().length() < 0.8, "{}", bench.applied_force_n());
        bench.ticks(40, DVec3::X);
        for tick in 0..20 {
            let before = bench.board(|it| it.exchanged());
            let force_n = (1.0 + 0.02 * f64::from(tick)) * DVec3::X;
            bench.tick(force_n);
            assert_eq!(bench.board(|it| (it.exchanged(), it.waiting())), (before + 1, 0));
            let off_n = bench.applied_force_n() - force_n;
            assert!(off_n.length() < ROUNDING_N, "{stops} {is_read}: {off_n}");
        }
    }
}

#[test]
fn a_board_of_which_a_report_is_lost_is_answered_again() {
    let mut bench = Bench::open(at_home(BoardForm::Bytes14).calibrated(), kept());
    bench.ticks(40, DVec3::X);
    assert!(bench.board(|it| it.input(&mut [0; 64])) > 0);
    for _ in 0..25 {
        bench.pass_ms(1);
        let _ = bench.device().read(Duration::ZERO);
        let _ = bench.device().write(DVec3::X);
    }
    bench.ticks(10, DVec3::X);
    assert!((bench.applied_force_n() - DVec3::X).length() < ROUNDING_N, "{}", bench.applied_force_n());
    assert_eq!(bench.board(|it| it.waiting()), 0);
}

/// A bus that brings one report at a time, the first when it has been asked twice.
struct OneByOne {
    board: Arc<Mutex<BoardFirmware>>,
    comes_next: bool,
}

impl Firmware for OneByOne {
    fn input(&mut self, report: &mut [u8]) -> usize {
        let length = if self.comes_next { self.board.input(report) } else { 0 };
        self.comes_next = length == 0;
        length
    }
    fn output(&mut self, report: &[u8]) -> bool {
        self.board.output(report)
    }
}

#[test]
fn nothing_waits_at_a_board_that_has_been_opened_whoever_was_to_speak() {
    for form in BoardForm::ALL {
        for is_listening in [false, true] {
            let mut bench = Bench::new(at_home(form), homed());
            if is_listening {
                assert!(bench.board(|it| it.input(&mut [0; 64])) > 0);
            }
            let one = OneByOne { board: bench.firmware.clone(), comes_next: false };
            bench.bus.plug(bench.board(|it| it.info(PATH)), bench.board(|it| it.descriptor()), one);
            bench.device().open().unwrap();
            bench.ticks(3, DVec3::ZERO);
            assert_eq!(bench.board(|it| it.waiting()), 0, "{form:?} {is_listening}");
            bench.ticks(40, DVec3::X);
            assert!((bench.applied_force_n() - DVec3::X).length() < ROUNDING_N, "{form:?} {is_listening}");
        }
    }
}

/// What a broken board may send.
struct Babbling(Vec<Vec<u8>>);

impl Firmware for Babbling {
    fn input(&mut self, report: &mut [u8]) -> usize {
        let next = self.0.pop().unwrap_or_default();
        report[..next.len()].copy_from_slice(&next);
        next.len()
    }
    fn output(&mut self, _: &[u8]) -> bool {
        true
    }
}

proptest! {
    #[test]
    fn whatever_a_board_sends_positions_are_finite_and_nothing_panics(
        said in collection::vec(prop_oneof![collection::vec(any::<u8>(), 14), collection::vec(any::<u8>(), 1..80)], 0..40),
    ) {
        let mut bench = Bench::new(at_home(BoardForm::Bytes14), homed());
        bench.bus.plug(bench.board(|it| it.info(PATH)), bench.board(|it| it.descriptor()), Babbling(said));
        bench.device().open().unwrap();
        for _ in 0..30 {
            bench.pass_ms(1);
            if let Ok(reading) = bench.device().read(Duration::ZERO) {
                prop_assert!(reading.is_usable());
            }
            let _ = bench.device().write(DVec3::ONE);
        }
    }
}

#[test]
fn nothing_is_allocated_while_it_is_read_and_written() {
    for form in BoardForm::ALL {
        let mut bench = Bench::open(moving(form), homed());
        bench.ticks(50, DVec3::ZERO);
        let (ms, mut device) = (bench.ms.clone(), bench.device.take().unwrap());
        let calibration = device.board_calibration().unwrap();
        let allocations = allocation_counter::measure(|| {
            for tick in 0..500 {
                ms.fetch_add(1, Ordering::Relaxed);
                device.read(Duration::from_millis(1)).unwrap();
                device.write(DVec3::splat(0.01 * f64::from(tick))).unwrap();
                if tick == 300 {
                    calibration.request();
                }
            }
            // A silence and a wake-up.
            device.read(Duration::ZERO).unwrap();
            for _ in 0..20 {
                ms.fetch_add(1, Ordering::Relaxed);
                let _ = device.read(Duration::ZERO);
            }
        });
        assert_eq!(allocations.count_total, 0, "{form:?}: {allocations:?}");
        assert_eq!(allocations.count_current, 0);
    }
}
