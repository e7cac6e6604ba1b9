//! The peer: the vendor's end of a bridge.

use super::force_limit::is_within;
use super::guarded_device::GuardedDevice;
use super::monitor::{BridgeMonitor, add_one};
use super::packet::{Body, EndReason, Name, Packet, PacketError, Sampled, Welcome};
use super::packet_order::PacketOrder;
use super::socket::{MAX_RECEIVED, PacketSocket, Received, SendError};
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
/// [`BridgePeer::run`] serves at the device's rate. To serve at another rate, call [`BridgePeer::advance`] with the time of any
/// monotonic clock; the peer itself then reads no clock. Each cycle receives the newest force, applies it, reads the hand and sends the
/// sample. Between sessions the device is at zero force. Dropping the peer sets zero force and closes the device.
///
/// A failure or panic of the device ends the session. The peer then writes zero force in every cycle, with or without palpate, and
/// closes the device if that fails for 100 ms. The next session reopens it.
pub struct BridgePeer {
    device: GuardedDevice,
    socket: PacketSocket,
    address: SocketAddr,
    welcome: Welcome,
    watchdog: Duration,
    monitor: BridgeMonitor,
    session: Option<Served>,
    /// Number and sender of the last session that has ended; it is never resumed.
    ended: Option<(u64, SocketAddr)>,
    /// Force to be applied, N.
    force_n: DVec3,
    /// Time of the last cycle.
    now: Duration,
    is_closed: bool,
}

/// The session being served.
#[derive(Clone, Copy, Debug)]
struct Served {
    id: u64,
    palpate: SocketAddr,
    order: PacketOrder,
    /// Time when the newest force was received, or the session started.
    received: Duration,
    /// Number of the applied force.
    shown: u64,
    /// Number of the last sample.
    sampled: u64,
}

impl BridgePeer {
    /// Opens `device` at zero force and listens for palpate.
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
        let socket_error = |source| BridgeError::Socket { address: settings.address, source };
        let socket = PacketSocket::bind(settings.address).map_err(socket_error)?;
        let address = socket.address().map_err(socket_error)?;
        let device = GuardedDevice::open(device).map_err(BridgeError::Device)?;
        Ok(Self {
            device,
            socket,
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

    /// Address and port on which the peer listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The force applied now or in the next cycle, N, device frame; zero without a session.
    #[must_use]
    pub fn force_n(&self) -> DVec3 {
        self.force_n
    }

    /// Number of the applied force; 0 before the first of a session, and without a session.
    #[must_use]
    pub fn forces_written(&self) -> u64 {
        self.session.map_or(0, |session| session.shown)
    }

    /// Number of the session being served.
    #[must_use]
    pub fn session(&self) -> Option<u64> {
        self.session.map(|session| session.id)
    }

    /// Reader of the counts, usable while another thread runs the peer.
    #[must_use]
    pub fn monitor(&self) -> BridgeMonitor {
        self.monitor.clone()
    }

    /// Serves at the device's rate until `stop` is set; then reports the end of the session to palpate and closes the device.
    pub fn run(&mut self, stop: &AtomicBool) {
        let clock = MonotonicClock::start();
        let (start_ns, period) = (clock.now_ns(), self.period());
        let mut due_ns = start_ns;
        while !stop.load(Ordering::Acquire) {
            self.advance(Duration::from_nanos(clock.now_ns() - start_ns));
            // Missed cycles are skipped, never made up by a burst.
            due_ns = (due_ns + period.as_nanos() as u64).max(clock.now_ns());
            clock.sleep_until(due_ns);
        }
        self.close();
    }

    /// Runs one cycle at time `now` of any monotonic clock.
    pub fn advance(&mut self, now: Duration) {
        self.receive(now);
        self.reply();
    }

    /// The first half of a cycle: sets zero force if the watchdog has expired, then processes the received packets. Returns whether a
    /// newer force is to be applied.
    pub fn receive(&mut self, now: Duration) -> bool {
        self.now = now;
        // Before receiving: after a pause of the peer itself, waiting packets are old.
        if self.session.is_some_and(|session| now.saturating_sub(session.received) > self.watchdog) {
            add_one(&self.monitor.counters().silences);
            self.end(EndReason::Silent);
        }
        let mut has_force = false;
        for _ in 0..MAX_RECEIVED {
            match self.socket.receive() {
                Ok(Received::Nothing) | Err(_) => break,
                Ok(Received::Undelivered) => {}
                Ok(Received::Unreadable) => add_one(&self.monitor.counters().corrupt),
                Ok(Received::Datagram { from, packet: Ok(packet), .. }) => {
                    if self.process(&packet, from, now) {
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
                        self.send(from, hello.session, hello.number, Body::End(EndReason::OtherVersion));
                    }
                }
            }
        }
        has_force
    }

    /// The second half of a cycle: applies the force, reads the hand and sends the sample. A failed device gets zero force.
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
        if let Err(SendError::Packet) = self.socket.send(&packet, session.palpate) {
            add_one(&self.monitor.counters().rejected);
        }
    }

    /// Reports the end of the session to palpate, sets zero force and closes the device. The peer sends no replies afterwards.
    pub fn close(&mut self) {
        if std::mem::replace(&mut self.is_closed, true) {
            return;
        }
        self.end(EndReason::Closing);
        // Also closes a device that rejects zero force.
        self.device.close();
    }

    fn period(&self) -> Duration {
        Duration::from_secs_f64(1.0 / self.welcome.rate_hz)
    }

    /// Processes a packet; returns whether it was a newer force.
    fn process(&mut self, packet: &Packet, from: SocketAddr, now: Duration) -> bool {
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
                self.send(from, packet.session, packet.number, Body::End(EndReason::NoSession));
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
                    add_one(&counters.rejected);
                    return false;
                }
                let is_newer = counters.note(session.order.note(packet.number));
                if is_newer {
                    (session.received, self.force_n) = (now, force_n);
                }
                is_newer
            }
            // Valid in any order: a stop may arrive before an older force.
            Body::Stop => {
                self.end_session();
                false
            }
            // Only the peer sends these.
            Body::Hello | Body::Welcome(_) | Body::Sample(_) | Body::End(_) => {
                add_one(&counters.corrupt);
                false
            }
        }
    }

    /// Replies to a hello.
    fn greet(&mut self, hello: &Packet, from: SocketAddr, now: Duration) {
        let Packet { session: id, number, .. } = *hello;
        let is_served = self.session.is_some_and(|session| (session.id, session.palpate) == (id, from));
        if id != 0 && !is_served {
            if self.session.is_some() {
                return self.send(from, id, number, Body::End(EndReason::Busy));
            }
            // A late or duplicate hello. Forces still in transit would count as new in a resumed session.
            if self.ended == Some((id, from)) {
                add_one(&self.monitor.counters().other_session);
                return self.send(from, id, number, Body::End(EndReason::NoSession));
            }
            if !self.device.is_ready() && self.device.reopen().is_err() {
                return self.send(from, id, number, Body::End(EndReason::DeviceFailed));
            }
            self.device.start_session();
            add_one(&self.monitor.counters().sessions);
            let order = PacketOrder::default();
            self.session = Some(Served { id, palpate: from, order, received: now, shown: 0, sampled: 0 });
        }
        self.send(from, id, number, Body::Welcome(self.welcome));
    }

    fn send(&self, to: SocketAddr, session: u64, number: u64, body: Body) {
        // A lost packet leads to a repeated hello or a timeout.
        let _ = self.socket.send(&Packet { session, number, body }, to);
    }

    /// Ends the session with zero force and reports the reason to palpate.
    fn end(&mut self, reason: EndReason) {
        if let Some(session) = self.session {
            self.send(session.palpate, session.id, 0, Body::End(reason));
        }
        self.end_session();
    }

    /// Ends the session and sets zero force.
    fn end_session(&mut self) {
        if let Some(session) = self.session.take() {
            self.ended = Some((session.id, session.palpate));
        }
        self.force_n = DVec3::ZERO;
        // On failure the next cycle tries again.
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
