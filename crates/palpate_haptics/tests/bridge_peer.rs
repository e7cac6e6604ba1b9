//! The vendor's end of a bridge, on a clock of the test's own. palpate is played by hand.

#[path = "shared/bridge.rs"]
mod ends;
#[path = "shared/wait.rs"]
mod wait;

use ends::*;
use glam::DVec3;
use palpate_haptics::bridge::packet::*;
use palpate_haptics::bridge::*;
use palpate_haptics::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use wait::wait_for;

const WATCHDOG: Duration = Duration::from_millis(20);
const START: Duration = Duration::from_secs(1000);

/// A device, a peer that serves it, and palpate in session with it at `START`.
fn in_session() -> (TestDevice, BridgePeer, Speaker) {
    let device = TestDevice::new();
    let mut peer = device.peer(WATCHDOG);
    let mut palpate = Speaker::new(peer.address());
    begin(&mut peer, &mut palpate, START);
    (device, peer, palpate)
}

fn begin(peer: &mut BridgePeer, palpate: &mut Speaker, now: Duration) {
    palpate.say(1, Body::Hello);
    wait_for(|| {
        peer.receive(now);
        peer.session() == Some(palpate.session)
    });
    assert!(matches!(palpate.hear_but_samples(), Packet { number: 1, body: Body::Welcome(_), .. }));
}

/// Says it, and turns the peer at `now` until it was heard, as `heard` tells by the counts.
fn until(peer: &mut BridgePeer, now: Duration, heard: impl Fn(BridgeCounts) -> bool) {
    wait_for(|| {
        peer.advance(now);
        heard(peer.monitor().counts())
    });
}

fn end_of(palpate: &mut Speaker) -> Body {
    palpate.hear_but_samples().body
}

#[test]
fn it_answers_a_question_and_begins_nothing() {
    let device = TestDevice::new();
    let mut peer = device.peer(WATCHDOG);
    let mut palpate = Speaker::new(peer.address());
    palpate.session = 0;
    palpate.say(9, Body::Hello);
    wait_for(|| {
        peer.advance(START);
        !palpate.hears_nothing()
    });
    let answer = palpate.hear();
    let expected = Welcome { name: Name::new("test hand"), ..welcome() };
    assert_eq!(answer, Packet { session: 0, number: 9, body: Body::Welcome(expected) });
    assert_eq!((peer.session(), peer.monitor().counts().sessions), (None, 0));
    peer.advance(START);
    assert!(palpate.hears_nothing(), "no samples either");
}

#[test]
fn forces_are_shown_in_order_and_samples_tell_which() {
    let (device, mut peer, mut palpate) = in_session();
    peer.advance(START);
    assert_eq!((peer.forces_written(), device.force_n()), (0, DVec3::ZERO));
    let force = |x: f64| Body::Force(DVec3::X * x);
    palpate.say(1, force(1.0));
    palpate.say(2, force(2.0));
    until(&mut peer, START, |counts| counts.taken == 2);
    assert_eq!(
        (peer.forces_written(), peer.force_n(), device.force_n()),
        (2, DVec3::X * 2.0, DVec3::X * 2.0)
    );
    // 4 comes before 3, which comes twice.
    for number in [4, 3, 3, 1] {
        palpate.say(number, force(number as f64));
    }
    until(&mut peer, START, |counts| counts.duplicated == 2);
    assert_eq!((peer.forces_written(), device.force_n()), (4, DVec3::X * 4.0));
    let counts = peer.monitor().counts();
    assert_eq!((counts.taken, counts.late, counts.lost), (3, 1, 0));
    // Samples are numbered without a gap, and know the force.
    let mut last = (0, 0);
    wait_for(|| {
        let Packet { number, body: Body::Sample(sampled), session } = palpate.hear() else {
            panic!("a sample")
        };
        assert_eq!((session, number), (palpate.session, last.0 + 1));
        assert!(sampled.shown >= last.1);
        last = (number, sampled.shown);
        last.1 == 4
    });
}

#[test]
fn a_sample_carries_all_of_a_reading() {
    let (device, mut peer, mut palpate) = in_session();
    let reading = Reading {
        position_m: DVec3::new(0.01, -0.02, 0.03),
        velocity_m_per_s: Some(DVec3::new(0.1, 0.2, -0.3)),
        orientation: glam::DQuat::from_rotation_z(0.7),
        buttons: 6,
        sequence: Some(1),
    };
    device.hand.lock().unwrap().reading = Ok(reading);
    peer.advance(START);
    let Packet { number, body: Body::Sample(sampled), .. } = palpate.hear() else { panic!("a sample") };
    assert_eq!(sampled.reading(number), reading);
    // What no packet can carry is not sent, and neither is what has not come.
    device.hand.lock().unwrap().reading = Ok(Reading::at(DVec3::NAN));
    peer.advance(START);
    device.hand.lock().unwrap().reading = Err(DeviceError::TimedOut);
    peer.advance(START);
    assert!(palpate.hears_nothing() && peer.session().is_some());
    assert_eq!(peer.monitor().counts().refused, 1);
}

#[test]
fn silence_lets_go_and_the_session_never_comes_back() {
    let (device, mut peer, mut palpate) = in_session();
    palpate.say(1, Body::Force(DVec3::X));
    until(&mut peer, START, |counts| counts.taken == 1);
    // Exactly as long as allowed, and then a microsecond more.
    peer.advance(START + WATCHDOG);
    assert_eq!(device.force_n(), DVec3::X);
    let now = START + WATCHDOG + Duration::from_micros(1);
    peer.advance(now);
    assert_eq!((device.force_n(), peer.force_n(), peer.session()), (DVec3::ZERO, DVec3::ZERO, None));
    assert_eq!(end_of(&mut palpate), Body::End(EndReason::Silent));
    palpate.say(2, Body::Force(DVec3::X));
    until(&mut peer, now, |counts| counts.other_session == 1);
    assert_eq!(device.force_n(), DVec3::ZERO);
    let answer = palpate.hear();
    assert_eq!((answer.session, answer.number), (palpate.session, 2));
    assert_eq!(answer.body, Body::End(EndReason::NoSession));
    palpate.session += 1;
    begin(&mut peer, &mut palpate, now);
    palpate.say(1, Body::Force(DVec3::Y));
    until(&mut peer, now, |counts| counts.taken == 2);
    assert_eq!(device.force_n(), DVec3::Y);
    assert_eq!(peer.monitor().counts().silences, 1);
}

/// However it ended, and though hellos and forces of it are still under way. Anybody else may have its number.
#[test]
fn a_late_hello_does_not_take_up_a_session_that_is_over() {
    for how in 0..3 {
        let (device, mut peer, mut palpate) = in_session();
        palpate.say(5, Body::Force(DVec3::X));
        until(&mut peer, START, |counts| counts.taken == 1);
        let mut now = START;
        match how {
            0 => palpate.say(6, Body::Stop),
            1 => now += WATCHDOG + Duration::from_micros(1),
            _ => device.hand.lock().unwrap().reading = Err(DeviceError::Disconnected),
        }
        wait_for(|| {
            peer.advance(now);
            peer.session().is_none()
        });
        device.hand.lock().unwrap().reading = Ok(Reading::at(DVec3::ZERO));
        if how > 0 {
            assert!(matches!(end_of(&mut palpate), Body::End(EndReason::Silent | EndReason::DeviceFailed)));
        }
        // Also when it comes again and again.
        for number in 2..5 {
            palpate.say(number, Body::Hello);
            palpate.say(number, Body::Force(DVec3::Y));
            let expected = Packet { session: palpate.session, number, body: Body::End(EndReason::NoSession) };
            wait_for(|| {
                peer.advance(now);
                !palpate.hears_nothing()
            });
            assert_eq!(palpate.hear_but_samples(), expected, "the hello");
            until(&mut peer, now, |counts| counts.other_session == 2 * (number - 1));
            assert_eq!(palpate.hear(), expected, "the force");
            assert_eq!((peer.session(), device.force_n()), (None, DVec3::ZERO));
        }
        let counts = peer.monitor().counts();
        assert_eq!((counts.sessions, counts.taken), (1, 1));
        // Another sender with that number, and the first one with another.
        let mut other = Speaker::new(peer.address());
        other.session = palpate.session;
        begin(&mut peer, &mut other, now);
        other.say(1, Body::Stop);
        wait_for(|| {
            peer.receive(now);
            peer.session().is_none()
        });
        palpate.session += 1;
        begin(&mut peer, &mut palpate, now);
    }
}

/// Every newer force puts the watchdog off, and nothing else does.
#[test]
fn what_is_refused_is_silence() {
    let (device, mut peer, mut palpate) = in_session();
    let ms = |ms| START + Duration::from_millis(ms);
    palpate.say(1, Body::Force(DVec3::X));
    until(&mut peer, ms(10), |counts| counts.taken == 1);
    palpate.say(2, Body::Force(DVec3::X * 2.0));
    until(&mut peer, ms(30), |counts| counts.taken == 2);
    let mut stranger = Speaker::new(peer.address());
    stranger.session = palpate.session;
    stranger.say(3, Body::Force(DVec3::Z));
    stranger.say(4, Body::Stop);
    // Longer than the device's largest force; older; again; of another session; not a number; too short; palpate's to receive.
    palpate.say(5, Body::Force(DVec3::splat(3.0)));
    palpate.say(1, Body::Force(DVec3::Z));
    palpate.say(2, Body::Force(DVec3::Z));
    let session = std::mem::replace(&mut palpate.session, 1);
    palpate.say(9, Body::Force(DVec3::Z));
    palpate.say(10, Body::Stop);
    palpate.session = session;
    let mut bytes = [0; MAX_SIZE];
    let force = Packet { session, number: 6, body: Body::Force(DVec3::ZERO) };
    let length = force.encode(&mut bytes).unwrap().len();
    palpate.bytes(&bytes[..length - 1]);
    bytes[40..48].copy_from_slice(&f64::NAN.to_le_bytes());
    palpate.bytes(&bytes[..length]);
    palpate.say(7, Body::Sample(sampled(0.0)));
    palpate.say(2, Body::Hello);
    until(&mut peer, ms(50), |counts| counts.corrupt == 3);
    wait_for(|| {
        peer.advance(ms(50));
        !palpate.hears_nothing() && matches!(palpate.hear().body, Body::Welcome(_))
    });
    assert_eq!((device.force_n(), peer.forces_written()), (DVec3::X * 2.0, 2));
    let counts = peer.monitor().counts();
    assert_eq!((counts.foreign, counts.refused, counts.other_session), (2, 1, 2));
    assert_eq!((counts.taken, counts.duplicated, counts.lost), (2, 2, 0));
    peer.advance(ms(51));
    assert_eq!((device.force_n(), peer.session()), (DVec3::ZERO, None));
}

/// What waits to be read after a pause is old.
#[test]
fn a_peer_that_slept_lets_go_first() {
    let (device, mut peer, mut palpate) = in_session();
    palpate.say(1, Body::Force(DVec3::X));
    until(&mut peer, START, |counts| counts.taken == 1);
    palpate.say(2, Body::Force(DVec3::X * 2.0));
    until(&mut peer, START + Duration::from_secs(1), |counts| counts.other_session == 1);
    let forces = device.hand.lock().unwrap().forces.clone();
    assert_eq!((forces.last(), forces.contains(&(DVec3::X * 2.0))), (Some(&DVec3::ZERO), false));
    assert_eq!(end_of(&mut palpate), Body::End(EndReason::Silent));
    assert_eq!(end_of(&mut palpate), Body::End(EndReason::NoSession));
}

#[test]
fn stop_lets_go_at_once() {
    let (device, mut peer, palpate) = in_session();
    palpate.say(1, Body::Force(DVec3::X));
    until(&mut peer, START, |counts| counts.taken == 1);
    palpate.say(2, Body::Stop);
    wait_for(|| {
        peer.receive(START);
        peer.session().is_none()
    });
    assert_eq!(device.force_n(), DVec3::ZERO, "before the turn is over");
    assert!(device.hand.lock().unwrap().is_open, "the device waits for the next session");
}

#[test]
fn another_one_is_told_that_the_peer_is_busy() {
    let (_device, mut peer, palpate) = in_session();
    let mut other = Speaker::new(peer.address());
    other.session = 77;
    other.say(3, Body::Hello);
    wait_for(|| {
        peer.advance(START);
        !other.hears_nothing()
    });
    assert_eq!(other.hear(), Packet { session: 77, number: 3, body: Body::End(EndReason::Busy) });
    assert_eq!(peer.session(), Some(palpate.session));
}

#[test]
fn a_hello_of_another_version_is_answered() {
    let mut peer = TestDevice::new().peer(WATCHDOG);
    let mut palpate = Speaker::new(peer.address());
    let mut bytes = [0; MAX_SIZE];
    let hello = Packet { session: 5, number: 6, body: Body::Hello };
    let length = hello.encode(&mut bytes).unwrap().len();
    for version in [0, 2, 200] {
        bytes[4] = version;
        palpate.bytes(&bytes[..length]);
        wait_for(|| {
            peer.advance(START);
            !palpate.hears_nothing()
        });
        let end = Body::End(EndReason::OtherVersion);
        assert_eq!(palpate.hear(), Packet { session: 5, number: 6, body: end });
    }
    assert_eq!((peer.session(), peer.monitor().counts().corrupt), (None, 3));
}

#[test]
fn a_device_that_fails_ends_the_session_and_is_opened_anew_for_the_next() {
    for is_deaf in [false, true] {
        let (device, mut peer, mut palpate) = in_session();
        {
            let mut hand = device.hand.lock().unwrap();
            if is_deaf {
                hand.written = Err(DeviceError::Os(5));
            } else {
                hand.reading = Err(DeviceError::Disconnected);
            }
            hand.opened = Err(DeviceError::Disconnected);
        }
        peer.advance(START);
        assert_eq!((end_of(&mut palpate), peer.session()), (Body::End(EndReason::DeviceFailed), None));
        palpate.session += 1;
        palpate.say(1, Body::Hello);
        wait_for(|| {
            peer.advance(START);
            !palpate.hears_nothing()
        });
        assert_eq!((end_of(&mut palpate), peer.session()), (Body::End(EndReason::DeviceFailed), None));
        {
            let mut hand = device.hand.lock().unwrap();
            (hand.opened, hand.written, hand.reading) = (Ok(()), Ok(()), Ok(Reading::at(DVec3::ZERO)));
        }
        begin(&mut peer, &mut palpate, START);
        assert!(device.hand.lock().unwrap().is_open);
    }
}

/// A device that shows a newton when its `written` becomes an error; palpate is gone and never comes back.
fn left_with_a_force(written: DeviceError, panics: bool) -> (TestDevice, BridgePeer) {
    let (device, mut peer, palpate) = in_session();
    palpate.say(1, Body::Force(DVec3::X));
    until(&mut peer, START, |counts| counts.taken == 1);
    let mut hand = device.hand.lock().unwrap();
    (hand.written, hand.panics) = (Err(written), panics);
    drop(hand);
    (device, peer)
}

#[test]
fn a_device_that_fails_is_zeroed_until_it_obeys_though_palpate_is_gone() {
    let ms = |ms| START + Duration::from_millis(ms);
    for (written, panics) in
        [(DeviceError::Os(5), false), (DeviceError::Os(5), true), (DeviceError::TimedOut, false)]
    {
        let (device, mut peer) = left_with_a_force(written, panics);
        for now in 1..=80 {
            peer.advance(ms(now));
            let hand = device.hand.lock().unwrap();
            assert_eq!((hand.forces.last(), hand.is_open), (Some(&DVec3::X), true), "{written}, {now} ms");
        }
        // A device that only timed out was let go when palpate had been silent for too long.
        assert_eq!(peer.session(), None, "{written}");
        device.hand.lock().unwrap().written = Ok(());
        peer.advance(ms(81));
        assert_eq!(device.force_n(), DVec3::ZERO, "{written}");
        // Another failure has 100 ms of its own, and a device that obeys stays open.
        for (now, written) in [(90, Err(written)), (189, Err(written)), (190, Ok(())), (500, Ok(()))] {
            device.hand.lock().unwrap().written = written;
            let writes = device.hand.lock().unwrap().writes;
            peer.advance(ms(now));
            let hand = device.hand.lock().unwrap();
            assert!(hand.writes > writes && hand.is_open, "at every turn: {now} ms");
        }
    }
}

#[test]
fn a_device_that_cannot_be_zeroed_for_100_ms_is_closed() {
    let ms = |ms| START + Duration::from_millis(ms);
    for panics in [false, true] {
        let (device, mut peer) = left_with_a_force(DeviceError::Os(5), panics);
        let state = || {
            let hand = device.hand.lock().unwrap();
            (hand.is_open, hand.closes)
        };
        for now in [1, 2, 50, 100] {
            peer.advance(ms(now));
            assert_eq!(state(), (true, 0), "{now} ms");
        }
        // The first zero that failed was that of the first turn, at 1 ms.
        peer.advance(ms(101));
        assert_eq!(state(), (false, 1));
        let writes = device.hand.lock().unwrap().writes;
        peer.advance(ms(102));
        assert_eq!(state(), (false, 1), "closed once");
        assert_eq!(device.hand.lock().unwrap().writes, writes, "and left alone");
        // The next session opens it.
        device.hand.lock().unwrap().written = Ok(());
        let mut palpate = Speaker::new(peer.address());
        begin(&mut peer, &mut palpate, ms(103));
        peer.advance(ms(103));
        assert_eq!((device.force_n(), state()), (DVec3::ZERO, (true, 1)));
        drop(peer);
        assert_eq!(state(), (false, 2));
    }
}

/// Whatever it was that panicked, palpate hears of a device that failed.
#[test]
fn a_driver_that_panics_is_a_device_that_fails() {
    let (device, mut peer, mut palpate) = in_session();
    palpate.say(1, Body::Force(DVec3::X));
    until(&mut peer, START, |counts| counts.taken == 1);
    {
        let mut hand = device.hand.lock().unwrap();
        (hand.reading, hand.panics) = (Err(DeviceError::Disconnected), true);
    }
    peer.advance(START);
    assert_eq!((end_of(&mut palpate), peer.session()), (Body::End(EndReason::DeviceFailed), None));
    assert_eq!(device.force_n(), DVec3::ZERO);
}

#[test]
fn a_peer_that_ends_says_so_and_leaves_zero_force() {
    for how in 0..3 {
        let (device, mut peer, mut palpate) = in_session();
        palpate.say(1, Body::Force(DVec3::X));
        until(&mut peer, START, |counts| counts.taken == 1);
        match how {
            0 => drop(peer),
            1 => peer.close(),
            // One that is stopped before it begins.
            _ => peer.run(&AtomicBool::new(true)),
        }
        assert_eq!(end_of(&mut palpate), Body::End(EndReason::Closing));
        let hand = device.hand.lock().unwrap();
        assert_eq!((hand.forces.last(), hand.is_open), (Some(&DVec3::ZERO), false));
    }
}

#[test]
fn a_peer_runs_at_its_rate_until_it_is_stopped() {
    let device = TestDevice::new();
    let mut peer = device.peer(Duration::from_secs(1));
    let mut palpate = Speaker::new(peer.address());
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| peer.run(&stop));
        palpate.say(1, Body::Hello);
        let mut number = 0;
        while number < 50 {
            let packet = palpate.hear();
            if matches!(packet.body, Body::Sample(_)) {
                number = packet.number;
                palpate.say(number, Body::Force(DVec3::X));
            }
        }
        wait_for(|| device.force_n() == DVec3::X);
        stop.store(true, Ordering::SeqCst);
    });
    assert_eq!(device.force_n(), DVec3::ZERO);
    assert!(!device.hand.lock().unwrap().is_open);
}

#[test]
fn a_device_that_cannot_be_served_is_refused() {
    let bind = |device: TestDevice| {
        let settings = PeerSettings { address: any_port(), ..PeerSettings::default() };
        BridgePeer::bind(settings, Box::new(device)).map(|_| ())
    };
    let closed = TestDevice::new();
    closed.hand.lock().unwrap().opened = Err(DeviceError::Os(13));
    assert!(matches!(bind(closed), Err(BridgeError::Device(DeviceError::Os(13)))));
    let mut senseless = TestDevice::new();
    senseless.description.max_force_n = f64::NAN;
    assert!(matches!(bind(senseless), Err(BridgeError::Setting(_))));
    let mut beyond = TestDevice::new();
    beyond.description.max_force_n = 2000.0;
    let refused = bind(beyond).unwrap_err();
    let of_packet = std::error::Error::source(&refused).unwrap().to_string();
    assert_eq!(of_packet, "largest force, N is 2000; it must be 0 to 1000");
    // The port of another peer.
    let first = TestDevice::new().peer(WATCHDOG);
    let settings = PeerSettings { address: first.address(), ..PeerSettings::default() };
    let second = BridgePeer::bind(settings, Box::new(TestDevice::new()));
    assert!(matches!(second, Err(BridgeError::Socket { address, .. }) if address == first.address()));
}
