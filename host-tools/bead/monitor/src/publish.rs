//! Strikes and states for programs that take them as they come.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use crate::feed::Feed;
use crate::model::{BeadView, HISTORY, SharedMonitor};
use crate::strike::ShownStrike;

/// Interval of the search for new strikes, and of the states of beads.
const LOOK_EVERY: Duration = Duration::from_millis(50);
const STATE_EVERY: Duration = Duration::from_secs(1);

/// News of a bead.
pub(crate) enum News {
    /// A strike that came.
    Strike(Arc<ShownStrike>),
    /// The state of a bead, once a second.
    State(Box<BeadView>),
}

impl News {
    /// Address of the bead.
    pub(crate) fn bead(&self) -> u8 {
        match self {
            Self::Strike(strike) => strike.bead,
            Self::State(state) => state.bead,
        }
    }

    /// Its time, s since 1970: when a strike was received, else now.
    pub(crate) fn time(&self) -> f64 {
        let received = match self {
            Self::Strike(strike) => strike.received_ms.map(|ms| 1e-3 * ms),
            Self::State(_) => None,
        };
        let now = || {
            let since = SystemTime::now().duration_since(UNIX_EPOCH);
            since.map_or(0.0, |since| since.as_secs_f64())
        };
        received.unwrap_or_else(now)
    }
}

/// Calls `send` with each strike, and with the state of each bead once a second, until `stop`.
pub(crate) fn publish(monitor: &SharedMonitor, stop: &AtomicBool, mut send: impl FnMut(&News)) {
    let (mut feed, mut sent) = (Feed::default(), None::<Instant>);
    while !stop.load(Ordering::Relaxed) {
        for strike in feed.take(monitor, HISTORY) {
            send(&News::Strike(strike));
        }
        if sent.is_none_or(|sent| sent.elapsed() >= STATE_EVERY) {
            sent = Some(Instant::now());
            let beads = monitor.lock().view().beads;
            for bead in beads {
                send(&News::State(Box::new(bead)));
            }
        }
        thread::sleep(LOOK_EVERY);
    }
}
