use super::*;
use glam::DQuat;

const LAWS: [ElasticLaw; 2] = [ElasticLaw::CorotationalLinear, ElasticLaw::NeoHookean];
const POISSONS_RATIOS: [f64; 4] = [0.0, 0.25, 0.45, 0.49];
const E_PA: f64 = 20e3;

fn of(nu: f64) -> LameParameters {
    LameParameters::new(E_PA, nu).unwrap()
}

fn turn(seed: f64) -> DMat3 {
    DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 1.3 * seed, 0.7 - seed, 2.1 * seed * seed))
}

/// Stretched, compressed, sheared, flat and inverted, in several directions.
fn gradients() -> Vec<DMat3> {
    let values = [
        DVec3::new(1.0, 1.0, 1.0),
        DVec3::new(1.3, 1.1, 0.8),
        DVec3::new(2.0, 0.7, 0.71),
        DVec3::new(1.0, 0.9, 0.4),
        DVec3::new(1.1, 0.9, 0.2),
        DVec3::new(1.2, 0.8, -0.3),
        DVec3::new(2.5, 2.0, -1.5),
    ];
    values
        .iter()
        .enumerate()
        .map(|(i, s)| turn(0.2 + i as f64) * DMat3::from_diagonal(*s) * turn(0.9 * i as f64))
        .collect()
}

fn moved(f: &DMat3, column: usize, row: usize, by: f64) -> DMat3 {
    let mut moved = *f;
    moved.col_mut(column)[row] += by;
    moved
}

#[test]
fn stress_is_the_derivative_of_the_energy_and_the_tangent_that_of_the_stress() {
    let h = 1e-6;
    for (law, nu, f) in LAWS
        .into_iter()
        .flat_map(|law| POISSONS_RATIOS.map(|nu| (law, nu)))
        .flat_map(|(law, nu)| gradients().into_iter().map(move |f| (law, nu, f)))
    {
        let (of, stress, tangent) = (of(nu), law.stress(&f, of(nu)), law.tangent(&f, of(nu), false));
        let size = law.stiffness_bound(&f, of);
        for (d, row) in (0..3).flat_map(|d| (0..3).map(move |row| (d, row))) {
            let [up, down] = [h, -h].map(|by| moved(&f, d, row, by));
            let slope = (law.energy(&up, of) - law.energy(&down, of)) / (2.0 * h);
            assert!((slope - stress.col(d)[row]).abs() < 1e-8 * size, "{law:?} {nu}: {slope}, {stress}");
            let change = (law.stress(&up, of) - law.stress(&down, of)) * (0.5 / h);
            for (c, of_column) in tangent.iter().enumerate() {
                let exact = of_column[d].col(row);
                assert!((change.col(c) - exact).length() < 1e-8 * size, "{law:?} {nu} {f}");
            }
        }
    }
}

#[test]
fn tangent_is_below_its_bound_and_its_clamped_part_is_positive() {
    let form = |tangent: &StressTangent, g: &DMat3| -> f64 {
        (0..3)
            .flat_map(|c| (0..3).map(move |d| (c, d)))
            .map(|(c, d)| g.col(c).dot(tangent[c][d] * g.col(d)))
            .sum()
    };
    for (law, nu) in LAWS.into_iter().flat_map(|law| POISSONS_RATIOS.map(|nu| (law, nu))) {
        for f in gradients() {
            let [exact, clamped] = [false, true].map(|clamped| law.tangent(&f, of(nu), clamped));
            let bound = law.stiffness_bound(&f, of(nu));
            for seed in 0..50 {
                let number = |i: u32| f64::from((seed * 7919 + i * 104_729 + 13) % 1009) / 504.5 - 1.0;
                let g = DMat3::from_cols_array(&std::array::from_fn(|i| number(i as u32)));
                let (exact, clamped) = (form(&exact, &g), form(&clamped, &g));
                assert!(exact <= bound * inner(&g, &g), "{law:?} {nu} {f}");
                assert!(clamped >= -1e-9 * bound && clamped >= exact - 1e-9 * bound, "{law:?} {nu} {f}");
            }
        }
    }
}

#[test]
fn rotation_gives_no_stress_and_stress_turns_with_the_body() {
    for (law, nu) in LAWS.into_iter().flat_map(|law| POISSONS_RATIOS.map(|nu| (law, nu))) {
        let stress = law.stress(&turn(1.7), of(nu));
        assert!(stress.to_cols_array().iter().all(|p| p.abs() < 1e-9 * E_PA));
        assert!(law.energy(&turn(1.7), of(nu)).abs() < 1e-12 * E_PA);
        for f in gradients() {
            let (turned, expected) =
                (law.stress(&(turn(0.8) * f), of(nu)), turn(0.8) * law.stress(&f, of(nu)));
            let size = law.stiffness_bound(&f, of(nu));
            assert!((turned - expected).to_cols_array().iter().all(|p| p.abs() < 1e-11 * size));
        }
    }
}

/// Case 1 of the reference: a bar under uniaxial stress at ν 0.45, nominal stress in Pa.
#[test]
fn uniaxial_stress_is_the_closed_form() {
    for (s, lateral, nominal_pa) in [
        (0.7, 1.170_852_546_927_761, -8_678.775_237_903_694),
        (1.5, 0.830_678_980_802_930_2, 7_172.287_038_400_945),
    ] {
        let f = DMat3::from_diagonal(DVec3::new(s, lateral, lateral));
        let stress = ElasticLaw::NeoHookean.stress(&f, of(0.45));
        assert!((stress.x_axis.x / nominal_pa - 1.0).abs() < 1e-12);
        assert!(stress.y_axis.y.abs() < 1e-9 * E_PA);
        let lateral = 1.0 - 0.45 * (s - 1.0);
        let f = turn(2.0) * DMat3::from_diagonal(DVec3::new(lateral, s, lateral));
        let stress = turn(2.0).transpose() * ElasticLaw::CorotationalLinear.stress(&f, of(0.45));
        assert!((stress.y_axis.y / (E_PA * (s - 1.0)) - 1.0).abs() < 1e-12);
        assert!(stress.x_axis.x.abs() < 1e-9 * E_PA);
    }
}

#[test]
fn logarithm_and_its_continuation_have_their_derivatives() {
    let h = 1e-6;
    let mut before = 0.0;
    for step in 0..4000 {
        let s = 1.0 - 0.005 * f64::from(step) - 1e-4;
        let (_, slope, curvature) = logarithm(s);
        let difference = (logarithm(s + h).0 - logarithm(s - h).0) / (2.0 * h);
        assert!((difference / slope - 1.0).abs() < 1e-7, "{s}");
        let difference = (logarithm(s + h).1 - logarithm(s - h).1) / (2.0 * h);
        assert!((difference - curvature).abs() < 1e-4 && curvature < 0.0, "{s}");
        // The slope grows to its limit.
        assert!(slope > before && slope < (1.0 + TO_LIMIT / FLAT) / FLAT, "{s}");
        before = slope;
        let apart = slope_of_slope(s, s + 1e-5);
        assert!((apart / slope_of_slope(s, s + 1e-9) - 1.0).abs() < 1e-3, "{s}");
    }
    assert!((logarithm(-1e9).1 * FLAT / (1.0 + TO_LIMIT / FLAT) - 1.0).abs() < 1e-8);
}

#[test]
fn parameters_outside_their_range_are_rejected() {
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(LameParameters::new(bad, 0.3), Err(LawError::YoungsModulus(_))));
    }
    for bad in [-0.01, 0.491, 0.5, f64::NAN] {
        assert!(matches!(LameParameters::new(1.0, bad), Err(LawError::PoissonsRatio(_))));
    }
    let of = of(0.25);
    assert!(
        (of.mu - 8e3).abs() < 1e-9 && (of.lambda - 8e3).abs() < 1e-9 && (of.bulk() - E_PA / 1.5).abs() < 1e-8
    );
}
