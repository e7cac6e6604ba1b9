//! Dependencies between crates, and between the files of a crate.

mod crate_imports;
mod import_circles;
