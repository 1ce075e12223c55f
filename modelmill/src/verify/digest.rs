//! SHA-256 of files, so that a result states exactly which files it belongs to (FIPS 180-4).

use std::io::Read;
use std::path::Path;

use modelmill_boundary::files::{FileError, FileFault, FileSource, OpenFile, PathKind};
use sha2::{Digest, Sha256};

/// Bytes that are read from a file at once.
const PORTION: usize = 1 << 16;

/// SHA-256 of bytes, as 64 hexadecimal digits.
pub(super) fn hash_bytes(bytes: &[u8]) -> String {
    digits(Sha256::digest(bytes).as_slice())
}

/// SHA-256 of a file, as 64 hexadecimal digits. `None` for a pipe or a device, which cannot be read a second time.
///
/// Fails when the file cannot be read.
pub fn hash_file(files: &dyn FileSource, path: &Path) -> Result<Option<String>, FileError> {
    if files.kind(path) != PathKind::File {
        return Ok(None);
    }
    let mut file = match files.open(path, u64::MAX)? {
        OpenFile::Memory(bytes) => return Ok(Some(hash_bytes(&bytes))),
        OpenFile::File(file) => file,
    };
    let mut hash = Sha256::new();
    let mut portion = vec![0; PORTION];
    loop {
        let read = file.read(&mut portion).map_err(|error| {
            let (kind, says) = (error.kind(), error.to_string());
            FileError::new(path, FileFault::System { kind, says })
        })?;
        if read == 0 {
            return Ok(Some(digits(hash.finalize().as_slice())));
        }
        hash.update(&portion[..read]);
    }
}

/// Bytes as hexadecimal digits.
fn digits(bytes: &[u8]) -> String {
    bytes
        .iter()
        .fold(String::new(), |digits, byte| digits + &format!("{byte:02x}"))
}

#[cfg(test)]
mod tests {
    use modelmill_boundary::files::MemoryFiles;

    use super::*;

    /// The examples of FIPS 180-4 (NIST, "SHA-256 examples"), and the digits of small bytes.
    #[test]
    fn hashes_are_those_of_the_standard() {
        let expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(hash_bytes(b"abc"), expected);
        let files = MemoryFiles::default().with_file("abc", b"abc".to_vec());
        assert_eq!(
            hash_file(&files, Path::new("abc")).expect("a file"),
            Some(expected.to_owned())
        );
        assert_eq!(
            hash_bytes(b""),
            "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
        );
    }
}
