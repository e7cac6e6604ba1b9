//! Builds and publishes the local models of the tools.

use super::components::HapticTool;
use super::results::LocalModelStats;
use super::second_contact::SecondContact;
use super::tool_loop::ToolLoop;
use crate::body::SimulatedBody;
use crate::fault::{FaultWriter, HapticFaultKind};
use crate::model_time::ModelPeriod;
use bevy::prelude::*;
use palpate_body::{Body, ToolContact};
use palpate_haptics::FollowedTool;
use palpate_local::{LocalModel, ModelId, Scheme};
use palpate_reduce::{BodyUnderTool, BuilderOptions, ReduceError};

/// Builds a local model for every tool with new samples, in the slot of the exchange.
pub(super) fn build_local_models(
    mut bodies: Query<&mut SimulatedBody>,
    mut tools: Query<(Entity, &HapticTool, &mut ToolLoop, &mut LocalModelStats)>,
    period: ModelPeriod,
    mut faults: FaultWriter,
) {
    let horizon_s = horizon_s(period.s());
    // The contacts of all tools, for the local models of the others.
    let all: Vec<ContactOfTool> = tools
        .iter()
        .flat_map(|(tool, _, of, _)| of.contacts().map(move |(body, contact)| (tool, body, contact.clone())))
        .collect();
    let slots: Vec<(u64, usize)> =
        tools.iter().filter_map(|(tool, _, of, _)| Some((tool.to_bits(), of.slot?))).collect();
    for (entity, described, mut tool, mut stats) in &mut tools {
        let ToolLoop {
            handle,
            contact,
            path,
            consumed,
            body,
            second,
            built,
            followed,
            support,
            has_support,
            reported_beyond_support: was_beyond,
            ..
        } = &mut *tool;
        (*built, *followed) = (false, None);
        let (Some(&point), Some(sequence)) = (path.last().filter(|_| path.len() > 1), *consumed) else {
            continue;
        };
        let model = handle.model_slot();
        let Some(body) = body.filter(|body| bodies.contains(*body)) else {
            // An empty model replaces the previous one, which would render force until it is stale.
            model.clear(sequence);
            *built = true;
            continue;
        };
        let of_second = second.as_mut().map(|second| {
            let SecondContact { contact, support, has_support, reported_beyond_support, .. } = second;
            (&*contact, support, has_support, reported_beyond_support)
        });
        let of_first = (&*contact, support, has_support, was_beyond);
        for (contact, support, has_support, was_beyond) in std::iter::once(of_first).chain(of_second) {
            // Contact outside the support set of the previous local model.
            let is_beyond =
                *has_support && contact.touched_nodes().iter().any(|node| !support.contains(node));
            if is_beyond && !std::mem::replace(was_beyond, true) {
                let nodes = support.len();
                faults.write(entity, HapticFaultKind::BeyondSupport { nodes });
            }
            *was_beyond = is_beyond;
            support.clear();
            *has_support = false;
        }
        let scheme = described.scheme;
        // The other schemes render the first body alone.
        let second = second.as_mut().filter(|_| scheme == Scheme::NearFieldExact);
        let pair = second.and_then(|second| {
            let pair = bodies.get_many_mut([body, second.body]).ok()?;
            Some((second, pair))
        });
        let result = if let Some((second, [mut a, mut b])) = pair {
            let of = [(body, &*contact), (second.body, &second.contact)];
            let simulated = [&mut *a, &mut *b];
            let report = build_pair((entity, of), simulated, &all, (point, sequence, horizon_s), model);
            if report.is_ok() {
                second.support.extend(b.builder.support());
                second.has_support = true;
            }
            report.map(|report| (report, a.builder.support().to_vec()))
        } else if let Ok(mut simulated) = bodies.get_mut(body) {
            let SimulatedBody { body: full, builder, epoch, .. } = &mut *simulated;
            let id = ModelId { body: body.to_bits(), epoch: *epoch, sequence };
            let others = others(&all, entity, (body, full));
            // Cannot fail: the value is clamped.
            let _ = builder.set_horizon_s(horizon_s);
            let built = builder.build_with_other_tools(scheme, full, (contact, point), &others, id, model);
            built.map(|report| (report.into(), builder.support().to_vec()))
        } else {
            continue;
        };
        match result {
            Ok((report, nodes)) => {
                (*built, *stats) = (true, report);
                let other =
                    model.near_fields().map(|field| field.other).into_iter().find(|other| other.tool != 0);
                *followed = other.filter(|_| scheme == Scheme::NearFieldExact).and_then(|other| {
                    let (_, slot) = slots.iter().find(|(tool, _)| *tool == other.tool)?;
                    Some(FollowedTool { slot: *slot, tool: other.tool, body: other.body })
                });
                if scheme == Scheme::NearFieldExact {
                    tool.support.extend(nodes);
                    tool.has_support = true;
                }
            }
            Err(error) => {
                faults.write(entity, HapticFaultKind::LocalModel(error));
            }
        }
    }
}

/// Horizon of the local models for model steps of `period_s`, s: a local model is active for one period, after a period in which it is
/// built.
pub(super) fn horizon_s(period_s: f64) -> f64 {
    (2.0 * period_s).clamp(BuilderOptions::default().horizon_s, 10.0)
}

/// A tool, a body and the tool's contact with it.
type ContactOfTool = (Entity, Entity, ToolContact);

/// The contacts of all tools but `tool` with a body.
fn others<'a>(all: &'a [ContactOfTool], tool: Entity, (body, full): (Entity, &Body)) -> Vec<&'a ToolContact> {
    all.iter()
        .filter(|(other, on, _)| *other != tool && *on == body)
        .map(|(.., contact)| contact)
        .filter(|contact| contact.validate(full).is_ok())
        .collect()
}

/// Builds the local model of two bodies under `tool`.
fn build_pair(
    (tool, [first, second]): (Entity, [(Entity, &ToolContact); 2]),
    [a, b]: [&mut SimulatedBody; 2],
    all: &[ContactOfTool],
    (point, sequence, horizon_s): (palpate_body::ToolPoint, u64, f64),
    model: &mut LocalModel,
) -> Result<LocalModelStats, ReduceError> {
    let [of_a, of_b] = [others(all, tool, (first.0, &a.body)), others(all, tool, (second.0, &b.body))];
    let first = under_tool(a, first, &of_a, horizon_s);
    let second = under_tool(b, second, &of_b, horizon_s);
    let built = BodyUnderTool::build_pair(first, second, point, sequence, model);
    let [a, b] = built.map_err(|(_, error)| error)?;
    Ok(LocalModelStats::from(a).with_second(b.into()))
}

/// `simulated`, the body of an entity, under a tool with the given contact, for a local model with the given horizon.
fn under_tool<'a>(
    simulated: &'a mut SimulatedBody,
    (entity, contact): (Entity, &'a ToolContact),
    others: &'a [&'a ToolContact],
    horizon_s: f64,
) -> BodyUnderTool<'a> {
    let SimulatedBody { body, builder, epoch, .. } = simulated;
    // Cannot fail: the value is clamped.
    let _ = builder.set_horizon_s(horizon_s);
    BodyUnderTool { builder, body, contact, others, identity: (entity.to_bits(), *epoch) }
}

/// Publishes the local models that have been built.
pub(super) fn publish_local_models(mut tools: Query<&mut ToolLoop>) {
    for mut tool in &mut tools {
        if std::mem::take(&mut tool.built) {
            tool.handle.publish_model();
        }
    }
}
