//! Order of numbered packets: newer, late, duplicate and missing ones.

/// Number of most recent packet numbers whose arrival is tracked.
const WINDOW: u64 = 64;

/// Packet numbers received in a session, from 1.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PacketOrder {
    newest: u64,
    /// Bit i is set if the number `newest - i` has arrived.
    arrived: u64,
}

/// Classification of a packet number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Arrival {
    /// Newer than all others; `missing` numbers in between have not arrived.
    Newer { missing: u64 },
    /// A number that has arrived before.
    Duplicate,
    /// Older than the newest: either counted as missing before, or too old to be tracked.
    Late { was_missing: bool },
}

impl PacketOrder {
    /// Newest number; 0 before the first.
    pub(super) fn newest(&self) -> u64 {
        self.newest
    }

    /// Notes the arrival of `number`.
    pub(super) fn note(&mut self, number: u64) -> Arrival {
        if number > self.newest {
            let ahead = number - self.newest;
            self.arrived = if ahead < WINDOW { self.arrived << ahead | 1 } else { 1 };
            self.newest = number;
            return Arrival::Newer { missing: ahead - 1 };
        }
        let behind = self.newest - number;
        if behind >= WINDOW {
            return Arrival::Late { was_missing: false };
        }
        let bit = 1 << behind;
        if self.arrived & bit != 0 {
            return Arrival::Duplicate;
        }
        self.arrived |= bit;
        Arrival::Late { was_missing: true }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    #[test]
    fn classifies_late_duplicate_and_missing_packets() {
        let mut order = PacketOrder::default();
        let newer = |missing| Arrival::Newer { missing };
        let late = |was_missing| Arrival::Late { was_missing };
        for (number, expected) in [
            (1, newer(0)),
            (2, newer(0)),
            (2, Arrival::Duplicate),
            (5, newer(2)),
            (3, late(true)),
            (3, Arrival::Duplicate),
            (1, Arrival::Duplicate),
            (4, late(true)),
            (100, newer(94)),
            (37, late(true)),
            (36, late(false)),
            (u64::MAX, newer(u64::MAX - 101)),
            (100, late(false)),
        ] {
            assert_eq!(order.note(number), expected, "{number}");
        }
    }

    proptest! {
        /// Within the window the classification equals that of a set of all numbers.
        #[test]
        fn window_agrees_with_set_of_all_numbers(numbers in prop::collection::vec(1..200u64, 1..300)) {
            let (mut order, mut arrived, mut lost) = (PacketOrder::default(), BTreeSet::new(), 0);
            for number in numbers {
                let newest = order.newest();
                match order.note(number) {
                    Arrival::Newer { missing } => {
                        prop_assert!(number > newest);
                        lost += missing;
                    }
                    Arrival::Duplicate => prop_assert!(arrived.contains(&number)),
                    Arrival::Late { was_missing: true } => {
                        prop_assert!(number < newest && !arrived.contains(&number));
                        lost -= 1;
                    }
                    Arrival::Late { was_missing: false } => {
                        prop_assert!(newest - number >= WINDOW);
                        // The set still tracks this number.
                        lost -= u64::from(!arrived.contains(&number));
                    }
                }
                arrived.insert(number);
                prop_assert_eq!(arrived.last(), Some(&order.newest()));
                prop_assert_eq!(lost, order.newest() - arrived.len() as u64);
            }
        }
    }
}
