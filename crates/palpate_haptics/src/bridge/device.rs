//! palpate's end of a bridge.

use super::force_limit::is_within;
use super::handshake::{Purpose, greet};
use super::monitor::{BridgeMonitor, Counters, add_one};
use super::packet::{Body, EndReason, Packet, Welcome};
use super::packet_order::PacketOrder;
use super::socket::{MAX_RECEIVED, PacketSocket, Received, device_error};
use super::{BridgeError, BridgeSettings};
use crate::clock::MonotonicClock;
use crate::{DeviceDescription, DeviceError, EmergencyStop, HapticDevice, Reading};
use glam::DVec3;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Time between two polls of the socket while a sample is due, ns.
const POLL_NS: u64 = 50_000;

/// A device whose driver runs in another process, see [`crate::bridge`].
///
/// * `read` returns the newest received sample. If no sample is newer than the last and one is due, it waits up to half of the given
///   time, and then returns the last sample again with the same sequence number. If the newest sample is older than two periods, it
///   returns [`DeviceError::TimedOut`].
/// * `write` sends the force without waiting. It rejects a force that is not finite or above the description's maximum.
/// * After the end of the session both return [`DeviceError::Disconnected`] until the device is closed and opened again. If the peer
///   gave a reason for the end, the first `read` returns that instead.
///
/// The device reads the monotonic clock. It is of little use in lock step, because a peer runs in real time.
#[derive(Debug)]
pub struct BridgeDevice {
    settings: BridgeSettings,
    welcome: Welcome,
    monitor: BridgeMonitor,
    /// Number of the last force or stop of the session, shared with the emergency stop on another thread.
    sent: Arc<AtomicU64>,
    session: Option<Session>,
}

/// State from `open` to `close`.
#[derive(Debug)]
struct Session {
    socket: PacketSocket,
    peer: SocketAddr,
    id: u64,
    sent: Arc<AtomicU64>,
    order: PacketOrder,
    newest: Option<Reading>,
    /// Whether `read` has not returned `newest` yet.
    is_fresh: bool,
    /// Time when the newest sample was received, or the session started, ns.
    received_ns: u64,
    is_over: bool,
    /// Reason given by the peer for the end, until `read` has returned it.
    ended: Option<EndReason>,
    clock: MonotonicClock,
}

impl BridgeDevice {
    /// Requests the description of the peer's device, without starting a session. [`HapticDevice::describe`] is therefore valid before
    /// `open`, when the loop's limits are derived from it. `open` rejects a peer whose description has changed.
    ///
    /// # Errors
    /// [`BridgeError::NotLoopback`], [`BridgeError::Setting`], [`BridgeError::Socket`], [`BridgeError::NoPeer`],
    /// [`BridgeError::OtherVersion`], [`BridgeError::NotAPeer`].
    pub fn find(settings: BridgeSettings) -> Result<Self, BridgeError> {
        settings.validate()?;
        let address = settings.address;
        let monitor = BridgeMonitor::default();
        let socket = PacketSocket::to(address).map_err(|source| BridgeError::Socket { address, source })?;
        let (_, welcome) = greet(&socket, &settings, Purpose::Describe, monitor.counters())?;
        Ok(Self { settings, welcome, monitor, sent: Arc::default(), session: None })
    }

    /// Reader of the counts, usable while a loop owns the device.
    #[must_use]
    pub fn monitor(&self) -> BridgeMonitor {
        self.monitor.clone()
    }

    /// Time without a newer force after which the peer sets zero force.
    #[must_use]
    pub fn peer_watchdog(&self) -> Duration {
        Duration::from_micros(self.welcome.watchdog_us.into())
    }

    fn period_ns(&self) -> u64 {
        // Parsing the packet has checked the range of the rate.
        (1e9 / self.welcome.rate_hz) as u64
    }

    fn silent_ns(&self) -> u64 {
        in_ns(self.settings.silent_after).max(3 * self.period_ns())
    }
}

/// Error of the device for a session that its peer ended.
fn end_error(reason: EndReason) -> DeviceError {
    DeviceError::Unavailable(match reason {
        EndReason::OtherVersion => {
            "the peer uses another version of the bridge's protocol; update the older end"
        }
        EndReason::Busy => "the peer serves another program; stop that one",
        EndReason::NoSession => "the peer has no such session, as after a restart; a new one follows",
        EndReason::Silent => {
            "the peer received no force within its watchdog time; reduce the load of the machine, or check the connection"
        }
        EndReason::Closing => "the peer has ended; start it again",
        EndReason::DeviceFailed => "the peer's device failed; check the peer's output",
    })
}

fn in_ns(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}

impl Session {
    /// Number of the next force or stop.
    fn next(&self) -> u64 {
        self.sent.fetch_add(1, Ordering::AcqRel) + 1
    }

    fn send(&self, body: Body) -> Result<(), DeviceError> {
        let packet = Packet { session: self.id, number: self.next(), body };
        self.socket.send(&packet, self.peer).map_err(|error| error.device_error())
    }

    /// Processes the received packets until `until_ns`.
    fn receive(&mut self, until_ns: u64, counters: &Counters) -> Result<(), DeviceError> {
        for _ in 0..MAX_RECEIVED {
            match self.socket.receive().map_err(|error| device_error(&error))? {
                Received::Nothing => return Ok(()),
                Received::Unreadable => add_one(&counters.corrupt),
                // No process listens on the peer's port.
                Received::Undelivered => self.is_over = true,
                Received::Datagram { from, .. } if from != self.peer => add_one(&counters.foreign),
                Received::Datagram { packet: Err(_), .. } => add_one(&counters.corrupt),
                Received::Datagram { packet: Ok(packet), .. } if packet.session != self.id => {
                    add_one(&counters.other_session);
                }
                Received::Datagram { packet: Ok(packet), .. } => self.process(&packet, counters),
            }
            if self.clock.now_ns() >= until_ns {
                return Ok(());
            }
        }
        Ok(())
    }

    fn process(&mut self, packet: &Packet, counters: &Counters) {
        match &packet.body {
            Body::Sample(sampled) => {
                if counters.note(self.order.note(packet.number)) {
                    if self.is_fresh {
                        add_one(&counters.skipped);
                    }
                    let in_flight = self.sent.load(Ordering::Acquire).saturating_sub(sampled.shown);
                    counters.forces_in_flight.store(in_flight, Ordering::Relaxed);
                    (self.newest, self.is_fresh) = (Some(sampled.reading(packet.number)), true);
                    self.received_ns = self.clock.now_ns();
                }
            }
            Body::End(reason) => (self.is_over, self.ended) = (true, Some(*reason)),
            // A reply to a repeated hello.
            Body::Welcome(_) => {}
            // Only palpate sends these.
            Body::Hello | Body::Force(_) | Body::Stop => add_one(&counters.corrupt),
        }
    }
}

impl HapticDevice for BridgeDevice {
    /// The description sent by the peer when it was found.
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
        let socket = PacketSocket::to(peer).map_err(|error| device_error(&error))?;
        let (id, welcome) = greet(&socket, &self.settings, Purpose::Start, self.monitor.counters())
            .map_err(|error| error.device_error())?;
        let clock = MonotonicClock::start();
        self.sent.store(0, Ordering::Release);
        let session = Session {
            socket,
            peer,
            id,
            sent: Arc::clone(&self.sent),
            order: PacketOrder::default(),
            newest: None,
            is_fresh: false,
            received_ns: clock.now_ns(),
            is_over: false,
            ended: None,
            clock,
        };
        let watchdog_us = self.welcome.watchdog_us;
        if (Welcome { watchdog_us, ..welcome }) != self.welcome {
            // The loop's limits were derived from the old description.
            let _ = session.send(Body::Stop);
            return Err(DeviceError::Protocol("the peer describes another device than when it was found"));
        }
        add_one(&self.monitor.counters().sessions);
        (self.welcome, self.session) = (welcome, Some(session));
        Ok(())
    }

    fn read(&mut self, within: Duration) -> Result<Reading, DeviceError> {
        let (period_ns, silent_ns, within_ns) = (self.period_ns(), self.silent_ns(), in_ns(within));
        let counters = self.monitor.counters();
        let session = self.session.as_mut().ok_or(DeviceError::NotOpen)?;
        let start_ns = session.clock.now_ns();
        // A sample is due within the given time, or a little later. The other half of the time is left for the tick.
        let is_due = period_ns <= within_ns.saturating_add(within_ns / 4);
        let wait_ns = if is_due { within_ns / 2 } else { 0 };
        let (until_ns, give_up_ns) = (start_ns.saturating_add(within_ns), start_ns.saturating_add(wait_ns));
        let (mut now_ns, mut failed) = (start_ns, None);
        while !session.is_over {
            failed = session.receive(until_ns, counters).err();
            now_ns = session.clock.now_ns();
            if session.is_fresh || now_ns >= give_up_ns {
                break;
            }
            session.clock.sleep_until(give_up_ns.min(now_ns.saturating_add(POLL_NS)));
        }
        let age_ns = now_ns.saturating_sub(session.received_ns);
        if !session.is_over && !session.is_fresh && age_ns > silent_ns {
            session.is_over = true;
            add_one(&counters.silences);
            // The peer may not receive it.
            let _ = session.send(Body::Stop);
        }
        if session.is_over {
            return Err(session.ended.take().map_or(DeviceError::Disconnected, end_error));
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
            add_one(&self.monitor.counters().rejected);
            return Err(DeviceError::Protocol("a force that is not finite, or above the device's maximum"));
        }
        session.send(Body::Force(force_n))
    }

    fn emergency_stop(&mut self) -> Option<Box<dyn EmergencyStop>> {
        let session = self.session.as_ref()?;
        let socket = session.socket.try_clone().ok()?;
        Some(Box::new(BridgeStop {
            socket,
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

/// Sends zero force from another thread. The session continues, and the loop arms its start stage when it resumes.
struct BridgeStop {
    socket: PacketSocket,
    peer: SocketAddr,
    id: u64,
    sent: Arc<AtomicU64>,
}

impl EmergencyStop for BridgeStop {
    fn stop(&mut self) -> Result<(), DeviceError> {
        // Newer than every number of the loop's thread, including one not sent yet.
        let number = self.sent.fetch_add(1, Ordering::AcqRel) + 1;
        let packet = Packet { session: self.id, number, body: Body::Force(DVec3::ZERO) };
        self.socket.send(&packet, self.peer).map_err(|error| error.device_error())
    }
}
