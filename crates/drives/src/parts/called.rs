//! What the drives of a family are called, beside the name of its profile.

/// Whose drives they are, and what stands on them.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Called {
    /// Who makes them; empty where the profile does not say.
    pub maker: String,
    /// Names of the maker's for drives of this family, such as `VFD-MS300`.
    pub models: Vec<String>,
    /// Drives with another maker's name that are these.
    pub aliases: Vec<Alias>,
}

/// A drive with another name that has the registers and commands of a family.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Alias {
    /// Its maker and its name: `Huanyang GT`.
    pub name: String,
    /// How much of the family is known of it.
    pub note: String,
    /// Who says so.
    pub source: String,
}

impl Called {
    /// Each of its names, and `title` with and without its maker.
    pub(crate) fn names<'a>(&'a self, title: &'a str) -> impl Iterator<Item = &'a str> {
        let alone = title.strip_prefix(self.maker.as_str()).filter(|_| !self.maker.is_empty());
        let aliases = self.aliases.iter().map(|alias| alias.name.as_str());
        [Some(title), alone].into_iter().flatten().chain(self.models.iter().map(String::as_str)).chain(aliases)
    }
}
