//! The order of numbered packets: which are newer, which come late or twice, which are missing.

/// So many numbers before the newest are known to have come or not.
const WINDOW: u64 = 64;

/// The numbers that have come in a session. They count from 1.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Order {
    newest: u64,
    /// Bit i: the number `newest - i` has come.
    came: u64,
}

/// What a number says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Arrival {
    /// Newer than all others; so many between are missing.
    Newer { missing: u64 },
    /// It has come before.
    Again,
    /// Older than the newest. It was counted as missing, or is so old that nobody knows.
    Late { was_missing: bool },
}

impl Order {
    /// The newest number; 0 before the first.
    pub(super) fn newest(&self) -> u64 {
        self.newest
    }

    /// Notes that `number` has come.
    pub(super) fn take(&mut self, number: u64) -> Arrival {
        if number > self.newest {
            let ahead = number - self.newest;
            self.came = if ahead < WINDOW { self.came << ahead | 1 } else { 1 };
            self.newest = number;
            return Arrival::Newer { missing: ahead - 1 };
        }
        let behind = self.newest - number;
        if behind >= WINDOW {
            return Arrival::Late { was_missing: false };
        }
        let bit = 1 << behind;
        if self.came & bit != 0 {
            return Arrival::Again;
        }
        self.came |= bit;
        Arrival::Late { was_missing: true }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    #[test]
    fn late_ones_are_told_from_doubles_and_gaps_are_counted() {
        let mut order = Order::default();
        let newer = |missing| Arrival::Newer { missing };
        let late = |was_missing| Arrival::Late { was_missing };
        for (number, expected) in [
            (1, newer(0)),
            (2, newer(0)),
            (2, Arrival::Again),
            (5, newer(2)),
            (3, late(true)),
            (3, Arrival::Again),
            (1, Arrival::Again),
            (4, late(true)),
            (100, newer(94)),
            (37, late(true)),
            (36, late(false)),
            (u64::MAX, newer(u64::MAX - 101)),
            (100, late(false)),
        ] {
            assert_eq!(order.take(number), expected, "{number}");
        }
    }

    proptest! {
        /// Within the window it knows as much as one who remembers everything.
        #[test]
        fn it_remembers_as_much_as_a_set(numbers in prop::collection::vec(1..200u64, 1..300)) {
            let (mut order, mut came, mut lost) = (Order::default(), BTreeSet::new(), 0);
            for number in numbers {
                let newest = order.newest();
                match order.take(number) {
                    Arrival::Newer { missing } => {
                        prop_assert!(number > newest);
                        lost += missing;
                    }
                    Arrival::Again => prop_assert!(came.contains(&number)),
                    Arrival::Late { was_missing: true } => {
                        prop_assert!(number < newest && !came.contains(&number));
                        lost -= 1;
                    }
                    Arrival::Late { was_missing: false } => {
                        prop_assert!(newest - number >= WINDOW);
                        // A set knows better.
                        lost -= u64::from(!came.contains(&number));
                    }
                }
                came.insert(number);
                prop_assert_eq!(came.last(), Some(&order.newest()));
                prop_assert_eq!(lost, order.newest() - came.len() as u64);
            }
        }
    }
}
