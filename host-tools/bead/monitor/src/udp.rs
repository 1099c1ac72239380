//! Strikes and states as JSON datagrams, for PlotJuggler and whatever reads JSON.
//!
//! # Design
//! A datagram is one JSON object with a `timestamp` in s since 1970. PlotJuggler (UDP server, JSON, "use field
//! as timestamp") makes a curve of every number in it by its path: `bead/7/strike/peak_force_n`. A strike's
//! curves follow as one datagram for each scan, as PlotJuggler takes no arrays. A datagram that nobody takes
//! is lost, as datagrams are.

use std::net::UdpSocket;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use serde_json::{Value, json};

use crate::feed::Feed;
use crate::model::SharedMonitor;
use crate::strike::ShownStrike;

/// Interval of the search for new strikes.
const BEAT: Duration = Duration::from_millis(100);
/// Interval of the states.
const STATE_EVERY: Duration = Duration::from_secs(1);

/// An address that takes datagrams.
pub struct Datagrams(UdpSocket);

impl Datagrams {
    /// Sends to HOST:PORT.
    ///
    /// # Errors
    /// It is no address, in one line.
    pub fn to(address: &str) -> Result<Self, String> {
        let wrong = |why: std::io::Error| {
            format!(
                "--udp {address}: {why}; give host and port of the program that listens, such as 127.0.0.1:9870"
            )
        };
        // The family of the address says from which one to send.
        let connect = |from: &str| {
            let socket = UdpSocket::bind(from)?;
            socket.connect(address).map(|()| socket)
        };
        let socket = connect("0.0.0.0:0")
            .or_else(|_| connect("[::]:0"))
            .map_err(wrong)?;
        Ok(Self(socket))
    }

    /// Sends what comes until `stop`.
    pub fn serve(&self, monitor: &SharedMonitor, stop: &AtomicBool) {
        let mut feed = Feed::default();
        let mut state = Instant::now();
        while !stop.load(Ordering::Relaxed) {
            for strike in feed.take(monitor) {
                self.send_strike(&strike);
            }
            if state.elapsed() >= STATE_EVERY {
                state = Instant::now();
                let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
                let view = monitor.lock().view();
                for bead in &view.beads {
                    let bead_json = json!({ bead.bead.to_string(): bead });
                    self.send(&json!({"timestamp": now.as_secs_f64(), "bead": bead_json}));
                }
            }
            thread::sleep(BEAT);
        }
    }

    fn send_strike(&self, strike: &ShownStrike) {
        let at = strike.received_ms.unwrap_or(0.0) * 1e-3;
        let of_bead = |value: Value| json!({ strike.bead.to_string(): value });
        self.send(&json!({"timestamp": at, "bead": of_bead(json!({"strike": strike}))}));
        let Some(curves) = strike.curves() else { return };
        for (place, (force, acceleration)) in curves.force_n.iter().zip(&curves.acceleration).enumerate() {
            let time = at + 1e-3 * (curves.from_ms + curves.step_ms * place as f64);
            let curve = json!({
                "force_n": force,
                "acceleration": acceleration,
                "residual": curves.residual.get(place),
            });
            self.send(&json!({"timestamp": time, "bead": of_bead(json!({"curve": curve}))}));
        }
    }

    fn send(&self, value: &Value) {
        // Nobody listens yet, or no longer: the next one may arrive.
        let _ = self.0.send(value.to_string().as_bytes());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::struck;

    #[test]
    fn a_strike_comes_as_json_with_its_curves_scan_by_scan() {
        let listener = UdpSocket::bind("127.0.0.1:0").unwrap();
        listener.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
        let monitor = struck();
        let sender = Datagrams::to(&listener.local_addr().unwrap().to_string()).unwrap();
        let strike = monitor.lock().last_strike(7).unwrap();
        sender.send_strike(&strike);
        let mut buffer = [0; 65536];
        let mut next = || {
            let length = listener.recv(&mut buffer).unwrap();
            serde_json::from_slice::<Value>(&buffer[..length]).unwrap()
        };
        let first = next();
        assert_eq!(first["bead"]["7"]["strike"]["peak_force_n"], strike.peak_force_n);
        let second = next();
        assert!(second["bead"]["7"]["curve"]["force_n"].is_number(), "{second}");
        let from = strike.curves().unwrap().from_ms * 1e-3;
        assert!((second["timestamp"].as_f64().unwrap() - from).abs() < 1e-6);
    }

    #[test]
    fn an_address_without_a_port_is_refused_in_one_line() {
        let refused = Datagrams::to("localhost").err().unwrap();
        assert!(refused.contains("give host and port"), "{refused}");
        assert_eq!(refused.lines().count(), 1);
    }
}
