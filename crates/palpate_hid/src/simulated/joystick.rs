//! Simulated force-feedback joystick: a stick with a mass, held by a hand, and motors driven by constant-force effects.

mod parsed_report;

use super::Firmware;
use crate::joystick::array_base::{PidArrayBases, offset};
use crate::joystick::usages::*;
use crate::{DescriptorError, ReportDescriptor, ReportKind};
use parsed_report::{Effect, ParsedReport};
use std::sync::Arc;

/// A stick held by a hand. The axes are independent: `m ẍ = F + k (x_hand - x) - c ẋ`, with the motor force `F`, integrated by
/// semi-implicit Euler with one step for each input report.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimulatedStick {
    /// Mass at the grip, kg.
    pub mass_kg: f64,
    /// Stiffness of the hand, N/m; 0 for a free stick.
    pub hand_n_per_m: f64,
    /// Damping of the hand, N s/m.
    pub hand_ns_per_m: f64,
    /// Travel from the centre to either end of x and of y, m.
    pub travel_m: [f64; 2],
    /// Force of the maximum magnitude of a constant force, N.
    pub full_scale_n: f64,
    /// Time between two input reports, s.
    pub step_s: f64,
    /// Maximum number of effects.
    pub max_effects: usize,
}

impl Default for SimulatedStick {
    /// 0.2 kg in a hand of 150 N/m and 5 N s/m, ±60 mm, 50 N, 1000 reports per second, four effects.
    fn default() -> Self {
        Self {
            mass_kg: 0.2,
            hand_n_per_m: 150.0,
            hand_ns_per_m: 5.0,
            travel_m: [0.06; 2],
            full_scale_n: 50.0,
            step_s: 1e-3,
            max_effects: 4,
        }
    }
}

/// Simulated firmware of a force-feedback joystick with any report descriptor. It supports only constant forces, rejects everything else
/// and everything that its descriptor does not allow, and has no watchdog: a magnitude stays for the duration of its effect. Each input
/// report advances the time by one step.
///
/// After each input report it returns none once, so a driver that reads all pending reports gets one at a time.
#[derive(Clone, Debug)]
pub struct JoystickFirmware {
    descriptor: Arc<ReportDescriptor>,
    stick: SimulatedStick,
    position_m: [f64; 2],
    velocity_m_per_s: [f64; 2],
    hand_m: [f64; 2],
    buttons: u32,
    has_just_reported: bool,
    /// Effect i has the index i + 1.
    effects: Vec<Option<Effect>>,
    creation_status: CreationStatus,
    fails_creation: bool,
    bases: PidArrayBases,
    wiring: [[f64; 2]; 2],
    is_on: bool,
    is_paused: bool,
    gain: f64,
}

/// Result of the last effect creation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum CreationStatus {
    None,
    Created(usize),
    Full,
    Failed,
}

impl JoystickFirmware {
    /// Creates the firmware with the report descriptor `descriptor`, actuators off, at rest in the centre.
    ///
    /// # Errors
    /// [`DescriptorError`].
    pub fn new(descriptor: &[u8], stick: SimulatedStick) -> Result<Self, DescriptorError> {
        Ok(Self {
            descriptor: Arc::new(ReportDescriptor::parse(descriptor)?),
            stick,
            position_m: [0.0; 2],
            velocity_m_per_s: [0.0; 2],
            hand_m: [0.0; 2],
            buttons: 0,
            has_just_reported: false,
            effects: vec![None; stick.max_effects],
            creation_status: CreationStatus::None,
            fails_creation: false,
            bases: PidArrayBases::default(),
            wiring: [[1.0, 0.0], [0.0, 1.0]],
            is_on: false,
            is_paused: false,
            gain: 1.0,
        })
    }

    /// Force of the motors on the stick along x and y, N.
    #[must_use]
    pub fn force_n(&self) -> [f64; 2] {
        if !self.is_on || self.is_paused {
            return [0.0; 2];
        }
        let playing = self.effects.iter().flatten().filter(|effect| effect.left_s > 0.0);
        let [x, y] = playing.fold([0.0; 2], |[x, y], effect| {
            let part = self.gain * effect.gain * effect.magnitude * self.stick.full_scale_n;
            [x + part * effect.along[0], y + part * effect.along[1]]
        });
        self.wiring.map(|[by_x, by_y]| by_x * x + by_y * y)
    }

    /// Position of the stick, m.
    #[must_use]
    pub fn position_m(&self) -> [f64; 2] {
        self.position_m
    }

    /// Number of effects.
    #[must_use]
    pub fn effects(&self) -> usize {
        self.effects.iter().flatten().count()
    }

    /// Whether the actuators are on.
    #[must_use]
    pub fn is_on(&self) -> bool {
        self.is_on
    }

    /// Moves the hand, m; the stick follows.
    pub fn move_hand(&mut self, hand_m: [f64; 2]) {
        self.hand_m = hand_m;
    }

    /// Presses buttons, bit i for button i + 1.
    pub fn press(&mut self, buttons: u32) {
        self.buttons = buttons;
    }

    /// Makes the creation of effects fail.
    pub fn break_effects(&mut self) {
        self.fails_creation = true;
    }

    /// Sets how the firmware numbers its arrays with the Logical Minimum 0; by default from 0.
    pub fn number_arrays(&mut self, bases: PidArrayBases) {
        self.bases = bases;
    }

    /// Sets the wiring of the motors: row i has the parts of an effect's force along x and y that act along axis i. A motor of x that is
    /// wired the other way has the first row `[-1.0, 0.0]`.
    pub fn wire_motors(&mut self, wiring: [[f64; 2]; 2]) {
        self.wiring = wiring;
    }

    /// Sets the velocity of the stick, m/s, as a bump does.
    pub fn bump(&mut self, velocity_m_per_s: [f64; 2]) {
        self.velocity_m_per_s = velocity_m_per_s;
    }

    /// Switches the actuators on, as a driver of the operating system may leave them.
    pub fn switch_on(&mut self) {
        self.is_on = true;
    }

    fn step(&mut self) {
        let (force_n, stick) = (self.force_n(), self.stick);
        for (axis, force_n) in force_n.into_iter().enumerate() {
            let (x, v) = (&mut self.position_m[axis], &mut self.velocity_m_per_s[axis]);
            let hand_n = stick.hand_n_per_m * (self.hand_m[axis] - *x) - stick.hand_ns_per_m * *v;
            *v += stick.step_s * (force_n + hand_n) / stick.mass_kg;
            let moved = *x + stick.step_s * *v;
            *x = moved.clamp(-stick.travel_m[axis], stick.travel_m[axis]);
            if *x != moved {
                *v = 0.0;
            }
        }
        for effect in self.effects.iter_mut().flatten() {
            effect.left_s -= stick.step_s;
        }
    }

    fn effect(&mut self, report: &ParsedReport<'_>) -> Option<&mut Effect> {
        let index = usize::try_from(report.value(INDEX)?).ok()?;
        self.effects.get_mut(index.checked_sub(1)?)?.as_mut()
    }

    /// Processes an output report; `None` for an invalid one.
    fn process(&mut self, report: &ParsedReport<'_>) -> Option<()> {
        if report.belongs_to(SET_CONSTANT_FORCE) {
            let field = report.field(MAGNITUDE)?;
            let magnitude = report.value(MAGNITUDE)? as f64 / field.logical[1] as f64;
            self.effect(report)?.magnitude = magnitude.max(-1.0);
        } else if report.belongs_to(SET_EFFECT) {
            let parameters = report.effect()?;
            let effect = self.effect(report)?;
            *effect = Effect {
                magnitude: effect.magnitude,
                left_s: effect.left_s.min(parameters.duration_s),
                ..parameters
            };
        } else if report.belongs_to(OPERATION_REPORT) {
            self.operate(report)?;
        } else if report.belongs_to(BLOCK_FREE) {
            self.effect(report)?;
            let index = usize::try_from(report.value(INDEX)?).ok()?;
            *self.effects.get_mut(index.checked_sub(1)?)? = None;
        } else if report.belongs_to(CONTROL) {
            self.control(report)?;
        } else if report.belongs_to(GAIN_REPORT) {
            self.gain = report.value(DEVICE_GAIN)? as f64 / report.field(DEVICE_GAIN)?.logical[1] as f64;
        } else {
            return None;
        }
        Some(())
    }

    fn operate(&mut self, report: &ParsedReport<'_>) -> Option<()> {
        let is_solo = report.is_set(OP_START_SOLO);
        let is_start = is_solo || report.is_set(OP_START);
        if is_start == report.is_set(OP_STOP) {
            return None;
        }
        let is_endless = report.field(LOOP_COUNT).is_none_or(|count| report.is_full(count));
        let loops = report.value(LOOP_COUNT).unwrap_or(1) as f64;
        self.effect(report)?;
        if is_solo {
            self.effects.iter_mut().flatten().for_each(|effect| effect.left_s = 0.0);
        }
        let effect = self.effect(report)?;
        effect.left_s = match (is_start, is_endless) {
            (false, _) => 0.0,
            (true, true) => effect.duration_s,
            (true, false) => effect.duration_s * loops,
        };
        Some(())
    }

    fn control(&mut self, report: &ParsedReport<'_>) -> Option<()> {
        // In this order, where each command has a bit of its own.
        let mut is_any = false;
        for command in [RESET, STOP_ALL, DISABLE_ACTUATORS, ENABLE_ACTUATORS, PAUSE, CONTINUE] {
            if !report.is_set(command) {
                continue;
            }
            is_any = true;
            match command.usage {
                usage if usage == RESET.usage => {
                    self.effects.fill(None);
                    // It stays paused, as ArduinoJoystickWithFFBLibrary does (PIDReportHandler.cpp at 04fdc39).
                    (self.is_on, self.gain) = (false, 1.0);
                }
                usage if usage == STOP_ALL.usage => {
                    self.effects.iter_mut().flatten().for_each(|effect| effect.left_s = 0.0);
                }
                usage if usage == PAUSE.usage => self.is_paused = true,
                usage if usage == CONTINUE.usage => self.is_paused = false,
                usage => self.is_on = usage == ENABLE_ACTUATORS.usage,
            }
        }
        is_any.then_some(())
    }
}

impl Firmware for JoystickFirmware {
    fn input(&mut self, report: &mut [u8]) -> usize {
        self.has_just_reported = !self.has_just_reported;
        if !self.has_just_reported {
            return 0;
        }
        self.step();
        let descriptor = Arc::clone(&self.descriptor);
        let within = [JOYSTICK, GAME_PAD].map(|named| named.usage);
        let found = within.iter().find_map(|&within| descriptor.find(ReportKind::Input, within, X.usage));
        let Some((input, _)) = found else { return 0 };
        let Some(report) = report.get_mut(..1 + input.bytes()) else { return 0 };
        report.fill(0);
        let Some((id, data)) = report.split_first_mut() else { return 0 };
        *id = input.id;
        for field in &input.fields {
            let Some(usage) = field.usages.first().map(|range| range.first) else { continue };
            if let Some(axis) = [X, Y].iter().position(|axis| axis.usage == usage) {
                let part = self.position_m[axis] / self.stick.travel_m[axis];
                let [low, high] = field.logical.map(|limit| limit as f64);
                field.set(data, (0.5 * (low + high) + part * 0.5 * (high - low)).round() as i64);
            } else if usage.page == BUTTONS && (1..=32).contains(&usage.id) && !field.is_array {
                field.set(data, i64::from(self.buttons >> (usage.id - 1) & 1));
            }
        }
        1 + input.bytes()
    }

    fn output(&mut self, report: &[u8]) -> bool {
        let descriptor = Arc::clone(&self.descriptor);
        let report = ParsedReport::of(&descriptor, ReportKind::Output, report, self.bases);
        report.is_some_and(|report| self.process(&report).is_some())
    }

    fn feature(&mut self, report: &mut [u8]) -> usize {
        let descriptor = Arc::clone(&self.descriptor);
        let Some((&mut id, data)) = report.split_first_mut() else { return 0 };
        let Some(requested) = descriptor.report(ReportKind::Feature, id) else { return 0 };
        let Some(data) = data.get_mut(..requested.bytes()) else { return 0 };
        data.fill(0);
        let is =
            |named: Named| requested.fields.iter().any(|it| descriptor.around(it).any(|a| a == named.usage));
        let base = self.bases.load_status;
        let mut put = |named: Named, value: i64| {
            if let Some(field) = requested.field(named.usage) {
                let number = || Some(field.value_of(named.usage)? + offset(field, base));
                let value = if field.is_array { number() } else { Some(value) };
                value.and_then(|value| field.set(data, value));
            }
        };
        if is(BLOCK_LOAD) {
            match self.creation_status {
                CreationStatus::None => {}
                CreationStatus::Created(index) => {
                    put(INDEX, i64::try_from(index).unwrap_or(0));
                    put(LOAD_SUCCESS, 1);
                }
                CreationStatus::Full => put(LOAD_FULL, 1),
                CreationStatus::Failed => put(LOAD_ERROR, 1),
            }
        } else if is(POOL_REPORT) {
            put(MAX_EFFECTS, i64::try_from(self.stick.max_effects).unwrap_or(0));
            put(DEVICE_MANAGED, 1);
        } else {
            return 0;
        }
        1 + requested.bytes()
    }

    fn set_feature(&mut self, report: &[u8]) -> bool {
        let descriptor = Arc::clone(&self.descriptor);
        let report = ParsedReport::of(&descriptor, ReportKind::Feature, report, self.bases);
        if !report.is_some_and(|report| report.belongs_to(CREATE_EFFECT) && report.is_set(ET_CONSTANT)) {
            return false;
        }
        let free = self.effects.iter().position(Option::is_none);
        self.creation_status = match free.and_then(|index| Some((index, self.effects.get_mut(index)?))) {
            _ if self.fails_creation => CreationStatus::Failed,
            Some((index, place)) => {
                *place = Some(Effect::default());
                CreationStatus::Created(index + 1)
            }
            None => CreationStatus::Full,
        };
        true
    }
}
