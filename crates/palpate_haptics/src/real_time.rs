//! Real-time requests of the loop's thread to the operating system, and their results. Each request is made once, when the thread
//! starts; the loop also runs if all are denied.

use std::fmt;

/// Requests of a thread to the operating system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RealTimeRequest {
    /// Real-time priority, 1 to 99 on Linux (`SCHED_FIFO`): the thread preempts threads of lower priority as soon as it wakes.
    /// Without one, a busy machine wakes it milliseconds late. `None` requests no priority.
    pub priority: Option<u8>,
    /// Whether to lock the process's memory: fetching a swapped page from a disk takes ten ticks. Pages are locked at their first use,
    /// for the lifetime of the process.
    pub lock_memory: bool,
    /// Core to which the thread is pinned; `None` leaves the choice to the operating system.
    pub core: Option<usize>,
}

impl Default for RealTimeRequest {
    /// Priority 80, memory locked, any core.
    fn default() -> Self {
        Self { priority: Some(80), lock_memory: true, core: None }
    }
}

impl RealTimeRequest {
    /// No requests.
    pub const NONE: Self = Self { priority: None, lock_memory: false, core: None };

    /// Makes the requests for the calling thread. The loop's thread does this by itself; call it on other threads with the same
    /// needs.
    #[must_use]
    pub fn apply_to_current_thread(self) -> RealTimeReport {
        apply(self)
    }
}

/// Outcome of each request. It holds no heap memory and can be part of an event.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RealTimeReport {
    /// Outcome of the priority.
    pub priority: Outcome,
    /// Outcome of the locked memory.
    pub memory: Outcome,
    /// Outcome of the core.
    pub core: Outcome,
}

impl RealTimeReport {
    /// Whether no request was denied.
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

/// Outcome of a request.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Outcome {
    /// The request was not made.
    #[default]
    NotRequested,
    /// The request was granted.
    Granted,
    /// The request was denied.
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

/// Why a request was denied; the text names a remedy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum DenialReason {
    /// The user lacks the permission to raise priorities.
    NotPermitted,
    /// The limit of locked memory is this number of bytes. The process may later need more, and an allocation would then fail.
    MemoryLimit(u64),
    /// The core does not exist or is not available to the process, which has this number of cores.
    NoSuchCore(usize),
    /// The priority is out of range.
    OutOfRange,
    /// The operating system returned this error number.
    Os(i32),
    /// The request is not supported on this operating system.
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
                write!(f, "the process may run on {cores} cores, and this is none of them; give the number of another")
            }
            Self::OutOfRange => f.write_str("out of range; give 1 to 99"),
            Self::Os(number) => write!(f, "{}", std::io::Error::from_raw_os_error(*number)),
            Self::NotOffered => f.write_str("not offered by this operating system"),
        }
    }
}

/// Makes the requests in `request` for the calling thread.
pub(crate) fn apply(request: RealTimeRequest) -> RealTimeReport {
    let outcome = |result: Option<Result<(), DenialReason>>| match result {
        None => Outcome::NotRequested,
        Some(Ok(())) => Outcome::Granted,
        Some(Err(why)) => Outcome::Denied(why),
    };
    RealTimeReport {
        // The core first: a thread of high priority should not be moved.
        core: outcome(request.core.map(pin)),
        memory: outcome(request.lock_memory.then(platform::lock_memory)),
        priority: outcome(request.priority.map(platform::raise)),
    }
}

/// Touches the stack memory that a tick needs, to avoid page faults within a tick.
#[inline(never)]
pub(crate) fn touch_stack() {
    std::hint::black_box(&mut [0_u8; STACK_BYTES]);
}

/// Several times the need of a tick, and a small part of a thread's stack.
const STACK_BYTES: usize = 128 << 10;

fn pin(core: usize) -> Result<(), DenialReason> {
    let cores = core_affinity::get_core_ids().unwrap_or_default();
    let found = cores.iter().find(|id| id.id == core);
    match found {
        Some(&id) if core_affinity::set_for_current(id) => Ok(()),
        // The core exists, but cannot be pinned, as on macOS with Apple processors.
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

    /// Locks present and future pages, each at its first use. With a limit in place a later allocation would fail; the request is
    /// therefore not made.
    pub(super) fn lock_memory() -> Result<(), DenialReason> {
        let may_lock_all =
            capabilities(None).is_ok_and(|sets| sets.effective.contains(CapabilitySet::IPC_LOCK));
        let limit = getrlimit(Resource::Memlock).current;
        match limit {
            Some(bytes) if !may_lock_all => Err(DenialReason::MemoryLimit(bytes)),
            _ => {
                let flags = MlockAllFlags::CURRENT | MlockAllFlags::FUTURE | MlockAllFlags::ONFAULT;
                mlockall(flags).map_err(|error| match error {
                    // A limit applies despite the capability, as in a container.
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
        let result = set_current_thread_priority(ThreadPriority::Crossplatform(value));
        result.map_err(|_| DenialReason::NotPermitted)
    }

    pub(super) fn lock_memory() -> Result<(), DenialReason> {
        Err(DenialReason::NotOffered)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Applies the request on a new thread, which leaves the test's own unchanged.
    fn apply_on_new_thread(request: RealTimeRequest) -> RealTimeReport {
        std::thread::spawn(move || apply(request)).join().unwrap()
    }

    #[test]
    fn makes_no_request_that_is_not_set() {
        assert_eq!(apply_on_new_thread(RealTimeRequest::NONE), RealTimeReport::default());
        assert!(RealTimeReport::default().is_complete());
    }

    #[test]
    fn denies_impossible_requests_with_remedy() {
        let report = apply_on_new_thread(RealTimeRequest {
            priority: Some(0),
            core: Some(100_000),
            lock_memory: false,
        });
        assert_eq!(report.priority, Outcome::Denied(DenialReason::OutOfRange));
        assert!(matches!(report.core, Outcome::Denied(DenialReason::NoSuchCore(1..))), "{report}");
        assert!(!report.is_complete());
        let text = report.to_string();
        assert!(text.contains("priority refused: out of range; give 1 to 99"), "{text}");
        assert!(
            text.contains("locked memory not asked for") && text.contains("give the number of another"),
            "{text}"
        );
        let denied = Outcome::Denied(DenialReason::MemoryLimit(65_536)).to_string();
        assert!(denied.contains("65536 bytes") && denied.contains("memlock unlimited"));
    }

    /// The report agrees with the thread's actual scheduling policy, whether this machine grants the request or not.
    #[cfg(target_os = "linux")]
    #[test]
    fn granted_priority_is_in_force() {
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
        let has_outcome =
            matches!(report.priority, Outcome::Granted | Outcome::Denied(DenialReason::NotPermitted));
        assert!(has_outcome, "{report}");
    }
}
