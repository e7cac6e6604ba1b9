//! Writes faults, and limits the rate of those that recur.

use super::{HapticFault, HapticFaultKind};
use bevy::ecs::system::SystemParam;
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use palpate_haptics::LoopEventKind;
use std::mem::{Discriminant, discriminant};

/// Time within which a kind of fault that recurs is reported once for an entity, s of real time.
const MIN_INTERVAL_S: f64 = 5.0;

/// The last report of each kind that recurs, for each entity.
#[derive(Resource, Default)]
pub(crate) struct FaultLimits(HashMap<(Option<Entity>, Recurring), LastReport>);

/// A kind that recurs, and the kind of its loop event.
type Recurring = (Discriminant<HapticFaultKind>, Option<Discriminant<LoopEventKind>>);

struct LastReport {
    at_s: f64,
    suppressed_count: u32,
}

impl FaultLimits {
    /// The fault of `entity` at the time `now_s`; `None` if it is suppressed.
    pub(crate) fn limit(
        &mut self,
        entity: Option<Entity>,
        kind: HapticFaultKind,
        now_s: f64,
    ) -> Option<HapticFault> {
        let Some(recurring) = recurring(&kind) else { return Some(HapticFault::new(entity, kind)) };
        let mut suppressed_count = 0;
        if let Some(last) = self.0.get_mut(&(entity, recurring)) {
            if now_s - last.at_s < MIN_INTERVAL_S {
                last.suppressed_count = last.suppressed_count.saturating_add(1);
                return None;
            }
            suppressed_count = last.suppressed_count;
        }
        // Entries of the past that hold no count are not needed.
        self.0.retain(|_, last| last.suppressed_count > 0 || now_s - last.at_s < MIN_INTERVAL_S);
        self.0.insert((entity, recurring), LastReport { at_s: now_s, suppressed_count: 0 });
        Some(HapticFault { suppressed_count, ..HapticFault::new(entity, kind) })
    }
}

/// The key of a kind that may recur without a change by the app or the user.
fn recurring(kind: &HapticFaultKind) -> Option<Recurring> {
    let event = match kind {
        HapticFaultKind::Loop(LoopEventKind::Panicked | LoopEventKind::EmergencyStopped) => return None,
        HapticFaultKind::Loop(event) => Some(discriminant(event)),
        HapticFaultKind::SamplesLost { .. }
        | HapticFaultKind::EventsDropped { .. }
        | HapticFaultKind::BeyondSupport { .. }
        | HapticFaultKind::BodiesLeftOut { .. }
        | HapticFaultKind::LocalModel(_)
        | HapticFaultKind::SlowStep(_)
        | HapticFaultKind::Unconverged { .. }
        | HapticFaultKind::UnconvergedSteps { .. }
        | HapticFaultKind::InvertedCells { .. } => None,
        _ => return None,
    };
    Some((discriminant(kind), event))
}

/// Adds the message of faults and the limits of their rate.
pub(crate) fn add_faults(app: &mut App) {
    app.add_message::<HapticFault>().init_resource::<FaultLimits>().allow_ambiguous_resource::<FaultLimits>();
}

/// Writes faults as messages.
#[derive(SystemParam)]
pub(crate) struct FaultWriter<'w> {
    messages: MessageWriter<'w, HapticFault>,
    limits: ResMut<'w, FaultLimits>,
    time: Option<Res<'w, Time<Real>>>,
}

impl FaultWriter<'_> {
    /// Writes the fault of `entity`, unless it recurs too soon.
    pub(crate) fn write(&mut self, entity: impl Into<Option<Entity>>, kind: HapticFaultKind) {
        let now_s = self.time.as_ref().map_or(0.0, |time| time.elapsed_secs_f64());
        if let Some(fault) = self.limits.limit(entity.into(), kind, now_s) {
            self.messages.write(fault);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ENTITY: Option<Entity> = Some(Entity::PLACEHOLDER);

    fn missed() -> HapticFaultKind {
        HapticFaultKind::Loop(LoopEventKind::DeadlinesMissed(2))
    }

    fn counts(limits: &mut FaultLimits, kind: fn() -> HapticFaultKind, times_s: &[f64]) -> Vec<Option<u32>> {
        let limit = |at_s: &f64| limits.limit(ENTITY, kind(), *at_s).map(|fault| fault.suppressed_count);
        times_s.iter().map(limit).collect()
    }

    #[test]
    fn recurring_fault_is_reported_once_in_5_s_with_the_number_of_suppressed_ones() {
        let mut limits = FaultLimits::default();
        let times_s: Vec<f64> = (0..180).map(|i| 8.0 * f64::from(i) / 180.0).collect();
        let reported = counts(&mut limits, missed, &times_s);
        let reported: Vec<u32> = reported.into_iter().flatten().collect();
        // 0 s and 5.02 s; the 112 others of the first 5 s are counted in the second report.
        assert_eq!(reported, [0, 112]);
        assert_eq!(counts(&mut limits, missed, &[60.0]), [Some(66)]);
        assert_eq!(counts(&mut limits, missed, &[70.0]), [Some(0)]);
    }

    #[test]
    fn kinds_events_and_entities_are_limited_separately() {
        let mut limits = FaultLimits::default();
        let kinds = [
            missed(),
            HapticFaultKind::Loop(LoopEventKind::Gap(30)),
            HapticFaultKind::SamplesLost { lost: 3 },
            HapticFaultKind::BeyondSupport { nodes: 18 },
        ];
        for kind in &kinds {
            assert!(limits.limit(ENTITY, kind.clone(), 1.0).is_some());
            assert!(limits.limit(None, kind.clone(), 1.0).is_some());
        }
        for kind in kinds {
            assert!(limits.limit(ENTITY, kind, 2.0).is_none());
        }
    }

    #[test]
    fn faults_that_follow_a_change_are_not_limited() {
        let mut limits = FaultLimits::default();
        let kinds = [
            || HapticFaultKind::BuildBody(palpate_body::BodyError::NoNodes),
            || HapticFaultKind::Loop(LoopEventKind::EmergencyStopped),
        ];
        for kind in kinds {
            assert_eq!(counts(&mut limits, kind, &[0.0, 0.1, 0.2]), [Some(0); 3]);
        }
        assert!(limits.0.is_empty());
    }
}
