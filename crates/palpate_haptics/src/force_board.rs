//! The board on which loops publish their forces for each other.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use glam::DVec3;
use palpate_local::{MAX_BODIES, ModelId, OtherToolForce};
use std::array;
use std::sync::atomic::{AtomicU64, Ordering, fence};

/// Words of a slot: the tool, then for each body its identity and three components of the force.
const WORDS: usize = 1 + 4 * MAX_BODIES;
/// Maximum number of attempts to read a slot while its loop writes.
const MAX_ATTEMPTS: usize = 4;

/// Slots in which loops publish the forces of their tools on bodies at every tick. The loops of other tools on the same body read
/// them: see [`crate::LoopSettings::other`].
///
/// Every slot has one writer and any number of readers. Neither waits: a reader that meets a write gives up after some attempts.
#[derive(Debug)]
pub struct ForceBoard {
    slots: Box<[ForceSlot]>,
}

/// A sequence lock: the version is odd during a write.
#[derive(Debug)]
struct ForceSlot {
    version: AtomicU64,
    words: [AtomicU64; WORDS],
}

impl ForceBoard {
    /// A board with `slots` slots, all without forces.
    #[must_use]
    pub fn new(slots: usize) -> Self {
        let slot = || ForceSlot { version: AtomicU64::new(0), words: array::from_fn(|_| AtomicU64::new(0)) };
        Self { slots: (0..slots).map(|_| slot()).collect() }
    }

    /// Number of slots.
    #[must_use]
    pub fn slot_count(&self) -> usize {
        self.slots.len()
    }

    /// Publishes the forces of `tool` on bodies, N, each with the identity of the body. Only one loop writes to a slot.
    pub(crate) fn publish(&self, slot: usize, tool: u64, forces_n: [(u64, DVec3); MAX_BODIES]) {
        let Some(ForceSlot { version, words }) = self.slots.get(slot) else { return };
        let of_body = |(body, force_n): (u64, DVec3)| {
            [body, force_n.x.to_bits(), force_n.y.to_bits(), force_n.z.to_bits()]
        };
        let values = std::iter::once(tool).chain(forces_n.into_iter().flat_map(of_body));
        let before = version.load(Ordering::Relaxed);
        version.store(before.wrapping_add(1), Ordering::Relaxed);
        fence(Ordering::Release);
        words.iter().zip(values).for_each(|(word, value)| word.store(value, Ordering::Relaxed));
        version.store(before.wrapping_add(2), Ordering::Release);
    }

    /// The newest force of `tool` on `body`; `None` if the slot has another tool or no force on the body, or is being written.
    #[must_use]
    pub fn read(&self, slot: usize, tool: u64, body: u64) -> Option<OtherToolForce> {
        let ForceSlot { version, words } = self.slots.get(slot)?;
        for _ in 0..MAX_ATTEMPTS {
            let before = version.load(Ordering::Acquire);
            let values: [u64; WORDS] = words.each_ref().map(|word| word.load(Ordering::Relaxed));
            fence(Ordering::Acquire);
            if before % 2 == 1 || version.load(Ordering::Relaxed) != before {
                continue;
            }
            let (first, of_bodies) = values.split_first()?;
            let (of_bodies, _) = of_bodies.as_chunks::<4>();
            let [_, x, y, z] = of_bodies.iter().find(|[of, ..]| *of == body && body != ModelId::NO_BODY)?;
            let force_n = DVec3::new(f64::from_bits(*x), f64::from_bits(*y), f64::from_bits(*z));
            return (*first == tool && force_n.is_finite()).then_some(OtherToolForce { tool, body, force_n });
        }
        None
    }
}

/// Another tool whose force a loop follows: its slot and identity, and the body that both touch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FollowedTool {
    /// Slot of the tool on the [`ForceBoard`].
    pub slot: usize,
    /// Identity of the tool.
    pub tool: u64,
    /// Identity of the body.
    pub body: u64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    #[test]
    fn slot_has_the_forces_of_its_tool_only() {
        let board = ForceBoard::new(2);
        assert_eq!((board.slot_count(), board.read(0, 0, 0), board.read(7, 1, 1)), (2, None, None));
        board.publish(1, 5, [(8, DVec3::X), (ModelId::NO_BODY, DVec3::ZERO)]);
        let force = OtherToolForce { tool: 5, body: 8, force_n: DVec3::X };
        assert_eq!(board.read(1, 5, 8), Some(force));
        assert_eq!(
            [board.read(1, 4, 8), board.read(1, 5, 9), board.read(1, 5, 0), board.read(0, 5, 8)],
            [None; 4]
        );
        board.publish(1, 5, [(8, DVec3::NAN), (9, DVec3::Y)]);
        assert_eq!(board.read(1, 5, 8), None);
        assert_eq!(board.read(1, 5, 9).map(|force| force.force_n), Some(DVec3::Y));
        board.publish(9, 5, [(8, DVec3::X); 2]);
    }

    #[test]
    fn concurrent_reads_are_never_torn() {
        let board = Arc::new(ForceBoard::new(1));
        let rounds = if cfg!(miri) { 200_u64 } else { 100_000 };
        let writer = std::thread::spawn({
            let board = Arc::clone(&board);
            move || {
                for i in 1..=rounds {
                    let force = DVec3::splat(i as f64);
                    board.publish(0, 1, [(2, force), (3, -force)]);
                }
            }
        });
        let mut newest = 0.0;
        while !writer.is_finished() {
            if let Some(read) = board.read(0, 1, 2) {
                assert_eq!(read.force_n, DVec3::splat(read.force_n.x));
                assert!(read.force_n.x >= newest);
                newest = read.force_n.x;
            }
        }
        writer.join().unwrap();
        assert_eq!(board.read(0, 1, 3).map(|read| read.force_n), Some(DVec3::splat(-(rounds as f64))));
    }
}
