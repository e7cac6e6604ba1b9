//! Errors of setting up a bridge.

use super::packet::{self, PacketError};
use crate::{DeviceError, HapticsError};
use std::net::SocketAddr;
use std::time::Duration;
use thiserror::Error;

/// Why one end of a bridge could not be set up.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum BridgeError {
    /// The address is not a loopback address.
    #[error(
        "{address} is not a loopback address (127.0.0.1, ::1); set `beyond_loopback` to allow it: any program that reaches the peer \
         can move its motors"
    )]
    NotLoopback {
        /// Rejected address.
        address: SocketAddr,
    },
    /// A time, or a value in the description of the served device, is out of range.
    #[error("the bridge cannot be set up")]
    Setting(#[from] HapticsError),
    /// The operating system could not create the socket or send through it.
    #[error("no socket for {address}; for a peer, check that no other peer uses the port")]
    Socket {
        /// Address to bind to or to send to.
        address: SocketAddr,
        /// Error of the operating system.
        #[source]
        source: std::io::Error,
    },
    /// No peer replied.
    #[error("no reply from {address} within {} ms; start the peer, and check its port", .waited.as_millis())]
    NoPeer {
        /// Expected address of the peer.
        address: SocketAddr,
        /// Time waited for a reply.
        waited: Duration,
    },
    /// The peer has a session with another program.
    #[error("the peer at {address} serves another program; stop that one first")]
    Busy {
        /// Address of the peer.
        address: SocketAddr,
    },
    /// The peer uses another version of the protocol.
    #[error(
        "the peer at {address} uses version {found} of the bridge's protocol; it must be {}",
        packet::VERSION
    )]
    OtherVersion {
        /// Address of the peer.
        address: SocketAddr,
        /// Version of the peer.
        found: u16,
    },
    /// The replies violate the protocol, or their sender is not a peer.
    #[error("the reply from {address} violates the bridge's protocol; check that a peer uses this port")]
    NotAPeer {
        /// Address of the peer.
        address: SocketAddr,
        /// Error in the reply.
        #[source]
        source: PacketError,
    },
    /// The peer runs, but cannot open its device.
    #[error("the peer at {address} cannot open its device; check the peer's output")]
    DeviceFailed {
        /// Address of the peer.
        address: SocketAddr,
    },
    /// The served device could not be opened.
    #[error("the served device could not be opened")]
    Device(#[source] DeviceError),
    /// The description of the served device exceeds the ranges of the protocol.
    #[error("the served device cannot be described over the bridge")]
    Description(#[source] PacketError),
}
