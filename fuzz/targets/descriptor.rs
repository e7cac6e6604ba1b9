//! Report descriptors: whatever the bytes are, they are refused, or read to something in which fields can be looked at.

#![no_main]

use libfuzzer_sys::fuzz_target;
use palpate_hid::{MAX_FIELDS, ReportDescriptor, Usage};

fuzz_target!(|bytes: &[u8]| {
    let Ok(parsed) = ReportDescriptor::parse(bytes) else { return };
    let mut data = [0xA5; 64];
    let mut fields = 0;
    for report in parsed.reports() {
        for field in &report.fields {
            fields += 1;
            if let Some(put) = field.set(&mut data, i64::from(i32::MIN)) {
                assert_eq!(field.get(&data), Some(put));
            }
            let _ = (field.set(&mut data, i64::MAX), field.usage_of(i64::MIN), field.value_of(Usage::new(1, 0x30)));
            assert!(parsed.around(field).count() <= 64);
        }
    }
    assert!(fields <= MAX_FIELDS);
});
