//! Frequency responses of a local model and of its body.

use crate::{BuilderOptions, DenseSystem, LocalModelBuilder, ReduceError, SecondOrderSystem};
use faer::{Mat, c64};
use glam::DVec3;
use palpate_body::{Body, ToolContact, ToolPoint};
use palpate_local::{LocalModel, ModelId, Scheme};
use std::f64::consts::TAU;

/// Bode plot of the dynamic stiffness g(s) = nᵀ G(s) n, N/m, at the node that a tool touches, with G of [`SecondOrderSystem`].
///
/// It compares the full body with a local model, both linearised about the current state of the body.
#[derive(Clone, Debug, PartialEq)]
pub struct Bode {
    /// The scheme of the local model.
    pub scheme: Scheme,
    /// Driven node: the one of maximum weight among those that the tool touches or holds.
    pub node: usize,
    /// Direction n: the contact normal, or the direction of the force.
    pub along: DVec3,
    /// Response of the full body.
    pub full: Vec<BodePoint>,
    /// Response of the local model; empty where its force does not depend on the tool's motion.
    pub local: Vec<BodePoint>,
}

/// One frequency of a [`Bode`] plot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodePoint {
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Gain |g| relative to 1 N/m, dB.
    pub gain_db: f64,
    /// Phase arg g, degrees, −180 to 180.
    pub phase_deg: f64,
}

impl Bode {
    /// Frequencies from 0.1 Hz to 1 kHz, eight a decade, Hz.
    #[must_use]
    pub fn frequencies_hz() -> Vec<f64> {
        (0..=32).map(|i| 10f64.powf(f64::from(i) / 8.0 - 1.0)).collect()
    }

    /// The driven node of a tool in `contact`: the free node of maximum weight among those that it touches or holds. `None` without
    /// contact.
    #[must_use]
    pub fn driven_node(body: &Body, contact: &ToolContact) -> Option<usize> {
        crate::builder::max_weight_node(&contact.points(), body)
    }

    /// Computes both responses at `frequencies_hz`. The local model is built by `scheme` and `options` from `body` with the tool at `tool`
    /// in `contact`. `None` where the tool touches nothing.
    ///
    /// Each frequency requires a sparse factorisation: 0.1 s in all for a few hundred nodes, many seconds for thousands.
    ///
    /// # Errors
    /// As [`LocalModelBuilder::new`], [`LocalModelBuilder::build`] and [`SecondOrderSystem::response`].
    pub fn compare(
        body: &Body,
        contact: &ToolContact,
        tool: ToolPoint,
        scheme: Scheme,
        options: BuilderOptions,
        frequencies_hz: &[f64],
    ) -> Result<Option<Self>, ReduceError> {
        let Some(node) = Self::driven_node(body, contact) else { return Ok(None) };
        let force_n = contact.displayed_force_n(body);
        let along = contact.normal().or(force_n.try_normalize()).unwrap_or(DVec3::Y);
        let s: Vec<c64> = frequencies_hz.iter().map(|hz| c64::new(0.0, TAU * hz)).collect();
        let system = SecondOrderSystem::of_body(body, &[node], 3)?;
        let full = points(frequencies_hz, &system.response(&s)?, along);
        let local = match scheme {
            Scheme::Hold | Scheme::LowPass => None,
            Scheme::Neighbourhood => Some(system.neighbourhood(body.network(), options.rings)?.response(&s)?),
            Scheme::Tangent | Scheme::KrylovLinear | Scheme::NearFieldExact => {
                // For the tangent, the tool holds the driven node alone: otherwise it would be that of all touched nodes.
                let held = ToolContact::hold(body, node, tool.position_m)?;
                let contact = if scheme == Scheme::Tangent { &held } else { contact };
                let mut builder = LocalModelBuilder::new(body, options)?;
                let mut model = LocalModel::empty(builder.capacity());
                builder.build(scheme, body, contact, tool, ModelId::default(), &mut model)?;
                let index = builder.support().iter().position(|&of_support| of_support == node);
                DenseSystem::of_local_model(&model, index).map(|local| local.response(&s))
            }
        };
        let local = local.map(|response| points(frequencies_hz, &response, along)).unwrap_or_default();
        Ok(Some(Self { scheme, node, along, full, local }))
    }
}

/// nᵀ G n at every frequency at which it is finite.
fn points(frequencies_hz: &[f64], response: &[Mat<c64>], n: DVec3) -> Vec<BodePoint> {
    let entry = |g: &Mat<c64>| {
        let mut sum = c64::new(0.0, 0.0);
        for i in 0..3 {
            for j in 0..3 {
                sum += g[(i, j)] * (n[i] * n[j]);
            }
        }
        sum
    };
    let point = |(&frequency_hz, g): (&f64, c64)| BodePoint {
        frequency_hz,
        gain_db: 20.0 * g.norm().log10(),
        phase_deg: g.im.atan2(g.re).to_degrees(),
    };
    let finite = |p: &BodePoint| p.gain_db.is_finite() && p.phase_deg.is_finite();
    frequencies_hz.iter().zip(response.iter().map(entry)).map(point).filter(finite).collect()
}
