//! How much memory the process has in use.
//!
//! What grows must not hide behind what only has not been used yet, nor be hidden by it. Pages of the loop are written to when it is
//! made. The model side's memory comes and goes with every step, most of it where the tool touches most, and where that is the
//! run finds out by chance, in its first second or its last; so its heap gets room for that before it begins
//! ([`settle`]). What it keeps is counted besides, to the byte ([`super::model_side::Done`]): a leak shows there long before
//! it has used up that room.

use serde::Serialize;

/// Seconds after which nothing should grow any more.
pub(super) const SETTLED_AFTER_S: u64 = 10;

/// Room for what a model step needs besides the body: twice what has been seen at the largest support sets.
const HEAP_BYTES: usize = 24 << 20;
/// And on its stack.
const STACK_BYTES: usize = 256 << 10;

/// The process's own memory, bytes: heaps, stacks and data, resident or swapped out, without pages of files such as the program
/// itself; counted page by page. `None` where the system does not tell.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub(super) struct Memory {
    /// Before the loop begins.
    pub(super) start: Option<u64>,
    /// After ten seconds.
    pub(super) after_10_s: Option<u64>,
    /// At the end, everything still running.
    pub(super) end: Option<u64>,
    /// From ten seconds to the end; negative where memory was given back. `None` in shorter runs.
    pub(super) growth: Option<i64>,
    /// What the model side has allocated from ten seconds to the end and not freed, bytes, as it was asked for. The loop's thread
    /// allocates nothing at all.
    pub(super) kept_by_model_side: Option<i64>,
}

impl Memory {
    pub(super) fn begin() -> Self {
        Self { start: own_bytes(), ..Self::default() }
    }

    /// Notes what is in use after `passed_s` whole seconds.
    pub(super) fn note(&mut self, passed_s: u64) {
        self.end = own_bytes();
        if passed_s == SETTLED_AFTER_S {
            self.after_10_s = self.end;
        } else if let (Some(settled), Some(end)) = (self.after_10_s, self.end) {
            self.growth = Some(end.cast_signed() - settled.cast_signed());
        }
    }
}

/// Makes room in this thread's heap and on its stack, and writes to all of it.
pub(super) fn settle() {
    // The first block comes from the operating system and goes back to it, by which the allocator learns to keep blocks of that
    // size; the second is kept.
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
    // Unlike `status`, whose books are exact to some pages for each thread.
    let told = std::fs::read_to_string("/proc/self/smaps_rollup").ok()?;
    let kilobytes = |name: &str| {
        let line = told.lines().find_map(|line| line.strip_prefix(name))?;
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
    fn growth_is_that_after_ten_seconds() {
        let mut memory = Memory::begin();
        (1..=SETTLED_AFTER_S).for_each(|second| memory.note(second));
        assert!(memory.start.is_some() && memory.after_10_s.is_some() && memory.growth.is_none());
        let block = vec![1_u8; 64 << 20];
        memory.note(SETTLED_AFTER_S + 1);
        assert!(memory.growth.unwrap() > 32 << 20, "{}", std::hint::black_box(block).len());
    }
}
