//! Reflection of the public types.

use bevy::prelude::*;
use bevy_palpate::prelude::*;
use palpate_tests::app::lockstep_app;

/// Reflected types by kind.
const REFLECTED: [(&str, &[&str]); 6] = [
    (
        "component",
        &[
            "BodyState",
            "ContactCompliance",
            "DeformableBody",
            "ElementFamily",
            "ExternalForce",
            "FixedRegion",
            "ForceError",
            "GraspedPoint",
            "GravityScale",
            "HapticTool",
            "Inclusions",
            "KinematicBody",
            "LocalModelStats",
            "LoopTiming",
            "Obstacle",
            "ObstacleForce",
            "Slit",
            "Suture",
            "SutureForce",
            "TickRecording",
            "Tissue",
            "ToolForce",
            "ToolGrasp",
            "ToolSettings",
            "TouchLayers",
            "TouchedBody",
        ],
    ),
    ("resource", &["Gravity", "LoopMode", "ModelRate", "ModelStepCount"]),
    (
        "message",
        &["BodyReady", "ContactStart", "ContactEnd", "GraspStart", "GraspEnd", "HapticFault", "SutureTorn"],
    ),
    ("event", &["BodyReady", "ContactStart", "ContactEnd", "GraspStart", "GraspEnd", "SutureTorn"]),
    (
        "part",
        &[
            "BodyRegion",
            "BoxFace",
            "ContactState",
            "DeviceSelector",
            "FaultSeverity",
            "HidSelector",
            "HidDeviceKind",
            "Inclusion",
            "Load",
            "MeshCellSize",
            "MeshPieces",
            "MeshShape",
            "ObstacleShape",
            "SafetyOverrides",
            "TetrahedralShape",
            "TetrahedralVolume",
            "ToolContactPoint",
            "ToolCoupling",
            "TrajectoryAsset",
        ],
    ),
    (
        "default",
        &[
            "BodyState",
            "ContactCompliance",
            "ContactState",
            "DeviceSelector",
            "ElementFamily",
            "FixedRegion",
            "ForceError",
            "GraspedPoint",
            "LoopMode",
            "HapticTool",
            "HidSelector",
            "Inclusions",
            "LocalModelStats",
            "LoopTiming",
            "ModelRate",
            "ModelStepCount",
            "SutureForce",
            "TickRecording",
            "Tissue",
            "ToolCoupling",
            "ToolForce",
            "ToolGrasp",
            "ToolSettings",
            "TouchedBody",
        ],
    ),
];

/// Types without reflection: simulated bodies and reports about meshes, loops and devices, errors, plugins, schedules and sets.
const NOT_REFLECTED: [&str; 29] = [
    "BodyPlugin",
    "DeviceFault",
    "FaultLogPlugin",
    "HapticDevices",
    "HapticDiagnosticsPlugin",
    "HapticFaultKind",
    "HapticSchedulePlugin",
    "HapticUpdateSystems",
    "HapticSystems",
    "BlackBoxDump",
    "MeshReport",
    "MeshFault",
    "BodyQuery",
    "BodySurfacePoint",
    "Model",
    "ModelSchedule",
    "NoForceCause",
    "PalpatePlugins",
    "SimulatedBody",
    "SlowStep",
    "StepPart",
    "SutureFault",
    "SurroundingsPlugin",
    "SuturePlugin",
    "ToolLoop",
    "ToolPlugin",
    "ToolSizeFault",
    "TrajectoryLoader",
    "prelude",
];

/// The names that the crate exports in a headless build, without the crates that it exports.
fn exported() -> Vec<String> {
    let source = include_str!("../crates/bevy_palpate/src/lib.rs");
    let (front, _) = source.split_once("pub mod prelude").unwrap();
    let parts: Vec<&str> = front.split(';').collect();
    let exports = parts.iter().filter(|part| part.contains("pub use ") && !part.contains("#[cfg("));
    let names = exports.flat_map(|part| {
        let exported = part.split_once("pub use ").unwrap().1;
        let names = exported.split_once("::").map_or("", |(_, names)| names);
        names.trim_matches(['{', '}', '\n', ' ']).split(',').map(|name| name.trim().to_owned())
    });
    names.filter(|name| !name.is_empty()).collect()
}

#[test]
fn public_types_are_reflected_or_listed_as_not_reflected() {
    let app = lockstep_app();
    let registry = app.world().resource::<AppTypeRegistry>().read();
    for (kind, names) in REFLECTED {
        for name in names {
            let registration =
                registry.get_with_short_type_path(name).unwrap_or_else(|| panic!("{name} is not registered"));
            let is_it = match kind {
                "component" => registration.data::<ReflectComponent>().is_some(),
                "resource" => registration.data::<ReflectResource>().is_some(),
                "message" => registration.data::<ReflectMessage>().is_some(),
                "default" => registration.data::<ReflectDefault>().is_some(),
                _ => true,
            };
            assert!(is_it, "{name} is not reflected as {kind}");
        }
    }
    let names = exported();
    assert!(names.len() > 50, "{names:?}");
    for name in names {
        let is_reflected = REFLECTED.iter().any(|(_, names)| names.contains(&name.as_str()));
        assert!(is_reflected || NOT_REFLECTED.contains(&name.as_str()), "{name} is in neither list");
    }
}

/// What is not in the prelude is found on the front page.
#[test]
fn front_page_lists_every_exported_name() {
    let source = include_str!("../crates/bevy_palpate/src/lib.rs");
    let (page, exports) = source.split_once("#![forbid").unwrap();
    let names = exported().into_iter().filter(|name| name != "prelude");
    let missing: Vec<String> = names.filter(|name| !page.contains(&format!("[`{name}`]"))).collect();
    assert!(missing.is_empty(), "{missing:?}");
    // With features these are exported, too.
    for name in [
        "AvianPlugin",
        "NotAnObstacle",
        "HapticGizmosOverride",
        "HapticWidgets",
        "MouseDevice",
        "MouseDeviceSystems",
    ] {
        assert!(page.contains(&format!("`{name}`")) && exports.contains(name), "{name}");
    }
}

/// The crates below are exported, with the types that belong to the device trait and to surfaces.
#[test]
fn companion_types_are_reachable_from_the_crate() {
    use bevy_palpate::palpate_body::SurfaceTree;
    use bevy_palpate::palpate_haptics::{
        DeviceDescription, DeviceError, HapticDevice, LoopEventKind, Reading, ScriptedDevice,
    };
    fn is_device<D: HapticDevice>(device: &D) -> DeviceDescription {
        device.describe()
    }
    let device = ScriptedDevice::new(|_, _| Ok(Reading::at(DVec3::ZERO)));
    assert!(is_device(&device).max_force_n > 0.0);
    assert!(LoopEventKind::DeviceFailed(DeviceError::NotOpen).is_fault());
    assert!(std::any::type_name::<SurfaceTree>().contains("palpate_body"));
}

#[test]
fn tool_is_inserted_by_reflection() {
    use bevy::reflect::structs::DynamicStruct;
    let mut app = lockstep_app();
    let registry = app.world().resource::<AppTypeRegistry>().clone();
    let tool = app.world_mut().spawn_empty().id();
    let registry = registry.read();
    let registration = registry.get_with_short_type_path("HapticTool").unwrap();
    let mut value = registration.data::<ReflectDefault>().unwrap().default();
    let mut change = DynamicStruct::default();
    change.insert("friction", 0.7_f64);
    value.apply(&change);
    let component = registration.data::<ReflectComponent>().unwrap();
    component.insert(&mut app.world_mut().entity_mut(tool), value.as_partial_reflect(), &registry);
    let expected = HapticTool { friction: 0.7, ..default() };
    assert_eq!(app.world().get::<HapticTool>(tool), Some(&expected));
}
