//! Devices that only their vendor's library can drive: another process, the *peer*, holds that library, and speaks with palpate
//! over UDP on the loopback address. Samples come in, forces go out. `docs/bridge.md` has every byte of the [`packet`]s.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

pub mod packet;
