//! palpate's end of a bridge, and how both ends meet. The peer is mostly played by hand.

#[path = "shared/bridge.rs"]
mod ends;
#[path = "shared/wait.rs"]
mod wait;

use ends::*;
use glam::{DQuat, DVec3};
use palpate_haptics::bridge::packet::*;
use palpate_haptics::bridge::*;
use palpate_haptics::*;
use std::time::Duration;
use wait::wait_for;

const TICK: Duration = Duration::from_millis(1);
const LONG: Duration = Duration::from_secs(1);

#[test]
fn finding_tells_what_the_peer_is_and_begins_nothing() {
    let hand = TestDevice::new();
    let mut peer = hand.peer(LONG);
    let settings = patient(peer.address());
    let mut device = meanwhile(&mut peer, || BridgeDevice::find(settings)).unwrap();
    assert_eq!(device.describe(), hand.description);
    assert_eq!(device.peer_watchdog(), LONG);
    assert_eq!(peer.session(), None);
    assert_eq!(device.read(TICK), Err(DeviceError::NotOpen));
    assert_eq!(device.write(DVec3::ZERO), Err(DeviceError::NotOpen));
    assert!(device.emergency_stop().is_none());
    for session in 1..=2 {
        meanwhile(&mut peer, || device.open()).unwrap();
        assert_eq!(device.open(), Err(DeviceError::AlreadyOpen));
        assert_eq!(peer.monitor().counts().sessions, session);
        assert!(peer.session().is_some());
        device.close().unwrap();
        peer.receive(Duration::ZERO);
        assert_eq!(peer.session(), None, "close says stop");
    }
    assert_eq!(device.monitor().counts().sessions, 2);
}

#[test]
fn a_peer_that_is_not_there_is_told() {
    let waited = Duration::from_millis(30);
    // Somebody has the port, and says nothing.
    let silent = Speaker::new(any_port());
    let nobody = silent.address();
    let settings = BridgeSettings { open_within: waited, ..patient(nobody) };
    let error = BridgeDevice::find(settings).unwrap_err();
    assert!(
        matches!(error, BridgeError::NoPeer { address, waited: told } if (address, told) == (nobody, waited))
    );
    let (_peer, mut device) = found(|settings| BridgeSettings { open_within: waited, ..settings });
    assert_eq!(device.open(), Err(DeviceError::Disconnected));
}

#[test]
fn only_the_loopback_address_is_spoken_with_unless_another_is_meant() {
    // For documentation, and nobody's (RFC 5737).
    let elsewhere = ([192, 0, 2, 1], 27_182).into();
    let settings = BridgeSettings { address: elsewhere, ..BridgeSettings::default() };
    let refused = BridgeDevice::find(settings).unwrap_err();
    assert!(matches!(refused, BridgeError::NotLoopback { address } if address == elsewhere));
    assert!(refused.to_string().contains("beyond_loopback"), "{refused}");
    let everywhere = ([0, 0, 0, 0], 0).into();
    let settings = PeerSettings { address: everywhere, ..PeerSettings::default() };
    let refused = BridgePeer::bind(settings, Box::new(TestDevice::new())).unwrap_err();
    assert!(matches!(refused, BridgeError::NotLoopback { address } if address == everywhere));
    // Meant: the peer listens everywhere, and so it does here.
    let settings = PeerSettings { beyond_loopback: true, ..settings };
    let mut peer = BridgePeer::bind(settings, Box::new(TestDevice::new())).unwrap();
    let here = patient(([127, 0, 0, 1], peer.address().port()).into());
    meanwhile(&mut peer, || BridgeDevice::find(here)).unwrap();
}

#[test]
fn a_peer_of_another_version_is_told() {
    let mut peer = Speaker::new(any_port());
    let settings = patient(peer.address());
    std::thread::scope(|scope| {
        let found = scope.spawn(|| BridgeDevice::find(settings));
        let hello = peer.hear();
        let mut end = [0; MAX_SIZE];
        let packet = Packet { session: 0, number: hello.number, body: Body::End(EndReason::OtherVersion) };
        let length = packet.encode(&mut end).unwrap().len();
        end[4] = 7;
        peer.bytes(&end[..length]);
        let error = found.join().unwrap().unwrap_err();
        assert!(matches!(error, BridgeError::OtherVersion { found: 7, .. }), "{error}");
        assert!(error.to_string().ends_with("uses version 7 of the bridge's protocol; it must be 1"));
    });
}

#[test]
fn what_answers_nonsense_is_no_peer() {
    let mut peer = Speaker::new(any_port());
    let settings = BridgeSettings { open_within: Duration::from_millis(100), ..patient(peer.address()) };
    std::thread::scope(|scope| {
        let found = scope.spawn(|| BridgeDevice::find(settings));
        peer.hear();
        peer.bytes(b"HTTP/1.1 400 Bad Request\r\n\r\n");
        let error = found.join().unwrap().unwrap_err();
        assert!(matches!(error, BridgeError::NotAPeer { source: PacketError::Magic, .. }), "{error}");
    });
}

#[test]
fn a_peer_serves_one_at_a_time() {
    let mut peer = TestDevice::new().peer(LONG);
    let settings = BridgeSettings { open_within: Duration::from_millis(50), ..patient(peer.address()) };
    let patient = patient(peer.address());
    let mut first = meanwhile(&mut peer, || BridgeDevice::find(patient)).unwrap();
    let mut impatient = meanwhile(&mut peer, || BridgeDevice::find(patient)).unwrap();
    meanwhile(&mut peer, || first.open()).unwrap();
    let served = peer.session();
    // It can be found meanwhile, and not opened.
    let mut second = loop {
        // On a busy machine 50 ms may be too short.
        if let Ok(device) = meanwhile(&mut peer, || BridgeDevice::find(settings)) {
            break device;
        }
    };
    wait_for(|| {
        let opened = meanwhile(&mut peer, || second.open());
        opened == Err(DeviceError::Protocol("the peer serves another program"))
    });
    assert_eq!(peer.session(), served);
    drop(first);
    meanwhile(&mut peer, || impatient.open()).unwrap();
    assert_ne!(peer.session(), served);
}

#[test]
fn a_welcome_that_is_lost_is_asked_for_again() {
    let (mut peer, mut device) = found(|settings| settings);
    std::thread::scope(|scope| {
        let opened = scope.spawn(|| device.open());
        let (first, second) = (peer.hear(), answer_hello(&mut peer, welcome()));
        assert_eq!((first.session, first.number + 1), (second.session, second.number));
        opened.join().unwrap().unwrap();
    });
}

#[test]
fn a_session_that_is_over_before_it_was_welcomed_is_given_up_for_a_new_one_at_once() {
    for reason in [EndReason::NoSession, EndReason::Silent, EndReason::Closing] {
        let (mut peer, mut device) = found(|settings| settings);
        let monitor = device.monitor();
        std::thread::scope(|scope| {
            let opened = scope.spawn(|| device.open());
            let first = peer.hear();
            assert_eq!(first.body, Body::Hello);
            // Said twice, as to two hellos: it is one session that is over.
            peer.session = first.session;
            (0..2).for_each(|_| peer.say(first.number, Body::End(reason)));
            let mut second = peer.hear();
            // One that was under way.
            while second.session == first.session {
                second = peer.hear();
            }
            assert!(second.body == Body::Hello && second.session != 0);
            peer.session = second.session;
            peer.say(second.number, Body::Welcome(welcome()));
            opened.join().unwrap().unwrap();
        });
        assert_eq!(monitor.counts().sessions, 1);
        // It is that one that goes on.
        device.write(DVec3::X).unwrap();
        let force = loop {
            let packet = peer.hear();
            if packet.body != Body::Hello {
                break packet;
            }
        };
        assert_eq!((force.session, force.body), (peer.session, Body::Force(DVec3::X)));
    }
}

/// A peer that knows no session at all is asked no more often than one that says nothing.
#[test]
fn a_peer_that_ends_every_session_is_not_flooded() {
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
            peer.say(hello.number, Body::End(EndReason::NoSession));
        }
        assert_eq!(opened.join().unwrap(), Err(DeviceError::Disconnected));
    });
    // One each 10 ms, and as many that were said at once.
    assert!((2..=42).contains(&hellos), "{hellos}");
}

#[test]
fn a_peer_whose_device_has_become_another_is_refused() {
    let (mut peer, mut device) = found(|settings| settings);
    let stronger = Welcome { max_force_n: 50.0, ..welcome() };
    std::thread::scope(|scope| {
        let opened = scope.spawn(|| device.open());
        answer_hello(&mut peer, stronger);
        let opened = opened.join().unwrap();
        assert!(matches!(opened, Err(DeviceError::Protocol(why)) if why.contains("another device")));
    });
    // It is let go at once, and nothing is open.
    wait_for(|| peer.hear().body == Body::Stop);
    assert_eq!(device.read(TICK), Err(DeviceError::NotOpen));
    assert_eq!(device.describe().max_force_n, 5.0);
    // Another watchdog is no other device.
    std::thread::scope(|scope| {
        let opened = scope.spawn(|| device.open());
        answer_hello(&mut peer, Welcome { watchdog_us: 50_000, ..welcome() });
        opened.join().unwrap().unwrap();
    });
    assert_eq!(device.peer_watchdog(), Duration::from_millis(50));
}

#[test]
fn the_newest_sample_is_read_and_nothing_moves_the_hand_back() {
    let (mut peer, mut device) = found(|settings| settings);
    open(&mut device, &mut peer);
    let monitor = device.monitor();
    assert_eq!(device.read(TICK), Err(DeviceError::TimedOut), "nothing has come yet");
    // What was read last, however late that is on a busy machine.
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
        peer.say(number, Body::Sample(sampled(number as f64 * 1e-3)));
    }
    read_until((3, 3e-3), &|_| true);
    let counts = monitor.counts();
    assert_eq!((counts.taken, counts.lost), (3, 0));
    // 6 and 5 overtake each other, 4 is lost, the others come again.
    for number in [3, 2, 6, 5, 6, 5] {
        peer.say(number, Body::Sample(sampled(number as f64 * 1e-3)));
    }
    read_until((6, 6e-3), &|counts| counts.duplicated == 4);
    let counts = monitor.counts();
    assert_eq!((counts.taken, counts.lost, counts.late, counts.duplicated), (4, 1, 1, 4));
    // What breaks the protocol, comes from elsewhere, or belongs to another session.
    peer.bytes(b"PLPB");
    peer.bytes(&[0; 200]);
    peer.bytes(&[]);
    peer.say(7, Body::Force(DVec3::X));
    let mut stranger = Speaker::new(peer.other);
    stranger.session = peer.session;
    stranger.say(100, Body::Sample(sampled(9.0)));
    stranger.say(101, Body::End(EndReason::Closing));
    let of_session = std::mem::replace(&mut peer.session, 1);
    peer.say(100, Body::Sample(sampled(9.0)));
    peer.say(0, Body::End(EndReason::Closing));
    peer.session = of_session;
    peer.say(7, Body::Sample(sampled(7e-3)));
    read_until((7, 7e-3), &|counts| counts.foreign == 2);
    let counts = monitor.counts();
    assert_eq!((counts.corrupt, counts.foreign, counts.other_session), (4, 2, 2));
    assert_eq!((counts.taken, counts.lost, counts.late), (5, 1, 1));
}

#[test]
fn samples_that_come_together_are_skipped_but_for_the_newest() {
    let (mut peer, mut device) = found(|settings| settings);
    open(&mut device, &mut peer);
    for number in 1..=100 {
        peer.say(number, Body::Sample(sampled(number as f64 * 1e-3)));
    }
    let mut numbers = Vec::new();
    wait_for(|| {
        numbers.extend(device.read(TICK).ok().and_then(|reading| reading.sequence));
        numbers.last() == Some(&100)
    });
    assert!(numbers.is_sorted());
    numbers.dedup();
    let counts = device.monitor().counts();
    assert_eq!((counts.taken, counts.skipped + numbers.len() as u64), (100, 100));
}

#[test]
fn a_reading_is_all_that_the_sample_says() {
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
    peer.say(77, Body::Sample(sampled));
    let mut read = Err(DeviceError::TimedOut);
    wait_for(|| {
        read = device.read(TICK);
        read.is_ok()
    });
    assert_eq!(read, Ok(sampled.reading(77)));
    assert_eq!(device.monitor().counts().unshown, 2);
}

#[test]
fn a_silent_peer_ends_the_session_for_good() {
    let (mut peer, mut device) =
        found(|settings| BridgeSettings { silent_after: Duration::from_millis(300), ..settings });
    open(&mut device, &mut peer);
    peer.say(1, Body::Sample(sampled(0.0)));
    let mut errors = Vec::new();
    wait_for(|| {
        let read = device.read(TICK);
        errors.extend(read.err().filter(|error| errors.last() != Some(error)));
        read == Err(DeviceError::Disconnected)
    });
    assert!(errors.len() <= 3, "{errors:?}");
    assert_eq!(device.monitor().counts().silences, 1);
    let stop = peer.hear();
    assert_eq!((stop.session, stop.body), (peer.session, Body::Stop));
    // It comes back, and is not heard.
    peer.say(2, Body::Sample(sampled(0.0)));
    for _ in 0..5 {
        assert_eq!(device.read(TICK), Err(DeviceError::Disconnected));
        assert_eq!(device.write(DVec3::X), Err(DeviceError::Disconnected));
    }
    assert!(peer.hears_nothing());
    let before = peer.session;
    device.close().unwrap();
    open(&mut device, &mut peer);
    assert_ne!(peer.session, before);
    // Numbers begin anew, those of the old session are no more.
    peer.say(1, Body::Sample(sampled(0.01)));
    wait_for(|| device.read(TICK).is_ok_and(|reading| reading.sequence == Some(1)));
}

#[test]
fn what_the_peer_ends_is_over() {
    for (reason, why) in [
        (EndReason::Silent, "watchdog"),
        (EndReason::Closing, "start it again"),
        (EndReason::NoSession, "restart"),
        (EndReason::DeviceFailed, "the peer's device failed"),
    ] {
        let (mut peer, mut device) = found(|settings| settings);
        open(&mut device, &mut peer);
        peer.say(1, Body::Sample(sampled(0.0)));
        peer.say(0, Body::End(reason));
        // Once why, and from then on that it is over.
        let mut told = Vec::new();
        wait_for(|| {
            let error = device.read(TICK).err();
            told.extend(error.filter(|error| *error != DeviceError::TimedOut));
            error == Some(DeviceError::Disconnected)
        });
        let [DeviceError::Unavailable(said), DeviceError::Disconnected] = told[..] else {
            panic!("{reason:?}: {told:?}")
        };
        assert!(said.contains(why), "{reason:?}: {said}");
        assert_eq!(device.write(DVec3::X), Err(DeviceError::Disconnected));
        device.close().unwrap();
        assert!(peer.hears_nothing(), "the peer knows");
    }
}

#[test]
fn forces_are_numbered_and_senseless_ones_are_not_sent() {
    let (mut peer, mut device) = found(|settings| settings);
    open(&mut device, &mut peer);
    // A rotation may make a force longer by a rounding.
    let longest = DVec3::new(3.0, 0.0, 4.0) * (1.0 + 1e-12);
    let forces = [DVec3::new(0.1, -0.2, 0.3), DVec3::ZERO, longest];
    let refused = [
        DVec3::NAN,
        DVec3::new(0.0, f64::INFINITY, 0.0),
        DVec3::new(f64::MAX, f64::MAX, f64::MAX),
        DVec3::new(3.0, 0.1, 4.0),
    ];
    for (number, force_n) in (1..).zip(forces) {
        for force_n in refused {
            let error = device.write(force_n).unwrap_err();
            assert!(matches!(error, DeviceError::Protocol(_)), "{error}");
        }
        device.write(force_n).unwrap();
        let packet = peer.hear();
        assert_eq!(packet, Packet { session: peer.session, number, body: Body::Force(force_n) });
    }
    assert!(peer.hears_nothing());
    assert_eq!(device.monitor().counts().refused, 12);
}

#[test]
fn it_is_stopped_from_another_thread_and_goes_on() {
    let (mut peer, mut device) = found(|settings| settings);
    open(&mut device, &mut peer);
    let mut brake = device.emergency_stop().unwrap();
    device.write(DVec3::X).unwrap();
    std::thread::spawn(move || brake.stop()).join().unwrap().unwrap();
    device.write(DVec3::Y).unwrap();
    let heard: Vec<Packet> = (0..3).map(|_| peer.hear()).collect();
    for (packet, (number, force_n)) in heard.iter().zip((1..).zip([DVec3::X, DVec3::ZERO, DVec3::Y])) {
        assert_eq!((packet.number, packet.body), (number, Body::Force(force_n)));
    }
    // Leaving it says stop, whether it is closed or dropped.
    device.close().unwrap();
    assert_eq!((peer.hear().body, device.close()), (Body::Stop, Ok(())));
    open(&mut device, &mut peer);
    drop(device);
    assert_eq!(peer.hear().body, Body::Stop);
    assert!(peer.hears_nothing());
}
