//! Rows of sections 2 to 4: the problem and balanced reduction.

use super::row::{Row, percent};
use crate::lattice::{Analysis, Lattice, Method, mesh, response_panels, states};
use crate::schemes::{Quality, Schemes};
use glam::DVec3;
use palpate_body::{Block, UniformLattice};
use palpate_lab::error::LabError;
use palpate_lab::figure::svg;
use palpate_lab::program::defaults;
use palpate_laws::SkinLaw;

/// Rows of section 2.
pub(super) fn demonstration() -> Result<Vec<Row>, LabError> {
    let e: Schemes = defaults();
    let (run, q) = e.experiment()?;
    let skin = SkinLaw::THIGH.at(0.010).map_or(f64::NAN, |tension| tension.force_n);
    let forces = "f(x[n]), f(x[N]), f(x[N]) * lpf[n], f(x[N]) + f'(x[N]) (x[n] - x[N])";
    let paradigms = "Simulation paradigms: full, held, filtered, local tangent";
    let diagram = Row::new("Fig. 1", paradigms, "a diagram", "four schemes: palpate-lab schemes")
        .why("Held, filtered and tangent forces are also schemes of the loop: Hold, LowPass, Tangent.");
    let rates = format!("{} Hz, {} Hz, {} Hz", e.haptic_rate_hz, e.model_rate_hz, e.cutoff_hz);
    let steps = format!("{} mm, {} N", e.position_step_mm, e.force_step_n);
    let ratio = |what, paper: &str, q: &Quality| {
        let Quality { lag_ms, snr_db, ten_ln_power_ratio } = q;
        let here =
            format!("{snr_db:.1} dB, {lag_ms:.0} ms; 10 ln of the power ratio {ten_ln_power_ratio:.1}");
        Row::new("Section 2", what, paper, here)
    };
    Ok(vec![
        diagram,
        Row::new("Eqs. 1-4", "The four forces", forces, "the same")
            .why("The low-pass is of first order; the paper states no order."),
        Row::new(
            "Eq. 5",
            "Force of the skin of the thigh, x/(5.4398 - 0.1418 x), at x = 10 mm",
            format!("{:.4} N", 10.0 / (5.4398 - 0.1418 * 10.0)),
            format!("{skin:.4} N"),
        ),
        Row::new("Section 2", "Rates: haptic, model, bandwidth of the filter", "1 kHz, 10 Hz, 10 Hz", rates),
        Row::new("Section 2", "Quantisation of position and of force", "0.3 mm, 0.07 N", steps)
            .why("By rounding to the nearest step; the paper states no rule."),
        ratio("SNR and lag at 1 kHz, the ideal case", "89 dB, less than 1 ms", &q.full).why(
            "The paper's figures equal ten times the natural logarithm of the power ratio and not ten times the decimal \
             one, so the paper probably used the former. An inference. The movement is not stated; here it is \
             10 + 6.5 sin(2 pi 1.2 t) mm.",
        ),
        ratio("SNR and lag of the held force", "43 dB, 49 ms", &q.hold).why("As above."),
        ratio("SNR and lag of the filtered force", "53 dB, 65 ms", &q.low_pass).why("As above."),
        ratio("SNR and lag of the local tangent", "72 dB, less than 1 ms", &q.tangent).why("As above."),
        Row::new("Section 2", "Bandwidth of voluntary movements of a hand", "5-10 Hz", "no experiment")
            .why("The paper quotes it without a measurement."),
        Row::new("Fig. 2", "Interaction with a nonlinear spring in one dimension", "four curves", "drawn below")
            .figure(run.figure(e.haptic_rate_hz)?),
    ])
}

/// Rows of section 3.
pub(super) fn linear_approximation() -> Result<Vec<Row>, LabError> {
    let lattice = UniformLattice { stiffness_n_per_m: 100.0, damping_ratio: 0.7, mass_kg: 1.0 };
    let cube = Block::new([10; 3], DVec3::splat(0.1))?.allow_unconstrained().uniform(&lattice)?;
    let order = (6 * cube.network.free().len()).to_string();
    let built = "linearise, then reduce: SecondOrderSystem::of_body, then a projection or truncation";
    Ok(vec![
        Row::new("Fig. 3", "Construction of the low order model", "a diagram", built),
        Row::new("Section 3", "Order of the dynamics of a 10 x 10 x 10 cube, 1000 x 3 x 2", "6000", order)
            .why("Counted on the network without fixed nodes."),
    ])
}

/// Rows of section 4.
pub(super) fn order_reduction() -> Result<Vec<Row>, LabError> {
    let of = |method| Lattice { method, ..defaults() }.analyse(false);
    let analysis = of(Method::Balanced)?;
    let (r, specimen) = (&analysis.report, &analysis.specimen);
    let (inputs, cells) = (analysis.full.inputs(), specimen.cells);
    let [i, j, _] = specimen.driven()?.map(|n| 100.0 * n as f64 / cells as f64);
    let bound = r.error_bound_n_per_m.unwrap_or(f64::NAN);
    let error = r.hinf_error_n_per_m;
    let near = percent(near_the_tool(&analysis)?);
    let apart = format!("at most {} apart, 10 to 1000 Hz", percent(r.band_relative_error));
    let decibels = format!("{:.0} dB", r.off_diagonal_db.unwrap_or(f64::NAN));
    Ok(vec![
        Row::new("Fig. 4", "Mesh of two dimensions, three edges fixed", "12 x 12", format!("{cells} x {cells} cells"))
            .why(
                "Twelve cells and thirteen nodes along each edge give the order of the paper and a node in the middle.",
            )
            .figure(mesh(&of(Method::Full)?)?),
        Row::new(
            "Section 4",
            "Inputs and outputs; order of the linear system",
            "2, 2; 524",
            format!("{inputs}, {inputs}; {}", r.order),
        ),
        Row::new("Section 4", "Order after balanced reduction", "10", r.reduced_order.to_string()),
        Row::new(
            "Section 4",
            "Infinity norm of the error",
            "less than 1.6e-3",
            format!("{error:.4} N/m; the bound from the Hankel singular values is {bound:.4} N/m"),
        )
        .why(
            "The paper states no stiffness, damping, mass or unit. Here: springs of 200 N/m, dampers of 1.5 times \
             the root of stiffness times mass, masses of 10 g.",
        ),
        Row::new(
            "Section 4",
            "Infinity norm of the error over that of the full model",
            "less than 1 %",
            percent(r.relative_to_proper_peak),
        )
        .why("Of the proper part of the response. The whole response, with a damper at the tool, is unbounded."),
        Row::new("Section 4", "Normal force from tangential displacement", "less than -200 dB", decibels).why(
            "Relative to the normal response, for the worse of the full and the reduced model: zero except for rounding, \
             because the mesh is symmetric.",
        ),
        Row::new("Fig. 5", "Responses of the original and the reduced system", "indistinguishable", apart)
            .figure(svg(&response_panels(&analysis), 2)?),
        Row::new(
            "Fig. 6",
            "Location of the states of the reduced model; coordinate of the input",
            "near the tool, at (50, 0)",
            format!(
                "{near} of the squared displacement in the first two states within a quarter of the width of the \
                 tool, at ({i:.0}, {:.0})",
                100.0 - j
            ),
        )
        .why("Displacements only. The slowest states, third and fourth in size, reach deeper.")
        .figure(states(&analysis)?),
    ])
}

/// Share of the squared displacement of the first two states within a quarter of the width from the tool.
fn near_the_tool(analysis: &Analysis) -> Result<f64, LabError> {
    let lattice = analysis.specimen.lattice()?;
    let tool = lattice.position_m(analysis.specimen.driven()?);
    let width = lattice.position_m([analysis.specimen.cells, 0, 0]).x;
    let states = analysis.state_magnitudes().unwrap_or_default();
    let sum = |near: f64| -> f64 {
        let nodes = lattice.grid().enumerate();
        let nodes = nodes.filter(|(_, ijk)| lattice.position_m(*ijk).distance(tool) <= near);
        nodes.flat_map(|(node, _)| states.iter().take(2).map(move |state| state[node].powi(2))).sum()
    };
    Ok(sum(0.25 * width) / sum(f64::INFINITY))
}
