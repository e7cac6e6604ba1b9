//! The peer, with a simulated clock. The test plays palpate.

use crate::ends::*;
use crate::wait::wait_for;
use glam::DVec3;
use palpate_haptics::bridge::packet::*;
use palpate_haptics::bridge::*;
use palpate_haptics::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

const WATCHDOG: Duration = Duration::from_millis(20);
const START: Duration = Duration::from_secs(1000);

/// A device, a peer that serves it, and palpate's end with a session started at `START`.
fn in_session() -> (TestDevice, BridgePeer, ManualEnd) {
    let device = TestDevice::new();
    let mut peer = device.peer(WATCHDOG);
    let mut palpate = ManualEnd::new(peer.address());
    start_session(&mut peer, &mut palpate, START);
    (device, peer, palpate)
}

fn start_session(peer: &mut BridgePeer, palpate: &mut ManualEnd, now: Duration) {
    palpate.send(1, Body::Hello);
    wait_for(|| {
        peer.receive(now);
        peer.session() == Some(palpate.session)
    });
    assert!(matches!(palpate.receive_except_samples(), Packet { number: 1, body: Body::Welcome(_), .. }));
}

/// Advances the peer at time `now` until its counts satisfy `done`.
fn advance_until(peer: &mut BridgePeer, now: Duration, done: impl Fn(BridgeCounts) -> bool) {
    wait_for(|| {
        peer.advance(now);
        done(peer.monitor().counts())
    });
}

fn end_of(palpate: &mut ManualEnd) -> Body {
    palpate.receive_except_samples().body
}

#[test]
fn replies_to_description_request_without_session() {
    let device = TestDevice::new();
    let mut peer = device.peer(WATCHDOG);
    let mut palpate = ManualEnd::new(peer.address());
    palpate.session = 0;
    palpate.send(9, Body::Hello);
    wait_for(|| {
        peer.advance(START);
        !palpate.receives_nothing()
    });
    let reply = palpate.receive();
    let expected = Welcome { name: Name::new("test hand"), ..welcome() };
    assert_eq!(reply, Packet { session: 0, number: 9, body: Body::Welcome(expected) });
    assert_eq!((peer.session(), peer.monitor().counts().sessions), (None, 0));
    peer.advance(START);
    assert!(palpate.receives_nothing(), "no samples either");
}

#[test]
fn applies_newest_force_and_samples_report_its_number() {
    let (device, mut peer, mut palpate) = in_session();
    peer.advance(START);
    assert_eq!((peer.forces_written(), device.force_n()), (0, DVec3::ZERO));
    let force = |x: f64| Body::Force(DVec3::X * x);
    palpate.send(1, force(1.0));
    palpate.send(2, force(2.0));
    advance_until(&mut peer, START, |counts| counts.accepted == 2);
    assert_eq!(
        (peer.forces_written(), peer.force_n(), device.force_n()),
        (2, DVec3::X * 2.0, DVec3::X * 2.0)
    );
    // 4 arrives before 3, which arrives twice.
    for number in [4, 3, 3, 1] {
        palpate.send(number, force(number as f64));
    }
    advance_until(&mut peer, START, |counts| counts.duplicated == 2);
    assert_eq!((peer.forces_written(), device.force_n()), (4, DVec3::X * 4.0));
    let counts = peer.monitor().counts();
    assert_eq!((counts.accepted, counts.late, counts.lost), (3, 1, 0));
    // Samples are numbered without a gap, and contain the number of the force.
    let mut last = (0, 0);
    wait_for(|| {
        let Packet { number, body: Body::Sample(sampled), session } = palpate.receive() else {
            panic!("a sample")
        };
        assert_eq!((session, number), (palpate.session, last.0 + 1));
        assert!(sampled.shown >= last.1);
        last = (number, sampled.shown);
        last.1 == 4
    });
}

#[test]
fn sample_contains_all_data_of_reading() {
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
    let Packet { number, body: Body::Sample(sampled), .. } = palpate.receive() else { panic!("a sample") };
    assert_eq!(sampled.reading(number), reading);
    // Neither a reading out of range nor a timeout gives a sample.
    device.hand.lock().unwrap().reading = Ok(Reading::at(DVec3::NAN));
    peer.advance(START);
    device.hand.lock().unwrap().reading = Err(DeviceError::TimedOut);
    peer.advance(START);
    assert!(palpate.receives_nothing() && peer.session().is_some());
    assert_eq!(peer.monitor().counts().rejected, 1);
}

#[test]
fn watchdog_sets_zero_force_and_ends_session_finally() {
    let (device, mut peer, mut palpate) = in_session();
    palpate.send(1, Body::Force(DVec3::X));
    advance_until(&mut peer, START, |counts| counts.accepted == 1);
    // Exactly the watchdog time, then one microsecond more.
    peer.advance(START + WATCHDOG);
    assert_eq!(device.force_n(), DVec3::X);
    let now = START + WATCHDOG + Duration::from_micros(1);
    peer.advance(now);
    assert_eq!((device.force_n(), peer.force_n(), peer.session()), (DVec3::ZERO, DVec3::ZERO, None));
    assert_eq!(end_of(&mut palpate), Body::End(EndReason::Silent));
    palpate.send(2, Body::Force(DVec3::X));
    advance_until(&mut peer, now, |counts| counts.other_session == 1);
    assert_eq!(device.force_n(), DVec3::ZERO);
    let reply = palpate.receive();
    assert_eq!((reply.session, reply.number), (palpate.session, 2));
    assert_eq!(reply.body, Body::End(EndReason::NoSession));
    palpate.session += 1;
    start_session(&mut peer, &mut palpate, now);
    palpate.send(1, Body::Force(DVec3::Y));
    advance_until(&mut peer, now, |counts| counts.accepted == 2);
    assert_eq!(device.force_n(), DVec3::Y);
    assert_eq!(peer.monitor().counts().silences, 1);
}

/// This holds for every kind of end, with hellos and forces of the session still in transit. Another sender may use the same number.
#[test]
fn late_hello_does_not_resume_ended_session() {
    for how in 0..3 {
        let (device, mut peer, mut palpate) = in_session();
        palpate.send(5, Body::Force(DVec3::X));
        advance_until(&mut peer, START, |counts| counts.accepted == 1);
        let mut now = START;
        match how {
            0 => palpate.send(6, Body::Stop),
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
        // Also after repeated hellos.
        for number in 2..5 {
            palpate.send(number, Body::Hello);
            palpate.send(number, Body::Force(DVec3::Y));
            let expected = Packet { session: palpate.session, number, body: Body::End(EndReason::NoSession) };
            wait_for(|| {
                peer.advance(now);
                !palpate.receives_nothing()
            });
            assert_eq!(palpate.receive_except_samples(), expected, "the hello");
            advance_until(&mut peer, now, |counts| counts.other_session == 2 * (number - 1));
            assert_eq!(palpate.receive(), expected, "the force");
            assert_eq!((peer.session(), device.force_n()), (None, DVec3::ZERO));
        }
        let counts = peer.monitor().counts();
        assert_eq!((counts.sessions, counts.accepted), (1, 1));
        // Another sender with the same number, and the first one with another number.
        let mut other = ManualEnd::new(peer.address());
        other.session = palpate.session;
        start_session(&mut peer, &mut other, now);
        other.send(1, Body::Stop);
        wait_for(|| {
            peer.receive(now);
            peer.session().is_none()
        });
        palpate.session += 1;
        start_session(&mut peer, &mut palpate, now);
    }
}

/// Only a newer force resets the watchdog.
#[test]
fn rejected_packets_do_not_reset_watchdog() {
    let (device, mut peer, mut palpate) = in_session();
    let ms = |ms| START + Duration::from_millis(ms);
    palpate.send(1, Body::Force(DVec3::X));
    advance_until(&mut peer, ms(10), |counts| counts.accepted == 1);
    palpate.send(2, Body::Force(DVec3::X * 2.0));
    advance_until(&mut peer, ms(30), |counts| counts.accepted == 2);
    let mut stranger = ManualEnd::new(peer.address());
    stranger.session = palpate.session;
    stranger.send(3, Body::Force(DVec3::Z));
    stranger.send(4, Body::Stop);
    // Above the device's maximum; older; duplicate; of another session; NaN; too short; a kind that only the peer sends.
    palpate.send(5, Body::Force(DVec3::splat(3.0)));
    palpate.send(1, Body::Force(DVec3::Z));
    palpate.send(2, Body::Force(DVec3::Z));
    let session = std::mem::replace(&mut palpate.session, 1);
    palpate.send(9, Body::Force(DVec3::Z));
    palpate.send(10, Body::Stop);
    palpate.session = session;
    let mut bytes = [0; MAX_SIZE];
    let force = Packet { session, number: 6, body: Body::Force(DVec3::ZERO) };
    let length = force.encode(&mut bytes).unwrap().len();
    palpate.send_bytes(&bytes[..length - 1]);
    bytes[40..48].copy_from_slice(&f64::NAN.to_le_bytes());
    palpate.send_bytes(&bytes[..length]);
    palpate.send(7, Body::Sample(sampled(0.0)));
    palpate.send(2, Body::Hello);
    advance_until(&mut peer, ms(50), |counts| counts.corrupt == 3);
    wait_for(|| {
        peer.advance(ms(50));
        !palpate.receives_nothing() && matches!(palpate.receive().body, Body::Welcome(_))
    });
    assert_eq!((device.force_n(), peer.forces_written()), (DVec3::X * 2.0, 2));
    let counts = peer.monitor().counts();
    assert_eq!((counts.foreign, counts.rejected, counts.other_session), (2, 1, 2));
    assert_eq!((counts.accepted, counts.duplicated, counts.lost), (2, 2, 0));
    peer.advance(ms(51));
    assert_eq!((device.force_n(), peer.session()), (DVec3::ZERO, None));
}

/// Packets that waited during a pause of the peer are old.
#[test]
fn peer_ends_session_after_its_own_pause_before_receiving() {
    let (device, mut peer, mut palpate) = in_session();
    palpate.send(1, Body::Force(DVec3::X));
    advance_until(&mut peer, START, |counts| counts.accepted == 1);
    palpate.send(2, Body::Force(DVec3::X * 2.0));
    advance_until(&mut peer, START + Duration::from_secs(1), |counts| counts.other_session == 1);
    let forces = device.hand.lock().unwrap().forces.clone();
    assert_eq!((forces.last(), forces.contains(&(DVec3::X * 2.0))), (Some(&DVec3::ZERO), false));
    assert_eq!(end_of(&mut palpate), Body::End(EndReason::Silent));
    assert_eq!(end_of(&mut palpate), Body::End(EndReason::NoSession));
}

#[test]
fn stop_sets_zero_force_at_once() {
    let (device, mut peer, palpate) = in_session();
    palpate.send(1, Body::Force(DVec3::X));
    advance_until(&mut peer, START, |counts| counts.accepted == 1);
    palpate.send(2, Body::Stop);
    wait_for(|| {
        peer.receive(START);
        peer.session().is_none()
    });
    assert_eq!(device.force_n(), DVec3::ZERO, "before the end of the cycle");
    assert!(device.hand.lock().unwrap().is_open, "the device stays open for the next session");
}

#[test]
fn second_client_gets_busy() {
    let (_device, mut peer, palpate) = in_session();
    let mut other = ManualEnd::new(peer.address());
    other.session = 77;
    other.send(3, Body::Hello);
    wait_for(|| {
        peer.advance(START);
        !other.receives_nothing()
    });
    assert_eq!(other.receive(), Packet { session: 77, number: 3, body: Body::End(EndReason::Busy) });
    assert_eq!(peer.session(), Some(palpate.session));
}

#[test]
fn replies_to_hello_of_another_version() {
    let mut peer = TestDevice::new().peer(WATCHDOG);
    let mut palpate = ManualEnd::new(peer.address());
    let mut bytes = [0; MAX_SIZE];
    let hello = Packet { session: 5, number: 6, body: Body::Hello };
    let length = hello.encode(&mut bytes).unwrap().len();
    for version in [0, 2, 200] {
        bytes[4] = version;
        palpate.send_bytes(&bytes[..length]);
        wait_for(|| {
            peer.advance(START);
            !palpate.receives_nothing()
        });
        let end = Body::End(EndReason::OtherVersion);
        assert_eq!(palpate.receive(), Packet { session: 5, number: 6, body: end });
    }
    assert_eq!((peer.session(), peer.monitor().counts().corrupt), (None, 3));
}

#[test]
fn failed_device_ends_session_and_is_reopened_for_next() {
    for fails_to_write in [false, true] {
        let (device, mut peer, mut palpate) = in_session();
        {
            let mut hand = device.hand.lock().unwrap();
            if fails_to_write {
                hand.written = Err(DeviceError::Os(5));
            } else {
                hand.reading = Err(DeviceError::Disconnected);
            }
            hand.opened = Err(DeviceError::Disconnected);
        }
        peer.advance(START);
        assert_eq!((end_of(&mut palpate), peer.session()), (Body::End(EndReason::DeviceFailed), None));
        palpate.session += 1;
        palpate.send(1, Body::Hello);
        wait_for(|| {
            peer.advance(START);
            !palpate.receives_nothing()
        });
        assert_eq!((end_of(&mut palpate), peer.session()), (Body::End(EndReason::DeviceFailed), None));
        {
            let mut hand = device.hand.lock().unwrap();
            (hand.opened, hand.written, hand.reading) = (Ok(()), Ok(()), Ok(Reading::at(DVec3::ZERO)));
        }
        start_session(&mut peer, &mut palpate, START);
        assert!(device.hand.lock().unwrap().is_open);
    }
}

/// A device at 1 N whose writes then fail with `written`; palpate sends nothing any more.
fn failing_at_1_n(written: DeviceError, panics: bool) -> (TestDevice, BridgePeer) {
    let (device, mut peer, palpate) = in_session();
    palpate.send(1, Body::Force(DVec3::X));
    advance_until(&mut peer, START, |counts| counts.accepted == 1);
    let mut hand = device.hand.lock().unwrap();
    (hand.written, hand.panics) = (Err(written), panics);
    drop(hand);
    (device, peer)
}

#[test]
fn failed_device_gets_zero_force_until_write_succeeds_without_palpate() {
    let ms = |ms| START + Duration::from_millis(ms);
    for (written, panics) in
        [(DeviceError::Os(5), false), (DeviceError::Os(5), true), (DeviceError::TimedOut, false)]
    {
        let (device, mut peer) = failing_at_1_n(written, panics);
        for now in 1..=80 {
            peer.advance(ms(now));
            let hand = device.hand.lock().unwrap();
            assert_eq!((hand.forces.last(), hand.is_open), (Some(&DVec3::X), true), "{written}, {now} ms");
        }
        // For a device that only timed out, the watchdog has ended the session.
        assert_eq!(peer.session(), None, "{written}");
        device.hand.lock().unwrap().written = Ok(());
        peer.advance(ms(81));
        assert_eq!(device.force_n(), DVec3::ZERO, "{written}");
        // Another failure has its own 100 ms, and a device whose write succeeds stays open.
        for (now, written) in [(90, Err(written)), (189, Err(written)), (190, Ok(())), (500, Ok(()))] {
            device.hand.lock().unwrap().written = written;
            let writes = device.hand.lock().unwrap().writes;
            peer.advance(ms(now));
            let hand = device.hand.lock().unwrap();
            assert!(hand.writes > writes && hand.is_open, "in every cycle: {now} ms");
        }
    }
}

#[test]
fn closes_device_after_100_ms_of_failed_zero_force() {
    let ms = |ms| START + Duration::from_millis(ms);
    for panics in [false, true] {
        let (device, mut peer) = failing_at_1_n(DeviceError::Os(5), panics);
        let state = || {
            let hand = device.hand.lock().unwrap();
            (hand.is_open, hand.closes)
        };
        for now in [1, 2, 50, 100] {
            peer.advance(ms(now));
            assert_eq!(state(), (true, 0), "{now} ms");
        }
        // The first failed write of zero force was at 1 ms.
        peer.advance(ms(101));
        assert_eq!(state(), (false, 1));
        let writes = device.hand.lock().unwrap().writes;
        peer.advance(ms(102));
        assert_eq!(state(), (false, 1), "closed once");
        assert_eq!(device.hand.lock().unwrap().writes, writes, "and not written again");
        // The next session opens the device.
        device.hand.lock().unwrap().written = Ok(());
        let mut palpate = ManualEnd::new(peer.address());
        start_session(&mut peer, &mut palpate, ms(103));
        peer.advance(ms(103));
        assert_eq!((device.force_n(), state()), (DVec3::ZERO, (true, 1)));
        drop(peer);
        assert_eq!(state(), (false, 2));
    }
}

/// palpate receives `DeviceFailed` for any panic of the driver.
#[test]
fn driver_panic_counts_as_device_failure() {
    let (device, mut peer, mut palpate) = in_session();
    palpate.send(1, Body::Force(DVec3::X));
    advance_until(&mut peer, START, |counts| counts.accepted == 1);
    {
        let mut hand = device.hand.lock().unwrap();
        (hand.reading, hand.panics) = (Err(DeviceError::Disconnected), true);
    }
    peer.advance(START);
    assert_eq!((end_of(&mut palpate), peer.session()), (Body::End(EndReason::DeviceFailed), None));
    assert_eq!(device.force_n(), DVec3::ZERO);
}

#[test]
fn closing_peer_reports_end_and_sets_zero_force() {
    for how in 0..3 {
        let (device, mut peer, mut palpate) = in_session();
        palpate.send(1, Body::Force(DVec3::X));
        advance_until(&mut peer, START, |counts| counts.accepted == 1);
        match how {
            0 => drop(peer),
            1 => peer.close(),
            // Stopped before the first cycle.
            _ => peer.run(&AtomicBool::new(true)),
        }
        assert_eq!(end_of(&mut palpate), Body::End(EndReason::Closing));
        let hand = device.hand.lock().unwrap();
        assert_eq!((hand.forces.last(), hand.is_open), (Some(&DVec3::ZERO), false));
    }
}

#[test]
fn run_serves_at_device_rate_until_stopped() {
    let device = TestDevice::new();
    let mut peer = device.peer(Duration::from_secs(1));
    let mut palpate = ManualEnd::new(peer.address());
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| peer.run(&stop));
        palpate.send(1, Body::Hello);
        let mut number = 0;
        while number < 50 {
            let packet = palpate.receive();
            if matches!(packet.body, Body::Sample(_)) {
                number = packet.number;
                palpate.send(number, Body::Force(DVec3::X));
            }
        }
        wait_for(|| device.force_n() == DVec3::X);
        stop.store(true, Ordering::SeqCst);
    });
    assert_eq!(device.force_n(), DVec3::ZERO);
    assert!(!device.hand.lock().unwrap().is_open);
}

#[test]
fn bind_rejects_devices_that_cannot_be_served() {
    let bind = |device: TestDevice| {
        let settings = PeerSettings { address: any_port(), ..PeerSettings::default() };
        BridgePeer::bind(settings, Box::new(device)).map(|_| ())
    };
    let closed = TestDevice::new();
    closed.hand.lock().unwrap().opened = Err(DeviceError::Os(13));
    assert!(matches!(bind(closed), Err(BridgeError::Device(DeviceError::Os(13)))));
    let mut invalid = TestDevice::new();
    invalid.description.max_force_n = f64::NAN;
    assert!(matches!(bind(invalid), Err(BridgeError::Setting(_))));
    let mut beyond = TestDevice::new();
    beyond.description.max_force_n = 2000.0;
    let rejected = bind(beyond).unwrap_err();
    let BridgeError::Description(PacketError::OutOfRange { value: 2000.0, min: 0.0, max: 1000.0, .. }) =
        rejected
    else {
        panic!("{rejected:?}")
    };
    // A port in use by another peer.
    let first = TestDevice::new().peer(WATCHDOG);
    let settings = PeerSettings { address: first.address(), ..PeerSettings::default() };
    let second = BridgePeer::bind(settings, Box::new(TestDevice::new()));
    assert!(matches!(second, Err(BridgeError::Socket { address, .. }) if address == first.address()));
}
