//! Text as somebody gave it, in quotes: nothing in it can move a terminal's cursor or hide where it ends.

use std::fmt;

/// `"as it was given"`, with what cannot be printed escaped.
pub(super) struct Quoted<'a>(pub(super) &'a str);

impl fmt::Display for Quoted<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("\"")?;
        for letter in self.0.chars() {
            match letter {
                '\\' => f.write_str(r"\\")?,
                '\n' => f.write_str(r"\n")?,
                '\r' => f.write_str(r"\r")?,
                '\t' => f.write_str(r"\t")?,
                '"' => f.write_str("\\\"")?,
                '\'' => f.write_str("'")?,
                // Rust knows what cannot be printed, and escapes it in its own way.
                _ if letter.escape_debug().len() == 1 => write!(f, "{letter}")?,
                _ => match u32::from(letter) {
                    code @ 0..=0xFF => write!(f, "\\x{code:02x}")?,
                    code @ 0x100..=0xFFFF => write!(f, "\\u{code:04x}")?,
                    code => write!(f, "\\U{code:08x}")?,
                },
            }
        }
        f.write_str("\"")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_printed_is_escaped() {
        for (text, shown) in [
            ("sim://x", "\"sim://x\""),
            ("it's", "\"it's\""),
            ("'\"", "\"'\\\"\""),
            ("a\u{1b}[31m\\\n", r#""a\x1b[31m\\\n""#),
            ("é\u{200b}\u{e0001}", r#""é\u200b\U000e0001""#),
        ] {
            assert_eq!(Quoted(text).to_string(), shown);
        }
    }
}
