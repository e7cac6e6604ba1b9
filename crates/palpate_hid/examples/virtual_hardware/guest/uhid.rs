//! Events of the kernel's virtual HID devices, which are written to and read from `/dev/uhid` one at a time.
//!
//! Source: Linux, `include/uapi/linux/uhid.h` and `Documentation/hid/uhid.rst`. Structures are packed; an event is its type, 32

/// Maximum length of an event, bytes: type and `struct uhid_create2_req`.
pub const MAX_EVENT_BYTES: usize = 4 + CREATE2;
/// `UHID_DATA_MAX` and `HID_MAX_DESCRIPTOR_SIZE`.
const DATA_MAX: usize = 4096;
/// `struct uhid_create2_req`: name, phys, uniq, rd_size, bus, vendor, product, version, country, rd_data.
const CREATE2: usize = 128 + 64 + 64 + 2 + 2 + 4 * 4 + DATA_MAX;

/// `BUS_USB` of `linux/input.h`; virtual ones (6) are not listed by hidapi.
const BUS_USB: u16 = 3;
/// `UHID_FEATURE_REPORT` of `enum uhid_report_type`.
const FEATURE: u8 = 0;
/// `EIO`, the reply of a device that rejects a report.
const REJECTED: u16 = 5;

// `enum uhid_event_type`.
const DESTROY: u32 = 1;
const START: u32 = 2;
const STOP: u32 = 3;
const OPEN: u32 = 4;
const CLOSE: u32 = 5;
const OUTPUT: u32 = 6;
const GET_REPORT: u32 = 9;
const GET_REPORT_REPLY: u32 = 10;
const CREATE_2: u32 = 11;
const INPUT_2: u32 = 12;
const SET_REPORT: u32 = 13;
const SET_REPORT_REPLY: u32 = 14;

/// Identity of a virtual device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity {
    pub name: &'static str,
    pub serial: String,
    pub vendor: u16,
    pub product: u16,
}

/// Bytes of an event for one write.
pub type EventBytes = Vec<u8>;

/// Event that plugs a device in.
pub fn create(identity: &Identity, descriptor: &[u8]) -> EventBytes {
    let mut event = event(CREATE_2);
    // Texts are zero-terminated.
    let mut text = |text: &str, capacity: usize| {
        let end = event.len() + capacity;
        event.extend(text.bytes().take(capacity - 1));
        event.resize(end, 0);
    };
    text(identity.name, 128);
    text("", 64);
    text(&identity.serial, 64);
    let taken = &descriptor[..descriptor.len().min(DATA_MAX)];
    event.extend((taken.len() as u16).to_le_bytes());
    event.extend(BUS_USB.to_le_bytes());
    let (version, country) = (0x0100, 0);
    for number in [u32::from(identity.vendor), u32::from(identity.product), version, country] {
        event.extend(number.to_le_bytes());
    }
    event.extend(taken);
    event
}

/// Event that unplugs the device.
pub fn destroy() -> EventBytes {
    event(DESTROY)
}

/// Event with an input report of the device.
pub fn input(report: &[u8]) -> EventBytes {
    let mut event = event(INPUT_2);
    event.extend((report.len() as u16).to_le_bytes());
    event.extend(report);
    event
}

/// Reply to [`Event::GetFeature`]; `None` rejects the request.
pub fn feature_reply(id: u32, report: Option<&[u8]>) -> EventBytes {
    let mut event = event(GET_REPORT_REPLY);
    event.extend(id.to_le_bytes());
    event.extend(report.map_or(REJECTED, |_| 0).to_le_bytes());
    let report = report.unwrap_or_default();
    event.extend((report.len() as u16).to_le_bytes());
    event.extend(report);
    event
}

/// Reply to [`Event::SetFeature`].
pub fn set_feature_reply(id: u32, is_accepted: bool) -> EventBytes {
    let mut event = event(SET_REPORT_REPLY);
    event.extend(id.to_le_bytes());
    event.extend(if is_accepted { 0 } else { REJECTED }.to_le_bytes());
    event
}

fn event(number: u32) -> EventBytes {
    number.to_le_bytes().to_vec()
}

/// An event from the kernel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Event {
    /// A driver was bound to the device.
    Start,
    /// The driver was unbound: the last event of an unplugged device.
    Stop,
    /// The first program has opened the device.
    Open,
    /// The last program has closed the device.
    Close,
    /// An output report with its ID; 0 without one.
    Output(Vec<u8>),
    /// Request for a feature report.
    GetFeature {
        id: u32,
        number: u8,
    },
    /// A feature report with its ID.
    SetFeature {
        id: u32,
        report: Vec<u8>,
    },
    /// A report of an unsupported type is requested or sent: reject it.
    GetOther {
        id: u32,
    },
    SetOther {
        id: u32,
    },
    /// Another event.
    Other(u32),
}

impl Event {
    /// Parses the result of one read; `None` where it is shorter than its type requires.
    pub fn parse(bytes: &[u8]) -> Option<Self> {
        let number = u32_at(bytes, 0)?;
        let payload = bytes.get(4..)?;
        Some(match number {
            START => Self::Start,
            STOP => Self::Stop,
            OPEN => Self::Open,
            CLOSE => Self::Close,
            // The data precede their size.
            OUTPUT => {
                let size = usize::from(u16_at(payload, DATA_MAX)?);
                Self::Output(payload.get(..DATA_MAX)?.get(..size)?.to_vec())
            }
            GET_REPORT => {
                let (id, number, kind) = (u32_at(payload, 0)?, *payload.get(4)?, *payload.get(5)?);
                if kind == FEATURE { Self::GetFeature { id, number } } else { Self::GetOther { id } }
            }
            SET_REPORT => {
                let (id, kind) = (u32_at(payload, 0)?, *payload.get(5)?);
                let size = usize::from(u16_at(payload, 6)?);
                let report = payload.get(8..8 + size)?.to_vec();
                if kind == FEATURE { Self::SetFeature { id, report } } else { Self::SetOther { id } }
            }
            other => Self::Other(other),
        })
    }
}

fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_le_bytes(*bytes.get(at..)?.first_chunk()?))
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn create_event_has_the_layout_of_the_structure() {
        let identity = Identity { name: "Cap", serial: "A1".into(), vendor: 0x256F, product: 0xC635 };
        let event = create(&identity, &[0xAA, 0xBB, 0xCC]);
        assert_eq!(event[..8], [11, 0, 0, 0, b'C', b'a', b'p', 0]);
        // After name and phys.
        assert_eq!(event[4 + 192..][..3], [b'A', b'1', 0]);
        // Size, bus, vendor, product, version, country, data.
        let numbers =
            [3, 0, 3, 0, 0x6F, 0x25, 0, 0, 0x35, 0xC6, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0xAA, 0xBB, 0xCC];
        assert_eq!(event[4 + 256..], numbers);
        let longest = create(&Identity { serial: "x".repeat(500), ..identity }, &[0; 5000]);
        assert_eq!(longest.len(), MAX_EVENT_BYTES);
        assert_eq!(longest[4 + 192 + 62..][..2], [b'x', 0]);
    }

    #[test]
    fn device_events_have_the_size_before_the_data() {
        assert_eq!(input(&[1, 2, 3]), [12, 0, 0, 0, 3, 0, 1, 2, 3]);
        assert_eq!(destroy(), [1, 0, 0, 0]);
        let reply = feature_reply(0x0102_0304, Some(&[6, 1]));
        assert_eq!(reply, [10, 0, 0, 0, 4, 3, 2, 1, 0, 0, 2, 0, 6, 1]);
        assert_eq!(feature_reply(7, None), [10, 0, 0, 0, 7, 0, 0, 0, 5, 0, 0, 0]);
        assert_eq!(set_feature_reply(7, true), [14, 0, 0, 0, 7, 0, 0, 0, 0, 0]);
        assert_eq!(set_feature_reply(7, false), [14, 0, 0, 0, 7, 0, 0, 0, 5, 0]);
    }

    /// An event with the full length, as from the kernel.
    fn given(begins: &[u8]) -> Vec<u8> {
        let mut bytes = begins.to_vec();
        bytes.resize(MAX_EVENT_BYTES, 0);
        bytes
    }

    #[test]
    fn parses_the_events_of_a_driver() {
        let mut output = given(&[6, 0, 0, 0, 4, 1]);
        output[4 + 4096] = 2;
        output[4 + 4098] = 1;
        assert_eq!(Event::parse(&output), Some(Event::Output(vec![4, 1])));
        let get = given(&[9, 0, 0, 0, 7, 0, 0, 0, 6, 0]);
        assert_eq!(Event::parse(&get), Some(Event::GetFeature { id: 7, number: 6 }));
        let set = given(&[13, 0, 0, 0, 8, 0, 0, 0, 5, 0, 3, 0, 5, 1, 9]);
        assert_eq!(Event::parse(&set), Some(Event::SetFeature { id: 8, report: vec![5, 1, 9] }));
        let of_inputs = [given(&[9, 0, 0, 0, 7, 0, 0, 0, 6, 2]), given(&[13, 0, 0, 0, 8, 0, 0, 0, 5, 2])];
        let others = [Event::GetOther { id: 7 }, Event::SetOther { id: 8 }];
        assert_eq!(of_inputs.map(|bytes| Event::parse(&bytes)), others.map(Some));
        for (number, event) in [(2, Event::Start), (3, Event::Stop), (4, Event::Open), (5, Event::Close)] {
            assert_eq!(Event::parse(&given(&[number])), Some(event));
        }
        assert_eq!(Event::parse(&given(&[99])), Some(Event::Other(99)));
    }

    #[test]
    fn truncated_events_are_none() {
        let mut output = given(&[6, 0, 0, 0]);
        output[4 + 4096..][..2].copy_from_slice(&4097_u16.to_le_bytes());
        assert_eq!(Event::parse(&output), None, "size beyond the data");
        for bytes in [&[][..], &[6, 0, 0], &[6, 0, 0, 0, 1], &[9, 0, 0, 0, 1, 0, 0, 0, 6], &[13, 0, 0, 0]] {
            assert_eq!(Event::parse(bytes), None, "{bytes:?}");
        }
    }
}
