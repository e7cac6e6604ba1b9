//! Devices that only their vendor's library can drive: another process, the *peer*, holds that library, and speaks with palpate
//! over UDP on the loopback address. Samples come in, forces go out.
//!
//! [`BridgeDevice`] is palpate's end, a [`crate::HapticDevice`] like any other. [`BridgePeer`] is the other end in Rust: it makes
//! any [`crate::HapticDevice`] available to another process, and is what the tests speak with. `docs/bridge.md` has every byte
//! of the [`packet`]s and a peer in C++, to be filled with a vendor's calls.
//!
//! ```
//! use glam::DVec3;
//! use palpate_haptics::bridge::{BridgeDevice, BridgePeer, BridgeSettings, PeerSettings};
//! use palpate_haptics::{HapticDevice, Reading, ScriptedDevice};
//! use std::time::Duration;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // The vendor's side: a hand that the force moves, a millimetre for each newton. Port 0 takes any that is free.
//! let hand = ScriptedDevice::new(|_, force_n| Ok(Reading::at(1e-3 * force_n)));
//! let any_port = PeerSettings { address: ([127, 0, 0, 1], 0).into(), ..PeerSettings::default() };
//! let mut peer = BridgePeer::bind(any_port, Box::new(hand))?;
//!
//! // palpate's side. `find` asks what is there, so that the loop knows its limits before it opens it.
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
//! `open` begins a session with a number of its own. It lasts until one end says that it is over, or until one end has heard nothing
//! for too long: then both let go. **A session that is over is never taken up again.** The device is
//! [`crate::DeviceError::Disconnected`] from then on, and the loop opens it anew twice a second, in a new session, with its force
//! beginning anew too. So a force never comes back at once where the hand had been let go, and a peer that was restarted is a
//! device that was unplugged and plugged in.
//!
//! # Who lets go, and when
//!
//! | end | hears nothing | does |
//! | --- | --- | --- |
//! | palpate | no newer sample for [`BridgeSettings::silent_after`] (20 ms) or three periods of the device | tells the peer to stop, takes no force any more |
//! | peer | no newer force for [`PeerSettings::watchdog`] (20 ms) | zero force, tells palpate that the session is over |
//!
//! A packet that is refused is not heard. A peer that was itself not run for so long lets go too, whatever is waiting to be read.
//! A peer whose device fails goes on telling it to show zero force, and closes it if it does not, see [`BridgePeer`].
//!
//! # Addresses
//!
//! Both ends refuse every address but a loopback one, [`BridgeError::NotLoopback`], unless `beyond_loopback` is set. The protocol
//! is neither encrypted nor does it know who speaks: whoever can reach the peer's port can move its motors.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

mod counts;
mod device;
mod guarded;
mod handshake;
mod link;
mod order;
pub mod packet;
mod peer;

pub use counts::{BridgeCounts, BridgeMonitor};
pub use device::BridgeDevice;
pub use peer::BridgePeer;

use crate::error::check;
use crate::{DeviceError, HapticsError};
use packet::PacketError;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::time::Duration;
use thiserror::Error;

/// The port of a peer that says nothing else.
pub const BRIDGE_PORT: u16 = 27_182;

/// Where a peer is, and how long it may be silent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BridgeSettings {
    /// The peer's address and port.
    pub address: SocketAddr,
    /// Whether the address may be another machine's. Set it only in a network of your own, see [`crate::bridge`].
    pub beyond_loopback: bool,
    /// How long [`BridgeDevice::find`] and `open` wait for the peer's answer, 1 ms to 1 min. Who stops a loop that is opening its
    /// device waits for it no longer than 200 ms.
    pub open_within: Duration,
    /// The time without a newer sample after which the session is over, 1 ms to 1 min; at least three periods of the device.
    pub silent_after: Duration,
}

impl Default for BridgeSettings {
    /// A peer on this machine, on [`BRIDGE_PORT`]; 100 ms to open, 20 ms of silence.
    fn default() -> Self {
        Self {
            address: SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), BRIDGE_PORT),
            beyond_loopback: false,
            open_within: Duration::from_millis(100),
            silent_after: Duration::from_millis(20),
        }
    }
}

impl BridgeSettings {
    /// Refuses what is not on this machine unless it may be, and times that make no sense.
    ///
    /// # Errors
    /// [`BridgeError::NotLoopback`], [`BridgeError::Setting`].
    pub fn validate(&self) -> Result<(), BridgeError> {
        check_reach(self.address, self.beyond_loopback)?;
        for (what, time) in [
            ("time to open a bridge, s", self.open_within),
            ("silence after which a bridge is over, s", self.silent_after),
        ] {
            let value = time.as_secs_f64();
            check(what, value, (1e-3..=60.0).contains(&value), "0.001 to 60")?;
        }
        Ok(())
    }
}

/// Where a peer listens, and how long palpate may be silent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PeerSettings {
    /// The address and port to listen on; port 0 takes any that is free, see [`BridgePeer::address`].
    pub address: SocketAddr,
    /// Whether other machines may reach it. Set it only in a network of your own, see [`crate::bridge`].
    pub beyond_loopback: bool,
    /// The time without a newer force after which it lets go, 1 ms to 1 s. It is told to palpate.
    pub watchdog: Duration,
}

impl Default for PeerSettings {
    /// On this machine, on [`BRIDGE_PORT`]; 20 ms.
    fn default() -> Self {
        Self {
            address: SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), BRIDGE_PORT),
            beyond_loopback: false,
            watchdog: Duration::from_millis(20),
        }
    }
}

impl PeerSettings {
    /// Refuses what other machines can reach unless they may, and a watchdog that makes no sense.
    ///
    /// # Errors
    /// [`BridgeError::NotLoopback`], [`BridgeError::Setting`].
    pub fn validate(&self) -> Result<(), BridgeError> {
        check_reach(self.address, self.beyond_loopback)?;
        let value = self.watchdog.as_secs_f64();
        check("watchdog of a bridge's peer, s", value, (1e-3..=1.0).contains(&value), "0.001 to 1")?;
        Ok(())
    }
}

fn check_reach(address: SocketAddr, beyond_loopback: bool) -> Result<(), BridgeError> {
    if beyond_loopback || address.ip().is_loopback() {
        Ok(())
    } else {
        Err(BridgeError::NotLoopback { address })
    }
}

/// Why an end of a bridge cannot be set up.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum BridgeError {
    /// The address can be reached by, or is that of, another machine.
    #[error(
        "{address} is not a loopback address (127.0.0.1, ::1); set `beyond_loopback` if you mean it: whoever reaches the peer can move its motors"
    )]
    NotLoopback {
        /// The address.
        address: SocketAddr,
    },
    /// A time is outside what is allowed, or the device to be served describes itself so that it makes no sense.
    #[error("the bridge cannot be set up")]
    Setting(#[from] HapticsError),
    /// The operating system gave no socket, or did not let it send.
    #[error("no socket for {address}; for a peer, see whether another one has the port")]
    Socket {
        /// The address to bind to or to send to.
        address: SocketAddr,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// Nobody answered.
    #[error("no answer from {address} within {} ms; start the peer, and check its port", .waited.as_millis())]
    NoPeer {
        /// Where it should be.
        address: SocketAddr,
        /// How long was waited.
        waited: Duration,
    },
    /// The peer has a session with somebody else.
    #[error("the peer at {address} serves another program; stop that one first")]
    Busy {
        /// Where it is.
        address: SocketAddr,
    },
    /// The peer speaks another version of the protocol.
    #[error(
        "the peer at {address} speaks version {found} of the bridge's protocol; it must be {}",
        packet::VERSION
    )]
    OtherVersion {
        /// Where it is.
        address: SocketAddr,
        /// Its version.
        found: u16,
    },
    /// What answered is not a peer, or one that breaks the protocol.
    #[error("what answers at {address} does not keep to the bridge's protocol")]
    NotAPeer {
        /// Where it is.
        address: SocketAddr,
        /// What is wrong with its answer.
        #[source]
        source: PacketError,
    },
    /// The peer is there, its device is not.
    #[error("the peer at {address} cannot open its device; see what it says")]
    DeviceFailed {
        /// Where it is.
        address: SocketAddr,
    },
    /// The device that a peer is to serve could not be opened.
    #[error("the device to be served could not be opened")]
    Device(#[source] DeviceError),
    /// The device that a peer is to serve is beyond what the protocol can say.
    #[error("the device to be served cannot be described over the bridge")]
    Description(#[source] PacketError),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_machines_are_refused_on_both_ends_unless_they_are_meant() {
        for (address, is_here) in [
            ("127.0.0.1:27182", true),
            ("127.8.9.1:1", true),
            ("[::1]:27182", true),
            ("0.0.0.0:27182", false),
            ("[::]:27182", false),
            ("192.168.0.7:27182", false),
            ("[fe80::1]:27182", false),
        ] {
            let address: SocketAddr = address.parse().unwrap();
            for beyond_loopback in [false, true] {
                let device = BridgeSettings { address, beyond_loopback, ..BridgeSettings::default() };
                let peer = PeerSettings { address, beyond_loopback, ..PeerSettings::default() };
                for result in [device.validate(), peer.validate()] {
                    match result {
                        Ok(()) => assert!(is_here || beyond_loopback, "{address}"),
                        Err(BridgeError::NotLoopback { address: named }) => {
                            assert!(!is_here && !beyond_loopback && named == address);
                        }
                        Err(error) => panic!("{error}"),
                    }
                }
            }
        }
    }

    #[test]
    fn times_that_make_no_sense_are_refused() {
        let good = BridgeSettings::default();
        good.validate().unwrap();
        for time in [Duration::ZERO, Duration::from_micros(999), Duration::from_secs(61)] {
            for bad in
                [BridgeSettings { open_within: time, ..good }, BridgeSettings { silent_after: time, ..good }]
            {
                assert!(matches!(bad.validate(), Err(BridgeError::Setting(_))));
            }
        }
        for watchdog in [Duration::ZERO, Duration::from_millis(1001)] {
            let bad = PeerSettings { watchdog, ..PeerSettings::default() };
            assert!(matches!(bad.validate(), Err(BridgeError::Setting(_))));
        }
    }
}
