//! Calibration of a board's encoder counters.

use super::{BoardForm, BoardInput, BoardKinematics};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Maximum distance of the counters from home just after they were set, counts. A body turns little within a few reports.
const NEAR_HOME: i32 = 200;
/// Maximum number of reports until the counters take the sent values; then the driver sends them again.
const MAX_REPORTS_UNTIL_SET: u8 = 10;

/// Assumption about a board's counters when it is opened. They count from the pose that the arm had at power-on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum BoardHoming {
    /// The counters are invalid until the user has put the arm to its home pose and requested calibration, with the board's button
    /// or by [`BoardCalibration::request`]. Until then forces are accepted and not displayed.
    #[default]
    Awaited,
    /// The arm is at home when the board is first opened. Later openings, as after unplugging, are treated as `Awaited`, because the
    /// arm may have moved.
    AtOpen,
    /// The counters were set before and the board has had power since. Wrong counters make forces wrong.
    ///
    /// The assumption holds until the connection is lost: a board powered over USB restarts its counters when it is unplugged. After a
    /// loss or an error the next opening is treated as `Awaited`, also for a board with its own power supply, until the board has been
    /// calibrated. A loss of power while no program has the board open, with the board back at the same path, is not detected.
    ///
    /// Not available for reports of 8 bytes, whose counters cannot be set.
    Kept,
}

/// Handle to calibrate a board from any thread, while the loop owns the device.
///
/// 1. The user puts the arm to its home pose and holds it there. For a WoodenHaptics link B points up and link C to the front; a
///    Polhem is folded, as [`BoardKinematics::polhem_v3`] describes.
/// 2. The app calls [`BoardCalibration::request`], or the user presses the board's button. The force is zero from the next report.
/// 3. The driver sends the counters of the home pose. With reports of 8 bytes the driver stores the offset instead.
/// 4. Once the counters match, [`BoardCalibration::is_done`] returns `true`, and the force limit rises from zero.
///
/// The position jumps during calibration; the loop treats this as an implausible position jump.
///
/// A request applies to the current opening. Requests made while the board is closed or unplugged are discarded, because the arm may
/// have moved.
#[derive(Clone, Debug, Default)]
pub struct BoardCalibration(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    is_requested: AtomicBool,
    is_done: AtomicBool,
}

impl BoardCalibration {
    /// Requests calibration at the next report, with the arm at home now. Without effect while the board is closed.
    pub fn request(&self) {
        self.0.is_done.store(false, Ordering::Relaxed);
        self.0.is_requested.store(true, Ordering::Release);
    }

    /// Whether the counters are calibrated. Before, the force is zero and positions are invalid.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.0.is_done.load(Ordering::Acquire)
    }
}

/// Calibration state of the driver.
#[derive(Debug)]
pub(super) struct Calibrator {
    form: BoardForm,
    shared: BoardCalibration,
    stage: Stage,
    /// Offset added to the counters of a board whose counters cannot be set.
    offset: [i16; 3],
    has_been_open: bool,
    /// Whether the counters may still be valid when the board is opened with [`BoardHoming::Kept`].
    may_be_kept: bool,
    /// Whether the calibration was completed since the last [`Calibrator::take_force_reset`].
    is_newly_done: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// Not calibrated, and no request.
    Uncalibrated,
    /// The arm is at home; the counters have not been sent yet.
    Requested,
    /// The counters were sent, this many reports ago.
    Sent(u8),
    Calibrated,
}

impl Calibrator {
    pub(super) fn new(form: BoardForm) -> Self {
        let shared = BoardCalibration::default();
        let stage = Stage::Uncalibrated;
        let (offset, has_been_open) = ([0; 3], false);
        Self { form, shared, stage, offset, has_been_open, may_be_kept: true, is_newly_done: false }
    }

    pub(super) fn handle(&self) -> BoardCalibration {
        self.shared.clone()
    }

    /// Discards earlier requests: the arm may have moved since. Requests from here on apply to this opening.
    pub(super) fn before_open(&mut self) {
        self.shared.0.is_requested.store(false, Ordering::Release);
    }

    /// Sets the initial stage of an opened board.
    pub(super) fn after_open(&mut self, homing: BoardHoming) {
        let was_open = std::mem::replace(&mut self.has_been_open, true);
        self.enter(match homing {
            BoardHoming::Kept if self.may_be_kept => Stage::Calibrated,
            BoardHoming::AtOpen if !was_open => Stage::Requested,
            BoardHoming::Kept | BoardHoming::AtOpen | BoardHoming::Awaited => Stage::Uncalibrated,
        });
    }

    /// Notes a lost connection: the board may have lost its power, which makes its counters invalid.
    pub(super) fn connection_lost(&mut self) {
        self.link_failed();
        self.enter(Stage::Uncalibrated);
    }

    /// Notes an error: the board continues if it can, and its counters are invalid at the next opening.
    pub(super) fn link_failed(&mut self) {
        self.may_be_kept = false;
    }

    fn enter(&mut self, stage: Stage) {
        self.stage = stage;
        match stage {
            Stage::Calibrated => (self.may_be_kept, self.is_newly_done) = (true, true),
            Stage::Requested | Stage::Sent(_) => self.may_be_kept = false,
            Stage::Uncalibrated => {}
        }
        self.shared.0.is_done.store(stage == Stage::Calibrated, Ordering::Release);
    }

    /// Processes a report and returns the counters in the direction of the bodies.
    pub(super) fn process(&mut self, kinematics: &BoardKinematics, input: &BoardInput) -> [i16; 3] {
        if self.shared.0.is_requested.swap(false, Ordering::AcqRel) {
            self.enter(Stage::Requested);
        }
        if !self.form.has_commands() {
            return self.process_without_commands(kinematics, input);
        }
        let [a, b, c, ..] = input.encoders;
        let counters = [a, b, c];
        match self.stage {
            Stage::Sent(reports) => {
                if !input.requests_calibration && is_near_home(kinematics, counters) {
                    self.enter(Stage::Calibrated);
                } else {
                    self.enter(if reports < MAX_REPORTS_UNTIL_SET {
                        Stage::Sent(reports + 1)
                    } else {
                        Stage::Requested
                    });
                }
            }
            _ if input.requests_calibration => self.enter(Stage::Requested),
            Stage::Uncalibrated | Stage::Requested | Stage::Calibrated => {}
        }
        counters
    }

    /// As [`Calibrator::process`] for reports of 8 bytes. The counters run in the opposite direction: home − (n − n_home).
    fn process_without_commands(&mut self, kinematics: &BoardKinematics, input: &BoardInput) -> [i16; 3] {
        let ([a, b, c, ..], [h, i, j, ..]) = (input.encoders, kinematics.home_counts);
        if self.stage == Stage::Requested {
            self.offset = [h.wrapping_add(a), i.wrapping_add(b), j.wrapping_add(c)];
            self.enter(Stage::Calibrated);
        }
        let [p, q, r] = self.offset;
        [p.wrapping_sub(a), q.wrapping_sub(b), r.wrapping_sub(c)]
    }

    /// Whether the counters of the home pose have to be sent.
    pub(super) fn must_send_counters(&self) -> bool {
        self.stage == Stage::Requested && self.form.has_commands()
    }

    /// Whether the counters have to be sent, or were sent and are not in effect yet.
    pub(super) fn is_in_progress(&self) -> bool {
        matches!(self.stage, Stage::Requested | Stage::Sent(_))
    }

    /// Notes that the counters were sent.
    pub(super) fn counters_sent(&mut self) {
        self.enter(Stage::Sent(0));
    }

    pub(super) fn is_done(&self) -> bool {
        self.stage == Stage::Calibrated
    }

    /// Whether the force limit has to restart from zero: the counters are invalid, or became valid since the last call. A calibration
    /// in use with reports of 8 bytes is complete after one report, with the arm at a different position.
    pub(super) fn take_force_reset(&mut self) -> bool {
        let is_newly_done = std::mem::take(&mut self.is_newly_done);
        is_newly_done || !self.is_done()
    }
}

fn is_near_home(kinematics: &BoardKinematics, counters: [i16; 3]) -> bool {
    let ([a, b, c], [h, i, j, ..]) = (kinematics.counts(counters), kinematics.home_counts);
    [(a, h), (b, i), (c, j)].iter().all(|&(count, home)| (count - i32::from(home)).abs() <= NEAR_HOME)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(c: i16, requests_calibration: bool) -> BoardInput {
        BoardInput { encoders: [0, 0, c, 0, 0, 0], requests_calibration, ..BoardInput::default() }
    }

    #[test]
    fn calibration_completes_near_home_without_a_board_request() {
        let arm = BoardKinematics::default();
        let mut calibrator = Calibrator::new(BoardForm::Bytes14);
        calibrator.after_open(BoardHoming::AtOpen);
        calibrator.process(&arm, &report(0, false));
        assert!(calibrator.must_send_counters() && !calibrator.is_done());
        calibrator.counters_sent();
        // Reports sent before the counters took effect.
        for old in [report(0, false), report(5990, true), report(5700, false)] {
            calibrator.process(&arm, &old);
            assert!(!calibrator.is_done() && !calibrator.must_send_counters() && calibrator.is_in_progress());
        }
        calibrator.process(&arm, &report(5990, false));
        assert!(calibrator.is_done() && calibrator.handle().is_done() && !calibrator.is_in_progress());
    }

    #[test]
    fn counters_are_sent_again_after_too_many_reports() {
        let arm = BoardKinematics::default();
        let mut calibrator = Calibrator::new(BoardForm::Bytes14);
        calibrator.after_open(BoardHoming::Awaited);
        calibrator.handle().request();
        calibrator.process(&arm, &report(0, false));
        calibrator.counters_sent();
        for _ in 0..=MAX_REPORTS_UNTIL_SET {
            assert!(!calibrator.must_send_counters());
            calibrator.process(&arm, &report(0, false));
        }
        assert!(calibrator.must_send_counters());
    }

    #[test]
    fn requests_before_opening_are_discarded() {
        let arm = BoardKinematics::default();
        for form in BoardForm::ALL {
            let mut calibrator = Calibrator::new(form);
            calibrator.handle().request();
            calibrator.before_open();
            calibrator.after_open(BoardHoming::Awaited);
            calibrator.process(&arm, &report(0, false));
            assert!(!calibrator.is_in_progress() && !calibrator.is_done(), "{form:?}");
            calibrator.before_open();
            calibrator.handle().request();
            calibrator.after_open(BoardHoming::Awaited);
            calibrator.process(&arm, &report(0, false));
            assert!(calibrator.is_in_progress() || calibrator.is_done(), "{form:?}");
        }
    }

    #[test]
    fn kept_counters_are_valid_until_the_link_fails_and_after_calibration() {
        let arm = BoardKinematics::default();
        let failures: [fn(&mut Calibrator); 2] = [Calibrator::connection_lost, Calibrator::link_failed];
        for fail in failures {
            let mut calibrator = Calibrator::new(BoardForm::Bytes14);
            for _ in 0..2 {
                calibrator.after_open(BoardHoming::Kept);
                assert!(calibrator.is_done());
            }
            fail(&mut calibrator);
            calibrator.after_open(BoardHoming::Kept);
            assert!(!calibrator.is_done() && !calibrator.handle().is_done());
            calibrator.handle().request();
            calibrator.process(&arm, &report(0, false));
            calibrator.counters_sent();
            // Not confirmed before the opening: still invalid.
            calibrator.after_open(BoardHoming::Kept);
            assert!(!calibrator.is_done());
            calibrator.handle().request();
            calibrator.process(&arm, &report(0, false));
            calibrator.counters_sent();
            calibrator.process(&arm, &report(6000, false));
            calibrator.after_open(BoardHoming::Kept);
            assert!(calibrator.is_done());
        }
    }

    #[test]
    fn reports_of_8_bytes_count_backwards_across_a_wrap() {
        let arm = BoardKinematics::default();
        let mut calibrator = Calibrator::new(BoardForm::Bytes8);
        calibrator.after_open(BoardHoming::AtOpen);
        assert_eq!(calibrator.process(&arm, &report(i16::MIN, false)), [0, 0, 6000]);
        assert!(calibrator.is_done() && !calibrator.must_send_counters());
        // One count down in the board, across the wrap, is one count up for the body.
        assert_eq!(calibrator.process(&arm, &report(i16::MAX, false)), [0, 0, 6001]);
    }
}
