//! Connections of the server, with a limit on those that have not sent a request with the token of the link.
//!
//! Any program of this machine can open connections, and send nothing, a part of a header, or a header whose body never
//! comes. Such a connection is closed after [`ADMISSION_TIMEOUT`], or as soon as more than [`MOST_WAITING`] of them
//! wait: the oldest one first, so that a user's request, which is sent at once, is always accepted.

use std::collections::VecDeque;
use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::task::{Context, Poll, Waker};
use std::time::Duration;

use axum::extract::connect_info::Connected;
use axum::serve::{IncomingStream, Listener};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};

/// Longest time from the start of a connection to its first request with the token. By judgement: a browser on the same
/// machine needs milliseconds.
const ADMISSION_TIMEOUT: Duration = Duration::from_secs(10);

/// Most connections without such a request. By judgement: a browser opens six, and some systems allow a program 256
/// open files.
const MOST_WAITING: usize = 32;

/// Pause after a connection could not be accepted, for example because too many files are open.
const RETRY_PAUSE: Duration = Duration::from_millis(50);

/// A listener on the loopback address that limits waiting connections.
pub(crate) struct LimitedListener {
    /// The listener of the system.
    inner: TcpListener,
    /// Connections without a request with the token, in the order of their start.
    waiting: VecDeque<Weak<ConnectionAdmission>>,
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
    fn register(&mut self) -> Arc<ConnectionAdmission> {
        let still_waits = |one: &Weak<ConnectionAdmission>| one.upgrade().is_some_and(|one| one.is_waiting());
        self.waiting.retain(still_waits);
        if self.waiting.len() >= MOST_WAITING
            && let Some(oldest) = self.waiting.pop_front().and_then(|one| one.upgrade())
        {
            oldest.close();
        }
        let new = Arc::new(ConnectionAdmission::default());
        self.waiting.push_back(Arc::downgrade(&new));
        let timed = Arc::downgrade(&new);
        tokio::spawn(async move {
            tokio::time::sleep(ADMISSION_TIMEOUT).await;
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
                let admission = self.register();
                return (LimitedStream { inner, admission }, address);
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

/// The state of a connection until its first request with the token.
#[derive(Default)]
pub(crate) struct ConnectionAdmission {
    /// Whether a request had the token.
    is_admitted: AtomicBool,
    /// Whether the connection was closed before that.
    is_closed: AtomicBool,
    /// The task that reads, to be woken when the connection is closed.
    reader: Mutex<Option<Waker>>,
}

impl ConnectionAdmission {
    /// Exempts the connection from the limit.
    pub(crate) fn admit(&self) {
        self.is_admitted.store(true, Ordering::Relaxed);
    }

    /// Whether a request with the token is still expected.
    fn is_waiting(&self) -> bool {
        !self.is_admitted.load(Ordering::Relaxed) && !self.is_closed.load(Ordering::Relaxed)
    }

    /// Closes the connection, unless it is admitted.
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
    admission: Arc<ConnectionAdmission>,
}

/// The connection of a request, for the check of its token.
#[derive(Clone)]
pub(crate) struct RequestConnection(pub(crate) Arc<ConnectionAdmission>);

impl Connected<IncomingStream<'_, LimitedListener>> for RequestConnection {
    fn connect_info(stream: IncomingStream<'_, LimitedListener>) -> Self {
        Self(Arc::clone(&stream.io().admission))
    }
}

impl AsyncRead for LimitedStream {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        if !self.admission.is_admitted.load(Ordering::Relaxed) {
            self.admission.remember(context.waker());
            if self.admission.is_closed.load(Ordering::SeqCst) {
                return Poll::Ready(Err(io::ErrorKind::TimedOut.into()));
            }
        }
        Pin::new(&mut self.inner).poll_read(context, buffer)
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
