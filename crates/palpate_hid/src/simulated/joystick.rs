//! A force-feedback joystick without hardware: a stick with a mass in a hand, and motors that do what constant forces say.

mod parsed_report;

use super::Firmware;
use crate::joystick::usages::*;
use crate::{DescriptorError, ReportDescriptor, ReportKind};
use parsed_report::{Effect, ParsedReport};
use std::sync::Arc;

/// A stick in a hand. Each axis is for itself: `m ẍ = F + k (x_hand - x) - c ẋ`, with `F` of the motor, advanced by a step of
/// semi-implicit Euler with every input report.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimulatedStick {
    /// Mass at the grip, kg.
    pub mass_kg: f64,
    /// Stiffness of the hand, N/m; 0 for a stick that nobody holds.
    pub hand_n_per_m: f64,
    /// Its damping, N s/m.
    pub hand_ns_per_m: f64,
    /// From the middle to either end of x and of y, m.
    pub travel_m: [f64; 2],
    /// What the greatest magnitude of a constant force is, N.
    pub full_scale_n: f64,
    /// Time between two input reports, s.
    pub step_s: f64,
    /// How many effects it has room for.
    pub max_effects: usize,
}

impl Default for SimulatedStick {
    /// 0.2 kg in a hand of 150 N/m and 5 N s/m, ±60 mm, 50 N, a thousand reports a second, room for four effects.
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

/// The firmware of a force-feedback joystick with any report descriptor. It knows constant forces and nothing else, refuses what it
/// does not know and what its descriptor does not allow, and has no watchdog: a magnitude stays for as long as its effect lasts. Its
/// time passes with its input reports, a step with each.
///
/// After every input report it says once that there is none, so that one who reads until there are no more gets one at a time.
#[derive(Clone, Debug)]
pub struct JoystickFirmware {
    descriptor: Arc<ReportDescriptor>,
    stick: SimulatedStick,
    position_m: [f64; 2],
    velocity_m_per_s: [f64; 2],
    hand_m: [f64; 2],
    buttons: u32,
    has_just_said: bool,
    /// Effect i has the index i + 1.
    effects: Vec<Option<Effect>>,
    loaded: Loaded,
    is_broken: bool,
    is_on: bool,
    is_paused: bool,
    gain: f64,
}

/// What became of the effect that was asked for last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Loaded {
    Nothing,
    Made(usize),
    Full,
    Failed,
}

impl JoystickFirmware {
    /// With the report descriptor `descriptor`, actuators off, at rest in the middle.
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
            has_just_said: false,
            effects: vec![None; stick.max_effects],
            loaded: Loaded::Nothing,
            is_broken: false,
            is_on: false,
            is_paused: false,
            gain: 1.0,
        })
    }

    /// What its motors do to the stick, N, along x and y.
    #[must_use]
    pub fn force_n(&self) -> [f64; 2] {
        if !self.is_on || self.is_paused {
            return [0.0; 2];
        }
        let playing = self.effects.iter().flatten().filter(|effect| effect.left_s > 0.0);
        playing.fold([0.0; 2], |[x, y], effect| {
            let part = self.gain * effect.gain * effect.magnitude * self.stick.full_scale_n;
            [x + part * effect.along[0], y + part * effect.along[1]]
        })
    }

    /// Where the stick is, m.
    #[must_use]
    pub fn position_m(&self) -> [f64; 2] {
        self.position_m
    }

    /// How many effects it has.
    #[must_use]
    pub fn effects(&self) -> usize {
        self.effects.iter().flatten().count()
    }

    /// Whether its actuators are on.
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

    /// Has every new effect fail.
    pub fn break_effects(&mut self) {
        self.is_broken = true;
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

    fn effect(&mut self, heard: &ParsedReport<'_>) -> Option<&mut Effect> {
        let index = usize::try_from(heard.value(INDEX)?).ok()?;
        self.effects.get_mut(index.checked_sub(1)?)?.as_mut()
    }

    /// Takes an output report; `None` where it makes no sense.
    fn take(&mut self, heard: &ParsedReport<'_>) -> Option<()> {
        if heard.is(SET_CONSTANT_FORCE) {
            let field = heard.field(MAGNITUDE)?;
            let magnitude = heard.value(MAGNITUDE)? as f64 / field.logical[1] as f64;
            self.effect(heard)?.magnitude = magnitude.max(-1.0);
        } else if heard.is(SET_EFFECT) {
            let told = heard.effect()?;
            let effect = self.effect(heard)?;
            *effect = Effect { magnitude: effect.magnitude, left_s: effect.left_s.min(told.lasts_s), ..told };
        } else if heard.is(OPERATION_REPORT) {
            self.operate(heard)?;
        } else if heard.is(BLOCK_FREE) {
            self.effect(heard)?;
            let index = usize::try_from(heard.value(INDEX)?).ok()?;
            *self.effects.get_mut(index.checked_sub(1)?)? = None;
        } else if heard.is(CONTROL) {
            self.control(heard)?;
        } else if heard.is(GAIN_REPORT) {
            self.gain = heard.value(DEVICE_GAIN)? as f64 / heard.field(DEVICE_GAIN)?.logical[1] as f64;
        } else {
            return None;
        }
        Some(())
    }

    fn operate(&mut self, heard: &ParsedReport<'_>) -> Option<()> {
        let is_solo = heard.says(OP_START_SOLO);
        let is_start = is_solo || heard.says(OP_START);
        if is_start == heard.says(OP_STOP) {
            return None;
        }
        let is_endless = heard.field(LOOP_COUNT).is_none_or(|count| heard.is_full(count));
        let loops = heard.value(LOOP_COUNT).unwrap_or(1) as f64;
        self.effect(heard)?;
        if is_solo {
            self.effects.iter_mut().flatten().for_each(|effect| effect.left_s = 0.0);
        }
        let effect = self.effect(heard)?;
        effect.left_s = match (is_start, is_endless) {
            (false, _) => 0.0,
            (true, true) => effect.lasts_s,
            (true, false) => effect.lasts_s * loops,
        };
        Some(())
    }

    fn control(&mut self, heard: &ParsedReport<'_>) -> Option<()> {
        // One after the other where there is a bit for each.
        let mut is_any = false;
        for command in [RESET, STOP_ALL, DISABLE_ACTUATORS, ENABLE_ACTUATORS, PAUSE, CONTINUE] {
            if !heard.says(command) {
                continue;
            }
            is_any = true;
            match command.usage {
                usage if usage == RESET.usage => {
                    self.effects.fill(None);
                    // It stays paused, as one with ArduinoJoystickWithFFBLibrary does (PIDReportHandler.cpp at 04fdc39).
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
        self.has_just_said = !self.has_just_said;
        if !self.has_just_said {
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
        let heard = ParsedReport::of(&descriptor, ReportKind::Output, report);
        heard.is_some_and(|heard| self.take(&heard).is_some())
    }

    fn feature(&mut self, report: &mut [u8]) -> usize {
        let descriptor = Arc::clone(&self.descriptor);
        let Some((&mut id, data)) = report.split_first_mut() else { return 0 };
        let Some(asked) = descriptor.report(ReportKind::Feature, id) else { return 0 };
        let Some(data) = data.get_mut(..asked.bytes()) else { return 0 };
        data.fill(0);
        let is = |named: Named| asked.fields.iter().any(|it| descriptor.around(it).any(|a| a == named.usage));
        let mut put = |named: Named, value: i64| {
            if let Some(field) = asked.field(named.usage) {
                let value = if field.is_array { field.value_of(named.usage) } else { Some(value) };
                value.and_then(|value| field.set(data, value));
            }
        };
        if is(BLOCK_LOAD) {
            match self.loaded {
                Loaded::Nothing => {}
                Loaded::Made(index) => {
                    put(INDEX, i64::try_from(index).unwrap_or(0));
                    put(LOAD_SUCCESS, 1);
                }
                Loaded::Full => put(LOAD_FULL, 1),
                Loaded::Failed => put(LOAD_ERROR, 1),
            }
        } else if is(POOL_REPORT) {
            put(MAX_EFFECTS, i64::try_from(self.stick.max_effects).unwrap_or(0));
            put(DEVICE_MANAGED, 1);
        } else {
            return 0;
        }
        1 + asked.bytes()
    }

    fn set_feature(&mut self, report: &[u8]) -> bool {
        let descriptor = Arc::clone(&self.descriptor);
        let heard = ParsedReport::of(&descriptor, ReportKind::Feature, report);
        if !heard.is_some_and(|heard| heard.is(CREATE_EFFECT) && heard.says(ET_CONSTANT)) {
            return false;
        }
        let free = self.effects.iter().position(Option::is_none);
        self.loaded = match free.and_then(|index| Some((index, self.effects.get_mut(index)?))) {
            _ if self.is_broken => Loaded::Failed,
            Some((index, place)) => {
                *place = Some(Effect::default());
                Loaded::Made(index + 1)
            }
            None => Loaded::Full,
        };
        true
    }
}
