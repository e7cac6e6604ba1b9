//! Settings of both ends of a bridge.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use super::BridgeError;
use crate::error::check;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::time::Duration;

/// Default port of a peer.
pub const BRIDGE_PORT: u16 = 27_182;

/// Settings of a [`super::BridgeDevice`]: the peer's address and timeouts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BridgeSettings {
    /// Address and port of the peer.
    pub address: SocketAddr,
    /// Whether the address may belong to another machine. Set it only in a private network, see [`crate::bridge`].
    pub beyond_loopback: bool,
    /// Time for which [`super::BridgeDevice::find`] and `open` wait for the peer's reply, 1 ms to 1 min. Stopping a loop that is opening
    /// its device waits at most 200 ms.
    pub open_within: Duration,
    /// Time without a newer sample after which the session ends, 1 ms to 1 min; at least three periods of the device.
    pub silent_after: Duration,
}

impl Default for BridgeSettings {
    /// A peer on this machine at [`BRIDGE_PORT`]; 100 ms to open, 20 ms timeout.
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
    /// Rejects an address beyond loopback unless `beyond_loopback` is set, and times out of range.
    ///
    /// # Errors
    /// [`BridgeError::NotLoopback`], [`BridgeError::Setting`].
    pub fn validate(&self) -> Result<(), BridgeError> {
        check_reach(self.address, self.beyond_loopback)?;
        for (what, time) in [
            ("time to open a bridge (open_within), s", self.open_within),
            ("timeout of a bridge (silent_after), s", self.silent_after),
        ] {
            let value = time.as_secs_f64();
            check(what, value, (1e-3..=60.0).contains(&value), "0.001 to 60")?;
        }
        Ok(())
    }
}

/// Settings of a [`super::BridgePeer`]: its address and watchdog.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PeerSettings {
    /// Address and port to listen on; port 0 selects a free port, see [`super::BridgePeer::address`].
    pub address: SocketAddr,
    /// Whether other machines may reach the peer. Set it only in a private network, see [`crate::bridge`].
    pub beyond_loopback: bool,
    /// Time without a newer force after which the peer sets zero force and ends the session, 1 ms to 1 s. The description sent to
    /// palpate includes it.
    pub watchdog: Duration,
}

impl Default for PeerSettings {
    /// This machine, [`BRIDGE_PORT`], 20 ms.
    fn default() -> Self {
        Self {
            address: SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), BRIDGE_PORT),
            beyond_loopback: false,
            watchdog: Duration::from_millis(20),
        }
    }
}

impl PeerSettings {
    /// Rejects an address beyond loopback unless `beyond_loopback` is set, and a watchdog out of range.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ends_reject_addresses_beyond_loopback_unless_enabled() {
        for (address, is_loopback) in [
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
                        Ok(()) => assert!(is_loopback || beyond_loopback, "{address}"),
                        Err(BridgeError::NotLoopback { address: named }) => {
                            assert!(!is_loopback && !beyond_loopback && named == address);
                        }
                        Err(error) => panic!("{error}"),
                    }
                }
            }
        }
    }

    #[test]
    fn rejects_times_out_of_range() {
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
