//! What the plugin shows to reflection, and what it does not.

use bevy::prelude::*;
use bevy_palpate::prelude::*;
use palpate_tests::app::lockstep_app;

/// What is reflected, and as what.
const REFLECTED: [(&str, &[&str]); 5] = [
    (
        "component",
        &[
            "ContactCompliance",
            "DeformableBody",
            "FixedRegion",
            "Grasping",
            "HapticTool",
            "Inclusions",
            "LocalModelStats",
            "LocalModelError",
            "LoopTiming",
            "Slit",
            "Suture",
            "SutureForce",
            "TickRecording",
            "Tissue",
            "ToolForce",
            "ToolGrasp",
            "ToolSettings",
            "Touching",
        ],
    ),
    ("resource", &["LoopMode", "ModelRate", "ModelStepCount"]),
    ("message", &["ContactStart", "ContactEnd", "SutureTorn"]),
    (
        "part",
        &[
            "BodyRegion",
            "ContactState",
            "DeviceSelector",
            "Face",
            "HidSelector",
            "HidDeviceKind",
            "Inclusion",
            "MeshShape",
            "ToolCoupling",
        ],
    ),
    (
        "default",
        &[
            "ContactCompliance",
            "ContactState",
            "DeviceSelector",
            "FixedRegion",
            "Grasping",
            "LoopMode",
            "HapticTool",
            "HidSelector",
            "Inclusions",
            "LocalModelStats",
            "LocalModelError",
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
            "Touching",
        ],
    ),
];

/// What is not: bodies and what became of their meshes, loops and devices, errors and what carries them, plugins, schedules and sets.
const OPAQUE: [&str; 25] = [
    "BodyPlugin",
    "DeviceFault",
    "FaultLogPlugin",
    "HapticDevices",
    "HapticDiagnosticsPlugin",
    "HapticFault",
    "HapticFaultKind",
    "HapticSchedulePlugin",
    "HapticUpdateSystems",
    "HapticSystems",
    "BlackBoxDump",
    "MeshReport",
    "MeshFault",
    "ModelStep",
    "NoForceCause",
    "PalpatePlugins",
    "SimulatedBody",
    "SlowStep",
    "StepPart",
    "SutureFault",
    "SuturePlugin",
    "ToolLoop",
    "ToolPlugin",
    "ToolSizeFault",
    "prelude",
];

/// The names that the crate exports in a headless build.
fn exported() -> Vec<String> {
    let source = include_str!("../crates/bevy_palpate/src/lib.rs");
    let (front, _) = source.split_once("pub mod prelude").unwrap();
    let parts: Vec<&str> = front.split(';').collect();
    let exports = parts.iter().filter(|part| part.contains("pub use ") && !part.contains("#[cfg("));
    let names = exports.flat_map(|part| {
        let (_, names) = part.split_once("pub use ").unwrap().1.split_once("::").unwrap();
        names.trim_matches(['{', '}', '\n', ' ']).split(',').map(|name| name.trim().to_owned())
    });
    names.filter(|name| !name.is_empty()).collect()
}

#[test]
fn every_public_type_is_reflected_where_it_can_be() {
    let app = lockstep_app();
    let registry = app.world().resource::<AppTypeRegistry>().read();
    for (kind, names) in REFLECTED {
        for name in names {
            let known =
                registry.get_with_short_type_path(name).unwrap_or_else(|| panic!("{name} is not registered"));
            let is_it = match kind {
                "component" => known.data::<ReflectComponent>().is_some(),
                "resource" => known.data::<ReflectResource>().is_some(),
                "message" => known.data::<ReflectMessage>().is_some(),
                "default" => known.data::<ReflectDefault>().is_some(),
                _ => true,
            };
            assert!(is_it, "{name} is no {kind} to reflection");
        }
    }
    for name in exported() {
        let is_known = REFLECTED.iter().any(|(_, names)| names.contains(&name.as_str()));
        assert!(is_known || OPAQUE.contains(&name.as_str()), "{name} is neither reflected nor told why not");
    }
}

#[test]
fn a_tool_is_made_by_reflection_alone() {
    use bevy::reflect::structs::DynamicStruct;
    let mut app = lockstep_app();
    let registry = app.world().resource::<AppTypeRegistry>().clone();
    let tool = app.world_mut().spawn_empty().id();
    let registry = registry.read();
    let known = registry.get_with_short_type_path("HapticTool").unwrap();
    let mut made = known.data::<ReflectDefault>().unwrap().default();
    let mut change = DynamicStruct::default();
    change.insert("friction", 0.7_f64);
    made.apply(&change);
    let component = known.data::<ReflectComponent>().unwrap();
    component.insert(&mut app.world_mut().entity_mut(tool), made.as_partial_reflect(), &registry);
    let expected = HapticTool { friction: 0.7, ..default() };
    assert_eq!(app.world().get::<HapticTool>(tool), Some(&expected));
}
