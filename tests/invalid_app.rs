//! Invalid bodies, tools and settings are faults with their causes.

use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{DeviceFault, DeviceSelector, HapticFaultKind, SimulatedBody, ToolLoop};
use palpate_body::BodyError;
use palpate_haptics::{HapticsError, ScriptedDevice};
use palpate_laws::LawError;
use palpate_tests::app::{
    assert_no_faults, force_n, lockstep_app, pressing_hand, spawn_scene, step, take_kinds, take_reports,
};

#[test]
fn invalid_bodies_are_faults_with_their_cause() {
    let block = || DeformableBody::block([6, 6, 6], 0.1);
    let scaled = |x: f32, y: f32, z: f32| Transform::from_scale(Vec3::new(x, y, z));
    type Expected = fn(&HapticFaultKind) -> bool;
    type Spawn<'a> = Box<dyn Fn(&mut World) + 'a>;
    let cases: [(&str, Spawn, Expected); 10] = [
        ("one node", Box::new(|world| _ = world.spawn(DeformableBody::block([1, 6, 6], 0.1))), |kind| {
            matches!(kind, HapticFaultKind::BuildBody(BodyError::LatticeNodes { nodes: [1, 6, 6] }))
        }),
        (
            "NaN size",
            Box::new(|world| _ = world.spawn(DeformableBody::block([6; 3], f64::NAN))),
            |kind| matches!(kind, HapticFaultKind::BuildBody(BodyError::Parameter { value, .. }) if value.is_nan()),
        ),
        (
            "zero density",
            Box::new(|world| _ = world.spawn((block(), Tissue { density_kg_per_m3: 0.0, ..default() }))),
            |kind| matches!(kind, HapticFaultKind::BuildBody(BodyError::Parameter { value: 0.0, .. })),
        ),
        (
            "scale 2",
            Box::new(|world| _ = world.spawn((block(), scaled(2.0, 2.0, 2.0)))),
            |kind| matches!(kind, HapticFaultKind::NonUnitScale { scale } if *scale == Vec3::splat(2.0)),
        ),
        (
            "NaN position",
            Box::new(|world| _ = world.spawn((block(), Transform::from_xyz(f32::NAN, 0.0, 0.0)))),
            |kind| matches!(kind, HapticFaultKind::NonFiniteTransform),
        ),
        ("scale 0", Box::new(|world| _ = world.spawn((block(), scaled(0.0, 0.0, 0.0)))), |kind| {
            matches!(kind, HapticFaultKind::NonUnitScale { scale: Vec3::ZERO })
        }),
        ("mirrored", Box::new(|world| _ = world.spawn((block(), scaled(-1.0, 1.0, 1.0)))), |kind| {
            matches!(kind, HapticFaultKind::NonUnitScale { scale: Vec3::ONE })
        }),
        (
            "too many nodes",
            Box::new(|world| _ = world.spawn(DeformableBody::block([40, 40, 40], 0.1))),
            |kind| matches!(kind, HapticFaultKind::BuildBody(BodyError::Parameter { value: 64e3, .. })),
        ),
        (
            "fixed vertices of a block",
            Box::new(|world| {
                world.spawn((block(), FixedRegion::Vertices(vec![true, false, true])));
            }),
            |kind| matches!(kind, HapticFaultKind::BuildBody(BodyError::Parameter { value: 2.0, .. })),
        ),
        (
            "too stiff",
            Box::new(|world| {
                let tissue = Tissue { youngs_modulus_pa: 1e12, ..default() };
                world.spawn((DeformableBody::block([5, 5, 5], 0.001), tissue));
            }),
            |kind| matches!(kind, HapticFaultKind::BuildBody(BodyError::Substeps { needed, .. }) if needed.ceil() == 661_375.0),
        ),
    ];
    for (what, spawn, is_expected) in cases {
        let mut app = lockstep_app();
        spawn(app.world_mut());
        app.update();
        let kinds = take_kinds(&mut app);
        assert!(kinds.len() == 1 && is_expected(&kinds[0]), "{what}: {kinds:?}");
        step(&mut app, 2);
        assert_no_faults(&mut app);
    }
}

#[test]
fn body_is_built_once_its_scale_is_one() {
    let mut app = lockstep_app();
    let scaled = Transform::from_scale(Vec3::splat(2.0));
    let entity = app.world_mut().spawn((DeformableBody::block([6, 6, 6], 0.1), scaled)).id();
    app.update();
    let expected = "the body's transform has scale [2, 2, 2], or is mirrored or sheared by its parents; its scale must be 1: set \
                    the size in DeformableBody";
    assert_eq!(take_reports(&mut app), [expected]);
    assert!(app.world().get::<SimulatedBody>(entity).is_none());
    app.world_mut().get_mut::<Transform>(entity).unwrap().scale = Vec3::ONE;
    app.update();
    assert!(app.world().get::<SimulatedBody>(entity).is_some());
    assert_no_faults(&mut app);
}

#[test]
fn invalid_tools_are_faults_with_their_cause() {
    let mut app = lockstep_app();
    let spawn = |app: &mut App, tool: HapticTool| app.world_mut().spawn(tool).id();
    spawn(&mut app, HapticTool::default());
    app.update();
    app.world_mut().resource_mut::<HapticDevices>().register("a", || Ok(pressing_hand()));
    app.world_mut()
        .resource_mut::<HapticDevices>()
        .register("broken", || -> Result<ScriptedDevice, _> { Err("no cable".into()) });
    for device in ["b", "broken"] {
        spawn(&mut app, HapticTool::new(device));
    }
    spawn(&mut app, HapticTool::new(DeviceSelector::replay(Handle::default())));
    spawn(&mut app, HapticTool::new("a").with_shape(ToolShape::Sphere { radius_m: 0.0 }));
    spawn(&mut app, HapticTool::new("a"));
    app.update();
    let kinds = take_kinds(&mut app);
    let device_fault = |kind: &HapticFaultKind| match kind {
        HapticFaultKind::Device(fault) => fault.clone(),
        other => panic!("{other}"),
    };
    let unknown = |kind: &HapticFaultKind| match &*device_fault(kind) {
        DeviceFault::UnknownName { name, registered } => (name.clone(), registered.clone()),
        other => panic!("{other}"),
    };
    assert_eq!(kinds.len(), 6, "{kinds:?}");
    assert_eq!(unknown(&kinds[0]), ("default".into(), "none".into()));
    // The start is retried after a registration.
    assert_eq!(unknown(&kinds[1]), ("default".into(), "a, broken".into()));
    assert_eq!(unknown(&kinds[2]), ("b".into(), "a, broken".into()));
    let broken = device_fault(&kinds[3]);
    assert!(matches!(&*broken, DeviceFault::Create(cause) if cause.to_string() == "no cable"), "{broken}");
    assert_eq!(kinds[3].report(), "the tool has no device: the device could not be created: no cable");
    let replay = device_fault(&kinds[4]);
    // The app has no AssetPlugin.
    assert!(matches!(&*replay, DeviceFault::NoTrajectories), "{replay}");
    let is_radius = matches!(kinds[5], HapticFaultKind::Tool(BodyError::Tool(LawError::Radius(0.0))));
    assert!(is_radius, "{:?}", kinds[5]);
    step(&mut app, 3);
    assert_no_faults(&mut app);
}

#[test]
fn invalid_settings_are_reported_once_and_the_previous_ones_stay() {
    for bad in [-1.0, f64::NAN] {
        let mut app = lockstep_app();
        let (body, tool) = spawn_scene(&mut app, Scheme::Tangent, pressing_hand);
        step(&mut app, 10);
        app.world_mut().get_mut::<ToolSettings>(tool).unwrap().safety.max_slew_n_per_s = Some(bad);
        app.world_mut().get_mut::<Tissue>(body).unwrap().youngs_modulus_pa *= 1.1;
        step(&mut app, 4);
        let kinds = take_kinds(&mut app);
        let [HapticFaultKind::Settings(error)] = &kinds[..] else { panic!("{kinds:?}") };
        let HapticsError::Setting { value, .. } = **error else { panic!("{error}") };
        assert_eq!(value.to_bits(), bad.to_bits());
        assert!(force_n(&app, tool).y > 0.5, "the previous settings are in effect");
    }
    // A tool that was spawned with invalid settings starts once they are corrected.
    let mut app = lockstep_app();
    let (_, tool) = spawn_scene(&mut app, Scheme::Tangent, pressing_hand);
    app.world_mut().get_mut::<ToolSettings>(tool).unwrap().frame.scale = 0.0;
    step(&mut app, 2);
    let kinds = take_kinds(&mut app);
    assert!(matches!(kinds[..], [HapticFaultKind::Settings(_)]), "{kinds:?}");
    assert!(app.world().get::<ToolLoop>(tool).is_none());
    app.world_mut().get_mut::<ToolSettings>(tool).unwrap().frame.scale = 1.0;
    step(&mut app, 1);
    assert!(app.world().get::<ToolLoop>(tool).is_some());
}
