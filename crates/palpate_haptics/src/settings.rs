//! What is fixed when a loop is made, and what can be set while it runs.

use crate::error::{check, check_positive};
use crate::{DeviceFrame, DeviceLimits, HapticsError, RealTimeRequest, SafetySettings, VelocityEstimator};
use palpate_local::HandOverSettings;

/// Sizes and rates of a loop, fixed at construction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopConfig {
    /// Tick, room for local models, samples kept and replayed.
    pub hand_over: HandOverSettings,
    /// What the device can bear.
    pub device: DeviceLimits,
    /// What the loop's thread asks of the operating system. Nothing is asked for in lock step.
    pub real_time: RealTimeRequest,
    /// Room for events that the app has not read yet.
    pub event_capacity: usize,
    /// Room for tick records that the app has not read yet.
    pub record_capacity: usize,
}

impl Default for LoopConfig {
    /// 1 kHz, a device of 20 N, priority and locked memory, 1024 events, 8192 records.
    fn default() -> Self {
        Self {
            hand_over: HandOverSettings::default(),
            device: DeviceLimits::of_force(20.0),
            real_time: RealTimeRequest::default(),
            event_capacity: 1024,
            record_capacity: 8192,
        }
    }
}

/// What an app can set while the loop runs. It crosses whole: the newest counts, and the loop acknowledges it
/// by its number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopSettings {
    /// How the device lies in the scene.
    pub frame: DeviceFrame,
    /// Limits of the safety chain.
    pub safety: SafetySettings,
    /// Where a sample's velocity comes from.
    pub velocity: VelocityEstimator,
    /// Speed that no hand has, m/s: a reading farther away than that is not believed until it has stayed there for 5 ticks.
    pub jump_m_per_s: f64,
    /// Time between two model steps, s; the age of a local model is counted in it.
    pub model_period_s: f64,
    /// The body whose models are taken, those of others falling silent at once; `None` takes any.
    /// A model of no body is always taken.
    pub body: Option<u64>,
    /// Whether the app is paused: the force fades to zero.
    pub paused: bool,
    /// Whether a record of every tick is sent.
    pub record: bool,
}

impl Default for LoopSettings {
    /// Jumps from 20 m/s on, 20 Hz, any body, not paused, no records.
    fn default() -> Self {
        Self {
            frame: DeviceFrame::default(),
            safety: SafetySettings::default(),
            velocity: VelocityEstimator::default(),
            jump_m_per_s: 20.0,
            model_period_s: 0.05,
            body: None,
            paused: false,
            record: false,
        }
    }
}

impl LoopConfig {
    pub(crate) fn validate(&self) -> Result<(), HapticsError> {
        self.hand_over.validate()?;
        let history = self.hand_over.history;
        check("samples kept", history as f64, history >= 512, "at least 512")?;
        for (what, room) in
            [("room for events", self.event_capacity), ("room for tick records", self.record_capacity)]
        {
            check(what, room as f64, (1..=1_000_000).contains(&room), "1 to 1000000")?;
        }
        Ok(())
    }
}

impl LoopSettings {
    /// Refuses settings that make no sense.
    ///
    /// # Errors
    /// [`HapticsError::Setting`] with the first of them.
    pub fn validate(&self) -> Result<(), HapticsError> {
        self.frame.validate()?;
        self.safety.validate()?;
        self.velocity.validate()?;
        check_positive("speed that no hand has, m/s", self.jump_m_per_s)?;
        check_positive("time between two model steps, s", self.model_period_s)
    }
}
