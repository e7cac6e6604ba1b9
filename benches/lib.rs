//! Benchmarks of palpate: see `ring.rs` and `reduce.rs`.
