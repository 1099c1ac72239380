//! The page in a browser.
//!
//! # Design
//! One thread serves the page, on an address of this computer unless its user asks for more. The path begins
//! with a token that is new each time, so other users and other pages do not find it. The `Host` of a request
//! must be an address or `localhost`, which no name that is rebound to this computer is, and its `Origin`, if
//! it has one, the page itself. The page loads nothing from elsewhere (`Content-Security-Policy`), and writes
//! what it gets as text. It only looks: nothing that a browser sends changes a bead or a recording.
//!
//! **Slow browsers.** Each connection takes what is new when it is ready for it ([`Feed`]). It holds up
//! nobody, and the page says how many strikes it missed. One that connects again gets the state and the
//! strikes that are kept.

use std::io;
use std::net::{IpAddr, SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use axum::Router;
use axum::body::Body;
use axum::extract::ws::{Message, WebSocket};
use axum::extract::{Request, State, WebSocketUpgrade};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use rand::TryRng;
use rand::rngs::SysRng;
use serde_json::{Value, json};
use tokio::io::AsyncReadExt;
use tokio_util::io::ReaderStream;

use crate::feed::Feed;
use crate::model::SharedMonitor;
use crate::strike::ShownStrike;

/// Interval of the states.
const BEAT: Duration = Duration::from_millis(250);
/// Time after which a browser that takes nothing is disconnected.
const PATIENCE: Duration = Duration::from_secs(30);
/// Greatest number of connections at a time.
const BROWSERS_MOST: usize = 16;
/// Sources of everything that the page loads, and nobody may frame it.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data:; \
                      base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// The files of the page, in the program: name, type, contents.
const FILES: [(&str, &str, &str); 5] = [
    ("", "text/html; charset=utf-8", include_str!("../page/index.html")),
    ("page.css", "text/css", include_str!("../page/page.css")),
    ("page.js", "text/javascript", include_str!("../page/page.js")),
    (
        "uplot.css",
        "text/css",
        include_str!("../page/uplot/uPlot.min.css"),
    ),
    (
        "uplot.js",
        "text/javascript",
        include_str!("../page/uplot/uPlot.iife.min.js"),
    ),
];

/// A page that is ready to be served.
pub struct WebPage {
    listener: TcpListener,
    address: SocketAddr,
    token: String,
}

#[derive(Clone)]
struct Served {
    monitor: SharedMonitor,
    address: SocketAddr,
    /// Number of connections.
    browsers: Arc<AtomicUsize>,
}

impl WebPage {
    /// Listens at an address; port 0 is any that is free. `only_here` refuses addresses that other computers
    /// reach.
    ///
    /// # Errors
    /// One line: the address is reached by others, or cannot be listened at.
    pub fn open(address: SocketAddr, only_here: bool) -> Result<Self, String> {
        if only_here && !address.ip().is_loopback() {
            return Err(format!(
                "--web {address}: other computers reach this address, and the page is not encrypted; give 127.0.0.1, and an \
                 ssh tunnel to it, or --web-without-encryption"
            ));
        }
        let failed = |why: io::Error| {
            format!("--web: cannot listen at {address}: {why}; give another port, or 127.0.0.1:0 for any")
        };
        let listener = TcpListener::bind(address).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        let mut random = [0; 16];
        SysRng
            .try_fill_bytes(&mut random)
            .map_err(|why| format!("--web: the system gives no random token ({why})"))?;
        let token = random.iter().map(|byte| format!("{byte:02x}")).collect();
        Ok(Self {
            listener,
            address,
            token,
        })
    }

    /// The address for the browser, with the token.
    pub fn url(&self) -> String {
        format!("http://{}/{}/", self.address, self.token)
    }

    /// Serves until `stop`.
    ///
    /// # Errors
    /// The system gives no sockets any more.
    pub fn serve(self, monitor: &SharedMonitor, stop: &AtomicBool) -> io::Result<()> {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()?;
        let served = Served {
            monitor: monitor.clone(),
            address: self.address,
            browsers: Arc::default(),
        };
        let mut page = Router::new()
            .route("/live", get(live))
            .route("/recording", get(recording));
        for (name, kind, contents) in FILES {
            let file = move || async move { ([(header::CONTENT_TYPE, kind)], contents) };
            page = page.route(&format!("/{name}"), get(file));
        }
        let app = Router::new()
            .nest(&format!("/{}", self.token), page)
            // `nest` takes the path without its last slash for the page's root.
            .route(&format!("/{}/", self.token), get(index))
            .layer(middleware::from_fn_with_state(served.clone(), guarded))
            .with_state(served);
        runtime.block_on(async {
            let listener = tokio::net::TcpListener::from_std(self.listener)?;
            tokio::select! {
                served = async { axum::serve(listener, app).await } => served,
                () = stopped(stop) => Ok(()),
            }
        })
    }
}

async fn stopped(stop: &AtomicBool) {
    while !stop.load(Ordering::Relaxed) {
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

async fn index() -> impl IntoResponse {
    ([(header::CONTENT_TYPE, FILES[0].1)], FILES[0].2)
}

/// Refuses requests from other pages and under other names, and says to the browser what the page may do.
async fn guarded(State(served): State<Served>, request: Request, next: Next) -> Response {
    let mut response = if is_ours(request.headers(), served.address) {
        next.run(request).await
    } else {
        let why = "this page answers under its address only, and to itself only\n";
        (StatusCode::FORBIDDEN, why).into_response()
    };
    let headers = response.headers_mut();
    for (name, value) in [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::CACHE_CONTROL, "no-store"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    response
}

/// True if a request names the page by an address, and comes from the page or from no page.
fn is_ours(headers: &HeaderMap, address: SocketAddr) -> bool {
    let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
    let Some(host) = text(header::HOST) else {
        return false;
    };
    let Some((name, port)) = host.rsplit_once(':') else {
        return false;
    };
    let ip = name
        .trim_start_matches('[')
        .trim_end_matches(']')
        .parse::<IpAddr>();
    let is_address = ip.is_ok_and(|ip| ip.is_loopback() || !address.ip().is_loopback());
    let is_named = is_address || name == "localhost";
    let is_from_itself = match headers.get(header::ORIGIN) {
        None => true,
        Some(origin) => origin
            .to_str()
            .is_ok_and(|origin| origin == format!("http://{host}")),
    };
    is_named && port == address.port().to_string() && is_from_itself
}

/// The recording as far as it is on disk: a recording that is cut, which every command reads.
async fn recording(State(served): State<Served>) -> Response {
    let path = served.monitor.lock().file().map(ToOwned::to_owned);
    let gone = |why: &str| (StatusCode::NOT_FOUND, why.to_owned()).into_response();
    let Some(path) = path else {
        return gone("nothing is recorded here\n");
    };
    let Ok(file) = tokio::fs::File::open(&path).await else {
        return gone("the recording has its final name now\n");
    };
    let length = file.metadata().await.map_or(0, |metadata| metadata.len());
    let headers = [
        (header::CONTENT_TYPE, "application/octet-stream"),
        (
            header::CONTENT_DISPOSITION,
            "attachment; filename=\"so-far.mcap\"",
        ),
    ];
    // Not what is written meanwhile: a download has an end.
    let body = Body::from_stream(ReaderStream::new(file.take(length)));
    (headers, body).into_response()
}

async fn live(State(served): State<Served>, upgrade: WebSocketUpgrade) -> Response {
    if served.browsers.fetch_add(1, Ordering::Relaxed) >= BROWSERS_MOST {
        served.browsers.fetch_sub(1, Ordering::Relaxed);
        return (StatusCode::SERVICE_UNAVAILABLE, "too many browsers\n").into_response();
    }
    upgrade.on_upgrade(move |socket| async move {
        // The browser has gone away, or takes nothing.
        let _ = send_all(socket, &served).await;
        served.browsers.fetch_sub(1, Ordering::Relaxed);
    })
}

/// Sends states and strikes until the browser goes away; `None` then.
async fn send_all(mut socket: WebSocket, served: &Served) -> Option<()> {
    let mut feed = Feed::default();
    loop {
        let strikes = feed.take(&served.monitor);
        if !strikes.is_empty() {
            send(&mut socket, &strikes_json(&strikes)).await?;
        }
        let (view, can_download) = {
            let mut monitor = served.monitor.lock();
            (monitor.view(), monitor.file().is_some())
        };
        let mut state = json!({"type": "state", "left_out": feed.missed, "can_download": can_download});
        if let (Value::Object(state), Ok(Value::Object(view))) = (&mut state, serde_json::to_value(&view)) {
            state.extend(view);
        }
        send(&mut socket, &state).await?;
        // What it says is of no interest, but for its end.
        match tokio::time::timeout(BEAT, socket.recv()).await {
            Ok(None | Some(Err(_)) | Some(Ok(Message::Close(_)))) => return None,
            Ok(Some(Ok(_))) => tokio::time::sleep(BEAT).await,
            Err(_) => {}
        }
    }
}

async fn send(socket: &mut WebSocket, value: &Value) -> Option<()> {
    let sent = socket.send(Message::Text(value.to_string().into()));
    tokio::time::timeout(PATIENCE, sent).await.ok()?.ok()
}

/// Strikes for the page; the last one of each bead has its curves, as only those are drawn.
fn strikes_json(strikes: &[Arc<ShownStrike>]) -> Value {
    let is_last = |place: usize| {
        let later = &strikes[place + 1..];
        later.iter().all(|strike| strike.bead != strikes[place].bead)
    };
    let all = strikes.iter().enumerate().map(|(place, strike)| {
        let mut value = json!(**strike);
        if is_last(place) {
            value["curves"] = json!(strike.curves());
        }
        value
    });
    json!({"type": "strikes", "strikes": all.collect::<Vec<_>>()})
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};
    use std::net::TcpStream;
    use std::thread;

    use super::*;
    use crate::testing::struck;

    /// The answer to a request with these header lines; `{}` in them is the page's address.
    fn answer(page: SocketAddr, path: &str, headers: &str) -> String {
        let mut stream = TcpStream::connect(page).unwrap();
        let headers = headers.replace("{}", &page.to_string());
        write!(
            stream,
            "GET {path} HTTP/1.1\r\nConnection: close\r\n{headers}\r\n"
        )
        .unwrap();
        let mut text = Vec::new();
        stream.set_read_timeout(Some(Duration::from_secs(2))).unwrap();
        let mut buffer = [0; 4096];
        while let Ok(length @ 1..) = stream.read(&mut buffer) {
            text.extend_from_slice(&buffer[..length]);
        }
        String::from_utf8_lossy(&text).into_owned()
    }

    fn with_page(test: impl FnOnce(SocketAddr, &str)) {
        let page = WebPage::open("127.0.0.1:0".parse().unwrap(), true).unwrap();
        let (address, path) = (page.address, format!("/{}/", page.token));
        let (monitor, stop) = (struck(), AtomicBool::new(false));
        thread::scope(|scope| {
            struct Stop<'a>(&'a AtomicBool);
            impl Drop for Stop<'_> {
                fn drop(&mut self) {
                    self.0.store(true, Ordering::Relaxed);
                }
            }
            let serving = scope.spawn(|| page.serve(&monitor, &stop));
            {
                let _stop = Stop(&stop);
                test(address, &path);
            }
            serving.join().unwrap().unwrap();
        });
    }

    #[test]
    fn only_who_has_the_token_the_right_host_and_the_right_origin_is_answered() {
        with_page(|page, path| {
            let status = |path: &str, headers: &str| {
                let text = answer(page, path, headers);
                let status = text
                    .split(' ')
                    .nth(1)
                    .map(|status| status.parse::<u16>().unwrap());
                status.unwrap()
            };
            let good = "Host: {}\r\n";
            assert_eq!(status(path, good), 200);
            let port = page.port();
            assert_eq!(status(path, &format!("Host: localhost:{port}\r\n")), 200);
            assert_eq!(status(path, "Host: {}\r\nOrigin: http://{}\r\n"), 200);
            for file in &FILES[1..] {
                assert_eq!(status(&format!("{path}{}", file.0), good), 200, "{}", file.0);
            }
            assert_eq!(status("/", good), 404);
            assert_eq!(status(&format!("/{}/", "0".repeat(32)), good), 404);
            // A name that was rebound to this computer, another page, and a page in a frame of no origin.
            assert_eq!(status(path, &format!("Host: evil.example:{port}\r\n")), 403);
            assert_eq!(status(path, "Host: 127.0.0.1:1\r\n"), 403);
            assert_eq!(status(path, "Host: {}\r\nOrigin: http://evil.example\r\n"), 403);
            assert_eq!(status(path, "Host: {}\r\nOrigin: null\r\n"), 403);
            assert_eq!(status(&format!("{path}recording"), good), 404);
        });
    }

    #[test]
    fn the_page_may_load_nothing_from_elsewhere_and_names_no_other_server() {
        with_page(|page, path| {
            let text = answer(page, path, "Host: {}\r\n");
            assert!(text.contains(&POLICY.split("; ").next().unwrap()[..18]), "{text}");
            assert!(
                text.contains("content-security-policy") && text.contains("referrer-policy: no-referrer")
            );
        });
        for (name, _, contents) in FILES {
            assert!(
                !contents.contains("//cdn") && !contents.contains("src=\"http"),
                "{name}"
            );
            // What comes from a device must not be parsed as HTML.
            if name == "page.js" {
                assert!(!contents.contains("innerHTML") && !contents.contains("document.write"));
            }
        }
    }

    const UPGRADE: &str = "Host: {}\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
                           Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nOrigin: http://{}\r\n";

    #[test]
    fn a_browser_gets_the_state_and_the_strikes_and_one_that_comes_again_gets_them_again() {
        with_page(|page, path| {
            for _ in 0..2 {
                let mut stream = TcpStream::connect(page).unwrap();
                let headers = UPGRADE.replace("{}", &page.to_string());
                write!(
                    stream,
                    "GET {path}live HTTP/1.1\r\nConnection: Upgrade\r\n{headers}\r\n"
                )
                .unwrap();
                let mut text = Vec::new();
                let mut buffer = [0; 4096];
                let has = |text: &[u8], part: &str| String::from_utf8_lossy(text).contains(part);
                while !(has(&text, "\"type\":\"strikes\"") && has(&text, "\"type\":\"state\"")) {
                    let length = stream.read(&mut buffer).unwrap();
                    assert!(length > 0, "{}", String::from_utf8_lossy(&text));
                    text.extend_from_slice(&buffer[..length]);
                }
                for part in [
                    "101 Switching",
                    "\"curves\":{\"from_ms\"",
                    "\"supply_v\":3.3",
                    "left_out\":0",
                ] {
                    assert!(has(&text, part), "{part}: {}", String::from_utf8_lossy(&text));
                }
            }
        });
    }

    #[test]
    fn a_reader_that_is_slow_learns_how_many_strikes_it_missed() {
        let monitor = struck();
        let mut feed = Feed::default();
        assert_eq!((feed.take(&monitor).len(), feed.missed), (1, 0));
        let mut bead = bead_testing::Speaker {
            boot: 1,
            ..bead_testing::Speaker::at(7)
        };
        let mut reader = bead_recording::frames::FrameReader::default();
        let more = crate::model::HISTORY as u64 + 10;
        crate::testing::strike_again(&mut bead, more as u32);
        reader.feed(&bead.bytes, Some(1), |item| monitor.lock().push(0, &item));
        assert_eq!(feed.take(&monitor).len(), crate::model::HISTORY);
        assert_eq!(feed.missed, 10);
    }

    #[test]
    fn an_address_that_others_reach_is_refused_unless_it_is_asked_for() {
        let all = "0.0.0.0:0".parse().unwrap();
        let refused = WebPage::open(all, true).err().unwrap();
        assert!(refused.contains("not encrypted"), "{refused}");
        assert!(WebPage::open(all, false).is_ok());
        let taken = WebPage::open("127.0.0.1:0".parse().unwrap(), true).unwrap();
        let refused = WebPage::open(taken.address, true).err().unwrap();
        assert!(refused.contains("give another port"), "{refused}");
        assert_eq!(refused.lines().count(), 1);
    }
}
