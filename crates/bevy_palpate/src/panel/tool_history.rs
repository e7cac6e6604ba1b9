//! What the panel collects at every model step while somebody looks at it.

mod background;

use super::history::{Curve, Trace, index_of};
use super::recording::Recorder;
use super::scheme_comparison::StepInput;
use super::state::HapticPanel;
use crate::body::SimulatedBody;
use crate::tool::{HapticTool, ToolLoop};
use background::{BodeTask, ComparisonTask};
use bevy::prelude::*;
use palpate_body::ToolContact;
use palpate_haptics::BlackBox;
use palpate_local::{ModelId, Sample, Scheme};
use palpate_reduce::Bode;

/// What the panel knows of the tool that it shows.
#[derive(Resource, Default)]
pub(crate) struct ToolHistory {
    /// What was looked at in the last frame, and what is in this one.
    wanted: Requested,
    pub(super) drawn: Requested,
    tool: Option<Entity>,
    body: Option<Entity>,
    /// The newest sample that has been seen.
    pub(super) newest: Option<u64>,
    pub(super) full: Curve,
    /// By [`Scheme::ALL`]: what the loop displayed while it ran, and what it would have otherwise.
    pub(super) schemes: [Curve; 6],
    /// How far each was from the full body over the last second, as a share of its force.
    pub(super) errors: [Trace; 6],
    /// Why a scheme has no curve.
    pub(super) notes: [Option<String>; 6],
    comparing: ComparisonTask,
    answering: BodeTask,
    pub(super) recorder: Recorder,
}

/// What is looked at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Requested {
    /// Force or error.
    pub(super) forces: bool,
    pub(super) bode: bool,
}

/// Ticks over which an error is taken.
pub(super) const ERROR_TICKS: u64 = 1000;

impl ToolHistory {
    fn forget_forces(&mut self) {
        self.full.clear();
        self.schemes.iter_mut().for_each(Curve::clear);
        self.errors.iter_mut().for_each(|trace| trace.points.clear());
        self.notes = Default::default();
        self.comparing.reset();
        self.newest = None;
    }

    /// How long the schemes that do not run took at the last model step, ms; model steps that were left out because that
    /// was too long.
    pub(super) fn comparing_cost(&self) -> (f64, u64) {
        (self.comparing.cost_ms, self.comparing.skipped)
    }

    pub(super) fn bode(&self) -> Option<&Result<Bode, String>> {
        self.answering.newest.as_ref()
    }

    /// Takes what has been computed in the background.
    fn take(&mut self) {
        for (scheme, told) in self.comparing.take() {
            let at = index_of(scheme);
            match told {
                Ok(forces) => {
                    self.notes[at] = None;
                    let newest = self.schemes[at].newest();
                    for (sequence, force_n) in forces {
                        if newest.is_none_or(|newest| sequence > newest) {
                            self.schemes[at].push(sequence, force_n);
                        }
                    }
                    self.compare_errors(at);
                }
                Err(why) => self.notes[at] = Some(why),
            }
        }
        self.answering.take();
    }

    fn compare_errors(&mut self, at: usize) {
        let Some(newest) = self.schemes[at].newest() else { return };
        let error = self.schemes[at].error_against(&self.full, newest.saturating_sub(ERROR_TICKS));
        let trace = &mut self.errors[at];
        let is_new = trace.points.back().is_none_or(|(last, _)| *last < newest);
        // Where there is hardly a force there is no share of it.
        if let Some(relative) = error.relative.filter(|share| is_new && error.rms_n > LEAST_N * share) {
            trace.push(newest, relative);
        }
    }
}

/// A force below that is none to speak of, N.
const LEAST_N: f64 = 0.01;

/// What was drawn in the last frame is what is wanted in this one.
pub(super) fn begin_frame(mut watched: ResMut<ToolHistory>) {
    let watched = &mut *watched;
    watched.wanted = std::mem::take(&mut watched.drawn);
    watched.take();
    watched.recorder.poll();
}

/// After every model step: takes what it has left, as far as it is looked at.
pub(super) fn update_history(
    panel: Res<HapticPanel>,
    mut watched: ResMut<ToolHistory>,
    mut tools: Query<(Entity, &HapticTool, &mut ToolLoop)>,
    bodies: Query<&SimulatedBody>,
    time: Res<Time<Real>>,
) {
    let watched = &mut *watched;
    if let Some((_, _, mut tool)) = watched.recorder.tool().and_then(|tool| tools.get_mut(tool).ok()) {
        let frame = tool.settings.frame;
        watched.recorder.record(tool.handle.samples(), &frame);
    }
    let chosen = panel.shown(tools.iter().map(|(entity, ..)| entity));
    let on = chosen.and_then(|tool| tools.get(tool).ok()?.2.body);
    let others = tools.iter().filter(|(entity, _, tool)| Some(*entity) != chosen && tool.body == on);
    let wants = watched.wanted.forces && panel.compare && on.is_some();
    let mut beside: Vec<ToolContact> =
        if wants { others.map(|(.., tool)| tool.contact.clone()).collect() } else { Vec::new() };
    let Some((entity, asked, mut tool)) = chosen.and_then(|tool| tools.get_mut(tool).ok()) else {
        watched.forget_forces();
        return;
    };
    let tool = &mut *tool;
    let is_other = watched.tool.replace(entity) != Some(entity);
    let is_elsewhere = std::mem::replace(&mut watched.body, tool.body) != tool.body;
    if is_other || is_elsewhere || watched.newest > tool.consumed || !watched.wanted.forces {
        watched.forget_forces();
    }
    let (Some(consumed), Some(body)) = (tool.consumed, tool.body) else { return };
    let Ok(simulated) = bodies.get(body) else { return };
    if watched.wanted.bode {
        let now_s = time.elapsed_secs_f64();
        if let Some(point) = tool.path.last() {
            watched.answering.request(now_s, simulated.body(), &tool.contact, *point, asked.scheme);
        }
    }
    if !watched.wanted.forces || tool.full_forces_n.is_empty() {
        return;
    }
    let first = consumed + 1 - (tool.full_forces_n.len() as u64).min(consumed);
    for (sequence, full_n) in (first..).zip(&tool.full_forces_n) {
        watched.full.push(sequence, *full_n);
    }
    let running = index_of(asked.scheme);
    let displayed = tool.handle.displayed();
    for (sequence, force_n) in (first..=consumed).filter_map(|s| Some((s, displayed.get(s)?))) {
        watched.schemes[running].push(sequence, force_n);
    }
    watched.newest = Some(consumed);
    watched.compare_errors(running);
    if panel.compare {
        let id = ModelId { body: body.to_bits(), epoch: simulated.epoch(), sequence: consumed };
        let history = tool.handle.samples();
        let samples: Vec<Sample> = (first..=consumed).filter_map(|s| history.get(s).copied()).collect();
        let adopted = adoptions(tool.handle.black_box(), first, id.body);
        let (body, contact) = (simulated.body().clone(), tool.contact.clone());
        beside.retain(|contact| contact.validate(&body).is_ok());
        let settings = tool.handle.config().hand_over;
        watched.comparing.push(StepInput { body, contact, beside, samples, adopted, id }, settings);
    } else {
        watched.comparing.reset();
    }
    watched.take();
}

/// The ticks, none before `first`, at which the loop began to speak by another local model of `body`: (the model's sample, tick).
fn adoptions(black_box: &BlackBox, first: u64, body: u64) -> Vec<(u64, u64)> {
    let mut adopted = Vec::new();
    // From the newest back: a tick whose model the tick before did not have.
    let mut later: Option<(u64, u64)> = None;
    for tick in black_box.ticks().rev() {
        let model = tick.model.filter(|model| model.body == body).map(|model| model.sequence);
        if let Some((of_later, sequence)) = later.filter(|(of_later, _)| model != Some(*of_later)) {
            adopted.push((of_later, sequence));
        }
        later = model.map(|model| (model, tick.sequence));
        if tick.sequence < first {
            break;
        }
    }
    adopted.reverse();
    adopted
}
