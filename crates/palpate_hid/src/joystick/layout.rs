//! Report layout of a force-feedback joystick, found by the usages in its descriptor. Report IDs, widths and positions of fields differ
//! from device to device.

use super::array_base::{PidArrayBase, PidArrayBases, is_ambiguous};
use super::effect_duration;
use super::force_scale::ForceScale;
use super::input::InputLayout;
use super::off_reports::OffReports;
use super::report_encoding::{ReportTemplate, UsageValue, blank, max_value, put, put_raw};
use super::usages::*;
use crate::{Field, HidError, JoystickOptions, Report, ReportDescriptor, ReportKind};

/// Axes with a motor: x alone, or x and y.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Axes {
    X,
    Xy,
}

/// Layout of all reports of the driver.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    pub(super) input: InputLayout,
    pub(super) axes: Axes,
    pub(super) control: Control,
    /// Report that sets the maximum gain.
    pub(super) gain: Option<Vec<u8>>,
    pub(super) pool: Option<Pool>,
    /// Feature report that creates a constant force.
    pub(super) create: Vec<u8>,
    pub(super) block_load: BlockLoad,
    /// Whether effects have a finite duration and must be started again in time.
    pub(super) has_finite_effects: bool,
    /// Parameters of a constant force along x, and of one along y.
    pub(super) set_effect: [ReportTemplate; 2],
    pub(super) constant_force: ReportTemplate,
    pub(super) magnitude: Field,
    pub(super) scale: ForceScale,
    pub(super) start: ReportTemplate,
    pub(super) stop: ReportTemplate,
    pub(super) free: Option<ReportTemplate>,
}

/// Device control report for each command.
#[derive(Clone, Debug)]
pub(super) struct Control {
    pub(super) reset: Vec<u8>,
    /// Ends a pause; `None` without the command.
    pub(super) resume: Option<Vec<u8>>,
    pub(super) enable: Vec<u8>,
    pub(super) off: OffReports,
    pub(super) stop_all: Vec<u8>,
}

/// Feature report with the status of a new effect.
#[derive(Clone, Debug)]
pub(super) struct BlockLoad {
    pub(super) blank: Vec<u8>,
    pub(super) index: Field,
    pub(super) success: UsageValue,
    pub(super) full: Option<UsageValue>,
    pub(super) error: Option<UsageValue>,
}

/// Feature report with the capacity for effects.
#[derive(Clone, Debug)]
pub(super) struct Pool {
    pub(super) blank: Vec<u8>,
    pub(super) max_effects: Option<Field>,
    pub(super) is_managed: Option<Field>,
}

impl Layout {
    /// Finds the layout in `descriptor`; errors name the device `device`.
    ///
    /// # Errors
    /// [`HidError::Unsupported`], which names the missing usage; [`HidError::AmbiguousArrays`].
    pub(super) fn of(
        device: &str,
        descriptor: &ReportDescriptor,
        options: &JoystickOptions,
    ) -> Result<Self, HidError> {
        let find = UsageFinder { device, descriptor, bases: options.pid_arrays };
        if !descriptor.is_numbered() {
            return Err(find.lacks("report IDs"));
        }
        let input = InputLayout::of(descriptor, options.use_y)
            .ok_or_else(|| find.missing(ReportKind::Input, X, &[JOYSTICK, GAME_PAD]))?;
        let (effect, kind) = find.usage_value(ReportKind::Output, SET_EFFECT, ET_CONSTANT)?;
        let set_effect =
            SetEffect { find, report: effect, kind, index: find.field_of(effect, SET_EFFECT, INDEX)? };
        let duration = set_effect.finite_duration();
        let axes = if input.has_y() && set_effect.has_y() { Axes::Xy } else { Axes::X };

        let (report, magnitude) = find.field(ReportKind::Output, SET_CONSTANT_FORCE, MAGNITUDE)?;
        let scale = ForceScale::of(magnitude, options.full_scale_n)
            .ok_or_else(|| find.lacks("Magnitude (000F:0070) of a constant force that can be negative"))?;
        let index = find.field_of(report, SET_CONSTANT_FORCE, INDEX)?.clone();
        let constant_force = ReportTemplate { bytes: blank(report), index };

        let (_, create) = find.command_report(ReportKind::Feature, CREATE_EFFECT, ET_CONSTANT)?;
        let layout = Self {
            axes,
            control: find.control()?,
            gain: find.gain(),
            pool: find.pool(),
            create,
            block_load: find.block_load()?,
            has_finite_effects: duration.is_some(),
            // A direction is that from which the force comes, clockwise from the far end of y; its components are -sin and +cos. A
            // force to the right comes from the left, 270°, and a force along y from the far end, 0°. OpenFFBoard's
            // EffectsCalculator.cpp at b5282dc and HidFFB.cpp at 3a4cc0e: -(sin, -cos); ArduinoJoystickWithFFBLibrary's Joystick.cpp at
            // 04fdc39: (-sin, cos); Linux, ff.rst: 0 is down, 90° left.
            set_effect: [set_effect.template(X, 0.75), set_effect.template(Y, 0.0)],
            constant_force,
            magnitude: magnitude.clone(),
            scale,
            start: find.operation(OP_START, duration.is_some())?,
            stop: find.operation(OP_STOP, false)?,
            free: find
                .field(ReportKind::Output, BLOCK_FREE, INDEX)
                .ok()
                .map(|(report, index)| ReportTemplate { bytes: blank(report), index: index.clone() }),
            input,
        };
        find.reject_ambiguous_arrays()?;
        Ok(layout)
    }

    /// Whether all reports can hold the effect index `index`. Index 0 means none.
    pub(super) fn has_index(&self, index: i64) -> bool {
        let [x, y] = &self.set_effect;
        let templates = [x, y, &self.constant_force, &self.start, &self.stop].into_iter().chain(&self.free);
        let mut fields = templates.map(|template| &template.index).chain([&self.block_load.index]);
        index > 0 && fields.all(|field| (field.logical[0]..=field.logical[1]).contains(&index))
    }
}

/// Finds usages in a descriptor; errors name the missing ones.
#[derive(Clone, Copy)]
struct UsageFinder<'a> {
    device: &'a str,
    descriptor: &'a ReportDescriptor,
    bases: PidArrayBases,
}

/// Usages that the driver uses as values of arrays, one for each array: type and collection of the report, and the usage.
const ARRAYS: [(ReportKind, Named, Named); 5] = [
    (ReportKind::Output, CONTROL, DISABLE_ACTUATORS),
    (ReportKind::Output, OPERATION_REPORT, OP_START),
    (ReportKind::Output, SET_EFFECT, ET_CONSTANT),
    (ReportKind::Feature, CREATE_EFFECT, ET_CONSTANT),
    (ReportKind::Feature, BLOCK_LOAD, LOAD_SUCCESS),
];

impl<'a> UsageFinder<'a> {
    fn lacks(self, what: &str) -> HidError {
        let lacks = format!("its report descriptor has no {what}");
        HidError::Unsupported { device: self.device.to_owned(), lacks }
    }

    fn missing(self, kind: ReportKind, wanted: Named, within: &[Named]) -> HidError {
        let label = |named: &Named| format!("{} ({})", named.name, named.usage);
        let kind = match kind {
            ReportKind::Input => "an input",
            ReportKind::Output => "an output",
            ReportKind::Feature => "a feature",
        };
        let within = within.iter().map(label).collect::<Vec<_>>().join(" or ");
        self.lacks(&format!("{} in {kind} report of {within}", label(&wanted)))
    }

    /// Base of an array in the report of `within`, if it is set.
    fn base(self, within: Named) -> Option<PidArrayBase> {
        let PidArrayBases { control, operation, effect_type, load_status } = self.bases;
        match within.usage {
            usage if usage == CONTROL.usage => control,
            usage if usage == OPERATION_REPORT.usage => operation,
            usage if usage == BLOCK_LOAD.usage => load_status,
            _ => effect_type,
        }
    }

    /// Rejects arrays that firmware may number in two ways, unless an option states which.
    fn reject_ambiguous_arrays(self) -> Result<(), HidError> {
        let is_unsettled = |&&(kind, within, wanted): &&(ReportKind, Named, Named)| {
            let found = self.descriptor.find(kind, within.usage, wanted.usage);
            self.base(within).is_none() && found.is_some_and(|(_, field)| is_ambiguous(field))
        };
        let unsettled = ARRAYS.iter().filter(is_unsettled);
        let arrays: Vec<String> =
            unsettled.map(|(_, within, _)| format!("{} ({})", within.name, within.usage)).collect();
        if arrays.is_empty() {
            return Ok(());
        }
        Err(HidError::AmbiguousArrays { device: self.device.to_owned(), arrays })
    }

    /// Field with the usage `wanted` in a collection `within`.
    fn field(
        self,
        kind: ReportKind,
        within: Named,
        wanted: Named,
    ) -> Result<(&'a Report, &'a Field), HidError> {
        let found = self.descriptor.find(kind, within.usage, wanted.usage);
        found
            .filter(|(_, field)| (1..=32).contains(&field.bits))
            .ok_or_else(|| self.missing(kind, wanted, &[within]))
    }

    /// Field with the usage `wanted` in `report`, the report of `within`.
    fn field_of(self, report: &'a Report, within: Named, wanted: Named) -> Result<&'a Field, HidError> {
        report.field(wanted.usage).ok_or_else(|| self.missing(report.kind, wanted, &[within]))
    }

    fn usage_value(
        self,
        kind: ReportKind,
        within: Named,
        wanted: Named,
    ) -> Result<(&'a Report, UsageValue), HidError> {
        let (report, field) = self.field(kind, within, wanted)?;
        let value = UsageValue::of(field, wanted.usage, self.base(within))
            .ok_or_else(|| self.missing(kind, wanted, &[within]))?;
        Ok((report, value))
    }

    /// Report that sets the usage `wanted` and nothing else.
    fn command_report(
        self,
        kind: ReportKind,
        within: Named,
        wanted: Named,
    ) -> Result<(&'a Report, Vec<u8>), HidError> {
        let (report, value) = self.usage_value(kind, within, wanted)?;
        let mut bytes = blank(report);
        value.write(&mut bytes);
        Ok((report, bytes))
    }

    fn control(self) -> Result<Control, HidError> {
        let command =
            |command| self.command_report(ReportKind::Output, CONTROL, command).map(|(_, bytes)| bytes);
        Ok(Control {
            reset: command(RESET)?,
            resume: command(CONTINUE).ok(),
            enable: command(ENABLE_ACTUATORS)?,
            off: self.off()?,
            stop_all: command(STOP_ALL)?,
        })
    }

    fn off(self) -> Result<OffReports, HidError> {
        let (report, field) = self.field(ReportKind::Output, CONTROL, DISABLE_ACTUATORS)?;
        OffReports::of(report, field, self.base(CONTROL))
            .ok_or_else(|| self.missing(ReportKind::Output, DISABLE_ACTUATORS, &[CONTROL]))
    }

    fn gain(self) -> Option<Vec<u8>> {
        let (report, gain) = self.field(ReportKind::Output, GAIN_REPORT, DEVICE_GAIN).ok()?;
        let mut bytes = blank(report);
        put(&mut bytes, gain, gain.logical[1]);
        Some(bytes)
    }

    fn pool(self) -> Option<Pool> {
        let of = |wanted| self.field(ReportKind::Feature, POOL_REPORT, wanted).ok();
        let (max_effects, is_managed) = (of(MAX_EFFECTS), of(DEVICE_MANAGED));
        let (report, _) = max_effects.or(is_managed)?;
        let of_this = |found: Option<(&'a Report, &Field)>| {
            found.filter(|(other, _)| other.id == report.id).map(|(_, field)| field.clone())
        };
        Some(Pool {
            blank: blank(report),
            max_effects: of_this(max_effects),
            is_managed: of_this(is_managed),
        })
    }

    fn block_load(self) -> Result<BlockLoad, HidError> {
        let (report, success) = self.usage_value(ReportKind::Feature, BLOCK_LOAD, LOAD_SUCCESS)?;
        let base = self.base(BLOCK_LOAD);
        let other = |status: Named| UsageValue::of(report.field(status.usage)?, status.usage, base);
        Ok(BlockLoad {
            blank: blank(report),
            index: self.field_of(report, BLOCK_LOAD, INDEX)?.clone(),
            success,
            full: other(LOAD_FULL),
            error: other(LOAD_ERROR),
        })
    }

    /// Report of an effect operation. The loop count of a start is 1 for finite effects and the maximum for endless ones: some devices
    /// multiply the duration by it.
    fn operation(self, operation: Named, has_finite_effects: bool) -> Result<ReportTemplate, HidError> {
        let (report, mut bytes) = self.command_report(ReportKind::Output, OPERATION_REPORT, operation)?;
        let index = self.field_of(report, OPERATION_REPORT, INDEX)?.clone();
        if operation.usage == OP_START.usage {
            let times = |count: &Field| if has_finite_effects { 1 } else { max_value(count) };
            report.field(LOOP_COUNT.usage).inspect(|count| put_raw(&mut bytes, count, times(count)));
        }
        Ok(ReportTemplate { bytes, index })
    }
}

/// Set Effect report.
struct SetEffect<'a> {
    find: UsageFinder<'a>,
    report: &'a Report,
    kind: UsageValue,
    index: &'a Field,
}

impl SetEffect<'_> {
    fn fields_in(&self, collection: Named) -> impl Iterator<Item = &Field> {
        let is_in =
            move |field: &&Field| self.find.descriptor.around(field).any(|around| around == collection.usage);
        self.report.fields.iter().filter(is_in)
    }

    fn axis(&self, axis: Named) -> Option<&Field> {
        self.fields_in(AXES_ENABLE).find(|field| field.has(axis.usage))
    }

    /// Whether effects can act along y: y can be enabled, or without enabled axes a direction can be set.
    fn has_y(&self) -> bool {
        let has_axes = self.fields_in(AXES_ENABLE).next().is_some();
        if has_axes { self.axis(Y).is_some() } else { self.direction().is_some() }
    }

    /// Field of the direction in the plane; further direction fields are angles out of it.
    fn direction(&self) -> Option<&Field> {
        let settable = || self.fields_in(DIRECTION).filter(|field| !field.is_constant);
        let first = settable().find(|field| field.has(FIRST_INSTANCE));
        first.or_else(|| settable().next()).or_else(|| self.report.field(DIRECTION.usage))
    }

    /// Value for a duration of 0.5 s, where it can be represented.
    fn finite_duration(&self) -> Option<i64> {
        self.report.field(DURATION.usage).and_then(effect_duration::duration_counts)
    }

    /// Parameters of a constant force on `axis`, from the direction `turn` (fraction of a full turn), without envelope or trigger.
    ///
    /// The duration is finite where the field can hold it. Otherwise all bits of the duration are set, which means endless: 0xFFFF for
    /// OpenFFBoard (`FFB_EFFECT_DURATION_INFINITE` in ffb_defs.h at 160af91), and for Linux the maximum of the bits.
    /// ArduinoJoystickWithFFBLibrary uses the loop count 0xFF instead. The trigger button is a number that no button has.
    ///
    /// Direction and axis are both enabled: OpenFFBoard uses the direction where it is enabled, the Arduino library the component of the
    /// direction along each enabled axis.
    fn template(&self, axis: Named, turn: f64) -> ReportTemplate {
        let mut bytes = blank(self.report);
        let field = |named: Named| self.report.field(named.usage);
        self.kind.write(&mut bytes);
        if let Some(duration) = field(DURATION) {
            put_raw(&mut bytes, duration, self.finite_duration().unwrap_or_else(|| max_value(duration)));
        }
        if let Some(gain) = field(GAIN) {
            put(&mut bytes, gain, gain.logical[1]);
        }
        if let Some(button) = field(TRIGGER_BUTTON) {
            let none = if button.logical[0] > 0 { 0 } else { max_value(button) };
            put_raw(&mut bytes, button, none);
        }
        for enabled in [self.axis(axis), field(DIRECTION_ENABLE)].into_iter().flatten() {
            if !enabled.is_constant {
                put_raw(&mut bytes, enabled, 1);
            }
        }
        if let Some(direction) = self.direction() {
            let [low, high] = direction.logical.map(|limit| limit as f64);
            put(&mut bytes, direction, (low + turn * (high - low)).round() as i64);
        }
        ReportTemplate { bytes, index: self.index.clone() }
    }
}
