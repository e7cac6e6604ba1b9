//! Memory in use by the process.
//!
//! Memory that is used for the first time must not look like growth, nor hide it. The loop writes to its pages when it is created.
//! A model step allocates and frees memory, most of it where the contact is widest, which may happen in the first second of a run or
//! in the last. [`reserve`] therefore extends the heap of its thread before the run. The bytes that the model side keeps are counted
//! exactly (`ModelSideStats`), which shows a leak long before it exceeds the reserve.

use serde::Serialize;

/// Time after which memory should not grow, s.
pub(super) const SETTLED_AFTER_S: u64 = 10;

/// Heap reserve of a model step, bytes: twice the maximum measured with the largest support sets.
const HEAP_BYTES: usize = 24 << 20;
/// Stack reserve, bytes.
const STACK_BYTES: usize = 256 << 10;

/// Anonymous memory of the process, bytes: heaps, stacks and data, resident or swapped out, counted page by page. Pages of files,
/// for example the program itself, do not count. `None` where the system does not report it.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub(super) struct Memory {
    /// Memory before the loop starts.
    pub(super) start: Option<u64>,
    /// Memory after ten seconds.
    pub(super) after_10_s: Option<u64>,
    /// Memory at the end, with all threads still running.
    pub(super) end: Option<u64>,
    /// Growth from ten seconds to the end; negative where memory was returned. `None` in shorter runs.
    pub(super) growth: Option<i64>,
    /// Bytes that the model side has requested since ten seconds and not freed. The loop's thread allocates nothing.
    pub(super) kept_by_model_side: Option<i64>,
}

impl Memory {
    pub(super) fn at_start() -> Self {
        Self { start: own_bytes(), ..Self::default() }
    }

    /// Records the memory in use after `passed_s` whole seconds.
    pub(super) fn record(&mut self, passed_s: u64) {
        self.end = own_bytes();
        if passed_s == SETTLED_AFTER_S {
            self.after_10_s = self.end;
        } else if let (Some(settled), Some(end)) = (self.after_10_s, self.end) {
            self.growth = Some(end.cast_signed() - settled.cast_signed());
        }
    }
}

/// Extends this thread's heap and stack by the reserves and writes to all of it.
pub(super) fn reserve() {
    // The allocator returns the first block to the operating system and raises its threshold to that size; it keeps the second.
    for bytes in [HEAP_BYTES, HEAP_BYTES - (64 << 10)] {
        drop(std::hint::black_box(vec![1_u8; bytes]));
    }
    touch_stack();
}

#[inline(never)]
fn touch_stack() {
    std::hint::black_box(&mut [0_u8; STACK_BYTES]);
}

#[cfg(target_os = "linux")]
fn own_bytes() -> Option<u64> {
    // `status` is only exact to some pages for each thread.
    let rollup = std::fs::read_to_string("/proc/self/smaps_rollup").ok()?;
    let kilobytes = |name: &str| {
        let line = rollup.lines().find_map(|line| line.strip_prefix(name))?;
        line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()
    };
    Some(1024 * (kilobytes("Anonymous:")? + kilobytes("Swap:")?))
}

#[cfg(not(target_os = "linux"))]
fn own_bytes() -> Option<u64> {
    None
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn growth_starts_at_ten_seconds() {
        let mut memory = Memory::at_start();
        (1..=SETTLED_AFTER_S).for_each(|second| memory.record(second));
        assert!(memory.start.is_some() && memory.after_10_s.is_some() && memory.growth.is_none());
        let block = vec![1_u8; 64 << 20];
        memory.record(SETTLED_AFTER_S + 1);
        assert!(memory.growth.unwrap() > 32 << 20, "{}", std::hint::black_box(block).len());
    }
}
