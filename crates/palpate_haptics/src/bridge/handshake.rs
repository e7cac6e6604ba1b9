//! Handshake of palpate's end: repeated hellos until a welcome arrives.

use super::monitor::{Counters, add_one};
use super::packet::{Body, EndReason, Packet, PacketError, Welcome};
use super::socket::{PacketSocket, Received, SendError, device_error};
use super::{BridgeError, BridgeSettings};
use crate::DeviceError;
use crate::clock::MonotonicClock;
use std::hash::{BuildHasher, RandomState};

/// Time between two hellos, ns. A peer whose last session was not ended is busy until its watchdog expires.
const HELLO_PERIOD_NS: u64 = 10_000_000;
/// Time between two polls of the socket, ns.
const POLL_NS: u64 = 200_000;

/// A random session number, with high probability different from all earlier ones.
fn new_session() -> u64 {
    // The standard library's source of randomness. 0 is not a session.
    RandomState::new().hash_one(0_u8).max(1)
}

/// Replies other than a welcome.
#[derive(Default)]
struct Failures {
    is_busy: bool,
    invalid: Option<PacketError>,
}

/// Purpose of a hello.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Purpose {
    /// Requests the peer's description, in session 0, which is not a session.
    Describe,
    /// Starts a session.
    Start,
}

/// Sends hellos until the peer replies with a welcome; returns the session number and the description.
///
/// If the peer ends the session before its welcome arrives, a new session replaces it: the first welcome may have been lost, and the
/// peer's watchdog may have expired before the next hello. The hello of the new session is sent at once, but at most once in 10 ms, to
/// avoid flooding a peer that ends every session.
pub(super) fn greet(
    socket: &PacketSocket,
    settings: &BridgeSettings,
    purpose: Purpose,
    counters: &Counters,
) -> Result<(u64, Welcome), BridgeError> {
    let BridgeSettings { address, open_within: waited, .. } = *settings;
    let clock = MonotonicClock::start();
    let start_ns = clock.now_ns();
    let end_ns = start_ns.saturating_add(u64::try_from(waited.as_nanos()).unwrap_or(u64::MAX));
    let mut session = if purpose == Purpose::Start { new_session() } else { 0 };
    let (mut failures, mut number, mut next_ns) = (Failures::default(), 0, start_ns);
    let mut renewed_ns: Option<u64> = None;
    loop {
        let now_ns = clock.now_ns();
        if now_ns >= end_ns {
            break;
        }
        if now_ns >= next_ns {
            (number, next_ns) = (number + 1, now_ns.saturating_add(HELLO_PERIOD_NS));
            let sent = socket.send(&Packet { session, number, body: Body::Hello }, address);
            if let Err(SendError::Os(source)) = sent {
                return Err(BridgeError::Socket { address, source });
            }
        }
        match socket.receive().map_err(|source| BridgeError::Socket { address, source })? {
            Received::Nothing => clock.sleep_until(end_ns.min(now_ns.saturating_add(POLL_NS))),
            Received::Undelivered => {}
            Received::Unreadable => add_one(&counters.corrupt),
            Received::Datagram { from, .. } if from != address => add_one(&counters.foreign),
            Received::Datagram { packet: Err(PacketError::Version(found)), .. } => {
                return Err(BridgeError::OtherVersion { address, found });
            }
            Received::Datagram { packet: Err(error), .. } => {
                add_one(&counters.corrupt);
                failures.invalid = Some(error);
            }
            Received::Datagram { packet: Ok(packet), .. } if packet.session != session => {
                add_one(&counters.other_session);
            }
            Received::Datagram { packet: Ok(packet), .. } => match packet.body {
                Body::Welcome(welcome) => return Ok((session, welcome)),
                Body::End(EndReason::NoSession | EndReason::Silent | EndReason::Closing) if session != 0 => {
                    session = new_session();
                    if renewed_ns.is_none_or(|at_ns| now_ns >= at_ns.saturating_add(HELLO_PERIOD_NS)) {
                        (renewed_ns, next_ns) = (Some(now_ns), now_ns);
                    }
                }
                Body::End(EndReason::Busy) => failures.is_busy = true,
                Body::End(EndReason::DeviceFailed) => return Err(BridgeError::DeviceFailed { address }),
                // A sample may overtake its welcome; the others do not affect the handshake.
                _ => {}
            },
        }
    }
    Err(match failures {
        Failures { is_busy: true, .. } => BridgeError::Busy { address },
        Failures { invalid: Some(source), .. } => BridgeError::NotAPeer { address, source },
        Failures { .. } => BridgeError::NoPeer { address, waited },
    })
}

impl BridgeError {
    /// The error of a device that could not be opened.
    pub(super) fn device_error(&self) -> DeviceError {
        match self {
            Self::Busy { .. } => DeviceError::Protocol("the peer serves another program"),
            Self::OtherVersion { .. } => DeviceError::Protocol("the peer uses another version"),
            Self::NotAPeer { .. } => DeviceError::Protocol("the reply is not that of a peer"),
            Self::Socket { source, .. } => device_error(source),
            _ => DeviceError::Disconnected,
        }
    }
}
