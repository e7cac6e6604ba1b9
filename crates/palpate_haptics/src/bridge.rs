//! Devices that only a vendor's library can drive. Another process, the *peer*, uses that library and exchanges UDP packets with
//! palpate over the loopback address: samples to palpate, forces to the peer.
//!
//! [`BridgeDevice`] is palpate's end, a [`crate::HapticDevice`] like any other. [`BridgePeer`] is the other end in Rust: it serves any
//! [`crate::HapticDevice`] to another process, and is the peer of the tests. `docs/bridge.md` documents every byte of the [`packet`]s
//! and contains a peer in C++, to be completed with a vendor's calls.
//!
//! ```
//! use glam::DVec3;
//! use palpate_haptics::bridge::{BridgeDevice, BridgePeer, BridgeSettings, PeerSettings};
//! use palpate_haptics::{HapticDevice, Reading, ScriptedDevice};
//! use std::time::Duration;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // The vendor's side: a hand that the force moves by 1 mm/N. Port 0 selects a free port.
//! let hand = ScriptedDevice::new(|_, force_n| Ok(Reading::at(1e-3 * force_n)));
//! let any_port = PeerSettings { address: ([127, 0, 0, 1], 0).into(), ..PeerSettings::default() };
//! let mut peer = BridgePeer::bind(any_port, Box::new(hand))?;
//!
//! // palpate's side. `find` requests the description, which the loop needs for its limits before it opens the device.
//! let settings = BridgeSettings { address: peer.address(), ..BridgeSettings::default() };
//! # let settings = BridgeSettings { open_within: Duration::from_secs(10), silent_after: Duration::from_secs(10), ..settings };
//! let stop = std::sync::atomic::AtomicBool::new(false);
//! std::thread::scope(|scope| {
//!     let served = scope.spawn(|| peer.run(&stop));
//!     let device = BridgeDevice::find(settings);
//!     stop.store(true, std::sync::atomic::Ordering::Release);
//!     assert_eq!(device?.describe().name, "scripted hand");
//!     let _ = served.join();
//!     Ok(())
//! })
//! # }
//! ```
//!
//! # Sessions
//!
//! `open` starts a session with a random number. The session ends when one end declares it over, or when one end receives nothing for
//! longer than its timeout; then both ends set zero force. **A session that has ended is never resumed.** From then on the device
//! returns [`crate::DeviceError::Disconnected`], and the loop opens it again, twice a second, in a new session and with the start stage
//! of the safety chain armed. Force therefore never returns at once after it was dropped, and a restarted peer is equivalent to a
//! device that was unplugged and plugged in.
//!
//! # Timeouts
//!
//! | end | timeout | action |
//! | --- | --- | --- |
//! | palpate | no newer sample for [`BridgeSettings::silent_after`] (20 ms) or three periods | sends a stop, rejects forces |
//! | peer | no newer force for [`PeerSettings::watchdog`] (20 ms) | sets zero force, reports the end to palpate |
//!
//! Rejected packets do not count. A peer that was not scheduled for that time also ends the session, before it reads waiting packets.
//! If the peer's device fails, the peer keeps writing zero force, and closes the device if that fails too ([`BridgePeer`]).
//!
//! # Addresses
//!
//! Both ends reject addresses other than loopback ones ([`BridgeError::NotLoopback`]) unless `beyond_loopback` is set. The protocol has
//! neither encryption nor authentication: any program that reaches the peer's port can move its motors.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

mod device;
mod error;
mod force_limit;
mod guarded_device;
mod handshake;
mod monitor;
pub mod packet;
mod packet_order;
mod peer;
mod settings;
mod socket;

pub use device::BridgeDevice;
pub use error::BridgeError;
pub use monitor::{BridgeCounts, BridgeMonitor};
pub use peer::BridgePeer;
pub use settings::{BRIDGE_PORT, BridgeSettings, PeerSettings};
