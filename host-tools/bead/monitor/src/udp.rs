//! Strikes and states as JSON over UDP, as PlotJuggler's UDP server takes them.
//!
//! # Design
//! A datagram is one JSON object. It has `timestamp`, s since 1970, and an object for one bead, named
//! `bead_7`, whose numbers become time series of these names. A receiver that is away costs nothing.

use std::io;
use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::sync::atomic::AtomicBool;

use serde_json::json;

use crate::model::SharedMonitor;
use crate::publish::{News, publish};

/// Sends datagrams to one address.
pub struct UdpSender(UdpSocket);

impl UdpSender {
    /// Prepares to send to an address.
    ///
    /// # Errors
    /// The system has no route to the address.
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
        publish(monitor, stop, |news| {
            let known = match news {
                News::Strike(strike) => json!(**strike),
                News::State(state) => json!({ "state": state }),
            };
            let mut datagram = json!({ "timestamp": news.time() });
            datagram[format!("bead_{}", news.bead())] = known;
            // A datagram may get lost anyway.
            let _ = self.0.send(datagram.to_string().as_bytes());
        });
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::Ordering;
    use std::thread;
    use std::time::Duration;

    use super::*;
    use crate::model::Monitor;
    use bead_recording::frames::FrameReader;
    use bead_testing::Speaker;
    use serde_json::Value;

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
