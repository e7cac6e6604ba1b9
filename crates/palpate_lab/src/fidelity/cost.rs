//! Cost of a scheme: the time of building its local model and of a tick.

use crate::error::LabError;
use palpate_body::{Body, SemiImplicitEuler, ToolContact, ToolPoint};
use palpate_local::{HandOver, HandOverSettings, LocalModel, ModelId, Sample, Scheme};
use palpate_reduce::{BuilderOptions, LocalModelBuilder};
use std::time::Instant;

/// Cost of a scheme; times are medians.
pub(super) struct Cost {
    /// Number of state variables of the local model.
    pub(super) states: usize,
    pub(super) tick_us: f64,
    pub(super) build_ms: f64,
}

/// Tick at which the local model is built.
const AT: usize = 150;
/// Number of local models that are built.
const BUILDS: usize = 11;

/// Measures `scheme` on `body`, which moves along the first of `samples`.
#[expect(clippy::disallowed_methods, reason = "the times are the result")]
pub(super) fn measure(
    scheme: Scheme,
    body: &Body,
    contact: &ToolContact,
    samples: &[Sample],
    options: BuilderOptions,
) -> Result<Cost, LabError> {
    let (mut body, mut contact) = (body.clone(), contact.clone());
    let mut builder = LocalModelBuilder::new(&body, options)?;
    let point = |s: &Sample| ToolPoint { position_m: s.position_m, velocity_m_per_s: s.velocity_m_per_s };
    let path: Vec<ToolPoint> = samples.iter().take(AT + 1).map(point).collect();
    body.advance(Some((&mut contact, &path)), AT, SemiImplicitEuler::default())?;
    let mut model = LocalModel::empty(builder.capacity());
    let id = ModelId { body: 1, epoch: 0, sequence: samples[AT].sequence };
    let mut builds = Vec::with_capacity(BUILDS);
    for _ in 0..BUILDS {
        let begun = Instant::now();
        builder.build(scheme, &body, &contact, path[AT], id, &mut model)?;
        builds.push(1e3 * begun.elapsed().as_secs_f64());
    }
    let states = match scheme {
        Scheme::Hold | Scheme::Tangent => 0,
        Scheme::LowPass => 3,
        Scheme::Neighbourhood | Scheme::KrylovLinear => 2 * model.reduced.order,
        // The driven nodes have no state of their own.
        Scheme::NearFieldExact => 2 * model.near.order,
    };
    let settings = HandOverSettings { capacity: builder.capacity(), ..HandOverSettings::default() };
    let mut hand_over = HandOver::new(settings)?;
    let mut ticks = Vec::with_capacity(samples.len());
    for sample in &samples[AT..] {
        let begun = Instant::now();
        hand_over.push(*sample);
        if sample.sequence == id.sequence {
            hand_over.submit(&model);
        }
        std::hint::black_box(hand_over.render());
        ticks.push(1e6 * begun.elapsed().as_secs_f64());
    }
    Ok(Cost { states, tick_us: median(ticks), build_ms: median(builds) })
}

fn median(mut list: Vec<f64>) -> f64 {
    list.sort_by(f64::total_cmp);
    list[list.len() / 2]
}
