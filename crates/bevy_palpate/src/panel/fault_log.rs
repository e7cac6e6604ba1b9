//! The last faults, and the reversal of a rejected tissue.

use super::state::HapticPanel;
use crate::body::{BodyBuild, SimulatedBody, Tissue};
use crate::fault::{HapticFault, HapticFaultKind};
use crate::tool::HapticTool;
use bevy::ecs::entity::EntityHashMap;
use bevy::prelude::*;
use palpate_haptics::LoopEventKind;
use std::collections::VecDeque;

/// The last faults.
#[derive(Resource, Default)]
pub(crate) struct FaultLog {
    /// Text, number of repetitions, and time of the last one, s.
    pub(super) faults: VecDeque<(String, u32, f64)>,
    /// Time of each tool's last contact beyond its support set, s.
    beyond_support: EntityHashMap<f64>,
}

/// Maximum number of faults in the log.
const MAX_FAULTS: usize = 5;

impl FaultLog {
    /// Time since the last contact of `tool` beyond its support set, s, if there was one.
    pub(super) fn beyond_support_s(&self, tool: Entity, now_s: f64) -> Option<f64> {
        self.beyond_support.get(&tool).map(|at_s| now_s - at_s)
    }

    /// Adds `times` faults with this text.
    fn add(&mut self, text: String, times: u32, now_s: f64) {
        match self.faults.back_mut() {
            Some((last, sum, at)) if *last == text => {
                *sum = sum.saturating_add(times);
                *at = now_s;
            }
            _ => self.faults.push_back((text, times, now_s)),
        }
        if self.faults.len() > MAX_FAULTS {
            self.faults.pop_front();
        }
    }
}

/// Collects faults. Reverts a tissue with which a body cannot be built, if the panel has set it.
pub(super) fn collect_faults(
    mut faults: MessageReader<HapticFault>,
    mut log: ResMut<FaultLog>,
    mut panel: ResMut<HapticPanel>,
    mut bodies: Query<(&mut Tissue, Option<&SimulatedBody>, Has<BodyBuild>)>,
    tools: Query<(), With<HapticTool>>,
    time: Res<Time<Real>>,
) {
    let built_tissue = |body| bodies.get(body).ok()?.1.map(SimulatedBody::tissue);
    panel.bypass_change_detection().view.confirm_tissue(built_tissue);
    log.bypass_change_detection().beyond_support.retain(|tool, _| tools.contains(*tool));
    for fault in faults.read() {
        if matches!(fault.kind, HapticFaultKind::Loop(LoopEventKind::DeadlinesMissed(_))) {
            continue;
        }
        if let (HapticFaultKind::BeyondSupport { .. }, Some(tool)) = (&fault.kind, fault.entity) {
            log.beyond_support.insert(tool, time.elapsed_secs_f64());
        }
        let text = fault.kind.report();
        let view = &mut panel.bypass_change_detection().view;
        if let (HapticFaultKind::BuildBody(_) | HapticFaultKind::LocalModel(_), Some(body)) =
            (&fault.kind, fault.entity)
            // During a build, the rejected tissue is an earlier one than that which is set now.
            && let Ok((mut tissue, _, false)) = bodies.get_mut(body)
            && let Some(before) = view.revert_tissue(body, *tissue, &text)
        {
            *tissue = before;
        }
        log.add(text, fault.suppressed_count.saturating_add(1), time.elapsed_secs_f64());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn panel() -> HapticPanel {
        HapticPanel::new(true, None, "recordings".into())
    }

    /// A slow build rejects a tissue that was set many frames ago.
    #[test]
    fn late_rejection_reverts_the_tissue() {
        let mut world = World::new();
        world.init_resource::<Messages<HapticFault>>();
        world.init_resource::<FaultLog>();
        world.init_resource::<Time<Real>>();
        world.insert_resource(panel());
        let good = Tissue::default();
        let set = Tissue { youngs_modulus_pa: 1e12, ..good };
        let body = world.spawn((set, BodyBuild::Outdated)).id();
        world.resource_mut::<HapticPanel>().view.start_change(body, good, set);
        let reject = |world: &mut World| {
            let kind = HapticFaultKind::BuildBody(palpate_body::BodyError::NoNodes);
            world.write_message(HapticFault::new(Some(body), kind));
        };
        for _ in 0..200 {
            world.run_system_cached(collect_faults).unwrap();
        }
        // A rejection of an earlier tissue while the body is built with this one.
        reject(&mut world);
        world.run_system_cached(collect_faults).unwrap();
        assert_eq!(world.get::<Tissue>(body), Some(&set));
        world.entity_mut(body).remove::<BodyBuild>();
        reject(&mut world);
        world.run_system_cached(collect_faults).unwrap();
        assert_eq!(world.get::<Tissue>(body), Some(&good));
        assert_eq!(world.resource::<FaultLog>().faults.len(), 1);
    }

    #[test]
    fn contact_beyond_the_support_set_is_recorded_for_its_tool() {
        let mut world = World::new();
        world.init_resource::<Messages<HapticFault>>();
        world.init_resource::<FaultLog>();
        world.init_resource::<Time<Real>>();
        world.insert_resource(panel());
        let [tool, other] = [0; 2].map(|_| world.spawn(HapticTool::default()).id());
        let kind = HapticFaultKind::BeyondSupport { nodes: 18 };
        world.write_message(HapticFault::new(Some(tool), kind));
        world.run_system_cached(collect_faults).unwrap();
        let log = world.resource::<FaultLog>();
        assert_eq!((log.beyond_support_s(tool, 3.0), log.beyond_support_s(other, 3.0)), (Some(3.0), None));
        world.despawn(tool);
        world.run_system_cached(collect_faults).unwrap();
        assert!(world.resource::<FaultLog>().beyond_support.is_empty());
    }

    #[test]
    fn repeated_faults_are_counted_and_old_ones_discarded() {
        let mut log = FaultLog::default();
        ["a", "a", "b", "a"].iter().zip(0..).for_each(|(text, t)| log.add((*text).into(), 1, f64::from(t)));
        assert_eq!(log.faults, [("a".into(), 2, 1.0), ("b".into(), 1, 2.0), ("a".into(), 1, 3.0)]);
        (0..20).for_each(|i| log.add(i.to_string(), 1, 4.0));
        assert_eq!(log.faults.len(), MAX_FAULTS);
    }
}
