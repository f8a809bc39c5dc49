//! Nothing of its own: the benchmarks stand beside `Cargo.toml`.
