//! palpate's end of a bridge, and the handshake of both ends. The test mostly plays the peer.

use crate::ends::*;
use crate::wait::wait_for;
use glam::{DQuat, DVec3};
use palpate_haptics::bridge::packet::*;
use palpate_haptics::bridge::*;
use palpate_haptics::*;
use std::time::Duration;

const TICK: Duration = Duration::from_millis(1);
const LONG: Duration = Duration::from_secs(1);

#[test]
fn find_returns_description_without_starting_session() {
    let hand = TestDevice::new();
    let mut peer = hand.peer(LONG);
    let settings = patient(peer.address());
    let mut device = while_serving(&mut peer, || BridgeDevice::find(settings)).unwrap();
    assert_eq!(device.describe(), hand.description);
    assert_eq!(device.peer_watchdog(), LONG);
    assert_eq!(peer.session(), None);
    assert_eq!(device.read(TICK), Err(DeviceError::NotOpen));
    assert_eq!(device.write(DVec3::ZERO), Err(DeviceError::NotOpen));
    assert!(device.emergency_stop().is_none());
    for session in 1..=2 {
        while_serving(&mut peer, || device.open()).unwrap();
        assert_eq!(device.open(), Err(DeviceError::AlreadyOpen));
        assert_eq!(peer.monitor().counts().sessions, session);
        assert!(peer.session().is_some());
        device.close().unwrap();
        peer.receive(Duration::ZERO);
        assert_eq!(peer.session(), None, "close sends a stop");
    }
    assert_eq!(device.monitor().counts().sessions, 2);
}

#[test]
fn reports_absent_peer() {
    let waited = Duration::from_millis(30);
    // The port is in use, but nothing replies.
    let silent = ManualEnd::new(any_port());
    let settings = BridgeSettings { open_within: waited, ..patient(silent.address()) };
    let error = BridgeDevice::find(settings).unwrap_err();
    assert!(
        matches!(error, BridgeError::NoPeer { address, waited: found } if (address, found) == (silent.address(), waited))
    );
    let (_peer, mut device) = found(|settings| BridgeSettings { open_within: waited, ..settings });
    assert_eq!(device.open(), Err(DeviceError::Disconnected));
}

#[test]
fn rejects_addresses_beyond_loopback_unless_enabled() {
    // Reserved for documentation (RFC 5737).
    let elsewhere = ([192, 0, 2, 1], 27_182).into();
    let settings = BridgeSettings { address: elsewhere, ..BridgeSettings::default() };
    let rejected = BridgeDevice::find(settings).unwrap_err();
    assert!(matches!(rejected, BridgeError::NotLoopback { address } if address == elsewhere));
    let everywhere = ([0, 0, 0, 0], 0).into();
    let settings = PeerSettings { address: everywhere, ..PeerSettings::default() };
    let rejected = BridgePeer::bind(settings, Box::new(TestDevice::new())).unwrap_err();
    assert!(matches!(rejected, BridgeError::NotLoopback { address } if address == everywhere));
    // Enabled: the peer listens on all addresses, including the loopback one.
    let settings = PeerSettings { beyond_loopback: true, ..settings };
    let mut peer = BridgePeer::bind(settings, Box::new(TestDevice::new())).unwrap();
    let here = patient(([127, 0, 0, 1], peer.address().port()).into());
    while_serving(&mut peer, || BridgeDevice::find(here)).unwrap();
}

#[test]
fn reports_peer_of_another_version() {
    let mut peer = ManualEnd::new(any_port());
    let settings = patient(peer.address());
    std::thread::scope(|scope| {
        let found = scope.spawn(|| BridgeDevice::find(settings));
        let hello = peer.receive();
        let mut end = [0; MAX_SIZE];
        let packet = Packet { session: 0, number: hello.number, body: Body::End(EndReason::OtherVersion) };
        let length = packet.encode(&mut end).unwrap().len();
        end[4] = 7;
        peer.send_bytes(&end[..length]);
        let error = found.join().unwrap().unwrap_err();
        assert!(matches!(error, BridgeError::OtherVersion { found: 7, .. }), "{error}");
        assert!(error.to_string().ends_with("uses version 7 of the bridge's protocol; it must be 1"));
    });
}

#[test]
fn invalid_reply_is_not_a_peer() {
    let mut peer = ManualEnd::new(any_port());
    let settings = BridgeSettings { open_within: Duration::from_millis(100), ..patient(peer.address()) };
    std::thread::scope(|scope| {
        let found = scope.spawn(|| BridgeDevice::find(settings));
        peer.receive();
        peer.send_bytes(b"HTTP/1.1 400 Bad Request\r\n\r\n");
        let error = found.join().unwrap().unwrap_err();
        assert!(matches!(error, BridgeError::NotAPeer { source: PacketError::Magic, .. }), "{error}");
    });
}

#[test]
fn peer_serves_one_session_at_a_time() {
    let mut peer = TestDevice::new().peer(LONG);
    let settings = BridgeSettings { open_within: Duration::from_millis(50), ..patient(peer.address()) };
    let patient = patient(peer.address());
    let mut first = while_serving(&mut peer, || BridgeDevice::find(patient)).unwrap();
    let mut impatient = while_serving(&mut peer, || BridgeDevice::find(patient)).unwrap();
    while_serving(&mut peer, || first.open()).unwrap();
    let served = peer.session();
    // The second device can find the peer, but not open it.
    let mut second = loop {
        // On a busy machine 50 ms may be too short.
        if let Ok(device) = while_serving(&mut peer, || BridgeDevice::find(settings)) {
            break device;
        }
    };
    wait_for(|| {
        let opened = while_serving(&mut peer, || second.open());
        opened == Err(DeviceError::Protocol("the peer serves another program"))
    });
    assert_eq!(peer.session(), served);
    drop(first);
    while_serving(&mut peer, || impatient.open()).unwrap();
    assert_ne!(peer.session(), served);
}

#[test]
fn repeats_hello_after_lost_welcome() {
    let (mut peer, mut device) = found(|settings| settings);
    std::thread::scope(|scope| {
        let opened = scope.spawn(|| device.open());
        let (first, second) = (peer.receive(), reply_to_hello(&mut peer, welcome()));
        assert_eq!((first.session, first.number + 1), (second.session, second.number));
        opened.join().unwrap().unwrap();
    });
}

#[test]
fn session_ended_before_welcome_is_replaced_at_once() {
    for reason in [EndReason::NoSession, EndReason::Silent, EndReason::Closing] {
        let (mut peer, mut device) = found(|settings| settings);
        let monitor = device.monitor();
        std::thread::scope(|scope| {
            let opened = scope.spawn(|| device.open());
            let first = peer.receive();
            assert_eq!(first.body, Body::Hello);
            // Sent twice, as in reply to two hellos: only one session has ended.
            peer.session = first.session;
            (0..2).for_each(|_| peer.send(first.number, Body::End(reason)));
            let mut second = peer.receive();
            // A hello that was in transit.
            while second.session == first.session {
                second = peer.receive();
            }
            assert!(second.body == Body::Hello && second.session != 0);
            peer.session = second.session;
            peer.send(second.number, Body::Welcome(welcome()));
            opened.join().unwrap().unwrap();
        });
        assert_eq!(monitor.counts().sessions, 1);
        // The second session is the open one.
        device.write(DVec3::X).unwrap();
        let force = loop {
            let packet = peer.receive();
            if packet.body != Body::Hello {
                break packet;
            }
        };
        assert_eq!((force.session, force.body), (peer.session, Body::Force(DVec3::X)));
    }
}

/// A peer that rejects every session receives at most one hello in 10 ms more than a silent one.
#[test]
fn peer_that_ends_every_session_is_not_flooded() {
    let waited = Duration::from_millis(200);
    let (mut peer, mut device) = found(|settings| BridgeSettings { open_within: waited, ..settings });
    let mut hellos = 0;
    std::thread::scope(|scope| {
        let opened = scope.spawn(|| device.open());
        peer.socket.set_read_timeout(Some(Duration::from_millis(5))).unwrap();
        let mut bytes = [0; 200];
        while !opened.is_finished() {
            let Ok((length, from)) = peer.socket.recv_from(&mut bytes) else { continue };
            let hello = Packet::parse(&bytes[..length]).unwrap();
            (peer.other, peer.session, hellos) = (from, hello.session, hellos + 1);
            peer.send(hello.number, Body::End(EndReason::NoSession));
        }
        assert_eq!(opened.join().unwrap(), Err(DeviceError::Disconnected));
    });
    // One every 10 ms, and as many immediate ones.
    assert!((2..=42).contains(&hellos), "{hellos}");
}

#[test]
fn open_rejects_changed_description() {
    let (mut peer, mut device) = found(|settings| settings);
    let stronger = Welcome { max_force_n: 50.0, ..welcome() };
    std::thread::scope(|scope| {
        let opened = scope.spawn(|| device.open());
        reply_to_hello(&mut peer, stronger);
        let opened = opened.join().unwrap();
        assert!(matches!(opened, Err(DeviceError::Protocol(_))), "{opened:?}");
    });
    // The session is stopped at once, and the device stays closed.
    wait_for(|| peer.receive().body == Body::Stop);
    assert_eq!(device.read(TICK), Err(DeviceError::NotOpen));
    assert_eq!(device.describe().max_force_n, 5.0);
    // A different watchdog does not change the description.
    std::thread::scope(|scope| {
        let opened = scope.spawn(|| device.open());
        reply_to_hello(&mut peer, Welcome { watchdog_us: 50_000, ..welcome() });
        opened.join().unwrap().unwrap();
    });
    assert_eq!(device.peer_watchdog(), Duration::from_millis(50));
}

#[test]
fn read_returns_newest_sample_and_never_an_older_one() {
    let (mut peer, mut device) = found(|settings| settings);
    open(&mut device, &mut peer);
    let monitor = device.monitor();
    assert_eq!(device.read(TICK), Err(DeviceError::TimedOut), "no sample has arrived");
    // The last reading, however late it is on a busy machine.
    let mut last = (0, 0.0);
    let mut read_until = |expected: (u64, f64), done: &dyn Fn(BridgeCounts) -> bool| {
        wait_for(|| {
            if let Ok(reading) = device.read(TICK) {
                assert!(reading.sequence >= Some(last.0), "the hand goes back");
                last = (reading.sequence.unwrap(), reading.position_m.x);
            }
            last == expected && done(monitor.counts())
        });
    };
    for number in 1..=3 {
        peer.send(number, Body::Sample(sampled(number as f64 * 1e-3)));
    }
    read_until((3, 3e-3), &|_| true);
    let counts = monitor.counts();
    assert_eq!((counts.accepted, counts.lost), (3, 0));
    // 6 arrives before 5, 4 is lost, the others arrive twice.
    for number in [3, 2, 6, 5, 6, 5] {
        peer.send(number, Body::Sample(sampled(number as f64 * 1e-3)));
    }
    read_until((6, 6e-3), &|counts| counts.duplicated == 4);
    let counts = monitor.counts();
    assert_eq!((counts.accepted, counts.lost, counts.late, counts.duplicated), (4, 1, 1, 4));
    // Packets that violate the protocol, come from another sender, or belong to another session.
    peer.send_bytes(b"PLPB");
    peer.send_bytes(&[0; 200]);
    peer.send_bytes(&[]);
    peer.send(7, Body::Force(DVec3::X));
    let mut stranger = ManualEnd::new(peer.other);
    stranger.session = peer.session;
    stranger.send(100, Body::Sample(sampled(9.0)));
    stranger.send(101, Body::End(EndReason::Closing));
    let of_session = std::mem::replace(&mut peer.session, 1);
    peer.send(100, Body::Sample(sampled(9.0)));
    peer.send(0, Body::End(EndReason::Closing));
    peer.session = of_session;
    peer.send(7, Body::Sample(sampled(7e-3)));
    read_until((7, 7e-3), &|counts| counts.foreign == 2);
    let counts = monitor.counts();
    assert_eq!((counts.corrupt, counts.foreign, counts.other_session), (4, 2, 2));
    assert_eq!((counts.accepted, counts.lost, counts.late), (5, 1, 1));
}

#[test]
fn skips_all_but_newest_of_simultaneous_samples() {
    let (mut peer, mut device) = found(|settings| settings);
    open(&mut device, &mut peer);
    for number in 1..=100 {
        peer.send(number, Body::Sample(sampled(number as f64 * 1e-3)));
    }
    let mut numbers = Vec::new();
    wait_for(|| {
        numbers.extend(device.read(TICK).ok().and_then(|reading| reading.sequence));
        numbers.last() == Some(&100)
    });
    assert!(numbers.is_sorted());
    numbers.dedup();
    let counts = device.monitor().counts();
    assert_eq!((counts.accepted, counts.skipped + numbers.len() as u64), (100, 100));
}

#[test]
fn reading_contains_all_data_of_sample() {
    let (mut peer, mut device) = found(|settings| settings);
    open(&mut device, &mut peer);
    for n in 0..5 {
        device.write(DVec3::X * f64::from(n)).unwrap();
    }
    let sampled = Sampled {
        position_m: DVec3::new(0.01, -0.02, 0.03),
        orientation: DQuat::from_rotation_x(1.0),
        velocity_m_per_s: Some(DVec3::new(0.1, 0.2, -0.3)),
        buttons: 0x8000_0005,
        shown: 3,
    };
    peer.send(77, Body::Sample(sampled));
    let mut read = Err(DeviceError::TimedOut);
    wait_for(|| {
        read = device.read(TICK);
        read.is_ok()
    });
    assert_eq!(read, Ok(sampled.reading(77)));
    assert_eq!(device.monitor().counts().forces_in_flight, 2);
}

#[test]
fn timeout_of_peer_ends_session_finally() {
    let (mut peer, mut device) =
        found(|settings| BridgeSettings { silent_after: Duration::from_millis(300), ..settings });
    open(&mut device, &mut peer);
    peer.send(1, Body::Sample(sampled(0.0)));
    let mut errors = Vec::new();
    wait_for(|| {
        let read = device.read(TICK);
        errors.extend(read.err().filter(|error| errors.last() != Some(error)));
        read == Err(DeviceError::Disconnected)
    });
    assert!(errors.len() <= 3, "{errors:?}");
    assert_eq!(device.monitor().counts().silences, 1);
    let stop = peer.receive();
    assert_eq!((stop.session, stop.body), (peer.session, Body::Stop));
    // Later samples of the session are ignored.
    peer.send(2, Body::Sample(sampled(0.0)));
    for _ in 0..5 {
        assert_eq!(device.read(TICK), Err(DeviceError::Disconnected));
        assert_eq!(device.write(DVec3::X), Err(DeviceError::Disconnected));
    }
    assert!(peer.receives_nothing());
    let before = peer.session;
    device.close().unwrap();
    open(&mut device, &mut peer);
    assert_ne!(peer.session, before);
    // Packet numbers restart in the new session.
    peer.send(1, Body::Sample(sampled(0.01)));
    wait_for(|| device.read(TICK).is_ok_and(|reading| reading.sequence == Some(1)));
}

#[test]
fn session_ended_by_peer_stays_closed_after_its_reason() {
    for (reason, why) in [
        (EndReason::Silent, "watchdog"),
        (EndReason::Closing, "start it again"),
        (EndReason::NoSession, "restart"),
        (EndReason::DeviceFailed, "the peer's device failed"),
    ] {
        let (mut peer, mut device) = found(|settings| settings);
        open(&mut device, &mut peer);
        peer.send(1, Body::Sample(sampled(0.0)));
        peer.send(0, Body::End(reason));
        // First the reason, then only `Disconnected`.
        let mut errors = Vec::new();
        wait_for(|| {
            let error = device.read(TICK).err();
            errors.extend(error.filter(|error| *error != DeviceError::TimedOut));
            error == Some(DeviceError::Disconnected)
        });
        let [DeviceError::Unavailable(text), DeviceError::Disconnected] = errors[..] else {
            panic!("{reason:?}: {errors:?}")
        };
        assert!(text.contains(why), "{reason:?}: {text}");
        assert_eq!(device.write(DVec3::X), Err(DeviceError::Disconnected));
        device.close().unwrap();
        assert!(peer.receives_nothing(), "no stop for a session that the peer has ended");
    }
}

#[test]
fn numbers_forces_and_rejects_invalid_ones() {
    let (mut peer, mut device) = found(|settings| settings);
    open(&mut device, &mut peer);
    // A rotation may lengthen a force by a rounding error.
    let longest = DVec3::new(3.0, 0.0, 4.0) * (1.0 + 1e-12);
    let forces = [DVec3::new(0.1, -0.2, 0.3), DVec3::ZERO, longest];
    let rejected = [
        DVec3::NAN,
        DVec3::new(0.0, f64::INFINITY, 0.0),
        DVec3::new(f64::MAX, f64::MAX, f64::MAX),
        DVec3::new(3.0, 0.1, 4.0),
    ];
    for (number, force_n) in (1..).zip(forces) {
        for force_n in rejected {
            let error = device.write(force_n).unwrap_err();
            assert!(matches!(error, DeviceError::Protocol(_)), "{error}");
        }
        device.write(force_n).unwrap();
        let packet = peer.receive();
        assert_eq!(packet, Packet { session: peer.session, number, body: Body::Force(force_n) });
    }
    assert!(peer.receives_nothing());
    assert_eq!(device.monitor().counts().rejected, 12);
}

#[test]
fn emergency_stop_from_another_thread_keeps_session() {
    let (mut peer, mut device) = found(|settings| settings);
    open(&mut device, &mut peer);
    let mut stop = device.emergency_stop().unwrap();
    device.write(DVec3::X).unwrap();
    std::thread::spawn(move || stop.stop()).join().unwrap().unwrap();
    device.write(DVec3::Y).unwrap();
    let received: Vec<Packet> = (0..3).map(|_| peer.receive()).collect();
    for (packet, (number, force_n)) in received.iter().zip((1..).zip([DVec3::X, DVec3::ZERO, DVec3::Y])) {
        assert_eq!((packet.number, packet.body), (number, Body::Force(force_n)));
    }
    // Closing and dropping both send a stop.
    device.close().unwrap();
    assert_eq!((peer.receive().body, device.close()), (Body::Stop, Ok(())));
    open(&mut device, &mut peer);
    drop(device);
    assert_eq!(peer.receive().body, Body::Stop);
    assert!(peer.receives_nothing());
}
