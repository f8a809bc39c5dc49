//! What two programs of one user both know, and nobody else: random bytes, and how one shows that it knows them.

use std::fmt;

use hmac::{Hmac, KeyInit, Mac};
use sha2::Sha256;
use sha2::digest::Output;

/// Bytes of a secret, and of what is used once.
pub(crate) const LENGTH: usize = 32;
/// Bytes of a key of this kind; a shorter one is followed by zeros. Source: RFC 2104, §2.
const KEY: usize = 64;

/// A secret of 256 bits. Two are compared only where both are this program's to know.
#[derive(Clone, PartialEq, Eq)]
pub(crate) struct Secret([u8; LENGTH]);

impl Secret {
    /// One that nobody can tell.
    ///
    /// # Errors
    ///
    /// The system has no random bytes.
    pub(crate) fn random() -> std::io::Result<Self> {
        random().map(Self)
    }

    #[cfg(test)]
    pub(crate) const fn of(bytes: [u8; LENGTH]) -> Self {
        Self(bytes)
    }

    /// As two letters a byte.
    pub(crate) fn written(&self) -> String {
        let digits = self.0.iter().flat_map(|byte| [byte >> 4, byte & 0xF]);
        digits.filter_map(|digit| char::from_digit(digit.into(), 16)).collect()
    }

    /// What [`written`](Self::written) wrote.
    pub(crate) fn read(text: &str) -> Option<Self> {
        let digits = text.as_bytes();
        let mut bytes = [0; LENGTH];
        if digits.len() != 2 * LENGTH {
            return None;
        }
        for (byte, pair) in bytes.iter_mut().zip(digits.chunks(2)) {
            *byte = u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok()?;
        }
        Some(Self(bytes))
    }

    /// The code by which who knows the secret says `parts`: HMAC-SHA256.
    pub(crate) fn code(&self, parts: &[&[u8]]) -> Output<Sha256> {
        self.over(parts).finalize().into_bytes()
    }

    /// Whether `code` is that of `parts`. How long it takes tells nobody how much of it is right.
    pub(crate) fn is_code(&self, code: &[u8], parts: &[&[u8]]) -> bool {
        self.over(parts).verify_slice(code).is_ok()
    }

    fn over(&self, parts: &[&[u8]]) -> Hmac<Sha256> {
        let mut key = [0; KEY];
        key[..LENGTH].copy_from_slice(&self.0);
        let mut mac = Hmac::new(&key.into());
        for part in parts {
            mac.update(part);
        }
        mac
    }
}

impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Secret")
    }
}

/// Bytes that nobody can tell.
pub(crate) fn random() -> std::io::Result<[u8; LENGTH]> {
    let mut bytes = [0; LENGTH];
    getrandom::fill(&mut bytes).map_err(std::io::Error::other)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By Python: `hmac.new(bytes(range(32)), b"Hi There", hashlib.sha256).hexdigest()`.
    #[test]
    fn the_code_is_that_of_another_implementation() {
        let secret = Secret::of(std::array::from_fn(|at| u8::try_from(at).unwrap()));
        let code = secret.code(&[b"Hi", b" There"]);
        let theirs = Secret::read("278639ec02309d3afded1b273f1349ba63b9089c12476d716bee3ecc94673e9e").unwrap();
        assert_eq!(code[..], theirs.0);
        assert!(secret.is_code(&code, &[b"Hi There"]));
        assert!(!secret.is_code(&code[..31], &[b"Hi There"]) && !secret.is_code(&[], &[b"Hi There"]));
        assert!(!secret.is_code(&code, &[b"Hi There!"]));
        assert!(!Secret::of([0; LENGTH]).is_code(&code, &[b"Hi There"]));
    }

    #[test]
    fn a_secret_is_read_as_it_was_written_and_shown_to_nobody() {
        let secret = Secret::random().unwrap();
        assert_eq!(Secret::read(&secret.written()), Some(secret.clone()));
        assert_ne!(secret, Secret::random().unwrap());
        assert_eq!(format!("{secret:?}"), "Secret");
        for wrong in ["", "00", &"0".repeat(63), &"0".repeat(65), &"g".repeat(64), &"é".repeat(32)] {
            assert_eq!(Secret::read(wrong), None, "{wrong}");
        }
    }
}
