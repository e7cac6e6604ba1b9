//! Selects the part of a recording that can be compared with the full body, which starts at rest and is stepped along every sample.

use palpate_local::Sample;

/// Maximum number of compared samples, which limits the time of the comparison after hours with a window.
const MAX_SAMPLES: usize = 10_000;
/// Number of the first sample of a loop.
const FIRST: u64 = 1;
/// Ticks without force after which the body is nearly at rest.
const AT_REST: u64 = 150;

/// Records of the last loop, with `number` as the sample's number: slow motion starts another loop, which counts from zero.
pub fn of_last_loop<T>(records: &[T], number: impl Fn(&T) -> u64) -> &[T] {
    let restart = records.windows(2).rposition(|pair| number(&pair[1]) < number(&pair[0]));
    &records[restart.map_or(0, |at| at + 1)..]
}

/// Index of the first sample that can be compared: after the last gap, and outside a contact. `touches` are the numbers of the samples with
/// force, in ascending order.
pub fn start(samples: &[Sample], touches: impl Iterator<Item = u64>) -> usize {
    let gap = samples.windows(2).rposition(|pair| pair[1].sequence != pair[0].sequence + 1);
    let first = gap.map_or(0, |at| at + 1).max(samples.len().saturating_sub(MAX_SAMPLES));
    let (Some(from), Some(to)) = (samples.get(first), samples.last()) else { return first };
    if from.sequence <= FIRST {
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
