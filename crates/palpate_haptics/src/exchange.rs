//! The data exchanged between the app and the loop.
//!
//! | data | direction | structure | if the reader is late |
//! | --- | --- | --- | --- |
//! | samples, and the force displayed at each | loop → app | triple buffer of at least 512 | older ones are lost; numbers show the gap |
//! | black box | loop → app | the same triple buffer, a ring buffer of 4096 ticks | older ticks are lost |
//! | local model | app → loop | triple buffer | the loop keeps the previous model, and its age fades the force |
//! | settings | app → loop | triple buffer of one struct with a number | the newest apply; the loop acknowledges their number |
//! | report | loop → app | triple buffer | the newest is read |
//! | events, tick records | loop → app | bounded queues, `try_send` only | dropped and counted |
//!
//! Loops of several tools also exchange their forces with each other: [`crate::ForceBoard`].

use crate::black_box::BlackBox;
use crate::displayed_forces::DisplayedForces;
use crate::{HapticsError, LoopConfig, LoopEvent, LoopReport, LoopSettings, TickRecord};
use crossbeam_channel::{Receiver, Sender, bounded};
use palpate_local::{LocalModel, SampleHistory};
use triple_buffer::{Input, Output, triple_buffer};

/// The app's half of a loop: publishes local models and settings, reads samples, events and reports.
///
/// It cannot be cloned, and none of its methods blocks the loop.
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

/// State that the loop publishes at every tick.
#[derive(Clone, Debug)]
pub(crate) struct LoopSnapshot {
    pub(crate) history: SampleHistory,
    pub(crate) displayed: DisplayedForces,
    pub(crate) black_box: BlackBox,
    pub(crate) latest: Option<TickRecord>,
}

/// The loop's ends of the exchange.
#[derive(Debug)]
pub(crate) struct LoopChannels {
    pub(crate) settings: Output<(u64, LoopSettings)>,
    pub(crate) models: Output<LocalModel>,
    pub(crate) samples: Input<LoopSnapshot>,
    pub(crate) reports: Input<LoopReport>,
    pub(crate) events: Sender<LoopEvent>,
    pub(crate) records: Sender<TickRecord>,
}

/// Creates the app's handle and the loop's channels.
pub(crate) fn exchange(
    config: LoopConfig,
    settings: LoopSettings,
) -> Result<(HapticHandle, LoopChannels), HapticsError> {
    config.validate()?;
    settings.validate()?;
    let first = (0, settings);
    let (settings_in, settings_out) = triple_buffer(&first);
    // The vectors get their full length before they are cloned into the three slots.
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
    let channels = LoopChannels {
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
    Ok((handle, channels))
}

impl HapticHandle {
    /// Sizes and rates of the loop.
    #[must_use]
    pub fn config(&self) -> &LoopConfig {
        &self.config
    }

    /// The settings published last.
    #[must_use]
    pub fn settings(&self) -> &LoopSettings {
        &self.newest_settings.1
    }

    /// Publishes new settings and returns their number, which the loop acknowledges
    /// ([`crate::LoopEventKind::SettingsAdopted`]).
    ///
    /// # Errors
    /// [`HapticsError::Setting`] for a value out of range; the previous settings stay in force.
    pub fn set_settings(&mut self, settings: LoopSettings) -> Result<u64, HapticsError> {
        settings.validate()?;
        self.newest_settings = (self.newest_settings.0 + 1, settings);
        self.settings.write(self.newest_settings);
        Ok(self.newest_settings.0)
    }

    /// The slot of the next local model; fill it, then call [`publish_model`](Self::publish_model). The slot contains an older model
    /// than the last one: write every field.
    pub fn model_slot(&mut self) -> &mut LocalModel {
        self.models.input_buffer_mut()
    }

    /// Publishes the local model in the slot.
    pub fn publish_model(&mut self) {
        self.models.publish();
    }

    /// The newest samples.
    pub fn samples(&mut self) -> &SampleHistory {
        &self.samples.read().history
    }

    /// The forces displayed at the newest samples.
    pub fn displayed(&mut self) -> &DisplayedForces {
        &self.samples.read().displayed
    }

    /// The newest ticks, at most 4,096; also after the loop has ended.
    ///
    /// The newest 256 ticks are always complete. Older ones may be missing for some hundredths of a second after a pause of more
    /// than a quarter of a second between two reads.
    pub fn black_box(&mut self) -> &BlackBox {
        &self.samples.read().black_box
    }

    /// The newest tick; `None` before the first.
    pub fn latest_tick(&mut self) -> Option<TickRecord> {
        self.samples.read().latest
    }

    /// The newest report of the loop.
    pub fn report(&mut self) -> &LoopReport {
        self.reports.read()
    }

    /// Removes the oldest event from the queue.
    pub fn next_event(&mut self) -> Option<LoopEvent> {
        self.events.try_recv().ok()
    }

    /// Removes the oldest tick record from the queue; the loop sends records while [`LoopSettings::record`] is set.
    pub fn next_record(&mut self) -> Option<TickRecord> {
        self.records.try_recv().ok()
    }
}

#[cfg(test)]
mod tests;
