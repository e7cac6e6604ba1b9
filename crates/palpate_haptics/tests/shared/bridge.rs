//! Both ends of a bridge, and one end played by the test packet by packet.

#![allow(dead_code, reason = "not every test plays both ends")]

use super::wait::wait_for;
use glam::DVec3;
use palpate_haptics::bridge::packet::*;
use palpate_haptics::bridge::*;
use palpate_haptics::*;
use std::net::{SocketAddr, UdpSocket};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Calls of a device so far, and its next results.
pub struct Hand {
    pub reading: Result<Reading, DeviceError>,
    pub written: Result<(), DeviceError>,
    pub opened: Result<(), DeviceError>,
    /// Whether the device panics where it would return an error.
    pub panics: bool,
    pub forces: Vec<DVec3>,
    /// Number of writes, successful or not.
    pub writes: u32,
    /// Number of closes.
    pub closes: u32,
    pub is_open: bool,
}

/// A device under a test's control.
#[derive(Clone)]
pub struct TestDevice {
    pub hand: Arc<Mutex<Hand>>,
    pub description: DeviceDescription,
}

impl TestDevice {
    pub fn new() -> Self {
        let hand = Hand {
            reading: Ok(Reading::at(DVec3::ZERO)),
            written: Ok(()),
            opened: Ok(()),
            panics: false,
            forces: Vec::new(),
            writes: 0,
            closes: 0,
            is_open: false,
        };
        let description = DeviceDescription {
            name: "test hand".into(),
            workspace_m: [DVec3::splat(-0.1), DVec3::splat(0.1)],
            max_force_n: 5.0,
            rate_hz: 1000.0,
        };
        Self { hand: Arc::new(Mutex::new(hand)), description }
    }

    /// The applied force, N.
    pub fn force_n(&self) -> DVec3 {
        self.hand.lock().unwrap().forces.last().copied().unwrap_or_default()
    }

    /// A peer that serves the device on a free port.
    pub fn peer(&self, watchdog: Duration) -> BridgePeer {
        let settings = PeerSettings { address: any_port(), watchdog, ..PeerSettings::default() };
        BridgePeer::bind(settings, Box::new(self.clone())).unwrap()
    }
}

impl HapticDevice for TestDevice {
    fn describe(&self) -> DeviceDescription {
        self.description.clone()
    }
    fn open(&mut self) -> Result<(), DeviceError> {
        let mut hand = self.hand.lock().unwrap();
        hand.opened?;
        hand.is_open = true;
        Ok(())
    }
    fn read(&mut self, _: Duration) -> Result<Reading, DeviceError> {
        let (reading, panics) = {
            let hand = self.hand.lock().unwrap();
            (hand.reading, hand.panics)
        };
        assert!(reading.is_ok() || !panics, "a driver panics while it reads");
        reading
    }
    fn write(&mut self, force_n: DVec3) -> Result<(), DeviceError> {
        let (written, panics) = {
            let mut hand = self.hand.lock().unwrap();
            hand.writes += 1;
            if hand.written.is_ok() {
                hand.forces.push(force_n);
            }
            (hand.written, hand.panics)
        };
        // The lock is released before the panic: the test reads the hand afterwards.
        assert!(written.is_ok() || !panics, "a driver panics while it writes");
        written
    }
    fn close(&mut self) -> Result<(), DeviceError> {
        let mut hand = self.hand.lock().unwrap();
        hand.closes += 1;
        hand.is_open = false;
        Ok(())
    }
}

pub fn any_port() -> SocketAddr {
    ([127, 0, 0, 1], 0).into()
}

/// Settings of a device at `address` with timeouts for a busy machine.
pub fn patient(address: SocketAddr) -> BridgeSettings {
    let long = Duration::from_secs(10);
    BridgeSettings { address, open_within: long, silent_after: long, ..BridgeSettings::default() }
}

/// Runs `call`, which waits for replies of `peer`, and serves it at time zero of its clock until `call` has returned.
pub fn while_serving<T: Send>(peer: &mut BridgePeer, call: impl FnOnce() -> T + Send) -> T {
    std::thread::scope(|scope| {
        let result = scope.spawn(call);
        wait_for(|| {
            peer.receive(Duration::ZERO);
            result.is_finished()
        });
        result.join().unwrap()
    })
}

/// One end of a bridge, played by the test.
pub struct ManualEnd {
    pub socket: UdpSocket,
    pub other: SocketAddr,
    pub session: u64,
}

impl ManualEnd {
    pub fn new(other: SocketAddr) -> Self {
        let socket = UdpSocket::bind(any_port()).unwrap();
        socket.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
        Self { socket, other, session: 0x5e55 }
    }

    pub fn address(&self) -> SocketAddr {
        self.socket.local_addr().unwrap()
    }

    pub fn send_bytes(&self, bytes: &[u8]) {
        self.socket.send_to(bytes, self.other).unwrap();
    }

    pub fn send(&self, number: u64, body: Body) {
        let packet = Packet { session: self.session, number, body };
        self.send_bytes(packet.encode(&mut [0; MAX_SIZE]).unwrap());
    }

    /// Receives the next packet from any sender.
    pub fn receive(&mut self) -> Packet {
        let mut bytes = [0; 200];
        let (length, from) = self.socket.recv_from(&mut bytes).unwrap();
        self.other = from;
        Packet::parse(&bytes[..length]).unwrap()
    }

    /// Whether no packet is waiting.
    pub fn receives_nothing(&self) -> bool {
        self.socket.set_nonblocking(true).unwrap();
        let nothing = self.socket.peek_from(&mut [0; 200]).is_err();
        self.socket.set_nonblocking(false).unwrap();
        nothing
    }

    /// Receives the next packet that is not a sample.
    pub fn receive_except_samples(&mut self) -> Packet {
        loop {
            let packet = self.receive();
            if !matches!(packet.body, Body::Sample(_)) {
                return packet;
            }
        }
    }
}

/// Description sent by a peer played by the test.
pub fn welcome() -> Welcome {
    Welcome {
        name: Name::new("by hand"),
        workspace_m: [DVec3::splat(-0.1), DVec3::splat(0.1)],
        max_force_n: 5.0,
        rate_hz: 1000.0,
        watchdog_us: 20_000,
    }
}

/// A sample at `x`, m.
pub fn sampled(x: f64) -> Sampled {
    Sampled {
        position_m: DVec3::X * x,
        orientation: glam::DQuat::IDENTITY,
        velocity_m_per_s: None,
        buttons: 0,
        shown: 0,
    }
}

/// A peer played by the test, and its device after `find`. The peer outlives the device and receives its last packets.
pub fn found(settings: impl FnOnce(BridgeSettings) -> BridgeSettings) -> (ManualEnd, BridgeDevice) {
    let mut peer = ManualEnd::new(any_port());
    let settings = settings(patient(peer.address()));
    let device = std::thread::scope(|scope| {
        let device = scope.spawn(|| BridgeDevice::find(settings));
        reply_to_hello(&mut peer, welcome());
        device.join().unwrap().unwrap()
    });
    // Repeated hellos.
    while !peer.receives_nothing() {
        peer.receive();
    }
    (peer, device)
}

/// Replies to the next hello.
pub fn reply_to_hello(peer: &mut ManualEnd, welcome: Welcome) -> Packet {
    let hello = peer.receive();
    assert_eq!(hello.body, Body::Hello);
    peer.session = hello.session;
    peer.send(hello.number, Body::Welcome(welcome));
    hello
}

/// Opens `device`, with the peer played by the test.
pub fn open(device: &mut BridgeDevice, peer: &mut ManualEnd) {
    let opened = std::thread::scope(|scope| {
        let opened = scope.spawn(|| device.open());
        reply_to_hello(peer, welcome());
        opened.join().unwrap()
    });
    opened.unwrap();
    while !peer.receives_nothing() {
        peer.receive();
    }
}
