//! Which part of a recording can be compared with the full body, which begins at rest and is stepped along every sample.

use palpate_local::Sample;

/// Most samples that are compared: a window may have been open for an hour, and nobody waits for that.
const MOST: usize = 10_000;
/// A hand that has felt nothing for so many ticks has left a body at rest.
const AT_REST: u64 = 150;

/// What the loop that ran last recorded, with the numbers of the samples: slow motion starts another loop, which counts from the
/// beginning.
pub fn of_last_loop<T>(records: &[T], number: impl Fn(&T) -> u64) -> &[T] {
    let restart = records.windows(2).rposition(|pair| number(&pair[1]) < number(&pair[0]));
    &records[restart.map_or(0, |at| at + 1)..]
}

/// The index of the first sample that can be compared: after the last hole, and not in the middle of a touch. `touches` are the
/// numbers of the samples at which something was felt, in ascending order.
pub fn begin(samples: &[Sample], touches: impl Iterator<Item = u64>) -> usize {
    let hole = samples.windows(2).rposition(|pair| pair[1].sequence != pair[0].sequence + 1);
    let first = hole.map_or(0, |at| at + 1).max(samples.len().saturating_sub(MOST));
    let (Some(from), Some(to)) = (samples.get(first), samples.last()) else { return first };
    if from.sequence == 0 {
        return first;
    }
    let mut pressed = from.sequence;
    for number in touches.chain([to.sequence]) {
        if number > pressed + AT_REST {
            return first + (pressed + AT_REST - from.sequence) as usize;
        }
        pressed = pressed.max(number);
    }
    first
}
