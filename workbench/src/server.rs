//! The server: it listens on the loopback address alone, and answers only who has the token of the link, asks under its own name,
//! and comes from its own page.
//!
//! A page of any other site may send requests to the loopback address; the name in `Host` keeps out sites whose name was made to
//! lead here (DNS rebinding), `Origin` those that ask openly, and the token all others.

use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::time::Duration;

use axum::extract::rejection::JsonRejection;
use axum::extract::{DefaultBodyLimit, Query, Request, State};
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
use serde_json::{Value, json};
use tokio::net::TcpListener;

use crate::page;
use crate::sitting::{LONGEST, STACK, Seeing, Sitting};

/// How the page shows that it is the one that was opened with the link.
const TOKEN: HeaderName = HeaderName::from_static("x-modelmill-token");
/// How often the disk is looked at. Files are read rather than watched for notices of the system: a model is short, and notices
/// do not come from every disk, nor for every way in which editors put a new file in the place of an old one.
const LOOK: Duration = Duration::from_millis(250);
/// How long a page waits for news before it asks again.
const NEWS: Duration = Duration::from_secs(20);

struct App {
    sitting: Arc<Sitting>,
    token: String,
    port: u16,
}

/// Serves a sitting until the program is stopped; `opened` gets the link.
///
/// Fails when the port cannot be had.
pub(crate) fn serve(sitting: Arc<Sitting>, port: u16, opened: impl FnOnce(&str)) -> Outcome {
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
        let token = random().map_err(Error::input)?;
        let link = format!("http://127.0.0.1:{port}/?token={token}");
        tokio::spawn(look(Arc::clone(&sitting)));
        let app = Arc::new(App {
            sitting,
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
fn random() -> Result<String, String> {
    let mut bytes = [0_u8; 16];
    getrandom::fill(&mut bytes).map_err(|error| format!("no token can be drawn: {error}"))?;
    Ok(format!("{:032x}", u128::from_le_bytes(bytes)))
}

async fn look(sitting: Arc<Sitting>) {
    loop {
        tokio::time::sleep(LOOK).await;
        let sitting = Arc::clone(&sitting);
        // What fails once is tried again.
        let _ = tokio::task::spawn_blocking(move || sitting.look()).await;
    }
}

fn router(app: Arc<App>) -> Router {
    let most = usize::try_from(8 * LONGEST).unwrap_or(usize::MAX);
    Router::new()
        .route("/", get(start))
        .route("/api/view", get(view))
        .route("/api/edit", post(edit))
        .route("/api/save", post(save))
        .route("/api/choose", post(choose))
        .route("/api/picture", post(picture))
        .route("/api/equations", post(equations))
        .route("/api/compare", post(compare))
        .route("/api/curves", post(curves))
        .route("/api/motion", post(motion))
        .route("/api/diagnosis", get(diagnosis))
        .route("/api/diagnose", post(diagnose))
        .route("/api/cancel", post(cancel))
        .route("/api/add", post(add))
        .layer(DefaultBodyLimit::max(most))
        .layer(middleware::from_fn_with_state(Arc::clone(&app), guard))
        .with_state(app)
}

/// Refuses what does not come from the page that was opened with the link.
async fn guard(State(app): State<Arc<App>>, request: Request, next: Next) -> Response {
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
    if !given.is_some_and(|given| is_same(given, &app.token)) {
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
fn is_same(given: &str, token: &str) -> bool {
    let pairs = given.bytes().zip(token.bytes());
    given.len() == token.len() && pairs.fold(0, |differs, (a, b)| differs | (a ^ b)) == 0
}

/// What a handler answers: JSON, or a sentence that says why there is none.
type Answer = Result<Json<Value>, Refusal>;

/// Why there is no answer.
struct Refusal(StatusCode, String);

impl IntoResponse for Refusal {
    fn into_response(self) -> Response {
        (self.0, Json(json!({ "says": self.1 }))).into_response()
    }
}

impl From<String> for Refusal {
    fn from(says: String) -> Self {
        Self(StatusCode::UNPROCESSABLE_ENTITY, says)
    }
}

impl From<JsonRejection> for Refusal {
    fn from(fault: JsonRejection) -> Self {
        Self(fault.status(), fault.body_text())
    }
}

/// Does work that takes its time where it keeps nobody else waiting.
async fn worked<T: Send + 'static>(
    app: &App,
    work: impl FnOnce(&Arc<Sitting>) -> T + Send + 'static,
) -> Result<T, Refusal> {
    let sitting = Arc::clone(&app.sitting);
    let done = tokio::task::spawn_blocking(move || work(&sitting)).await;
    done.map_err(|_| {
        Refusal(
            StatusCode::INTERNAL_SERVER_ERROR,
            "a fault of the program, which is none of yours; the text is kept".to_owned(),
        )
    })
}

async fn start() -> Result<Response, Refusal> {
    let nonce = random()?;
    let policy = format!(
        "default-src 'none'; script-src 'nonce-{nonce}'; style-src 'unsafe-inline'; img-src data:; connect-src 'self'; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    );
    let mut response = Html(page::page(&nonce)).into_response();
    if let Ok(policy) = HeaderValue::from_str(&policy) {
        let headers = response.headers_mut();
        headers.insert(CONTENT_SECURITY_POLICY, policy);
    }
    Ok(response)
}

#[derive(Deserialize)]
struct Since {
    /// The version that the page has.
    #[serde(default)]
    since: u64,
}

/// What stands, as soon as it is news.
async fn view(State(app): State<Arc<App>>, Query(Since { since }): Query<Since>) -> Answer {
    let mut changes = app.sitting.changes();
    let news = changes.wait_for(|version| *version != since);
    // Without news it is told once more.
    let _ = tokio::time::timeout(NEWS, news).await;
    Ok(Json(worked(&app, |sitting| sitting.view()).await?))
}

#[derive(Deserialize)]
struct Edit {
    /// The revision that the text was made of.
    base: u64,
    text: String,
}

async fn edit(State(app): State<Arc<App>>, request: Result<Json<Edit>, JsonRejection>) -> Answer {
    let Json(Edit { base, text }) = request?;
    let told = worked(&app, move |sitting| sitting.edit(base, &text)).await?;
    told.map(Json).ok_or_else(|| {
        Refusal(
            StatusCode::CONFLICT,
            "the text was changed elsewhere meanwhile".to_owned(),
        )
    })
}

async fn save(State(app): State<Arc<App>>) -> Answer {
    Ok(Json(worked(&app, |sitting| sitting.save()).await??))
}

#[derive(Deserialize)]
struct Choice {
    theirs: bool,
}

async fn choose(
    State(app): State<Arc<App>>,
    request: Result<Json<Choice>, JsonRejection>,
) -> Answer {
    let Json(Choice { theirs }) = request?;
    Ok(Json(
        worked(&app, move |sitting| sitting.choose(theirs)).await?,
    ))
}

async fn picture(
    State(app): State<Arc<App>>,
    request: Result<Json<Seeing>, JsonRejection>,
) -> Result<Response, Refusal> {
    let Json(seeing) = request?;
    let svg = worked(&app, move |sitting| sitting.picture(&seeing)).await??;
    Ok(([(CONTENT_TYPE, "image/svg+xml")], svg).into_response())
}

async fn equations(State(app): State<Arc<App>>) -> Result<Html<String>, Refusal> {
    Ok(Html(worked(&app, |sitting| sitting.equations()).await??))
}

#[derive(Deserialize)]
struct Comparing {
    /// Whether to look where the error lives.
    places: bool,
    /// Whether to read the recordings again.
    afresh: bool,
}

async fn compare(
    State(app): State<Arc<App>>,
    request: Result<Json<Comparing>, JsonRejection>,
) -> Answer {
    let Json(Comparing { places, afresh }) = request?;
    Ok(Json(
        worked(&app, move |sitting| sitting.compare(places, afresh)).await??,
    ))
}

#[derive(Deserialize)]
struct Curves {
    /// With identified values rather than those of the file.
    identified: bool,
}

async fn curves(
    State(app): State<Arc<App>>,
    request: Result<Json<Curves>, JsonRejection>,
) -> Result<Html<String>, Refusal> {
    let Json(Curves { identified }) = request?;
    Ok(Html(
        worked(&app, move |sitting| sitting.curves(identified)).await??,
    ))
}

async fn motion(State(app): State<Arc<App>>) -> Answer {
    Ok(Json(worked(&app, |sitting| sitting.motion()).await??))
}

async fn diagnosis(State(app): State<Arc<App>>) -> Answer {
    Ok(Json(app.sitting.diagnosis()))
}

async fn diagnose(State(app): State<Arc<App>>) -> Answer {
    Ok(Json(app.sitting.diagnose()?))
}

async fn cancel(State(app): State<Arc<App>>) -> Answer {
    Ok(Json(app.sitting.cancel()))
}

#[derive(Deserialize)]
struct Add {
    entry: usize,
}

async fn add(State(app): State<Arc<App>>, request: Result<Json<Add>, JsonRejection>) -> Answer {
    let Json(Add { entry }) = request?;
    Ok(Json(
        worked(&app, move |sitting| sitting.add(entry)).await??,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_are_long_and_differ() {
        let [a, b] = [(); 2].map(|()| random().unwrap());
        assert!(a.len() == 32 && a != b);
        assert!(is_same(&a, &a) && !is_same(&a, &b) && !is_same("", &a) && !is_same(&a[1..], &a));
    }
}
