//! What the paper says, and what comes out here, section by section.

use super::{Row, defaults};
use crate::chain::{self, Chain, Figures};
use crate::density::{self, Density};
use crate::error::LabError;
use crate::figure::svg;
use crate::grip::{self, Grip};
use crate::lattice::{Analysis, Lattice, Method, mesh, response_panels, states};
use crate::manipulate::{Manipulate, SchemeName};
use crate::schemes::Schemes;
use faer::c64;
use glam::DVec3;
use palpate_body::{Block, UniformLattice};
use palpate_laws::SkinLaw;
use std::f64::consts::TAU;

type Section = fn() -> Result<Vec<Row>, LabError>;

/// The sections of the paper that have figures or numbers.
pub(super) const SECTIONS: [(&str, Section); 7] = [
    ("section 2", demonstration),
    ("section 3", linear_approximation),
    ("section 4", order_reduction),
    ("section 5", local_models),
    ("section 5.1", one_dimension),
    ("section 5.2", scaling),
    ("section 6", implementation),
];

const NO_PARAMETERS: &str = "The paper states no stiffness, damping, mass or unit. Here: springs of 200 N/m, dampers of 1.5 \
    times the root of stiffness times mass, masses of 10 g.";

fn demonstration() -> Result<Vec<Row>, LabError> {
    let experiment: Schemes = defaults();
    let (run, q) = experiment.experiment()?;
    let skin = SkinLaw::THIGH.at(0.010).map_or(f64::NAN, |tension| tension.force_n);
    let mut rows = vec![
        Row::new(
            "Fig. 1",
            "Simulation paradigms: full, held, filtered, local tangent",
            "a diagram",
            "four schemes: palpate-lab schemes",
        )
        .why(
            "The held, filtered and tangent ones are the schemes Hold, LowPass and Tangent of the loop, too.",
        ),
        Row::new(
            "Eqs. 1-4",
            "The four forces",
            "f(x[n]), f(x[N]), f(x[N]) * lpf[n], f(x[N]) + f'(x[N]) (x[n] - x[N])",
            "the same",
        )
        .why("The low-pass is of first order, which the paper does not say."),
        Row::new(
            "Eq. 5",
            "Force of the skin of the thigh, x/(5.4398 - 0.1418 x), at x = 10 mm",
            "2.4864 N",
            format!("{skin:.4} N"),
        ),
        Row::new(
            "Section 2",
            "Rates: haptic, model, bandwidth of the filter",
            "1 kHz, 10 Hz, 10 Hz",
            "the same",
        ),
        Row::new("Section 2", "Quantisation of position and of force", "0.3 mm, 0.07 N", "the same")
            .why("By rounding to the nearest step, which the paper does not say."),
    ];
    let named = [
        ("SNR and lag at 1 kHz, the ideal case", "89 dB, less than 1 ms", &q.full),
        ("SNR and lag of the held force", "43 dB, 49 ms", &q.hold),
        ("SNR and lag of the filtered force", "53 dB, 65 ms", &q.low_pass),
        ("SNR and lag of the local tangent", "72 dB, less than 1 ms", &q.tangent),
    ];
    rows.extend(named.map(|(what, paper, q)| {
        let here = format!("{:.1} dB, {:.0} ms; 10 ln of the power ratio {:.1}", q.snr_db, q.lag_ms, q.ten_ln_power_ratio);
        Row::new("Section 2", what, paper, here)
            .why("Ten times the natural logarithm meets the paper's figure, ten times the decimal one does not: it seems to \
                  have taken the former. An inference. The movement is not stated; here 10 + 6.5 sin(2 pi 1.2 t) mm.")
    }));
    let fig = Row::new(
        "Fig. 2",
        "Interaction with a nonlinear spring in one dimension",
        "four curves over time",
        "drawn below",
    );
    rows.push(fig.figure(run.figure(experiment.haptic_rate_hz)?));
    Ok(rows)
}

fn linear_approximation() -> Result<Vec<Row>, LabError> {
    let lattice = UniformLattice { stiffness_n_per_m: 100.0, damping_ratio: 0.7, mass_kg: 1.0 };
    let cube = Block::new([10; 3], DVec3::splat(0.1))?.uniform(&lattice)?;
    let order = 6 * cube.network.free().len();
    Ok(vec![
        Row::new(
            "Fig. 3",
            "Construction of the low order model",
            "a diagram",
            "linearise, then reduce: SecondOrderSystem::of_body, then a projection or truncation",
        ),
        Row::new(
            "Section 3",
            "Order of the dynamics of a 10 x 10 x 10 cube, 1000 x 3 x 2",
            "6000",
            order.to_string(),
        )
        .why("Counted on the network that is built, nothing of it held."),
    ])
}

fn percent(share: f64) -> String {
    format!("{:.2} %", 100.0 * share)
}

fn order_reduction() -> Result<Vec<Row>, LabError> {
    let lattice = Lattice { method: Method::Balanced, ..defaults() };
    let analysis = lattice.analyse(false)?;
    let r = &analysis.report;
    let inputs = analysis.full.inputs();
    let db = r.off_diagonal_db.unwrap_or(f64::NAN);
    let driven = analysis.specimen.driven();
    let at = 100.0 * driven[0] as f64 / analysis.specimen.cells as f64;
    let deep = 100.0 - 100.0 * driven[1] as f64 / analysis.specimen.cells as f64;
    Ok(vec![
        Row::new("Fig. 4", "Two dimensional 12 x 12 mesh, three edges held", "12 x 12", format!("{0} x {0} cells", analysis.specimen.cells))
            .why("Twelve cells, so thirteen nodes, along each edge: so counted, the order is the paper's, and there is a node in the middle.")
            .figure(mesh(&Lattice { method: Method::Full, ..defaults() }.analyse(false)?)?),
        Row::new("Section 4", "Inputs and outputs; order of the linear system", "2, 2; 524", format!("{inputs}, {inputs}; {}", r.order)),
        Row::new("Section 4", "Order after balanced reduction", "10", r.reduced_order.to_string()),
        Row::new("Section 4", "Infinity norm of the error", "less than 1.6e-3", format!("{:.4} N/m; the bound from the Hankel singular values is {:.4} N/m", r.hinf_error_n_per_m, r.error_bound_n_per_m.unwrap_or(f64::NAN)))
            .why(NO_PARAMETERS),
        Row::new("Section 4", "The same over the norm of the full model", "less than 1 %", percent(r.relative_to_proper_peak))
            .why("Of the proper part of the response: the whole, with a damper at the tool, grows without bound."),
        Row::new("Section 4", "Normal force from tangential displacement", "less than -200 dB", format!("{db:.0} dB"))
            .why("Relative to the normal response, the worst of the full and the reduced model: zero but for rounding, as the mesh is symmetric."),
        Row::new("Fig. 5", "Responses of the original and the reduced system", "indistinguishable", format!("{} apart at most, 10 to 1000 Hz", percent(r.band_relative_error)))
            .figure(svg(&response_panels(&analysis), 2)?),
        Row::new("Fig. 6", "Where the states of the reduced model live; coordinate of the input", "near the tool, at (50, 0)", format!("{} of the squared displacement in the first two states within a quarter of the width of the tool, at ({at:.0}, {deep:.0})", percent(near_the_tool(&analysis)?)))
            .why("Displacements only; the tool's node is no state. The two slowest states, third and fourth by size, reach deeper.")
            .figure(states(&analysis)?),
    ])
}

/// The share of the squared displacement of the first two states that is within a quarter of the width of the tool.
fn near_the_tool(analysis: &Analysis) -> Result<f64, LabError> {
    let lattice = analysis.specimen.lattice()?;
    let tool = lattice.position_m(analysis.specimen.driven());
    let width = lattice.position_m([analysis.specimen.cells, 0, 0]).x;
    let states = analysis.state_magnitudes().unwrap_or_default();
    let sum = |near: f64| -> f64 {
        let nodes =
            lattice.grid().enumerate().filter(|(_, ijk)| lattice.position_m(*ijk).distance(tool) <= near);
        nodes.flat_map(|(node, _)| states.iter().take(2).map(move |state| state[node].powi(2))).sum()
    };
    Ok(sum(0.25 * width) / sum(f64::INFINITY))
}

fn local_models() -> Result<Vec<Row>, LabError> {
    let near = |method, rings| Lattice { method, rings, ..defaults() }.analyse(true);
    let (one, two, three) =
        (near(Method::Neighbourhood, 1)?, near(Method::Neighbourhood, 2)?, near(Method::Neighbourhood, 3)?);
    let scaled = near(Method::Scaled, 1)?;
    let high = Lattice { method: Method::Neighbourhood, band_hz: vec![30.0, 1000.0], ..defaults() }
        .analyse(false)?;
    let dc = |analysis: &Analysis| percent(analysis.report.dc_relative_error);
    Ok(vec![
        Row::new("Fig. 7", "Construction of the low order model from the full one directly", "a diagram", "LocalModelBuilder, at every model step"),
        Row::new("Fig. 8", "Local low order approximation", "nodes round the instrument", format!("{} nodes, {} states", one.report.reduced_order / 4, one.report.reduced_order))
            .figure(mesh(&one)?),
        Row::new("Fig. 9", "Its response: close in 10-1000 Hz, DC gain significantly off", "close; off", format!("{} off from 30 Hz, {} from 10 Hz; {} at zero", percent(high.report.band_relative_error), percent(one.report.band_relative_error), dc(&one)))
            .why("How far down the band it is close depends on the specimen's slowest resonance, here at 7 to 11 Hz, and the paper states no parameters.")
            .figure(svg(&response_panels(&one), 2)?),
        Row::new("Section 5", "More layers of nodes improve the low frequencies", "possible", format!("off at zero by {}, {} and {} with 1, 2 and 3 rings", dc(&one), dc(&two), dc(&three))),
        Row::new("Fig. 10", "Local approximation with better low frequency response", "outer elements scaled by Fig. 16, masses by distance; square root at the surface", "the same nodes and rules")
            .why("The paper leaves open which distance counts for a mass: here the mean of that along the node's outer springs.")
            .figure(mesh(&scaled)?),
        Row::new("Fig. 11", "Its response: captures the first cut-off and the overall shape", "qualitatively", format!("{} off at zero, where that of Fig. 8 is {} off; worst in 10-1000 Hz {}", dc(&scaled), dc(&one), percent(scaled.report.band_relative_error)))
            .figure(svg(&response_panels(&scaled), 2)?),
    ])
}

/// The largest difference of assembled and closed-form poles, over the pole.
fn poles_apart(assembled: &Figures, closed: &Figures) -> f64 {
    let pairs = assembled.poles.iter().zip(&closed.poles);
    pairs.map(|(a, c)| (a.re - c.re).hypot(a.im - c.im) / c.re.hypot(c.im)).fold(0.0, f64::max)
}

fn one_dimension() -> Result<Vec<Row>, LabError> {
    let chain: Chain = defaults();
    let models = chain.models()?;
    let (k, b, m) = (chain.stiffness, chain.damping, chain.mass);
    let spring = move |s: c64| k + b * s;
    let masses = move |mu: f64, s: c64, share: f64| mu * m * s * s + share * (b * s + k);
    let eq_6 = move |s: c64| {
        let (h, d) = (spring(s), masses(1.0, s, 2.0));
        h * (1.0 - h * (d * d - h * h) / (d * (d * d - 2.0 * h * h)))
    };
    let eq_10 = move |s: c64| spring(s) * (1.0 - spring(s) / masses(1.0, s, 2.0));
    let eq_12 = move |s: c64| spring(s) * (1.0 - spring(s) / masses(2.0, s, 4.0 / 3.0));
    let hz: Vec<c64> = (0..=60).map(|i| c64::new(0.0, TAU * 10f64.powf(f64::from(i) / 15.0 - 1.0))).collect();
    let apart = |model: &chain::Model, formula: &dyn Fn(c64) -> c64| -> Result<String, LabError> {
        let responses = model.system.response(&hz)?;
        let off =
            responses.iter().zip(&hz).map(|(g, &s)| (g[(0, 0)] - formula(s)).norm() / formula(s).norm());
        Ok(format!("assembled, {:.0e} apart at most from 0.1 Hz to 1 kHz", off.fold(0.0, f64::max)))
    };
    let poles = |model: &chain::Model| {
        format!("assembled, {:.0e} apart", poles_apart(&model.assembled, &model.closed_form))
    };
    let ends = |model: &chain::Model| {
        let Figures { dc_gain, asymptote_stiffness, asymptote_damping, .. } = &model.assembled;
        format!("{:.4} k + {:.4} b s; {:.4} k", asymptote_stiffness / k, asymptote_damping / b, dc_gain / k)
    };
    let drawn =
        |method| mesh(&Lattice { dimension: 1, cells: 4, order: 1, method, ..defaults() }.analyse(false)?);
    let responses = chain.responses(&models)?;
    let ends_of = "High-frequency asymptote; DC gain";
    Ok(vec![
        Row::new(
            "Fig. 12",
            "Four layer lumped element chain",
            "a diagram",
            "a specimen of one dimension and four cells",
        )
        .figure(drawn(Method::Full)?),
        Row::new("Eq. 6", "Transfer function of the chain", "a closed form", apart(&models.full, &eq_6)?),
        Row::new("Eqs. 7-9", "Its poles", "a closed form", poles(&models.full)),
        Row::new("Section 5.1", ends_of, "k + b s; k/4", ends(&models.full)),
        Row::new(
            "Fig. 13",
            "First local model: the nearest mass, the others stand",
            "a diagram",
            "its neighbourhood of one ring",
        )
        .figure(drawn(Method::Neighbourhood)?),
        Row::new("Eq. 10", "Its transfer function", "a closed form", apart(&models.near, &eq_10)?),
        Row::new("Eq. 11", "Its poles", "a closed form", poles(&models.near)),
        Row::new("Section 5.1", ends_of, "k + b s; k/2", ends(&models.near)),
        Row::new(
            "Fig. 14",
            "Second local model: three layers as one, half their masses on the first",
            "a diagram",
            "its scaled model of one ring",
        )
        .figure(drawn(Method::Scaled)?),
        Row::new("Eq. 12", "Its transfer function", "a closed form", apart(&models.two_level, &eq_12)?),
        Row::new("Eq. 13", "Its poles", "a closed form", poles(&models.two_level)),
        Row::new("Section 5.1", ends_of, "k + b s; k/4", ends(&models.two_level)),
        Row::new(
            "Fig. 15",
            "Responses of the chain and its two local models",
            "three curves",
            "drawn below, for 100 N/m, 1 N s/m and 10 g",
        )
        .why("The paper states no parameters.")
        .figure(chain::figure(&responses)?),
    ])
}

fn scaling() -> Result<Vec<Row>, LabError> {
    let scalings = defaults::<Density>().scalings()?;
    let at = |dimension: usize| {
        let last = scalings.get(&dimension).and_then(|s| Some((s.density.last()?, s.scaling.last()?)));
        last.map_or_else(String::new, |(n, s)| {
            format!("{s:.3} in {dimension}-D with {n} cells along an edge")
        })
    };
    Ok(vec![
        Row::new("Fig. 16", "Stiffness of a block over the density of its mesh, 3-D and 2-D", "two curves", format!("{}, {}", at(2), at(3)))
            .why("The paper does not say how the block is held. Here its stiffness matrix is that on its corners, condensed, which in one dimension gives the rule of section 5.1.")
            .figure(density::figure(&scalings)?),
    ])
}

fn implementation() -> Result<Vec<Row>, LabError> {
    let manipulate = Manipulate { scheme: SchemeName::Neighbourhood, ..defaults() };
    let (comparison, report) = manipulate.experiment()?;
    let (paths, outcomes) = defaults::<Grip>().experiment()?;
    let outcome = |name: &str| outcomes.schemes.get(name).map_or("", |outcome| outcome.outcome);
    Ok(vec![
        Row::new("Section 6", "Size of the manipulated object", "6 x 6 x 6", format!("{0} x {0} x {0}", manipulate.nodes)),
        Row::new("Section 6", "Rates of the full model and of the local one", "20 Hz, 1 kHz", format!("{} Hz, 1 kHz", report.model_rate_hz)),
        Row::new("Section 6", "Contact: the force pushes only", "zero where it would pull", "the same rule, in body, local model and loop")
            .why("palpate-lab manipulate --contact touch shows it; Fig. 17 is made with the node held, which feels both."),
        Row::new("Fig. 17", "Force during manipulation: low rate and local model", "two curves", format!("local model {} off the full model at 1 kHz, largest jump {:.2} N; low rate, held, {} off, largest jump {:.2} N", percent(report.displayed.relative_rms_error), report.displayed.largest_jump_n, percent(report.low_rate.relative_rms_error), report.low_rate.largest_jump_n))
            .why("The paper does not compare with the full model at 1 kHz, and states neither parameters nor movement. The local model's error is that of its static stiffness.")
            .figure(manipulate.figure(&comparison)?),
        Row::new("Fig. 18", "A loosened grip: oscillation without the local approximation, none with it", "oscillates; does not", format!("held force {}; local approximation {}; full model at 1 kHz {}", outcome("hold"), outcome("neighbourhood"), outcome("full")))
            .why("A simulated device of 75 g under 1 N with 0.3 N s/m of grip, not a real one; nothing bounds its movement, so that what oscillates in a hand diverges here.")
            .figure(grip::figure(&paths)?),
    ])
}
