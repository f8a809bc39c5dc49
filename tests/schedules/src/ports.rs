//! No port here has a name that programs could meet at.

pub(crate) mod key {
    use std::convert::Infallible;
    use std::fmt;

    /// There is none.
    #[derive(Debug, Clone)]
    pub(crate) struct PortKey(Infallible);

    impl fmt::Display for PortKey {
        fn fmt(&self, _: &mut fmt::Formatter<'_>) -> fmt::Result {
            match self.0 {}
        }
    }
}
