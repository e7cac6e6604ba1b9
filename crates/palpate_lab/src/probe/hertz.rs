//! The closed forms of an indentation of an elastic half-space without friction (K. L. Johnson, Contact Mechanics, 1985,
//! sections 3.4 and 4.2).

use super::options::Tool;

/// E* = E / (1 − ν²), Pa, of tissue with Young's modulus E, Pa, and Poisson's ratio ν under a rigid tool.
fn reduced_modulus_pa((youngs_pa, poissons_ratio): (f64, f64)) -> f64 {
    youngs_pa / (1.0 - poissons_ratio * poissons_ratio)
}

/// Force on `tool`, N, when it is pressed by `depth_m` into a half-space of tissue with Young's modulus, Pa, and Poisson's ratio: Hertz's for a
/// sphere, continued beyond a depth of its radius with the slope there; that of a flat punch for a punch.
pub(super) fn force_n(tool: Tool, tissue: (f64, f64), depth_m: f64) -> f64 {
    let modulus = reduced_modulus_pa(tissue);
    match tool {
        Tool::Sphere { radius_m } => {
            let (within, beyond) = (depth_m.min(radius_m), (depth_m - radius_m).max(0.0));
            4.0 / 3.0 * modulus * radius_m.sqrt() * within.powf(1.5) + 2.0 * modulus * radius_m * beyond
        }
        Tool::Punch { radius_m } => 2.0 * radius_m * modulus * depth_m,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sphere_force_and_slope_are_continuous_at_its_radius() {
        let tool = Tool::Sphere { radius_m: 0.005 };
        let force = |depth| force_n(tool, (20e3, 0.25), depth);
        // 4/3 · 20 kPa/0.9375 · R².
        assert!((force(0.005) - 4.0 / 3.0 * 20e3 / 0.9375 * 2.5e-5).abs() < 1e-12);
        let (below, above) = (force(0.005) - force(0.005 - 1e-8), force(0.005 + 1e-8) - force(0.005));
        assert!((below / above - 1.0).abs() < 1e-5, "{below}, {above}");
    }

    #[test]
    fn punch_force_is_proportional_to_depth() {
        let tool = Tool::Punch { radius_m: 0.005 };
        assert!((force_n(tool, (20e3, 0.25), 0.002) - 2.0 * 0.005 * 20e3 / 0.9375 * 0.002).abs() < 1e-15);
    }
}
