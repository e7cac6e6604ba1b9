//! What a force-feedback joystick's reports are, found by what its descriptor says they mean and never by their numbers, widths or
//! places, which differ from device to device.

use super::effect_duration;
use super::force_scale::Scale;
use super::input::Input;
use super::report_encoding::{Template, Word, blank, highest, put, put_raw};
use super::usages::*;
use crate::{Field, HidError, JoystickOptions, Report, ReportDescriptor, ReportKind};

/// The axes that have a motor: x alone, or x and y.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Axes {
    X,
    Xy,
}

/// All that the driver says and hears.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    pub(super) input: Input,
    pub(super) axes: Axes,
    pub(super) control: Control,
    /// The greatest gain of the device.
    pub(super) gain: Option<Vec<u8>>,
    pub(super) pool: Option<Pool>,
    /// Asks for a new constant force, a feature report.
    pub(super) create: Vec<u8>,
    pub(super) block_load: BlockLoad,
    /// Whether its effects end by themselves and have to be started again in time.
    pub(super) ends: bool,
    /// What a constant force along x is, and one along y.
    pub(super) set_effect: [Template; 2],
    pub(super) constant_force: Template,
    pub(super) magnitude: Field,
    pub(super) scale: Scale,
    pub(super) start: Template,
    pub(super) stop: Template,
    pub(super) free: Option<Template>,
}

/// The device control report, once for each command.
#[derive(Clone, Debug)]
pub(super) struct Control {
    pub(super) reset: Vec<u8>,
    /// Ends a pause, where there is such a command.
    pub(super) resume: Option<Vec<u8>>,
    pub(super) enable: Vec<u8>,
    pub(super) disable: Vec<u8>,
    pub(super) stop_all: Vec<u8>,
}

/// The feature report that says what has become of a new effect.
#[derive(Clone, Debug)]
pub(super) struct BlockLoad {
    pub(super) blank: Vec<u8>,
    pub(super) index: Field,
    pub(super) success: Word,
    pub(super) full: Option<Word>,
    pub(super) error: Option<Word>,
}

/// The feature report that says what room there is.
#[derive(Clone, Debug)]
pub(super) struct Pool {
    pub(super) blank: Vec<u8>,
    pub(super) most: Option<Field>,
    pub(super) is_managed: Option<Field>,
}

impl Layout {
    /// That of the device `device` with `descriptor`.
    ///
    /// # Errors
    /// [`HidError::Unsupported`], with the usage that is missing.
    pub(super) fn of(
        device: &str,
        descriptor: &ReportDescriptor,
        options: &JoystickOptions,
    ) -> Result<Self, HidError> {
        let find = Finder { device, descriptor };
        if !descriptor.is_numbered() {
            return Err(find.lacks("report numbers"));
        }
        let input = Input::of(descriptor, options.use_y)
            .ok_or_else(|| find.missing(ReportKind::Input, X, &[JOYSTICK, GAME_PAD]))?;
        let (effect, kind) = find.word(ReportKind::Output, SET_EFFECT, ET_CONSTANT)?;
        let set_effect =
            SetEffect { find, report: effect, kind, index: find.field_of(effect, SET_EFFECT, INDEX)? };
        let lasts = set_effect.lasts();
        let axes = if input.has_y() && set_effect.has_y() { Axes::Xy } else { Axes::X };

        let (report, magnitude) = find.field(ReportKind::Output, SET_CONSTANT_FORCE, MAGNITUDE)?;
        let scale = Scale::of(magnitude, options.full_scale_n)
            .ok_or_else(|| find.lacks("Magnitude (000F:0070) of a constant force that can be negative"))?;
        let index = find.field_of(report, SET_CONSTANT_FORCE, INDEX)?.clone();
        let constant_force = Template { bytes: blank(report), index };

        let (_, create) = find.said(ReportKind::Feature, CREATE_EFFECT, ET_CONSTANT)?;
        Ok(Self {
            axes,
            control: find.control()?,
            gain: find.gain(),
            pool: find.pool(),
            create,
            block_load: find.block_load()?,
            ends: lasts.is_some(),
            // Directions are where the force comes from, clockwise from the far end of y: its parts are -sin and +cos. So force
            // comes from the left, 270°, to push to the right, and from the far end, 0°, to push along y. OpenFFBoard's
            // EffectsCalculator.cpp at b5282dc and HidFFB.cpp at 3a4cc0e: -(sin, -cos); ArduinoJoystickWithFFBLibrary's
            // Joystick.cpp at 04fdc39: (-sin, cos); Linux, ff.rst: 0 is down, 90° left.
            set_effect: [set_effect.template(X, 0.75), set_effect.template(Y, 0.0)],
            constant_force,
            magnitude: magnitude.clone(),
            scale,
            start: find.operation(OP_START, lasts.is_some())?,
            stop: find.operation(OP_STOP, false)?,
            free: find
                .field(ReportKind::Output, BLOCK_FREE, INDEX)
                .ok()
                .map(|(report, index)| Template { bytes: blank(report), index: index.clone() }),
            input,
        })
    }

    /// Whether every report about an effect can be about the effect `index`. Index 0 means none.
    pub(super) fn has_index(&self, index: i64) -> bool {
        let [x, y] = &self.set_effect;
        let templates = [x, y, &self.constant_force, &self.start, &self.stop].into_iter().chain(&self.free);
        let mut fields = templates.map(|template| &template.index).chain([&self.block_load.index]);
        index > 0 && fields.all(|field| (field.logical[0]..=field.logical[1]).contains(&index))
    }
}

/// Looks for usages in a descriptor, and says which are missing.
#[derive(Clone, Copy)]
struct Finder<'a> {
    device: &'a str,
    descriptor: &'a ReportDescriptor,
}

impl<'a> Finder<'a> {
    fn lacks(self, what: &str) -> HidError {
        let lacks = format!("its report descriptor has no {what}");
        HidError::Unsupported { device: self.device.to_owned(), lacks }
    }

    fn missing(self, kind: ReportKind, wanted: Named, within: &[Named]) -> HidError {
        let told = |named: &Named| format!("{} ({})", named.name, named.usage);
        let kind = match kind {
            ReportKind::Input => "an input",
            ReportKind::Output => "an output",
            ReportKind::Feature => "a feature",
        };
        let within = within.iter().map(told).collect::<Vec<_>>().join(" or ");
        self.lacks(&format!("{} in {kind} report of {within}", told(&wanted)))
    }

    /// The field with `wanted` in a collection with `within`.
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

    /// The field with `wanted` in `report`, which is that of `within`.
    fn field_of(self, report: &'a Report, within: Named, wanted: Named) -> Result<&'a Field, HidError> {
        report.field(wanted.usage).ok_or_else(|| self.missing(report.kind, wanted, &[within]))
    }

    fn word(self, kind: ReportKind, within: Named, wanted: Named) -> Result<(&'a Report, Word), HidError> {
        let (report, field) = self.field(kind, within, wanted)?;
        let word = Word::of(field, wanted.usage).ok_or_else(|| self.missing(kind, wanted, &[within]))?;
        Ok((report, word))
    }

    /// A report that says `wanted` and nothing else.
    fn said(self, kind: ReportKind, within: Named, wanted: Named) -> Result<(&'a Report, Vec<u8>), HidError> {
        let (report, word) = self.word(kind, within, wanted)?;
        let mut bytes = blank(report);
        word.say(&mut bytes);
        Ok((report, bytes))
    }

    fn control(self) -> Result<Control, HidError> {
        let command = |command| self.said(ReportKind::Output, CONTROL, command).map(|(_, bytes)| bytes);
        Ok(Control {
            reset: command(RESET)?,
            resume: command(CONTINUE).ok(),
            enable: command(ENABLE_ACTUATORS)?,
            disable: command(DISABLE_ACTUATORS)?,
            stop_all: command(STOP_ALL)?,
        })
    }

    fn gain(self) -> Option<Vec<u8>> {
        let (report, gain) = self.field(ReportKind::Output, GAIN_REPORT, DEVICE_GAIN).ok()?;
        let mut bytes = blank(report);
        put(&mut bytes, gain, gain.logical[1]);
        Some(bytes)
    }

    fn pool(self) -> Option<Pool> {
        let of = |wanted| self.field(ReportKind::Feature, POOL_REPORT, wanted).ok();
        let (most, is_managed) = (of(MAX_EFFECTS), of(DEVICE_MANAGED));
        let (report, _) = most.or(is_managed)?;
        let of_this = |found: Option<(&'a Report, &Field)>| {
            found.filter(|(other, _)| other.id == report.id).map(|(_, field)| field.clone())
        };
        Some(Pool { blank: blank(report), most: of_this(most), is_managed: of_this(is_managed) })
    }

    fn block_load(self) -> Result<BlockLoad, HidError> {
        let (report, success) = self.word(ReportKind::Feature, BLOCK_LOAD, LOAD_SUCCESS)?;
        let other = |status: Named| Word::of(report.field(status.usage)?, status.usage);
        Ok(BlockLoad {
            blank: blank(report),
            index: self.field_of(report, BLOCK_LOAD, INDEX)?.clone(),
            success,
            full: other(LOAD_FULL),
            error: other(LOAD_ERROR),
        })
    }

    /// A start is once, the whole duration, where effects end, and else as often as can be: some devices take a duration times that
    /// number.
    fn operation(self, operation: Named, ends: bool) -> Result<Template, HidError> {
        let (report, mut bytes) = self.said(ReportKind::Output, OPERATION_REPORT, operation)?;
        let index = self.field_of(report, OPERATION_REPORT, INDEX)?.clone();
        if operation.usage == OP_START.usage {
            let times = |count: &Field| if ends { 1 } else { highest(count) };
            report.field(LOOP_COUNT.usage).inspect(|count| put_raw(&mut bytes, count, times(count)));
        }
        Ok(Template { bytes, index })
    }
}

/// The report that says what an effect is.
struct SetEffect<'a> {
    find: Finder<'a>,
    report: &'a Report,
    kind: Word,
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

    /// Whether effects can be along y: one of the axes that can be enabled, or any direction.
    fn has_y(&self) -> bool {
        let has_axes = self.fields_in(AXES_ENABLE).next().is_some();
        if has_axes { self.axis(Y).is_some() } else { self.direction().is_some() }
    }

    /// The field of a direction in the plane; others are angles out of it.
    fn direction(&self) -> Option<&Field> {
        let settable = || self.fields_in(DIRECTION).filter(|field| !field.is_constant);
        let first = settable().find(|field| field.has(FIRST_INSTANCE));
        first.or_else(|| settable().next()).or_else(|| self.report.field(DIRECTION.usage))
    }

    /// What to write as a duration of half a second, where that can be written.
    fn lasts(&self) -> Option<i64> {
        self.report.field(DURATION.usage).and_then(effect_duration::counts)
    }

    /// A constant force that only its magnitude changes, on `axis`, from `turn` parts of a full turn.
    ///
    /// It ends by itself where the duration can say so. Where it cannot, all bits of the duration mean without end: 0xFFFF for
    /// OpenFFBoard (`FFB_EFFECT_DURATION_INFINITE` in ffb_defs.h at 160af91), and for Linux the greatest that the bits can hold;
    /// ArduinoJoystickWithFFBLibrary goes by the number of loops, 0xFF. That no button triggers it is said by a number that no
    /// button has.
    ///
    /// Direction and axis are both enabled: OpenFFBoard goes by the direction where it is enabled, the Arduino library takes the
    /// direction's part along each axis that is enabled.
    fn template(&self, axis: Named, turn: f64) -> Template {
        let mut bytes = blank(self.report);
        let field = |named: Named| self.report.field(named.usage);
        self.kind.say(&mut bytes);
        if let Some(duration) = field(DURATION) {
            put_raw(&mut bytes, duration, self.lasts().unwrap_or_else(|| highest(duration)));
        }
        if let Some(gain) = field(GAIN) {
            put(&mut bytes, gain, gain.logical[1]);
        }
        if let Some(button) = field(TRIGGER_BUTTON) {
            let none = if button.logical[0] > 0 { 0 } else { highest(button) };
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
        Template { bytes, index: self.index.clone() }
    }
}
