//! What the loop's thread asks of the operating system, and what it gets. Each is tried once, when the thread starts; the
//! loop runs without any of them.

use std::fmt;

/// What the loop's thread asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RealTimeRequest {
    /// The real-time priority, 1 to 99 on Linux (`SCHED_FIFO`): the thread runs before all others as soon as it wakes. Without,
    /// a busy machine wakes it milliseconds late. `None` asks for none.
    pub priority: Option<u8>,
    /// That the process's memory is never swapped out: a page that has to be fetched from a disk costs ten ticks. Pages are
    /// locked when they are first used, for as long as the process lives.
    pub lock_memory: bool,
    /// The core that it runs on and no other; `None` leaves that to the operating system.
    pub core: Option<usize>,
}

impl Default for RealTimeRequest {
    /// Priority 80, memory locked, any core.
    fn default() -> Self {
        Self { priority: Some(80), lock_memory: true, core: None }
    }
}

impl RealTimeRequest {
    /// Asks for nothing.
    pub const NONE: Self = Self { priority: None, lock_memory: false, core: None };

    /// Asks for everything in it, for the calling thread. The loop's thread does so when it starts; this is for other threads
    /// that are to have the same.
    #[must_use]
    pub fn apply_to_current_thread(self) -> RealTimeReport {
        apply(self)
    }
}

/// What came of each request. It carries no heap, so it can be part of an event.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RealTimeReport {
    /// The priority.
    pub priority: Outcome,
    /// The memory.
    pub memory: Outcome,
    /// The core.
    pub core: Outcome,
}

impl RealTimeReport {
    /// Whether nothing that was asked for was refused.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        [self.priority, self.memory, self.core].iter().all(|what| !matches!(what, Outcome::Denied(_)))
    }
}

impl fmt::Display for RealTimeReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { priority, memory, core } = self;
        write!(f, "real-time priority {priority}; locked memory {memory}; core {core}")
    }
}

/// What came of a request.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Outcome {
    /// It was not made.
    #[default]
    NotRequested,
    /// It was granted.
    Granted,
    /// It was not.
    Denied(DenialReason),
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotRequested => f.write_str("not asked for"),
            Self::Granted => f.write_str("granted"),
            Self::Denied(why) => write!(f, "refused: {why}"),
        }
    }
}

/// Why a request was refused, and how it can be allowed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum DenialReason {
    /// The user may not raise priorities.
    NotPermitted,
    /// So many bytes of memory may be locked, and the process may come to need more: asking for it would let it fail later.
    MemoryLimit(u64),
    /// There is no such core, or the process may not run on it; there are so many.
    NoSuchCore(usize),
    /// The priority is out of range.
    OutOfRange,
    /// The operating system gave this error number.
    Os(i32),
    /// This operating system offers no such thing to this library.
    NotOffered,
}

impl fmt::Display for DenialReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotPermitted => f.write_str(
                "not permitted; allow it by a line \"USER - rtprio 95\" in /etc/security/limits.conf and a new login, or by \
                 \"setcap cap_sys_nice=ep PROGRAM\"",
            ),
            Self::MemoryLimit(bytes) => write!(
                f,
                "only {bytes} bytes may be locked; allow more by a line \"USER - memlock unlimited\" in \
                 /etc/security/limits.conf and a new login, or by \"setcap cap_ipc_lock=ep PROGRAM\""
            ),
            Self::NoSuchCore(cores) => {
                write!(f, "the process may run on {cores} cores, and that is none of them; give the number of another")
            }
            Self::OutOfRange => f.write_str("out of range; give 1 to 99"),
            Self::Os(number) => write!(f, "{}", std::io::Error::from_raw_os_error(*number)),
            Self::NotOffered => f.write_str("not offered by this operating system"),
        }
    }
}

/// Asks for everything in `wanted`, for the calling thread.
pub(crate) fn apply(wanted: RealTimeRequest) -> RealTimeReport {
    let outcome = |asked: Option<Result<(), DenialReason>>| match asked {
        None => Outcome::NotRequested,
        Some(Ok(())) => Outcome::Granted,
        Some(Err(why)) => Outcome::Denied(why),
    };
    RealTimeReport {
        // The core first: a thread of high priority should not be moved.
        core: outcome(wanted.core.map(pin)),
        memory: outcome(wanted.lock_memory.then(platform::lock_memory)),
        priority: outcome(wanted.priority.map(platform::raise)),
    }
}

/// Touches the memory that a tick needs on the stack, so that no page of it is fetched within one.
#[inline(never)]
pub(crate) fn touch_stack() {
    std::hint::black_box(&mut [0_u8; STACK_BYTES]);
}

/// Several times what a tick needs, and little of what a thread has.
const STACK_BYTES: usize = 128 << 10;

fn pin(core: usize) -> Result<(), DenialReason> {
    let cores = core_affinity::get_core_ids().unwrap_or_default();
    let found = cores.iter().find(|id| id.id == core);
    match found {
        Some(&id) if core_affinity::set_for_current(id) => Ok(()),
        // The core is there; macOS on its own processors offers none.
        Some(_) => Err(DenialReason::NotOffered),
        None => Err(DenialReason::NoSuchCore(cores.len())),
    }
}

#[cfg(target_os = "linux")]
mod platform {
    use super::DenialReason;
    use rustix::io::Errno;
    use rustix::mm::{MlockAllFlags, mlockall};
    use rustix::process::{Resource, getrlimit};
    use rustix::thread::{CapabilitySet, capabilities};
    use thread_priority::{
        Error, RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
        set_thread_priority_and_policy, thread_native_id,
    };

    const EPERM: i32 = 1;

    pub(super) fn raise(priority: u8) -> Result<(), DenialReason> {
        let value = ThreadPriorityValue::try_from(priority).map_err(|_| DenialReason::OutOfRange)?;
        if priority == 0 {
            return Err(DenialReason::OutOfRange);
        }
        let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
        let priority = ThreadPriority::Crossplatform(value);
        set_thread_priority_and_policy(thread_native_id(), priority, policy).map_err(|error| match error {
            Error::OS(EPERM) => DenialReason::NotPermitted,
            Error::OS(number) => DenialReason::Os(number),
            Error::Priority(_) | Error::PriorityNotInRange(_) => DenialReason::OutOfRange,
            Error::Ffi(_) => DenialReason::NotOffered,
        })
    }

    /// Locks what there is and what will be, each page when it is first used. Under a limit a later allocation would fail, so
    /// that it is not asked for.
    pub(super) fn lock_memory() -> Result<(), DenialReason> {
        let may_lock_all =
            capabilities(None).is_ok_and(|sets| sets.effective.contains(CapabilitySet::IPC_LOCK));
        let limit = getrlimit(Resource::Memlock).current;
        match limit {
            Some(bytes) if !may_lock_all => Err(DenialReason::MemoryLimit(bytes)),
            _ => {
                let flags = MlockAllFlags::CURRENT | MlockAllFlags::FUTURE | MlockAllFlags::ONFAULT;
                mlockall(flags).map_err(|error| match error {
                    // The limit holds all the same, as in a container.
                    Errno::PERM | Errno::NOMEM => DenialReason::MemoryLimit(limit.unwrap_or(0)),
                    error => DenialReason::Os(error.raw_os_error()),
                })
            }
        }
    }
}

#[cfg(not(target_os = "linux"))]
mod platform {
    use super::DenialReason;
    use thread_priority::{ThreadPriority, ThreadPriorityValue, set_current_thread_priority};

    pub(super) fn raise(priority: u8) -> Result<(), DenialReason> {
        let value = ThreadPriorityValue::try_from(priority).map_err(|_| DenialReason::OutOfRange)?;
        let asked = set_current_thread_priority(ThreadPriority::Crossplatform(value));
        asked.map_err(|_| DenialReason::NotPermitted)
    }

    pub(super) fn lock_memory() -> Result<(), DenialReason> {
        Err(DenialReason::NotOffered)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On a thread of its own, so that the test's own stays as it is.
    fn asked(wanted: RealTimeRequest) -> RealTimeReport {
        std::thread::spawn(move || apply(wanted)).join().unwrap()
    }

    #[test]
    fn what_is_not_asked_for_is_not_tried() {
        assert_eq!(asked(RealTimeRequest::NONE), RealTimeReport::default());
        assert!(RealTimeReport::default().is_complete());
    }

    #[test]
    fn what_cannot_be_is_refused_with_a_remedy() {
        let report = asked(RealTimeRequest { priority: Some(0), core: Some(100_000), lock_memory: false });
        assert_eq!(report.priority, Outcome::Denied(DenialReason::OutOfRange));
        assert!(matches!(report.core, Outcome::Denied(DenialReason::NoSuchCore(1..))), "{report}");
        assert!(!report.is_complete());
        let said = report.to_string();
        assert!(said.contains("priority refused: out of range; give 1 to 99"), "{said}");
        assert!(
            said.contains("locked memory not asked for") && said.contains("give the number of another"),
            "{said}"
        );
        let refused = Outcome::Denied(DenialReason::MemoryLimit(65_536)).to_string();
        assert!(refused.contains("65536 bytes") && refused.contains("memlock unlimited"));
    }

    /// Whatever this machine grants, what it says is what is so.
    #[cfg(target_os = "linux")]
    #[test]
    fn what_is_granted_is_in_force() {
        let (report, policy) = std::thread::spawn(|| {
            let report =
                apply(RealTimeRequest { core: Some(0), lock_memory: false, ..RealTimeRequest::default() });
            (report, thread_priority::thread_schedule_policy().unwrap())
        })
        .join()
        .unwrap();
        let fifo = thread_priority::ThreadSchedulePolicy::Realtime(
            thread_priority::RealtimeThreadSchedulePolicy::Fifo,
        );
        assert_eq!(report.priority == Outcome::Granted, policy == fifo, "{report}");
        let is_told =
            matches!(report.priority, Outcome::Granted | Outcome::Denied(DenialReason::NotPermitted));
        assert!(is_told, "{report}");
    }
}
