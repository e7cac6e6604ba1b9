//! palpate's end of a bridge.

use super::counts::{BridgeMonitor, Counters, add_one};
use super::handshake::{Purpose, greet};
use super::link::{Link, MOST_IN_A_ROW, Received, of_device};
use super::order::Order;
use super::packet::{Body, EndReason, Packet, Welcome};
use super::{BridgeError, BridgeSettings};
use crate::clock::MonotonicClock;
use crate::{DeviceDescription, DeviceError, EmergencyStop, HapticDevice, Reading};
use glam::DVec3;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Time between two looks at the socket while a sample is due, ns.
const LOOK_NS: u64 = 50_000;

/// A device whose driver is in another process, see [`crate::bridge`].
///
/// * `read` gives the newest sample that has come. Where there is none newer than the last, it waits for one for half of the time
///   it is given, if the device is fast enough for one to be due; then it gives the last again, with the number that it had. Of
///   samples older than two periods it says [`DeviceError::TimedOut`].
/// * `write` sends the force and does not wait. It refuses what is not finite or beyond the largest force of the description.
/// * Once the session is over both say [`DeviceError::Disconnected`], until the device is closed and opened again; where the peer said
///   why, the first reading after it says that.
///
/// It reads the monotonic clock, so it is of little use in lock step: a peer lives in real time.
#[derive(Debug)]
pub struct BridgeDevice {
    settings: BridgeSettings,
    welcome: Welcome,
    monitor: BridgeMonitor,
    /// The number of the last force or stop of the session, shared with what stops the device from another thread.
    sent: Arc<AtomicU64>,
    session: Option<Session>,
}

/// What lasts from `open` to `close`.
#[derive(Debug)]
struct Session {
    link: Link,
    peer: SocketAddr,
    id: u64,
    sent: Arc<AtomicU64>,
    order: Order,
    newest: Option<Reading>,
    /// Whether `newest` has not been given yet.
    is_fresh: bool,
    /// When the newest sample was read from the socket, or the session began, ns.
    heard_ns: u64,
    is_over: bool,
    /// Why the peer ended it, until that has been told.
    ended: Option<EndReason>,
    clock: MonotonicClock,
}

impl BridgeDevice {
    /// The device of the peer at the settings' address: asks what it is, without beginning a session. So [`HapticDevice::describe`]
    /// tells the truth before `open`, which is when limits are made of it; `open` refuses a peer whose device has become another.
    ///
    /// # Errors
    /// [`BridgeError::NotLoopback`], [`BridgeError::Setting`], [`BridgeError::Socket`], [`BridgeError::NoPeer`],
    /// [`BridgeError::OtherVersion`], [`BridgeError::NotAPeer`].
    pub fn find(settings: BridgeSettings) -> Result<Self, BridgeError> {
        settings.validate()?;
        let address = settings.address;
        let monitor = BridgeMonitor::default();
        let link = Link::towards(address).map_err(|source| BridgeError::Socket { address, source })?;
        let (_, welcome) = greet(&link, &settings, Purpose::Ask, monitor.counters())?;
        Ok(Self { settings, welcome, monitor, sent: Arc::default(), session: None })
    }

    /// What reads the counts while a loop has the device.
    #[must_use]
    pub fn monitor(&self) -> BridgeMonitor {
        self.monitor.clone()
    }

    /// The time without a newer force after which the peer lets go.
    #[must_use]
    pub fn peer_watchdog(&self) -> Duration {
        Duration::from_micros(self.welcome.watchdog_us.into())
    }

    fn period_ns(&self) -> u64 {
        // The rate was checked when its packet came.
        (1e9 / self.welcome.rate_hz) as u64
    }

    fn silent_ns(&self) -> u64 {
        in_ns(self.settings.silent_after).max(3 * self.period_ns())
    }
}

/// What a device says of a session that its peer ended.
fn of_end(reason: EndReason) -> DeviceError {
    DeviceError::Unavailable(match reason {
        EndReason::OtherVersion => {
            "the peer speaks another version of the bridge's protocol; update the older end"
        }
        EndReason::Busy => "the peer serves another program; stop that one",
        EndReason::NoSession => {
            "the peer knows nothing of the session, as after a restart; a new one is begun"
        }
        EndReason::Silent => {
            "the peer heard no force for as long as its watchdog waits; give the machine less to do, or check the way to the peer"
        }
        EndReason::Closing => "the peer has ended; start it again",
        EndReason::DeviceFailed => "the peer's device failed; see what the peer says",
    })
}

fn in_ns(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}

impl Session {
    /// The number of the next force or stop.
    fn next(&self) -> u64 {
        self.sent.fetch_add(1, Ordering::AcqRel) + 1
    }

    fn send(&self, body: Body) -> Result<(), DeviceError> {
        let packet = Packet { session: self.id, number: self.next(), body };
        self.link.send(&packet, self.peer).map_err(|error| error.of_device())
    }

    /// Takes what has come, up to `until_ns`.
    fn receive(&mut self, until_ns: u64, counters: &Counters) -> Result<(), DeviceError> {
        for _ in 0..MOST_IN_A_ROW {
            match self.link.receive().map_err(|error| of_device(&error))? {
                Received::Nothing => return Ok(()),
                Received::Unreadable => add_one(&counters.corrupt),
                // There is nobody at the peer's port.
                Received::Undelivered => self.is_over = true,
                Received::Datagram { from, .. } if from != self.peer => add_one(&counters.foreign),
                Received::Datagram { packet: Err(_), .. } => add_one(&counters.corrupt),
                Received::Datagram { packet: Ok(packet), .. } if packet.session != self.id => {
                    add_one(&counters.other_session);
                }
                Received::Datagram { packet: Ok(packet), .. } => self.take(&packet, counters),
            }
            if self.clock.now_ns() >= until_ns {
                return Ok(());
            }
        }
        Ok(())
    }

    fn take(&mut self, packet: &Packet, counters: &Counters) {
        match &packet.body {
            Body::Sample(sampled) => {
                if counters.note(self.order.take(packet.number)) {
                    if self.is_fresh {
                        add_one(&counters.skipped);
                    }
                    let unshown = self.sent.load(Ordering::Acquire).saturating_sub(sampled.shown);
                    counters.unshown.store(unshown, Ordering::Relaxed);
                    (self.newest, self.is_fresh) = (Some(sampled.reading(packet.number)), true);
                    self.heard_ns = self.clock.now_ns();
                }
            }
            Body::End(reason) => (self.is_over, self.ended) = (true, Some(*reason)),
            // A welcome that was asked for twice.
            Body::Welcome(_) => {}
            // These are ours to send.
            Body::Hello | Body::Force(_) | Body::Stop => add_one(&counters.corrupt),
        }
    }
}

impl HapticDevice for BridgeDevice {
    /// What the peer said of itself when it was found.
    fn describe(&self) -> DeviceDescription {
        DeviceDescription {
            name: self.welcome.name.as_str().into(),
            workspace_m: self.welcome.workspace_m,
            max_force_n: self.welcome.max_force_n,
            rate_hz: self.welcome.rate_hz,
        }
    }

    fn open(&mut self) -> Result<(), DeviceError> {
        if self.session.is_some() {
            return Err(DeviceError::AlreadyOpen);
        }
        let peer = self.settings.address;
        let link = Link::towards(peer).map_err(|error| of_device(&error))?;
        let (id, welcome) = greet(&link, &self.settings, Purpose::Begin, self.monitor.counters())
            .map_err(|error| error.of_device())?;
        let clock = MonotonicClock::start();
        self.sent.store(0, Ordering::Release);
        let session = Session {
            link,
            peer,
            id,
            sent: Arc::clone(&self.sent),
            order: Order::default(),
            newest: None,
            is_fresh: false,
            heard_ns: clock.now_ns(),
            is_over: false,
            ended: None,
            clock,
        };
        let watchdog_us = self.welcome.watchdog_us;
        if (Welcome { watchdog_us, ..welcome }) != self.welcome {
            // The limits of whoever asked were made of the old description.
            let _ = session.send(Body::Stop);
            return Err(DeviceError::Protocol("the peer describes another device than it was found with"));
        }
        add_one(&self.monitor.counters().sessions);
        (self.welcome, self.session) = (welcome, Some(session));
        Ok(())
    }

    fn read(&mut self, within: Duration) -> Result<Reading, DeviceError> {
        let (period_ns, silent_ns, within_ns) = (self.period_ns(), self.silent_ns(), in_ns(within));
        let counters = self.monitor.counters();
        let session = self.session.as_mut().ok_or(DeviceError::NotOpen)?;
        let begun_ns = session.clock.now_ns();
        // A sample is due within that time, or a little later. The other half is the tick's.
        let is_due = period_ns <= within_ns.saturating_add(within_ns / 4);
        let patience_ns = if is_due { within_ns / 2 } else { 0 };
        let (until_ns, give_up_ns) =
            (begun_ns.saturating_add(within_ns), begun_ns.saturating_add(patience_ns));
        let (mut now_ns, mut failed) = (begun_ns, None);
        while !session.is_over {
            failed = session.receive(until_ns, counters).err();
            now_ns = session.clock.now_ns();
            if session.is_fresh || now_ns >= give_up_ns {
                break;
            }
            session.clock.sleep_until(give_up_ns.min(now_ns.saturating_add(LOOK_NS)));
        }
        let age_ns = now_ns.saturating_sub(session.heard_ns);
        if !session.is_over && !session.is_fresh && age_ns > silent_ns {
            session.is_over = true;
            add_one(&counters.silences);
            // Whether the peer can still hear it or not.
            let _ = session.send(Body::Stop);
        }
        if session.is_over {
            return Err(session.ended.take().map_or(DeviceError::Disconnected, of_end));
        }
        let is_recent =
            std::mem::take(&mut session.is_fresh) || age_ns <= period_ns.max(within_ns).saturating_mul(2);
        session.newest.filter(|_| is_recent).ok_or(failed.unwrap_or(DeviceError::TimedOut))
    }

    fn write(&mut self, force_n: DVec3) -> Result<(), DeviceError> {
        let session = self.session.as_ref().ok_or(DeviceError::NotOpen)?;
        if session.is_over {
            return Err(DeviceError::Disconnected);
        }
        if !is_within(force_n, self.welcome.max_force_n) {
            add_one(&self.monitor.counters().refused);
            return Err(DeviceError::Protocol("a force that is not finite, or beyond the device's largest"));
        }
        session.send(Body::Force(force_n))
    }

    fn emergency_stop(&mut self) -> Option<Box<dyn EmergencyStop>> {
        let session = self.session.as_ref()?;
        let link = session.link.try_clone().ok()?;
        Some(Box::new(BridgeStop {
            link,
            peer: session.peer,
            id: session.id,
            sent: Arc::clone(&session.sent),
        }))
    }

    fn close(&mut self) -> Result<(), DeviceError> {
        match self.session.take() {
            Some(session) if !session.is_over => session.send(Body::Stop),
            _ => Ok(()),
        }
    }
}

impl Drop for BridgeDevice {
    fn drop(&mut self) {
        let _ = self.close();
    }
}

/// Whether the device shows such a force. What turning it by a rotation adds to its length is no excess.
pub(super) fn is_within(force_n: DVec3, max_force_n: f64) -> bool {
    // Not a number is not at most anything.
    force_n.length() <= max_force_n * (1.0 + 1e-9)
}

/// Zero force from another thread. The session goes on: the loop begins its force anew when it goes on.
struct BridgeStop {
    link: Link,
    peer: SocketAddr,
    id: u64,
    sent: Arc<AtomicU64>,
}

impl EmergencyStop for BridgeStop {
    fn stop(&mut self) -> Result<(), DeviceError> {
        // Newer than all that the loop's thread has numbered, even if it has not sent it yet.
        let number = self.sent.fetch_add(1, Ordering::AcqRel) + 1;
        let packet = Packet { session: self.id, number, body: Body::Force(DVec3::ZERO) };
        self.link.send(&packet, self.peer).map_err(|error| error.of_device())
    }
}
