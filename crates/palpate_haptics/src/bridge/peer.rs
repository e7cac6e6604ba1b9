//! The vendor's end of a bridge.

use super::counts::{BridgeMonitor, add_one};
use super::device::is_within;
use super::guarded::Guarded;
use super::link::{Link, MOST_IN_A_ROW, Received, SendError};
use super::order::Order;
use super::packet::{Body, EndReason, Name, Packet, PacketError, Sampled, Welcome};
use super::{BridgeError, PeerSettings};
use crate::clock::MonotonicClock;
use crate::{DeviceError, HapticDevice};
use glam::DVec3;
use std::fmt;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// The reference peer: serves any [`HapticDevice`] to palpate in another process, see [`crate::bridge`].
///
/// [`BridgePeer::run`] turns it at the device's rate. Whoever has a rate of their own calls [`BridgePeer::turn`], with the time
/// on a clock of theirs: the peer itself reads none. At every turn it takes the newest force, shows it, reads the hand and sends
/// it. Between sessions the device has zero force. Dropping the peer leaves the device with zero force, and closed.
///
/// A device that fails, or panics, ends its session. It is told to show zero force at every turn from then on, whether palpate is
/// there or not; one that has not taken it for 100 ms is closed. It is opened anew when a session is to begin.
pub struct BridgePeer {
    device: Guarded,
    link: Link,
    address: SocketAddr,
    welcome: Welcome,
    watchdog: Duration,
    monitor: BridgeMonitor,
    session: Option<Served>,
    /// Number and sender of the last session that is over. It is never taken up again.
    ended: Option<(u64, SocketAddr)>,
    /// The force to be shown, N.
    force_n: DVec3,
    /// The time of the last turn.
    now: Duration,
    is_closed: bool,
}

/// The session that is served.
#[derive(Clone, Copy, Debug)]
struct Served {
    id: u64,
    palpate: SocketAddr,
    order: Order,
    /// When the newest force came, or the session began.
    heard: Duration,
    /// The number of the force that is shown.
    shown: u64,
    /// The number of the last sample.
    sampled: u64,
}

impl BridgePeer {
    /// Opens `device`, at zero force, and listens for palpate.
    ///
    /// # Errors
    /// [`BridgeError::NotLoopback`], [`BridgeError::Setting`], [`BridgeError::Description`], [`BridgeError::Socket`],
    /// [`BridgeError::Device`].
    pub fn bind(settings: PeerSettings, device: Box<dyn HapticDevice>) -> Result<Self, BridgeError> {
        settings.validate()?;
        let description = device.describe();
        description.validate()?;
        let welcome = Welcome {
            name: Name::new(&description.name),
            workspace_m: description.workspace_m,
            max_force_n: description.max_force_n,
            rate_hz: description.rate_hz,
            watchdog_us: u32::try_from(settings.watchdog.as_micros()).unwrap_or(u32::MAX),
        };
        Packet { session: 0, number: 0, body: Body::Welcome(welcome) }
            .encode(&mut [0; super::packet::MAX_SIZE])
            .map_err(BridgeError::Description)?;
        let of_socket = |source| BridgeError::Socket { address: settings.address, source };
        let link = Link::bind(settings.address).map_err(of_socket)?;
        let address = link.address().map_err(of_socket)?;
        let device = Guarded::open(device).map_err(BridgeError::Device)?;
        Ok(Self {
            device,
            link,
            address,
            welcome,
            watchdog: settings.watchdog,
            monitor: BridgeMonitor::default(),
            session: None,
            ended: None,
            force_n: DVec3::ZERO,
            now: Duration::ZERO,
            is_closed: false,
        })
    }

    /// Where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The force that it shows, or will at the next turn, N, the device's frame; zero where there is no session.
    #[must_use]
    pub fn force_n(&self) -> DVec3 {
        self.force_n
    }

    /// The number of the force that it shows; 0 before the first of a session, and where there is none.
    #[must_use]
    pub fn forces_written(&self) -> u64 {
        self.session.map_or(0, |session| session.shown)
    }

    /// The session that it serves.
    #[must_use]
    pub fn session(&self) -> Option<u64> {
        self.session.map(|session| session.id)
    }

    /// What reads the counts while another thread turns it.
    #[must_use]
    pub fn monitor(&self) -> BridgeMonitor {
        self.monitor.clone()
    }

    /// Turns it at its device's rate until `stop` is set, then tells palpate that the session is over, and closes the device.
    pub fn run(&mut self, stop: &AtomicBool) {
        let clock = MonotonicClock::start();
        let (begun_ns, period) = (clock.now_ns(), self.period());
        let mut due_ns = begun_ns;
        while !stop.load(Ordering::Acquire) {
            self.advance(Duration::from_nanos(clock.now_ns() - begun_ns));
            // Turns that are late are left out, never made up by a burst.
            due_ns = (due_ns + period.as_nanos() as u64).max(clock.now_ns());
            clock.sleep_until(due_ns);
        }
        self.close();
    }

    /// One turn, at the time `now` on any clock that only goes forward.
    pub fn advance(&mut self, now: Duration) {
        self.receive(now);
        self.reply();
    }

    /// The first half of a turn: lets go if palpate has been silent for too long, then takes what has come. Whether a newer force
    /// is to be shown.
    pub fn receive(&mut self, now: Duration) -> bool {
        self.now = now;
        // Before anything is read: after a pause of the peer itself, what waits is old.
        if self.session.is_some_and(|session| now.saturating_sub(session.heard) > self.watchdog) {
            add_one(&self.monitor.counters().silences);
            self.end(EndReason::Silent);
        }
        let mut has_force = false;
        for _ in 0..MOST_IN_A_ROW {
            match self.link.receive() {
                Ok(Received::Nothing) | Err(_) => break,
                Ok(Received::Undelivered) => {}
                Ok(Received::Unreadable) => add_one(&self.monitor.counters().corrupt),
                Ok(Received::Datagram { from, packet: Ok(packet), .. }) => {
                    if self.take(&packet, from, now) {
                        if has_force {
                            add_one(&self.monitor.counters().skipped);
                        }
                        has_force = true;
                    }
                }
                Ok(Received::Datagram { from, packet: Err(error), header }) => {
                    add_one(&self.monitor.counters().corrupt);
                    let hello = header.filter(|header| header.is_hello());
                    if let (Some(hello), PacketError::Version(_)) = (hello, error) {
                        self.tell(from, hello.session, hello.number, Body::End(EndReason::OtherVersion));
                    }
                }
            }
        }
        has_force
    }

    /// The second half of a turn: shows the force, reads the hand and sends it. A device that has failed is shown zero force.
    pub fn reply(&mut self) {
        if self.is_closed {
            return;
        }
        if !self.device.is_ready() {
            return self.device.zero(self.now);
        }
        let written = self.device.write(self.force_n);
        let reading = self.device.read(self.period());
        let failed = |error: DeviceError| error != DeviceError::TimedOut;
        if written.is_err_and(failed) || reading.is_err_and(failed) {
            self.device.fail();
            return self.end(EndReason::DeviceFailed);
        }
        let Some(session) = self.session.as_mut() else {
            return self.device.note_zero(written, self.now);
        };
        if written.is_ok() {
            session.shown = session.order.newest();
        }
        let Ok(reading) = reading else { return };
        session.sampled += 1;
        let sampled = Sampled {
            position_m: reading.position_m,
            orientation: reading.orientation,
            velocity_m_per_s: reading.velocity_m_per_s,
            buttons: reading.buttons,
            shown: session.shown,
        };
        let packet = Packet { session: session.id, number: session.sampled, body: Body::Sample(sampled) };
        if let Err(SendError::Packet) = self.link.send(&packet, session.palpate) {
            add_one(&self.monitor.counters().refused);
        }
    }

    /// Tells palpate that the session is over, and leaves the device with zero force, and closed. It answers nobody any more.
    pub fn close(&mut self) {
        if std::mem::replace(&mut self.is_closed, true) {
            return;
        }
        self.end(EndReason::Closing);
        // One that cannot be zeroed any more is closed all the same.
        self.device.close();
    }

    fn period(&self) -> Duration {
        Duration::from_secs_f64(1.0 / self.welcome.rate_hz)
    }

    /// Whether it was a newer force.
    fn take(&mut self, packet: &Packet, from: SocketAddr, now: Duration) -> bool {
        if self.is_closed {
            return false;
        }
        if let Body::Hello = packet.body {
            self.greet(packet, from, now);
            return false;
        }
        let counters = self.monitor.counters();
        let Some(session) = self.session.as_mut().filter(|session| session.id == packet.session) else {
            add_one(&counters.other_session);
            if let Body::Force(_) = packet.body {
                self.tell(from, packet.session, packet.number, Body::End(EndReason::NoSession));
            }
            return false;
        };
        if from != session.palpate {
            add_one(&counters.foreign);
            return false;
        }
        match packet.body {
            Body::Force(force_n) => {
                if !is_within(force_n, self.welcome.max_force_n) {
                    add_one(&counters.refused);
                    return false;
                }
                let is_newer = counters.note(session.order.take(packet.number));
                if is_newer {
                    (session.heard, self.force_n) = (now, force_n);
                }
                is_newer
            }
            // It may have been overtaken by an older force, and is right all the same.
            Body::Stop => {
                self.let_go();
                false
            }
            // These are ours to send.
            Body::Hello | Body::Welcome(_) | Body::Sample(_) | Body::End(_) => {
                add_one(&counters.corrupt);
                false
            }
        }
    }

    /// Answers a hello.
    fn greet(&mut self, hello: &Packet, from: SocketAddr, now: Duration) {
        let Packet { session: id, number, .. } = *hello;
        let is_known = self.session.is_some_and(|session| (session.id, session.palpate) == (id, from));
        if id != 0 && !is_known {
            if self.session.is_some() {
                return self.tell(from, id, number, Body::End(EndReason::Busy));
            }
            // A hello that came late, or twice. Forces that are still under way would count as new.
            if self.ended == Some((id, from)) {
                add_one(&self.monitor.counters().other_session);
                return self.tell(from, id, number, Body::End(EndReason::NoSession));
            }
            if !self.device.is_ready() && self.device.reopen().is_err() {
                return self.tell(from, id, number, Body::End(EndReason::DeviceFailed));
            }
            self.device.begin();
            add_one(&self.monitor.counters().sessions);
            let order = Order::default();
            self.session = Some(Served { id, palpate: from, order, heard: now, shown: 0, sampled: 0 });
        }
        self.tell(from, id, number, Body::Welcome(self.welcome));
    }

    fn tell(&self, to: SocketAddr, session: u64, number: u64, body: Body) {
        // What does not arrive is asked for again, or found out by silence.
        let _ = self.link.send(&Packet { session, number, body }, to);
    }

    /// Zero force, and palpate is told why.
    fn end(&mut self, reason: EndReason) {
        if let Some(session) = self.session {
            self.tell(session.palpate, session.id, 0, Body::End(reason));
        }
        self.let_go();
    }

    /// Zero force, now.
    fn let_go(&mut self) {
        if let Some(session) = self.session.take() {
            self.ended = Some((session.id, session.palpate));
        }
        self.force_n = DVec3::ZERO;
        // If it fails, the next turn tries again.
        self.device.zero(self.now);
    }
}

impl Drop for BridgePeer {
    fn drop(&mut self) {
        self.close();
    }
}

impl fmt::Debug for BridgePeer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("BridgePeer")
            .field("address", &self.address)
            .field("session", &self.session)
            .field("force_n", &self.force_n)
            .finish_non_exhaustive()
    }
}
