//! The fingerprint of files that are written together: their texts go in, a number comes out that stands in each of
//! them. Files of different models or of different runs of the program are then refused by the compiler.
//!
//! The number is FNV-1a with 64 bits (Fowler, Noll and Vo). It protects against mistakes, not against attackers.

use std::fmt;

/// The fingerprint of a set of texts, printed as a number of C and Rust.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Fingerprint(u64);

impl Fingerprint {
    /// The fingerprint of texts in a fixed order.
    pub(crate) fn new<'a>(texts: impl IntoIterator<Item = &'a str>) -> Self {
        let mut hash = 0xcbf2_9ce4_8422_2325_u64;
        for text in texts {
            // The byte 255 occurs in no text, so that a byte that moves to the next text changes the hash.
            for byte in text.bytes().chain([0xff]) {
                hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
            }
        }
        Self(hash)
    }
}

impl fmt::Display for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "0x{:016x}", self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fingerprint_depends_on_each_byte_and_on_the_limits_of_texts() {
        // The published value for the bytes `a` and 255 by the definition of the hash.
        let step = |hash: u64, byte: u64| (hash ^ byte).wrapping_mul(0x0100_0000_01b3);
        let expected = step(step(0xcbf2_9ce4_8422_2325, 97), 255);
        assert_eq!(Fingerprint::new(["a"]).to_string(), format!("{expected:#018x}"));
        assert_ne!(Fingerprint::new(["ab", "c"]), Fingerprint::new(["a", "bc"]));
        assert_ne!(Fingerprint::new(["a", ""]), Fingerprint::new(["a"]));
    }
}
