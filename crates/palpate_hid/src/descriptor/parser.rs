//! Parser of report descriptors.

use super::items::{Item, Items};
use super::{
    Collection, DescriptorError, Field, MAX_DESCRIPTOR_BYTES, MAX_FIELDS, MAX_REPORT_BYTES, Report,
    ReportDescriptor, ReportKind, Usage, UsageRange,
};
use std::sync::Arc;

/// Maximum depth of the push stack and of collections.
const MAX_DEPTH: usize = 64;

/// Global items, valid until replaced.
#[derive(Clone, Copy, Default)]
struct Globals {
    page: u16,
    logical_min: i64,
    /// Evaluated at the next field, as the sign depends on the minimum.
    logical_max: Option<Item>,
    physical_min: i64,
    physical_max: Option<Item>,
    unit: u32,
    unit_exponent: i8,
    bits: u32,
    count: u32,
    id: u8,
}

/// Local items, valid for the next main item.
#[derive(Clone, Default)]
struct Locals {
    /// Usages, with a page if the item has one of its own.
    usages: Vec<(Option<u16>, u16, u16)>,
    first: Option<(Option<u16>, u16)>,
    /// Whether the parser is within a delimited set of alternatives, of which the first is used.
    is_alternative: bool,
    has_alternative: bool,
}

#[derive(Default)]
struct Parser {
    descriptor: ReportDescriptor,
    globals: Globals,
    pushed: Vec<Globals>,
    locals: Locals,
    /// Indices of the open collections, outermost first.
    open: Vec<usize>,
    fields: usize,
    /// Offset of the first field without a report ID.
    unnumbered: Option<usize>,
}

impl ReportDescriptor {
    /// Parses the bytes of a report descriptor.
    ///
    /// # Errors
    /// [`DescriptorError`]. For any bytes the parser neither panics nor allocates more than a few MB.
    pub fn parse(bytes: &[u8]) -> Result<Self, DescriptorError> {
        if bytes.len() > MAX_DESCRIPTOR_BYTES {
            return Err(DescriptorError::TooLong(bytes.len()));
        }
        let mut parser = Parser::default();
        for item in Items::of(bytes) {
            parser.take(item?)?;
        }
        if !parser.open.is_empty() {
            return Err(DescriptorError::UnpairedCollection { at: bytes.len() });
        }
        match parser.unnumbered {
            Some(at) if parser.descriptor.is_numbered() => Err(DescriptorError::Unnumbered { at }),
            _ => Ok(parser.descriptor),
        }
    }
}

impl Parser {
    fn take(&mut self, item: Item) -> Result<(), DescriptorError> {
        let Item { at, data, .. } = item;
        let globals = &mut self.globals;
        match item.tag {
            // Main items.
            0x80 => self.main(ReportKind::Input, item)?,
            0x90 => self.main(ReportKind::Output, item)?,
            0xB0 => self.main(ReportKind::Feature, item)?,
            0xA0 => self.begin_collection(at)?,
            0xC0 => {
                self.open.pop().ok_or(DescriptorError::UnpairedCollection { at })?;
                self.locals = Locals::default();
            }
            // Global items.
            0x04 => globals.page = data as u16,
            0x14 => globals.logical_min = item.signed(),
            0x24 => globals.logical_max = Some(item),
            0x34 => globals.physical_min = item.signed(),
            0x44 => globals.physical_max = Some(item),
            0x54 => globals.unit_exponent = exponent(data),
            0x64 => globals.unit = data,
            0x74 => globals.bits = data,
            0x84 => match u8::try_from(data) {
                Ok(id @ 1..) => globals.id = id,
                _ => return Err(DescriptorError::ReportNumber { at, id: data }),
            },
            0x94 => globals.count = data,
            0xA4 if self.pushed.len() == MAX_DEPTH => {
                return Err(DescriptorError::TooDeep { at, allowed: MAX_DEPTH });
            }
            0xA4 => self.pushed.push(self.globals),
            0xB4 => self.globals = self.pushed.pop().ok_or(DescriptorError::UnpairedPop { at })?,
            // Local items; designators and strings are ignored.
            0x08 => {
                let (page, id) = paged(item);
                self.locals.push(page, id, id);
            }
            0x18 => self.locals.first = Some(paged(item)),
            0x28 => {
                let (last_page, last) = paged(item);
                if let Some((page, first)) = self.locals.first.take() {
                    self.locals.push(page.or(last_page), first, last);
                }
            }
            0xA8 => {
                self.locals.is_alternative = data == 1;
                self.locals.has_alternative = false;
            }
            _ => {}
        }
        Ok(())
    }

    fn begin_collection(&mut self, at: usize) -> Result<(), DescriptorError> {
        if self.open.len() == MAX_DEPTH {
            return Err(DescriptorError::TooDeep { at, allowed: MAX_DEPTH });
        }
        let page = self.globals.page;
        let usage = self
            .locals
            .usages
            .first()
            .map_or(Usage::new(page, 0), |&(own, first, _)| Usage::new(own.unwrap_or(page), first));
        self.locals = Locals::default();
        let collections = &mut self.descriptor.collections;
        collections.push(Collection { usage, parent: self.open.last().copied() });
        self.open.push(collections.len() - 1);
        Ok(())
    }

    fn main(&mut self, kind: ReportKind, item: Item) -> Result<(), DescriptorError> {
        const MAX_REPORT_BITS: usize = 8 * MAX_REPORT_BYTES;
        let Item { at, data: flags, .. } = item;
        let locals = std::mem::take(&mut self.locals);
        let Globals { page, bits, count, id, unit, unit_exponent, .. } = self.globals;
        let too_long = DescriptorError::ReportTooLong { at };
        let (bits, count) = (bits as usize, count as usize);
        let all = bits.checked_mul(count).filter(|&all| all <= MAX_REPORT_BITS).ok_or(too_long)?;
        if all == 0 {
            return Ok(());
        }
        if id == 0 {
            self.unnumbered.get_or_insert(at);
        }
        let reports = &mut self.descriptor.reports;
        let index = reports.iter().position(|report| report.kind == kind && report.id == id);
        let index = index.unwrap_or(reports.len());
        if index == reports.len() {
            reports.push(Report { kind, id, fields: Vec::new(), bits: 0 });
        }
        let Some(report) = reports.get_mut(index) else { return Ok(()) };
        let begin = report.bits;
        report.bits += all;
        if report.bits > MAX_REPORT_BITS {
            return Err(too_long);
        }
        let range = |&(own, first, last): &(Option<u16>, u16, u16)| UsageRange {
            first: Usage::new(own.unwrap_or(page), first),
            last,
        };
        let usages: Arc<[UsageRange]> = locals.usages.iter().map(range).collect();
        let is_constant = flags & 1 != 0;
        if is_constant && usages.is_empty() {
            return Ok(());
        }
        let is_array = flags & 2 == 0;
        let [logical, physical] = self.globals.limits();
        let mut named = usages.iter().flat_map(|range| (0..range.count()).filter_map(|i| range.at(i)));
        let mut newest = Usage::new(page, 0);
        for element in 0..count {
            self.fields += 1;
            if self.fields > MAX_FIELDS {
                return Err(DescriptorError::TooManyFields { at });
            }
            let of_this = if is_array {
                Arc::clone(&usages)
            } else {
                // The last usage applies to all remaining fields.
                newest = named.next().unwrap_or(newest);
                Arc::from([UsageRange { first: newest, last: newest.id }])
            };
            report.fields.push(Field {
                usages: of_this,
                bit: begin + bits * element,
                bits,
                logical,
                physical,
                unit,
                unit_exponent,
                is_array,
                is_constant,
                is_relative: flags & 4 != 0,
                collection: self.open.last().copied(),
            });
        }
        Ok(())
    }
}

impl Locals {
    fn push(&mut self, page: Option<u16>, first: u16, last: u16) {
        if !(self.is_alternative && self.has_alternative) && first <= last {
            self.usages.push((page, first, last));
            self.has_alternative = true;
        }
    }
}

impl Globals {
    /// Minimum and maximum, logical and physical. A maximum is signed only if the minimum is negative: many devices declare 255 in one
    /// byte.
    fn limits(&self) -> [[i64; 2]; 2] {
        let highest = |low: i64, item: Option<Item>| match item {
            Some(item) if low < 0 => item.signed(),
            Some(item) => i64::from(item.data),
            None => 0,
        };
        let range = |low, item| [low, highest(low, item)];
        [range(self.logical_min, self.logical_max), range(self.physical_min, self.physical_max)]
    }
}

/// Value of a unit exponent: its lowest four bits, where 8 to 15 stand for -8 to -1. Many devices write all eight bits.
fn exponent(data: u32) -> i8 {
    let low = (data & 0xF) as i8;
    if low > 7 { low - 16 } else { low }
}

/// Page, if the item has one of its own, and ID of a usage item.
fn paged(item: Item) -> (Option<u16>, u16) {
    let page = (item.bytes == 4).then_some((item.data >> 16) as u16);
    (page, item.data as u16)
}
