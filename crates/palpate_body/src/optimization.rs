//! Whether the crate is compiled with optimisation.

/// Returns whether this crate was compiled with optimisation (`opt-level` above 0). Without it a step is tens of times slower, and a
/// haptic loop misses its deadlines.
///
/// The profile of palpate's own workspace does not apply to an app. Add it to the `Cargo.toml` of the app's workspace, or build with
/// `--release`:
///
/// ```toml
/// [profile.dev.package."*"]
/// opt-level = 3
/// ```
#[must_use]
pub const fn is_optimized() -> bool {
    !cfg!(palpate_unoptimized)
}

#[cfg(test)]
#[path = "../build.rs"]
#[expect(dead_code, reason = "the main function of the build script")]
mod build_script;

#[cfg(test)]
mod tests {
    use super::{build_script::instructions, is_optimized};

    #[test]
    fn build_without_optimisation_warns_once_and_sets_the_flag() {
        let of_level = |level| instructions(level).into_iter().filter(|line| !line.contains("rerun-if"));
        let warnings = |level| of_level(level).filter(|line| line.starts_with("cargo::warning=")).count();
        let flags = |level| of_level(level).filter(|line| line.starts_with("cargo::rustc-cfg=")).count();
        assert_eq!((warnings("0"), flags("0")), (1, 1));
        for level in ["1", "2", "3", "s", "z"] {
            assert_eq!((warnings(level), flags(level)), (0, 0), "{level}");
        }
    }

    #[test]
    fn this_workspace_is_optimized() {
        assert!(is_optimized());
    }
}
