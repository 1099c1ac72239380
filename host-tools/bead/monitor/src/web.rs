//! The page in a browser.
//!
//! # Design
//! The program listens only on this computer, unless it is told otherwise. Three things keep others out: a
//! random token in the path, the refusal of host names other than `localhost` (a foreign name that leads
//! here is an attack by DNS rebinding), and an `Origin` that must be the page's own. The page is static;
//! data of a bead goes to it as JSON, and the page inserts it as text.
//!
//! Nothing is queued for a browser. The task of a browser takes the new strikes when the connection is
//! ready for them, so that a slow browser costs the recorder nothing, and learns how many it missed.

use std::io;
use std::net::{IpAddr, SocketAddr, TcpListener};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use axum::Router;
use axum::body::Body;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use bead_recording::file::Recording;
use bead_recording::recover::recover;
use bead_tables::whole::Target;
use rand::TryRng;
use rand::rngs::SysRng;
use serde_json::json;
use tokio::time::{interval, timeout};
use tokio_util::io::ReaderStream;

use crate::feed::Feed;
use crate::model::SharedMonitor;

/// Interval of the updates to a browser.
const NEWS_EVERY: Duration = Duration::from_millis(200);
/// Time after which a browser that takes nothing is disconnected; it connects again.
const PATIENCE: Duration = Duration::from_secs(20);
/// Greatest number of strikes that go to a browser at a time.
const STRIKES_AT_A_TIME: usize = 32;
/// Greatest number of browsers.
const BROWSERS: usize = 16;
/// Content security policy: the page may load from and connect to this program only.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; \
                      base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// The files of the page: name, type, content.
const FILES: [(&str, &str, &str); 5] = [
    ("", "text/html; charset=utf-8", include_str!("../page/index.html")),
    (
        "page.js",
        "text/javascript; charset=utf-8",
        include_str!("../page/page.js"),
    ),
    (
        "page.css",
        "text/css; charset=utf-8",
        include_str!("../page/page.css"),
    ),
    (
        "uPlot.js",
        "text/javascript; charset=utf-8",
        include_str!("../page/uPlot.js"),
    ),
    (
        "uPlot.css",
        "text/css; charset=utf-8",
        include_str!("../page/uPlot.css"),
    ),
];

/// A page that waits to be served.
pub struct WebPage {
    listener: TcpListener,
    at: SocketAddr,
    token: String,
}

#[derive(Clone)]
struct Served {
    monitor: SharedMonitor,
    is_here_alone: bool,
    browsers: Arc<AtomicUsize>,
}

impl WebPage {
    /// Listens at an address.
    ///
    /// # Errors
    /// The address cannot be listened at, or the system has no random numbers.
    pub fn open(at: SocketAddr) -> io::Result<Self> {
        let listener = TcpListener::bind(at)?;
        listener.set_nonblocking(true)?;
        let mut token = [0; 16];
        SysRng.try_fill_bytes(&mut token).map_err(io::Error::other)?;
        Ok(Self {
            at: listener.local_addr()?,
            listener,
            token: bead_recording::json::hex(&token),
        })
    }

    /// The URL of the page, with its token.
    pub fn url(&self) -> String {
        format!("http://{}/{}/", self.at, self.token)
    }

    /// Serves the page until `stop`.
    ///
    /// # Errors
    /// The system refuses a listener.
    pub fn serve(self, monitor: SharedMonitor, stop: &AtomicBool) -> io::Result<()> {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()?;
        runtime.block_on(async {
            let listener = tokio::net::TcpListener::from_std(self.listener)?;
            let served = Served {
                monitor,
                is_here_alone: self.at.ip().is_loopback(),
                browsers: Arc::default(),
            };
            // No path without the token exists.
            let at = |name: &str| format!("/{}/{name}", self.token);
            let mut page = Router::new()
                .route(&at("live"), get(live))
                .route(&at("recording"), get(download));
            for (name, kind, content) in FILES {
                let file = move || async move { ([(header::CONTENT_TYPE, kind)], content) };
                page = page.route(&at(name), get(file));
            }
            let guard = middleware::from_fn_with_state(served.clone(), guard);
            let routes = page.layer(guard).with_state(served);
            let serve = axum::serve(listener, routes);
            let stopped = async {
                while !stop.load(Ordering::Relaxed) {
                    tokio::time::sleep(Duration::from_millis(50)).await;
                }
            };
            // Connections end with the runtime.
            tokio::select! {
                served = serve => served,
                () = stopped => Ok(()),
            }
        })
    }
}

/// True if a `Host` is this computer or, where the page is open to the network, any numeric address.
fn is_own_host(host: &str, is_here_alone: bool) -> bool {
    let name = host.rsplit_once(':').map_or(host, |(name, port)| {
        if port.bytes().all(|digit| digit.is_ascii_digit()) {
            name
        } else {
            host
        }
    });
    let name = name.trim_start_matches('[').trim_end_matches(']');
    name == "localhost"
        || name
            .parse::<IpAddr>()
            .is_ok_and(|ip| !is_here_alone || ip.is_loopback())
}

/// True for a request to a name of this computer that, if a page makes it, comes from its own page.
fn is_own(headers: &HeaderMap, is_here_alone: bool) -> bool {
    let text = |name| headers.get(name).map(|value| value.to_str().unwrap_or("?"));
    let host = text(header::HOST).unwrap_or_default();
    let is_own_page = text(header::ORIGIN).is_none_or(|origin| origin == format!("http://{host}"));
    is_own_host(host, is_here_alone) && is_own_page
}

/// Refuses requests that are not the page's own, and says on every answer what a browser may do with it.
async fn guard(State(served): State<Served>, request: Request, next: Next) -> Response {
    let is_own = is_own(request.headers(), served.is_here_alone);
    let mut answer = if is_own {
        next.run(request).await
    } else {
        let advice = "open the page at the address that `bead monitor` printed\n";
        (StatusCode::FORBIDDEN, advice).into_response()
    };
    for (name, value) in [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        // The token is in the address.
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-store"),
        (header::X_FRAME_OPTIONS, "DENY"),
    ] {
        answer.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    answer
}

async fn live(State(served): State<Served>, headers: HeaderMap, upgrade: WebSocketUpgrade) -> Response {
    // Every browser sends an origin here. Another program reads the recording.
    if !headers.contains_key(header::ORIGIN) {
        return (StatusCode::FORBIDDEN, "only for the page of `bead monitor`\n").into_response();
    }
    if served.browsers.fetch_add(1, Ordering::Relaxed) >= BROWSERS {
        served.browsers.fetch_sub(1, Ordering::Relaxed);
        return (
            StatusCode::SERVICE_UNAVAILABLE,
            "too many browsers are connected\n",
        )
            .into_response();
    }
    let place = BrowserPlace(Arc::clone(&served.browsers));
    let upgrade = upgrade.max_message_size(1 << 10);
    upgrade.on_upgrade(move |socket| async move {
        // An end of the connection is no error: the browser connects again.
        let _ = tell_news(socket, &served.monitor).await;
        drop(place);
    })
}

/// One of the places for browsers. Dropping it frees the place.
struct BrowserPlace(Arc<AtomicUsize>);

impl Drop for BrowserPlace {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Sends a browser the state and the new strikes until it goes.
async fn tell_news(mut socket: WebSocket, monitor: &SharedMonitor) -> Option<()> {
    let (mut feed, mut clock) = (Feed::default(), interval(NEWS_EVERY));
    loop {
        tokio::select! {
            received = socket.recv() => drop(received?.ok()?),
            _ = clock.tick() => {
                let strikes = feed.take(monitor, STRIKES_AT_A_TIME);
                let with_curves = strikes.iter().map(|strike| {
                    json!({ "strike": &**strike, "curves": strike.curves() })
                });
                let strikes: Vec<_> = with_curves.collect();
                let state = monitor.lock().view();
                let news = json!({ "state": state, "missed": feed.missed, "strikes": strikes });
                let sent = socket.send(Message::Text(news.to_string().into()));
                timeout(PATIENCE, sent).await.ok()?.ok()?;
            }
        }
    }
}

/// Sends the recording so far, made whole.
async fn download(State(served): State<Served>) -> Response {
    let file = served.monitor.lock().file().map(Path::to_owned);
    let Some(file) = file else {
        return (StatusCode::NOT_FOUND, "this program has no recording yet\n").into_response();
    };
    let copied = tokio::task::spawn_blocking(move || whole_copy(&file)).await;
    match copied {
        Ok(Ok(copy)) => {
            let kind = [
                (header::CONTENT_TYPE, "application/octet-stream"),
                (header::CONTENT_DISPOSITION, "attachment; filename=\"bead.mcap\""),
            ];
            let stream = ReaderStream::new(tokio::fs::File::from_std(copy));
            (kind, Body::from_stream(stream)).into_response()
        }
        Ok(Err(why)) => (StatusCode::INTERNAL_SERVER_ERROR, format!("{why}\n")).into_response(),
        Err(_) => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
    }
}

/// A whole recording of a file's content so far. Its own file is already deleted, so it vanishes when closed.
fn whole_copy(recording: &Path) -> Result<std::fs::File, String> {
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let copy = folder.path().join("bead.mcap");
    let recording = Recording::open(recording).map_err(|error| error.to_string())?;
    recover(&recording, &Target::new(&copy)).map_err(|error| error.to_string())?;
    std::fs::File::open(&copy).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_names_that_cannot_be_another_computers_are_this_one() {
        for host in ["localhost:80", "127.0.0.1:8080", "[::1]:80", "127.0.0.1"] {
            assert!(is_own_host(host, true), "{host}");
        }
        for host in [
            "",
            "evil.example:80",
            "127.0.0.1.evil.example",
            "192.168.1.2:80",
            "localhost.evil:80",
        ] {
            assert!(!is_own_host(host, true), "{host}");
        }
        assert!(is_own_host("192.168.1.2:80", false));
        assert!(!is_own_host("evil.example:80", false));
    }
}
