//! How much memory the process has in use.

use serde::Serialize;

/// Seconds after which nothing should grow any more.
pub(super) const SETTLED_AFTER_S: u64 = 10;

/// Resident memory of the process, bytes; `None` where the system does not tell. The books of the whole process are exact to
/// some pages for each of its threads.
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
}

impl Memory {
    pub(super) fn begin() -> Self {
        Self { start: resident_bytes(), ..Self::default() }
    }

    /// Notes what is in use after `passed_s` whole seconds.
    pub(super) fn note(&mut self, passed_s: u64) {
        self.end = resident_bytes();
        if passed_s == SETTLED_AFTER_S {
            self.after_10_s = self.end;
        } else if let (Some(settled), Some(end)) = (self.after_10_s, self.end) {
            self.growth = Some(end.cast_signed() - settled.cast_signed());
        }
    }
}

#[cfg(target_os = "linux")]
fn resident_bytes() -> Option<u64> {
    // In kB here, in pages of a size that is told elsewhere in `statm`.
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kilobytes| 1024 * kilobytes)
}

#[cfg(not(target_os = "linux"))]
fn resident_bytes() -> Option<u64> {
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
