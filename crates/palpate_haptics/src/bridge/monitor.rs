//! Counts of packets on a bridge, written by its thread and readable from any thread.

use super::packet_order::Arrival;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Counts of one end of a bridge since its creation. Packets are samples at palpate's end and forces at the peer's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BridgeCounts {
    /// Started sessions.
    pub sessions: u64,
    /// Sessions ended by a timeout of the other end.
    pub silences: u64,
    /// Packets newer than all previous ones.
    pub accepted: u64,
    /// Newer packets that were not used because an even newer one followed before their use.
    pub skipped: u64,
    /// Packets missing in the sequence of numbers.
    pub lost: u64,
    /// Packets that arrived after a newer one, and were dropped.
    pub late: u64,
    /// Packets that arrived twice; the second was dropped.
    pub duplicated: u64,
    /// Packets that violate the protocol or are of another version.
    pub corrupt: u64,
    /// Packets from another sender.
    pub foreign: u64,
    /// Packets of another session.
    pub other_session: u64,
    /// At the peer: rejected forces above the device's maximum, and readings out of the range of the protocol. At palpate's end:
    /// rejected forces that were not finite or above the maximum.
    pub rejected: u64,
    /// At palpate's end: forces sent by the arrival of the newest sample, but not yet applied when that sample was measured.
    pub forces_in_flight: u64,
}

/// Reads the counts of one end of a bridge, from any thread. The counts of one call may differ by a few packets in time.
#[derive(Clone, Debug, Default)]
pub struct BridgeMonitor(Arc<Counters>);

/// Counters, each written by one thread.
#[derive(Debug, Default)]
pub(super) struct Counters {
    pub(super) sessions: AtomicU64,
    pub(super) silences: AtomicU64,
    pub(super) accepted: AtomicU64,
    pub(super) skipped: AtomicU64,
    pub(super) lost: AtomicU64,
    pub(super) late: AtomicU64,
    pub(super) duplicated: AtomicU64,
    pub(super) corrupt: AtomicU64,
    pub(super) foreign: AtomicU64,
    pub(super) other_session: AtomicU64,
    pub(super) rejected: AtomicU64,
    pub(super) forces_in_flight: AtomicU64,
}

impl BridgeMonitor {
    /// The current counts.
    #[must_use]
    pub fn counts(&self) -> BridgeCounts {
        // Relaxed: the counters carry no other data.
        let read = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        let counters = &self.0;
        BridgeCounts {
            sessions: read(&counters.sessions),
            silences: read(&counters.silences),
            accepted: read(&counters.accepted),
            skipped: read(&counters.skipped),
            lost: read(&counters.lost),
            late: read(&counters.late),
            duplicated: read(&counters.duplicated),
            corrupt: read(&counters.corrupt),
            foreign: read(&counters.foreign),
            other_session: read(&counters.other_session),
            rejected: read(&counters.rejected),
            forces_in_flight: read(&counters.forces_in_flight),
        }
    }

    pub(super) fn counters(&self) -> &Counters {
        &self.0
    }
}

impl Counters {
    /// Counts `arrival`; returns whether it is newer than all previous ones.
    pub(super) fn note(&self, arrival: Arrival) -> bool {
        match arrival {
            Arrival::Newer { missing } => {
                self.lost.fetch_add(missing, Ordering::Relaxed);
                add_one(&self.accepted);
            }
            Arrival::Duplicate => add_one(&self.duplicated),
            Arrival::Late { was_missing } => {
                self.lost.fetch_sub(u64::from(was_missing), Ordering::Relaxed);
                add_one(&self.late);
            }
        }
        matches!(arrival, Arrival::Newer { .. })
    }
}

/// Increments `counter`.
pub(super) fn add_one(counter: &AtomicU64) {
    counter.fetch_add(1, Ordering::Relaxed);
}
