//! Rows of sections 5 and 6: local models and their results.

use super::row::{Row, percent};
use crate::chain::{self, Chain, Figures};
use crate::density::{self, Density};
use crate::grip::{self, Grip};
use crate::lattice::{Analysis, Lattice, Method, mesh, response_panels};
use crate::manipulate::Manipulate;
use faer::c64;
use palpate_lab::block_scene::ContactKind;
use palpate_lab::error::LabError;
use palpate_lab::figure::svg;
use palpate_lab::program::defaults;
use palpate_local::Scheme;
use std::f64::consts::TAU;

/// Rows of section 5.
pub(super) fn local_models() -> Result<Vec<Row>, LabError> {
    let of = |method, rings, low| {
        let lattice = Lattice { method, rings, band_hz: vec![low, 1000.0], ..defaults() };
        lattice.analyse(low == 10.0)
    };
    let near = of(Method::Neighbourhood, 1, 10.0)?;
    let above = of(Method::Neighbourhood, 1, 30.0)?;
    let wider = [of(Method::Neighbourhood, 2, 10.0)?, of(Method::Neighbourhood, 3, 10.0)?];
    let scaled = of(Method::Scaled, 1, 10.0)?;
    let dc = |analysis: &Analysis| percent(analysis.report.dc_relative_error);
    let band = |analysis: &Analysis| percent(analysis.report.band_relative_error);
    let states = near.report.reduced_order;
    Ok(vec![
        Row::new(
            "Fig. 7",
            "Construction of the low order model from the full one directly",
            "a diagram",
            "LocalModelBuilder, at every model step",
        ),
        Row::new(
            "Fig. 8",
            "Local low order approximation",
            "nodes around the instrument",
            format!("{} nodes, {states} states", states / 4),
        )
        .figure(mesh(&near)?),
        Row::new(
            "Fig. 9",
            "Its response: close in 10-1000 Hz, DC gain significantly off",
            "close; off",
            format!("{} off from 30 Hz, {} from 10 Hz; {} at zero", band(&above), band(&near), dc(&near)),
        )
        .why(
            "The lower limit of the band in which it is close depends on the slowest resonances of the specimen, here \
             7 and 11 Hz; the paper states no parameters.",
        )
        .figure(svg(&response_panels(&near), 2)?),
        Row::new(
            "Section 5",
            "More layers of nodes improve the low frequencies",
            "possible",
            format!("{}, {} and {} off at zero with 1, 2 and 3 rings", dc(&near), dc(&wider[0]), dc(&wider[1])),
        ),
        Row::new(
            "Fig. 10",
            "Local approximation with better low frequency response",
            "outer elements scaled by Fig. 16, masses by distance; square root at the surface",
            "the same rules; scaled springs in the colour of the tool",
        )
        .why(
            "The paper does not define the distance for a mass: here it is the mean along the outer springs of the \
             node.",
        )
        .figure(mesh(&scaled)?),
        Row::new(
            "Fig. 11",
            "Its response: captures the first cut-off and the overall shape",
            "qualitatively",
            format!(
                "{} off at zero, compared with {} in Fig. 8; at most {} in 10-1000 Hz",
                dc(&scaled),
                dc(&near),
                band(&scaled)
            ),
        )
        .figure(svg(&response_panels(&scaled), 2)?),
    ])
}

/// Rows of section 5.1.
pub(super) fn one_dimension() -> Result<Vec<Row>, LabError> {
    let chain: Chain = defaults();
    let models = chain.models()?;
    let (k, b, m) = (chain.stiffness, chain.damping, chain.mass);
    let spring = move |s: c64| k + b * s;
    let mass = move |mu: f64, s: c64, share: f64| mu * m * s * s + share * (b * s + k);
    let eq_6 = move |s: c64| {
        let (h, d) = (spring(s), mass(1.0, s, 2.0));
        h * (1.0 - h * (d * d - h * h) / (d * (d * d - 2.0 * h * h)))
    };
    let eq_10 = move |s: c64| spring(s) * (1.0 - spring(s) / mass(1.0, s, 2.0));
    let eq_12 = move |s: c64| spring(s) * (1.0 - spring(s) / mass(2.0, s, 4.0 / 3.0));
    let s: Vec<c64> = (0..=60).map(|i| c64::new(0.0, TAU * 10f64.powf(f64::from(i) / 15.0 - 1.0))).collect();
    let apart = |model: &chain::Model, formula: &dyn Fn(c64) -> c64| -> Result<String, LabError> {
        let responses = model.system.response(&s)?;
        let off = responses.iter().zip(&s).map(|(g, &s)| (g[(0, 0)] - formula(s)).norm() / formula(s).norm());
        Ok(format!("assembled, at most {:.0e} apart, 0.1 Hz to 1 kHz", off.fold(0.0, f64::max)))
    };
    let poles = |model: &chain::Model| {
        let pairs = model.assembled.poles.iter().zip(&model.closed_form.poles);
        let off = pairs.map(|(a, c)| (a.re - c.re).hypot(a.im - c.im) / c.re.hypot(c.im)).fold(0.0, f64::max);
        format!("assembled, at most {off:.0e} apart")
    };
    let ends = |model: &chain::Model| {
        let Figures { dc_gain, asymptote_stiffness, asymptote_damping, .. } = &model.assembled;
        format!("{:.4} k + {:.4} b s; {:.4} k", asymptote_stiffness / k, asymptote_damping / b, dc_gain / k)
    };
    let drawn = |method| {
        let lattice = Lattice { dimension: 1, cells: 4, order: 1, method, ..defaults() };
        mesh(&lattice.analyse(false)?)
    };
    let limits = "High-frequency asymptote; DC gain";
    let leading = "The asymptote of the spring and damper at the tool. The constant of a transfer function at high frequency \
                   is smaller by the square of b over the mass behind them.";
    let (first, second) = (
        "First local model: the nearest mass, the others fixed",
        "Second local model: three layers lumped into one, half their masses on the first",
    );
    Ok(vec![
        Row::new("Fig. 12", "Four layer lumped element chain", "a diagram", "a specimen of one dimension")
            .figure(drawn(Method::Full)?),
        Row::new("Eq. 6", "Transfer function of the chain", "a closed form", apart(&models.full, &eq_6)?),
        Row::new("Eqs. 7-9", "Its poles", "a closed form", poles(&models.full)),
        Row::new("Section 5.1", limits, "k + b s; k/4", ends(&models.full)).why(leading),
        Row::new("Fig. 13", first, "a diagram", "its neighbourhood of one ring")
            .figure(drawn(Method::Neighbourhood)?),
        Row::new("Eq. 10", "Its transfer function", "a closed form", apart(&models.near, &eq_10)?),
        Row::new("Eq. 11", "Its poles", "a closed form", poles(&models.near)),
        Row::new("Section 5.1", limits, "k + b s; k/2", ends(&models.near)).why("As above."),
        Row::new("Fig. 14", second, "a diagram", "its scaled model of one ring")
            .figure(drawn(Method::Scaled)?),
        Row::new("Eq. 12", "Its transfer function", "a closed form", apart(&models.two_level, &eq_12)?),
        Row::new("Eq. 13", "Its poles", "a closed form", poles(&models.two_level)),
        Row::new("Section 5.1", limits, "k + b s; k/4", ends(&models.two_level)).why("As above."),
        Row::new(
            "Fig. 15",
            "Responses of the chain and its two local models",
            "three curves",
            format!("drawn below, for {k} N/m, {b} N s/m and {m} kg"),
        )
        .why("The paper states no parameters.")
        .figure(chain::figure(&chain.responses(&models)?)?),
    ])
}

/// Rows of section 5.2.
pub(super) fn scaling() -> Result<Vec<Row>, LabError> {
    let scalings = defaults::<Density>().scalings()?;
    let ends = scalings.iter().filter_map(|(dimension, s)| {
        Some(format!(
            "{:.3} in {dimension}-D with {} cells along an edge",
            s.scaling.last()?,
            s.density.last()?
        ))
    });
    let ends = ends.collect::<Vec<_>>().join(", ");
    let what = "Stiffness of a block over the density of its mesh, 3-D and 2-D";
    let row = Row::new("Fig. 16", what, "two curves", ends)
        .why(
            "The paper does not define the stiffness matrix. Here it is that of the block condensed on its corners, which in \
             one dimension gives the rule of section 5.1.",
        )
        .figure(density::figure(&scalings)?);
    Ok(vec![row])
}

/// Rows of section 6.
pub(super) fn implementation() -> Result<Vec<Row>, LabError> {
    let held = Manipulate { scheme: Scheme::Neighbourhood, ..defaults() };
    let (comparison, report) = held.experiment()?;
    let (touching, _) = Manipulate { contact: ContactKind::Touch, ..held.clone() }.experiment()?;
    let forces = touching.displayed(Scheme::Neighbourhood).unwrap_or_default();
    let least = forces.iter().map(|f| f.z).fold(f64::INFINITY, f64::min);
    let (paths, outcomes) = defaults::<Grip>().experiment()?;
    let outcome = |name: &str| outcomes.schemes.get(name).map_or("", |outcome| outcome.outcome);
    let (local, low) = (&report.displayed, &report.low_rate);
    let (size, rate) = (held.nodes, report.model_rate_hz);
    Ok(vec![
        Row::new("Section 6", "Size of the object", "6 x 6 x 6", format!("{size} x {size} x {size} nodes")),
        Row::new(
            "Section 6",
            "Rates of the full model and of the local one",
            "20 Hz, 1 kHz",
            format!("{rate} Hz, 1 kHz"),
        ),
        Row::new(
            "Section 6",
            "Contact surface: the force only pushes, and is zero otherwise",
            "along the normal, never pulling",
            format!("minimum normal force while touching and leaving {:.4} N", least + 0.0),
        )
        .why("Fig. 17 holds the node, as in the manipulation of the paper, and therefore also pulls it."),
        Row::new(
            "Fig. 17",
            "Force during manipulation: low rate and local model",
            "two curves",
            format!(
                "local model {} off the full one at 1 kHz, maximum jump {:.2} N; low rate, held, {} off, maximum jump \
                 {:.2} N",
                percent(local.relative_rms_error),
                local.largest_jump_n,
                percent(low.relative_rms_error),
                low.largest_jump_n
            ),
        )
        .why(
            "The paper does not compare with the full model at 1 kHz, and states neither parameters nor movement. \
             The remaining error of the local model is that of its static stiffness.",
        )
        .figure(held.figure(&comparison)?),
        Row::new(
            "Fig. 18",
            "A loose grip: oscillation without the local approximation, none with it",
            "oscillates; does not",
            format!(
                "held force {}; local approximation {}; full model at 1 kHz {}",
                outcome("hold"),
                outcome("neighbourhood"),
                outcome("full")
            ),
        )
        .why(
            "A simulated device of 75 g under 1 N with a grip of 0.3 N s/m. Its movement is unbounded: an oscillation in a \
             hand is a divergence here.",
        )
        .figure(grip::figure(&paths)?),
    ])
}
