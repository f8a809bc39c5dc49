//! Nothing of its own: the tests stand in `tests/`, and the examples of docs/rust.md and of
//! docs/developers/growing-types.md are tests here.

#[cfg(doctest)]
mod may_grow;

#[cfg(doctest)]
#[doc = include_str!("../../../docs/rust.md")]
struct RustPage;

#[cfg(doctest)]
#[doc = include_str!("../../../docs/developers/growing-types.md")]
struct GrowingTypes;
