//! The haptic loop: one tick takes a reading and returns a force.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

mod lifecycle;

use crate::black_box::BlackBox;
use crate::displayed_forces::DisplayedForces;
use crate::exchange::{HapticHandle, LoopChannels, exchange};
use crate::force_board::ForceBoard;
use crate::frozen_position::FrozenPosition;
use crate::plausibility::Plausibility;
use crate::sampling::{HandMotion, Periods, Sampler};
use crate::{
    BlackBoxTick, DeviceError, HapticsError, LoopConfig, LoopEvent, LoopEventKind, LoopReport, LoopSettings,
    MAX_BRIDGED_TICKS, Reading, SafetyChain, SafetyInput, TickOutput, TickTiming,
};
use palpate_local::{HandOver, ModelId, OtherToolForce, RenderedForce, SubmitResult};
use std::sync::Arc;

/// Upper bound on the periods between two ticks: about three years of ticks of 1 ms.
const MAX_ELAPSED: u64 = 100_000_000_000;

/// Ticks between two published reports.
const REPORT_PERIOD: u64 = 64;

/// Creates a loop and its handle. The handle stays with the app; the loop runs on a thread ([`HapticLoop::spawn`]) or in lock step
/// ([`crate::Lockstep`]).
///
/// # Errors
/// [`HapticsError`] if a value of `config` or `settings` is out of range.
pub fn haptic_loop(
    config: LoopConfig,
    settings: LoopSettings,
) -> Result<(HapticHandle, HapticLoop), HapticsError> {
    let (handle, channels) = exchange(config, settings)?;
    Ok((handle, HapticLoop::new(config, settings, channels)?))
}

/// The loop's half: it owns the active local model, the safety chain and the loop's ends of the exchange.
///
/// [`HapticLoop::tick`] is a function of its arguments, of the loop's state and of the data received through the exchange. It reads
/// no clock, allocates, frees, locks and logs nothing, and does not panic. A loop runs once: [`HapticLoop::spawn`], [`crate::run`]
/// and [`crate::Lockstep`] consume it.
#[derive(Debug)]
pub struct HapticLoop {
    config: LoopConfig,
    settings: LoopSettings,
    pub(crate) channels: LoopChannels,
    hand_over: HandOver,
    safety: SafetyChain,
    sampler: Sampler,
    motion: HandMotion,
    displayed: DisplayedForces,
    black_box: BlackBox,
    /// Periods since the start, up to the last tick.
    sequence: u64,
    /// Ticks in a row without an accepted reading.
    silent_ticks: u64,
    plausibility: Plausibility,
    frozen: FrozenPosition,
    /// Whether the next tick arms the start stage of the safety chain again.
    rearm: bool,
    /// Ticks in a row in which writing to the device failed.
    unwritten_ticks: u64,
    /// Whether the active model was stale at the last tick.
    is_stale: bool,
    /// Whether the rendered force was not finite at the last tick.
    is_not_finite: bool,
    report: LoopReport,
    /// The board on which the loop publishes its forces, with its slot and the identity of its tool.
    board: Option<(Arc<ForceBoard>, usize, u64)>,
    /// The force of the followed tool that was read last.
    other: Option<OtherToolForce>,
}

impl HapticLoop {
    /// Connects the loop to a `board`: it publishes its forces in `slot`, as those of the tool with the identity `tool`, and reads those
    /// of [`LoopSettings::other`]. No other loop may publish in the slot.
    pub fn connect(&mut self, board: Arc<ForceBoard>, slot: usize, tool: u64) {
        self.board = Some((board, slot, tool));
    }

    fn new(config: LoopConfig, settings: LoopSettings, channels: LoopChannels) -> Result<Self, HapticsError> {
        let tick_s = config.hand_over.tick_s;
        Ok(Self {
            config,
            settings,
            channels,
            hand_over: HandOver::new(config.hand_over)?,
            safety: SafetyChain::new(tick_s, config.device)?,
            sampler: Sampler::new(tick_s),
            motion: HandMotion::default(),
            displayed: DisplayedForces::with_capacity(config.hand_over.history),
            black_box: BlackBox::new(),
            sequence: 0,
            silent_ticks: 0,
            plausibility: Plausibility::default(),
            frozen: FrozenPosition::default(),
            rearm: false,
            unwritten_ticks: 0,
            is_stale: false,
            is_not_finite: false,
            report: LoopReport::new(),
            board: None,
            other: None,
        })
    }

    /// Sizes and rates of the loop.
    #[must_use]
    pub fn config(&self) -> &LoopConfig {
        &self.config
    }

    /// Computes one tick from the device's `reading`, device frame, `elapsed` periods after the previous tick: 1, or more after
    /// missed deadlines. Write the force to the device, then call [`HapticLoop::finish_tick`].
    pub fn tick(&mut self, elapsed: u64, reading: Result<Reading, DeviceError>) -> TickOutput {
        let elapsed = elapsed.clamp(1, MAX_ELAPSED);
        // Models before settings: an app that selects another body and then publishes a model of it
        // must not have that model checked against the old settings.
        let has_arrived = self.hand_over.is_ready() && self.channels.models.update();
        let frame = self.settings.frame;
        let settings = self.adopt_settings();
        if frame.rotation != self.settings.frame.rotation {
            // The force at the device stays the same; its coordinates in the scene rotate.
            self.safety.rotate_frame(self.settings.frame.rotation * frame.rotation.conjugate());
        }
        let reading = self.validate_reading(reading.and_then(usable), elapsed);
        let in_scene = reading.map(|r| self.settings.frame.to_scene(&r)).and_then(usable);
        self.record_deadlines(elapsed);
        self.sequence = self.sequence.saturating_add(elapsed);
        let has_recovered = self.record_reading(&in_scene, elapsed);
        let has_jumped = has_recovered || frame != self.settings.frame;
        let periods = Periods { sequence: self.sequence, elapsed };
        let estimator = self.settings.velocity;
        let other = self.read_other();
        self.sampler.take_sample(&mut self.hand_over, estimator, periods, (&in_scene, other), has_jumped);
        let new_model = if has_arrived { Some(self.take_model()) } else { None };
        let rendered = self.hand_over.render();
        self.record_model(&rendered);
        if let Some((board, slot, tool)) = &self.board {
            board.publish(*slot, *tool, self.hand_over.forces_on_bodies_n());
        }
        let input = self.safety_input(&rendered, elapsed, has_jumped);
        let (force_n, safety) = self.safety.apply(&self.settings.safety, &input);
        self.report.safety_acted += u64::from(safety.acted());
        // One event when the model becomes stale; none during a pause, in which no model is expected.
        if std::mem::replace(&mut self.is_stale, safety.stale) != safety.stale
            && safety.stale
            && !self.settings.paused
        {
            self.emit(LoopEventKind::ModelStale(input.model_age_periods));
        }
        if !std::mem::replace(&mut self.is_not_finite, safety.not_finite) && safety.not_finite {
            self.emit(LoopEventKind::ForceNotFinite);
        }
        let sample = self.hand_over.history().newest().copied();
        if let Some(sample) = sample.filter(|_| rendered.model.is_some()) {
            self.displayed.push(sample.sequence, rendered.force_n);
        }
        TickOutput {
            device_force_n: self.settings.frame.force_to_device(force_n),
            sequence: self.sequence,
            elapsed,
            reading,
            sample,
            settings,
            new_model,
            rendered,
            safety,
            force_n,
        }
    }

    /// Completes a tick after its force was written: records the result of the write (`written`) and the times, and publishes
    /// samples, black box and report to the app.
    pub fn finish_tick(
        &mut self,
        output: TickOutput,
        timing: Option<TickTiming>,
        written: Result<(), DeviceError>,
    ) {
        self.record_write(written, output.elapsed);
        if let Some(timing) = timing {
            self.report.record_timing(timing, self.config.hand_over.tick_s);
        }
        self.report.ticks += 1;
        let record = output.complete(written, timing.unwrap_or_default());
        self.black_box.push(BlackBoxTick::of(&record, self.config.hand_over.tick_s));
        let snapshot = self.channels.samples.input_buffer_mut();
        snapshot.history.catch_up_with(self.hand_over.history());
        snapshot.displayed.catch_up_with(&self.displayed);
        snapshot.black_box.catch_up_with(&self.black_box);
        snapshot.latest = Some(record);
        self.channels.samples.publish();
        if self.settings.record {
            self.report.dropped_records += u64::from(self.channels.records.try_send(record).is_err());
        }
        if self.report.ticks.is_multiple_of(REPORT_PERIOD) {
            self.publish_report();
        }
    }

    fn publish_report(&mut self) {
        self.channels.reports.input_buffer_mut().copy_from(&self.report);
        self.channels.reports.publish();
    }

    fn emit(&mut self, kind: LoopEventKind) {
        let event = LoopEvent { sequence: self.sequence, kind };
        self.report.dropped_events += u64::from(self.channels.events.try_send(event).is_err());
    }

    /// Checks whether `reading` is plausible. After a jump whose path was not observed, the start stage is armed again.
    fn validate_reading(
        &mut self,
        reading: Result<Reading, DeviceError>,
        elapsed: u64,
    ) -> Result<Reading, DeviceError> {
        let step_m = self.settings.jump_m_per_s * self.config.hand_over.tick_s;
        let accepted = self.plausibility.validate(reading, elapsed, step_m)?;
        if let Some(distance_m) = accepted.jumped_m {
            self.rearm = true;
            self.emit(LoopEventKind::HandJumped(distance_m));
        }
        // Without motors there is no arm whose encoder could be lost; the position of a mouse stays while the cap is turned.
        if self.config.device.force_n > 0.0 {
            let elapsed_s = elapsed as f64 * self.config.hand_over.tick_s;
            if let Some(frozen_s) = self.frozen.check(&accepted.reading, elapsed_s) {
                self.emit(LoopEventKind::PositionFrozen(frozen_s));
            }
        }
        Ok(accepted.reading)
    }

    fn safety_input(&mut self, rendered: &RenderedForce, elapsed: u64, has_jumped: bool) -> SafetyInput {
        let newest = self.hand_over.history().newest();
        let (moved_m, velocity_m_per_s) = self.motion.advance(newest, self.settings.frame.scale, has_jumped);
        let in_model_periods =
            |ticks: u64| ticks as f64 * self.config.hand_over.tick_s / self.settings.model_period_s;
        SafetyInput {
            force_n: rendered.force_n + self.settings.external_force_n,
            external_n: self.settings.external_force_n,
            has_model: rendered.model.is_some(),
            model_age_periods: rendered
                .model
                .map_or(0.0, |m| in_model_periods(self.sequence.saturating_sub(m.sequence))),
            silent_ticks: self.silent_ticks.max(self.unwritten_ticks),
            paused: self.settings.paused,
            sampled: newest.is_some(),
            has_jumped: std::mem::take(&mut self.rearm),
            moved_m,
            velocity_m_per_s,
            elapsed,
        }
    }

    /// The newest force of the followed tool.
    fn read_other(&mut self) -> Option<OtherToolForce> {
        let followed = self.settings.other?;
        let (board, ..) = self.board.as_ref()?;
        let is_followed = |force: &OtherToolForce| (force.tool, force.body) == (followed.tool, followed.body);
        let newest = board.read(followed.slot, followed.tool, followed.body);
        self.other = newest.or(self.other.filter(is_followed));
        self.other
    }

    fn adopt_settings(&mut self) -> Option<(u64, LoopSettings)> {
        if !self.channels.settings.update() {
            return None;
        }
        let (number, settings) = *self.channels.settings.output_buffer();
        self.settings = settings;
        self.report.settings_number = number;
        if let Some(bodies) = settings.bodies() {
            self.hand_over.retain_bodies(&bodies);
        }
        self.emit(LoopEventKind::SettingsAdopted(number));
        Some((number, settings))
    }

    fn record_deadlines(&mut self, elapsed: u64) {
        self.report.success.note(elapsed);
        let missed = elapsed - 1;
        if missed > 0 {
            self.report.missed_deadlines += missed;
            let is_gap = missed > MAX_BRIDGED_TICKS;
            // The hand's path during a gap is unobserved.
            self.rearm |= is_gap;
            self.report.gaps += u64::from(is_gap);
            self.emit(if is_gap {
                LoopEventKind::Gap(missed)
            } else {
                LoopEventKind::DeadlinesMissed(missed)
            });
        }
    }

    /// Returns whether this is the first reading after ticks without one.
    fn record_reading(&mut self, reading: &Result<Reading, DeviceError>, elapsed: u64) -> bool {
        match reading {
            Ok(_) => {
                let silent = std::mem::take(&mut self.silent_ticks);
                if silent > 0 {
                    self.emit(LoopEventKind::DeviceRecovered(silent));
                }
                silent > 0
            }
            Err(error) => {
                if error.is_rejected_reading() {
                    self.report.rejected_readings += 1;
                } else {
                    self.report.device_errors += 1;
                }
                // One event at the first failure; `DeviceRecovered` gives the duration.
                if self.silent_ticks == 0 {
                    self.emit(LoopEventKind::DeviceFailed(*error));
                }
                self.silent_ticks = self.silent_ticks.saturating_add(elapsed);
                false
            }
        }
    }

    fn record_write(&mut self, written: Result<(), DeviceError>, elapsed: u64) {
        let Err(error) = written else {
            self.unwritten_ticks = 0;
            return;
        };
        self.report.device_errors += 1;
        // One event at the first failure.
        if self.unwritten_ticks == 0 {
            self.emit(LoopEventKind::DeviceFailed(error));
        }
        self.unwritten_ticks = self.unwritten_ticks.saturating_add(elapsed);
        self.safety.write_failed();
    }

    /// Submits the local model that arrived.
    fn take_model(&mut self) -> ModelId {
        let model = self.channels.models.output_buffer();
        let (id, second) = (model.id, model.second.body);
        let bodies = self.settings.bodies();
        let is_accepted = |body: u64| bodies.is_none_or(|bodies| bodies.contains(&body));
        let has_second = second != ModelId::NO_BODY && is_accepted(second);
        let is_wrong = id.body != ModelId::NO_BODY && !is_accepted(id.body) && !has_second;
        let rejected = if is_wrong {
            LoopEventKind::WrongBody(id)
        } else {
            match self.hand_over.submit(model) {
                SubmitResult::Accepted => {
                    // A body may have been removed while the model waited.
                    if let Some([first, second]) = bodies {
                        self.hand_over.retain_bodies(&[first, second, ModelId::NO_BODY]);
                    }
                    return id;
                }
                SubmitResult::Busy => return id,
                SubmitResult::Rejected(error) => LoopEventKind::ModelRejected(error),
            }
        };
        self.report.models_rejected += 1;
        self.emit(rejected);
        id
    }

    fn record_model(&mut self, rendered: &RenderedForce) {
        self.report.unconverged_ticks += u64::from(rendered.unconverged);
        if let Some(swap) = rendered.swap {
            self.report.models_adopted += 1;
            self.report.last_swap = Some(swap);
            self.emit(LoopEventKind::ModelAdopted(swap));
        }
        if let Some(error) = rendered.abandoned {
            self.report.models_rejected += 1;
            self.emit(LoopEventKind::ModelRejected(error));
        }
    }
}

fn usable(reading: Reading) -> Result<Reading, DeviceError> {
    if reading.is_usable() { Ok(reading) } else { Err(DeviceError::Unusable) }
}
