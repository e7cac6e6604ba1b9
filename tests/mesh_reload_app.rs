//! Meshes that change under their bodies, in lock step: while they are touched, to the worse, and to the better again.

use bevy::mesh::{Mesh, VertexAttributeValues};
use bevy::prelude::*;
use bevy_palpate::NoForceCause;
use bevy_palpate::prelude::*;
use palpate_tests::app::{Contacts, step, take_causes, take_faults};
use palpate_tests::mesh::{
    RADIUS, add, ball, body, force, hand, mesh_app as app, replace, shown, spawn_of, torn,
};

/// A ball of other triangles, so with other vertices.
fn coarser() -> Mesh {
    Sphere::new(RADIUS as f32).mesh().ico(12).unwrap()
}

fn is_a_ball(app: &App, entity: Entity, vertices: usize) -> bool {
    let (x, n) = (shown(app, entity, false), shown(app, entity, true));
    x.len() == vertices
        && n.len() == vertices
        && x.iter()
            .zip(&n)
            .all(|(x, n)| (f64::from(x.length()) - RADIUS).abs() < 1e-4 && n.dot(x.normalize()) > 0.9)
}

#[test]
fn a_mesh_that_changes_while_it_is_touched_is_let_go_of_and_touched_anew() {
    let mut app = app();
    let mesh = add(&mut app, ball());
    let entity = spawn_of(&mut app, mesh.clone());
    let tool = hand(&mut app);
    step(&mut app, 15);
    let before = force(&app, tool);
    assert!(before.y > 0.5, "{before}");
    let epoch = body(&app, entity).unwrap().epoch();
    replace(&mut app, &mesh, coarser());
    let mut strongest: f64 = 0.0;
    for _ in 0..40 {
        step(&mut app, 1);
        strongest = strongest.max(force(&app, tool).length());
        assert!(force(&app, tool).is_finite());
    }
    assert!(body(&app, entity).unwrap().epoch() > epoch);
    // What the hand felt of the old body it does not feel twice of the new one.
    assert!(strongest < 1.5 * before.length(), "{strongest} N, {before} before");
    assert_eq!(app.world().resource::<Contacts>().0[..2], ["began", "ended"]);
    assert_eq!(shown(&app, entity, false).len(), coarser().count_vertices());
    // The new ball is round, and the hand's centre in it.
    assert_eq!(take_causes(&mut app), [(tool, NoForceCause::Inside { body: entity })]);
    assert_eq!(take_faults(&mut app).len(), 1);
}

#[test]
fn after_a_mesh_that_is_refused_the_body_is_drawn_as_it_was_whatever_changes_then() {
    let mut app = app();
    let red = |mesh: Mesh| {
        let vertices = mesh.count_vertices();
        mesh.with_inserted_attribute(Mesh::ATTRIBUTE_COLOR, vec![[1.0, 0.0, 0.0, 1.0]; vertices])
    };
    let mesh = add(&mut app, red(ball()));
    let entity = spawn_of(&mut app, mesh.clone());
    step(&mut app, 2);
    let vertices = ball().count_vertices();
    assert!(is_a_ball(&app, entity, vertices));
    replace(&mut app, &mesh, torn(coarser()));
    step(&mut app, 3);
    let said = take_faults(&mut app);
    assert!(said.len() == 1 && said[0].contains("holes"), "{said:?}");
    assert!(is_a_ball(&app, entity, vertices));
    // Drawn anew, since other nodes are fixed: of the mesh that it is made of, and in its colours.
    app.world_mut().entity_mut(entity).insert(FixedRegion::Face(BoxFace::Bottom));
    step(&mut app, 3);
    assert_eq!(take_faults(&mut app), [""; 0]);
    assert!(is_a_ball(&app, entity, vertices));
    let drawn = app.world().get::<Mesh3d>(entity).unwrap().0.clone();
    let drawn = app.world().resource::<Assets<Mesh>>().get(&drawn).unwrap();
    assert!(drawn.indices().unwrap().iter().all(|index| index < vertices));
    let Some(VertexAttributeValues::Float32x4(colors)) = drawn.attribute(Mesh::ATTRIBUTE_COLOR) else {
        panic!("it has no colours")
    };
    assert!(colors.iter().all(|color| *color == [1.0, 0.0, 0.0, 1.0]) && colors.len() == vertices);
    // Put right: taken, though nothing else changes.
    replace(&mut app, &mesh, coarser());
    step(&mut app, 3);
    assert_eq!(take_faults(&mut app), [""; 0]);
    assert!(is_a_ball(&app, entity, coarser().count_vertices()));
}

/// What is refused because of something else is not refused itself.
#[test]
fn a_mesh_that_changed_along_with_a_tissue_that_is_none_is_taken_with_the_next_one() {
    let mut app = app();
    let mesh = add(&mut app, ball());
    let entity = spawn_of(&mut app, mesh.clone());
    step(&mut app, 2);
    replace(&mut app, &mesh, coarser());
    app.update();
    app.world_mut().get_mut::<Tissue>(entity).unwrap().density_kg_per_m3 = -1.0;
    step(&mut app, 3);
    let said = take_faults(&mut app);
    assert!(!said.is_empty() && said.iter().all(|said| said.contains("density")), "{said:?}");
    app.world_mut().get_mut::<Tissue>(entity).unwrap().density_kg_per_m3 = 900.0;
    step(&mut app, 3);
    assert_eq!(take_faults(&mut app), [""; 0]);
    assert!(is_a_ball(&app, entity, coarser().count_vertices()));
}
