//! A value of `profile.toml` that knows where it stands.

use std::ops::Deref;

use serde::Deserialize;
use toml::Spanned;

/// A value and its place. A type of our own, because the schema of the file is made of the types that read it, and says
/// nothing of places.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(transparent)]
pub(super) struct Placed<T>(Spanned<T>);

impl<T> Placed<T> {
    /// `value`, as if it stood where `self` does.
    pub(super) fn beside<U>(&self, value: U) -> Placed<U> {
        Placed(Spanned::new(self.0.span(), value))
    }
}

impl<T> Deref for Placed<T> {
    type Target = Spanned<T>;

    fn deref(&self) -> &Spanned<T> {
        &self.0
    }
}

#[cfg(test)]
impl<T: schemars::JsonSchema> schemars::JsonSchema for Placed<T> {
    fn inline_schema() -> bool {
        T::inline_schema()
    }

    fn schema_name() -> std::borrow::Cow<'static, str> {
        T::schema_name()
    }

    fn schema_id() -> std::borrow::Cow<'static, str> {
        T::schema_id()
    }

    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        T::json_schema(generator)
    }
}
