//! Force over depth: rendered, of the full body, and of the theory.

#![cfg(feature = "panel")]

use super::scene::{Measured, THICKNESS_M, YOUNGS_MODULUS_PA};
use super::{hand, theory};
use bevy::prelude::*;
use bevy_egui::EguiContexts;
use palpate_stage::{Plot, plot_window};

/// Plots the rendered force of the present tip, with that of the full body and of the theory.
pub fn show(mut contexts: EguiContexts, measured: Res<Measured>) -> Result {
    let tip = measured.tip();
    let modulus = theory::reduced_modulus_pa(YOUNGS_MODULUS_PA);
    let deepest = hand::DEPTHS_M[hand::DEPTHS_M.len() - 1];
    let depths = || (0..=40).map(|i| deepest * f64::from(i) / 40.0);
    let half_space = depths().map(|d| [1e3 * d, theory::half_space_n(tip, modulus, d)]).collect();
    let layer = depths()
        .map(|d| [1e3 * d, theory::half_space_n(tip, modulus, d) * theory::layer(tip, THICKNESS_M, d)])
        .collect();
    let rendered =
        measured.curve().iter().map(|pressed| [1e3 * pressed.depth_m, pressed.rendered_n]).collect();
    let full = measured.curve().iter().map(|pressed| [1e3 * pressed.depth_m, pressed.full_n]).collect();
    plot_window(
        &mut contexts,
        &Plot {
            title: tip.name(),
            axes: ["depth, mm", "force, N"],
            lines: &[
                ("half-space", [120, 160, 220], half_space),
                ("full body", [190, 190, 190], full),
                // Drawn over the full body's curve, from which it hardly differs.
                ("layer", [240, 228, 66], layer),
            ],
            points: &[("rendered", [255, 120, 90], rendered)],
        },
    )
}
