//! Constants of the packet format.

use std::ops::RangeInclusive;

/// First bytes of every packet.
pub const MAGIC: [u8; 4] = *b"PLPB";
/// Version of the protocol.
pub const VERSION: u16 = 1;
/// Size of the header, bytes.
pub const HEADER_SIZE: usize = 24;
/// Size of the largest packet, bytes.
pub const MAX_SIZE: usize = 128;

/// Maximum coordinate, m.
pub const MAX_POSITION_M: f64 = 100.0;
/// Maximum component of a velocity, m/s.
pub const MAX_SPEED_M_PER_S: f64 = 1000.0;
/// Maximum component of a force, N.
pub const MAX_FORCE_N: f64 = 1000.0;
/// Allowed rates of a device, Hz.
pub const RATES_HZ: RangeInclusive<f64> = 1.0..=20_000.0;
/// Allowed watchdog times of a peer, µs.
pub const WATCHDOGS_US: RangeInclusive<u32> = 1_000..=1_000_000;
