//! Force over depth, as it is measured.

#![cfg(feature = "panel")]

use crate::scene::{Measured, THICKNESS_M, YOUNGS_MODULUS_PA};
use crate::{hand, theory};
use bevy::prelude::*;
use bevy_egui::EguiContexts;
use palpate_stage::{Plot, plot_window};

/// Shows the curve of the tip that presses now beside what the theory says of it.
pub fn show(mut contexts: EguiContexts, measured: Res<Measured>) -> Result {
    let tip = measured.tip();
    let modulus = theory::reduced_modulus_pa(YOUNGS_MODULUS_PA);
    let deepest = hand::DEPTHS_M[hand::DEPTHS_M.len() - 1];
    let depths = || (0..=40).map(|i| deepest * f64::from(i) / 40.0);
    let half_space = depths().map(|d| [1e3 * d, theory::half_space_n(tip, modulus, d)]).collect();
    let layer = depths()
        .map(|d| [1e3 * d, theory::half_space_n(tip, modulus, d) * theory::layer(tip, THICKNESS_M, d)])
        .collect();
    let felt = measured.curve().iter().map(|[depth_m, force_n]| [1e3 * depth_m, *force_n]).collect();
    plot_window(
        &mut contexts,
        &Plot {
            title: tip.name(),
            axes: ["depth, mm", "force, N"],
            lines: &[("half-space", [120, 160, 220], half_space), ("layer", [240, 228, 66], layer)],
            points: &[("measured", [255, 120, 90], felt)],
        },
    )
}
