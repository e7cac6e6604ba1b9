//! What went wrong lately, and what the panel takes back because of it.

use super::HapticPanel;
use crate::body::{BodyBuild, SimulatedBody, Tissue};
use crate::fault::{HapticFault, HapticFaultKind};
use bevy::prelude::*;
use palpate_haptics::LoopEventKind;
use std::collections::VecDeque;

/// The faults that were told last.
#[derive(Resource, Default)]
pub(crate) struct Heard {
    /// Text, how often in a row, and when last, s.
    pub(super) faults: VecDeque<(String, u32, f64)>,
}

/// Faults that are kept.
const KEPT: usize = 5;

impl Heard {
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
pub(super) fn hear(
    mut faults: MessageReader<HapticFault>,
    mut heard: ResMut<Heard>,
    mut panel: ResMut<HapticPanel>,
    mut bodies: Query<(&mut Tissue, Option<&SimulatedBody>, Has<BodyBuild>)>,
    time: Res<Time<Real>>,
) {
    let made_of = |body| bodies.get(body).ok()?.1.map(SimulatedBody::tissue);
    panel.bypass_change_detection().view.settle_tissue(made_of);
    for fault in faults.read() {
        if matches!(fault.kind, HapticFaultKind::Loop(LoopEventKind::DeadlinesMissed(_))) {
            continue;
        }
        let text = fault.kind.chain();
        let view = &mut panel.bypass_change_detection().view;
        if let (HapticFaultKind::BuildBody(_) | HapticFaultKind::LocalModel(_), Some(body)) =
            (&fault.kind, fault.entity)
            // While it is being made anew, what has been refused is not what is set now.
            && let Ok((mut tissue, _, false)) = bodies.get_mut(body)
            && let Some(before) = view.take_back_tissue(body, *tissue, &text)
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
        world.init_resource::<Heard>();
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
            world.run_system_cached(hear).unwrap();
        }
        // Of an earlier material, while this one is being made.
        refuse(&mut world);
        world.run_system_cached(hear).unwrap();
        assert_eq!(world.get::<Tissue>(body), Some(&set));
        world.entity_mut(body).remove::<BodyBuild>();
        refuse(&mut world);
        world.run_system_cached(hear).unwrap();
        assert_eq!(world.get::<Tissue>(body), Some(&good));
        assert_eq!(world.resource::<Heard>().faults.len(), 1);
    }

    #[test]
    fn what_is_said_again_is_counted_and_only_the_last_few_are_kept() {
        let mut heard = Heard::default();
        ["a", "a", "b", "a"].iter().zip(0..).for_each(|(text, t)| heard.add((*text).into(), f64::from(t)));
        assert_eq!(heard.faults, [("a".into(), 2, 1.0), ("b".into(), 1, 2.0), ("a".into(), 1, 3.0)]);
        (0..20).for_each(|i| heard.add(i.to_string(), 4.0));
        assert_eq!(heard.faults.len(), KEPT);
    }
}
