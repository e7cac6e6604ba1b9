//! Dependencies of the crates on each other and on external crates: only those of the table.

use cargo_metadata::{DependencyKind, MetadataCommand};
use std::collections::BTreeSet;

/// Allowed dependencies of each crate, except `thiserror`: `(crate, allowed)`.
const ALLOWED: [(&str, &[&str]); 9] = [
    ("palpate_laws", &["glam"]),
    ("palpate_body", &["palpate_laws", "glam", "faer", "parry3d-f64", "serde"]),
    ("palpate_local", &["palpate_laws", "glam"]),
    ("palpate_reduce", &["palpate_body", "palpate_local", "palpate_laws", "glam", "faer"]),
    (
        "palpate_haptics",
        &[
            "palpate_local",
            "glam",
            "triple_buffer",
            "crossbeam-channel",
            "csv",
            "hdrhistogram",
            "rustix",
            "thread-priority",
            "core_affinity",
        ],
    ),
    ("palpate_hid", &["palpate_haptics", "glam", "hidapi"]),
    (
        "palpate_lab",
        &[
            "palpate_laws",
            "palpate_body",
            "palpate_local",
            "palpate_reduce",
            "palpate_haptics",
            "palpate_hid",
            "allocation-counter",
            "clap",
            "ctrlc",
            "glam",
            "gltf",
            "indicatif",
            "plotters",
            "serde",
            "serde_json",
            "tempfile",
        ],
    ),
    (
        "palpate_paper",
        &[
            "palpate_lab",
            "palpate_laws",
            "palpate_body",
            "palpate_local",
            "palpate_reduce",
            "palpate_haptics",
            "clap",
            "faer",
            "glam",
            "plotters",
            "serde",
        ],
    ),
    (
        "bevy_palpate",
        &[
            "palpate_body",
            "palpate_local",
            "palpate_reduce",
            "palpate_haptics",
            "palpate_hid",
            "bevy",
            "glam",
            "avian3d",
            "bevy_egui",
            "egui_plot",
            "winit",
        ],
    ),
];

#[test]
fn every_crate_has_only_allowed_dependencies() {
    let manifest = concat!(env!("CARGO_MANIFEST_DIR"), "/../../Cargo.toml");
    let metadata = MetadataCommand::new().manifest_path(manifest).no_deps().exec().unwrap();
    let mut seen = BTreeSet::new();
    for package in metadata.workspace_packages() {
        let name = package.name.as_str();
        // Tests, benches and examples may use anything.
        if ["palpate_tests", "palpate_tests_without_bevy", "palpate_benches", "palpate_examples"]
            .contains(&name)
        {
            continue;
        }
        let (_, allowed) = ALLOWED.iter().find(|(listed, _)| *listed == name).unwrap_or_else(|| {
            panic!("{name} is not in the table of crates; add it there and in ARCHITECTURE.md")
        });
        seen.insert(name.to_owned());
        for dependency in package.dependencies.iter().filter(|d| d.kind == DependencyKind::Normal) {
            let on = dependency.name.as_str();
            assert!(on == "thiserror" || allowed.contains(&on), "{name} may not depend on {on}");
        }
    }
    assert_eq!(seen.len(), ALLOWED.len(), "{seen:?}");
}

/// `cargo test` and the headless examples must not build a renderer. `cargo tree` of the default members lists the packages that cargo
/// builds for them on this machine.
#[test]
fn the_default_build_has_no_renderer() {
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".into());
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
    let tree = ["tree", "--locked", "--edges", "normal,build,dev", "--prefix", "none", "--format", "{p}"];
    let output = std::process::Command::new(cargo).current_dir(root).args(tree).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    let names: BTreeSet<&str> = text.lines().filter_map(|line| line.split(' ').next()).collect();
    assert!(
        names.contains("bevy_mesh") && names.contains("palpate_tests"),
        "the tree is not that of the workspace"
    );
    // The reader of glTF files depends on `bevy_window`, the description of a window. Nothing may open one.
    for other in ["wgpu", "winit", "bevy_render", "bevy_pbr", "bevy_winit", "egui", "avian3d"] {
        assert!(!names.contains(other), "the default build has {other}");
    }
}

#[test]
fn every_feature_is_in_every_table() {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
    let metadata =
        MetadataCommand::new().manifest_path(format!("{root}/Cargo.toml")).no_deps().exec().unwrap();
    let package =
        metadata.workspace_packages().into_iter().find(|p| p.name.as_str() == "bevy_palpate").unwrap();
    let of_package: BTreeSet<&str> =
        package.features.keys().map(String::as_str).filter(|name| *name != "default").collect();
    for file in ["README.md", "crates/bevy_palpate/README.md", "crates/bevy_palpate/src/lib.rs"] {
        let text = std::fs::read_to_string(format!("{root}/{file}")).unwrap();
        let rows = text.lines().map(|line| line.trim_start_matches("//! "));
        let table = rows.skip_while(|line| !line.starts_with("| feature |")).skip(2);
        let listed: BTreeSet<&str> =
            table.map_while(|line| line.strip_prefix("| `")?.split('`').next()).collect();
        assert_eq!(listed, of_package, "{file}");
    }
}
