//! Files on a disk, and other things that a path may lead to.
//!
//! - An ordinary file is read up to the limit.
//! - Standard input and pipes of a shell (`/dev/stdin`, `<(zcat run.csv.gz)`) are read up to the limit. There is no
//!   timeout, because the shell has started the writer together with this program.
//! - A named pipe has the timeout [`DiskFiles::pipe_timeout`] for its opening and between its bytes, because it may
//!   have no writer.
//! - Devices and sockets are refused, unless one is standard input.

use std::fs::{File, Metadata};
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use super::write::write_with_timeout;
use super::{FileError, FileFault, FileSource, OpenFile, PathKind, stream};

/// The files of this machine. Clones share the list of files that were read.
#[derive(Clone, Debug)]
pub struct DiskFiles {
    /// Longest time without bytes from a named pipe.
    pub pipe_timeout: Duration,
    /// Files that were read, which are therefore never overwritten.
    read: Arc<Mutex<Vec<FileIdentity>>>,
}

/// The identity of a file, independent of links.
#[derive(Clone, Debug, PartialEq, Eq)]
enum FileIdentity {
    /// Number of the device and of the file on it; hard links have the same numbers.
    #[cfg(unix)]
    Number(u64, u64),
    /// The path after all links are resolved.
    #[cfg(not(unix))]
    Path(PathBuf),
}

impl Default for DiskFiles {
    fn default() -> Self {
        Self {
            pipe_timeout: stream::DEFAULT_PIPE_TIMEOUT,
            read: Arc::default(),
        }
    }
}

impl DiskFiles {
    /// Whether a path leads to a file that was read here, also through links.
    pub fn has_read(&self, path: &Path) -> bool {
        identity(path).is_some_and(|found| self.lock_read_identities().contains(&found))
    }

    /// Writes a file atomically (see [`write()`](super::write())). Fails when it is a file that was read here.
    pub fn write(&self, path: &Path, bytes: &[u8]) -> Result<(), FileError> {
        self.write_together(&[(path, bytes)])
    }

    /// Writes several files as one act (see [`write_together()`](super::write_together())). Fails when one of them was
    /// read here.
    pub fn write_together(&self, files: &[(&Path, &[u8])]) -> Result<(), FileError> {
        if let Some((path, _)) = files.iter().find(|(path, _)| self.has_read(path)) {
            return Err(FileError::new(path, FileFault::Input));
        }
        write_with_timeout(files, self.pipe_timeout)
    }

    /// Writes a file atomically over one that was read, for edits in place.
    pub fn replace(&self, path: &Path, bytes: &[u8]) -> Result<(), FileError> {
        let old = identity(path);
        write_with_timeout(&[(path, bytes)], self.pipe_timeout)?;
        // The old file is gone, and its number may be used for another one.
        let mut known = self.lock_read_identities();
        known.retain(|one| Some(one) != old.as_ref());
        known.extend(identity(path));
        Ok(())
    }

    /// The files that were read; a lock of a thread that panicked is still valid.
    fn lock_read_identities(&self) -> std::sync::MutexGuard<'_, Vec<FileIdentity>> {
        self.read.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a file to those that were read.
    fn record_read(&self, path: &Path) {
        if let Some(found) = identity(path) {
            let mut known = self.lock_read_identities();
            if !known.contains(&found) {
                known.push(found);
            }
        }
    }
}

impl FileSource for DiskFiles {
    fn read(&self, path: &Path, most: u64) -> Result<Vec<u8>, FileError> {
        match self.open(path, most)? {
            OpenFile::File(file) => read_capped(file, path, most),
            OpenFile::Memory(bytes) => Ok(Arc::unwrap_or_clone(bytes)),
        }
    }

    fn kind(&self, path: &Path) -> PathKind {
        match path.metadata() {
            Ok(found) => kind_of(&found, path),
            Err(_) => PathKind::Missing,
        }
    }

    fn list(&self, folder: &Path) -> Result<Vec<PathBuf>, FileError> {
        // Entries are sorted, because the order of a disk is arbitrary.
        let fail = |error: io::Error| FileError::from_io_error(folder, &error);
        let entries = std::fs::read_dir(folder).map_err(fail)?;
        let mut found = entries
            .map(|entry| entry.map(|entry| entry.path()))
            .collect::<Result<Vec<_>, _>>()
            .map_err(fail)?;
        found.sort();
        Ok(found)
    }

    // What the path leads to decides how it is opened.
    fn open(&self, path: &Path, most: u64) -> Result<OpenFile, FileError> {
        let fail = |error: io::Error| FileError::from_io_error(path, &error);
        let found = path.metadata().map_err(fail)?;
        let opened = match kind_of(&found, path) {
            PathKind::File => OpenFile::File(File::open(path).map_err(fail)?),
            PathKind::Stream if is_standard_input(path) => {
                OpenFile::Memory(read_capped(io::stdin().lock(), path, most)?.into())
            }
            PathKind::Stream if is_handed_over(path) => {
                let file = File::open(path).map_err(fail)?;
                OpenFile::Memory(read_capped(file, path, most)?.into())
            }
            PathKind::Stream => OpenFile::Memory(read_pipe_with_timeout(path, most, self.pipe_timeout)?.into()),
            PathKind::Folder => return Err(FileError::new(path, FileFault::Folder)),
            PathKind::Device | PathKind::Missing => {
                return Err(FileError::new(path, FileFault::Device));
            }
        };
        // Only files that could be opened are protected from being overwritten.
        self.record_read(path);
        Ok(opened)
    }
}

/// What an existing path leads to.
fn kind_of(found: &Metadata, path: &Path) -> PathKind {
    if found.is_file() {
        return PathKind::File;
    }
    if found.is_dir() {
        return PathKind::Folder;
    }
    #[cfg(unix)]
    if std::os::unix::fs::FileTypeExt::is_fifo(&found.file_type()) {
        return PathKind::Stream;
    }
    // Anything else that the shell has opened is read as a stream, too.
    if is_handed_over(path) {
        PathKind::Stream
    } else {
        PathKind::Device
    }
}

/// Whether a path is a name of standard input.
fn is_standard_input(path: &Path) -> bool {
    ["/dev/stdin", "/dev/fd/0", "/proc/self/fd/0"]
        .iter()
        .any(|name| path == Path::new(name))
}

/// Whether a path is a descriptor that the shell has opened.
fn is_handed_over(path: &Path) -> bool {
    path == Path::new("/dev/stdin") || path.starts_with("/dev/fd") || path.starts_with("/proc/self/fd")
}

/// All bytes of a stream; fails when there are more than `most`.
fn read_capped(stream: impl Read, path: &Path, most: u64) -> Result<Vec<u8>, FileError> {
    // One byte more than allowed shows that the stream is too long.
    let mut bytes = Vec::new();
    stream
        .take(most.saturating_add(1))
        .read_to_end(&mut bytes)
        .map_err(|error| FileError::from_io_error(path, &error))?;
    if bytes.len() as u64 > most {
        return Err(FileError::new(path, FileFault::TooLarge { most }));
    }
    // A vector that grew by doubling may use up to twice the memory.
    bytes.shrink_to_fit();
    Ok(bytes)
}

/// All bytes of a named pipe. A thread reads them; without a writer that thread waits forever.
///
/// Fails after `patience` without bytes, or when there are more than `most`.
fn read_pipe_with_timeout(path: &Path, most: u64, patience: Duration) -> Result<Vec<u8>, FileError> {
    // The channel is short, so that the thread cannot read far ahead.
    let (sender, receiver) = sync_channel(4);
    let pipe = path.to_owned();
    std::thread::Builder::new()
        .name("reads a named pipe".to_owned())
        .spawn(move || forward_pipe(&pipe, &sender))
        .map_err(|error| FileError::from_io_error(path, &error))?;
    let mut bytes = Vec::new();
    loop {
        match receiver.recv_timeout(patience) {
            Ok(Ok(more)) => bytes.extend_from_slice(&more),
            Ok(Err(error)) => return Err(FileError::from_io_error(path, &error)),
            Err(RecvTimeoutError::Disconnected) => {
                bytes.shrink_to_fit();
                return Ok(bytes);
            }
            Err(RecvTimeoutError::Timeout) => {
                let seconds = patience.as_secs();
                return Err(FileError::new(path, FileFault::Silent { seconds }));
            }
        }
        if bytes.len() as u64 > most {
            return Err(FileError::new(path, FileFault::TooLarge { most }));
        }
    }
}

/// Sends the bytes of a pipe until it ends or the receiver is gone.
fn forward_pipe(pipe: &Path, to: &SyncSender<io::Result<Vec<u8>>>) {
    let mut stream = match File::open(pipe) {
        Ok(stream) => stream,
        Err(error) => return drop(to.send(Err(error))),
    };
    let mut buffer = vec![0; 1 << 16];
    loop {
        let sent = match stream.read(&mut buffer) {
            Ok(0) => return,
            Ok(n) => to.send(Ok(buffer[..n].to_vec())),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => Ok(()),
            Err(error) => return drop(to.send(Err(error))),
        };
        if sent.is_err() {
            return;
        }
    }
}

/// The identity of an ordinary file; `None` for anything else.
#[cfg(unix)]
fn identity(path: &Path) -> Option<FileIdentity> {
    use std::os::unix::fs::MetadataExt;
    let found = path.metadata().ok()?;
    // Terminals and similar devices may be read and written at the same time.
    found.is_file().then(|| FileIdentity::Number(found.dev(), found.ino()))
}

#[cfg(not(unix))]
fn identity(path: &Path) -> Option<FileIdentity> {
    path.canonicalize().ok().map(FileIdentity::Path)
}

#[cfg(all(test, unix))]
mod tests {
    use std::fs::OpenOptions;
    use std::process::Command;

    use super::super::write;
    use super::*;

    /// A folder of its own for a test, gone with it.
    struct Folder(PathBuf);

    impl Folder {
        fn new(name: &str) -> Self {
            let own = format!("modelmill-disk-{name}-{}", std::process::id());
            let path = std::env::temp_dir().join(own);
            std::fs::create_dir_all(&path).unwrap();
            Self(path)
        }

        fn pipe(&self) -> PathBuf {
            let path = self.0.join("pipe");
            assert!(Command::new("mkfifo").arg(&path).status().unwrap().success());
            path
        }

        fn names(&self) -> Vec<String> {
            let listed = DiskFiles::default().list(&self.0).unwrap();
            let name = |path: &PathBuf| path.file_name().unwrap().to_string_lossy().into_owned();
            listed.iter().map(name).collect()
        }
    }

    impl Drop for Folder {
        fn drop(&mut self) {
            let _ = std::fs::remove_dir_all(&self.0);
        }
    }

    fn hasty() -> DiskFiles {
        DiskFiles {
            pipe_timeout: Duration::from_millis(200),
            ..DiskFiles::default()
        }
    }

    #[test]
    fn what_never_ends_is_refused_or_capped() {
        let folder = Folder::new("endless");
        let fault = |path: &Path| hasty().read(path, 100).unwrap_err().fault;
        assert_eq!(fault(Path::new("/dev/zero")), FileFault::Device);
        assert_eq!(fault(&folder.0), FileFault::Folder);
        assert_eq!(fault(&folder.0.join("none")), FileFault::Missing);
        let pipe = folder.pipe();
        assert_eq!(fault(&pipe), FileFault::Silent { seconds: 0 });
        // A pipe of its own: who still waits at the other would read from this one, leave, and end its writer.
        let folder = Folder::new("endless-writer");
        let pipe = folder.pipe();
        let mut endless = Command::new("sh")
            .args(["-c", "exec cat /dev/zero > \"$0\""])
            .arg(&pipe)
            .spawn()
            .unwrap();
        let disk = DiskFiles::default();
        let found = disk.read(&pipe, 100_000).unwrap_err().fault;
        let _ = endless.kill();
        let _ = endless.wait();
        assert_eq!(found, FileFault::TooLarge { most: 100_000 });
    }

    #[test]
    fn a_named_pipe_that_nobody_reads_is_an_error_and_one_that_is_read_gets_all_bytes() {
        let folder = Folder::new("output-pipe");
        let pipe = folder.pipe();
        let fault = hasty().write(&pipe, b"text").unwrap_err().fault;
        assert_eq!(fault, FileFault::Unread { seconds: 0 });
        let folder = Folder::new("output-pipe-reader");
        let pipe = folder.pipe();
        let reader = Command::new("sh")
            .args(["-c", "sleep 0.1; wc -c < \"$0\""])
            .arg(&pipe)
            .stdout(std::process::Stdio::piped())
            .spawn()
            .unwrap();
        DiskFiles::default().write(&pipe, &vec![b'x'; 200_000]).unwrap();
        let counted = reader.wait_with_output().unwrap().stdout;
        assert_eq!(String::from_utf8_lossy(&counted).trim(), "200000");
    }

    #[test]
    fn a_named_pipe_that_ends_is_a_file() {
        let folder = Folder::new("pipe");
        let pipe = folder.pipe();
        let mut writer = Command::new("sh")
            .args(["-c", "sleep 0.1; head -c 200000 /dev/zero > \"$0\""])
            .arg(&pipe)
            .spawn()
            .unwrap();
        let bytes = DiskFiles::default().read(&pipe, 1 << 20).unwrap();
        writer.wait().unwrap();
        assert_eq!(bytes.len(), 200_000);
    }

    #[test]
    fn what_was_read_is_not_overwritten_under_any_name() {
        let folder = Folder::new("inputs");
        let at = |name: &str| folder.0.join(name);
        std::fs::write(at("model"), "old").unwrap();
        std::os::unix::fs::symlink("model", at("soft")).unwrap();
        std::fs::hard_link(at("model"), at("hard")).unwrap();
        let disk = DiskFiles::default();
        assert_eq!(disk.read(&at("model"), 100).unwrap(), b"old");
        for name in ["model", "soft", "hard", "../x/model"] {
            let name = name.replace('x', &folder.0.file_name().unwrap().to_string_lossy());
            let found = disk.write(&at(&name), b"new").unwrap_err();
            assert_eq!(found.fault, FileFault::Input, "{name}");
        }
        disk.write(&at("other"), b"new").unwrap();
        disk.replace(&at("soft"), b"edited").unwrap();
        assert_eq!(std::fs::read(at("model")).unwrap(), b"edited");
        assert!(at("soft").is_symlink());
        assert!(disk.has_read(&at("model")));
        assert_eq!(folder.names(), ["hard", "model", "other", "soft"]);
    }

    #[test]
    fn a_file_keeps_its_permissions_and_one_that_is_locked_its_bytes() {
        use std::os::unix::fs::PermissionsExt;
        let folder = Folder::new("permissions");
        let path = folder.0.join("model");
        std::fs::write(&path, "old").unwrap();
        let set = |mode| {
            std::fs::set_permissions(&path, std::fs::Permissions::from_mode(mode)).unwrap();
        };
        set(0o640);
        write(&path, b"new").unwrap();
        assert_eq!(path.metadata().unwrap().permissions().mode() & 0o777, 0o640);
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
        // A superuser may write to anything, so the rest shows nothing there.
        set(0o440);
        if OpenOptions::new().write(true).open(&path).is_err() {
            assert!(write(&path, b"newer").is_err());
            assert_eq!(std::fs::read(&path).unwrap(), b"new");
        }
        assert_eq!(folder.names(), ["model"]);
    }

    #[test]
    fn devices_are_written_to_as_they_are() {
        write(Path::new("/dev/null"), b"gone").unwrap();
        assert_eq!(DiskFiles::default().kind(Path::new("/dev/null")), PathKind::Device);
        #[cfg(target_os = "linux")]
        {
            let full = write(Path::new("/dev/full"), b"none").unwrap_err();
            assert_eq!(full.fault.remedy(), "make room, or choose another place");
        }
    }
}
