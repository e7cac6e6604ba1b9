//! The answer of a local model beside that of the body that it stands for, over frequency.

use crate::{BuilderOptions, DenseSystem, LocalModelBuilder, ReduceError, SecondOrderSystem};
use faer::{Mat, c64};
use glam::DVec3;
use palpate_body::{Body, ToolContact, ToolPoint};
use palpate_local::{LocalModel, ModelId, Scheme};
use std::f64::consts::TAU;

/// How force answers to a small displacement of the node that a tool touches, in the full body and in a local model, both
/// linear about the body's present state: g(s) = nᵀ G(s) n, N/m, with G of [`SecondOrderSystem`].
#[derive(Clone, Debug, PartialEq)]
pub struct Bode {
    /// The scheme of the local model.
    pub scheme: Scheme,
    /// The node that is driven: of those that the tool touches or holds the one with the greatest weight.
    pub node: usize,
    /// n: the normal of the surface there, or the force's direction.
    pub along: DVec3,
    /// Of the full body.
    pub full: Vec<BodePoint>,
    /// Of the local model; empty for one that answers nothing between two model steps.
    pub local: Vec<BodePoint>,
}

/// One frequency of a [`Bode`] plot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodePoint {
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// |g| over 1 N/m, dB.
    pub gain_db: f64,
    /// arg g, degrees, −180 to 180.
    pub phase_deg: f64,
}

impl Bode {
    /// Eight frequencies in a decade, from 0.1 Hz to 1 kHz, Hz.
    #[must_use]
    pub fn frequencies_hz() -> Vec<f64> {
        (0..=32).map(|i| 10f64.powf(f64::from(i) / 8.0 - 1.0)).collect()
    }

    /// The node that a tool in `contact` drives: the free one with the greatest weight of what it touches or holds; `None` where
    /// that is nothing.
    #[must_use]
    pub fn driven_node(body: &Body, contact: &ToolContact) -> Option<usize> {
        crate::builder::heaviest(&contact.points(), body)
    }

    /// At `frequencies_hz`, with the local model of `scheme` that a builder with `options` makes of `body` with the tool at
    /// `tool` in `contact`. `None` where the tool touches nothing.
    ///
    /// It takes a sparse factorisation for each frequency: 0.1 s in all for a few hundred nodes, many seconds for thousands.
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
                // A tangent is that of all that the tool touches, or of the one node if it holds no more.
                let held = ToolContact::hold(body, node, tool.position_m)?;
                let contact = if scheme == Scheme::Tangent { &held } else { contact };
                let mut builder = LocalModelBuilder::new(body, options)?;
                let mut model = LocalModel::empty(builder.capacity());
                builder.build(scheme, body, contact, tool, ModelId::default(), &mut model)?;
                let place = builder.support().iter().position(|&of_support| of_support == node);
                DenseSystem::of_local_model(&model, place).map(|local| local.response(&s))
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

#[cfg(test)]
mod tests;
