//! Results of a tool.

use bevy::prelude::*;
use glam::DVec3;
use palpate_haptics::TickRecord;
use palpate_local::Sample;
use palpate_reduce::BuildReport;

/// The force on the hand, and the tool's contact, at the newest tick that the app has read. Changes only when a value differs.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct ToolForce {
    /// Force written to the device, N, world frame: the force of the body on the hand.
    pub force_n: DVec3,
    /// Force of the local model before the safety chain, N, world frame.
    pub model_force_n: DVec3,
    /// Sequence number of the sample at which these forces were rendered.
    pub sample: u64,
    /// Position of the device at that sample, m, world frame. The tool's [`Transform`] has the position of the proxy.
    pub device_position_m: DVec3,
    /// Contact with [`TouchedBody::body`] after the last model step; `None` without contact.
    pub contact: Option<ToolContactPoint>,
    /// Whether the safety chain changed the force.
    pub safety_limited: bool,
    /// Age of the local model at that tick, s.
    pub model_age_s: f64,
    /// Jump of the force at the last change of the local model, N: the new model's force minus the old one's.
    pub swap_force_jump_n: DVec3,
    /// Energy that this change added to the body, J, negative if it removed energy; `None` for a scheme without an energy.
    pub swap_energy_jump_j: Option<f64>,
}

/// Contact of a tool with the full body.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Debug, PartialEq, Clone)]
pub struct ToolContactPoint {
    /// Point of the body's surface, m, world frame.
    pub point_m: DVec3,
    /// Unit normal of the surface there, out of the body, world frame.
    pub normal: DVec3,
    /// Displacement of that point from its position on the undeformed body, against the normal, m: the dent that the cells resolve. The tool is
    /// deeper by what the added compliance ([`ContactCompliance`](crate::ContactCompliance)) gives way below the size of a cell.
    pub depth_m: f64,
}

/// Timing and counters of the loop since its start, updated every 64 ticks.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct LoopTiming {
    /// Number of ticks.
    pub ticks: u64,
    /// Number of deadlines that passed without a tick.
    pub missed_deadlines: u64,
    /// Lateness, the time from a deadline to its tick: median, µs.
    pub lateness_p50_us: f64,
    /// Lateness: 99th percentile, µs.
    pub lateness_p99_us: f64,
    /// Lateness: 99.9th percentile, µs.
    pub lateness_p999_us: f64,
    /// Lateness: maximum, µs.
    pub lateness_max_us: f64,
    /// Share of the last 100 periods that had a tick, 0 to 1.
    pub on_time_ratio_100: f64,
    /// Share of the last 1000 periods that had a tick, 0 to 1.
    pub on_time_ratio_1000: f64,
    /// Number of ticks that took longer than a period.
    pub overruns: u64,
    /// Duration of a tick, device included: median, µs.
    pub cost_p50_us: f64,
    /// Duration of a tick, device included: 99th percentile, µs.
    pub cost_p99_us: f64,
    /// Duration of reading the device: 99th percentile, µs.
    pub read_p99_us: f64,
    /// Duration of writing to the device: 99th percentile, µs.
    pub write_p99_us: f64,
    /// Number of ticks at which the contact solver did not converge.
    pub unconverged_ticks: u64,
    /// Number of rejected readings.
    pub rejected_readings: u64,
    /// Number of device errors, on reading and on writing.
    pub device_errors: u64,
    /// Number of local models that were rejected or abandoned.
    pub models_rejected: u64,
    /// Number of events that were dropped because their queue was full.
    pub dropped_events: u64,
}

/// Report about the newest local model of the tool, of both bodies if it contains two, updated at every model step that builds one ([`palpate_reduce::BuildReport`]).
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct LocalModelStats {
    /// Number of degrees of freedom that the loop steps at a tick.
    pub states: usize,
    /// Number of nodes in the support set.
    pub support_nodes: usize,
    /// Whether the body buckled and its tangent was clamped: the far field is stiffer than the body.
    pub tangent_clamped: bool,
    /// Whether the support set is too small: its capacity left out nodes that the tool touches now, or touches before the next local model
    /// if it keeps its velocity. False in ordinary contact; true for a tool that is wide or fast compared with the nodes' spacing.
    pub support_truncated: bool,
    /// Bound of the relative error of the reduced stiffness at 80 Hz; `None` for schemes without one.
    pub error_bound: Option<f64>,
    /// Duration of the build, s.
    pub time_s: f64,
}

impl From<BuildReport> for LocalModelStats {
    fn from(report: BuildReport) -> Self {
        let BuildReport {
            states,
            support_nodes,
            tangent_clamped,
            support_truncated,
            error_bound,
            time_s,
            ..
        } = report;
        Self { states, support_nodes, tangent_clamped, support_truncated, error_bound, time_s }
    }
}

impl LocalModelStats {
    /// The statistics of a local model of two bodies, these and those of a `second` one.
    pub(super) fn with_second(self, second: Self) -> Self {
        Self {
            states: self.states + second.states,
            support_nodes: self.support_nodes + second.support_nodes,
            tangent_clamped: self.tangent_clamped || second.tangent_clamped,
            support_truncated: self.support_truncated || second.support_truncated,
            error_bound: self.error_bound.into_iter().chain(second.error_bound).reduce(f64::max),
            time_s: self.time_s + second.time_s,
        }
    }
}

/// Difference between the force of the local model and that of the full body over the last model step, at the same samples and before
/// the safety chain. Ticks without an active local model do not count.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct ForceError {
    /// RMS of the difference, N.
    pub rms_n: f64,
    /// Maximum of the difference, N.
    pub peak_n: f64,
    /// RMS of the difference divided by the RMS of the full body's force; `None` if the latter is zero.
    pub relative: Option<f64>,
    /// [`Self::relative`] divided by [`Self::FORCE_JND`].
    pub jnd_ratio: Option<f64>,
    /// Number of compared ticks.
    pub ticks: usize,
}

impl ForceError {
    /// Just noticeable difference of a force, relative: the lower end of 7 to 10 %.
    pub const FORCE_JND: f64 = 0.07;

    /// The error of pairs of a rendered force and the full body's force, N.
    pub(crate) fn of(pairs: impl Iterator<Item = (DVec3, DVec3)>) -> Self {
        let (mut error, mut reference, mut peak_n, mut ticks) = (0.0, 0.0, 0.0_f64, 0);
        for (rendered, full) in pairs {
            error += (rendered - full).length_squared();
            reference += full.length_squared();
            peak_n = peak_n.max((rendered - full).length());
            ticks += 1;
        }
        let relative = (reference > 0.0).then(|| f64::sqrt(error / reference));
        Self {
            rms_n: if ticks > 0 { (error / ticks as f64).sqrt() } else { 0.0 },
            peak_n,
            relative,
            jnd_ratio: relative.map(|relative| relative / Self::FORCE_JND),
            ticks,
        }
    }
}

/// The body or the two bodies that a tool touches or holds, and the state of the contact. Updated at every model step, and changed only when a value differs.
///
/// A tool and a body can meet other than by the tool's motion: the body is spawned, replaced by one with other nodes, moved by its
/// transform or selected by [`HapticTool::body`](crate::HapticTool::body); or the tool is started, changes its shape, is released from a
/// grasp, or moves during a pause or while samples are lost. The position of the tool's centre then decides. Outside the body, the contact
/// starts at once, however far the tool's radius overlaps. Inside, it starts only after the whole tool has left the body
/// ([`ContactState::Inside`]), which is reported after half a second ([`NoForceCause::Inside`](crate::NoForceCause::Inside)).
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct TouchedBody {
    /// The touched or held body, of two that which the tool has touched longer; `None` without contact.
    pub body: Option<Entity>,
    /// The second touched body, if the tool touches two at once: an instrument between two organs.
    pub second: Option<Entity>,
    /// State of the contact after the last model step.
    pub state: ContactState,
}

/// State of a tool's contact with the body that it can touch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
#[reflect(Debug, Default, PartialEq, Hash, Clone)]
pub enum ContactState {
    /// No body can be touched, or the loop does not run.
    #[default]
    NoBody,
    /// The tool is outside the body, without contact.
    Clear,
    /// The tool pushes against the surface of a body, or of two.
    Touching,
    /// The tool holds a point of the body ([`ToolGrasp`](crate::ToolGrasp)).
    Holding,
    /// The tool's centre is inside the body without having been pushed in. It renders no force until the whole tool has left the body
    /// ([`TouchedBody`]).
    Inside,
}

/// Recording of every tick and sample of a tool. A tick takes 736 bytes, an hour 2.6 GB; [`Self::keep`] limits the size.
#[derive(Component, Clone, Debug, Reflect)]
#[reflect(Component, Debug, Default, Clone)]
pub struct TickRecording {
    /// Ticks since the component was inserted, added in every frame.
    #[reflect(ignore)]
    pub records: Vec<TickRecord>,
    /// Samples of the loop: one for each period, including interpolated ones for missed deadlines.
    #[reflect(ignore)]
    pub samples: Vec<Sample>,
    /// Number of ticks that are missing because the app read them too late.
    pub dropped: u64,
    /// Minimum number of ticks and of samples that are kept; at twice as many the older half is discarded.
    pub keep: usize,
}

impl Default for TickRecording {
    /// Keeps all ticks.
    fn default() -> Self {
        Self { records: Vec::new(), samples: Vec::new(), dropped: 0, keep: usize::MAX }
    }
}

impl TickRecording {
    /// Discards the older half of what exceeds twice [`Self::keep`].
    pub(super) fn discard_old(&mut self) {
        if self.records.len() / 2 >= self.keep {
            self.records.drain(..self.records.len() - self.keep);
        }
        if self.samples.len() / 2 >= self.keep {
            self.samples.drain(..self.samples.len() - self.keep);
        }
    }
}
