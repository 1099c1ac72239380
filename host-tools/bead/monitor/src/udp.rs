//! Strikes and states as JSON over UDP, as PlotJuggler's UDP server takes them.
//!
//! # Design
//! A datagram is one JSON object. It has `timestamp`, s since 1970, and an object for one bead, named
//! `bead_7`, whose numbers become time series of these names. A receiver that is away costs nothing.

use std::io;
use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use serde_json::{Value, json};

use crate::feed::Feed;
use crate::model::{HISTORY, SharedMonitor};

/// Interval of the search for new strikes, and of the states of beads.
const LOOK_EVERY: Duration = Duration::from_millis(50);
const STATE_EVERY: Duration = Duration::from_secs(1);

/// Sends datagrams to one address.
pub struct UdpSender(UdpSocket);

impl UdpSender {
    /// Prepares to send to an address.
    ///
    /// # Errors
    /// The system has no way there.
    pub fn open(to: SocketAddr) -> io::Result<Self> {
        let any: SocketAddr = match to {
            SocketAddr::V4(_) => (Ipv4Addr::UNSPECIFIED, 0).into(),
            SocketAddr::V6(_) => (Ipv6Addr::UNSPECIFIED, 0).into(),
        };
        let socket = UdpSocket::bind(any)?;
        socket.connect(to)?;
        socket.set_nonblocking(true)?;
        Ok(Self(socket))
    }

    /// Sends each strike, and the state of each bead once a second, until `stop`.
    pub fn serve(&self, monitor: &SharedMonitor, stop: &AtomicBool) {
        let (mut feed, mut told) = (Feed::default(), None::<Instant>);
        while !stop.load(Ordering::Relaxed) {
            for strike in feed.take(monitor, HISTORY) {
                self.send(
                    strike.received_ms.map(|ms| 1e-3 * ms),
                    strike.bead,
                    json!(&*strike),
                );
            }
            if told.is_none_or(|told| told.elapsed() >= STATE_EVERY) {
                told = Some(Instant::now());
                let beads = monitor.lock().view().beads;
                for bead in beads {
                    self.send(None, bead.bead, json!({ "state": bead }));
                }
            }
            thread::sleep(LOOK_EVERY);
        }
    }

    /// Sends what is known of a bead at a time, s since 1970; now, if that is `None`.
    fn send(&self, at: Option<f64>, bead: u8, known: Value) {
        let now = || {
            let since = SystemTime::now().duration_since(UNIX_EPOCH);
            since.map_or(0.0, |since| since.as_secs_f64())
        };
        let mut datagram = json!({ "timestamp": at.unwrap_or_else(now) });
        datagram[format!("bead_{bead}")] = known;
        // A datagram may get lost anyway.
        let _ = self.0.send(datagram.to_string().as_bytes());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Monitor;
    use bead_recording::frames::FrameReader;
    use bead_testing::Speaker;

    #[test]
    fn a_receiver_gets_the_state_of_each_bead_as_one_object_under_its_name() {
        let receiver = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        receiver.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        let sender = UdpSender::open(receiver.local_addr().unwrap()).unwrap();
        let (monitor, stop) = (
            SharedMonitor::new(Monitor::new(Vec::new(), String::new())),
            AtomicBool::new(false),
        );
        let mut bead = Speaker::at(7);
        let identity = bead.identity();
        bead.say(0, identity);
        FrameReader::default().feed(&bead.bytes, None, |item| monitor.lock().push(0, &item));
        let mut buffer = [0; 65_536];
        let length = thread::scope(|scope| {
            scope.spawn(|| sender.serve(&monitor, &stop));
            let received = receiver.recv(&mut buffer);
            stop.store(true, Ordering::Relaxed);
            received.unwrap()
        });
        let datagram: Value = serde_json::from_slice(&buffer[..length]).unwrap();
        assert!(datagram["timestamp"].as_f64().unwrap() > 1.7e9, "{datagram}");
        assert_eq!(datagram["bead_7"]["state"]["frames"], 1, "{datagram}");
    }
}
