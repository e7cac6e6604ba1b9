//! Closing of a board that rejects reports.

use super::bench::*;
use glam::DVec3;
use palpate_haptics::*;
use palpate_hid::simulated::*;
use palpate_hid::*;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

/// A board that rejects a given number of output reports.
struct RejectingBoard {
    board: Arc<Mutex<BoardFirmware>>,
    rejections_left: Arc<AtomicU64>,
}

impl Firmware for RejectingBoard {
    fn input(&mut self, report: &mut [u8]) -> usize {
        self.board.input(report)
    }
    fn output(&mut self, report: &[u8]) -> bool {
        let rejects =
            self.rejections_left.fetch_update(Ordering::SeqCst, Ordering::SeqCst, |rejections_left| {
                rejections_left.checked_sub(1)
            });
        rejects.is_err() && self.board.output(report)
    }
}

/// Some of the last reports are lost; zero is sent a limited number of times until the board accepts it.
#[test]
fn zero_is_sent_again_until_accepted() {
    for form in BoardForm::ALL {
        for (rejections, is_zero) in [(0, true), (1, true), (4, true), (100, false)] {
            let mut bench = Bench::new(at_home(form), homed());
            let rejections_left = Arc::<AtomicU64>::default();
            let rejecting = RejectingBoard {
                board: Arc::clone(&bench.firmware),
                rejections_left: Arc::clone(&rejections_left),
            };
            bench.bus.plug(bench.board(|it| it.info(PATH)), bench.board(|it| it.descriptor()), rejecting);
            bench.device().open().unwrap();
            bench.ticks(40, DVec3::X);
            assert!(bench.board(|it| it.currents_ma()) != [0; 3]);
            rejections_left.store(rejections, Ordering::SeqCst);
            let closed = bench.device().close();
            assert_eq!(closed.is_ok(), is_zero, "{form:?}, {rejections}: {closed:?}");
            assert_eq!(bench.board(|it| it.currents_ma()) == [0; 3], is_zero, "{form:?}, {rejections}");
        }
    }
}
