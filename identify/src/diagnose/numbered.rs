//! Hash maps with column indices as keys. The indices come from the program itself, so a fast hash function without
//! protection against collisions is enough for millions of look-ups.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// Values by column index.
pub(crate) type ColumnMap<T> = HashMap<usize, T, BuildHasherDefault<ColumnHasher>>;

/// Hash function that multiplies by a constant (D. Knuth, The Art of Computer Programming 3, 1973, sec. 6.4).
#[derive(Default)]
pub(crate) struct ColumnHasher(u64);

/// 2^64 divided by the golden ratio.
const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

impl Hasher for ColumnHasher {
    fn write(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.write_u64(u64::from(*byte));
        }
    }

    fn write_u64(&mut self, number: u64) {
        self.0 = (self.0 ^ number).wrapping_mul(GOLDEN);
    }

    fn write_usize(&mut self, number: usize) {
        self.write_u64(number as u64);
    }

    fn finish(&self) -> u64 {
        self.0
    }
}
