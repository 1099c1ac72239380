//! `bead monitor --web` in Chromium without a window, driven over its DevTools protocol.
//!
//! Where Chromium is missing, or QEMU for the beads that need it, the tests are skipped and say so.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::os::unix::net::UnixListener;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::Duration;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use bead_testing::{Speaker, paper_settings};
use bead_wire::{Fault, FaultCause};
use serde_json::{Value, json};
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket};

use crate::monitor::draws_pictures;
use crate::program::{ROOT, RunningProgram, TestFolder, until};

/// A page in a browser.
struct Page {
    browser: Child,
    line: WebSocket<MaybeTlsStream<TcpStream>>,
    session: Option<String>,
    number: u64,
}

impl Page {
    /// Opens a page; `None` where there is no Chromium.
    fn open(folder: &TestFolder, url: &str) -> Option<Self> {
        let mut chromium = Command::new("chromium");
        chromium.args("--headless --no-sandbox --disable-gpu --window-size=1280,1190".split(' '));
        let profile = folder.join("profile");
        chromium.arg(format!("--user-data-dir={}", profile.display()));
        chromium.args(["--remote-debugging-port=0", "about:blank"]);
        let Ok(mut browser) = chromium.stderr(Stdio::piped()).stdout(Stdio::null()).spawn() else {
            eprintln!("skipped: there is no `chromium` here");
            return None;
        };
        let mut said = BufReader::new(browser.stderr.take().unwrap());
        let mut line = String::new();
        let devtools = loop {
            line.clear();
            assert!(said.read_line(&mut line).unwrap() > 0, "Chromium ended");
            if let Some(address) = line.trim().strip_prefix("DevTools listening on ") {
                break address.to_owned();
            }
        };
        // Chromium would block if nobody read its output.
        thread::spawn(move || std::io::copy(&mut said, &mut std::io::sink()));
        let (line, _) = tungstenite::connect(devtools).unwrap();
        let mut page = Self {
            browser,
            line,
            session: None,
            number: 0,
        };
        let target = page.ask("Target.createTarget", json!({ "url": url }));
        let attach = json!({ "targetId": target["targetId"], "flatten": true });
        let session = page.ask("Target.attachToTarget", attach);
        page.session = session["sessionId"].as_str().map(str::to_owned);
        Some(page)
    }

    fn ask(&mut self, method: &str, parameters: Value) -> Value {
        self.number += 1;
        let mut asked = json!({ "id": self.number, "method": method, "params": parameters });
        if let Some(session) = &self.session {
            asked["sessionId"] = session.as_str().into();
        }
        self.line.send(Message::text(asked.to_string())).unwrap();
        loop {
            let answer: Value = serde_json::from_str(self.line.read().unwrap().to_text().unwrap()).unwrap();
            if answer["id"] == self.number {
                assert!(answer["error"].is_null(), "{method}: {answer}");
                return answer["result"].clone();
            }
        }
    }

    /// The value of an expression in the page.
    fn value(&mut self, expression: &str) -> Value {
        let asked = json!({ "expression": expression, "returnByValue": true, "awaitPromise": true });
        self.ask("Runtime.evaluate", asked)["result"]["value"].clone()
    }

    fn until(&mut self, expression: &str) {
        until(expression, || {
            thread::sleep(Duration::from_millis(100));
            self.value(expression) == true
        });
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.browser.kill();
        let _ = self.browser.wait();
    }
}

/// Waits for the address of the page.
fn url(monitor: &mut RunningProgram) -> String {
    let line = monitor.error_line();
    let url = line.split(' ').find(|word| word.starts_with("http://"));
    url.unwrap_or_else(|| panic!("no address in {line}")).to_owned()
}

/// Serves a bead that was struck once, at a socket. Its fault has a text that no page may take for markup.
fn hostile_bead(folder: &TestFolder) {
    let mut bead = Speaker::at(7);
    let codes = (0..3000).map(|sample| {
        let at = f64::from(sample) - 2000.0;
        let force = 128.0 + 6.0 * 256.0 * (-(at / 20.0).powi(2)).exp();
        [force as u16, 128, 2048, 2048].map(|code: u16| code + (sample % 2) as u16)
    });
    assert_eq!(bead.measure(&paper_settings(), codes), 1);
    let fault = Fault {
        cause: FaultCause::Panic,
        boot: 0,
        pc: 0,
        detail: "<img src=x onerror=hit=1>".into(),
    };
    bead.say(0, fault);
    let listener = UnixListener::bind(folder.join("bead.sock")).unwrap();
    thread::spawn(move || {
        let (mut line, _) = listener.accept().unwrap();
        line.write_all(&bead.bytes).unwrap();
        // The bead stays until the monitor hangs up.
        let _ = line.read(&mut [0]);
    });
}

/// The status of an answer to a request with these headers.
fn status(url: &str, path: &str, headers: &str) -> String {
    let (host, token) = url.strip_prefix("http://").unwrap().split_once('/').unwrap();
    let mut line = TcpStream::connect(host).unwrap();
    let headers = headers.replace("HOST", host);
    let request = format!("GET /{token}{path} HTTP/1.1\r\n{headers}Connection: close\r\n\r\n");
    line.write_all(request.as_bytes()).unwrap();
    let mut answer = String::new();
    BufReader::new(line).read_line(&mut answer).unwrap();
    answer.split(' ').nth(1).unwrap().to_owned()
}

#[test]
fn a_page_shows_text_of_a_bead_as_text_and_only_the_page_itself_gets_an_answer() {
    let folder = TestFolder::new();
    hostile_bead(&folder);
    let mut monitor = folder.start("monitor --port unix:bead.sock --web --out a.mcap");
    let url = url(&mut monitor);
    let (own, evil) = ("Host: HOST\r\n", "Origin: http://evil.example\r\n");
    let upgrade = "Host: HOST\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
                   Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";
    for (path, headers, expected) in [
        ("", own, "200"),
        ("page.js", own, "200"),
        ("", "Host: evil.example\r\n", "403"),
        ("", &format!("{own}{evil}"), "403"),
        ("live", upgrade, "403"),
        ("live", &format!("{upgrade}{evil}"), "403"),
        ("live", &format!("{upgrade}Origin: http://HOST\r\n"), "101"),
    ] {
        assert_eq!(status(&url, path, headers), expected, "{path} {headers}");
    }
    let other = url.replace(|digit: char| digit.is_ascii_hexdigit() && digit > '9', "0");
    assert_eq!(status(&other, "", own), "404");

    let Some(mut page) = Page::open(&folder, &url) else {
        return;
    };
    page.until("document.querySelectorAll('#strikes tbody tr').length === 1");
    page.until("document.getElementById('messages').textContent.includes('<img src=x onerror=hit=1>')");
    let hits = page.value("document.querySelectorAll('img').length + (window.hit ?? 0)");
    let curves = page.value("document.querySelectorAll('#curves canvas').length");
    assert_eq!((hits, curves), (0.into(), 3.into()));
    let title = page.value("document.getElementById('title').textContent");
    let title = title.as_str().unwrap();
    assert!(title.starts_with("Strike 0 of bead 7"), "{title}");
    // A browser that comes back finds the state again.
    page.ask("Page.reload", json!({}));
    page.until("document.querySelectorAll('#strikes tbody tr').length === 1");
    let magic = "fetch('recording').then((answer) => answer.text()).then((text) => text.slice(1, 5))";
    assert_eq!(page.value(magic), "MCAP");
    drop(page);
    monitor.signal("INT");
    assert!(monitor.finish().status.success());
    folder.done("replay a.mcap");
}

#[test]
fn emulated_beads_with_one_sync_line_are_on_one_time_in_the_picture_of_the_row() {
    if Command::new("qemu-system-arm").arg("--version").output().is_err() {
        eprintln!("skipped: `qemu-system-arm --version` does not run here");
        return;
    }
    let folder = TestFolder::new();
    let scenarios = format!("{ROOT}/docs/scenarios");
    let mut monitor = folder.start(&format!(
        "monitor --emulate {scenarios}/ten-intruders.toml --bead 7-10 --uncertainty {scenarios}/paper-bead.toml --web \
         --out row.mcap"
    ));
    let url = url(&mut monitor);
    let Some(mut page) = Page::open(&folder, &url) else {
        return;
    };
    page.until("document.querySelectorAll('#beads tbody tr').length === 4");
    page.until("document.querySelectorAll('#strikes tbody tr').length >= 12");
    page.until("document.getElementById('base').textContent.includes('all beads on one time')");
    // The wave is at bead 10 later than at bead 7, by what the chain of the scenario makes it take.
    // While a wave is on its way, some beads have not sent it yet.
    page.until(
        "(() => { const { beads } = wave(); if (beads.length < 4) return false; \
         window.later = beads[3].from - beads[0].from; return true; })()",
    );
    let later = page.value("window.later").as_f64().unwrap();
    assert!((0.5..1.0).contains(&later), "{later} ms");
    if draws_pictures() {
        let picture = page.ask("Page.captureScreenshot", json!({ "format": "png" }));
        let png = BASE64_STANDARD.decode(picture["data"].as_str().unwrap()).unwrap();
        fs::write(format!("{ROOT}/docs/images/monitor-web.png"), png).unwrap();
    }
    drop(page);
    monitor.signal("INT");
    assert!(monitor.finish().status.success());
}
