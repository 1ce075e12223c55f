//! Connections of the server, with a limit on those that have not sent a complete request header.
//!
//! Any program of this machine can open connections and send nothing. Such a connection is closed after
//! [`HEADER_TIMEOUT`], or as soon as more than [`MOST_WAITING`] of them wait: the oldest one first, so that a user's
//! request, which is sent at once, is always accepted.

use std::collections::VecDeque;
use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::task::{Context, Poll, Waker};
use std::time::Duration;

use axum::serve::Listener;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};

/// Longest time from the start of a connection to the end of its first request header. By judgement: a browser on the
/// same machine needs milliseconds.
const HEADER_TIMEOUT: Duration = Duration::from_secs(10);

/// Most connections without a complete header. By judgement: a browser opens six, and some systems allow a program 256
/// open files.
const MOST_WAITING: usize = 32;

/// Pause after a connection could not be accepted, for example because too many files are open.
const RETRY_PAUSE: Duration = Duration::from_millis(50);

/// A listener on the loopback address that limits waiting connections.
pub(crate) struct LimitedListener {
    /// The listener of the system.
    inner: TcpListener,
    /// Connections without a complete header, in the order of their start.
    waiting: VecDeque<Weak<HeaderWait>>,
}

impl LimitedListener {
    /// Limits the connections of a listener.
    pub(crate) fn new(inner: TcpListener) -> Self {
        Self {
            inner,
            waiting: VecDeque::new(),
        }
    }

    /// Registers a new connection, and closes the oldest waiting one if there are too many.
    fn register(&mut self) -> Arc<HeaderWait> {
        let still_waits = |one: &Weak<HeaderWait>| one.upgrade().is_some_and(|one| one.is_waiting());
        self.waiting.retain(still_waits);
        if self.waiting.len() >= MOST_WAITING
            && let Some(oldest) = self.waiting.pop_front().and_then(|one| one.upgrade())
        {
            oldest.close();
        }
        let new = Arc::new(HeaderWait::default());
        self.waiting.push_back(Arc::downgrade(&new));
        let timed = Arc::downgrade(&new);
        tokio::spawn(async move {
            tokio::time::sleep(HEADER_TIMEOUT).await;
            if let Some(connection) = timed.upgrade() {
                connection.close();
            }
        });
        new
    }
}

impl Listener for LimitedListener {
    type Io = LimitedStream;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Self::Io, Self::Addr) {
        loop {
            if let Ok((inner, address)) = self.inner.accept().await {
                let wait = self.register();
                let stream = LimitedStream {
                    inner,
                    wait,
                    has_begun: false,
                    line_ends: 0,
                };
                return (stream, address);
            }
            // The oldest waiting connection gives its file back.
            if let Some(oldest) = self.waiting.pop_front().and_then(|one| one.upgrade()) {
                oldest.close();
            }
            tokio::time::sleep(RETRY_PAUSE).await;
        }
    }

    fn local_addr(&self) -> io::Result<Self::Addr> {
        self.inner.local_addr()
    }
}

/// The state of a connection until its first header is complete.
#[derive(Default)]
struct HeaderWait {
    /// Whether the header is complete.
    is_complete: AtomicBool,
    /// Whether the connection was closed before that.
    is_closed: AtomicBool,
    /// The task that reads, to be woken when the connection is closed.
    reader: Mutex<Option<Waker>>,
}

impl HeaderWait {
    /// Whether the header is still expected.
    fn is_waiting(&self) -> bool {
        !self.is_complete.load(Ordering::Relaxed) && !self.is_closed.load(Ordering::Relaxed)
    }

    /// Closes the connection, unless its header is complete.
    fn close(&self) {
        if self.is_waiting() {
            self.is_closed.store(true, Ordering::SeqCst);
            let reader = self.reader.lock().unwrap_or_else(PoisonError::into_inner).take();
            reader.into_iter().for_each(Waker::wake);
        }
    }

    /// Remembers the task that reads. The state is read after this, so that no closing is missed.
    fn remember(&self, reader: &Waker) {
        let mut known = self.reader.lock().unwrap_or_else(PoisonError::into_inner);
        *known = Some(reader.clone());
    }
}

/// A connection that fails to read after it was closed by the limit.
pub(crate) struct LimitedStream {
    /// The connection of the system.
    inner: TcpStream,
    /// Its state.
    wait: Arc<HeaderWait>,
    /// Whether a byte that is no line end was read.
    has_begun: bool,
    /// Line ends at the end of what was read; two of them end a header.
    line_ends: u8,
}

impl LimitedStream {
    /// Looks for the end of the header in new bytes.
    fn inspect(&mut self, bytes: &[u8]) {
        for byte in bytes {
            match byte {
                // Empty lines before a request are no header.
                b'\n' if self.has_begun => self.line_ends += 1,
                b'\n' | b'\r' => {}
                _ => {
                    self.has_begun = true;
                    self.line_ends = 0;
                }
            }
            if self.line_ends == 2 {
                return self.wait.is_complete.store(true, Ordering::Relaxed);
            }
        }
    }
}

impl AsyncRead for LimitedStream {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        if self.wait.is_complete.load(Ordering::Relaxed) {
            return Pin::new(&mut self.inner).poll_read(context, buffer);
        }
        self.wait.remember(context.waker());
        if self.wait.is_closed.load(Ordering::SeqCst) {
            return Poll::Ready(Err(io::ErrorKind::TimedOut.into()));
        }
        let before = buffer.filled().len();
        let read = Pin::new(&mut self.inner).poll_read(context, buffer);
        if read.is_ready() {
            self.inspect(&buffer.filled()[before..]);
        }
        read
    }
}

impl AsyncWrite for LimitedStream {
    fn poll_write(mut self: Pin<&mut Self>, context: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.inner).poll_write(context, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.inner).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.inner).poll_shutdown(context)
    }
}
