use super::*;
use palpate_body::{
    Block, CellLattice, CellSize, ClosedMesh, Face, Region, SemiImplicitEuler, Tissue, ToolShape,
    UniformLattice,
};
use palpate_reduce::{Comparison, ComparisonOptions};

fn block() -> Body {
    let lattice = UniformLattice { stiffness_n_per_m: 100.0, damping_ratio: 0.7, mass_kg: 1.0 };
    let block = Block::new([4, 4, 4], DVec3::splat(0.1)).unwrap().fix(Face::NegZ).uniform(&lattice).unwrap();
    Body::new(block.network, block.surface).unwrap()
}

/// Samples of a motion that presses and slides at `start`.
fn hand(start: DVec3) -> Vec<Sample> {
    let position = |t: f64| start - DVec3::new(0.002 * (17.0 * t).sin(), 0.0, 0.006 * (10.0 * t).sin());
    (0..=400)
        .map(|i| {
            let t = f64::from(i) * 1e-3;
            Sample {
                sequence: i as u64,
                position_m: position(t),
                velocity_m_per_s: (position(t) - position(t - 1e-3)) / 1e-3,
                ..Sample::default()
            }
        })
        .collect()
}

/// A block with a held node, and the position of the node.
fn held() -> (Body, ToolContact, DVec3) {
    let (body, node) = (block(), 1 + 4 * (1 + 4 * 3));
    let start = body.positions_m()[node];
    let contact = ToolContact::hold(&body, node, start).unwrap();
    (body, contact, start)
}

/// A body from a mesh, an octahedron with its lower half fixed, and a sphere at its upper tip.
fn touched_mesh() -> (Body, ToolContact, DVec3) {
    let corners = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z].map(|x| 0.06 * x);
    let triangles = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    let mesh = ClosedMesh::new(corners.to_vec(), triangles.to_vec()).unwrap();
    let held = Region::HalfSpace { point_m: DVec3::Z * -0.01, outward: DVec3::Z };
    let lattice = CellLattice::fit(&mesh, CellSize::Along(7)).unwrap().fix(held);
    let built = lattice.tissue(&Tissue::default()).unwrap();
    let contact = ToolContact::touch(ToolShape::Sphere { radius_m: 0.006 }, 0.3).unwrap();
    (Body::new(built.network, built.surface).unwrap(), contact, DVec3::new(0.001, 0.002, 0.066))
}

/// Forces of the schemes tick by tick, for a loop whose local models arrive `delay` ticks after their sample.
fn compared(
    (mut body, mut contact, start): (Body, ToolContact, DVec3),
    schemes: &[Scheme],
    delay: u64,
) -> Vec<Vec<(u64, DVec3)>> {
    let samples = hand(start);
    let capacity = LocalModelBuilder::new(&body, BuilderOptions::of(&body)).unwrap().capacity();
    let settings = HandOverSettings { capacity, ..HandOverSettings::default() };
    let mut comparison: Option<SchemeComparison> = None;
    let mut forces = vec![Vec::new(); schemes.len()];
    for newest in (50..=400).step_by(50) {
        let path: Vec<ToolPoint> = samples[newest - 50..=newest]
            .iter()
            .map(|s| ToolPoint { position_m: s.position_m, velocity_m_per_s: s.velocity_m_per_s })
            .collect();
        body.advance(Some((&mut contact, &path)), 50, SemiImplicitEuler::default()).unwrap();
        let oldest = if newest == 50 { 0 } else { newest - 49 };
        let built = newest as u64 - 50;
        let input = StepInput {
            body: body.clone(),
            contact: contact.clone(),
            others: Vec::new(),
            samples: samples[oldest..=newest].to_vec(),
            adopted: if built > 0 { vec![(built, built + delay)] } else { Vec::new() },
            id: ModelId { body: 7, epoch: 1, sequence: newest as u64 },
        };
        let comparison =
            comparison.get_or_insert_with(|| SchemeComparison::new(&input, schemes, settings).unwrap());
        assert!(comparison.fits(&input, schemes));
        for (forces, (_, new)) in forces.iter_mut().zip(comparison.step(&input)) {
            forces.extend(new.unwrap());
        }
    }
    forces
}

#[test]
fn compared_schemes_render_the_forces_of_running_ones() {
    for delay in [1, 40] {
        let (body, contact, start) = held();
        let (forces, samples) = (compared(held(), &Scheme::ALL, delay), hand(start));
        let options = ComparisonOptions { delay_ticks: delay as usize, ..ComparisonOptions::default() };
        let expected = Comparison::run(&body, &contact, &samples, &Scheme::ALL, &options).unwrap();
        for (scheme, forces) in Scheme::ALL.into_iter().zip(forces) {
            let displayed = expected.displayed(scheme).unwrap();
            // No force before the first local model; a model that is more than eight samples late catches up first.
            let first = 50 + delay + if scheme.has_state() { delay / 9 } else { 0 };
            assert_eq!(forces.first().unwrap().0, first, "{scheme}");
            assert_eq!(forces.len() as u64, 400 - first + 1, "{scheme}");
            for (sequence, force_n) in forces {
                assert_eq!(force_n, displayed[sequence as usize], "{scheme}, delay {delay}, tick {sequence}");
            }
        }
    }
}

/// Uses the support set and the order of a mesh body in the loop, which differ from those of a block.
#[test]
fn compared_schemes_render_the_forces_of_running_ones_on_a_mesh() {
    let (body, contact, start) = touched_mesh();
    let (schemes, delay) = ([Scheme::NearFieldExact, Scheme::Tangent], 2);
    let forces = compared(touched_mesh(), &schemes, delay);
    let builder = BuilderOptions::of(&body);
    assert_ne!(builder, BuilderOptions::default());
    let options = ComparisonOptions { builder, delay_ticks: delay as usize, ..ComparisonOptions::default() };
    let expected = Comparison::run(&body, &contact, &hand(start), &schemes, &options).unwrap();
    for (scheme, forces) in schemes.into_iter().zip(forces) {
        let displayed = expected.displayed(scheme).unwrap();
        let strongest = forces.iter().map(|(_, force_n)| force_n.length()).fold(0.0, f64::max);
        assert!(forces.len() > 300 && strongest > 0.05, "{scheme}: {} forces, {strongest} N", forces.len());
        for (sequence, force_n) in forces {
            assert_eq!(force_n, displayed[sequence as usize], "{scheme}, tick {sequence}");
        }
    }
}

#[test]
fn rejected_scheme_reports_the_reason_and_the_others_continue() {
    let body = block();
    let node = 1 + 4 * (1 + 4 * 3);
    let start = body.positions_m()[node];
    let contact = ToolContact::hold(&body, node, start).unwrap();
    // No capacity for a neighbourhood.
    let settings =
        HandOverSettings { capacity: palpate_local::Capacity::of_order(3), ..HandOverSettings::default() };
    let input = |newest: u64| StepInput {
        body: body.clone(),
        contact: contact.clone(),
        others: Vec::new(),
        samples: hand(start)[newest as usize - 49..=newest as usize].to_vec(),
        adopted: vec![(newest - 50, newest - 49)],
        id: ModelId { body: 7, epoch: 1, sequence: newest },
    };
    let schemes = [Scheme::Neighbourhood, Scheme::Tangent];
    let mut comparison = SchemeComparison::new(&input(50), &schemes, settings).unwrap();
    comparison.step(&input(50));
    let results = comparison.step(&input(100));
    let reason = results[0].1.as_ref().unwrap_err();
    assert!(reason.contains("local model"), "{reason}");
    assert_eq!(results[1].1.as_ref().unwrap().len(), 50);
    let other = StepInput { id: ModelId { body: 7, epoch: 2, sequence: 150 }, ..input(150) };
    assert!(comparison.fits(&input(150), &schemes));
    assert!(!comparison.fits(&other, &schemes) && !comparison.fits(&input(150), &schemes[1..]));
    // A missing step.
    assert!(!comparison.fits(&input(200), &schemes));
}
