//! A board that is closed while it does not take every report.

use crate::bench::*;
use glam::DVec3;
use palpate_haptics::*;
use palpate_hid::simulated::*;
use palpate_hid::*;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

/// A board that refuses as many output reports as it is told to.
struct Refusing {
    board: Arc<Mutex<BoardFirmware>>,
    left: Arc<AtomicU64>,
}

impl Firmware for Refusing {
    fn input(&mut self, report: &mut [u8]) -> usize {
        self.board.input(report)
    }
    fn output(&mut self, report: &[u8]) -> bool {
        let refuses = self.left.fetch_update(Ordering::SeqCst, Ordering::SeqCst, |left| left.checked_sub(1));
        refuses.is_err() && self.board.output(report)
    }
}

/// Some of the last reports are lost: zero is sent until it is taken, but not for ever.
#[test]
fn zero_is_sent_again_where_it_was_not_taken() {
    for form in BoardForm::ALL {
        for (refusals, is_zero) in [(0, true), (1, true), (4, true), (100, false)] {
            let mut bench = Bench::new(at_home(form), homed());
            let left = Arc::<AtomicU64>::default();
            let refusing = Refusing { board: Arc::clone(&bench.firmware), left: Arc::clone(&left) };
            bench.bus.plug(bench.board(|it| it.info(PATH)), bench.board(|it| it.descriptor()), refusing);
            bench.device().open().unwrap();
            bench.ticks(40, DVec3::X);
            assert!(bench.board(|it| it.currents_ma()) != [0; 3]);
            left.store(refusals, Ordering::SeqCst);
            let closed = bench.device().close();
            assert_eq!(closed.is_ok(), is_zero, "{form:?}, {refusals}: {closed:?}");
            assert_eq!(bench.board(|it| it.currents_ma()) == [0; 3], is_zero, "{form:?}, {refusals}");
        }
    }
}
