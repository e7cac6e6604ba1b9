//! Benchmarks of palpate: see `ring.rs`.
