//! Time for which a tool has lacked force.

use crate::fault::NoForceCause;
use bevy::prelude::*;
use glam::DVec3;

/// Ticks without force after which the cause is reported.
const REPORTED_AFTER_TICKS: u64 = 500;

/// The same while the body is being built.
const BUILT_WITHIN_TICKS: u64 = 5000;

/// Time for which a tool has lacked force, and the reported cause.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct ForceWatch {
    /// The present cause and its ticks.
    present: Option<(NoForceCause, u64)>,
    reported: Option<NoForceCause>,
    /// The body, with its contact key, that the tool was outside of at the last model step.
    pub(super) clear_of: Option<(Entity, (u64, u64))>,
    /// The body, with its contact key, that the tool entered through a fixed surface, and the point of entry, m.
    pub(super) entered: Option<(Entity, (u64, u64), DVec3)>,
    /// Whether the device has been outside the workspace of its description.
    pub(super) left_workspace: bool,
}

/// Classification of a model step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ForceStep {
    /// A force is missing.
    Missing(NoForceCause),
    /// A force reaches the device.
    Rendered,
    /// No force is expected.
    Quiet,
    /// Undetermined: another fault reports the cause.
    Unknown,
}

impl ForceWatch {
    /// Adds a step of `ticks` ticks; returns a cause to be reported.
    pub(super) fn record(&mut self, step: ForceStep, ticks: u64) -> Option<NoForceCause> {
        let ForceStep::Missing(cause) = step else {
            self.present = None;
            let is_over = |reported: &NoForceCause| reported.is_about_reach() || step == ForceStep::Rendered;
            self.reported = self.reported.filter(|reported| step == ForceStep::Unknown || !is_over(reported));
            return None;
        };
        let before = self.present.filter(|(before, _)| before.is_same(&cause)).map_or(0, |(_, ticks)| ticks);
        let lasted = before + ticks;
        self.present = Some((cause, lasted));
        let (cause, limit) = match cause {
            NoForceCause::BodyNotReady { body, .. } => {
                (NoForceCause::BodyNotReady { body, waited_s: 1e-3 * lasted as f64 }, BUILT_WITHIN_TICKS)
            }
            cause => (cause, REPORTED_AFTER_TICKS),
        };
        let is_new = !self.reported.is_some_and(|reported| reported.is_same(&cause));
        (lasted >= limit && is_new).then(|| *self.reported.insert(cause))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMIT: ForceStep = ForceStep::Missing(NoForceCause::ForceLimit { max_force_n: 0.0 });
    const RAMP: ForceStep = ForceStep::Missing(NoForceCause::StartRamp { ramp_s: 1e9 });
    const NO_BODY: ForceStep = ForceStep::Missing(NoForceCause::NoBody);

    /// Numbers of the steps, of 50 ticks each, after which a cause is reported.
    fn reported(steps: &[(ForceStep, usize)]) -> Vec<usize> {
        let mut watch = ForceWatch::default();
        let all = steps.iter().flat_map(|(step, times)| std::iter::repeat_n(*step, *times));
        all.enumerate().filter_map(|(i, step)| watch.record(step, 50).map(|_| i + 1)).collect()
    }

    #[test]
    fn reports_a_cause_once_after_half_a_second_without_a_break() {
        assert_eq!(reported(&[(LIMIT, 40)]), [10]);
        assert_eq!(reported(&[(LIMIT, 9), (ForceStep::Quiet, 1), (LIMIT, 9)]), [0; 0]);
        assert_eq!(reported(&[(LIMIT, 9), (RAMP, 9)]), [0; 0]);
    }

    #[test]
    fn reports_another_cause_too() {
        assert_eq!(reported(&[(LIMIT, 20), (RAMP, 20)]), [10, 30]);
    }

    #[test]
    fn reports_a_missing_force_again_after_a_rendered_force() {
        assert_eq!(reported(&[(LIMIT, 20), (ForceStep::Quiet, 20), (LIMIT, 20)]), [10]);
        assert_eq!(reported(&[(LIMIT, 20), (ForceStep::Rendered, 1), (LIMIT, 20)]), [10, 31]);
        assert_eq!(reported(&[(LIMIT, 20), (ForceStep::Unknown, 20), (LIMIT, 20)]), [10]);
    }

    #[test]
    fn reports_a_missing_body_again_after_a_body_in_reach() {
        assert_eq!(reported(&[(NO_BODY, 20), (ForceStep::Quiet, 1), (NO_BODY, 20)]), [10, 31]);
        assert_eq!(reported(&[(NO_BODY, 20), (ForceStep::Unknown, 1), (NO_BODY, 20)]), [10]);
    }

    #[test]
    fn reports_a_running_build_after_five_seconds() {
        let body = Entity::PLACEHOLDER;
        let building = ForceStep::Missing(NoForceCause::BodyNotReady { body, waited_s: 0.0 });
        assert_eq!(reported(&[(building, 99)]), [0; 0]);
        assert_eq!(reported(&[(building, 200)]), [100]);
    }
}
