//! Report exchange: sequence numbers, silences, zero on closing, malformed reports.

use super::bench::*;
use glam::DVec3;
use palpate_haptics::*;
use palpate_hid::simulated::*;
use palpate_hid::*;
use proptest::{collection, prelude::*};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

#[test]
fn repeated_readings_keep_their_sequence_number() {
    let mut bench = Bench::open(at_home(BoardForm::Bytes14).calibrated(), kept());
    let first = bench.tick(DVec3::ZERO).sequence.unwrap();
    assert_eq!(bench.tick(DVec3::ZERO).sequence, Some(first + 1));
    // Without a write the board waits.
    bench.device().read(Duration::ZERO).unwrap();
    for _ in 0..9 {
        bench.advance_ms(1);
        assert_eq!(bench.device().read(Duration::ZERO).unwrap().sequence, Some(first + 2));
    }
}

#[test]
fn unreplied_board_is_woken_up_after_10_ms_and_reading_times_out() {
    let mut bench = Bench::open(at_home(BoardForm::Bytes14).calibrated(), kept());
    bench.ticks(40, DVec3::X);
    assert!((bench.applied_force_n() - DVec3::X).length() < ROUNDING_N);
    bench.advance_ms(1);
    // A report is read and not replied to: the board waits for the reply.
    bench.device().read(Duration::ZERO).unwrap();
    let exchanged = bench.board(|it| it.exchanged());
    for _ in 0..9 {
        bench.advance_ms(1);
        bench.device().read(Duration::ZERO).unwrap();
    }
    assert_eq!(bench.board(|it| it.exchanged()), exchanged);
    bench.advance_ms(1);
    assert_eq!(bench.device().read(Duration::ZERO), Err(DeviceError::TimedOut));
    assert_eq!(bench.board(|it| it.exchanged()), exchanged + 1, "woken up");
    assert_eq!(bench.applied_force_n(), DVec3::ZERO);
    assert_eq!(bench.device().write(DVec3::X), Err(DeviceError::TimedOut), "no report to reply to");
    assert_eq!(bench.device().write(DVec3::ZERO), Ok(()), "zero is no force that could be dropped");
    // The force grows from zero by a twentieth of 5 N per report.
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

/// The watchdog of the board: 0.5 s without a report.
#[test]
fn firmware_watchdog_switches_the_motors_off() {
    let mut bench = Bench::open(at_home(BoardForm::Bytes14).calibrated(), kept());
    bench.ticks(40, DVec3::X);
    bench.board(|it| it.advance(0.49));
    assert!(bench.board(|it| it.are_motors_on() && it.currents_ma() != [0; 3]));
    bench.board(|it| it.advance(0.02));
    assert!(!bench.board(|it| it.are_motors_on()));
    assert_eq!(bench.board(|it| it.currents_ma()), [0; 3]);
}

#[test]
fn force_waits_for_a_report_except_zero_and_below_half() {
    let mut bench = Bench::open(at_home(BoardForm::Bytes14).calibrated(), kept());
    bench.ticks(40, DVec3::X);
    let displayed = bench.board(|it| it.currents_ma());
    let exchanged = |bench: &Bench| bench.board(|it| it.exchanged());
    let before = exchanged(&bench);
    for more in [1.5, 1.0, 0.9, 0.6] {
        bench.device().write(more * DVec3::X).unwrap();
    }
    assert_eq!((exchanged(&bench), bench.board(|it| it.currents_ma())), (before, displayed));
    // The board has sent its report; the reply to it is early.
    let mut report = [0; 64];
    bench.board(|it| it.input(&mut report));
    bench.device().write(0.4 * DVec3::X).unwrap();
    assert_eq!(exchanged(&bench), before + 1);
    assert!((bench.applied_force_n() - 0.4 * DVec3::X).length() < ROUNDING_N);
    // Only one for each report.
    bench.board(|it| it.input(&mut report));
    bench.device().write(DVec3::ZERO).unwrap();
    assert_eq!(exchanged(&bench), before + 1);
}

#[test]
fn stop_from_another_thread_zeroes_the_force() {
    let mut bench = Bench::open(at_home(BoardForm::Bytes64).calibrated(), kept());
    bench.ticks(40, DVec3::X);
    let mut stop = bench.device().emergency_stop().unwrap();
    // The board has sent its report and the loop hangs.
    bench.advance_ms(1);
    bench.device().read(Duration::ZERO).unwrap();
    stop.stop().unwrap();
    assert_eq!(bench.applied_force_n(), DVec3::ZERO);
    assert_eq!(bench.board(|it| it.currents_ma()), [0; 3]);
}

#[test]
fn dropping_the_device_zeroes_the_currents() {
    let mut bench = Bench::open(at_home(BoardForm::Bytes14).calibrated(), kept());
    bench.ticks(40, DVec3::X);
    assert!(bench.board(|it| it.currents_ma()) != [0; 3]);
    drop(bench.device.take());
    assert_eq!(bench.board(|it| it.currents_ma()), [0; 3]);
}

/// A board that sends only at every second tick.
struct SlowBoard {
    board: Arc<Mutex<BoardFirmware>>,
    is_awake: bool,
}

impl Firmware for SlowBoard {
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
fn slow_board_gets_one_reply_per_report() {
    let mut bench = Bench::new(at_home(BoardForm::Bytes14).calibrated(), kept());
    let slow = SlowBoard { board: bench.firmware.clone(), is_awake: false };
    bench.bus.plug(bench.board(|it| it.info(PATH)), bench.board(|it| it.descriptor()), slow);
    bench.device().open().unwrap();
    bench.ticks(50, DVec3::X);
    let (exchanged, first) = (bench.board(|it| it.exchanged()), bench.tick(DVec3::X).sequence.unwrap());
    let mut max_ahead = 0;
    for tick in 0..100_u64 {
        let number = bench.tick((1.0 + 0.01 * tick as f64) * DVec3::X).sequence.unwrap();
        max_ahead = max_ahead.max(bench.board(|it| it.exchanged()) - exchanged - (number - first));
    }
    let taken = bench.board(|it| it.exchanged()) - exchanged;
    assert!((45..=55).contains(&taken) && max_ahead <= 1, "{taken} {max_ahead}");
}

/// A board that sends one report per period.
struct PacedBoard {
    board: Arc<Mutex<BoardFirmware>>,
    ms: Arc<AtomicU64>,
    period_ms: u64,
    next_ms: u64,
}

impl Firmware for PacedBoard {
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

/// A calibrated board with one report per `period_ms`, opened and synchronised.
fn open_at_pace(period_ms: u64) -> Bench {
    let mut bench = Bench::new(at_home(BoardForm::Bytes14).calibrated(), kept());
    let paced = PacedBoard { board: bench.firmware.clone(), ms: bench.ms.clone(), period_ms, next_ms: 0 };
    bench.bus.plug(bench.board(|it| it.info(PATH)), bench.board(|it| it.descriptor()), paced);
    bench.device().open().unwrap();
    // Reading fails before the first report.
    for _ in 0..8 {
        bench.advance_ms(1);
        let _ = bench.device().read(Duration::ZERO);
        let _ = bench.device().write(DVec3::ZERO);
    }
    bench
}

#[test]
fn early_forces_do_not_queue_up_at_a_slow_board() {
    let mut bench = open_at_pace(4);
    bench.ticks(200, DVec3::X);
    let (mut max_queued, mut displayed) = (0, 0);
    for _ in 0..50 {
        // Less than half, which is sent early; then the whole force, which waits for a report.
        for force_n in [0.4 * DVec3::X, DVec3::X] {
            for _ in 0..12 {
                bench.tick(force_n);
                max_queued = max_queued.max(bench.board(|it| it.waiting()));
            }
            displayed += u32::from((bench.applied_force_n() - force_n).length() < ROUNDING_N);
        }
    }
    assert!(
        max_queued == 1 && displayed == 100,
        "{max_queued} reports in the board's queue, {displayed} forces displayed"
    );
    assert_eq!(bench.board(|it| it.waiting()), 0);
}

/// At any time of the stop, each later report gets one reply, with the force of its own tick. The bus delivers one report per ms.
#[test]
fn stop_from_another_thread_does_not_delay_later_forces() {
    for (stops, is_read) in [(1, true), (1, false), (3, true), (3, false)] {
        let mut bench = open_at_pace(1);
        bench.ticks(50, DVec3::X);
        assert!((bench.applied_force_n() - DVec3::X).length() < ROUNDING_N, "{}", bench.applied_force_n());
        let mut stop = bench.device().emergency_stop().unwrap();
        bench.advance_ms(1);
        if is_read {
            // The board has sent its report and the loop hangs before the reply.
            bench.device().read(Duration::ZERO).unwrap();
        }
        (0..stops).for_each(|_| stop.stop().unwrap());
        bench.device().write(DVec3::X).unwrap();
        // The early reports are processed and the force grows from zero.
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
fn lost_report_does_not_block_the_exchange() {
    let mut bench = Bench::open(at_home(BoardForm::Bytes14).calibrated(), kept());
    bench.ticks(40, DVec3::X);
    assert!(bench.board(|it| it.input(&mut [0; 64])) > 0);
    for _ in 0..25 {
        bench.advance_ms(1);
        let _ = bench.device().read(Duration::ZERO);
        let _ = bench.device().write(DVec3::X);
    }
    bench.ticks(10, DVec3::X);
    assert!((bench.applied_force_n() - DVec3::X).length() < ROUNDING_N, "{}", bench.applied_force_n());
    assert_eq!(bench.board(|it| it.waiting()), 0);
}

/// A bus that delivers one report at a time, at every second poll.
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
fn opened_board_has_an_empty_queue_in_either_phase() {
    for form in BoardForm::ALL {
        for is_receiving in [false, true] {
            let mut bench = Bench::new(at_home(form), homed());
            if is_receiving {
                assert!(bench.board(|it| it.input(&mut [0; 64])) > 0);
            }
            let one = OneByOne { board: bench.firmware.clone(), comes_next: false };
            bench.bus.plug(bench.board(|it| it.info(PATH)), bench.board(|it| it.descriptor()), one);
            bench.device().open().unwrap();
            bench.ticks(3, DVec3::ZERO);
            assert_eq!(bench.board(|it| it.waiting()), 0, "{form:?} {is_receiving}");
            bench.ticks(40, DVec3::X);
            assert!((bench.applied_force_n() - DVec3::X).length() < ROUNDING_N, "{form:?} {is_receiving}");
        }
    }
}

/// A board that sends arbitrary reports.
struct ArbitraryReports(Vec<Vec<u8>>);

impl Firmware for ArbitraryReports {
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
    fn arbitrary_reports_give_finite_positions_and_no_panic(
        reports in collection::vec(prop_oneof![collection::vec(any::<u8>(), 14), collection::vec(any::<u8>(), 1..80)], 0..40),
    ) {
        let mut bench = Bench::new(at_home(BoardForm::Bytes14), homed());
        bench.bus.plug(bench.board(|it| it.info(PATH)), bench.board(|it| it.descriptor()), ArbitraryReports(reports));
        bench.device().open().unwrap();
        for _ in 0..30 {
            bench.advance_ms(1);
            if let Ok(reading) = bench.device().read(Duration::ZERO) {
                prop_assert!(reading.is_usable());
            }
            let _ = bench.device().write(DVec3::ONE);
        }
    }
}

#[test]
fn read_and_write_do_not_allocate() {
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
            // Silence and wake-up.
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
