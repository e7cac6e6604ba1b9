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

/// A hand that presses and wipes at `start`.
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

/// A block whose node is held, and where the hand is.
fn held() -> (Body, ToolContact, DVec3) {
    let (body, node) = (block(), 1 + 4 * (1 + 4 * 3));
    let start = body.positions_m()[node];
    let contact = ToolContact::hold(&body, node, start).unwrap();
    (body, contact, start)
}

/// A body of a mesh, an octahedron with its lower half held, and a sphere at its upper tip.
fn touched_mesh() -> (Body, ToolContact, DVec3) {
    let corners = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z].map(|x| 0.06 * x);
    let triangles = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    let mesh = ClosedMesh::new(corners.to_vec(), triangles.to_vec()).unwrap();
    let held = Region::HalfSpace { point_m: DVec3::Z * -0.01, outward: DVec3::Z };
    let lattice = CellLattice::fit(&mesh, CellSize::Along(7)).unwrap().fix(held);
    let made = lattice.tissue(&Tissue::default()).unwrap();
    let contact = ToolContact::touch(ToolShape::Sphere { radius_m: 0.006 }, 0.3).unwrap();
    (Body::new(made.network, made.surface).unwrap(), contact, DVec3::new(0.001, 0.002, 0.066))
}

/// The schemes beside a loop whose local models arrive `delay` ticks after their sample, tick by tick.
fn shadowed(
    (mut body, mut contact, start): (Body, ToolContact, DVec3),
    schemes: &[Scheme],
    delay: u64,
) -> Vec<Vec<(u64, DVec3)>> {
    let samples = hand(start);
    let capacity = LocalModelBuilder::new(&body, BuilderOptions::of(&body)).unwrap().capacity();
    let settings = HandOverSettings { capacity, ..HandOverSettings::default() };
    let mut shadow: Option<SchemeComparison> = None;
    let mut forces = vec![Vec::new(); schemes.len()];
    for newest in (50..=400).step_by(50) {
        let path: Vec<ToolPoint> = samples[newest - 50..=newest]
            .iter()
            .map(|s| ToolPoint { position_m: s.position_m, velocity_m_per_s: s.velocity_m_per_s })
            .collect();
        body.advance(Some((&mut contact, &path)), 50, SemiImplicitEuler::default()).unwrap();
        let oldest = if newest == 50 { 0 } else { newest - 49 };
        let built = newest as u64 - 50;
        let moment = StepInput {
            body: body.clone(),
            contact: contact.clone(),
            beside: Vec::new(),
            samples: samples[oldest..=newest].to_vec(),
            adopted: if built > 0 { vec![(built, built + delay)] } else { Vec::new() },
            id: ModelId { body: 7, epoch: 1, sequence: newest as u64 },
        };
        let shadow = shadow.get_or_insert_with(|| SchemeComparison::new(&moment, schemes, settings).unwrap());
        assert!(shadow.fits(&moment, schemes));
        for (forces, (_, told)) in forces.iter_mut().zip(shadow.step(&moment)) {
            forces.extend(told.unwrap());
        }
    }
    forces
}

#[test]
fn a_scheme_that_does_not_run_displays_what_it_would_display_if_it_ran() {
    for delay in [1, 40] {
        let (body, contact, start) = held();
        let (forces, samples) = (shadowed(held(), &Scheme::ALL, delay), hand(start));
        let options = ComparisonOptions { delay_ticks: delay as usize, ..ComparisonOptions::default() };
        let expected = Comparison::run(&body, &contact, &samples, &Scheme::ALL, &options).unwrap();
        for (scheme, forces) in Scheme::ALL.into_iter().zip(forces) {
            let displayed = expected.displayed(scheme).unwrap();
            // Before the first local model nothing is said, and what has missed more than eight samples catches up first.
            let first = 50 + delay + if scheme.has_state() { delay / 9 } else { 0 };
            assert_eq!(forces.first().unwrap().0, first, "{scheme}");
            assert_eq!(forces.len() as u64, 400 - first + 1, "{scheme}");
            for (sequence, force_n) in forces {
                assert_eq!(force_n, displayed[sequence as usize], "{scheme}, delay {delay}, tick {sequence}");
            }
        }
    }
}

/// With the support set and the order that a body of a mesh has in the loop: with those of a block it would be another scheme.
#[test]
fn on_a_mesh_a_scheme_displays_what_it_would_display_if_it_ran() {
    let (body, contact, start) = touched_mesh();
    let (schemes, delay) = ([Scheme::NearFieldExact, Scheme::Tangent], 2);
    let forces = shadowed(touched_mesh(), &schemes, delay);
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
fn a_scheme_that_cannot_be_had_says_why_and_the_others_go_on() {
    let body = block();
    let node = 1 + 4 * (1 + 4 * 3);
    let start = body.positions_m()[node];
    let contact = ToolContact::hold(&body, node, start).unwrap();
    // No room for a neighbourhood.
    let settings =
        HandOverSettings { capacity: palpate_local::Capacity::of_order(3), ..HandOverSettings::default() };
    let moment = |newest: u64| StepInput {
        body: body.clone(),
        contact: contact.clone(),
        beside: Vec::new(),
        samples: hand(start)[newest as usize - 49..=newest as usize].to_vec(),
        adopted: vec![(newest - 50, newest - 49)],
        id: ModelId { body: 7, epoch: 1, sequence: newest },
    };
    let schemes = [Scheme::Neighbourhood, Scheme::Tangent];
    let mut shadow = SchemeComparison::new(&moment(50), &schemes, settings).unwrap();
    shadow.step(&moment(50));
    let told = shadow.step(&moment(100));
    let why = told[0].1.as_ref().unwrap_err();
    assert!(why.contains("local model"), "{why}");
    assert_eq!(told[1].1.as_ref().unwrap().len(), 50);
    let other = StepInput { id: ModelId { body: 7, epoch: 2, sequence: 150 }, ..moment(150) };
    assert!(shadow.fits(&moment(150), &schemes));
    assert!(!shadow.fits(&other, &schemes) && !shadow.fits(&moment(150), &schemes[1..]));
    // A step was left out.
    assert!(!shadow.fits(&moment(200), &schemes));
}
