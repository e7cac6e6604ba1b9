//! The model side of a step: bodies, local models, hand-over.

use super::{ContactBegan, ContactEnded, HapticTool, LocalModelBuild, LocalModelError, ToolLoop};
use crate::body::SimulatedBody;
use crate::fault::{HapticFault, HapticFaultKind};
use crate::schedule::ModelRate;
use bevy::prelude::*;
use glam::DVec3;
use palpate_body::SemiImplicitEuler;
use palpate_local::{ModelId, Scheme};

/// Steps every body: along the samples of the tool that can touch it, or by the model period if there is none.
pub(super) fn step_bodies(
    mut bodies: Query<(Entity, &mut SimulatedBody)>,
    mut tools: Query<(Entity, &mut ToolLoop)>,
    rate: Res<ModelRate>,
    mut began: MessageWriter<ContactBegan>,
    mut ended: MessageWriter<ContactEnded>,
    mut faults: MessageWriter<HapticFault>,
) {
    let integrator = SemiImplicitEuler::default();
    for (_, mut tool) in &mut tools {
        tool.full_n.clear();
    }
    for (entity, mut simulated) in &mut bodies {
        let simulated = &mut *simulated;
        let tool = tools.iter_mut().find(|(_, tool)| tool.body == Some(entity) && !tool.path.is_empty());
        let stepped = match tool {
            None => simulated.body.advance(None, rate.ticks() as usize, integrator),
            Some((tool_entity, mut tool)) => {
                // Nodes of another shape have other numbers.
                if std::mem::replace(&mut tool.shape, simulated.shape) != simulated.shape {
                    tool.let_go(tool_entity).map(|message| ended.write(message));
                }
                let ToolLoop { contact, path, full_n, .. } = &mut *tool;
                let before = contact.normal();
                let along = Some((&mut *contact, path.as_slice()));
                let note = |_, force_n| full_n.push(force_n);
                let stepped = simulated.body.advance_observed(along, path.len() - 1, integrator, note);
                if stepped.is_err() {
                    contact.let_go();
                    full_n.clear();
                }
                let after = contact.normal();
                if before.is_some() && after.is_none() {
                    ended.write(ContactEnded { tool: tool_entity, body: entity });
                }
                if let Some((normal, touched)) =
                    after.filter(|_| before.is_none()).zip(contact.touched().first())
                {
                    let point_m = touched.point_m(&simulated.body);
                    began.write(ContactBegan { tool: tool_entity, body: entity, point_m, normal });
                }
                stepped
            }
        };
        match stepped {
            Ok(report) => (simulated.last_step, simulated.failed) = (report, None),
            Err(error) => {
                bring_to_rest(simulated);
                let kind = std::mem::discriminant(&error);
                if simulated.failed.replace(kind) != Some(kind) {
                    let kind = HapticFaultKind::StepBody(error);
                    faults.write(HapticFault { entity: Some(entity), kind });
                }
            }
        }
    }
}

/// Compares what every loop displayed with what the full body says for the same samples.
pub(super) fn judge_loops(mut tools: Query<&mut ToolLoop>) {
    for mut tool in &mut tools {
        let ToolLoop { handle, full_n, consumed, error, .. } = &mut *tool;
        let displayed = handle.displayed();
        let first = consumed.and_then(|newest| newest.checked_sub(full_n.len() as u64));
        let pair = |(i, full): (usize, &DVec3)| Some((displayed.get(first? + 1 + i as u64)?, *full));
        *error = LocalModelError::of(full_n.iter().enumerate().filter_map(pair));
    }
}

/// What could not be stepped from here may be from rest.
fn bring_to_rest(simulated: &mut SimulatedBody) {
    let x = simulated.body.positions_m().to_vec();
    // The positions are the body's own, so they fit.
    let _ = simulated.body.set_state(&x, &vec![DVec3::ZERO; x.len()]);
}

/// Builds a local model for every tool that has new samples, into the slot of the exchange.
pub(super) fn build_local_models(
    mut bodies: Query<&mut SimulatedBody>,
    mut tools: Query<(Entity, &HapticTool, &mut ToolLoop, &mut LocalModelBuild)>,
    mut faults: MessageWriter<HapticFault>,
) {
    for (entity, asked, mut tool, mut newest) in &mut tools {
        let ToolLoop {
            handle, contact, path, consumed, body, built, support, has_support, was_beyond, ..
        } = &mut *tool;
        *built = false;
        let (Some(&point), Some(sequence)) = (path.last().filter(|_| path.len() > 1), *consumed) else {
            continue;
        };
        let model = handle.model_slot();
        let simulated = body.and_then(|body| Some((body, bodies.get_mut(body).ok()?)));
        let Some((body, mut simulated)) = simulated else {
            // Nothing to be felt: that is a model too, or the last touch would last until it is stale.
            model.silence(sequence);
            *built = true;
            continue;
        };
        let SimulatedBody { body: full, builder, epoch, .. } = &mut *simulated;
        // Where it has been felt is where the local model before had its support set.
        let is_beyond = *has_support && contact.touched_nodes().iter().any(|node| !support.contains(node));
        if is_beyond && !std::mem::replace(was_beyond, true) {
            let nodes = support.len();
            faults
                .write(HapticFault { entity: Some(entity), kind: HapticFaultKind::BeyondSupport { nodes } });
        }
        *was_beyond = is_beyond;
        support.clear();
        *has_support = false;
        let id = ModelId { body: body.to_bits(), epoch: *epoch, sequence };
        match builder.build(asked.scheme, full, contact, point, id, model) {
            Ok(report) => {
                (*built, *newest) = (true, report.into());
                if asked.scheme == Scheme::NearFieldExact {
                    support.extend(builder.support());
                    *has_support = true;
                }
            }
            Err(error) => {
                faults.write(HapticFault { entity: Some(entity), kind: HapticFaultKind::LocalModel(error) });
            }
        }
    }
}

/// Hands over the local models that have been built.
pub(super) fn publish_local_models(mut tools: Query<&mut ToolLoop>) {
    for mut tool in &mut tools {
        if std::mem::take(&mut tool.built) {
            tool.handle.publish_model();
        }
    }
}
