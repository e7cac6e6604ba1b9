//! Report descriptors: published ones, comparison with a second parser, and arbitrary bytes.

use palpate_hid::{
    DescriptorError, Field, MAX_DESCRIPTOR_BYTES, MAX_FIELDS, MAX_REPORT_BYTES, ReportDescriptor, ReportKind,
    Usage,
};
use proptest::prelude::*;

/// A mouse with three buttons. Source: Device Class Definition for HID 1.11, appendix E.10.
const MOUSE: [u8; 50] = [
    0x05, 0x01, 0x09, 0x02, 0xA1, 0x01, 0x09, 0x01, 0xA1, 0x00, 0x05, 0x09, 0x19, 0x01, 0x29, 0x03, 0x15,
    0x00, 0x25, 0x01, 0x95, 0x03, 0x75, 0x01, 0x81, 0x02, 0x95, 0x01, 0x75, 0x05, 0x81, 0x01, 0x05, 0x01,
    0x09, 0x30, 0x09, 0x31, 0x15, 0x81, 0x25, 0x7F, 0x75, 0x08, 0x95, 0x02, 0x81, 0x06, 0xC0, 0xC0,
];

const X: Usage = Usage::new(1, 0x30);
const Y: Usage = Usage::new(1, 0x31);

#[test]
fn parses_the_mouse_of_the_standard() {
    let mouse = ReportDescriptor::parse(&MOUSE).unwrap();
    assert!(!mouse.is_numbered());
    assert_eq!(mouse.applications().collect::<Vec<_>>(), [Usage::new(1, 2)]);
    let [report] = mouse.reports() else { panic!("one report") };
    assert_eq!((report.kind, report.id, report.bytes()), (ReportKind::Input, 0, 3));
    // Three buttons, five bits of padding, x and y.
    let places: Vec<(usize, usize)> = report.fields.iter().map(|field| (field.bit, field.bits)).collect();
    assert_eq!(places, [(0, 1), (1, 1), (2, 1), (8, 8), (16, 8)]);
    let (_, x) = mouse.find(ReportKind::Input, Usage::new(1, 1), X).unwrap();
    assert_eq!((x.logical, x.is_relative, x.is_array, x.is_constant), ([-127, 127], true, false, false));
    assert_eq!(mouse.around(x).collect::<Vec<_>>(), [Usage::new(1, 1), Usage::new(1, 2)]);
    let data = [0b0000_0101, 0xFE, 0x7F];
    let value = |usage| report.field(usage).unwrap().get(&data);
    assert_eq!([value(X), value(Y)], [Some(-2), Some(127)]);
    assert_eq!([1, 2, 3].map(|button| value(Usage::new(9, button))), [Some(1), Some(0), Some(1)]);
    assert_eq!(report.field(Y).unwrap().get(&data[..2]), None, "too short");
}

/// A field of `bits` bits at `bit`, after padding.
fn field(bit: u8, bits: u8, low: i16, high: i16) -> Field {
    let [[a, b], [c, d]] = [low.to_le_bytes(), high.to_le_bytes()];
    let bytes = [
        &[0x75, bit, 0x95, 1, 0x91, 3][..],
        &[0x05, 1, 0x09, 0x30, 0x16, a, b, 0x26, c, d, 0x75, bits, 0x95, 1, 0x91, 2],
    ];
    let parsed = ReportDescriptor::parse(&bytes.concat()).unwrap();
    parsed.reports()[0].fields[0].clone()
}

proptest! {
    #[test]
    fn set_then_get_returns_the_value_and_changes_no_other_bits(
        bit in 0_u8..40, bits in 2_u8..=16, value in any::<i16>(), before in any::<[u8; 8]>(),
    ) {
        let max = (1_i32 << (bits - 1)) - 1;
        let field = field(bit, bits, (-max) as i16, max as i16);
        let mut data = before;
        let put = field.set(&mut data, i64::from(value)).unwrap();
        prop_assert_eq!(put, i64::from(value).clamp(-i64::from(max), i64::from(max)));
        prop_assert_eq!(field.get(&data), Some(put));
        // The data as a 64-bit number without the field.
        let rest = |bytes: [u8; 8]| u64::from_le_bytes(bytes) & !(((1 << bits) - 1) << bit);
        prop_assert_eq!(rest(data), rest(before));
        // The value from the single bits.
        let bits_of = (0..usize::from(bits)).map(|i| {
            let at = usize::from(bit) + i;
            i64::from(data[at / 8] >> (at % 8) & 1) << i
        });
        prop_assert_eq!(bits_of.sum::<i64>(), put & ((1 << bits) - 1));
    }

    #[test]
    fn arbitrary_bytes_do_not_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        if let Ok(parsed) = ReportDescriptor::parse(&bytes) {
            let mut data = [0; 64];
            for report in parsed.reports() {
                prop_assert!(report.bytes() <= MAX_REPORT_BYTES && report.fields.len() <= MAX_FIELDS);
                for field in &report.fields {
                    let _ = (field.get(&data), field.set(&mut data, i64::MAX), field.set(&mut data, i64::MIN));
                    let _ = (field.value_of(X), field.usage_of(i64::MIN), field.usage_of(3));
                    let _ = parsed.around(field).count();
                }
            }
        }
    }

    #[test]
    fn agrees_with_a_second_parser(items in prop::collection::vec(item(), 1..30)) {
        // The second parser requires a collection.
        let bytes = [&[0x05, 1, 0x09, 4, 0xA1, 1][..], &items.concat(), &[0xC0]].concat();
        let ours = ReportDescriptor::parse(&bytes).unwrap();
        let theirs = hidreport::ReportDescriptor::try_from(bytes.as_slice()).unwrap();
        compare(&ours, ReportKind::Input, theirs.input_reports())?;
        compare(&ours, ReportKind::Output, theirs.output_reports())?;
        compare(&ours, ReportKind::Feature, theirs.feature_reports())?;
    }
}

/// A main item with its global and local items.
fn item() -> impl Strategy<Value = Vec<u8>> {
    let kind = prop::sample::select(vec![0x81_u8, 0x91, 0xB1]);
    let flags = prop::sample::select(vec![2_u8, 6, 0]);
    (kind, flags, 1_u8..5, 1_u8..5, 1_u8..33, 1_u8..200, any::<i8>(), 0_i8..=127).prop_map(
        |(kind, flags, id, count, bits, usage, low, high)| {
            let high = high.max(low).cast_unsigned();
            let last = usage + count - 1;
            vec![
                0x85,
                id,
                0x05,
                0x0F,
                0x19,
                usage,
                0x29,
                last,
                0x15,
                low.cast_unsigned(),
                0x25,
                high,
                0x75,
                bits,
                0x95,
                count,
                kind,
                flags,
            ]
        },
    )
}

fn compare(
    ours: &ReportDescriptor,
    kind: ReportKind,
    theirs: &[impl hidreport::Report],
) -> Result<(), TestCaseError> {
    prop_assert_eq!(ours.reports().iter().filter(|report| report.kind == kind).count(), theirs.len());
    for report in theirs {
        let id = u8::from(report.report_id().unwrap());
        let mine = ours.report(kind, id).unwrap();
        // The second parser includes the report ID.
        prop_assert_eq!(mine.bytes() + 1, report.size_in_bytes());
        let mut of_mine = mine.fields.iter();
        for field in report.fields() {
            match field {
                hidreport::Field::Variable(theirs) => {
                    let mine = of_mine.next().unwrap();
                    prop_assert!(!mine.is_array);
                    prop_assert_eq!((mine.bit + 8)..(mine.bit + 8 + mine.bits), theirs.bits.clone());
                    prop_assert_eq!(mine.logical[0], i64::from(i32::from(theirs.logical_minimum)));
                    prop_assert_eq!(mine.logical[1], i64::from(i32::from(theirs.logical_maximum)));
                    let (page, id) = (u16::from(theirs.usage.usage_page), u16::from(theirs.usage.usage_id));
                    prop_assert!(mine.has(Usage::new(page, id)));
                }
                hidreport::Field::Array(theirs) => {
                    // The second parser has one field for all elements.
                    let mut at = theirs.bits.start;
                    while at < theirs.bits.end {
                        let mine = of_mine.next().unwrap();
                        prop_assert!(mine.is_array && mine.bit + 8 == at);
                        let usages: Vec<(u16, u16)> = theirs
                            .usages()
                            .iter()
                            .map(|usage| (u16::from(usage.usage_page), u16::from(usage.usage_id)))
                            .collect();
                        prop_assert!(usages.iter().all(|&(page, id)| mine.has(Usage::new(page, id))));
                        prop_assert_eq!(
                            mine.usages.iter().map(|range| range.count()).sum::<usize>(),
                            usages.len()
                        );
                        at += mine.bits;
                    }
                }
                hidreport::Field::Constant(_) => {}
            }
        }
    }
    Ok(())
}

#[test]
fn array_field_maps_usages_to_numbers() {
    // A device control with six commands, numbers 1 to 6. Source: Device Class Definition for PID 1.0, chapter 5.8.
    let bytes = [
        0x05, 0x0F, 0x09, 0x96, 0xA1, 0x02, 0x85, 0x0C, 0x09, 0x97, 0x09, 0x98, 0x09, 0x99, 0x09, 0x9A, 0x09,
        0x9B, 0x09, 0x9C, 0x15, 0x01, 0x25, 0x06, 0x75, 0x08, 0x95, 0x01, 0x91, 0x00, 0xC0,
    ];
    let parsed = ReportDescriptor::parse(&bytes).unwrap();
    let reset = Usage::new(0x0F, 0x9A);
    let (report, field) = parsed.find(ReportKind::Output, Usage::new(0x0F, 0x96), reset).unwrap();
    assert_eq!((report.id, report.bytes(), field.is_array), (12, 1, true));
    assert_eq!(field.value_of(reset), Some(4));
    assert_eq!(field.usage_of(4), Some(reset));
    assert_eq!((field.usage_of(0), field.usage_of(7)), (None, None));
    let mut data = [0];
    assert_eq!(field.set(&mut data, 4), Some(4));
    assert_eq!((data, field.set(&mut data, 9)), ([4], Some(6)));
}

#[test]
fn find_skips_constant_fields() {
    // A joystick with a constant field for x, a variable one for x, and only a constant one for y.
    let bytes = [
        0x05, 0x01, 0x09, 0x04, 0xA1, 0x01, 0x15, 0x81, 0x25, 0x7F, 0x75, 0x08, 0x95, 0x01, 0x09, 0x30, 0x81,
        0x03, 0x09, 0x30, 0x81, 0x02, 0x09, 0x31, 0x81, 0x03, 0xC0,
    ];
    let parsed = ReportDescriptor::parse(&bytes).unwrap();
    let [report] = parsed.reports() else { panic!("one report") };
    let all: Vec<(usize, bool)> = report.fields.iter().map(|field| (field.bit, field.is_constant)).collect();
    assert_eq!(all, [(0, true), (8, false), (16, true)], "constant fields are listed");
    let joystick = Usage::new(1, 4);
    assert_eq!(report.field(X).map(|field| field.bit), Some(8));
    assert_eq!(parsed.find(ReportKind::Input, joystick, X).map(|(_, field)| field.bit), Some(8));
    assert_eq!(report.field(Y), None);
    assert_eq!(parsed.find(ReportKind::Input, joystick, Y), None);
}

/// Chapters 6.2.2.7 and 6.2.2.8 of the standard: push saves all global items, pop restores them, local items are excluded.
#[test]
fn pop_restores_global_items() {
    let bytes = [
        // Page 1, -127 to 127, physical 0 to 100, unit 0x11 by a thousandth, 8 bits, one, report 3; pushed twice.
        &[0x05, 1, 0x15, 0x81, 0x25, 0x7F, 0x35, 0, 0x45, 100, 0x65, 0x11, 0x55, 0x0D][..],
        &[0x75, 8, 0x95, 1, 0x85, 3, 0xA4, 0xA4],
        // All global items changed: two buttons of report 4.
        &[0x05, 9, 0x15, 0, 0x25, 1, 0x35, 0, 0x45, 0, 0x65, 0, 0x55, 0, 0x75, 1, 0x95, 2, 0x85, 4],
        &[0x19, 1, 0x29, 2, 0x81, 2],
        // x, with its usage before the pop.
        &[0x09, 0x30, 0xB4, 0x81, 2],
        // Another size; the second pop restores eight bits, for y.
        &[0x75, 16, 0xB4, 0x09, 0x31, 0x81, 2],
    ];
    let parsed = ReportDescriptor::parse(&bytes.concat()).unwrap();
    let buttons = parsed.report(ReportKind::Input, 4).unwrap();
    assert_eq!((buttons.bytes(), buttons.fields.len()), (1, 2));
    let second = buttons.field(Usage::new(9, 2)).unwrap();
    assert_eq!((second.logical, second.physical, second.unit, second.unit_exponent), ([0, 1], [0, 0], 0, 0));
    let axes = parsed.report(ReportKind::Input, 3).unwrap();
    assert_eq!(axes.bytes(), 2);
    for (usage, bit) in [(X, 0), (Y, 8)] {
        let axis = axes.field(usage).unwrap();
        assert_eq!((axis.bit, axis.bits, axis.logical, axis.physical), (bit, 8, [-127, 127], [0, 100]));
        assert_eq!((axis.unit, axis.unit_exponent), (0x11, -3));
    }
}

/// Chapter 6.2.2.8: delimiters enclose alternative usages of one control, the preferred one first.
#[test]
fn first_of_delimited_usages_is_used() {
    let bytes = [
        &[0x05, 1, 0x09, 4, 0xA1, 1, 0x15, 0, 0x25, 0x7F, 0x75, 8, 0x95, 3][..],
        // Three controls: x or z, y alone, a slider or a dial or a wheel.
        &[0xA9, 1, 0x09, 0x30, 0x09, 0x32, 0xA9, 0],
        &[0x09, 0x31],
        &[0xA9, 1, 0x09, 0x36, 0x09, 0x37, 0x09, 0x38, 0xA9, 0],
        &[0x81, 2],
        // The main item resets local items.
        &[0x95, 2, 0x09, 0x33, 0x09, 0x34, 0x81, 2, 0xC0],
    ];
    let parsed = ReportDescriptor::parse(&bytes.concat()).unwrap();
    let [report] = parsed.reports() else { panic!("one report") };
    let of = |id| report.field(Usage::new(1, id)).map(|field| field.bit);
    assert_eq!([0x30, 0x31, 0x36, 0x33, 0x34].map(of), [Some(0), Some(8), Some(16), Some(24), Some(32)]);
    assert_eq!([0x32, 0x37, 0x38].map(of), [None; 3]);
}

#[test]
fn rejects_malformed_descriptors_with_the_offset() {
    let error = |bytes: &[u8]| ReportDescriptor::parse(bytes).unwrap_err();
    assert_eq!(error(&[0x05]), DescriptorError::Truncated { at: 0 });
    assert_eq!(error(&[0x05, 1, 0x27, 1, 2, 3]), DescriptorError::Truncated { at: 2 });
    assert_eq!(error(&[0xFE, 9, 0]), DescriptorError::Truncated { at: 0 });
    assert_eq!(error(&[0xC0]), DescriptorError::UnpairedCollection { at: 0 });
    assert_eq!(error(&[0xA1, 1]), DescriptorError::UnpairedCollection { at: 2 });
    assert_eq!(error(&[0xB4]), DescriptorError::UnpairedPop { at: 0 });
    assert_eq!(error(&[0xA4; 65]), DescriptorError::TooDeep { at: 64, allowed: 64 });
    assert_eq!(error(&[0xA0; 65]), DescriptorError::TooDeep { at: 64, allowed: 64 });
    assert_eq!(error(&[0x85, 0]), DescriptorError::ReportNumber { at: 0, id: 0 });
    assert_eq!(error(&[0x86, 0, 1]), DescriptorError::ReportNumber { at: 0, id: 256 });
    let unnumbered = [0x75, 8, 0x95, 1, 0x81, 2, 0x85, 1, 0x81, 2];
    assert_eq!(error(&unnumbered), DescriptorError::Unnumbered { at: 4 });
    // 2³² − 1 fields with as many bits each.
    let huge = [0x77, 0xFF, 0xFF, 0xFF, 0xFF, 0x97, 0xFF, 0xFF, 0xFF, 0xFF, 0x81, 2];
    assert_eq!(error(&huge), DescriptorError::ReportTooLong { at: 10 });
    let many = [0x75, 1, 0x96, 0x01, 0x10, 0x81, 2];
    assert_eq!(error(&many), DescriptorError::TooManyFields { at: 5 });
    let longer = vec![0x04; MAX_DESCRIPTOR_BYTES + 1];
    assert_eq!(error(&longer), DescriptorError::TooLong(MAX_DESCRIPTOR_BYTES + 1));
    // A usage with its own page overrides the global page; a long item is skipped; 0xFF is 255 for a minimum of 0.
    let unusual =
        [0xFE, 2, 0, 9, 9, 0x05, 1, 0x0B, 0x70, 0, 0x0F, 0, 0x15, 0, 0x25, 0xFF, 0x75, 8, 0x95, 2, 0x81, 2];
    let parsed = ReportDescriptor::parse(&unusual).unwrap();
    let fields = &parsed.reports()[0].fields;
    // The last usage applies to the remaining fields.
    assert!(fields.len() == 2 && fields.iter().all(|field| field.has(Usage::new(0x0F, 0x70))));
    assert_eq!(fields[1].logical, [0, 255]);
}
