//! What went wrong lately, and what the panel takes back because of it.

use super::state::HapticPanel;
use crate::body::{BodyBuild, SimulatedBody, Tissue};
use crate::fault::{HapticFault, HapticFaultKind};
use crate::tool::HapticTool;
use bevy::ecs::entity::EntityHashMap;
use bevy::prelude::*;
use palpate_haptics::LoopEventKind;
use std::collections::VecDeque;

/// The faults that were told last.
#[derive(Resource, Default)]
pub(crate) struct FaultLog {
    /// Text, how often in a row, and when last, s.
    pub(super) faults: VecDeque<(String, u32, f64)>,
    /// When each tool last touched beyond its support set, s.
    beyond_support: EntityHashMap<f64>,
}

/// Faults that are kept.
const KEPT: usize = 5;

impl FaultLog {
    /// How long ago `tool` last touched beyond its support set, s, if it did.
    pub(super) fn beyond_support_s(&self, tool: Entity, now_s: f64) -> Option<f64> {
        self.beyond_support.get(&tool).map(|at_s| now_s - at_s)
    }

    fn add(&mut self, text: String, now_s: f64) {
        match self.faults.back_mut() {
            Some((last, times, at)) if *last == text => {
                *times += 1;
                *at = now_s;
            }
            _ => self.faults.push_back((text, 1, now_s)),
        }
        if self.faults.len() > KEPT {
            self.faults.pop_front();
        }
    }
}

/// Hears faults. A material with which a body cannot be built gives way to the one before, if the panel has set it.
pub(super) fn collect_faults(
    mut faults: MessageReader<HapticFault>,
    mut heard: ResMut<FaultLog>,
    mut panel: ResMut<HapticPanel>,
    mut bodies: Query<(&mut Tissue, Option<&SimulatedBody>, Has<BodyBuild>)>,
    tools: Query<(), With<HapticTool>>,
    time: Res<Time<Real>>,
) {
    let made_of = |body| bodies.get(body).ok()?.1.map(SimulatedBody::tissue);
    panel.bypass_change_detection().view.confirm_tissue(made_of);
    heard.bypass_change_detection().beyond_support.retain(|tool, _| tools.contains(*tool));
    for fault in faults.read() {
        if matches!(fault.kind, HapticFaultKind::Loop(LoopEventKind::DeadlinesMissed(_))) {
            continue;
        }
        if let (HapticFaultKind::BeyondSupport { .. }, Some(tool)) = (&fault.kind, fault.entity) {
            heard.beyond_support.insert(tool, time.elapsed_secs_f64());
        }
        let text = fault.kind.report();
        let view = &mut panel.bypass_change_detection().view;
        if let (HapticFaultKind::BuildBody(_) | HapticFaultKind::LocalModel(_), Some(body)) =
            (&fault.kind, fault.entity)
            // While it is being made anew, what has been refused is not what is set now.
            && let Ok((mut tissue, _, false)) = bodies.get_mut(body)
            && let Some(before) = view.revert_tissue(body, *tissue, &text)
        {
            *tissue = before;
        }
        heard.add(text, time.elapsed_secs_f64());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::panel::HapticPanelPlugin;

    /// A body that takes long to make refuses what was set many frames ago.
    #[test]
    fn a_refusal_that_comes_late_takes_the_material_back_all_the_same() {
        let mut world = World::new();
        world.init_resource::<Messages<HapticFault>>();
        world.init_resource::<FaultLog>();
        world.init_resource::<Time<Real>>();
        world.insert_resource(HapticPanel::new(&HapticPanelPlugin::default()));
        let good = Tissue::default();
        let set = Tissue { youngs_modulus_pa: 1e12, ..good };
        let body = world.spawn((set, BodyBuild::Outdated)).id();
        world.resource_mut::<HapticPanel>().view.try_tissue(body, good, set);
        let refuse = |world: &mut World| {
            let kind = HapticFaultKind::BuildBody(palpate_body::BodyError::NoNodes);
            world.write_message(HapticFault { entity: Some(body), kind });
        };
        for _ in 0..200 {
            world.run_system_cached(collect_faults).unwrap();
        }
        // Of an earlier material, while this one is being made.
        refuse(&mut world);
        world.run_system_cached(collect_faults).unwrap();
        assert_eq!(world.get::<Tissue>(body), Some(&set));
        world.entity_mut(body).remove::<BodyBuild>();
        refuse(&mut world);
        world.run_system_cached(collect_faults).unwrap();
        assert_eq!(world.get::<Tissue>(body), Some(&good));
        assert_eq!(world.resource::<FaultLog>().faults.len(), 1);
    }

    #[test]
    fn a_touch_beyond_the_support_set_is_known_of_its_tool() {
        let mut world = World::new();
        world.init_resource::<Messages<HapticFault>>();
        world.init_resource::<FaultLog>();
        world.init_resource::<Time<Real>>();
        world.insert_resource(HapticPanel::new(&HapticPanelPlugin::default()));
        let [tool, other] = [0; 2].map(|_| world.spawn(HapticTool::default()).id());
        let kind = HapticFaultKind::BeyondSupport { nodes: 18 };
        world.write_message(HapticFault { entity: Some(tool), kind });
        world.run_system_cached(collect_faults).unwrap();
        let heard = world.resource::<FaultLog>();
        assert_eq!(
            (heard.beyond_support_s(tool, 3.0), heard.beyond_support_s(other, 3.0)),
            (Some(3.0), None)
        );
        world.despawn(tool);
        world.run_system_cached(collect_faults).unwrap();
        assert!(world.resource::<FaultLog>().beyond_support.is_empty());
    }

    #[test]
    fn what_is_said_again_is_counted_and_only_the_last_few_are_kept() {
        let mut heard = FaultLog::default();
        ["a", "a", "b", "a"].iter().zip(0..).for_each(|(text, t)| heard.add((*text).into(), f64::from(t)));
        assert_eq!(heard.faults, [("a".into(), 2, 1.0), ("b".into(), 1, 2.0), ("a".into(), 1, 3.0)]);
        (0..20).for_each(|i| heard.add(i.to_string(), 4.0));
        assert_eq!(heard.faults.len(), KEPT);
    }
}
