//! The server: it listens on the loopback address alone, and answers only who has the token of the link, asks under its own name,
//! and comes from its own page.
//!
//! A page of any other site may send requests to the loopback address; the name in `Host` keeps out sites whose name was made to
//! lead here (DNS rebinding), `Origin` those that ask openly, and the token all others.
//!
//! Decision: HTTP is axum on hyper and tokio without macros, forms or sockets, because a parser of browser requests
//! should be maintained by a project of its own. It costs half a minute of one core to build. The page runs no
//! script but its own (a nonce), and texts of models and recordings enter as text.

use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, Path, Query, Request, State};
use axum::http::StatusCode;
use axum::http::header::{
    CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HOST, HeaderName, HeaderValue, ORIGIN,
    REFERRER_POLICY, X_CONTENT_TYPE_OPTIONS, X_FRAME_OPTIONS,
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
use crate::machine::{LocalMachine, STACK};
use crate::page;
use crate::sitting::{LONGEST, WorkbenchSession};

/// How the page shows that it is the one that was opened with the link.
const TOKEN: HeaderName = HeaderName::from_static("x-modelmill-token");
/// How often the disk is looked at. Files are read rather than watched for notices of the system: a model is short, and notices
/// do not come from every disk, nor for every way in which editors put a new file in the place of an old one.
const POLL_INTERVAL: Duration = Duration::from_millis(250);
/// How long a page waits for news before it asks again.
const NEWS_TIMEOUT: Duration = Duration::from_secs(20);

struct ServerState {
    sitting: Arc<WorkbenchSession>,
    machine: Arc<LocalMachine>,
    token: String,
    port: u16,
}

/// Serves a sitting until the program is stopped; `opened` gets the link.
///
/// Fails when the port cannot be had.
pub(crate) fn serve(
    sitting: Arc<WorkbenchSession>,
    machine: Arc<LocalMachine>,
    port: u16,
    opened: impl FnOnce(&str),
) -> Outcome {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .thread_stack_size(STACK)
        .enable_all()
        .build()
        .map_err(|error| Error::input(format!("no server can be made: {error}")))?;
    runtime.block_on(async {
        let address = SocketAddr::from((Ipv4Addr::LOCALHOST, port));
        let taken = |error| {
            Error::input(format!(
                "{address} cannot be listened on: {error}; choose another port, or none"
            ))
        };
        let listener = TcpListener::bind(address).await.map_err(taken)?;
        let port = listener.local_addr().map_err(taken)?.port();
        let token = random_token().map_err(Error::input)?;
        let link = format!("http://127.0.0.1:{port}/?token={token}");
        tokio::spawn(poll_files(Arc::clone(&sitting)));
        let app = Arc::new(ServerState {
            sitting,
            machine,
            token,
            port,
        });
        opened(&link);
        axum::serve(listener, router(app))
            .await
            .map_err(|error| Error::input(format!("the server ended: {error}")))
    })
}

/// 128 random bits in hexadecimal digits.
fn random_token() -> Result<String, String> {
    let mut bytes = [0_u8; 16];
    getrandom::fill(&mut bytes).map_err(|error| format!("no token can be drawn: {error}"))?;
    Ok(format!("{:032x}", u128::from_le_bytes(bytes)))
}

async fn poll_files(sitting: Arc<WorkbenchSession>) {
    loop {
        tokio::time::sleep(POLL_INTERVAL).await;
        let sitting = Arc::clone(&sitting);
        // What fails once is tried again.
        let _ = tokio::task::spawn_blocking(move || sitting.check_disk()).await;
    }
}

fn router(app: Arc<ServerState>) -> Router {
    let most = usize::try_from(8 * LONGEST).unwrap_or(usize::MAX);
    Router::new()
        .route("/", get(serve_page))
        .route("/api/view", get(view))
        .route("/api/{question}", post(handle_request))
        .layer(DefaultBodyLimit::max(most))
        .layer(middleware::from_fn_with_state(Arc::clone(&app), guard))
        .with_state(app)
}

/// Refuses what does not come from the page that was opened with the link.
async fn guard(State(app): State<Arc<ServerState>>, request: Request, next: Next) -> Response {
    let headers = request.headers();
    let refused = |says: &'static str| (StatusCode::FORBIDDEN, says).into_response();
    let names = [
        format!("127.0.0.1:{}", app.port),
        format!("localhost:{}", app.port),
    ];
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
            return refused("Pages of other sites get no answer.\n");
        }
    }
    let is_page = request.uri().path() == "/";
    let given = if is_page {
        let query = request.uri().query().unwrap_or_default();
        let mut pairs = query.split('&').filter_map(|pair| pair.split_once('='));
        pairs
            .find(|(name, _)| *name == "token")
            .map(|(_, value)| value)
    } else {
        text(TOKEN)
    };
    if !given.is_some_and(|given| is_same_token(given, &app.token)) {
        return refused(
            "Open the link that `modelmill work` printed; its token is missing here.\n",
        );
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

/// Compares without telling by its time how much was right.
fn is_same_token(given: &str, token: &str) -> bool {
    let pairs = given.bytes().zip(token.bytes());
    given.len() == token.len() && pairs.fold(0, |differs, (a, b)| differs | (a ^ b)) == 0
}

/// What a handler answers, or why it does not.
type HandlerResult = Result<Response, HttpRefusal>;

/// Why there is no answer.
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

/// Does work that takes its time where it keeps nobody else waiting.
async fn run_blocking<T: Send + 'static>(
    app: &ServerState,
    work: impl FnOnce(&Arc<WorkbenchSession>) -> T + Send + 'static,
) -> Result<T, HttpRefusal> {
    let sitting = Arc::clone(&app.sitting);
    let done = tokio::task::spawn_blocking(move || work(&sitting)).await;
    done.map_err(|_| {
        HttpRefusal(
            StatusCode::INTERNAL_SERVER_ERROR,
            "a fault of the program, which is none of yours; the text is kept".to_owned(),
        )
    })
}

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

#[derive(Deserialize)]
struct SinceQuery {
    /// The version that the page has.
    #[serde(default)]
    since: u64,
}

/// What stands, as soon as it is news.
async fn view(
    State(app): State<Arc<ServerState>>,
    Query(SinceQuery { since }): Query<SinceQuery>,
) -> HandlerResult {
    let mut changes = app.machine.changes();
    let news = changes.wait_for(|version| *version != since);
    // Without news it is told once more.
    let _ = tokio::time::timeout(NEWS_TIMEOUT, news).await;
    let told = run_blocking(&app, |sitting| sitting.view()).await?;
    Ok(Json(told).into_response())
}

/// Anything else.
async fn handle_request(
    State(app): State<Arc<ServerState>>,
    Path(question): Path<String>,
    body: Bytes,
) -> HandlerResult {
    let found = run_blocking(&app, move |sitting| {
        answer_request(sitting, &question, &body)
    })
    .await?;
    Ok(match found? {
        PageResponse::Json(told) => Json(told).into_response(),
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
            is_same_token(&a, &a)
                && !is_same_token(&a, &b)
                && !is_same_token("", &a)
                && !is_same_token(&a[1..], &a)
        );
    }
}
