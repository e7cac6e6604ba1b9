//! What came over a bridge and what did not, counted where it runs and read from anywhere.

use super::order::Arrival;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// What one end of a bridge has counted since it was made. Packets are samples at palpate's end, forces at the peer's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BridgeCounts {
    /// Sessions that began.
    pub sessions: u64,
    /// Sessions that were over because the other end was silent.
    pub silences: u64,
    /// Packets that were newer than all before.
    pub taken: u64,
    /// Of these, such that were never used, because a newer one had come by then.
    pub skipped: u64,
    /// Numbers that have not come.
    pub lost: u64,
    /// Packets that came after a newer one. They are not used.
    pub late: u64,
    /// Packets that came again. They are not used.
    pub duplicated: u64,
    /// Packets that break the protocol, or are of another version.
    pub corrupt: u64,
    /// Packets from somebody else.
    pub foreign: u64,
    /// Packets of another session.
    pub other_session: u64,
    /// At the peer: forces beyond the device's largest, which are not shown, and readings that no packet can carry. At palpate's
    /// end: forces that were not finite or beyond the largest, which are not sent.
    pub refused: u64,
    /// At palpate's end: forces that had been sent when the newest sample came, and were not shown when it was taken.
    pub unshown: u64,
}

/// Reads the counts of an end of a bridge, from any thread. Counts of one reading may be some packets apart.
#[derive(Clone, Debug, Default)]
pub struct BridgeMonitor(Arc<Counters>);

/// Written by one thread each.
#[derive(Debug, Default)]
pub(super) struct Counters {
    pub(super) sessions: AtomicU64,
    pub(super) silences: AtomicU64,
    pub(super) taken: AtomicU64,
    pub(super) skipped: AtomicU64,
    pub(super) lost: AtomicU64,
    pub(super) late: AtomicU64,
    pub(super) duplicated: AtomicU64,
    pub(super) corrupt: AtomicU64,
    pub(super) foreign: AtomicU64,
    pub(super) other_session: AtomicU64,
    pub(super) refused: AtomicU64,
    pub(super) unshown: AtomicU64,
}

impl BridgeMonitor {
    /// The counts as they are now.
    #[must_use]
    pub fn counts(&self) -> BridgeCounts {
        // They carry no other data.
        let read = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        let counters = &self.0;
        BridgeCounts {
            sessions: read(&counters.sessions),
            silences: read(&counters.silences),
            taken: read(&counters.taken),
            skipped: read(&counters.skipped),
            lost: read(&counters.lost),
            late: read(&counters.late),
            duplicated: read(&counters.duplicated),
            corrupt: read(&counters.corrupt),
            foreign: read(&counters.foreign),
            other_session: read(&counters.other_session),
            refused: read(&counters.refused),
            unshown: read(&counters.unshown),
        }
    }

    pub(super) fn counters(&self) -> &Counters {
        &self.0
    }
}

impl Counters {
    /// Counts `arrival`, and whether it is newer than all before.
    pub(super) fn note(&self, arrival: Arrival) -> bool {
        match arrival {
            Arrival::Newer { missing } => {
                self.lost.fetch_add(missing, Ordering::Relaxed);
                add_one(&self.taken);
            }
            Arrival::Again => add_one(&self.duplicated),
            Arrival::Late { was_missing } => {
                self.lost.fetch_sub(u64::from(was_missing), Ordering::Relaxed);
                add_one(&self.late);
            }
        }
        matches!(arrival, Arrival::Newer { .. })
    }
}

/// One more.
pub(super) fn add_one(counter: &AtomicU64) {
    counter.fetch_add(1, Ordering::Relaxed);
}
