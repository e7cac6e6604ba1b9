//! Both ends of a bridge, and somebody who plays the other end by hand.

// Each test uses its part.
#![allow(dead_code, reason = "not every test plays both ends")]

use super::wait::wait_for;
use glam::DVec3;
use palpate_haptics::bridge::packet::*;
use palpate_haptics::bridge::*;
use palpate_haptics::*;
use std::net::{SocketAddr, UdpSocket};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// What a device was asked, and what it is to answer.
pub struct Hand {
    pub reading: Result<Reading, DeviceError>,
    pub written: Result<(), DeviceError>,
    pub opened: Result<(), DeviceError>,
    /// Whether it panics where it would give an error.
    pub panics: bool,
    pub forces: Vec<DVec3>,
    /// How often it was to show a force, could it or not.
    pub writes: u32,
    /// How often it was closed.
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

    /// The force that it shows.
    pub fn force_n(&self) -> DVec3 {
        self.hand.lock().unwrap().forces.last().copied().unwrap_or_default()
    }

    /// A peer that serves it, on any port.
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
        assert!(reading.is_ok() || !panics, "a driver that panics while it reads");
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
        // The lock is free again: others look at the hand afterwards.
        assert!(written.is_ok() || !panics, "a driver that panics while it writes");
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

/// Settings of a device at `address` that outlast a busy machine.
pub fn patient(address: SocketAddr) -> BridgeSettings {
    let long = Duration::from_secs(10);
    BridgeSettings { address, open_within: long, silent_after: long, ..BridgeSettings::default() }
}

/// What `ask` gives, which waits for `peer`, turned meanwhile at the time zero of its clock.
pub fn meanwhile<T: Send>(peer: &mut BridgePeer, ask: impl FnOnce() -> T + Send) -> T {
    std::thread::scope(|scope| {
        let asked = scope.spawn(ask);
        wait_for(|| {
            peer.receive(Duration::ZERO);
            asked.is_finished()
        });
        asked.join().unwrap()
    })
}

/// One who speaks by hand.
pub struct Speaker {
    pub socket: UdpSocket,
    pub other: SocketAddr,
    pub session: u64,
}

impl Speaker {
    pub fn new(other: SocketAddr) -> Self {
        let socket = UdpSocket::bind(any_port()).unwrap();
        socket.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
        Self { socket, other, session: 0x5e55 }
    }

    pub fn address(&self) -> SocketAddr {
        self.socket.local_addr().unwrap()
    }

    pub fn bytes(&self, bytes: &[u8]) {
        self.socket.send_to(bytes, self.other).unwrap();
    }

    pub fn say(&self, number: u64, body: Body) {
        let packet = Packet { session: self.session, number, body };
        self.bytes(packet.encode(&mut [0; MAX_SIZE]).unwrap());
    }

    /// The next packet, whoever sent it.
    pub fn hear(&mut self) -> Packet {
        let mut bytes = [0; 200];
        let (length, from) = self.socket.recv_from(&mut bytes).unwrap();
        self.other = from;
        Packet::parse(&bytes[..length]).unwrap()
    }

    /// Whether nothing has come that was not heard.
    pub fn hears_nothing(&self) -> bool {
        self.socket.set_nonblocking(true).unwrap();
        let nothing = self.socket.peek_from(&mut [0; 200]).is_err();
        self.socket.set_nonblocking(false).unwrap();
        nothing
    }

    /// The next packet that is not a sample.
    pub fn hear_but_samples(&mut self) -> Packet {
        loop {
            let packet = self.hear();
            if !matches!(packet.body, Body::Sample(_)) {
                return packet;
            }
        }
    }
}

/// What a peer played by hand says of itself.
pub fn welcome() -> Welcome {
    Welcome {
        name: Name::new("by hand"),
        workspace_m: [DVec3::splat(-0.1), DVec3::splat(0.1)],
        max_force_n: 5.0,
        rate_hz: 1000.0,
        watchdog_us: 20_000,
    }
}

/// A hand at `x`, m.
pub fn sampled(x: f64) -> Sampled {
    Sampled {
        position_m: DVec3::X * x,
        orientation: glam::DQuat::IDENTITY,
        velocity_m_per_s: None,
        buttons: 0,
        shown: 0,
    }
}

/// A peer that is played by hand, and its device, found. The player outlives it: nobody else is to get its last words.
pub fn found(settings: impl FnOnce(BridgeSettings) -> BridgeSettings) -> (Speaker, BridgeDevice) {
    let mut peer = Speaker::new(any_port());
    let settings = settings(patient(peer.address()));
    let device = std::thread::scope(|scope| {
        let device = scope.spawn(|| BridgeDevice::find(settings));
        answer_hello(&mut peer, welcome());
        device.join().unwrap().unwrap()
    });
    // Hellos that were said again meanwhile.
    while !peer.hears_nothing() {
        peer.hear();
    }
    (peer, device)
}

/// Answers the next hello.
pub fn answer_hello(peer: &mut Speaker, welcome: Welcome) -> Packet {
    let hello = peer.hear();
    assert_eq!(hello.body, Body::Hello);
    peer.session = hello.session;
    peer.say(hello.number, Body::Welcome(welcome));
    hello
}

/// Opens `device` with the peer played by hand.
pub fn open(device: &mut BridgeDevice, peer: &mut Speaker) {
    let opened = std::thread::scope(|scope| {
        let opened = scope.spawn(|| device.open());
        answer_hello(peer, welcome());
        opened.join().unwrap()
    });
    opened.unwrap();
    while !peer.hears_nothing() {
        peer.hear();
    }
}
