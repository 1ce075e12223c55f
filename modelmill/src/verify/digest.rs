//! SHA-256 of files, so that a result can state exactly which files it belongs to (FIPS 180-4).

use std::io::Read;
use std::path::Path;

use modelmill_boundary::files::{FileError, FileFault, FileSource, OpenFile, PathKind};

/// Bytes of one block of the algorithm.
const BLOCK: usize = 64;
/// Bytes that are read from a file at once.
const PORTION: usize = 1 << 16;

/// SHA-256 of a sequence of bytes that comes in pieces.
#[derive(Clone, Debug)]
pub struct Sha256 {
    /// The hash of the complete blocks.
    state: [u32; 8],
    /// The bytes of the block that is not complete.
    rest: Vec<u8>,
    /// Number of bytes so far.
    length: u64,
}

impl Default for Sha256 {
    fn default() -> Self {
        Self {
            state: [
                0x6a09_e667,
                0xbb67_ae85,
                0x3c6e_f372,
                0xa54f_f53a,
                0x510e_527f,
                0x9b05_688c,
                0x1f83_d9ab,
                0x5be0_cd19,
            ],
            rest: Vec::new(),
            length: 0,
        }
    }
}

impl Sha256 {
    /// Adds bytes.
    pub fn update(&mut self, bytes: &[u8]) {
        self.length += bytes.len() as u64;
        self.rest.extend_from_slice(bytes);
        let complete = self.rest.len() / BLOCK * BLOCK;
        for block in self.rest[..complete].chunks_exact(BLOCK) {
            add_block(&mut self.state, block);
        }
        self.rest.drain(..complete);
    }

    /// The hash of all bytes, as 64 hexadecimal digits.
    pub fn finish(mut self) -> String {
        let bits = self.length.wrapping_mul(8);
        self.rest.push(0x80);
        while self.rest.len() % BLOCK != BLOCK - 8 {
            self.rest.push(0);
        }
        self.rest.extend_from_slice(&bits.to_be_bytes());
        for block in self.rest.chunks_exact(BLOCK) {
            add_block(&mut self.state, block);
        }
        let [a, b, c, d, e, f, g, h] = self.state;
        format!("{a:08x}{b:08x}{c:08x}{d:08x}{e:08x}{f:08x}{g:08x}{h:08x}")
    }

    /// The hash of a file. `None` for a pipe or a device, which cannot be read a second time.
    ///
    /// Fails when the file cannot be read.
    pub fn hash_file(files: &dyn FileSource, path: &Path) -> Result<Option<String>, FileError> {
        if files.kind(path) != PathKind::File {
            return Ok(None);
        }
        let mut hash = Self::default();
        match files.open(path, u64::MAX)? {
            OpenFile::Memory(bytes) => hash.update(&bytes),
            OpenFile::File(mut file) => {
                let mut portion = vec![0; PORTION];
                loop {
                    let n = file.read(&mut portion).map_err(|error| {
                        let says = error.to_string();
                        FileError::new(
                            path,
                            FileFault::System {
                                kind: error.kind(),
                                says,
                            },
                        )
                    })?;
                    if n == 0 {
                        break;
                    }
                    hash.update(&portion[..n]);
                }
            }
        }
        Ok(Some(hash.finish()))
    }
}

/// The constants of the rounds: the first 32 bits of the fractional parts of the cube roots of the first 64 primes.
const ROUNDS: [u32; 64] = [
    0x428a_2f98,
    0x7137_4491,
    0xb5c0_fbcf,
    0xe9b5_dba5,
    0x3956_c25b,
    0x59f1_11f1,
    0x923f_82a4,
    0xab1c_5ed5,
    0xd807_aa98,
    0x1283_5b01,
    0x2431_85be,
    0x550c_7dc3,
    0x72be_5d74,
    0x80de_b1fe,
    0x9bdc_06a7,
    0xc19b_f174,
    0xe49b_69c1,
    0xefbe_4786,
    0x0fc1_9dc6,
    0x240c_a1cc,
    0x2de9_2c6f,
    0x4a74_84aa,
    0x5cb0_a9dc,
    0x76f9_88da,
    0x983e_5152,
    0xa831_c66d,
    0xb003_27c8,
    0xbf59_7fc7,
    0xc6e0_0bf3,
    0xd5a7_9147,
    0x06ca_6351,
    0x1429_2967,
    0x27b7_0a85,
    0x2e1b_2138,
    0x4d2c_6dfc,
    0x5338_0d13,
    0x650a_7354,
    0x766a_0abb,
    0x81c2_c92e,
    0x9272_2c85,
    0xa2bf_e8a1,
    0xa81a_664b,
    0xc24b_8b70,
    0xc76c_51a3,
    0xd192_e819,
    0xd699_0624,
    0xf40e_3585,
    0x106a_a070,
    0x19a4_c116,
    0x1e37_6c08,
    0x2748_774c,
    0x34b0_bcb5,
    0x391c_0cb3,
    0x4ed8_aa4a,
    0x5b9c_ca4f,
    0x682e_6ff3,
    0x748f_82ee,
    0x78a5_636f,
    0x84c8_7814,
    0x8cc7_0208,
    0x90be_fffa,
    0xa450_6ceb,
    0xbef9_a3f7,
    0xc671_78f2,
];

/// Adds one block of 64 bytes to the state.
fn add_block(state: &mut [u32; 8], block: &[u8]) {
    let mut w = [0_u32; 64];
    for (word, bytes) in w.iter_mut().zip(block.chunks_exact(4)) {
        *word = bytes.iter().fold(0, |word, byte| word << 8 | u32::from(*byte));
    }
    for i in 16..64 {
        let s0 = w[i - 15].rotate_right(7) ^ w[i - 15].rotate_right(18) ^ (w[i - 15] >> 3);
        let s1 = w[i - 2].rotate_right(17) ^ w[i - 2].rotate_right(19) ^ (w[i - 2] >> 10);
        w[i] = w[i - 16].wrapping_add(s0).wrapping_add(w[i - 7]).wrapping_add(s1);
    }
    let [mut a, mut b, mut c, mut d, mut e, mut f, mut g, mut h] = *state;
    for i in 0..64 {
        let s1 = e.rotate_right(6) ^ e.rotate_right(11) ^ e.rotate_right(25);
        let choice = (e & f) ^ (!e & g);
        let t1 = h
            .wrapping_add(s1)
            .wrapping_add(choice)
            .wrapping_add(ROUNDS[i])
            .wrapping_add(w[i]);
        let s0 = a.rotate_right(2) ^ a.rotate_right(13) ^ a.rotate_right(22);
        let majority = (a & b) ^ (a & c) ^ (b & c);
        [h, g, f, e, d, c, b] = [g, f, e, d.wrapping_add(t1), c, b, a];
        a = t1.wrapping_add(s0.wrapping_add(majority));
    }
    for (sum, word) in state.iter_mut().zip([a, b, c, d, e, f, g, h]) {
        *sum = sum.wrapping_add(word);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The hash of bytes that come in pieces of `piece` bytes.
    fn hash(bytes: &[u8], piece: usize) -> String {
        let mut hash = Sha256::default();
        bytes.chunks(piece).for_each(|piece| hash.update(piece));
        hash.finish()
    }

    /// The examples of FIPS 180-4 (NIST, "SHA-256 examples").
    #[test]
    fn hashes_are_those_of_the_standard() {
        let long = b"abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq";
        for (bytes, expected) in [
            (
                &b""[..],
                "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855",
            ),
            (
                b"abc",
                "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad",
            ),
            (long, "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1"),
        ] {
            assert_eq!(hash(bytes, 1), expected);
            assert_eq!(hash(bytes, 100), expected);
        }
        let million = vec![b'a'; 1_000_000];
        let expected = "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0";
        assert_eq!(hash(&million, 977), expected);
    }
}
