//! Writing to devices and pipes, which have no old contents and cannot be replaced.

use std::fs::OpenOptions;
use std::io::{self, Write};
use std::path::Path;
use std::sync::mpsc::{RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;

use super::{FileError, FileFault};

/// Longest time without bytes through a named pipe, if the user of this crate states no other.
pub(super) const DEFAULT_PIPE_TIMEOUT: Duration = Duration::from_secs(10);

/// Bytes that are written to a named pipe at once; a pipe of Linux stores 64 kB.
const PORTION: usize = 1 << 14;

/// Writes bytes to a device or a pipe. A named pipe fails after `patience` without a reader.
pub(super) fn write_stream(path: &Path, bytes: &[u8], patience: Duration) -> Result<(), FileError> {
    if is_named_pipe(path) {
        return write_pipe_with_timeout(path, bytes, patience);
    }
    // The shell or the system has opened the other side of anything else.
    let fail = |error: io::Error| FileError::from_io_error(path, &error);
    let mut stream = OpenOptions::new().write(true).open(path).map_err(fail)?;
    stream.write_all(bytes).map_err(fail)
}

/// Whether a path leads to a named pipe, whose other side may not exist. Descriptors of the shell do not count: their
/// reader may pause as long as it likes.
fn is_named_pipe(path: &Path) -> bool {
    let is_handed_over = ["/dev/stdout", "/dev/stderr", "/dev/fd", "/proc/self/fd"]
        .iter()
        .any(|start| path.starts_with(start));
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        let is_pipe = path.metadata().is_ok_and(|found| found.file_type().is_fifo());
        is_pipe && !is_handed_over
    }
    #[cfg(not(unix))]
    {
        let _ = is_handed_over;
        false
    }
}

/// Writes bytes to a named pipe. A thread writes them; without a reader that thread waits forever.
fn write_pipe_with_timeout(path: &Path, bytes: &[u8], patience: Duration) -> Result<(), FileError> {
    let fail = |error: io::Error| FileError::from_io_error(path, &error);
    let (sender, receiver) = sync_channel(4);
    let (pipe, text) = (path.to_owned(), bytes.to_vec());
    std::thread::Builder::new()
        .name("writes a named pipe".to_owned())
        .spawn(move || forward_to_pipe(&pipe, &text, &sender))
        .map_err(fail)?;
    loop {
        match receiver.recv_timeout(patience) {
            Ok(Ok(())) => {}
            Ok(Err(error)) => return Err(fail(error)),
            Err(RecvTimeoutError::Disconnected) => return Ok(()),
            Err(RecvTimeoutError::Timeout) => {
                let seconds = patience.as_secs();
                return Err(FileError::new(path, FileFault::Unread { seconds }));
            }
        }
    }
}

/// Writes to a pipe and reports each portion, until all is written or the receiver is gone.
fn forward_to_pipe(pipe: &Path, bytes: &[u8], to: &SyncSender<io::Result<()>>) {
    let mut stream = match OpenOptions::new().write(true).open(pipe) {
        Ok(stream) => stream,
        Err(error) => return drop(to.send(Err(error))),
    };
    for portion in bytes.chunks(PORTION) {
        if to.send(stream.write_all(portion)).is_err() {
            return;
        }
    }
}
