//! Whether a board's counters tell where its arm is, and how they come to.

use super::{BoardForm, BoardInput, BoardKinematics};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// How near to home, in counts, the counters are just after they have been set: a body turns little within a few reports.
const NEAR_HOME: i32 = 200;
/// So many reports may come before they are; then they are set once more.
const MAX_REPORTS_UNTIL_SET: u8 = 10;

/// What is believed of a board's counters when it is opened. They count from where the arm was when the board got its power.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum BoardHoming {
    /// Nothing: there is no force until somebody has put the arm to its home and said so, with the board's own button or by
    /// [`BoardCalibration::request`]. Forces are taken meanwhile, and not shown.
    #[default]
    Awaited,
    /// The arm is at home when the board is first opened. Whenever it is opened again, as after it was unplugged, it is as with
    /// `Awaited`: nobody has put it home since.
    AtOpen,
    /// They have been set before and the board has had power since. If that is wrong, forces go astray: a board that gets its
    /// power over USB counts anew when it has been unplugged. So it is believed only until the link to the board is lost: once the
    /// board was gone, or has failed and is opened again, it is as with `Awaited`, also for a board with a power supply of its own,
    /// until it has been calibrated anew. What happens to a board while no program has it open and it comes back where it was
    /// cannot be seen. Not for boards with reports of 8 bytes, whose counters cannot be set.
    Kept,
}

/// A way to have a board calibrated, from any thread, while the loop has the device.
///
/// 1. Somebody puts the arm to its home and holds it there: for a WoodenHaptics link B up, link C to the front; for a Polhem folded, as
///    [`BoardKinematics::polhem_v3`] has it.
/// 2. [`BoardCalibration::request`]; or that person pushes the board's button. From the next report on there is no force.
/// 3. The board is told what its counters are at home. With reports of 8 bytes the driver keeps the difference itself.
/// 4. The counters come back as they should, [`BoardCalibration::is_done`] says so, and force begins from nothing.
///
/// The position jumps meanwhile, which the loop takes for a hand that has come elsewhere.
///
/// A request holds for the opening in which it is made: what was asked for before a board is opened, or opened again after it was
/// unplugged, is forgotten, as nobody knows where the arm has gone since.
#[derive(Clone, Debug, Default)]
pub struct BoardCalibration(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    is_requested: AtomicBool,
    is_done: AtomicBool,
}

impl BoardCalibration {
    /// The arm is at home now: the board is calibrated there at its next report. Forgotten where the board is not open.
    pub fn request(&self) {
        self.0.is_done.store(false, Ordering::Relaxed);
        self.0.is_requested.store(true, Ordering::Release);
    }

    /// Whether the counters tell where the arm is. Without that there is no force, and positions mean nothing.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.0.is_done.load(Ordering::Acquire)
    }
}

/// The driver's side of it.
#[derive(Debug)]
pub(super) struct Calibrator {
    form: BoardForm,
    shared: BoardCalibration,
    stage: Stage,
    /// What is added to the counters of a board that cannot be told.
    offset: [i16; 3],
    has_been_open: bool,
    /// Whether nothing speaks against counters that are said to be right when it is opened.
    may_be_kept: bool,
    /// Whether it has become done since that was last asked.
    is_newly_done: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// Nobody has said where home is.
    Awaited,
    /// The arm is at home: the board is to be told.
    Asked,
    /// The board has been told, so many reports ago.
    Told(u8),
    Done,
}

impl Calibrator {
    pub(super) fn new(form: BoardForm) -> Self {
        let shared = BoardCalibration::default();
        let stage = Stage::Awaited;
        let (offset, has_been_open) = ([0; 3], false);
        Self { form, shared, stage, offset, has_been_open, may_be_kept: true, is_newly_done: false }
    }

    pub(super) fn handle(&self) -> BoardCalibration {
        self.shared.clone()
    }

    /// The board is about to be opened: what was asked for before says nothing of where its arm is now. What is asked for from here
    /// on belongs to this opening.
    pub(super) fn opening(&mut self) {
        self.shared.0.is_requested.store(false, Ordering::Release);
    }

    /// The board has been opened.
    pub(super) fn opened(&mut self, homing: BoardHoming) {
        let was_open = std::mem::replace(&mut self.has_been_open, true);
        self.enter(match homing {
            BoardHoming::Kept if self.may_be_kept => Stage::Done,
            BoardHoming::AtOpen if !was_open => Stage::Asked,
            BoardHoming::Kept | BoardHoming::AtOpen | BoardHoming::Awaited => Stage::Awaited,
        });
    }

    /// The board is gone, or was: it may have had no power, so that its counters mean nothing.
    pub(super) fn lost(&mut self) {
        self.doubt();
        self.enter(Stage::Awaited);
    }

    /// The board has failed: it goes on if it can, but when it is opened again nothing is known of its counters.
    pub(super) fn doubt(&mut self) {
        self.may_be_kept = false;
    }

    fn enter(&mut self, stage: Stage) {
        self.stage = stage;
        match stage {
            Stage::Done => (self.may_be_kept, self.is_newly_done) = (true, true),
            Stage::Asked | Stage::Told(_) => self.may_be_kept = false,
            Stage::Awaited => {}
        }
        self.shared.0.is_done.store(stage == Stage::Done, Ordering::Release);
    }

    /// Takes a report, and gives counters that count as the body turns.
    pub(super) fn take(&mut self, kinematics: &BoardKinematics, input: &BoardInput) -> [i16; 3] {
        if self.shared.0.is_requested.swap(false, Ordering::AcqRel) {
            self.enter(Stage::Asked);
        }
        if !self.form.has_commands() {
            return self.take_without_commands(kinematics, input);
        }
        let [a, b, c, ..] = input.encoders;
        let counters = [a, b, c];
        match self.stage {
            Stage::Told(reports) => {
                if !input.requests_calibration && is_near_home(kinematics, counters) {
                    self.enter(Stage::Done);
                } else {
                    self.enter(if reports < MAX_REPORTS_UNTIL_SET {
                        Stage::Told(reports + 1)
                    } else {
                        Stage::Asked
                    });
                }
            }
            _ if input.requests_calibration => self.enter(Stage::Asked),
            Stage::Awaited | Stage::Asked | Stage::Done => {}
        }
        counters
    }

    /// Such a board counts the other way round: home − (n − n_home).
    fn take_without_commands(&mut self, kinematics: &BoardKinematics, input: &BoardInput) -> [i16; 3] {
        let ([a, b, c, ..], [h, i, j, ..]) = (input.encoders, kinematics.home_counts);
        if self.stage == Stage::Asked {
            self.offset = [h.wrapping_add(a), i.wrapping_add(b), j.wrapping_add(c)];
            self.enter(Stage::Done);
        }
        let [p, q, r] = self.offset;
        [p.wrapping_sub(a), q.wrapping_sub(b), r.wrapping_sub(c)]
    }

    /// Whether the board is to be told where home is.
    pub(super) fn is_asked(&self) -> bool {
        self.stage == Stage::Asked && self.form.has_commands()
    }

    /// Whether the board is to be told, or has been and has not come back with the right counters yet.
    pub(super) fn is_in_progress(&self) -> bool {
        matches!(self.stage, Stage::Asked | Stage::Told(_))
    }

    /// The board has been told.
    pub(super) fn told(&mut self) {
        self.enter(Stage::Told(0));
    }

    pub(super) fn is_done(&self) -> bool {
        self.stage == Stage::Done
    }

    /// Whether force has to begin from nothing: the counters are not right, or have only been since this was last asked. A board
    /// of 8 bytes that is calibrated in use is done before and after a report, and its arm elsewhere.
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
    fn it_is_done_when_the_counters_are_near_home_and_the_board_asks_no_more() {
        let arm = BoardKinematics::default();
        let mut calibrator = Calibrator::new(BoardForm::Bytes14);
        calibrator.opened(BoardHoming::AtOpen);
        calibrator.take(&arm, &report(0, false));
        assert!(calibrator.is_asked() && !calibrator.is_done());
        calibrator.told();
        // Reports that were on their way.
        for old in [report(0, false), report(5990, true), report(5700, false)] {
            calibrator.take(&arm, &old);
            assert!(!calibrator.is_done() && !calibrator.is_asked() && calibrator.is_in_progress());
        }
        calibrator.take(&arm, &report(5990, false));
        assert!(calibrator.is_done() && calibrator.handle().is_done() && !calibrator.is_in_progress());
    }

    #[test]
    fn a_board_that_has_not_done_it_is_told_again() {
        let arm = BoardKinematics::default();
        let mut calibrator = Calibrator::new(BoardForm::Bytes14);
        calibrator.opened(BoardHoming::Awaited);
        calibrator.handle().request();
        calibrator.take(&arm, &report(0, false));
        calibrator.told();
        for _ in 0..=MAX_REPORTS_UNTIL_SET {
            assert!(!calibrator.is_asked());
            calibrator.take(&arm, &report(0, false));
        }
        assert!(calibrator.is_asked());
    }

    #[test]
    fn a_request_from_before_an_opening_is_forgotten_and_one_from_within_it_is_not() {
        let arm = BoardKinematics::default();
        for form in BoardForm::ALL {
            let mut calibrator = Calibrator::new(form);
            calibrator.handle().request();
            calibrator.opening();
            calibrator.opened(BoardHoming::Awaited);
            calibrator.take(&arm, &report(0, false));
            assert!(!calibrator.is_in_progress() && !calibrator.is_done(), "{form:?}");
            calibrator.opening();
            calibrator.handle().request();
            calibrator.opened(BoardHoming::Awaited);
            calibrator.take(&arm, &report(0, false));
            assert!(calibrator.is_in_progress() || calibrator.is_done(), "{form:?}");
        }
    }

    #[test]
    fn counters_are_kept_until_the_board_was_lost_and_again_once_it_is_calibrated() {
        let arm = BoardKinematics::default();
        let losses: [fn(&mut Calibrator); 2] = [Calibrator::lost, Calibrator::doubt];
        for lose in losses {
            let mut calibrator = Calibrator::new(BoardForm::Bytes14);
            for _ in 0..2 {
                calibrator.opened(BoardHoming::Kept);
                assert!(calibrator.is_done());
            }
            lose(&mut calibrator);
            calibrator.opened(BoardHoming::Kept);
            assert!(!calibrator.is_done() && !calibrator.handle().is_done());
            calibrator.handle().request();
            calibrator.take(&arm, &report(0, false));
            calibrator.told();
            // Not yet: it may have gone between.
            calibrator.opened(BoardHoming::Kept);
            assert!(!calibrator.is_done());
            calibrator.handle().request();
            calibrator.take(&arm, &report(0, false));
            calibrator.told();
            calibrator.take(&arm, &report(6000, false));
            calibrator.opened(BoardHoming::Kept);
            assert!(calibrator.is_done());
        }
    }

    #[test]
    fn a_board_of_8_bytes_counts_the_other_way_round_also_where_it_wraps() {
        let arm = BoardKinematics::default();
        let mut calibrator = Calibrator::new(BoardForm::Bytes8);
        calibrator.opened(BoardHoming::AtOpen);
        assert_eq!(calibrator.take(&arm, &report(i16::MIN, false)), [0, 0, 6000]);
        assert!(calibrator.is_done() && !calibrator.is_asked());
        // One count back for the board, across the end of its numbers, is one on for the body.
        assert_eq!(calibrator.take(&arm, &report(i16::MAX, false)), [0, 0, 6001]);
    }
}
