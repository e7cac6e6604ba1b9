//! The bridge's packets: what is understood is written again byte by byte.

#![no_main]

use libfuzzer_sys::fuzz_target;
use palpate_haptics::bridge::packet::{LARGEST_SIZE, Packet};

fuzz_target!(|bytes: &[u8]| {
    if let Ok(packet) = Packet::parse(bytes) {
        let mut buffer = [0; LARGEST_SIZE];
        let again = packet.encode(&mut buffer).expect("what was understood can be said");
        assert_eq!(again, bytes);
    }
});
