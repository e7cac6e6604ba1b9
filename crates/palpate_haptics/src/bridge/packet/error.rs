//! Errors of packets.

use super::format::{MAGIC, VERSION};
use thiserror::Error;

/// Why bytes could not be parsed or a packet could not be encoded. It holds no heap memory.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum PacketError {
    /// The length does not match the kind.
    #[error("a packet has {found} bytes; it must have {expected}")]
    Length {
        /// Length found, bytes.
        found: usize,
        /// Expected length, bytes.
        expected: usize,
    },
    /// The first bytes are not [`MAGIC`].
    #[error("a packet does not begin with {MAGIC:02x?}")]
    Magic,
    /// The packet is of another version of the protocol.
    #[error("a packet is of version {0}; it must be {VERSION}")]
    Version(u16),
    /// The kind does not exist.
    #[error("a packet is of kind {0}; it must be 1 to 6")]
    Kind(u8),
    /// A reserved byte, flag or field is not zero.
    #[error("a reserved byte is not zero")]
    Reserved,
    /// The session number is 0 in a packet that belongs to a session.
    #[error("a sample, a force or a stop is of session 0, which is not a session")]
    Session,
    /// The packet number is 0.
    #[error("a hello, a sample, a force or a stop has the number 0; they are counted from 1")]
    Counted,
    /// A number is not finite or out of range.
    #[error("{what} is {value}; it must be {min} to {max}")]
    OutOfRange {
        /// Quantity, with its unit.
        what: &'static str,
        /// Rejected number.
        value: f64,
        /// Minimum.
        min: f64,
        /// Maximum.
        max: f64,
    },
    /// The orientation is not a unit quaternion.
    #[error("the orientation is not a unit quaternion; its squared length must be 1 within 0.0002")]
    Orientation,
    /// The name is empty, is not UTF-8, or contains control characters or bytes after its end.
    #[error("the name must be 1 to 32 bytes of UTF-8 without control characters, then zeros")]
    Name,
    /// The reason of an end does not exist.
    #[error("a session ends for reason {0}; it must be 1 to 6")]
    Reason(u32),
}
