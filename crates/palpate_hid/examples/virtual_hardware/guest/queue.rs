//! Unread reports: hidraw keeps the oldest 63; the driver reads all of them at its next tick and uses the latest.

use super::check::{Outcome, ensure};
use super::space_mouse;
use super::virtual_device::Pace;
use palpate_haptics::HapticDevice;
use palpate_hid::simulated::SpaceMouseLayout;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Number of reports sent without reading.
const SENT: i16 = 200;
/// Number of reports kept: one place in the ring of `HIDRAW_BUFFER_SIZE` 64 stays free.
const KEPT: i16 = 63;

pub fn run() -> Outcome {
    let (plugged, cap) = space_mouse::plug("queue", SpaceMouseLayout::Combined, Pace::Manual)?;
    let device = space_mouse::find("queue")?;
    let counters = device.counters();
    let ms = Arc::<AtomicU64>::default();
    let of_driver = Arc::clone(&ms);
    let mut device = device.with_clock(move || Duration::from_millis(of_driver.load(Ordering::Relaxed)));
    device.open()?;
    device.read(Duration::ZERO)?;
    // Speed for a deflection, m/s.
    let speed = |count: i16| 0.1 * (f64::from(count) / 350.0 - 0.02) / (1.0 - 0.02);
    let mut read = |expected: i16| -> Outcome {
        ms.fetch_add(1, Ordering::Relaxed);
        let reading = device.read(Duration::ZERO)?;
        let found = reading.velocity_m_per_s.ok_or("the driver gives no velocity")?.x;
        let target = speed(expected);
        ensure((found - target).abs() < 1e-12, || format!("the point moves at {found} m/s, not {target}"))?;
        Ok(String::new())
    };

    for count in 1..=SENT {
        space_mouse::of(&cap, |cap| cap.push([count, 0, 0], [0; 3]));
        plugged.send_report()?;
    }
    read(KEPT)?;
    let counted = (counters.read(), counters.skipped(), counters.malformed());
    ensure(counted == (KEPT as u64, KEPT as u64 - 1, 0), || {
        format!("read, skipped and malformed are {counted:?}")
    })?;
    // The queue is empty: the next report is the latest.
    space_mouse::of(&cap, |cap| cap.push([300, 0, 0], [0; 3]));
    plugged.send_report()?;
    read(300)?;
    let counted = (counters.read(), counters.skipped());
    ensure(counted == (KEPT as u64 + 1, KEPT as u64 - 1), || format!("then they are {counted:?}"))?;
    // A stall of 400 ms, in which the cap is released and the report of it is lost.
    let before_m = device.read(Duration::ZERO)?.position_m;
    for count in [300; SENT as usize].into_iter().chain([0]) {
        space_mouse::of(&cap, |cap| cap.push([count, 0, 0], [0; 3]));
        plugged.send_report()?;
    }
    ms.fetch_add(400, Ordering::Relaxed);
    let mut moved_m = 0.0;
    for _ in 0..200 {
        moved_m = device.read(Duration::ZERO)?.position_m.distance(before_m);
        ms.fetch_add(1, Ordering::Relaxed);
    }
    ensure(moved_m == 0.0, || format!("after a lost release the point moves by {moved_m} m"))?;
    device.close()?;
    plugged.unplug();
    Ok(format!(
        "of {SENT} reports the oldest {KEPT} were kept, {} were skipped; a lost release moves the point by {moved_m} m",
        KEPT - 1
    ))
}
