//! Configuration of a loop: fixed at construction, and settable while it runs.

use crate::error::{check, check_positive};
use crate::force_board::FollowedTool;
use crate::{DeviceFrame, DeviceLimits, HapticsError, RealTimeRequest, SafetySettings, VelocityEstimator};
use glam::DVec3;
use palpate_local::HandOverSettings;

/// Sizes, rates and limits of a loop, fixed at construction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopConfig {
    /// Tick, capacity of local models, numbers of samples kept and replayed.
    pub hand_over: HandOverSettings,
    /// Limits of the device.
    pub device: DeviceLimits,
    /// Requests of the loop's thread to the operating system; unused in lock step.
    pub real_time: RealTimeRequest,
    /// Capacity of the queue of events.
    pub event_capacity: usize,
    /// Capacity of the queue of tick records.
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

/// Settings of a running loop. The loop adopts the newest as a whole, and acknowledges their number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopSettings {
    /// Pose and scale of the device in the scene.
    pub frame: DeviceFrame,
    /// Limits and times of the safety chain.
    pub safety: SafetySettings,
    /// Estimator of the samples' velocity.
    pub velocity: VelocityEstimator,
    /// Maximum plausible speed of a hand, m/s. A reading farther away is rejected until it has persisted for 5 ticks.
    pub jump_m_per_s: f64,
    /// Time between two model steps, s: the unit of a local model's age.
    pub model_period_s: f64,
    /// Body whose local models are accepted; the loop drops the models of other bodies at once. `None` accepts all bodies.
    /// A model of [`palpate_local::ModelId::NO_BODY`] is always accepted.
    pub body: Option<u64>,
    /// A second body whose local models are accepted, alone or with the first. Of a model of two bodies the loop drops the part of a body
    /// that is not accepted. No effect without [`Self::body`].
    pub second_body: Option<u64>,
    /// Another tool on a body of this one. The loop reads its force at every tick, and the local model follows it.
    pub other: Option<FollowedTool>,
    /// Force that is added to that of the local model, N, scene frame, for example the weight of an instrument.
    pub external_force_n: DVec3,
    /// Whether the app is paused; the force then fades to zero.
    pub paused: bool,
    /// Whether the loop sends a record of every tick.
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
            second_body: None,
            other: None,
            external_force_n: DVec3::ZERO,
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
        for (what, capacity) in [
            ("capacity of the queue of events", self.event_capacity),
            ("capacity of the queue of tick records", self.record_capacity),
        ] {
            check(what, capacity as f64, (1..=1_000_000).contains(&capacity), "1 to 1000000")?;
        }
        Ok(())
    }
}

impl LoopSettings {
    /// The bodies whose local models are accepted; `None` for all.
    pub(crate) fn bodies(&self) -> Option<[u64; 2]> {
        let body = self.body?;
        Some([body, self.second_body.unwrap_or(body)])
    }

    /// Checks all ranges.
    ///
    /// # Errors
    /// [`HapticsError::Setting`] for the first value out of range.
    pub fn validate(&self) -> Result<(), HapticsError> {
        self.frame.validate()?;
        self.safety.validate()?;
        self.velocity.validate()?;
        check_positive("maximum plausible speed of a hand (jump_m_per_s), m/s", self.jump_m_per_s)?;
        let external_n = self.external_force_n.abs().max_element();
        check(
            "external force (external_force_n), N",
            external_n,
            self.external_force_n.is_finite(),
            "finite",
        )?;
        check_positive("time between two model steps (model_period_s), s", self.model_period_s)
    }
}
