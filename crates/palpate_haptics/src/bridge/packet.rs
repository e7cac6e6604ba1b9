//! Packets of the bridge: pure functions between bytes and values. `docs/bridge.md` contains the table of bytes.
//!
//! Numbers are little-endian; floating-point numbers are IEEE 754 doubles. Each kind has one size, and reserved bytes are zero. All
//! other packets are rejected: encoding a parsed packet reproduces its bytes.

mod bytes;
mod codec;
mod error;
mod format;
mod name;

pub use codec::Header;
pub use error::PacketError;
pub use format::{
    HEADER_SIZE, MAGIC, MAX_FORCE_N, MAX_POSITION_M, MAX_SIZE, MAX_SPEED_M_PER_S, RATES_HZ, VERSION,
    WATCHDOGS_US,
};
pub use name::Name;

use crate::Reading;
use glam::{DQuat, DVec3};
use std::ops::RangeInclusive;

/// One packet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Packet {
    /// Session number; 0 in a request for the description and in its reply.
    pub session: u64,
    /// Packet number. Samples count from 1 in each session, as do forces and stops together; a reply has the number of its
    /// request.
    pub number: u64,
    /// Content of the packet.
    pub body: Body,
}

/// Content of a packet. Kinds are numbered from 1 in this order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Body {
    /// From palpate: start this session; in session 0, request the description.
    Hello,
    /// From the peer: description of the device, in reply to a hello.
    Welcome(Welcome),
    /// From the peer: one sample of the hand.
    Sample(Sampled),
    /// From palpate: apply this force, N, device frame.
    Force(DVec3),
    /// From palpate: set zero force and end the session.
    Stop,
    /// From the peer: zero force is set; the session has ended or was not started.
    End(EndReason),
}

/// Description of a peer's device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Welcome {
    /// Human-readable name.
    pub name: Name,
    /// Lower and upper corner of the workspace box, m, device frame.
    pub workspace_m: [DVec3; 2],
    /// Maximum force, N; the peer rejects larger ones.
    pub max_force_n: f64,
    /// Rate at which the device is read and written, Hz.
    pub rate_hz: f64,
    /// Time without a newer force after which the peer sets zero force, µs.
    pub watchdog_us: u32,
}

/// Measured state of the hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampled {
    /// Position, m, device frame.
    pub position_m: DVec3,
    /// Orientation, a unit quaternion.
    pub orientation: DQuat,
    /// Velocity measured by the device, m/s; `None` if the device measures none.
    pub velocity_m_per_s: Option<DVec3>,
    /// Bit i is set while button i is pressed.
    pub buttons: u32,
    /// Number of the force applied at the measurement; 0 before the first.
    pub shown: u64,
}

impl Sampled {
    /// Converts to a reading with the number of the packet as its sequence number.
    #[must_use]
    pub fn reading(&self, number: u64) -> Reading {
        let Self { position_m, orientation, velocity_m_per_s, buttons, .. } = *self;
        Reading { position_m, velocity_m_per_s, orientation, buttons, sequence: Some(number) }
    }
}

/// Why a session ended or was not started.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum EndReason {
    /// The other end uses another version.
    OtherVersion = 1,
    /// The peer has a session with another program.
    Busy = 2,
    /// The session does not exist: the peer was restarted, or the session has ended.
    NoSession = 3,
    /// The peer's watchdog expired without a newer force.
    Silent = 4,
    /// The peer is closing.
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
    /// Rejects contents out of range.
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

fn within(what: &'static str, vector: DVec3, max: f64) -> Result<(), PacketError> {
    vector.to_array().into_iter().try_for_each(|component| number(what, component, -max..=max))
}

/// Rejects a number out of range, and NaN.
fn number(what: &'static str, value: f64, allowed: RangeInclusive<f64>) -> Result<(), PacketError> {
    if allowed.contains(&value) {
        return Ok(());
    }
    Err(PacketError::OutOfRange { what, value, min: *allowed.start(), max: *allowed.end() })
}
