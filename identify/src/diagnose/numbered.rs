//! Maps by the place of a column: places are numbers that nobody chooses to collide, and are looked up millions of times.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// What is known of columns, by their places.
pub(crate) type ColumnMap<T> = HashMap<usize, T, BuildHasherDefault<ColumnHasher>>;

/// Spreads numbers by a multiplication (D. Knuth, The Art of Computer Programming 3, 1973, sec. 6.4).
#[derive(Default)]
pub(crate) struct ColumnHasher(u64);

/// 2^64 over the golden ratio.
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
