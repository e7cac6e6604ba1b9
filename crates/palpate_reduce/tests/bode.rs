//! Frequency responses of local models and of the body.

use glam::DVec3;
use palpate_body::*;
use palpate_local::Scheme;
use palpate_reduce::*;

/// A block of tissue with a sphere at rest 4 mm deep.
fn pressed() -> (Body, ToolContact, ToolPoint) {
    let block = Block::new([5, 5, 5], DVec3::splat(0.1)).unwrap().fix(Face::NegY);
    let block = block.tissue(&Tissue::default()).unwrap();
    let mut body = Body::new(block.network, block.surface).unwrap();
    let mut contact = ToolContact::touch(ToolShape::Sphere { radius_m: 0.005 }, 0.3).unwrap();
    let at = |i: i32| {
        let depth = 4e-5 * f64::from(i.min(100));
        ToolPoint::at_rest(DVec3::new(0.001, 0.0555 - depth, 0.002))
    };
    let path: Vec<ToolPoint> = (0..=400).map(at).collect();
    for from in (0..400).step_by(100) {
        let along = Some((&mut contact, &path[from..=from + 100]));
        body.advance(along, 100, SemiImplicitEuler::default()).unwrap();
    }
    (body, contact, path[400])
}

fn bode(scheme: Scheme) -> Bode {
    let (body, contact, tool) = pressed();
    let hz = Bode::frequencies_hz();
    Bode::compare(&body, &contact, tool, scheme, BuilderOptions::default(), &hz).unwrap().unwrap()
}

#[test]
fn near_field_matches_the_body_and_the_neighbourhood_is_too_stiff() {
    let near = bode(Scheme::NearFieldExact);
    assert_eq!((near.full.len(), near.local.len()), (33, 33));
    assert!(
        (near.full[0].frequency_hz - 0.1).abs() < 1e-9 && (near.full[32].frequency_hz - 1e3).abs() < 1e-9
    );
    assert!(near.along.y > 0.9, "{}", near.along);
    for (full, local) in near.full.iter().zip(&near.local) {
        assert!((full.gain_db - local.gain_db).abs() < 0.5, "{full:?} {local:?}");
        assert!((full.phase_deg - local.phase_deg).abs() < 5.0, "{full:?} {local:?}");
        // The phase of a passive body is between 0° and 180°; dampers make it positive.
        assert!((0.0..180.0).contains(&full.phase_deg), "{full:?}");
    }
    let seed = bode(Scheme::Neighbourhood);
    assert_eq!(seed.full, near.full);
    assert!(seed.local[0].gain_db > seed.full[0].gain_db + 1.0, "{:?} {:?}", seed.local[0], seed.full[0]);
}

#[test]
fn tangent_is_flat_and_exact_at_rest() {
    let bode = bode(Scheme::Tangent);
    let flat = bode.local.iter().all(|p| (p.gain_db - bode.local[0].gain_db).abs() < 1e-9);
    assert!(flat && (bode.local[0].gain_db - bode.full[0].gain_db).abs() < 0.01, "{:?}", bode.local[0]);
}

#[test]
fn no_contact_has_no_response_and_hold_has_no_local_one() {
    let hold = bode(Scheme::Hold);
    assert!(hold.local.is_empty() && hold.full.len() == 33);
    let (body, _, tool) = pressed();
    let apart = ToolContact::touch(ToolShape::Sphere { radius_m: 0.005 }, 0.3).unwrap();
    assert_eq!(Bode::driven_node(&body, &apart), None);
    let options = BuilderOptions::default();
    assert_eq!(Bode::compare(&body, &apart, tool, Scheme::Tangent, options, &[1.0]).unwrap(), None);
}
