//! The parsers of single reports.

#![no_main]

use libfuzzer_sys::fuzz_target;
use palpate_hid::CapReport;

fuzz_target!(|bytes: &[u8]| {
    let _ = CapReport::parse(bytes);
});
