//! Dependencies of the crates on each other and on external crates: only those of the table.

use cargo_metadata::{DependencyKind, MetadataCommand};
use std::collections::BTreeSet;

/// Allowed dependencies of each crate, except `thiserror`: `(crate, allowed)`.
const ALLOWED: [(&str, &[&str]); 10] = [
    (
        "palpate_files",
        &[
            "base64",
            "draco-core",
            "lz4_flex",
            "meshoptimizer-rs",
            "miniz_oxide",
            "roxmltree",
            "serde",
            "serde_json",
        ],
    ),
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
            "faer",
            "glam",
            "palpate_files",
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
            "palpate_files",
            "serde",
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

/// A library or program whose unit tests are switched off is not compiled a second time, and has none.
#[test]
fn switched_off_unit_tests_hide_no_test() {
    let manifest = concat!(env!("CARGO_MANIFEST_DIR"), "/../../Cargo.toml");
    let metadata = MetadataCommand::new().manifest_path(manifest).no_deps().exec().unwrap();
    let mut switched_off = 0;
    // Elsewhere a library lies beside the tests that use it.
    let is_crate = |manifest: &str| manifest.contains("/crates/");
    for package in metadata.workspace_packages().into_iter().filter(|p| is_crate(p.manifest_path.as_str())) {
        let sources: Vec<_> = package
            .targets
            .iter()
            .filter(|target| !target.test && (target.is_lib() || target.is_bin()))
            .collect();
        for folder in sources.iter().filter_map(|target| target.src_path.parent()) {
            switched_off += 1;
            // A program without unit tests may lie beside a library that has some.
            let is_program = sources.iter().all(|target| target.is_bin());
            let hidden = files_with_tests(folder.as_std_path(), is_program);
            assert!(hidden.is_empty(), "tests that do not run: {hidden:?}");
        }
    }
    assert!(switched_off > 0);
}

/// Rust files in `folder` that contain a test; with `only_main`, of `main.rs` alone.
fn files_with_tests(folder: &std::path::Path, only_main: bool) -> Vec<std::path::PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries
        .flat_map(|path| {
            if path.is_dir() {
                return if only_main { Vec::new() } else { files_with_tests(&path, false) };
            }
            let is_examined = path.extension().is_some_and(|extension| extension == "rs")
                && (!only_main || path.file_name().is_some_and(|name| name == "main.rs"));
            let has_test = is_examined && std::fs::read_to_string(&path).unwrap().contains("#[test]");
            if has_test { vec![path] } else { Vec::new() }
        })
        .collect()
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
