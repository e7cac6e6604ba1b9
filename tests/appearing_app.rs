//! A body and a tool that meet other than by the tool's motion, in lock step: one rule for all causes.

use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{ContactState, HapticFaultKind, NoForceCause, SutureFault, ToolSizeFault};
use palpate_haptics::{Reading, ScriptedDevice};
use palpate_tests::app::{
    Contact, assert_no_faults, contacts, lockstep_app, spawn_tool, step, take_causes, take_faults,
};

/// Height of the tool's centre while the scene changes, m: outside the block at rest, and inside it. The tool has a radius of 5 mm, and the
/// top of the block is at 50 mm.
const OUTSIDE_M: f64 = 0.0515;
const INSIDE_M: f64 = 0.0465;

fn block() -> impl Bundle {
    (DeformableBody::block([6, 6, 6], 0.1), FixedRegion::Face(BoxFace::Bottom))
}

/// Spawns a tool that descends to `height_m` within 0.3 s and leaves after 3 s.
fn tool(app: &mut App, height_m: f64) -> Entity {
    spawn_tool(app, move || {
        ScriptedDevice::new(move |n, _| {
            let t = n as f64 * 1e-3;
            let down = (t / 0.3).min(1.0) * (1.0 - ((t - 3.0) / 0.3).clamp(0.0, 1.0));
            Ok(Reading::at(DVec3::new(0.012, 0.06 + (height_m - 0.06) * down, 0.009)))
        })
    })
}

fn state(app: &App, tool: Entity) -> ContactState {
    app.world().get::<TouchedBody>(tool).unwrap().state
}

fn force(app: &App, tool: Entity) -> f64 {
    app.world().get::<ToolForce>(tool).unwrap().force_n.length()
}

/// Makes a tool and a body meet; returns the body.
type Way = fn(&mut App, Entity) -> Entity;

/// Spawns a block, which the tool touches on its way down, and waits until the tool rests in it.
fn touched(app: &mut App, tool: Entity) -> Entity {
    let body = app.world_mut().spawn(block()).id();
    step(app, 16);
    assert_eq!(state(app, tool), ContactState::Touching);
    assert!(force(app, tool) > 0.2);
    body
}

const WAYS: [(&str, Way); 7] = [
    ("a first body", |app, _| {
        step(app, 12);
        app.world_mut().spawn(block()).id()
    }),
    ("despawned and spawned again", |app, tool| {
        let body = touched(app, tool);
        app.world_mut().despawn(body);
        app.world_mut().spawn(block()).id()
    }),
    ("despawned, and spawned a while later", |app, tool| {
        let body = touched(app, tool);
        app.world_mut().despawn(body);
        step(app, 4);
        app.world_mut().spawn(block()).id()
    }),
    ("replaced by one of other nodes", |app, tool| {
        let body = touched(app, tool);
        app.world_mut().entity_mut(body).insert(DeformableBody::block([7, 7, 7], 0.1));
        body
    }),
    ("removed and inserted", |app, tool| {
        let body = touched(app, tool);
        app.world_mut().entity_mut(body).remove::<DeformableBody>();
        step(app, 2);
        app.world_mut().entity_mut(body).insert(DeformableBody::block([6, 6, 6], 0.1));
        body
    }),
    ("another one selected, and this one again", |app, tool| {
        let body = touched(app, tool);
        let far = app.world_mut().spawn((block(), Transform::from_xyz(0.24, 0.0, 0.0))).id();
        app.world_mut().get_mut::<HapticTool>(tool).unwrap().body = Some(far);
        // Waits until the indentation has gone.
        step(app, 20);
        assert_eq!(state(app, tool), ContactState::Clear);
        app.world_mut().get_mut::<HapticTool>(tool).unwrap().body = Some(body);
        body
    }),
    ("moved", |app, _| {
        let place = Transform::from_xyz(0.0, -0.24, 0.0);
        let body = app.world_mut().spawn((block(), place)).id();
        step(app, 12);
        app.world_mut().get_mut::<Transform>(body).unwrap().translation.y = 0.0;
        body
    }),
];

#[test]
fn tool_with_its_centre_outside_touches_an_appearing_body_at_once() {
    for (what, way) in WAYS {
        let mut app = lockstep_app();
        let tool = tool(&mut app, OUTSIDE_M);
        let body = way(&mut app, tool);
        step(&mut app, 3);
        assert_eq!(state(&app, tool), ContactState::Touching, "{what}");
        assert_eq!(app.world().get::<TouchedBody>(tool).unwrap().body, Some(body), "{what}");
        step(&mut app, 12);
        assert!(force(&app, tool) > 0.2, "{what}: {} N", force(&app, tool));
        let causes = take_causes(&mut app);
        assert!(causes.iter().all(|(_, cause)| *cause == NoForceCause::NoBody), "{what}: {causes:?}");
    }
}

/// The state [`ContactState::Inside`] is reported once.
#[test]
fn tool_with_its_centre_inside_an_appearing_body_touches_only_after_leaving() {
    for (what, way) in WAYS {
        let mut app = lockstep_app();
        let tool = tool(&mut app, INSIDE_M);
        let body = way(&mut app, tool);
        let before = contacts(&app).len();
        step(&mut app, 1);
        let _ = take_causes(&mut app);
        assert_eq!(state(&app, tool), ContactState::Inside, "{what}");
        assert_eq!(app.world().get::<TouchedBody>(tool).unwrap().body, None, "{what}");
        step(&mut app, 20);
        assert_eq!((state(&app, tool), force(&app, tool)), (ContactState::Inside, 0.0), "{what}");
        assert_eq!(take_causes(&mut app), [(tool, NoForceCause::Inside { body })], "{what}");
        // The tool leaves without another contact.
        step(&mut app, 40);
        assert_eq!(state(&app, tool), ContactState::Clear, "{what}");
        assert!(!contacts(&app)[before..].contains(&Contact::Start), "{what}");
        assert_eq!(take_causes(&mut app), [], "{what}");
    }
}

#[test]
fn tool_that_grows_into_a_body_touches_with_its_centre_outside() {
    let mut app = lockstep_app();
    app.world_mut().spawn(block());
    let tool = tool(&mut app, 0.056);
    step(&mut app, 12);
    assert_eq!(state(&app, tool), ContactState::Clear);
    app.world_mut().get_mut::<HapticTool>(tool).unwrap().shape = ToolShape::Sphere { radius_m: 0.01 };
    step(&mut app, 12);
    assert_eq!(state(&app, tool), ContactState::Touching);
    assert!(force(&app, tool) > 0.5);
    assert_no_faults(&mut app);
}

#[test]
fn touched_body_has_the_state_of_the_contact() {
    let mut app = lockstep_app();
    let tool = tool(&mut app, OUTSIDE_M);
    assert_eq!(state(&app, tool), ContactState::NoBody);
    step(&mut app, 1);
    assert_eq!(state(&app, tool), ContactState::NoBody);
    let body = app.world_mut().spawn(block()).id();
    step(&mut app, 1);
    assert_eq!(state(&app, tool), ContactState::Clear);
    step(&mut app, 10);
    assert_eq!(state(&app, tool), ContactState::Touching);
    app.world_mut().despawn(body);
    step(&mut app, 2);
    assert_eq!(state(&app, tool), ContactState::NoBody);
    app.world_mut().entity_mut(tool).remove::<HapticTool>();
    app.update();
    assert_eq!(app.world().get::<TouchedBody>(tool), Some(&TouchedBody::default()));
}

/// Faults of a tool's size since the last call, each with its tool.
fn take_sizes(app: &mut App) -> Vec<(Entity, ToolSizeFault)> {
    let size = |fault: HapticFault| match fault.kind {
        HapticFaultKind::ToolSize(size) => Some((fault.entity?, size)),
        _ => None,
    };
    take_faults(app).into_iter().filter_map(size).collect()
}

#[test]
fn tool_of_unsuitable_size_is_reported_once() {
    // A cell is 20 mm, the body 100 mm.
    for (radius_m, is_small, is_large) in
        [(0.0019, true, false), (0.0021, false, false), (0.049, false, false), (0.051, false, true)]
    {
        let mut app = lockstep_app();
        let body = app.world_mut().spawn(block()).id();
        let tool = spawn_tool(&mut app, move || {
            ScriptedDevice::new(move |n, _| {
                // Down to a depth of 2 mm, up and down again.
                let above = 0.001 + 0.003 * (n as f64 * 6e-3).cos();
                Ok(Reading::at(DVec3::new(0.012, 0.05 + radius_m + above, 0.009)))
            })
        });
        app.world_mut().get_mut::<HapticTool>(tool).unwrap().shape = ToolShape::Sphere { radius_m };
        step(&mut app, 60);
        assert!(contacts(&app).len() >= 4, "the tool touches several times");
        let sizes = take_sizes(&mut app);
        match sizes[..] {
            [] => assert!(!is_small && !is_large, "{radius_m} m"),
            [(reported, ToolSizeFault::TooSmall { radius_m: r, cell_m, body: on })] => {
                assert!(is_small && (reported, on, r) == (tool, body, radius_m), "{radius_m} m");
                assert!((cell_m - 0.02).abs() < 1e-12, "{cell_m} m");
            }
            [(reported, ToolSizeFault::TooLarge { radius_m: r, side_m, body: on })] => {
                assert!(is_large && (reported, on, r) == (tool, body, radius_m), "{radius_m} m");
                assert!((side_m - 0.1).abs() < 1e-12, "{side_m} m");
            }
            _ => panic!("{sizes:?}"),
        }
    }
}

/// Faults of sutures since the last call, each with its suture.
fn take_sutures(app: &mut App) -> Vec<(Entity, SutureFault)> {
    let suture = |fault: HapticFault| match fault.kind {
        HapticFaultKind::Suture(cause) => Some((fault.entity?, cause)),
        _ => None,
    };
    take_faults(app).into_iter().filter_map(suture).collect()
}

#[test]
fn sutures_without_effect_are_reported_once_and_sewn_when_they_have_one() {
    let mut app = lockstep_app();
    let body = app.world_mut().spawn(block()).id();
    let mut sew = |ends_m: [DVec3; 2]| {
        let suture = Suture {
            body,
            ends_m,
            length_m: 0.01,
            stiffness_n_per_m: f64::INFINITY,
            tear_limit_n: f64::INFINITY,
        };
        app.world_mut().spawn(suture).id()
    };
    let top = |x: f64| DVec3::new(x, 0.05, 0.01);
    let bottom = |x: f64| DVec3::new(x, -0.05, 0.01);
    let same = sew([top(0.01); 2]);
    let fixed = sew([bottom(0.01), bottom(0.03)]);
    let good = sew([top(-0.03), top(-0.01)]);
    let half = sew([top(0.05), bottom(0.05)]);
    step(&mut app, 10);
    let faults = take_sutures(&mut app);
    let [(first, SutureFault::SamePoint { at_m }), (second, SutureFault::FixedEnds { ends_m })] = &faults[..]
    else {
        panic!("{faults:?}")
    };
    assert_eq!((*first, *second), (same, fixed));
    assert!((*at_m - top(0.01)).length() < 1e-9, "{at_m}");
    assert!(ends_m.iter().zip([0.01, 0.03]).all(|(end, x)| (*end - bottom(x)).length() < 1e-9), "{ends_m:?}");
    let tension = |app: &App, suture: Entity| app.world().get::<SutureForce>(suture).unwrap().tension_n;
    assert_eq!([same, fixed].map(|suture| tension(&app, suture)), [0.0; 2]);
    assert!([good, half].into_iter().all(|suture| tension(&app, suture) > 0.0));
    // With another fixed region the thread has an effect.
    app.world_mut().entity_mut(body).insert(FixedRegion::Face(BoxFace::Top));
    step(&mut app, 10);
    assert!(tension(&app, fixed) > 0.0);
    let faults = take_sutures(&mut app);
    let kind = |(suture, cause): &(Entity, SutureFault)| (*suture, std::mem::discriminant(cause));
    let expected = [
        (same, SutureFault::SamePoint { at_m: DVec3::ZERO }),
        (good, SutureFault::FixedEnds { ends_m: [DVec3::ZERO; 2] }),
    ];
    assert_eq!(faults.iter().map(kind).collect::<Vec<_>>(), expected.iter().map(kind).collect::<Vec<_>>());
}
