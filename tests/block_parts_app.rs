//! Inclusions and slits of blocks: inserted, removed and rejected.

use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{BodyRegion, BodyState, HapticFaultKind, Inclusion, Inclusions, SimulatedBody, Slit};
use palpate_body::BodyError;
use palpate_tests::app::Contact::Start;
use palpate_tests::app::{
    assert_no_faults, contacts, force_n, lockstep_app, pressing_hand, spawn_block, spawn_scene, step,
    take_kinds,
};

/// A lump below the place at which [`pressing_hand`] presses.
fn lump(youngs_modulus_pa: f64) -> Inclusions {
    let region = BodyRegion::Sphere { center_m: DVec3::new(0.012, 0.03, 0.009), radius_m: 0.015 };
    Inclusions(vec![Inclusion { region, tissue: Tissue { youngs_modulus_pa, ..default() } }])
}

/// Force after 0.6 s, where the hand is deepest, with `change` applied to the body at the start and after 0.4 s, N.
fn pressed_n(start: impl Fn(&mut EntityWorldMut), later: impl Fn(&mut EntityWorldMut)) -> f64 {
    let mut app = lockstep_app();
    let (body, tool) = spawn_scene(&mut app, Scheme::NearFieldExact, pressing_hand);
    start(&mut app.world_mut().entity_mut(body));
    step(&mut app, 8);
    assert_eq!(contacts(&app), [Start]);
    later(&mut app.world_mut().entity_mut(body));
    step(&mut app, 4);
    assert_eq!(contacts(&app), [Start], "the contact does not end");
    assert_no_faults(&mut app);
    force_n(&app, tool).y
}

#[test]
fn lump_in_a_block_raises_the_force_until_it_is_removed() {
    let insert = |body: &mut EntityWorldMut| {
        body.insert(lump(200e3));
    };
    let remove = |body: &mut EntityWorldMut| {
        body.remove::<Inclusions>();
    };
    let nothing = |_: &mut EntityWorldMut| ();
    let plain_n = pressed_n(nothing, nothing);
    let stiff_n = pressed_n(insert, nothing);
    assert!(stiff_n > 1.15 * plain_n, "{stiff_n} N, {plain_n} N without");
    // The removal during contact leaves the motion of the tissue: the force differs slightly.
    let removed_n = pressed_n(insert, remove);
    assert!((removed_n / plain_n - 1.0).abs() < 0.02, "{removed_n} N, {plain_n} N without");
    let inserted_n = pressed_n(nothing, insert);
    assert!((inserted_n / stiff_n - 1.0).abs() < 0.02, "{inserted_n} N, {stiff_n} N");
}

#[test]
fn removed_slit_leaves_a_whole_block() {
    let mut app = lockstep_app();
    let block = DeformableBody::block_of_size([5, 6, 11], DVec3::new(0.08, 0.1, 0.2));
    let slit = Slit { length_m: 0.12, depth_m: 0.04, opening_m: 0.004 };
    let body = app.world_mut().spawn((block, slit, FixedRegion::Face(BoxFace::Bottom), lump(40e3))).id();
    let nodes = |app: &App| app.world().get::<SimulatedBody>(body).unwrap().body().network().node_count();
    step(&mut app, 1);
    assert!(nodes(&app) > 330);
    app.world_mut().entity_mut(body).remove::<Slit>();
    step(&mut app, 1);
    assert_eq!(nodes(&app), 330);
    assert_no_faults(&mut app);
}

#[test]
fn block_has_the_bounds_of_a_mesh() {
    for (edge_m, is_valid) in [(100.0, false), (9.9, true), (1.1e-3, true), (0.9e-3, false)] {
        let mut app = lockstep_app();
        let body = app
            .world_mut()
            .spawn((DeformableBody::block([3; 3], edge_m), FixedRegion::Face(BoxFace::Bottom)));
        let body = body.id();
        step(&mut app, 1);
        let is_ready = app.world().get::<BodyState>(body) == Some(&BodyState::Ready);
        assert_eq!(is_ready, is_valid, "{edge_m} m");
        let rejected = take_kinds(&mut app);
        let is_size = |kind: &HapticFaultKind| {
            matches!(
                kind,
                HapticFaultKind::BuildBody(BodyError::Parameter { what: "longest side of a block, m", .. })
            )
        };
        assert!(is_valid || rejected.len() == 1 && is_size(&rejected[0]), "{rejected:?}");
    }
}

#[test]
fn inclusion_outside_the_block_is_a_fault_that_names_it() {
    let mut app = lockstep_app();
    let body = spawn_block(&mut app);
    let region = BodyRegion::Sphere { center_m: DVec3::Y, radius_m: 0.1 };
    app.world_mut().entity_mut(body).insert(Inclusions(vec![Inclusion { region, tissue: default() }]));
    step(&mut app, 1);
    let kinds = take_kinds(&mut app);
    let [HapticFaultKind::BuildBody(BodyError::Mesh(error))] = &kinds[..] else { panic!("{kinds:?}") };
    assert!(error.to_string().starts_with("region of tissue 0 contains no part of the body"), "{error}");
}
