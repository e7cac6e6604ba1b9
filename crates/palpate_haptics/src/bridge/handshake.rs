//! How palpate's end begins: hello, until there is a welcome.

use super::counts::{Counters, add_one};
use super::link::{Link, Received};
use super::packet::{Body, EndReason, Packet, PacketError, Welcome};
use super::{BridgeError, BridgeSettings};
use crate::DeviceError;
use crate::clock::MonotonicClock;
use std::hash::{BuildHasher, RandomState};

/// Time between two hellos, ns. A peer whose last session was never ended is busy for the length of its watchdog.
const AGAIN_NS: u64 = 10_000_000;
/// Time between two looks at the socket, ns.
const LOOK_NS: u64 = 200_000;

/// A number for a session that no session before it had, in all likelihood.
fn new_session() -> u64 {
    // The standard library's source of randomness. 0 is no session.
    RandomState::new().hash_one(0_u8).max(1)
}

/// What has been learned while the peer did not welcome us.
#[derive(Default)]
struct Heard {
    is_busy: bool,
    nonsense: Option<PacketError>,
}

/// What a hello is said for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Purpose {
    /// To learn what the peer is, in session 0, which is none.
    Ask,
    /// To begin a session.
    Begin,
}

/// Says hello until the peer welcomes us: in which session that is, and what it says of itself.
///
/// A session that the peer says is over before it has welcomed us is given up for a new one: its first welcome may have been lost, and
/// its watchdog have run out before we asked again. The hello of the new one goes at once, but no more than one hello in 10 ms is owed
/// to that, so that a peer that knows no better is not flooded.
pub(super) fn greet(
    link: &Link,
    settings: &BridgeSettings,
    purpose: Purpose,
    counters: &Counters,
) -> Result<(u64, Welcome), BridgeError> {
    let BridgeSettings { address, open_within: waited, .. } = *settings;
    let clock = MonotonicClock::start();
    let begun_ns = clock.now_ns();
    let end_ns = begun_ns.saturating_add(u64::try_from(waited.as_nanos()).unwrap_or(u64::MAX));
    let mut session = if purpose == Purpose::Begin { new_session() } else { 0 };
    let (mut heard, mut number, mut next_ns) = (Heard::default(), 0, begun_ns);
    let mut renewed_ns: Option<u64> = None;
    loop {
        let now_ns = clock.now_ns();
        if now_ns >= end_ns {
            break;
        }
        if now_ns >= next_ns {
            (number, next_ns) = (number + 1, now_ns.saturating_add(AGAIN_NS));
            let sent = link.send(&Packet { session, number, body: Body::Hello }, address);
            if let Err(super::link::SendError::Os(source)) = sent {
                return Err(BridgeError::Socket { address, source });
            }
        }
        match link.receive().map_err(|source| BridgeError::Socket { address, source })? {
            Received::Nothing => clock.sleep_until(end_ns.min(now_ns.saturating_add(LOOK_NS))),
            Received::Undelivered => {}
            Received::Unreadable => add_one(&counters.corrupt),
            Received::Datagram { from, .. } if from != address => add_one(&counters.foreign),
            Received::Datagram { packet: Err(PacketError::Version(found)), .. } => {
                return Err(BridgeError::OtherVersion { address, found });
            }
            Received::Datagram { packet: Err(error), .. } => {
                add_one(&counters.corrupt);
                heard.nonsense = Some(error);
            }
            Received::Datagram { packet: Ok(packet), .. } if packet.session != session => {
                add_one(&counters.other_session);
            }
            Received::Datagram { packet: Ok(packet), .. } => match packet.body {
                Body::Welcome(welcome) => return Ok((session, welcome)),
                Body::End(EndReason::NoSession | EndReason::Silent | EndReason::Closing) if session != 0 => {
                    session = new_session();
                    if renewed_ns.is_none_or(|at_ns| now_ns >= at_ns.saturating_add(AGAIN_NS)) {
                        (renewed_ns, next_ns) = (Some(now_ns), now_ns);
                    }
                }
                Body::End(EndReason::Busy) => heard.is_busy = true,
                Body::End(EndReason::DeviceFailed) => return Err(BridgeError::DeviceFailed { address }),
                // A sample may overtake its welcome; the rest says nothing of whether we are welcome.
                _ => {}
            },
        }
    }
    Err(match heard {
        Heard { is_busy: true, .. } => BridgeError::Busy { address },
        Heard { nonsense: Some(source), .. } => BridgeError::NotAPeer { address, source },
        Heard { .. } => BridgeError::NoPeer { address, waited },
    })
}

impl BridgeError {
    /// What a device says of it that could not be opened.
    pub(super) fn of_device(&self) -> DeviceError {
        match self {
            Self::Busy { .. } => DeviceError::Protocol("the peer serves another program"),
            Self::OtherVersion { .. } => DeviceError::Protocol("the peer speaks another version"),
            Self::NotAPeer { .. } => DeviceError::Protocol("what answers is no peer"),
            Self::Socket { source, .. } => super::link::of_device(source),
            _ => DeviceError::Disconnected,
        }
    }
}
