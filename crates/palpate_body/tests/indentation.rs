//! Balls and flat punches on a layer against closed forms of elasticity.

use glam::DVec3;
use palpate_body::*;

const E_PA: f64 = 20e3;
/// Thickness of the layer.
const H: f64 = 0.06;
/// Width of the layer as a multiple of its thickness.
const WIDTH: f64 = 3.0;

/// A layer with `n` cubic cells through its thickness and a fixed bottom.
fn layer(n: usize) -> Body {
    let across = (WIDTH * n as f64) as usize;
    let size = DVec3::new(WIDTH * H, WIDTH * H, H);
    let block = Block::new([across + 1, across + 1, n + 1], size).unwrap().fix(Face::NegZ);
    let tissue = Tissue { youngs_modulus_pa: E_PA, damping: Damping::Ratio(0.5), ..Tissue::default() };
    let made = block.tissue(&tissue).unwrap();
    Body::new(made.network, made.surface).unwrap()
}

/// Presses `shape`, whose lowest point is `low_m` below its position, `depth_m` into the layer with `n` cells and
/// waits for rest. Returns the force, N.
fn indent(n: usize, shape: ToolShape, low_m: f64, depth_m: f64) -> f64 {
    let (mut body, mut tool) = (layer(n), ToolContact::touch(shape, 0.0).unwrap());
    let at = |share: f64| ToolPoint::at_rest(DVec3::Z * (0.5 * H + low_m + 1e-6 - share * (depth_m + 1e-6)));
    let down: Vec<ToolPoint> = (0..=50).map(|i| at(f64::from(i) / 50.0)).collect();
    body.advance(Some((&mut tool, &down)), 50, SemiImplicitEuler::default()).unwrap();
    let mut force = f64::NAN;
    loop {
        let stay = vec![at(1.0); 51];
        let report = body.advance(Some((&mut tool, &stay)), 50, SemiImplicitEuler::default()).unwrap();
        assert_eq!((report.left_out, report.unconverged), (0, 0));
        let now = tool.displayed_force_n(&body).z;
        if (now - force).abs() < 1e-4 * now {
            return now;
        }
        force = now;
    }
}

/// E* = E/(1 - nu²) with Poisson's ratio 1/4: the tool is rigid.
fn reduced_modulus_pa() -> f64 {
    E_PA / (1.0 - 1.0 / 16.0)
}

/// The layer is stiffer than the half-space of the formulas, because its bottom is fixed: E. K. Dimitriadis, F.
/// Horkay, J. Maresca, B. Kachar, R. S. Chadwick, Biophys. J. 82 (2002) 2798, bonded case, for a contact radius of
/// chi times the thickness. Returns alpha_0 and beta_0.
fn bonded(nu: f64) -> (f64, f64) {
    let alpha = -(1.2876 - 1.4678 * nu + 1.3442 * nu * nu) / (1.0 - nu);
    (alpha, (0.6387 - 1.0277 * nu + 1.5164 * nu * nu) / (1.0 - nu))
}

#[test]
fn ball_on_a_layer_matches_hertz() {
    let pi = std::f64::consts::PI;
    // A contact of 0.22 of the thickness: about 1, 2 and 3 cells.
    let a = 0.22 * H;
    let radius = 8.0 * a;
    let depth = a * a / radius;
    let hertz = 4.0 / 3.0 * reduced_modulus_pa() * radius.sqrt() * depth.powf(1.5);
    let ((alpha, beta), chi) = (bonded(0.25), (radius * depth).sqrt() / H);
    let layer = 1.0 - 2.0 * alpha / pi * chi + 4.0 * (alpha / pi * chi).powi(2)
        - 8.0 / pi.powi(3) * (alpha.powi(3) + 4.0 * pi * pi / 15.0 * beta) * chi.powi(3)
        + 16.0 * alpha / pi.powi(4) * (alpha.powi(3) + 0.6 * pi * pi * beta) * chi.powi(4);
    let error = |n| indent(n, ToolShape::Sphere { radius_m: radius }, radius, depth) / (hertz * layer) - 1.0;
    let errors = [4, 8, 12].map(error);
    // Measured: -1.2 %, -1.6 %, -1.5 %.
    assert!(errors.iter().all(|error| error.abs() < 0.03), "{errors:?}");
}

#[test]
fn flat_punch_on_a_layer_matches_boussinesq() {
    // Radii of 1, 2 and 3 cells. To first order the mean effect of the bottom is as for the ball.
    let a = 0.25 * H;
    let depth = 0.05 * a;
    let flat = 2.0 * reduced_modulus_pa() * a * depth;
    let layer = 1.0 / (1.0 + 2.0 * bonded(0.25).0 / std::f64::consts::PI * a / H);
    let punch = ToolShape::FlatPunch { radius_m: a, axis: -DVec3::Z };
    let errors = [4, 8, 12].map(|n| indent(n, punch, 0.0, depth) / (flat * layer) - 1.0);
    // Measured: -2 %, 3 %, 3 %.
    assert!(errors.iter().all(|error| error.abs() < 0.04), "{errors:?}");
}

#[test]
fn wider_layer_gives_the_same_force() {
    // A layer twice as wide gives the same force to 1 %: the remaining error is not due to the width.
    let force = |width: f64| {
        let cells = 4;
        let across = (width * f64::from(cells)) as usize;
        let size = DVec3::new(width * H, width * H, H);
        let block = Block::new([across + 1, across + 1, cells as usize + 1], size).unwrap().fix(Face::NegZ);
        let tissue = Tissue { youngs_modulus_pa: E_PA, damping: Damping::Ratio(0.5), ..Tissue::default() };
        let made = block.tissue(&tissue).unwrap();
        let mut body = Body::new(made.network, made.surface).unwrap();
        let mut tool =
            ToolContact::touch(ToolShape::FlatPunch { radius_m: 0.25 * H, axis: -DVec3::Z }, 0.0).unwrap();
        let path: Vec<ToolPoint> = (0..=1000)
            .map(|i| ToolPoint::at_rest(DVec3::Z * (0.5 * H - 0.001 * (f64::from(i) / 50.0).min(1.0))))
            .collect();
        body.advance(Some((&mut tool, &path)), 1000, SemiImplicitEuler::default()).unwrap();
        tool.displayed_force_n(&body).z
    };
    let (narrow, wide) = (force(WIDTH), force(2.0 * WIDTH));
    assert!((narrow / wide - 1.0).abs() < 0.01, "{narrow} N, {wide} N");
}
