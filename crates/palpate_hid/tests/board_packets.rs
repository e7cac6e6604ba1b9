//! Reports of 3-DOF boards, compared byte by byte with data files, and their report descriptors.

use crate::bytes::{bytes, words};
use palpate_hid::simulated::*;
use palpate_hid::*;
use proptest::prelude::*;

const FILE_8: &str = include_str!("data/board_8.txt");
const FILE_14: &str = include_str!("data/board_14.txt");
const FILE_64: &str = include_str!("data/board_64.txt");
const MBED_8: &str = include_str!("data/board_mbed_8_descriptor.txt");
const MBED_14: &str = include_str!("data/board_mbed_14_descriptor.txt");
const LATER_MBED_14: &str = include_str!("data/board_later_mbed_14_descriptor.txt");
const RAWHID: &str = include_str!("data/board_teensy_rawhid_descriptor.txt");
const SEREMU: &str = include_str!("data/board_teensy_seremu_descriptor.txt");

/// Bytes after the word `name`, up to the next name.
fn named(text: &str, name: &str) -> Vec<u8> {
    let after = words(text).skip_while(|word| *word != name).skip(1);
    let found: Vec<u8> = after.map_while(|word| u8::from_str_radix(word, 16).ok()).collect();
    assert!(!found.is_empty(), "{name} is in the file");
    found
}

fn input(encoders: [i16; 6]) -> BoardInput {
    BoardInput { encoders, ..BoardInput::default() }
}

/// Parses and encodes an input report.
fn check_input(form: BoardForm, report: &[u8], input: BoardInput) {
    assert_eq!(BoardInput::parse(form, report), Ok(input));
    let encoded = input.encode(form);
    // Unused bytes may have any value.
    let used = form.bytes().min(14);
    assert_eq!(encoded.as_slice()[..used], report[..used]);
    assert_eq!(encoded.as_slice().len(), form.bytes());
}

/// Parses and encodes an output report.
fn check_output(form: BoardForm, report: &[u8], output: BoardOutput) {
    assert_eq!(output.encode(form).unwrap().as_slice(), report);
    assert_eq!(BoardOutput::parse(form, report), Ok(output));
}

#[test]
fn reports_of_8_bytes_match_the_data_file() {
    let form = BoardForm::Bytes8;
    let sequence = |encoders, sequence| BoardInput { sequence, ..input(encoders) };
    check_input(form, &named(FILE_8, "input"), sequence([6000, -6000, -1, 0, 0, 0], 0x1234));
    check_input(form, &named(FILE_8, "input_ends"), sequence([i16::MIN, i16::MAX, 0, 0, 0, 0], 65535));
    check_output(form, &named(FILE_8, "zero"), BoardOutput::ZERO);
    check_output(form, &named(FILE_8, "currents"), BoardOutput::Currents([1200, -1000, 1]));
    check_output(form, &named(FILE_8, "currents_ends"), BoardOutput::Currents([i16::MAX, i16::MIN, 2000]));
    let home = BoardOutput::Counters([0, 0, 6000, 0, 0, 0]);
    assert_eq!(home.encode(form), Err(BoardPacketError::NoCommands));
}

#[test]
fn reports_of_14_and_64_bytes_match_the_data_files() {
    for (form, file) in [(BoardForm::Bytes14, FILE_14), (BoardForm::Bytes64, FILE_64)] {
        check_input(form, &named(file, "input"), input([0, -1, 6000, 0, 30, i16::MIN]));
        let pressed = BoardInput { is_pressed: true, ..input([1, 2, 3, -900, 0, 0]) };
        check_input(form, &named(file, "input_pressed"), pressed);
        check_input(
            form,
            &named(file, "input_request"),
            BoardInput { requests_calibration: true, ..input([0; 6]) },
        );
        check_output(form, &named(file, "zero"), BoardOutput::ZERO);
        check_output(form, &named(file, "currents"), BoardOutput::Currents([1200, -1000, 1]));
        check_output(form, &named(file, "home"), BoardOutput::Counters([0, 0, 6000, 0, 30, 0]));
    }
}

#[test]
fn button_is_pressed_above_5000() {
    let form = BoardForm::Bytes14;
    check_input(form, &named(FILE_14, "input_at_limit"), input([0, 0, 0, 5000, 0, 0]));
    let above = BoardInput { is_pressed: true, ..input([0, 0, 0, -4999, 0, 0]) };
    check_input(form, &named(FILE_14, "input_above"), above);
}

#[test]
fn rejects_wrong_lengths_report_ids_and_commands() {
    for form in BoardForm::ALL {
        let expected = form.bytes();
        for found in (0..=80).filter(|found| *found != expected) {
            let error = BoardPacketError::Length { found, expected };
            assert_eq!(BoardInput::parse(form, &vec![0; found]), Err(error));
            let error = BoardPacketError::Length { found: found + 1, expected: expected + 1 };
            assert_eq!(BoardOutput::parse(form, &vec![0; found + 1]), Err(error));
        }
        let mut numbered = vec![0; expected + 1];
        numbered[0] = 7;
        assert_eq!(BoardOutput::parse(form, &numbered), Err(BoardPacketError::Number(7)));
    }
    let mut unknown = named(FILE_14, "zero");
    unknown[7] = 2;
    assert_eq!(BoardOutput::parse(BoardForm::Bytes14, &unknown), Err(BoardPacketError::Command(2)));
}

#[test]
fn form_follows_from_the_report_descriptor() {
    let form = |text| BoardForm::of(&ReportDescriptor::parse(&bytes(text)).unwrap());
    assert_eq!(form(MBED_8), Some(BoardForm::Bytes8));
    assert_eq!(form(MBED_14), Some(BoardForm::Bytes14));
    assert_eq!(form(LATER_MBED_14), Some(BoardForm::Bytes14));
    assert_eq!(form(RAWHID), Some(BoardForm::Bytes64));
    // Serial port of a Teensy: 64 bytes in one direction and 32 in the other.
    assert_eq!(form(SEREMU), None);
    let application = |text| {
        let descriptor = ReportDescriptor::parse(&bytes(text)).unwrap();
        descriptor.applications().next().unwrap()
    };
    for text in [MBED_8, MBED_14, LATER_MBED_14, RAWHID] {
        assert_eq!(application(text), Usage::new(0xFFAB, 0x0200));
    }
    assert_eq!(application(SEREMU), Usage::new(0xFFC9, 0x0004));
}

#[test]
fn simulated_descriptors_match_the_data_files() {
    for (form, text) in
        [(BoardForm::Bytes8, MBED_8), (BoardForm::Bytes14, MBED_14), (BoardForm::Bytes64, RAWHID)]
    {
        let firmware = BoardFirmware::at_home(form, &BoardKinematics::default());
        assert_eq!(firmware.descriptor(), bytes(text));
    }
}

#[test]
fn descriptors_with_report_ids_or_other_lengths_have_no_form() {
    let form = |bytes: &[u8]| BoardForm::of(&ReportDescriptor::parse(bytes).unwrap());
    let mut numbered = bytes(MBED_14);
    numbered.splice(8..8, [0x85, 0x01]);
    assert_eq!(form(&numbered), None);
    let mut longer = bytes(MBED_14);
    let lengths = longer.iter().position(|byte| *byte == 0x0E).unwrap();
    longer[lengths] = 16;
    assert_eq!(form(&longer), None);
}

proptest! {
    #[test]
    fn arbitrary_bytes_do_not_panic(report in proptest::collection::vec(any::<u8>(), 0..80)) {
        for form in BoardForm::ALL {
            let parsed = BoardInput::parse(form, &report);
            prop_assert_eq!(parsed.is_ok(), report.len() == form.bytes());
            if let Ok(input) = parsed {
                prop_assert_eq!(BoardInput::parse(form, input.encode(form).as_slice()), Ok(input));
            }
            if let Ok(output) = BoardOutput::parse(form, &report) {
                let encoded = output.encode(form).unwrap();
                prop_assert_eq!(BoardOutput::parse(form, encoded.as_slice()), Ok(output));
            }
        }
    }
}
