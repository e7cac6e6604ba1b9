//! Non-blocking socket for packets.

use super::packet::{Header, MAX_SIZE, Packet, PacketError};
use crate::DeviceError;
use std::io::{self, ErrorKind};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};

/// Maximum number of packets processed in a row: a flood of packets must not block an end. It exceeds the usual capacity of a
/// socket's buffer.
pub(super) const MAX_RECEIVED: usize = 512;

/// The socket of one end of a bridge.
#[derive(Debug)]
pub(super) struct PacketSocket(UdpSocket);

/// Result of receiving.
#[derive(Debug)]
pub(super) enum Received {
    /// No more datagrams.
    Nothing,
    /// A datagram that could not be read.
    Unreadable,
    /// Notice that a sent datagram could not be delivered.
    Undelivered,
    /// A datagram. A packet of another version gives a header and an error.
    Datagram { from: SocketAddr, header: Option<Header>, packet: Result<Packet, PacketError> },
}

/// Windows error number of a datagram larger than the buffer.
const WSAEMSGSIZE: i32 = 10_040;

impl PacketSocket {
    /// Creates a socket that listens on `address`.
    pub(super) fn bind(address: SocketAddr) -> io::Result<Self> {
        let socket = UdpSocket::bind(address)?;
        socket.set_nonblocking(true)?;
        Ok(Self(socket))
    }

    /// Creates a socket for packets to `peer`, on a free port. For a peer on a loopback address, it is not reachable from other machines.
    pub(super) fn to(peer: SocketAddr) -> io::Result<Self> {
        let local = match (peer.ip(), peer.ip().is_loopback()) {
            (IpAddr::V4(_), true) => IpAddr::V4(Ipv4Addr::LOCALHOST),
            (IpAddr::V4(_), false) => IpAddr::V4(Ipv4Addr::UNSPECIFIED),
            (IpAddr::V6(_), true) => IpAddr::V6(Ipv6Addr::LOCALHOST),
            (IpAddr::V6(_), false) => IpAddr::V6(Ipv6Addr::UNSPECIFIED),
        };
        Self::bind(SocketAddr::new(local, 0))
    }

    /// Another handle to the same socket.
    pub(super) fn try_clone(&self) -> io::Result<Self> {
        self.0.try_clone().map(Self)
    }

    pub(super) fn address(&self) -> io::Result<SocketAddr> {
        self.0.local_addr()
    }

    /// Receives the oldest waiting datagram, without blocking.
    pub(super) fn receive(&self) -> io::Result<Received> {
        // One byte more than the largest packet: longer datagrams are truncated to a length that no packet has.
        let mut bytes = [0; MAX_SIZE + 1];
        match self.0.recv_from(&mut bytes) {
            Ok((length, from)) => {
                let datagram = bytes.get(..length).unwrap_or_default();
                let (header, packet) = (Header::of(datagram), Packet::parse(datagram));
                Ok(Received::Datagram { from, header, packet })
            }
            Err(error) => match error.kind() {
                ErrorKind::WouldBlock | ErrorKind::Interrupted | ErrorKind::TimedOut => Ok(Received::Nothing),
                ErrorKind::ConnectionRefused | ErrorKind::ConnectionReset => Ok(Received::Undelivered),
                _ if cfg!(windows) && error.raw_os_error() == Some(WSAEMSGSIZE) => Ok(Received::Unreadable),
                _ => Err(error),
            },
        }
    }

    /// Sends `packet` without blocking.
    pub(super) fn send(&self, packet: &Packet, to: SocketAddr) -> Result<(), SendError> {
        let mut buffer = [0; MAX_SIZE];
        let bytes = packet.encode(&mut buffer).map_err(|_| SendError::Packet)?;
        self.0.send_to(bytes, to).map(|_| ()).map_err(SendError::Os)
    }
}

/// Why a packet was not sent.
#[derive(Debug)]
pub(super) enum SendError {
    /// The content exceeds the ranges of the protocol.
    Packet,
    /// The operating system returned an error.
    Os(io::Error),
}

impl SendError {
    /// The corresponding error of a device.
    pub(super) fn device_error(&self) -> DeviceError {
        match self {
            Self::Packet => DeviceError::Protocol("a force out of the range of the bridge's protocol"),
            Self::Os(error) => device_error(error),
        }
    }
}

/// The device error that corresponds to an error of the socket.
pub(super) fn device_error(error: &io::Error) -> DeviceError {
    match error.kind() {
        ErrorKind::WouldBlock | ErrorKind::Interrupted | ErrorKind::TimedOut => DeviceError::TimedOut,
        ErrorKind::ConnectionRefused | ErrorKind::ConnectionReset => DeviceError::Disconnected,
        _ => error.raw_os_error().map_or(DeviceError::Disconnected, DeviceError::Os),
    }
}
