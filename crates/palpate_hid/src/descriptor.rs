//! Report descriptors: the reports of a device, and the position of each usage in them.
//!
//! Source: *Device Class Definition for Human Interface Devices (HID)*, version 1.11, USB Implementers' Forum, chapters 5.4 to 6.2.2.

mod error;
mod field;
mod items;
mod parser;
mod report;

pub use error::{DescriptorError, MAX_DESCRIPTOR_BYTES, MAX_FIELDS, MAX_REPORT_BYTES};
pub use field::{Field, Usage, UsageRange};
pub use report::{Collection, Report, ReportDescriptor, ReportKind};
