//! Mutations of a file: bits, bytes, numbers, lengths, repeated parts, and parts of other files. The same seed gives the
//! same bytes on every machine.

/// Longest mutated input in bytes.
const LONGEST_INPUT: usize = 1 << 18;
/// Most mutations of one input.
const MOST_MUTATIONS: u64 = 6;
/// Longest part, and most repetitions of one, as a power of two. Many repetitions find work that takes the square of a
/// number.
const LONGEST_PART: usize = 12;

/// Sizes and counts at the limits of integers.
const SIZES: [u64; 10] = [
    0,
    1,
    0x7f,
    0xff,
    0xffff,
    0x7fff_ffff,
    0xffff_ffff,
    0x7fff_ffff_ffff_ffff,
    0xffff_ffff_ffff_fffe,
    0xffff_ffff_ffff_ffff,
];

/// Words that mean something to some reader of text.
const WORDS: [&str; 40] = [
    "0",
    "-1",
    "1e308",
    "-1e-308",
    "1e999",
    "nan",
    "inf",
    "-0.0",
    "9223372036854775807",
    "18446744073709551616",
    "1/0",
    "\n",
    "\r\n",
    "\t",
    ",",
    ";",
    "\"",
    "'",
    "\\",
    "#",
    "%",
    "[",
    "]",
    "{",
    "}",
    "(",
    ")",
    "=",
    ".",
    "<",
    "/>",
    "<!--",
    "&#0;",
    "\u{feff}",
    "\u{202e}",
    "\u{0}",
    "true",
    "null",
    "^64",
    "sqrt(",
];

/// A generator of pseudorandom numbers (`SplitMix64`; Steele, Lea and Flood 2014).
#[derive(Clone, Debug)]
pub struct MutationNoise(u64);

impl MutationNoise {
    /// A generator with a seed.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next number.
    pub fn number(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number below a bound; 0 for the bound 0.
    pub fn below(&mut self, bound: usize) -> usize {
        usize::try_from(self.number() % (bound.max(1) as u64)).unwrap_or(0)
    }
}

impl MutationNoise {
    /// A length from 1 on; each power of two is as frequent as any other.
    fn length(&mut self) -> usize {
        let power = self.below(LONGEST_PART);
        1 + self.below(1 << power)
    }
}

/// A mutation of one of the files.
pub fn mutate(files: &[Vec<u8>], noise: &mut MutationNoise) -> Vec<u8> {
    let Some(file) = files.get(noise.below(files.len())) else {
        return Vec::new();
    };
    let mut bytes = file.clone();
    for _ in 0..=noise.number() % MOST_MUTATIONS {
        mutate_once(&mut bytes, files, noise);
    }
    bytes.truncate(LONGEST_INPUT);
    bytes
}

/// One mutation.
fn mutate_once(bytes: &mut Vec<u8>, files: &[Vec<u8>], noise: &mut MutationNoise) {
    let n = bytes.len();
    let at = noise.below(n);
    let length = noise.length();
    let end = (at + length).min(n);
    match noise.below(9) {
        0 if n > 0 => bytes[at] ^= 1 << noise.below(8),
        1 if n > 0 => bytes[at] = noise.number().to_le_bytes()[0],
        2 => drop(bytes.drain(at..end)),
        3 => bytes.truncate(at),
        4 => write_size(bytes, at, noise),
        5 => {
            let word = WORDS[noise.below(WORDS.len())].as_bytes();
            bytes.splice(at..at, word.iter().copied());
        }
        6 => {
            let part = bytes[at..end].to_vec();
            let times = noise.length().min(1 + LONGEST_INPUT / part.len().max(1));
            bytes.splice(at..at, part.repeat(times));
        }
        7 => {
            // A part of another file, or of the same one from another place.
            let other = files.get(noise.below(files.len())).map_or(&[][..], Vec::as_slice);
            let from = noise.below(other.len());
            let part = &other[from..(from + length).min(other.len())];
            bytes.splice(at..end, part.iter().copied());
        }
        _ => {
            // Digits of a number in text.
            let Some(digit) = bytes[at..].iter().position(u8::is_ascii_digit) else {
                return;
            };
            let word = WORDS[noise.below(10)].as_bytes();
            bytes.splice(at + digit..=at + digit, word.iter().copied());
        }
    }
}

/// Overwrites one to eight bytes by a size in one of both byte orders.
fn write_size(bytes: &mut [u8], at: usize, noise: &mut MutationNoise) {
    let size = SIZES[noise.below(SIZES.len())].wrapping_add(noise.number() % 3);
    let width = 1_usize << noise.below(4);
    let mut text = size.to_le_bytes()[..width].to_vec();
    if noise.below(2) == 0 {
        text.reverse();
    }
    for (byte, new) in bytes.iter_mut().skip(at).zip(text) {
        *byte = new;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_seed_gives_the_same_bytes() {
        let files = [b"t,q\n0,1\n1,2\n".to_vec(), Vec::new(), vec![7; 300]];
        let all = |seed| {
            let mut noise = MutationNoise::new(seed);
            (0..500).map(|_| mutate(&files, &mut noise)).collect::<Vec<_>>()
        };
        let found = all(3);
        assert_eq!(found, all(3));
        assert_ne!(found, all(4));
        assert!(found.iter().all(|bytes| bytes.len() <= LONGEST_INPUT));
        assert!(found.iter().filter(|bytes| !files.contains(bytes)).count() > 250);
        assert!(mutate(&[], &mut MutationNoise::new(1)).is_empty());
    }
}
