//! The loop on bodies of elements against the full body at 1 kHz.

use glam::DVec3;
use palpate_body::*;
use palpate_local::{Sample, Scheme};
use palpate_reduce::*;
use std::f64::consts::TAU;

/// Samples along a movement that presses 10 mm deep and shears 3 mm, with faster movements on top, from `start`.
fn samples(start: DVec3) -> Vec<Sample> {
    let offset = |t: f64| {
        let slow = 0.010 * (1.0 - (TAU * t).cos()) / 2.0;
        DVec3::new(0.003 * (TAU * 1.7 * t).sin(), 0.0, -(slow + 0.0008 * (TAU * 9.0 * t).sin()))
    };
    let sample = |i: u32| {
        let t = f64::from(i) * 1e-3;
        let velocity_m_per_s = (offset(t) - offset((t - 1e-3).max(0.0))) / 1e-3;
        let position_m = start + offset(t);
        Sample { sequence: u64::from(i), time_s: t, position_m, velocity_m_per_s, ..Sample::default() }
    };
    (0..800).map(sample).collect()
}

/// Fills a block with elements.
type Build = fn(&Block, &Tissue) -> Result<BlockBody, BodyError>;

/// Error of the loop whose local models arrive `delay_ticks` late, on a cube whose top is held in the middle, or touched by a ball.
fn error(build: Build, tissue: &Tissue, soft: Option<f64>, is_touched: bool, delay_ticks: usize) -> f64 {
    let block = Block::new([6, 6, 6], DVec3::splat(0.1)).unwrap().fix(Face::NegZ);
    let node = block.node([3, 3, 5]);
    let block = match soft {
        Some(share) => block.region(
            Region::HalfSpace { point_m: DVec3::ZERO, outward: DVec3::Z },
            Tissue { youngs_modulus_pa: share * tissue.youngs_modulus_pa, ..*tissue },
        ),
        None => block,
    };
    let made = build(&block, tissue).unwrap();
    let body = Body::new(made.network, made.surface).unwrap();
    let at = body.positions_m()[node];
    let shape = ToolShape::Sphere { radius_m: 0.01 };
    let (contact, start) = if is_touched {
        (ToolContact::touch(shape, 0.3).unwrap(), at + 0.01 * DVec3::Z)
    } else {
        (ToolContact::hold(&body, node, at).unwrap(), at)
    };
    let options = ComparisonOptions { period_ticks: 50, delay_ticks, ..ComparisonOptions::default() };
    let samples = samples(start);
    let compared = Comparison::run(&body, &contact, &samples, &[Scheme::NearFieldExact], &options).unwrap();
    relative_rms_error(&compared.displayed_n[0].1[200..], &compared.oracle_n[200..]).unwrap()
}

#[test]
fn loop_follows_a_body_of_elements() {
    for (law, nu) in [
        (ElasticLaw::NeoHookean, 0.25),
        (ElasticLaw::NeoHookean, 0.45),
        (ElasticLaw::NeoHookean, 0.49),
        (ElasticLaw::CorotationalLinear, 0.45),
    ] {
        let tissue = Tissue { poissons_ratio: nu, law, ..Tissue::default() };
        for (is_touched, delay, most) in
            [(false, 0, 0.001), (false, 40, 0.002), (true, 0, 0.001), (true, 40, 0.004)]
        {
            let error = error(Block::elements, &tissue, None, is_touched, delay);
            assert!(error < most, "{law:?} {nu}, touched {is_touched}, {delay} ms late: {error}");
        }
    }
}

#[test]
fn loop_follows_a_body_of_tetrahedra() {
    let cases = [
        (ElasticLaw::NeoHookean, 0.25),
        (ElasticLaw::NeoHookean, 0.49),
        (ElasticLaw::CorotationalLinear, 0.45),
    ];
    let mut errors = Vec::new();
    for (law, nu) in cases {
        let tissue = Tissue { poissons_ratio: nu, law, ..Tissue::default() };
        for (is_touched, delay) in [(false, 0), (false, 40), (true, 0), (true, 40)] {
            errors.push(error(Block::tetrahedra, &tissue, None, is_touched, delay));
        }
    }
    assert!(errors.iter().all(|error| *error < 0.007), "{errors:?}");
}

#[test]
fn loop_follows_a_body_whose_lower_half_is_soft() {
    for share in [0.3, 0.1] {
        let error = error(Block::elements, &Tissue::default(), Some(share), false, 0);
        assert!(error < 0.015, "{share}: {error}");
    }
}

#[test]
fn loop_relaxes_as_the_body() {
    let relaxation =
        Relaxation::new(&[PronyTerm { share: 0.3, time_s: 0.05 }, PronyTerm { share: 0.2, time_s: 0.4 }]);
    let tissue = Tissue { relaxation: relaxation.unwrap(), ..Tissue::default() };
    // Beyond the nodes under the tool no stress relaxes between two model steps, which are as far apart as the shorter time.
    for (build, is_touched, most) in [
        (Block::elements as Build, false, 0.015),
        (Block::elements, true, 0.02),
        (Block::tetrahedra, false, 0.015),
        (Block::tetrahedra, true, 0.02),
    ] {
        let error = error(build, &tissue, None, is_touched, 0);
        assert!(error < most, "touched {is_touched}: {error}");
    }
}

#[test]
fn loop_is_damped_as_the_body() {
    let families: [(&str, Build, f64); 3] = [
        ("springs", Block::tissue, 0.005),
        ("hexahedra", Block::elements, 0.005),
        ("tetrahedra", Block::tetrahedra, 0.007),
    ];
    for damping in [
        Damping::Rayleigh { mass_per_s: 20.0, stiffness_s: 2e-3 },
        Damping::LossFactor { loss_factor: 0.3, frequency_hz: 10.0 },
    ] {
        let tissue = Tissue { damping, ..Tissue::default() };
        for (family, build, most) in families {
            for is_touched in [false, true] {
                let error = error(build, &tissue, None, is_touched, 0);
                assert!(error < most, "{family}, {damping:?}, touched {is_touched}: {error}");
            }
        }
    }
}
