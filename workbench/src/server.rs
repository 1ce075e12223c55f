//! The server. It listens on the loopback address only. It accepts requests with the token of the link, under its own
//! name, from its own page.
//!
//! A page of any other site can send requests to the loopback address. The check of `Host` refuses sites whose name
//! resolves to this machine (DNS rebinding), the check of `Origin` refuses pages of other sites, and the token refuses
//! all others.
//!
//! Decision: HTTP is axum on hyper and tokio without macros, forms or sockets, because a parser of browser requests
//! should be maintained by a project of its own. It costs half a minute of one core to build. The page runs no script
//! but its own (a nonce), and texts of models and recordings enter as text.

use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::{ConnectInfo, DefaultBodyLimit, Path, Query, Request, State};
use axum::http::StatusCode;
use axum::http::header::{
    CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HOST, HeaderName, HeaderValue, ORIGIN, REFERRER_POLICY,
    X_CONTENT_TYPE_OPTIONS, X_FRAME_OPTIONS,
};
use axum::middleware::{self, Next};
use axum::response::{Html, IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Json, Router};
use modelmill::{Error, Outcome};
use serde::Deserialize;
use serde_json::json;
use tokio::net::TcpListener;

use crate::answers::{PageResponse, RequestRefusal, answer_request};
use crate::connections::{LimitedListener, RequestConnection};
use crate::machine::{LocalMachine, STACK};
use crate::page;
use crate::session::{LONGEST, WorkbenchSession};

/// Header with the token, by which the page proves that it was opened with the link.
const TOKEN: HeaderName = HeaderName::from_static("x-modelmill-token");
/// Interval at which files are read and compared. Notifications of the system are not used: a model is short, and
/// notifications are missing on some disks and for some ways in which editors replace a file.
const POLL_INTERVAL: Duration = Duration::from_millis(250);
/// Time after which a request for changes is answered even without a change.
const NEWS_TIMEOUT: Duration = Duration::from_secs(20);

/// State that all handlers share.
struct ServerState {
    /// The session of the model file.
    session: Arc<WorkbenchSession>,
    /// This machine; it signals changes to waiting pages.
    machine: Arc<LocalMachine>,
    /// Token of the link, 32 hexadecimal digits.
    token: String,
    /// Port on the loopback address.
    port: u16,
}

/// Serves a session until the program is stopped; `opened` gets the link.
///
/// Fails if the port is in use.
pub(crate) fn serve(
    session: Arc<WorkbenchSession>,
    machine: Arc<LocalMachine>,
    port: u16,
    opened: impl FnOnce(&str),
) -> Outcome {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .thread_stack_size(STACK)
        .enable_all()
        .build()
        .map_err(|error| Error::input(format!("the server cannot be started: {error}")))?;
    runtime.block_on(async {
        let address = SocketAddr::from((Ipv4Addr::LOCALHOST, port));
        let taken = |error| {
            Error::input(format!(
                "the server cannot listen on {address}: {error}; choose another port, or give no port"
            ))
        };
        let listener = TcpListener::bind(address).await.map_err(taken)?;
        let port = listener.local_addr().map_err(taken)?.port();
        let token = random_token().map_err(Error::input)?;
        let link = format!("http://127.0.0.1:{port}/?token={token}");
        tokio::spawn(poll_files(Arc::clone(&session)));
        let app = Arc::new(ServerState {
            session,
            machine,
            token,
            port,
        });
        opened(&link);
        let service = router(app).into_make_service_with_connect_info::<RequestConnection>();
        axum::serve(LimitedListener::new(listener), service)
            .await
            .map_err(|error| Error::input(format!("the server ended: {error}")))
    })
}

/// 128 random bits in hexadecimal digits.
fn random_token() -> Result<String, String> {
    let mut bytes = [0_u8; 16];
    getrandom::fill(&mut bytes).map_err(|error| format!("no random token is available: {error}"))?;
    Ok(format!("{:032x}", u128::from_le_bytes(bytes)))
}

/// Checks the files for changes by other programs, as long as the server runs.
async fn poll_files(session: Arc<WorkbenchSession>) {
    loop {
        tokio::time::sleep(POLL_INTERVAL).await;
        let session = Arc::clone(&session);
        // A failure is ignored here: the next check repeats it.
        let _ = tokio::task::spawn_blocking(move || session.check_disk()).await;
    }
}

/// The routes of page and requests; each passes the checks of [`guard`] first.
fn router(app: Arc<ServerState>) -> Router {
    // Escapes of JSON make a text longer than its file.
    let most = usize::try_from(8 * LONGEST).unwrap_or(usize::MAX);
    Router::new()
        .route("/", get(serve_page))
        .route("/api/view", get(view))
        .route("/api/{question}", post(handle_request))
        .layer(DefaultBodyLimit::max(most))
        .layer(middleware::from_fn_with_state(Arc::clone(&app), guard))
        .with_state(app)
}

/// Refuses requests that do not come from the page that was opened with the link.
async fn guard(State(app): State<Arc<ServerState>>, request: Request, next: Next) -> Response {
    let headers = request.headers();
    let refused = |says: &'static str| (StatusCode::FORBIDDEN, says).into_response();
    let names = [format!("127.0.0.1:{}", app.port), format!("localhost:{}", app.port)];
    let text = |name: HeaderName| headers.get(name).and_then(|value| value.to_str().ok());
    if !text(HOST).is_some_and(|host| names.iter().any(|name| name == host)) {
        return refused("This server answers under 127.0.0.1 only.\n");
    }
    if headers.contains_key(ORIGIN) {
        let is_own = |origin: &str| {
            let name = origin.strip_prefix("http://");
            name.is_some_and(|name| names.iter().any(|own| own == name))
        };
        if !text(ORIGIN).is_some_and(is_own) {
            return refused("Requests from pages of other sites are refused.\n");
        }
    }
    // The link has the token in its query; requests of the page have it in a header, which other sites cannot set.
    let is_page = request.uri().path() == "/";
    let given = if is_page {
        let query = request.uri().query().unwrap_or_default();
        let mut pairs = query.split('&').filter_map(|pair| pair.split_once('='));
        pairs.find(|(name, _)| *name == "token").map(|(_, value)| value)
    } else {
        text(TOKEN)
    };
    if !given.is_some_and(|given| is_same_token(given, &app.token)) {
        return refused("The token is missing or wrong. Open the link that `modelmill work` printed.\n");
    }
    // Only connections of the page's user are exempt from the limit.
    if let Some(ConnectInfo(connection)) = request.extensions().get::<ConnectInfo<RequestConnection>>() {
        connection.0.admit();
    }
    let mut response = next.run(request).await;
    let own = [
        (CACHE_CONTROL, "no-store"),
        (REFERRER_POLICY, "no-referrer"),
        (X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (X_FRAME_OPTIONS, "DENY"),
    ];
    for (name, value) in own {
        let headers = response.headers_mut();
        headers.insert(name, HeaderValue::from_static(value));
    }
    response
}

/// Compares in constant time, so that the duration does not reveal how many characters are right.
fn is_same_token(given: &str, token: &str) -> bool {
    let pairs = given.bytes().zip(token.bytes());
    given.len() == token.len() && pairs.fold(0, |differs, (a, b)| differs | (a ^ b)) == 0
}

/// The response of a handler, or its refusal.
type HandlerResult = Result<Response, HttpRefusal>;

/// A refusal: HTTP status, and a sentence with the reason.
struct HttpRefusal(StatusCode, String);

impl IntoResponse for HttpRefusal {
    fn into_response(self) -> Response {
        (self.0, Json(json!({ "says": self.1 }))).into_response()
    }
}

impl From<RequestRefusal> for HttpRefusal {
    fn from(RequestRefusal(fault, says): RequestRefusal) -> Self {
        let status = StatusCode::from_u16(fault.status());
        Self(status.unwrap_or(StatusCode::UNPROCESSABLE_ENTITY), says)
    }
}

/// Does long work on a separate thread, so that other requests do not wait. A panic becomes status 500.
async fn run_blocking<T: Send + 'static>(
    app: &ServerState,
    work: impl FnOnce(&Arc<WorkbenchSession>) -> T + Send + 'static,
) -> Result<T, HttpRefusal> {
    let session = Arc::clone(&app.session);
    let done = tokio::task::spawn_blocking(move || work(&session)).await;
    done.map_err(|_| {
        HttpRefusal(
            StatusCode::INTERNAL_SERVER_ERROR,
            "internal error of the program, not of your input; the text is kept".to_owned(),
        )
    })
}

/// Sends the page with a policy that permits only its own scripts (by a nonce) and no other connections.
async fn serve_page() -> HandlerResult {
    let nonce = random_token().map_err(RequestRefusal::from)?;
    let policy = format!(
        "default-src 'none'; script-src 'nonce-{nonce}'; style-src 'unsafe-inline'; img-src data:; connect-src 'self'; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    );
    let mut response = Html(page::served_page(&nonce)).into_response();
    if let Ok(policy) = HeaderValue::from_str(&policy) {
        let headers = response.headers_mut();
        headers.insert(CONTENT_SECURITY_POLICY, policy);
    }
    Ok(response)
}

/// Query of `/api/view`.
#[derive(Deserialize)]
struct SinceQuery {
    /// The version that the page has.
    #[serde(default)]
    since: u64,
}

/// Sends the current view once its version differs from that of the page, or after [`NEWS_TIMEOUT`].
async fn view(State(app): State<Arc<ServerState>>, Query(SinceQuery { since }): Query<SinceQuery>) -> HandlerResult {
    let mut changes = app.machine.changes();
    let news = changes.wait_for(|version| *version != since);
    // After the timeout the page gets the view that it already has, and requests the next one.
    let _ = tokio::time::timeout(NEWS_TIMEOUT, news).await;
    let view_json = run_blocking(&app, |session| session.view()).await?;
    Ok(Json(view_json).into_response())
}

/// Answers all other requests, by their names.
async fn handle_request(
    State(app): State<Arc<ServerState>>,
    Path(question): Path<String>,
    body: Bytes,
) -> HandlerResult {
    let found = run_blocking(&app, move |session| answer_request(session, &question, &body)).await?;
    Ok(match found? {
        PageResponse::Json(view_json) => Json(view_json).into_response(),
        PageResponse::Svg(svg) => ([(CONTENT_TYPE, "image/svg+xml")], svg).into_response(),
        PageResponse::Html(html) => Html(html).into_response(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_are_long_and_differ() {
        let [a, b] = [(); 2].map(|()| random_token().unwrap());
        assert!(a.len() == 32 && a != b);
        assert!(
            is_same_token(&a, &a) && !is_same_token(&a, &b) && !is_same_token("", &a) && !is_same_token(&a[1..], &a)
        );
    }
}
