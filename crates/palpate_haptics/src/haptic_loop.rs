//! One tick of the loop: reading in, force out.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

use crate::black_box::BlackBox;
use crate::displayed::DisplayedForces;
use crate::exchange::LoopChannels;
use crate::plausibility::Plausibility;
use crate::real_time;
use crate::timing::LoopReport;
use crate::velocity::VelocityState;
use crate::{
    BlackBoxTick, DeviceError, HapticsError, LoopConfig, LoopEvent, LoopEventKind, LoopSettings, Reading,
    SafetyChain, SafetyInput, TickRecord, TickTiming,
};
use glam::{DQuat, DVec3};
use palpate_local::{HandOver, ModelId, RenderedForce, Sample, SampleOrigin, SubmitResult};

/// Missed deadlines in a row that are bridged by interpolated samples; more begin the samples anew.
pub const MAX_BRIDGED_TICKS: u64 = 200;

/// A longer sleep than that counts as one of that length: about three years of ticks of 1 ms.
const LONGEST_GAP: u64 = 100_000_000_000;

/// Ticks between two published reports.
const REPORT_PERIOD: u64 = 64;

/// The loop's half: it owns the speaking local model, the safety chain and the loop's ends of the exchange.
///
/// [`HapticLoop::tick`] is a function of its arguments, the loop's state and what has arrived by the exchange.
/// It reads no clock, allocates, frees, locks and logs nothing, and does not panic. A loop runs once: it is used
/// up by [`HapticLoop::spawn`], [`crate::run`] or [`crate::Lockstep`].
#[derive(Debug)]
pub struct HapticLoop {
    config: LoopConfig,
    settings: LoopSettings,
    pub(crate) ends: LoopChannels,
    hand_over: HandOver,
    safety: SafetyChain,
    velocity: VelocityState,
    displayed: DisplayedForces,
    black_box: BlackBox,
    /// Periods since the start, up to the last tick.
    sequence: u64,
    /// Ticks in a row without a usable reading.
    silent_ticks: u64,
    plausibility: Plausibility,
    /// The start of the force begins anew at this tick.
    begin_anew: bool,
    /// Where the hand was at the last tick, m, in its own size.
    hand_m: Option<DVec3>,
    /// Ticks in a row in which the device took no force.
    unwritten_ticks: u64,
    /// The speaking model was too old at the last tick; its force was not finite.
    is_stale: bool,
    is_not_finite: bool,
    report: LoopReport,
}

/// The outcome of a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TickOutput {
    /// The force to be written to the device, N, device frame.
    pub device_force_n: DVec3,
    /// Everything else, to be given back to [`HapticLoop::finish_tick`].
    pub record: TickRecord,
}

impl HapticLoop {
    pub(crate) fn new(
        config: LoopConfig,
        settings: LoopSettings,
        ends: LoopChannels,
    ) -> Result<Self, HapticsError> {
        Ok(Self {
            config,
            settings,
            ends,
            hand_over: HandOver::new(config.hand_over)?,
            safety: SafetyChain::new(config.hand_over.tick_s, config.device)?,
            velocity: VelocityState::default(),
            displayed: DisplayedForces::with_capacity(config.hand_over.history),
            black_box: BlackBox::new(),
            sequence: 0,
            silent_ticks: 0,
            plausibility: Plausibility::default(),
            begin_anew: false,
            hand_m: None,
            unwritten_ticks: 0,
            is_stale: false,
            is_not_finite: false,
            report: LoopReport::new(),
        })
    }

    /// Sizes and rates.
    #[must_use]
    pub fn config(&self) -> &LoopConfig {
        &self.config
    }

    /// One tick, `elapsed` periods after the last one (1, more where deadlines were missed), with what the
    /// device gave. The force must be written before [`HapticLoop::finish_tick`] is called.
    pub fn tick(&mut self, elapsed: u64, reading: Result<Reading, DeviceError>) -> TickOutput {
        let elapsed = elapsed.clamp(1, LONGEST_GAP);
        // Models before settings: whoever sets a tool to another body and then publishes a model of it must not
        // have the model judged by the old settings.
        let arrived = self.hand_over.is_ready() && self.ends.models.update();
        let frame = self.settings.frame;
        let settings = self.adopt_settings();
        if frame.rotation != self.settings.frame.rotation {
            // The device goes on showing what it shows, whatever the scene calls it.
            self.safety.rotate_frame(self.settings.frame.rotation * frame.rotation.conjugate());
        }
        let reading = self.validate_reading(reading.and_then(usable), elapsed);
        let in_scene = reading.map(|r| self.settings.frame.to_scene(&r)).and_then(usable);
        self.record_deadlines(elapsed);
        self.sequence = self.sequence.saturating_add(elapsed);
        let recovered = self.record_reading(&in_scene, elapsed);
        let has_jumped = recovered || frame != self.settings.frame;
        self.take_sample(elapsed, &in_scene, has_jumped);
        let taken = if arrived { Some(self.take_model()) } else { None };
        let spoken = self.hand_over.render();
        self.record_model(&spoken);
        let (moved_m, velocity_m_per_s) = self.hand_motion(has_jumped);
        let periods = |ticks: u64| ticks as f64 * self.config.hand_over.tick_s / self.settings.model_period_s;
        let input = SafetyInput {
            force_n: spoken.force_n,
            has_model: spoken.model.is_some(),
            model_age_periods: spoken
                .model
                .map_or(0.0, |m| periods(self.sequence.saturating_sub(m.sequence))),
            silent_ticks: self.silent_ticks.max(self.unwritten_ticks),
            paused: self.settings.paused,
            sampled: !self.hand_over.history().is_empty(),
            has_jumped: std::mem::take(&mut self.begin_anew),
            moved_m,
            velocity_m_per_s,
            elapsed,
        };
        let (force_n, safety) = self.safety.apply(&self.settings.safety, &input);
        self.report.safety_acted += u64::from(safety.acted());
        // One word when it begins; no word in a pause, in which none is expected.
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
        if let Some(sample) = sample.filter(|_| spoken.model.is_some()) {
            self.displayed.push(sample.sequence, spoken.force_n);
        }
        let timing = TickTiming::default();
        let record = TickRecord {
            sequence: self.sequence,
            elapsed,
            reading,
            sample,
            settings,
            taken,
            rendered: spoken,
            safety,
            force_n,
            written: Ok(()),
            timing,
        };
        TickOutput { device_force_n: self.settings.frame.force_to_device(force_n), record }
    }

    /// After the force of `ticked` has been written: takes the time and publishes what the app wants to know.
    pub fn finish_tick(
        &mut self,
        ticked: &TickOutput,
        timing: Option<TickTiming>,
        written: Result<(), DeviceError>,
    ) {
        match written {
            Ok(()) => self.unwritten_ticks = 0,
            Err(error) => {
                self.report.device_errors += 1;
                // One word when it begins.
                if self.unwritten_ticks == 0 {
                    self.emit(LoopEventKind::DeviceFailed(error));
                }
                self.unwritten_ticks = self.unwritten_ticks.saturating_add(ticked.record.elapsed);
                self.safety.write_failed();
            }
        }
        if let Some(timing) = timing {
            self.report.lateness.record(timing.lateness_ns);
            self.report.cost.record(timing.cost_ns);
            self.report.read.record(timing.read_ns);
            self.report.write.record(timing.write_ns);
            if timing.period_ns > 0 {
                self.report.period.record(timing.period_ns);
            }
            let period_ns = 1e9 * self.config.hand_over.tick_s;
            self.report.overruns += u64::from(timing.cost_ns as f64 > period_ns);
        }
        self.report.ticks += 1;
        let record = TickRecord { written, timing: timing.unwrap_or_default(), ..ticked.record };
        self.black_box.push(BlackBoxTick::of(&record, self.config.hand_over.tick_s));
        let sampled = self.ends.samples.input_buffer_mut();
        sampled.history.catch_up_with(self.hand_over.history());
        sampled.displayed.catch_up_with(&self.displayed);
        sampled.black_box.catch_up_with(&self.black_box);
        sampled.latest = Some(record);
        self.ends.samples.publish();
        if self.settings.record {
            self.report.dropped_records += u64::from(self.ends.records.try_send(record).is_err());
        }
        if self.report.ticks.is_multiple_of(REPORT_PERIOD) {
            self.publish_report();
        }
    }

    /// Asks the operating system for what the thread needs, on that thread.
    pub(crate) fn set_up_thread(&mut self) {
        let granted = real_time::apply(self.config.real_time);
        real_time::touch_stack();
        self.report.real_time = granted;
        self.emit(LoopEventKind::RealTime(granted));
    }

    /// Tells the app that the device is open, and whether it is watched.
    pub(crate) fn start(&mut self, is_watched: bool) {
        self.emit(LoopEventKind::Started);
        if !is_watched {
            self.emit(LoopEventKind::NoEmergencyStop);
        }
    }

    /// The device was stopped beside the loop: its force begins anew.
    pub(crate) fn was_stopped(&mut self) {
        self.begin_anew = true;
        self.safety.reset_output();
        self.emit(LoopEventKind::EmergencyStopped);
    }

    /// The device has been opened again: its force begins anew, wherever the hand is now.
    pub(crate) fn reconnected(&mut self) {
        (self.begin_anew, self.plausibility) = (true, Plausibility::default());
        self.safety.reset_output();
        self.emit(LoopEventKind::Reconnected);
    }

    /// The device was disconnected and could not be opened again, for another reason than the last that was told.
    pub(crate) fn not_reopened(&mut self, error: DeviceError) {
        self.emit(LoopEventKind::ReopenFailed(error));
    }

    /// The driver or the loop panicked; zero force has been written and the device closed.
    pub(crate) fn panicked(&mut self) {
        self.emit(LoopEventKind::Panicked);
        self.report.ended = true;
        self.publish_report();
    }

    /// The last words: `closed` is what closing the device gave.
    pub(crate) fn end(&mut self, closed: Result<(), DeviceError>) {
        if let Err(error) = closed {
            self.report.device_errors += 1;
            self.emit(LoopEventKind::DeviceFailed(error));
        }
        self.emit(LoopEventKind::Stopped);
        self.report.ended = true;
        self.publish_report();
    }

    fn publish_report(&mut self) {
        self.ends.reports.input_buffer_mut().copy_from(&self.report);
        self.ends.reports.publish();
    }

    fn emit(&mut self, kind: LoopEventKind) {
        let event = LoopEvent { sequence: self.sequence, kind };
        self.report.dropped_events += u64::from(self.ends.events.try_send(event).is_err());
    }

    /// `reading` if it is believed. Where nobody saw how the hand came there, the start begins anew.
    fn validate_reading(
        &mut self,
        reading: Result<Reading, DeviceError>,
        elapsed: u64,
    ) -> Result<Reading, DeviceError> {
        let step_m = self.settings.jump_m_per_s * self.config.hand_over.tick_s;
        let believed = self.plausibility.validate(reading, elapsed, step_m)?;
        if let Some(distance_m) = believed.jumped_m {
            self.begin_anew = true;
            self.emit(LoopEventKind::HandJumped(distance_m));
        }
        Ok(believed.reading)
    }

    /// How far the hand has moved since the last tick, m, and its velocity, m/s, in its own size and the scene's axes.
    fn hand_motion(&mut self, has_jumped: bool) -> (DVec3, DVec3) {
        let Some(sample) = self.hand_over.history().newest() else { return (DVec3::ZERO, DVec3::ZERO) };
        let scale = self.settings.frame.scale;
        let at = sample.position_m / scale;
        let last = self.hand_m.replace(at).filter(|_| !has_jumped);
        (last.map_or(DVec3::ZERO, |last| at - last), sample.velocity_m_per_s / scale)
    }

    fn adopt_settings(&mut self) -> Option<(u64, LoopSettings)> {
        if !self.ends.settings.update() {
            return None;
        }
        let (number, settings) = *self.ends.settings.output_buffer();
        self.settings = settings;
        self.report.settings_number = number;
        if let Some(body) = settings.body {
            self.hand_over.retain_body(body);
        }
        self.emit(LoopEventKind::SettingsAdopted(number));
        Some((number, settings))
    }

    fn record_deadlines(&mut self, elapsed: u64) {
        self.report.success.note(elapsed);
        let missed = elapsed - 1;
        if missed > 0 {
            self.report.missed_deadlines += missed;
            let long = missed > MAX_BRIDGED_TICKS;
            // What the hand did meanwhile nobody knows.
            self.begin_anew |= long;
            self.report.gaps += u64::from(long);
            self.emit(if long { LoopEventKind::Gap(missed) } else { LoopEventKind::DeadlinesMissed(missed) });
        }
    }

    /// Returns whether the device has answered again after a silence.
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
                if error.is_of_the_loop() {
                    self.report.rejected_readings += 1;
                } else {
                    self.report.device_errors += 1;
                }
                // One word when it begins; `DeviceRecovered` says how long it lasted.
                if self.silent_ticks == 0 {
                    self.emit(LoopEventKind::DeviceFailed(*error));
                }
                self.silent_ticks = self.silent_ticks.saturating_add(elapsed);
                false
            }
        }
    }

    /// Makes the sample of this tick and those of the missed ones before it. After a `jump` the tool is elsewhere
    /// without having moved there: that is no velocity, and there is nothing between.
    fn take_sample(&mut self, elapsed: u64, reading: &Result<Reading, DeviceError>, jump: bool) {
        let last = self.hand_over.history().newest().copied();
        let first_missed = self.sequence.saturating_sub(elapsed - 1);
        if let Some(last) = last.filter(|_| elapsed <= MAX_BRIDGED_TICKS + 1) {
            for (i, sequence) in (1..elapsed).zip(first_missed..) {
                match reading {
                    Ok(now) if !jump => {
                        let along = i as f64 / elapsed as f64;
                        let between = Reading {
                            position_m: last.position_m + (now.position_m - last.position_m) * along,
                            orientation: slerp(last.orientation, now.orientation, along),
                            ..*now
                        };
                        self.push_sample(sequence, &between, SampleOrigin::Interpolated);
                    }
                    _ => self.repeat_sample(sequence, &last),
                }
            }
        } else {
            self.velocity.reset();
        }
        match (reading, last) {
            (Ok(now), _) => {
                if jump {
                    self.velocity.reset();
                }
                self.push_sample(self.sequence, now, SampleOrigin::Measured);
            }
            (Err(_), Some(last)) => self.repeat_sample(self.sequence, &last),
            (Err(_), None) => {}
        }
    }

    /// The last sample again, at rest.
    fn repeat_sample(&mut self, sequence: u64, last: &Sample) {
        let at_rest =
            Reading { orientation: last.orientation, buttons: last.buttons, ..Reading::at(last.position_m) };
        self.velocity.reset();
        self.push_sample(sequence, &at_rest, SampleOrigin::Repeated);
    }

    fn push_sample(&mut self, sequence: u64, reading: &Reading, origin: SampleOrigin) {
        let tick_s = self.config.hand_over.tick_s;
        let told = reading.velocity_m_per_s;
        let velocity_m_per_s = self.velocity.step(self.settings.velocity, reading.position_m, told, tick_s);
        self.hand_over.push(Sample {
            sequence,
            time_s: sequence as f64 * tick_s,
            position_m: reading.position_m,
            velocity_m_per_s,
            orientation: reading.orientation,
            buttons: reading.buttons,
            origin,
        });
    }

    /// Offers the local model that has arrived.
    fn take_model(&mut self) -> ModelId {
        let model = self.ends.models.output_buffer();
        let id = model.id;
        let refused = if self.settings.body.is_some_and(|body| ![body, ModelId::NO_BODY].contains(&id.body)) {
            LoopEventKind::WrongBody(id)
        } else {
            match self.hand_over.submit(model) {
                SubmitResult::Accepted | SubmitResult::Busy => return id,
                SubmitResult::Rejected(error) => LoopEventKind::ModelRefused(error),
            }
        };
        self.report.models_rejected += 1;
        self.emit(refused);
        id
    }

    fn record_model(&mut self, spoken: &RenderedForce) {
        self.report.unconverged_ticks += u64::from(spoken.unconverged);
        if let Some(swap) = spoken.swap {
            self.report.models_adopted += 1;
            self.report.last_swap = Some(swap);
            self.emit(LoopEventKind::ModelAdopted(swap));
        }
        if let Some(error) = spoken.abandoned {
            self.report.models_rejected += 1;
            self.emit(LoopEventKind::ModelRefused(error));
        }
    }
}

fn usable(reading: Reading) -> Result<Reading, DeviceError> {
    if reading.is_usable() { Ok(reading) } else { Err(DeviceError::Unusable) }
}

/// Between two orientations; the later one where they are opposite and no way between is the shorter.
fn slerp(from: DQuat, to: DQuat, along: f64) -> DQuat {
    let between = from.slerp(to, along);
    if between.is_finite() { between } else { to }
}
