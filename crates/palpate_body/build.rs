//! Warns of a build without optimisation.

use std::io::Write;

fn main() -> std::io::Result<()> {
    let level = std::env::var("OPT_LEVEL").unwrap_or_default();
    let mut out = std::io::stdout();
    instructions(&level).into_iter().try_for_each(|instruction| writeln!(out, "{instruction}"))
}

/// Instructions to cargo for a crate that is compiled at `opt_level`.
pub(crate) fn instructions(opt_level: &str) -> Vec<&'static str> {
    let always = ["cargo::rerun-if-changed=build.rs", "cargo::rustc-check-cfg=cfg(palpate_unoptimized)"];
    // Cargo shows the warning for path dependencies; `palpate_body::is_optimized` serves the others.
    let unoptimized = [
        "cargo::rustc-cfg=palpate_unoptimized",
        "cargo::warning=palpate_body is built without optimisation, which is tens of times slower; build with --release, or add \
         [profile.dev.package.\"*\"] with opt-level = 3 to the Cargo.toml of your workspace",
    ];
    let mut instructions = always.to_vec();
    if opt_level == "0" {
        instructions.extend(unoptimized);
    }
    instructions
}
