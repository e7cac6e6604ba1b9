//! Computation on all processors. Results do not depend on their number.

use std::ops::Range;

/// Minimum number of items for which a thread pays.
const MIN_SHARE: usize = 1024;

/// `each` of all `items`, in their order.
pub(crate) fn map<T: Sync, R: Send>(items: &[T], each: impl Fn(&T) -> R + Sync) -> Vec<R> {
    map_ranges(items.len(), |range| items[range].iter().map(&each).collect())
}

/// The results of `each` on consecutive ranges of 0 to `count`, joined in their order.
pub(crate) fn map_ranges<R: Send>(count: usize, each: impl Fn(Range<usize>) -> Vec<R> + Sync) -> Vec<R> {
    map_shares(count, MIN_SHARE, each)
}

/// [`map_ranges`] for items each of which takes so long that a thread pays for a few.
pub(crate) fn map_long<R: Send>(count: usize, each: impl Fn(Range<usize>) -> Vec<R> + Sync) -> Vec<R> {
    map_shares(count, 1, each)
}

fn map_shares<R: Send>(
    count: usize,
    min_share: usize,
    each: impl Fn(Range<usize>) -> Vec<R> + Sync,
) -> Vec<R> {
    let share = count.div_ceil(threads()).max(min_share);
    let ranges: Vec<Range<usize>> =
        (0..count).step_by(share).map(|first| first..(first + share).min(count)).collect();
    map_each(&ranges, |range| each(range.clone())).into_iter().flatten().collect()
}

/// `each` of all `items`, in their order, each on a thread of its own.
pub(crate) fn map_each<T: Sync, R: Send>(items: &[T], each: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let [first, others @ ..] = items else { return Vec::new() };
    let each = &each;
    std::thread::scope(|scope| {
        let started: Vec<_> = others.iter().map(|item| scope.spawn(move || each(item))).collect();
        let mut results = vec![each(first)];
        for thread in started {
            match thread.join() {
                Ok(result) => results.push(result),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        results
    })
}

/// Number of threads that run at the same time.
pub(crate) fn threads() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}
