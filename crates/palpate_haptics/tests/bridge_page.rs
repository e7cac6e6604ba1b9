//! Extracts the C++ peer from `docs/bridge.md`, compiles it and tests it against the protocol, which keeps page and protocol
//! consistent.

#![cfg(unix)]

use crate::ends::ManualEnd;
use crate::wait::wait_for;
use glam::DVec3;
use palpate_haptics::bridge::packet::*;
use palpate_haptics::bridge::*;
use palpate_haptics::*;
use std::io::{BufRead, BufReader, Write};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

const TICK: Duration = Duration::from_millis(1);
const PAGE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/bridge.md");
/// Stiffness of the simulated hand's spring, N/m.
const STIFFNESS: f64 = 200.0;

/// The page's only block of C++.
fn source() -> String {
    let page = std::fs::read_to_string(PAGE).unwrap();
    let blocks: Vec<&str> = page.split("```cpp\n").skip(1).collect();
    assert_eq!(blocks.len(), 1, "blocks of C++ on the page");
    blocks[0].split_once("```\n").unwrap().0.to_owned()
}

/// Compiles the page's peer; `None` without a compiler.
fn compiled(folder: &Path) -> Option<PathBuf> {
    let program = folder.join("peer");
    let compiler = Command::new("c++")
        .args(["-x", "c++", "-std=c++17", "-O1", "-Wall", "-Wextra", "-pthread", "-", "-o"])
        .arg(&program)
        .stdin(Stdio::piped())
        .spawn();
    let mut compiler = match compiler {
        Ok(compiler) => compiler,
        Err(error) => {
            let _ = writeln!(std::io::stderr(), "skipped: the page's peer needs the compiler c++: {error}");
            return None;
        }
    };
    compiler.stdin.take().unwrap().write_all(source().as_bytes()).unwrap();
    assert!(compiler.wait().unwrap().success(), "the page's peer does not compile");
    Some(program)
}

/// A running peer, killed on drop.
struct Running(Child, SocketAddr);

impl Running {
    fn start(program: &Path, port: u16) -> Self {
        let mut child = Command::new(program).arg(port.to_string()).stdout(Stdio::piped()).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let address = line.trim_end().strip_prefix("listening on ").unwrap().parse().unwrap();
        Self(child, address)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Runs ticks with force `force_n` until `done`. Reopens the device after the end of a session, since on a busy machine the peer's
/// watchdog may expire.
fn tick_until(device: &mut BridgeDevice, force_n: DVec3, mut done: impl FnMut(&Reading) -> bool) {
    wait_for(|| {
        let reading = device.read(TICK);
        let written = device.write(force_n);
        if [reading.err(), written.err()].contains(&Some(DeviceError::Disconnected)) {
            device.close().unwrap();
            device.open().unwrap();
        }
        reading.is_ok_and(|reading| done(&reading))
    });
}

/// Sends packets that a [`BridgeDevice`] never sends.
fn rejects_invalid_packets(peer: SocketAddr) {
    let mut palpate = ManualEnd::new(peer);
    let expect_end = |palpate: &mut ManualEnd, number, body| {
        assert_eq!(
            palpate.receive_except_samples(),
            Packet { session: palpate.session, number, body: Body::End(body) }
        );
    };
    palpate.send(4, Body::Force(DVec3::X));
    expect_end(&mut palpate, 4, EndReason::NoSession);
    let mut bytes = [0; MAX_SIZE];
    let hello = Packet { session: palpate.session, number: 3, body: Body::Hello };
    let length = hello.encode(&mut bytes).unwrap().len();
    bytes[4] = 9;
    palpate.send_bytes(&bytes[..length]);
    expect_end(&mut palpate, 3, EndReason::OtherVersion);
    // The peer does not reply to truncated, oversized or empty packets, nor to the invalid packets of the following session.
    bytes[4] = 1;
    for invalid in [&bytes[..length - 1], &bytes[..], &[], b"PLPB"] {
        palpate.send_bytes(invalid);
    }
    wait_for(|| {
        // Another session if a busy machine ended this one too early.
        palpate.session += 1;
        palpate.send(1, Body::Hello);
        palpate.send(5, Body::Force(DVec3::X));
        palpate.send(3, Body::Force(DVec3::Y));
        palpate.send(6, Body::Force(DVec3::splat(3.0)));
        let force = Packet { session: palpate.session, number: 7, body: Body::Force(DVec3::ZERO) };
        let length = force.encode(&mut bytes).unwrap().len();
        bytes[32..40].copy_from_slice(&f64::NAN.to_le_bytes());
        palpate.send_bytes(&bytes[..length]);
        let (mut other, mut newest, mut last) = (ManualEnd::new(peer), 0, 0);
        other.session = 1;
        other.send(8, Body::Force(DVec3::Z));
        loop {
            let packet = palpate.receive();
            assert_eq!(packet.session, palpate.session);
            match packet.body {
                Body::Sample(Sampled { position_m, shown, .. }) => {
                    assert_eq!(packet.number, last + 1);
                    assert!([0, 5].contains(&shown) && shown >= newest, "{shown}");
                    assert_eq!((position_m.y, position_m.z), (0.0, 0.0));
                    (newest, last) = (shown, packet.number);
                }
                Body::End(EndReason::Silent) => break,
                body => {
                    assert!(matches!(body, Body::Welcome(_) | Body::End(EndReason::NoSession)), "{body:?}");
                }
            }
        }
        assert_eq!(other.receive().body, Body::End(EndReason::NoSession));
        // The peer replied to each force after the end.
        while !palpate.receives_nothing() {
            palpate.receive();
        }
        newest == 5
    });
}

/// A hello of the last ended session, from its owner, starts no session and makes no force of it valid.
fn never_resumes_ended_session(peer: SocketAddr) {
    let (mut palpate, mut newer) = (ManualEnd::new(peer), ManualEnd::new(peer));
    let no_session = Body::End(EndReason::NoSession);
    // The page's peer serves one session at a time: the previous one must end first.
    wait_for(|| {
        palpate.session += 1;
        palpate.send(1, Body::Hello);
        matches!(palpate.receive_except_samples().body, Body::Welcome(_))
    });
    palpate.send(2, Body::Stop);
    // Skips samples in transit, and an end caused by a busy machine.
    for number in 3..6 {
        palpate.send(number, Body::Hello);
        palpate.send(number, Body::Force(DVec3::X));
        for what in ["hello", "force"] {
            let reply = loop {
                let packet = palpate.receive_except_samples();
                if packet.number == number {
                    break packet;
                }
            };
            assert_eq!((reply.session, reply.body), (palpate.session, no_session), "{what}");
        }
    }
    // Another sender may use the same number for a new session.
    newer.session = palpate.session;
    newer.send(1, Body::Hello);
    assert!(matches!(newer.receive_except_samples().body, Body::Welcome(_)));
    newer.send(1, Body::Stop);
    // The first sender may use another number.
    wait_for(|| {
        palpate.session += 1;
        palpate.send(1, Body::Hello);
        matches!(palpate.receive_except_samples().body, Body::Welcome(_))
    });
    palpate.send(1, Body::Stop);
}

#[test]
fn cpp_peer_of_page_follows_protocol() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let Some(program) = compiled(folder) else { return };
    let peer = Running::start(&program, 0);
    let address = peer.1;
    assert!(address.ip().is_loopback());
    rejects_invalid_packets(address);
    never_resumes_ended_session(address);
    let long = Duration::from_secs(10);
    let settings = BridgeSettings { address, open_within: long, ..BridgeSettings::default() };
    let mut device = BridgeDevice::find(settings).unwrap();
    let described = DeviceDescription {
        name: "stand-in hand".into(),
        workspace_m: [DVec3::splat(-0.1), DVec3::splat(0.1)],
        max_force_n: 5.0,
        rate_hz: 1000.0,
    };
    assert_eq!((device.describe(), device.peer_watchdog()), (described, Duration::from_millis(20)));
    device.open().unwrap();

    // The hand moves, with a reported velocity, to the equilibrium of spring and force.
    let (force_n, mut fastest) = (DVec3::new(1.0, -2.0, 3.0), 0.0_f64);
    tick_until(&mut device, force_n, |reading| {
        assert_eq!((reading.buttons, reading.orientation), (0, glam::DQuat::IDENTITY));
        let velocity = reading.velocity_m_per_s.unwrap();
        fastest = fastest.max(velocity.length());
        reading.position_m.distance(force_n / STIFFNESS) < 1e-5 && velocity.length() < 1e-4
    });
    assert!(fastest > 0.05, "{fastest}");
    wait_for(|| {
        // The peer applies forces written at most a few ticks ago.
        tick_until(&mut device, force_n, |_| true);
        device.monitor().counts().forces_in_flight < 20
    });

    // Timeout: the peer sets zero force and ends the session.
    #[expect(clippy::disallowed_methods, reason = "palpate sends nothing")]
    std::thread::sleep(Duration::from_millis(300));
    wait_for(|| device.read(TICK) == Err(DeviceError::Disconnected));
    device.close().unwrap();
    device.open().unwrap();
    let mut first = None;
    tick_until(&mut device, DVec3::ZERO, |reading| {
        first = first.or(Some(reading.position_m));
        true
    });
    assert!(first.unwrap().length() < force_n.length() / STIFFNESS / 2.0, "{first:?}");

    // The peer serves one session at a time, but replies to every description request.
    let impatient = BridgeSettings { open_within: Duration::from_millis(200), ..settings };
    let second = std::thread::scope(|scope| {
        let opened = scope.spawn(|| {
            assert_eq!(BridgeDevice::find(settings).unwrap().peer_watchdog(), Duration::from_millis(20));
            BridgeDevice::find(impatient).map(|mut other| other.open())
        });
        wait_for(|| {
            tick_until(&mut device, DVec3::X, |_| true);
            opened.is_finished()
        });
        opened.join().unwrap()
    });
    // On a busy machine the first session may have ended and the second been served, or neither in time.
    if let Ok(Err(error)) = second {
        let busy = DeviceError::Protocol("the peer serves another program");
        assert!([busy, DeviceError::Disconnected].contains(&error), "{error}");
    }

    // A crash without a message, then a new peer on the same port.
    tick_until(&mut device, DVec3::X, |_| true);
    drop(peer);
    wait_for(|| {
        let _ = device.write(DVec3::X);
        device.read(TICK) == Err(DeviceError::Disconnected)
    });
    let _again = Running::start(&program, address.port());
    device.close().unwrap();
    device.open().unwrap();
    tick_until(&mut device, DVec3::X, |reading| reading.position_m.distance(DVec3::X / STIFFNESS) < 1e-5);
}
