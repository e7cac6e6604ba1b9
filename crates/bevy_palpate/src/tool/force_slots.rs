//! The board on which the loops of all tools publish their forces for each other.

use bevy::prelude::*;
use palpate_haptics::ForceBoard;
use std::sync::Arc;

/// Number of slots. The loops of more tools follow no other one, and are followed by none.
const SLOTS: usize = u64::BITS as usize;

/// The slots of running loops, a bit for each.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct UsedSlots(u64);

impl UsedSlots {
    pub(super) fn add(&mut self, slot: usize) {
        self.0 |= 1 << slot;
    }
}

/// The slots of all loops on their common board.
#[derive(Resource, Debug)]
pub(super) struct ForceSlots {
    board: Arc<ForceBoard>,
    /// The slot after the one that was given last.
    next: usize,
}

impl Default for ForceSlots {
    fn default() -> Self {
        Self { board: Arc::new(ForceBoard::new(SLOTS)), next: 0 }
    }
}

impl ForceSlots {
    /// The board, and a slot that is not among the `used` ones. Slots are given in turn: the loop that had one before may end late.
    pub(super) fn place(&mut self, used: UsedSlots) -> Option<(Arc<ForceBoard>, usize)> {
        let slot = (0..SLOTS).map(|i| (self.next + i) % SLOTS).find(|slot| used.0 >> slot & 1 == 0)?;
        self.next = (slot + 1) % SLOTS;
        Some((Arc::clone(&self.board), slot))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_are_given_in_turn_and_never_twice() {
        let mut slots = ForceSlots::default();
        let mut used = UsedSlots::default();
        for expected in 0..SLOTS {
            let (_, slot) = slots.place(used).unwrap();
            assert_eq!(slot, expected);
            used.add(slot);
        }
        assert!(slots.place(used).is_none());
        used.0 &= !(1 << 3 | 1 << 60);
        let again: Vec<usize> = std::iter::from_fn(|| {
            let (_, slot) = slots.place(used)?;
            used.add(slot);
            Some(slot)
        })
        .collect();
        assert_eq!(again, [3, 60]);
    }
}
