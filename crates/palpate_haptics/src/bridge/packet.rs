//! The bridge's packets: pure functions between bytes and values. `docs/bridge.md` has the table of bytes.
//!
//! Numbers are little-endian, floating-point numbers IEEE 754 doubles. Each kind has one size; bytes without a meaning are zero.
//! Whatever is not exactly so is refused, so that bytes that are taken are those that the packet gives again.

mod bytes;
mod coding;
mod error;
mod name;

pub use coding::Header;
pub use error::PacketError;
pub use name::Name;

use crate::Reading;
use glam::{DQuat, DVec3};
use std::ops::RangeInclusive;

/// What every packet begins with.
pub const MAGIC: [u8; 4] = *b"PLPB";
/// The version of the protocol.
pub const VERSION: u16 = 1;
/// The size of the header.
pub const HEADER_SIZE: usize = 24;
/// The size of the largest packet.
pub const MAX_SIZE: usize = 128;

/// What no coordinate exceeds, m.
pub const MAX_POSITION_M: f64 = 100.0;
/// What no velocity exceeds, m/s.
pub const MAX_SPEED_M_PER_S: f64 = 1000.0;
/// What no force exceeds, N.
pub const MAX_FORCE_N: f64 = 1000.0;
/// Rates of a device, Hz.
pub const RATES_HZ: RangeInclusive<f64> = 1.0..=20_000.0;
/// Watchdogs of a peer, µs.
pub const WATCHDOGS_US: RangeInclusive<u32> = 1_000..=1_000_000;

/// One packet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Packet {
    /// The session that it belongs to; 0 in a question for the description, and in its answer.
    pub session: u64,
    /// Its number. Samples, and forces together with the stop, are counted from 1 in each session; answers have the number of
    /// what they answer.
    pub number: u64,
    /// What it says.
    pub body: Body,
}

/// What a packet says. Kinds are numbered from 1 in this order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Body {
    /// palpate: let us begin this session; in session 0: what are you?
    Hello,
    /// Peer: this is what I am.
    Welcome(Welcome),
    /// Peer: the hand.
    Sample(Sampled),
    /// palpate: show this force, N, the device's frame.
    Force(DVec3),
    /// palpate: zero force; the session is over.
    Stop,
    /// Peer: zero force; the session is over, or never began.
    End(EndReason),
}

/// What a peer's device is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Welcome {
    /// A name for people.
    pub name: Name,
    /// Corners of the box in which it can be moved, m, its own frame.
    pub workspace_m: [DVec3; 2],
    /// The largest force that it shows, N. Larger ones are refused.
    pub max_force_n: f64,
    /// How often it is read and written, Hz.
    pub rate_hz: f64,
    /// The time without a newer force after which it lets go, µs.
    pub watchdog_us: u32,
}

/// The hand at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampled {
    /// Position, m, the device's frame.
    pub position_m: DVec3,
    /// Orientation.
    pub orientation: DQuat,
    /// Velocity as the device itself knows it, m/s.
    pub velocity_m_per_s: Option<DVec3>,
    /// Bit i is set while button i is pressed.
    pub buttons: u32,
    /// The number of the force that was shown then; 0 before the first.
    pub shown: u64,
}

impl Sampled {
    /// The reading that it carries, with the number of its packet.
    #[must_use]
    pub fn reading(&self, number: u64) -> Reading {
        let Self { position_m, orientation, velocity_m_per_s, buttons, .. } = *self;
        Reading { position_m, velocity_m_per_s, orientation, buttons, sequence: Some(number) }
    }
}

/// Why a session is over, or did not begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum EndReason {
    /// The other end speaks another version.
    OtherVersion = 1,
    /// There is a session with somebody else.
    Busy = 2,
    /// There is no such session: the peer was restarted, or the session has ended.
    NoSession = 3,
    /// No newer force came for too long.
    Silent = 4,
    /// The peer ends.
    Closing = 5,
    /// The peer's device failed.
    DeviceFailed = 6,
}

impl EndReason {
    const ALL: [Self; 6] =
        [Self::OtherVersion, Self::Busy, Self::NoSession, Self::Silent, Self::Closing, Self::DeviceFailed];
}

impl Body {
    fn kind(&self) -> u8 {
        match self {
            Self::Hello => 1,
            Self::Welcome(_) => 2,
            Self::Sample(_) => 3,
            Self::Force(_) => 4,
            Self::Stop => 5,
            Self::End(_) => 6,
        }
    }
}

impl Packet {
    /// Refuses what no packet may say.
    fn check(&self) -> Result<(), PacketError> {
        let is_in_session = matches!(self.body, Body::Sample(_) | Body::Force(_) | Body::Stop);
        if is_in_session && self.session == 0 {
            return Err(PacketError::Session);
        }
        if (is_in_session || matches!(self.body, Body::Hello)) && self.number == 0 {
            return Err(PacketError::Counted);
        }
        match &self.body {
            Body::Welcome(welcome) => welcome.check(),
            Body::Sample(sampled) => sampled.check(),
            Body::Force(force_n) => within("force, N", *force_n, MAX_FORCE_N),
            Body::Hello | Body::Stop | Body::End(_) => Ok(()),
        }
    }
}

impl Welcome {
    fn check(&self) -> Result<(), PacketError> {
        let [low, high] = self.workspace_m;
        within("workspace, m", low, MAX_POSITION_M)?;
        within("workspace, m", high, MAX_POSITION_M)?;
        number("smallest side of the workspace, m", (high - low).min_element(), 0.0..=2.0 * MAX_POSITION_M)?;
        number("largest force, N", self.max_force_n, 0.0..=MAX_FORCE_N)?;
        number("rate, Hz", self.rate_hz, RATES_HZ)?;
        let watchdog = RangeInclusive::new(f64::from(*WATCHDOGS_US.start()), f64::from(*WATCHDOGS_US.end()));
        number("watchdog, µs", f64::from(self.watchdog_us), watchdog)
    }
}

impl Sampled {
    fn check(&self) -> Result<(), PacketError> {
        within("position, m", self.position_m, MAX_POSITION_M)?;
        within("velocity, m/s", self.velocity_m_per_s.unwrap_or_default(), MAX_SPEED_M_PER_S)?;
        let q = self.orientation;
        for component in q.to_array() {
            number("orientation", component, -1.001..=1.001)?;
        }
        if q.is_normalized() { Ok(()) } else { Err(PacketError::Orientation) }
    }
}

fn within(what: &'static str, vector: DVec3, most: f64) -> Result<(), PacketError> {
    vector.to_array().into_iter().try_for_each(|component| number(what, component, -most..=most))
}

/// Refuses a number beyond what is allowed, and what is not a number.
fn number(what: &'static str, value: f64, allowed: RangeInclusive<f64>) -> Result<(), PacketError> {
    if allowed.contains(&value) {
        return Ok(());
    }
    Err(PacketError::Beyond { what, value, least: *allowed.start(), most: *allowed.end() })
}
