//! A body and a tool that come together otherwise than by the tool's motion: one rule, however it happens. In lock step.

use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{HapticFaultKind, NoForceCause, SutureFault, ToolSizeFault};
use palpate_tests::app::{Contacts, lockstep_app, step, take_causes, take_faults};

/// Height of the tool's centre while the scene changes, m: outside of the block at rest, and inside of it. The tool has a radius
/// of 5 mm and the top of the block is at 50 mm.
const OUTSIDE_M: f64 = 0.0515;
const INSIDE_M: f64 = 0.0465;

fn block() -> impl Bundle {
    (DeformableBody::block([6, 6, 6], 0.1), FixedRegion::Face(BoxFace::Bottom))
}

/// A tool that comes down from above to `height_m` within 0.3 s and leaves after 4 s.
fn tool(app: &mut App, height_m: f64) -> Entity {
    app.world_mut().resource_mut::<HapticDevices>().register("hand", move || {
        Ok(ScriptedDevice::new(move |n, _| {
            let t = n as f64 * 1e-3;
            let down = (t / 0.3).min(1.0) * (1.0 - ((t - 4.0) / 0.3).clamp(0.0, 1.0));
            Ok(Reading::at(DVec3::new(0.012, 0.06 + (height_m - 0.06) * down, 0.009)))
        }))
    });
    app.world_mut().spawn(HapticTool { device: DeviceSelector::named("hand"), ..default() }).id()
}

fn state(app: &App, tool: Entity) -> ContactState {
    app.world().get::<TouchedBody>(tool).unwrap().state
}

fn force(app: &App, tool: Entity) -> f64 {
    app.world().get::<ToolForce>(tool).unwrap().force_n.length()
}

/// A way for a tool and a body to come together; gives the body.
type Way = fn(&mut App, Entity) -> Entity;

/// Spawns a block, which the tool touches on its way down, and waits until it rests in it.
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
    ("another one asked for, and this one again", |app, tool| {
        let body = touched(app, tool);
        let far = app.world_mut().spawn((block(), Transform::from_xyz(0.24, 0.0, 0.0))).id();
        app.world_mut().get_mut::<HapticTool>(tool).unwrap().body = Some(far);
        // Until the dent has gone.
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

/// The tool's centre decides: outside of the body it touches at once.
#[test]
fn a_body_that_appears_at_a_tool_whose_centre_is_outside_is_touched_at_once() {
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

/// Inside it waits until all of it has left, which is reported once.
#[test]
fn a_body_that_appears_round_the_centre_of_a_tool_waits_for_it_to_leave() {
    for (what, way) in WAYS {
        let mut app = lockstep_app();
        let tool = tool(&mut app, INSIDE_M);
        let body = way(&mut app, tool);
        let touched = app.world().resource::<Contacts>().0.len();
        step(&mut app, 1);
        let _ = take_causes(&mut app);
        assert_eq!(state(&app, tool), ContactState::Inside, "{what}");
        assert_eq!(app.world().get::<TouchedBody>(tool).unwrap().body, None, "{what}");
        step(&mut app, 20);
        assert_eq!((state(&app, tool), force(&app, tool)), (ContactState::Inside, 0.0), "{what}");
        assert_eq!(take_causes(&mut app), [(tool, NoForceCause::Inside { body })], "{what}");
        // It leaves and has touched nothing since.
        step(&mut app, 60);
        assert_eq!(state(&app, tool), ContactState::Clear, "{what}");
        let began = app.world().resource::<Contacts>().0[touched..].iter().filter(|told| **told == "began");
        assert_eq!((began.count(), take_causes(&mut app)), (0, vec![]), "{what}");
    }
}

#[test]
fn a_tool_that_grows_into_a_body_touches_as_its_centre_is_outside() {
    let mut app = lockstep_app();
    app.world_mut().spawn(block());
    let tool = tool(&mut app, 0.056);
    step(&mut app, 12);
    assert_eq!(state(&app, tool), ContactState::Clear);
    app.world_mut().get_mut::<HapticTool>(tool).unwrap().shape = ToolShape::Sphere { radius_m: 0.01 };
    step(&mut app, 12);
    assert_eq!(state(&app, tool), ContactState::Touching);
    assert!(force(&app, tool) > 0.5);
    assert_eq!(take_faults(&mut app), [""; 0]);
}

#[test]
fn the_state_of_a_contact_follows_it() {
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

/// Every fault of a tool's size, with its tool.
#[derive(Resource, Default)]
struct Sizes(Vec<(Entity, ToolSizeFault)>);

fn collect_sizes(mut faults: MessageReader<HapticFault>, mut sizes: ResMut<Sizes>) {
    for fault in faults.read() {
        if let (Some(tool), HapticFaultKind::ToolSize(size)) = (fault.entity, &fault.kind) {
            sizes.0.push((tool, *size));
        }
    }
}

#[test]
fn tools_that_do_not_suit_the_body_they_touch_are_reported_once() {
    // A cell is 20 mm, the body 100 mm.
    for (radius_m, is_small, is_large) in
        [(0.0019, true, false), (0.0021, false, false), (0.049, false, false), (0.051, false, true)]
    {
        let mut app = lockstep_app();
        app.init_resource::<Sizes>().add_systems(Last, collect_sizes);
        let body = app.world_mut().spawn(block()).id();
        let make = move || {
            Ok(ScriptedDevice::new(move |n, _| {
                // Down to 2 mm deep, up and down again.
                let above = 0.001 + 0.003 * (n as f64 * 6e-3).cos();
                Ok(Reading::at(DVec3::new(0.012, 0.05 + radius_m + above, 0.009)))
            }))
        };
        app.world_mut().resource_mut::<HapticDevices>().register("hand", make);
        let shape = ToolShape::Sphere { radius_m };
        let asked = HapticTool { device: DeviceSelector::named("hand"), shape, ..default() };
        let tool = app.world_mut().spawn(asked).id();
        step(&mut app, 60);
        assert!(app.world().resource::<Contacts>().0.len() >= 4, "it touches several times");
        let sizes = std::mem::take(&mut app.world_mut().resource_mut::<Sizes>().0);
        match sizes[..] {
            [] => assert!(!is_small && !is_large, "{radius_m} m"),
            [(told, ToolSizeFault::TooSmall { radius_m: r, cell_m, body: on })] => {
                assert!(is_small && (told, on, r) == (tool, body, radius_m), "{radius_m} m");
                assert!((cell_m - 0.02).abs() < 1e-12, "{cell_m} m");
            }
            [(told, ToolSizeFault::TooLarge { radius_m: r, side_m, body: on })] => {
                assert!(is_large && (told, on, r) == (tool, body, radius_m), "{radius_m} m");
                assert!((side_m - 0.1).abs() < 1e-12, "{side_m} m");
            }
            _ => panic!("{sizes:?}"),
        }
    }
}

/// Every fault of a suture, with its entity.
#[derive(Resource, Default)]
struct Sutures(Vec<(Entity, SutureFault)>);

fn collect_sutures(mut faults: MessageReader<HapticFault>, mut sutures: ResMut<Sutures>) {
    for fault in faults.read() {
        if let (Some(suture), HapticFaultKind::Suture(why)) = (fault.entity, &fault.kind) {
            sutures.0.push((suture, why.clone()));
        }
    }
}

#[test]
fn sutures_without_an_effect_are_reported_once_and_sewn_when_they_have_one() {
    let mut app = lockstep_app();
    app.init_resource::<Sutures>().add_systems(Last, collect_sutures);
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
    let told = std::mem::take(&mut app.world_mut().resource_mut::<Sutures>().0);
    let [(first, SutureFault::SamePoint { at_m }), (second, SutureFault::FixedEnds { ends_m })] = &told[..]
    else {
        panic!("{told:?}")
    };
    assert_eq!((*first, *second), (same, fixed));
    assert!((*at_m - top(0.01)).length() < 1e-9, "{at_m}");
    assert!(ends_m.iter().zip([0.01, 0.03]).all(|(end, x)| (*end - bottom(x)).length() < 1e-9), "{ends_m:?}");
    let tension = |app: &App, suture: Entity| app.world().get::<SutureForce>(suture).unwrap().tension_n;
    assert_eq!([same, fixed].map(|suture| tension(&app, suture)), [0.0; 2]);
    assert!([good, half].into_iter().all(|suture| tension(&app, suture) > 0.0));
    // With another part fixed the thread has an effect.
    app.world_mut().entity_mut(body).insert(FixedRegion::Face(BoxFace::Top));
    step(&mut app, 10);
    assert!(tension(&app, fixed) > 0.0);
    let told = std::mem::take(&mut app.world_mut().resource_mut::<Sutures>().0);
    let suture = |(suture, why): &(Entity, SutureFault)| (*suture, std::mem::discriminant(why));
    let expected = [
        (same, SutureFault::SamePoint { at_m: DVec3::ZERO }),
        (good, SutureFault::FixedEnds { ends_m: [DVec3::ZERO; 2] }),
    ];
    assert_eq!(told.iter().map(suture).collect::<Vec<_>>(), expected.iter().map(suture).collect::<Vec<_>>());
}
