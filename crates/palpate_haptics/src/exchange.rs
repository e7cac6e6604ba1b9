//! The two halves of a loop and what crosses between them.
//!
//! | data | direction | structure | when the reader is late |
//! | --- | --- | --- | --- |
//! | samples, and what was displayed at each | loop → model side | triple buffer of a history of at least 512 | older ones are lost; the gap is seen in the sequence numbers |
//! | black box | loop → app | the same triple buffer, a ring of 4096 ticks | older ones are lost |
//! | local model | model side → loop | triple buffer | the loop keeps the last one, and its age fades the force |
//! | settings | app → loop | triple buffer, one struct with a number | the newest counts; the loop acknowledges by number |
//! | report | loop → app | triple buffer | the newest counts |
//! | events, tick records | loop → app | bounded queues, `try_send` only | dropped and counted |

use crate::black_box::BlackBox;
use crate::displayed::DisplayedForces;
use crate::haptic_loop::HapticLoop;
use crate::timing::LoopReport;
use crate::{HapticsError, LoopConfig, LoopEvent, LoopSettings, TickRecord};
use crossbeam_channel::{Receiver, Sender, bounded};
use palpate_local::{LocalModel, SampleHistory};
use triple_buffer::{Input, Output, triple_buffer};

/// The app's half of a loop: publishes local models and settings, reads samples, events and reports.
///
/// It cannot be cloned, and nothing it does makes the loop wait.
#[derive(Debug)]
pub struct HapticHandle {
    config: LoopConfig,
    settings: Input<(u64, LoopSettings)>,
    newest_settings: (u64, LoopSettings),
    models: Input<LocalModel>,
    samples: Output<LoopSnapshot>,
    reports: Output<LoopReport>,
    events: Receiver<LoopEvent>,
    records: Receiver<TickRecord>,
}

/// What the loop publishes at every tick.
#[derive(Clone, Debug)]
pub(crate) struct LoopSnapshot {
    pub(crate) history: SampleHistory,
    pub(crate) displayed: DisplayedForces,
    pub(crate) black_box: BlackBox,
    pub(crate) latest: Option<TickRecord>,
}

/// The loop's ends of everything that crosses.
#[derive(Debug)]
pub(crate) struct LoopChannels {
    pub(crate) settings: Output<(u64, LoopSettings)>,
    pub(crate) models: Output<LocalModel>,
    pub(crate) samples: Input<LoopSnapshot>,
    pub(crate) reports: Input<LoopReport>,
    pub(crate) events: Sender<LoopEvent>,
    pub(crate) records: Sender<TickRecord>,
}

/// Makes the two halves of a loop: the handle stays with the app, the loop goes to a thread
/// ([`HapticLoop::spawn`]) or into lock step ([`crate::Lockstep`]).
///
/// # Errors
/// [`HapticsError`] when `config` or `settings` makes no sense.
pub fn haptic_loop(
    config: LoopConfig,
    settings: LoopSettings,
) -> Result<(HapticHandle, HapticLoop), HapticsError> {
    config.validate()?;
    settings.validate()?;
    let first = (0, settings);
    let (settings_in, settings_out) = triple_buffer(&first);
    // The vectors get their length here, before they are cloned into the three slots.
    let (models_in, models_out) = triple_buffer(&LocalModel::empty(config.hand_over.capacity));
    let history = SampleHistory::with_capacity(config.hand_over.history)?;
    let (samples_in, samples_out) = triple_buffer(&LoopSnapshot {
        displayed: DisplayedForces::with_capacity(config.hand_over.history),
        history,
        black_box: BlackBox::new(),
        latest: None,
    });
    let (reports_in, reports_out) = triple_buffer(&LoopReport::new());
    let (events_in, events_out) = bounded(config.event_capacity);
    let (records_in, records_out) = bounded(config.record_capacity);
    let ends = LoopChannels {
        settings: settings_out,
        models: models_out,
        samples: samples_in,
        reports: reports_in,
        events: events_in,
        records: records_in,
    };
    let handle = HapticHandle {
        config,
        settings: settings_in,
        newest_settings: first,
        models: models_in,
        samples: samples_out,
        reports: reports_out,
        events: events_out,
        records: records_out,
    };
    Ok((handle, HapticLoop::new(config, settings, ends)?))
}

impl HapticHandle {
    /// Sizes and rates of the loop.
    #[must_use]
    pub fn config(&self) -> &LoopConfig {
        &self.config
    }

    /// The settings set last.
    #[must_use]
    pub fn settings(&self) -> &LoopSettings {
        &self.newest_settings.1
    }

    /// Sets new settings; returns their number, with which the loop acknowledges them.
    ///
    /// # Errors
    /// [`HapticsError::Setting`] when they make no sense; the old ones stay in force.
    pub fn set_settings(&mut self, settings: LoopSettings) -> Result<u64, HapticsError> {
        settings.validate()?;
        self.newest_settings = (self.newest_settings.0 + 1, settings);
        self.settings.write(self.newest_settings);
        Ok(self.newest_settings.0)
    }

    /// The slot of the next local model, to be filled and then [published](Self::publish_model). It holds an
    /// older model, not the last: every field must be written.
    pub fn model_slot(&mut self) -> &mut LocalModel {
        self.models.input_buffer_mut()
    }

    /// Hands the local model in the slot over to the loop.
    pub fn publish_model(&mut self) {
        self.models.publish();
    }

    /// The newest samples.
    pub fn samples(&mut self) -> &SampleHistory {
        &self.samples.read().history
    }

    /// What was displayed at the newest samples.
    pub fn displayed(&mut self) -> &DisplayedForces {
        &self.samples.read().displayed
    }

    /// What went through the newest ticks, 4,096 at most, also after the loop has ended. Whoever looks twice within a few
    /// hundredths of a second after not having looked for a quarter of one may miss the older ones at the second look,
    /// never the newest 256.
    pub fn black_box(&mut self) -> &BlackBox {
        &self.samples.read().black_box
    }

    /// The newest tick; `None` before the first.
    pub fn latest_tick(&mut self) -> Option<TickRecord> {
        self.samples.read().latest
    }

    /// The loop's newest account of itself.
    pub fn report(&mut self) -> &LoopReport {
        self.reports.read()
    }

    /// The next event that has not been read.
    pub fn next_event(&mut self) -> Option<LoopEvent> {
        self.events.try_recv().ok()
    }

    /// The next tick record that has not been read; there are some while [`LoopSettings::record`] is set.
    pub fn next_record(&mut self) -> Option<TickRecord> {
        self.records.try_recv().ok()
    }
}

#[cfg(test)]
mod tests;
