//! What can be wrong with a packet.

use super::{MAGIC, VERSION};
use thiserror::Error;

/// Why bytes are no packet, or a packet is not sent. It carries no heap.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum PacketError {
    /// It is shorter or longer than its kind.
    #[error("a packet has {found} bytes; it must have {expected}")]
    Length {
        /// Its length.
        found: usize,
        /// What it must be.
        expected: usize,
    },
    /// It does not begin as every packet does.
    #[error("a packet does not begin with {MAGIC:02x?}")]
    Magic,
    /// It is of another version of the protocol.
    #[error("a packet is of version {0}; it must be {VERSION}")]
    Version(u16),
    /// There is no such kind.
    #[error("a packet is of kind {0}; there are 1 to 6")]
    Kind(u8),
    /// A byte, a flag or a field without a meaning is not zero.
    #[error("a byte without a meaning is not zero")]
    Reserved,
    /// It belongs to no session, and must.
    #[error("a sample, a force or a stop is of session 0, which there never is")]
    Session,
    /// It has the number 0; they are counted from 1.
    #[error("a hello, a sample, a force or a stop has the number 0; they are counted from 1")]
    Counted,
    /// A number is not finite, or beyond what is allowed.
    #[error("{what} is {value}; it must be {least} to {most}")]
    Beyond {
        /// What it is, with its unit.
        what: &'static str,
        /// The number.
        value: f64,
        /// The least that is allowed.
        least: f64,
        /// The most that is allowed.
        most: f64,
    },
    /// The orientation is no rotation.
    #[error("the orientation is no unit quaternion; its square must be 1 within 0.0002")]
    Orientation,
    /// The name is empty, not UTF-8, has control characters, or something after its end.
    #[error("the name must be 1 to 32 bytes of UTF-8 without control characters, then zeros")]
    Name,
    /// There is no such reason for an end.
    #[error("a session ends for reason {0}; there are 1 to 6")]
    Reason(u32),
}
