//! The board on which the loops of all tools publish their forces for each other.

use bevy::prelude::*;
use palpate_haptics::ForceBoard;
use std::sync::Arc;

/// Number of slots. The loops of more tools follow no other one, and are followed by none.
const SLOTS: usize = 64;

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
    pub(super) fn place(&mut self, used: &[usize]) -> Option<(Arc<ForceBoard>, usize)> {
        let slot = (0..SLOTS).map(|i| (self.next + i) % SLOTS).find(|slot| !used.contains(slot))?;
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
        let mut used = Vec::new();
        for expected in 0..SLOTS {
            let (_, slot) = slots.place(&used).unwrap();
            assert_eq!(slot, expected);
            used.push(slot);
        }
        assert!(slots.place(&used).is_none());
        used.retain(|slot| ![3, 60].contains(slot));
        let again: Vec<usize> = std::iter::from_fn(|| {
            let (_, slot) = slots.place(&used)?;
            used.push(slot);
            Some(slot)
        })
        .collect();
        assert_eq!(again, [3, 60]);
    }
}
