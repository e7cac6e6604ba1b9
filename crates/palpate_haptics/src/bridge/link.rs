//! A socket that never waits.

use super::packet::{Header, MAX_SIZE, Packet, PacketError};
use crate::DeviceError;
use std::io::{self, ErrorKind};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};

/// So many packets are looked at in a row at most, so that nobody who sends without end can keep an end from its work. It is more
/// than a socket's usual buffer has room for.
pub(super) const MOST_IN_A_ROW: usize = 512;

/// The socket of one end.
#[derive(Debug)]
pub(super) struct Link(UdpSocket);

/// What has come.
#[derive(Debug)]
pub(super) enum Received {
    /// Nothing more.
    Nothing,
    /// Something that cannot be read.
    Unreadable,
    /// Word that what was sent could not be delivered.
    Undelivered,
    /// A datagram. Of one of another version there is a header and an error.
    Datagram { from: SocketAddr, header: Option<Header>, packet: Result<Packet, PacketError> },
}

/// A datagram that was larger than the room for it, on Windows.
const WSAEMSGSIZE: i32 = 10_040;

impl Link {
    /// One that listens on `address`.
    pub(super) fn bind(address: SocketAddr) -> io::Result<Self> {
        let socket = UdpSocket::bind(address)?;
        socket.set_nonblocking(true)?;
        Ok(Self(socket))
    }

    /// One that speaks with `peer`, on a port of its own; with a peer on a loopback address it cannot be reached from elsewhere.
    pub(super) fn towards(peer: SocketAddr) -> io::Result<Self> {
        let here = match (peer.ip(), peer.ip().is_loopback()) {
            (IpAddr::V4(_), true) => IpAddr::V4(Ipv4Addr::LOCALHOST),
            (IpAddr::V4(_), false) => IpAddr::V4(Ipv4Addr::UNSPECIFIED),
            (IpAddr::V6(_), true) => IpAddr::V6(Ipv6Addr::LOCALHOST),
            (IpAddr::V6(_), false) => IpAddr::V6(Ipv6Addr::UNSPECIFIED),
        };
        Self::bind(SocketAddr::new(here, 0))
    }

    /// Another handle of the same socket.
    pub(super) fn try_clone(&self) -> io::Result<Self> {
        self.0.try_clone().map(Self)
    }

    pub(super) fn address(&self) -> io::Result<SocketAddr> {
        self.0.local_addr()
    }

    /// The oldest datagram that has not been received yet, without waiting.
    pub(super) fn receive(&self) -> io::Result<Received> {
        // One byte more than the largest packet: what is longer still is cut, and has no packet's length either.
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

    /// Sends `packet` without waiting.
    pub(super) fn send(&self, packet: &Packet, to: SocketAddr) -> Result<(), SendError> {
        let mut buffer = [0; MAX_SIZE];
        let bytes = packet.encode(&mut buffer).map_err(|_| SendError::Packet)?;
        self.0.send_to(bytes, to).map(|_| ()).map_err(SendError::Os)
    }
}

/// Why a packet was not sent.
#[derive(Debug)]
pub(super) enum SendError {
    /// No packet can say that.
    Packet,
    /// The operating system refused.
    Os(io::Error),
}

impl SendError {
    /// What a device says of it.
    pub(super) fn of_device(&self) -> DeviceError {
        match self {
            Self::Packet => DeviceError::Protocol("a force that no packet can carry"),
            Self::Os(error) => of_device(error),
        }
    }
}

/// What a device says of the socket's error.
pub(super) fn of_device(error: &io::Error) -> DeviceError {
    match error.kind() {
        ErrorKind::WouldBlock | ErrorKind::Interrupted | ErrorKind::TimedOut => DeviceError::TimedOut,
        ErrorKind::ConnectionRefused | ErrorKind::ConnectionReset => DeviceError::Disconnected,
        _ => error.raw_os_error().map_or(DeviceError::Disconnected, DeviceError::Os),
    }
}
