//! The monotonic clock, and waiting for a point in time. Its users are the runner with watchdog and baseline thread, and the bridge,
//! whose other end runs in real time.

#[cfg(target_os = "linux")]
mod platform {
    use rustix::thread::clock_nanosleep_absolute;
    use rustix::time::{ClockId, Timespec, clock_gettime};

    const NS_PER_S: u64 = 1_000_000_000;

    /// `CLOCK_MONOTONIC`.
    #[derive(Clone, Copy, Debug)]
    pub(crate) struct MonotonicClock;

    impl MonotonicClock {
        pub(crate) fn start() -> Self {
            Self
        }

        /// Current time, ns.
        pub(crate) fn now_ns(self) -> u64 {
            let now = clock_gettime(ClockId::Monotonic);
            now.tv_sec.unsigned_abs() * NS_PER_S + now.tv_nsec.unsigned_abs()
        }

        /// Waits until `deadline_ns`; returns at once if that has passed.
        pub(crate) fn sleep_until(self, deadline_ns: u64) {
            let (Ok(tv_sec), Ok(tv_nsec)) =
                ((deadline_ns / NS_PER_S).try_into(), (deadline_ns % NS_PER_S).try_into())
            else {
                return;
            };
            // A signal may end the wait early.
            while self.now_ns() < deadline_ns {
                let _ = clock_nanosleep_absolute(ClockId::Monotonic, &Timespec { tv_sec, tv_nsec });
            }
        }
    }
}

#[cfg(not(target_os = "linux"))]
mod platform {
    use std::time::{Duration, Instant};

    /// The standard library's monotonic clock, counted from its construction.
    #[derive(Clone, Copy, Debug)]
    pub(crate) struct MonotonicClock(Instant);

    #[expect(clippy::disallowed_methods, reason = "this is the runner's clock")]
    impl MonotonicClock {
        pub(crate) fn start() -> Self {
            Self(Instant::now())
        }

        /// Current time, ns.
        pub(crate) fn now_ns(self) -> u64 {
            u64::try_from(self.0.elapsed().as_nanos()).unwrap_or(u64::MAX)
        }

        /// Waits until `deadline_ns`; returns at once if that has passed.
        pub(crate) fn sleep_until(self, deadline_ns: u64) {
            loop {
                let now = self.now_ns();
                if now >= deadline_ns {
                    return;
                }
                std::thread::sleep(Duration::from_nanos(deadline_ns - now));
            }
        }
    }
}

pub(crate) use platform::MonotonicClock;
