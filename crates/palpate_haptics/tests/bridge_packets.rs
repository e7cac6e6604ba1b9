//! Packets of the bridge, byte for byte in both directions, and arbitrary bytes.

use glam::{DQuat, DVec3};
use palpate_haptics::bridge::packet::*;
use proptest::prelude::*;
use std::collections::BTreeMap;

const SESSION: u64 = 0x0123_4567_89ab_cdef;

/// The packets of `data/bridge_packets.txt`, which names its source.
fn reference_bytes() -> BTreeMap<&'static str, Vec<u8>> {
    let mut packets = BTreeMap::<_, Vec<u8>>::new();
    let mut name = "";
    for line in include_str!("data/bridge_packets.txt").lines().filter(|line| !line.starts_with('#')) {
        if let Some(named) = line.strip_prefix('[') {
            name = named.strip_suffix(']').unwrap();
        } else if let Some((bytes, _)) = line.split_once('|') {
            let bytes = bytes.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap());
            packets.entry(name).or_default().extend(bytes);
        }
    }
    packets
}

fn expected() -> BTreeMap<&'static str, Packet> {
    let packet = |session, number, body| Packet { session, number, body };
    let end = |number, reason| packet(SESSION, number, Body::End(reason));
    let high = DVec3::new(0.08, 0.06, 0.035);
    let welcome = Welcome {
        name: Name::new("Gerät 3"),
        workspace_m: [-high, high],
        max_force_n: 3.3,
        rate_hz: 1000.0,
        watchdog_us: 20_000,
    };
    let sampled = Sampled {
        position_m: DVec3::new(0.0125, -0.04, 1e-9),
        orientation: DQuat::from_xyzw(0.5, -0.5, 0.5, -0.5),
        velocity_m_per_s: Some(DVec3::new(0.25, -1.5, 0.0)),
        buttons: 0b101,
        shown: 257,
    };
    let plain = Sampled {
        position_m: DVec3::new(-100.0, 100.0, 0.0),
        orientation: DQuat::IDENTITY,
        velocity_m_per_s: None,
        buttons: 1 << 31,
        shown: 0,
    };
    BTreeMap::from([
        ("hello", packet(SESSION, 2, Body::Hello)),
        ("question", packet(0, 1, Body::Hello)),
        ("welcome", packet(SESSION, 2, Body::Welcome(welcome))),
        ("sample", packet(SESSION, 258, Body::Sample(sampled))),
        ("sample without velocity", packet(SESSION, 1, Body::Sample(plain))),
        ("force", packet(SESSION, 65_536, Body::Force(DVec3::new(1.0, -2.75, 0.1)))),
        ("stop", packet(SESSION, 65_537, Body::Stop)),
        ("end: other version", end(7, EndReason::OtherVersion)),
        ("end: busy", end(7, EndReason::Busy)),
        ("end: no such session", end(7, EndReason::NoSession)),
        ("end: silent", end(0, EndReason::Silent)),
        ("end: closing", end(0, EndReason::Closing)),
        ("end: device failed", end(0, EndReason::DeviceFailed)),
    ])
}

fn encoded(packet: &Packet) -> Result<Vec<u8>, PacketError> {
    packet.encode(&mut [0xff; MAX_SIZE]).map(<[u8]>::to_vec)
}

#[test]
fn parses_and_encodes_reference_packets() {
    let (written, expected) = (reference_bytes(), expected());
    assert!(written.keys().eq(expected.keys()), "{:?}", written.keys());
    for (name, bytes) in written {
        let packet = expected[name];
        assert_eq!(Packet::parse(&bytes), Ok(packet), "{name}");
        assert_eq!(encoded(&packet).as_ref(), Ok(&bytes), "{name}");
    }
}

#[test]
fn sample_converts_to_reading_with_its_number() {
    let Body::Sample(sampled) = expected()["sample"].body else { panic!("a sample") };
    let reading = sampled.reading(258);
    assert!(reading.is_usable());
    assert_eq!((reading.sequence, reading.buttons), (Some(258), 0b101));
    assert_eq!(
        (reading.position_m, reading.velocity_m_per_s),
        (sampled.position_m, sampled.velocity_m_per_s)
    );
    assert_eq!(reading.orientation, sampled.orientation);
}

/// Parses the reference packet `name` with `bytes` written at offset `at`.
fn parse_with(name: &str, at: usize, bytes: &[u8]) -> Result<Packet, PacketError> {
    let mut packet = reference_bytes()[name].clone();
    packet[at..at + bytes.len()].copy_from_slice(bytes);
    Packet::parse(&packet)
}

#[test]
fn each_violation_has_its_own_error() {
    use PacketError::*;
    for (name, bytes) in reference_bytes() {
        for length in 0..bytes.len() {
            let expected = if length < HEADER_SIZE { HEADER_SIZE } else { bytes.len() };
            assert_eq!(Packet::parse(&bytes[..length]), Err(Length { found: length, expected }), "{name}");
        }
        let longer = [&bytes[..], &[0]].concat();
        assert_eq!(Packet::parse(&longer), Err(Length { found: bytes.len() + 1, expected: bytes.len() }));
    }
    assert_eq!(parse_with("hello", 0, b"plpb"), Err(Magic));
    assert_eq!(parse_with("hello", 4, &[2, 0]), Err(Version(2)));
    for kind in [0, 7, 255] {
        assert_eq!(parse_with("hello", 6, &[kind]), Err(Kind(kind)));
    }
    for (name, reserved) in
        [("hello", 7), ("welcome", 124), ("welcome", 127), ("sample", 29), ("end: busy", 31)]
    {
        assert_eq!(parse_with(name, reserved, &[1]), Err(Reserved), "{name}");
    }
    // A velocity without its flag, even -0.
    assert_eq!(parse_with("sample without velocity", 95, &[0x80]), Err(Reserved));
    assert_eq!(parse_with("sample", 28, &[2]), Err(Reserved));
    for name in ["sample", "force", "stop"] {
        assert_eq!(parse_with(name, 8, &[0; 8]), Err(Session), "{name}");
        assert_eq!(parse_with(name, 16, &[0; 8]), Err(Counted), "{name}");
    }
    assert_eq!(parse_with("hello", 16, &[0; 8]), Err(Counted));
    for name in [[0; 32], [b'a'; 32].map(|_| 0xff), [7; 32], *b"a\0b                             "] {
        assert_eq!(parse_with("welcome", 24, &name), Err(Name), "{name:?}");
    }
    for reason in [0, 7, u32::MAX] {
        assert_eq!(parse_with("end: busy", 24, &reason.to_le_bytes()), Err(Reason(reason)));
    }
    assert_eq!(parse_with("sample", 80, &1.0_f64.to_le_bytes()), Err(Orientation));
    assert_eq!(parse_with("welcome", 120, &999_u32.to_le_bytes()).map_err(quantity_of), Err("watchdog, µs"));
    assert_eq!(
        parse_with("welcome", 80, &(-0.081_f64).to_le_bytes()).map_err(quantity_of),
        Err("smallest side of the workspace, m")
    );
}

/// The quantity out of range.
fn quantity_of(error: PacketError) -> &'static str {
    match error {
        PacketError::OutOfRange { what, .. } => what,
        _ => panic!("{error}"),
    }
}

#[test]
fn rejects_numbers_out_of_range_in_both_directions() {
    let fields = [
        ("welcome", 56, 6, "workspace, m"),
        ("welcome", 104, 1, "largest force, N"),
        ("welcome", 112, 1, "rate, Hz"),
        ("sample", 32, 3, "position, m"),
        ("sample", 56, 4, "orientation"),
        ("sample", 88, 3, "velocity, m/s"),
        ("force", 24, 3, "force, N"),
    ];
    for value in [f64::NAN, -f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300, 20_001.0] {
        for (name, first, count, what) in fields {
            for field in 0..count {
                let rejected = parse_with(name, first + 8 * field, &value.to_le_bytes());
                assert_eq!(rejected.map_err(quantity_of), Err(what), "{name} {field} {value}");
            }
        }
        let force = Packet { session: 1, number: 1, body: Body::Force(DVec3::new(0.0, value, 0.0)) };
        assert_eq!(encoded(&force).map_err(quantity_of), Err("force, N"));
    }
    assert_eq!(encoded(&Packet { session: 0, number: 1, body: Body::Stop }), Err(PacketError::Session));
    assert_eq!(encoded(&Packet { session: 1, number: 0, body: Body::Stop }), Err(PacketError::Counted));
}

#[test]
fn names_are_truncated_at_character_boundaries() {
    let long = "ä".repeat(20);
    assert_eq!(Name::new(&long).as_str(), "ä".repeat(16));
    assert_eq!(Name::new(&format!("a{long}")).as_str(), format!("a{}", "ä".repeat(15)));
    assert_eq!(Name::new("Touch\n\u{7}\0X").as_str(), "TouchX");
    assert_eq!(Name::new("").as_str(), "device");
}

#[test]
fn header_identifies_hello_of_any_version() {
    let mut hello = reference_bytes()["hello"].clone();
    hello[4] = 9;
    let header = Header::of(&hello).unwrap();
    assert!(header.is_hello());
    assert_eq!((header.version, header.session, header.number), (9, SESSION, 2));
    assert_eq!(Header::of(&hello[..23]), None);
}

fn vector(max: f64) -> impl Strategy<Value = DVec3> + Clone {
    let one = -max..=max;
    (one.clone(), one.clone(), one).prop_map(|(x, y, z)| DVec3::new(x, y, z))
}

fn body() -> impl Strategy<Value = Body> {
    let rotation = (vector(1.0), 0.0..7.0).prop_filter_map("an axis", |(axis, angle)| {
        Some(DQuat::from_axis_angle(axis.try_normalize()?, angle))
    });
    let sampled = (
        vector(MAX_POSITION_M),
        rotation,
        prop::option::of(vector(MAX_SPEED_M_PER_S)),
        any::<u32>(),
        any::<u64>(),
    )
        .prop_map(|(position_m, orientation, velocity_m_per_s, buttons, shown)| {
            Body::Sample(Sampled { position_m, orientation, velocity_m_per_s, buttons, shown })
        });
    let welcome =
        (".*", [vector(MAX_POSITION_M), vector(MAX_POSITION_M)], 0.0..=MAX_FORCE_N, RATES_HZ, WATCHDOGS_US)
            .prop_map(|(name, [a, b], max_force_n, rate_hz, watchdog_us)| {
                let workspace_m = [a.min(b), a.max(b)];
                Body::Welcome(Welcome {
                    name: Name::new(&name),
                    workspace_m,
                    max_force_n,
                    rate_hz,
                    watchdog_us,
                })
            });
    let reason = prop::sample::select(vec![
        EndReason::OtherVersion,
        EndReason::Busy,
        EndReason::NoSession,
        EndReason::Silent,
        EndReason::Closing,
        EndReason::DeviceFailed,
    ]);
    prop_oneof![
        Just(Body::Hello),
        welcome,
        sampled,
        vector(MAX_FORCE_N).prop_map(Body::Force),
        Just(Body::Stop),
        reason.prop_map(Body::End),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn encoded_packets_parse_to_themselves(session in 1..=u64::MAX, number in 1..=u64::MAX, body in body()) {
        let packet = Packet { session, number, body };
        let bytes = encoded(&packet).unwrap();
        prop_assert_eq!(Packet::parse(&bytes), Ok(packet));
    }

    /// Encoding a parsed packet reproduces its bytes.
    #[test]
    fn arbitrary_bytes_round_trip_or_are_rejected(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        if let Ok(packet) = Packet::parse(&bytes) {
            prop_assert_eq!(encoded(&packet), Ok(bytes));
        }
    }

    /// The same for packets with random changes.
    #[test]
    fn corrupted_packets_round_trip_or_are_rejected(
        body in body(),
        changes in prop::collection::vec((0..MAX_SIZE, any::<u8>()), 1..6),
    ) {
        let mut bytes = encoded(&Packet { session: SESSION, number: 1, body }).unwrap();
        for (at, byte) in changes {
            if let Some(target) = bytes.get_mut(at) {
                *target = byte;
            }
        }
        if let Ok(packet) = Packet::parse(&bytes) {
            prop_assert_eq!(encoded(&packet), Ok(bytes));
        }
    }
}
