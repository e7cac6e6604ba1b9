//! Benchmarks of palpate.
