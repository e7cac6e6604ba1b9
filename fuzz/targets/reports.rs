//! The parsers of single reports and packets; what is understood is written again as it was.

#![no_main]

use libfuzzer_sys::fuzz_target;
use palpate_hid::{BoardForm, BoardInput, BoardOutput, SpaceMouseReport};

fuzz_target!(|bytes: &[u8]| {
    let _ = SpaceMouseReport::parse(bytes);
    for form in [BoardForm::Bytes8, BoardForm::Bytes14, BoardForm::Bytes64] {
        if let Ok(input) = BoardInput::parse(form, bytes) {
            assert_eq!(BoardInput::parse(form, input.encode(form).as_slice()), Ok(input));
        }
        if let Ok(output) = BoardOutput::parse(form, bytes) {
            let again = output.encode(form).expect("what was understood can be said");
            assert_eq!(BoardOutput::parse(form, again.as_slice()), Ok(output));
        }
    }
});
