//! What a tool shows of itself.

use bevy::prelude::*;
use glam::DVec3;
use palpate_haptics::TickRecord;
use palpate_local::Sample;
use palpate_reduce::BuildReport;

/// The force on the hand, and the tool's contact, at the newest tick that the app has read. It is changed only when a value differs.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct ToolForce {
    /// Force written to the device, N, world frame: the force of the body on the hand.
    pub force_n: DVec3,
    /// Force of the local model before the safety chain, N, world frame.
    pub model_force_n: DVec3,
    /// Sequence number of the sample at which these forces were rendered.
    pub sample: u64,
    /// Position of the device at that sample, m, world frame. The tool's [`Transform`] has that of the proxy.
    pub device_position_m: DVec3,
    /// Contact with a body after the last model step; `None` without contact.
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
    /// Unit normal of the surface there, out of the body.
    pub normal: DVec3,
    /// Displacement of that point against the normal from its place on the undeformed body, m: the depth of the dent.
    pub depth_m: f64,
}

/// The loop's account of itself since its start, renewed every 64 ticks.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct LoopTiming {
    /// Ticks done.
    pub ticks: u64,
    /// Deadlines that passed without a tick.
    pub missed_deadlines: u64,
    /// Median of the time from deadline to tick, µs.
    pub lateness_p50_us: f64,
    /// Its 99th percentile, µs.
    pub lateness_p99_us: f64,
    /// Its 99.9th percentile, µs.
    pub lateness_p999_us: f64,
    /// Its maximum, µs.
    pub lateness_max_us: f64,
    /// Of the last 100 periods, the share that had a tick, 0 to 1.
    pub on_time_ratio_100: f64,
    /// Of the last 1000.
    pub on_time_ratio_1000: f64,
    /// Ticks that took longer than a period.
    pub overruns: u64,
    /// Median of the time that a tick takes, device included, µs.
    pub cost_p50_us: f64,
    /// Its 99th percentile, µs.
    pub cost_p99_us: f64,
    /// 99th percentile of the time that the device takes to be read, µs.
    pub read_p99_us: f64,
    /// 99th percentile of the time that it takes to be written, µs.
    pub write_p99_us: f64,
    /// Ticks at which the impulses of the tool's contacts were not found as well as they should be.
    pub unconverged_ticks: u64,
    /// Readings that could not be used.
    pub rejected_readings: u64,
    /// Device errors, on reading and on writing.
    pub device_errors: u64,
    /// Local models that were refused or given up.
    pub models_rejected: u64,
    /// Events that were lost because the app did not listen.
    pub dropped_events: u64,
}

/// The newest local model that was built for the tool, and what that took. See [`palpate_reduce::BuildReport`].
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct LocalModelStats {
    /// Degrees of freedom that the loop steps at a tick.
    pub states: usize,
    /// Nodes of the support set.
    pub support_nodes: usize,
    /// Whether the body buckled and its clamped tangent had to do: the far field is stiffer than the body.
    pub tangent_clamped: bool,
    /// Whether nodes that the tool may reach before the next local model did not find room in the support set.
    pub support_truncated: bool,
    /// A bound of the relative error of the reduced stiffness at 80 Hz; `None` for schemes that have none.
    pub error_bound: Option<f64>,
    /// How long it took, s.
    pub time_s: f64,
}

impl From<BuildReport> for LocalModelStats {
    fn from(report: BuildReport) -> Self {
        let BuildReport {
            states,
            support_nodes,
            tangent_clamped: is_clamped,
            support_truncated: is_cut,
            error_bound,
            time_s,
            ..
        } = report;
        Self {
            states,
            support_nodes,
            tangent_clamped: is_clamped,
            support_truncated: is_cut,
            error_bound,
            time_s,
        }
    }
}

/// How far the force on the hand was from that of the full body over the last model step, at the same samples and before
/// the safety chain. Ticks at which no local model spoke do not count.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct ForceError {
    /// RMS of the difference, N.
    pub rms_n: f64,
    /// Largest difference, N.
    pub peak_n: f64,
    /// RMS of the difference over that of the full body's force; `None` where that is zero.
    pub relative: Option<f64>,
    /// That as a share of 7 %, the difference that a person just notices.
    pub jnd_ratio: Option<f64>,
    /// Ticks that were compared.
    pub ticks: usize,
}

impl ForceError {
    /// The just noticeable difference of a force: a person notices about 7 to 10 %; the stricter end.
    pub const FORCE_JND: f64 = 0.07;

    /// Of pairs of what was displayed and what the full body says, N.
    pub(crate) fn of(pairs: impl Iterator<Item = (DVec3, DVec3)>) -> Self {
        let (mut error, mut reference, mut peak_n, mut ticks) = (0.0, 0.0, 0.0_f64, 0);
        for (displayed, full) in pairs {
            error += (displayed - full).length_squared();
            reference += full.length_squared();
            peak_n = peak_n.max((displayed - full).length());
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

/// What a tool touches now.
///
/// One rule holds whenever a tool and a body come together otherwise than by the tool's motion: the body is spawned, replaced by one
/// with other nodes, moved by its transform or chosen by [`HapticTool::body`](crate::HapticTool::body); or the tool is started, changed
/// in shape, released from a grasp, or moved in a pause or while samples were lost. The tool's centre decides. Outside of the body, the tool touches at
/// once, however far its radius overlaps. Inside, it touches nothing until all of it has left the body:
/// [`ContactState::Inside`], which is reported after half a second
/// ([`NoForceCause::Inside`](crate::NoForceCause::Inside)).
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Debug, Default, PartialEq, Clone)]
pub struct TouchedBody {
    /// The touched or held body; `None` while the tool is free.
    pub body: Option<Entity>,
    /// State of the contact after the last model step.
    pub state: ContactState,
}

/// State of a tool's contact with the body that it can touch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
#[reflect(Debug, Default, PartialEq, Hash, Clone)]
pub enum ContactState {
    /// There is no body to touch, or the loop does not run.
    #[default]
    NoBody,
    /// The tool is outside of the body and touches nothing.
    Clear,
    /// The tool pushes the body's surface.
    Touching,
    /// The tool holds a point of the body ([`ToolGrasp`](crate::ToolGrasp)).
    Holding,
    /// The tool is inside the body without having pushed its way there: it renders no force until all of it has left. See
    /// [`TouchedBody`].
    Inside,
}

/// Put it on a tool to record every tick. A tick takes 736 bytes, so an hour 2.6 GB; see `keep`.
#[derive(Component, Clone, Debug, Reflect)]
#[reflect(Component, Debug, Default, Clone)]
pub struct TickRecording {
    /// The ticks since it was put there, as far as they have been fetched.
    #[reflect(ignore)]
    pub records: Vec<TickRecord>,
    /// The samples that were felt: one for each period, those of missed deadlines included.
    #[reflect(ignore)]
    pub samples: Vec<Sample>,
    /// Ticks that are missing because the app fetched them too late.
    pub dropped: u64,
    /// How many ticks and samples are kept at least; when there are twice as many the older half is forgotten.
    pub keep: usize,
}

impl Default for TickRecording {
    /// Keeps everything.
    fn default() -> Self {
        Self { records: Vec::new(), samples: Vec::new(), dropped: 0, keep: usize::MAX }
    }
}

impl TickRecording {
    pub(super) fn forget(&mut self) {
        if self.records.len() / 2 >= self.keep {
            self.records.drain(..self.records.len() - self.keep);
        }
        if self.samples.len() / 2 >= self.keep {
            self.samples.drain(..self.samples.len() - self.keep);
        }
    }
}
