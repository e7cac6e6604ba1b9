//! A SpaceMouse cap that is released while its reports are not read: the queue of the operating system keeps the oldest 63 reports and
//! drops newer ones, among them the zeros of the release.

use glam::DVec3;
use palpate_haptics::HapticDevice;
use palpate_hid::simulated::{Firmware, SimulatedBus};
use palpate_hid::{HidDevice, HidInfo, HidKind, HidOptions, HidSelector, Usage};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// A queue of 63 reports, as hidraw's, and the number of lost ones.
#[derive(Clone, Default)]
struct Queue(Arc<Mutex<(VecDeque<Vec<u8>>, usize)>>);

impl Queue {
    fn send(&self, report: Vec<u8>) {
        let (queue, lost) = &mut *self.0.lock().unwrap();
        if queue.len() < 63 { queue.push_back(report) } else { *lost += 1 }
    }
}

impl Firmware for Queue {
    fn input(&mut self, report: &mut [u8]) -> usize {
        let Some(next) = self.0.lock().unwrap().0.pop_front() else { return 0 };
        report[..next.len()].copy_from_slice(&next);
        next.len()
    }
    fn output(&mut self, _: &[u8]) -> bool {
        true
    }
}

/// Reports of a cap, every `period_ms`.
#[derive(Clone, Copy, Debug)]
enum Cap {
    /// Push and turn in reports 1 and 2.
    Cable { zeros: u32 },
    /// Both in report 1.
    Radio { zeros: u32 },
}

impl Cap {
    fn period_ms(self) -> u64 {
        match self {
            Self::Cable { .. } => 8,
            Self::Radio { .. } => 16,
        }
    }

    /// Fully to the right and turned, or at rest.
    fn send(self, queue: &Queue, is_pushed: bool) {
        let [low, high] = if is_pushed { 350_i16.to_le_bytes() } else { [0, 0] };
        match self {
            Self::Cable { .. } => {
                queue.send(vec![1, low, high, 0, 0, 0, 0]);
                queue.send(vec![2, 0, 0, low, high, 0, 0]);
            }
            Self::Radio { .. } => queue.send(vec![1, low, high, 0, 0, 0, 0, 0, 0, low, high, 0, 0]),
        }
    }
}

/// A cap is pushed from 0 to `released_ms` of a stall of `stall_ms`, after 200 ms in which the loop reads it every `loop_ms`. Returns the
/// motion after the last reading before the stall, m and rad, and the number of lost reports.
fn run(cap: Cap, loop_ms: u64, stall_ms: u64, released_ms: u64) -> (f64, f64, usize) {
    let (bus, queue, time) =
        (Arc::new(SimulatedBus::default()), Queue::default(), Arc::<AtomicU64>::default());
    let info = HidInfo {
        path: "cap".into(),
        vendor: 0x256F,
        product: 0xC635,
        applications: vec![Usage::new(1, 8)],
        ..HidInfo::default()
    };
    bus.plug(info, Vec::new(), queue.clone());
    let now = Arc::clone(&time);
    let selector = HidSelector::first(HidKind::SpaceMouse);
    let device = HidDevice::find(bus, &selector, &HidOptions::default()).unwrap();
    let mut device = device.with_clock(move || Duration::from_millis(now.load(Ordering::Relaxed)));
    device.open().unwrap();
    const BEGIN_MS: u64 = 200;
    let (mut zeros, mut before) = (0, None);
    let mut last = device.read(Duration::ZERO).unwrap();
    for ms in 1..=BEGIN_MS + stall_ms + 1000 {
        time.store(ms, Ordering::Relaxed);
        if ms % cap.period_ms() == 0 {
            let is_pushed = ms <= BEGIN_MS + released_ms;
            let (Cap::Cable { zeros: of_release } | Cap::Radio { zeros: of_release }) = cap;
            if is_pushed || zeros < of_release {
                zeros += u32::from(!is_pushed);
                cap.send(&queue, is_pushed);
            }
        }
        let is_stalled = (BEGIN_MS..BEGIN_MS + stall_ms).contains(&ms);
        if !is_stalled && ms % loop_ms == 0 {
            last = device.read(Duration::ZERO).unwrap();
        } else if is_stalled {
            before.get_or_insert(last);
        }
    }
    let before = before.unwrap();
    let turned_rad = last.orientation.angle_between(before.orientation);
    assert!(last.velocity_m_per_s == Some(DVec3::ZERO), "it still moves");
    (last.position_m.distance(before.position_m), turned_rad, queue.0.lock().unwrap().1)
}

#[test]
fn released_cap_moves_at_most_10_mm_after_any_stall() {
    for cap in
        [Cap::Cable { zeros: 3 }, Cap::Cable { zeros: 0 }, Cap::Radio { zeros: 3 }, Cap::Radio { zeros: 0 }]
    {
        for loop_ms in [1, 2, 8, 33] {
            for stall_ms in [50, 100, 200, 300, 400, 600, 1000, 3000] {
                for percent in [5, 25, 50, 75, 90, 99] {
                    let released_ms = stall_ms * percent / 100;
                    let (moved_m, turned_rad, lost) = run(cap, loop_ms, stall_ms, released_ms);
                    let case = format!(
                        "{cap:?}, read every {loop_ms} ms, stall of {stall_ms}, released at {released_ms} ms, {lost} lost"
                    );
                    // The first step after the stall covers at most 20 ms, in part before the release.
                    let held_s = 1e-3 * released_ms.min(20) as f64;
                    let has_zeros = matches!(cap, Cap::Cable { zeros: 3 } | Cap::Radio { zeros: 3 });
                    let limit_m = 0.010 + if has_zeros { 0.0 } else { 0.1 * held_s };
                    assert!(
                        moved_m <= limit_m + 1e-12 && turned_rad <= 15.0 * limit_m + 1e-9,
                        "{case}: {moved_m} m, {turned_rad} rad"
                    );
                }
            }
        }
    }
}

/// The rows of a report on stalls: what was lost, and the motion that remains.
#[test]
fn lost_zeros_are_a_release() {
    let cap = Cap::Cable { zeros: 3 };
    for loop_ms in [1, 33] {
        for (stall_ms, released_ms, lost) in
            [(200, 100, 0), (400, 100, 0), (1000, 100, 0), (400, 350, 31), (1000, 900, 169)]
        {
            let (moved_m, turned_rad, was_lost) = run(cap, loop_ms, stall_ms, released_ms);
            assert!(moved_m == 0.0 && turned_rad < 1e-7, "stall of {stall_ms} ms: {moved_m} m");
            assert!(was_lost.abs_diff(lost) <= 6, "stall of {stall_ms} ms: {was_lost} lost");
        }
    }
}

/// A held cap goes on after a stall, with its next report.
#[test]
fn held_cap_moves_on_after_a_stall() {
    for cap in [Cap::Cable { zeros: 3 }, Cap::Radio { zeros: 3 }] {
        for stall_ms in [50, 200, 400, 1000] {
            // Held for half a second after the stall: 50 mm, less what the stall and its end cost.
            let (moved_m, ..) = run(cap, 1, stall_ms, stall_ms + 500);
            assert!((0.048..=0.053).contains(&moved_m), "{cap:?}, stall of {stall_ms} ms: {moved_m} m");
        }
    }
}
