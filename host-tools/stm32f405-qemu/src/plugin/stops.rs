//! The stops of a live run: at a time set by the host, the image stands still until the host sets the next
//! one.
//!
//! # Design
//! QEMU's virtual clock stands still while a callback runs, however long it takes. So the overlay asks to be
//! called at the time of the stop, as for an interrupt, and waits for the host inside that call. The image
//! does not notice.
//!
//! A thread reads the host's messages, also in runs that are not live, and notices at once when the host is
//! gone.

use std::fs::File;
use std::io::{self, Read};
use std::sync::mpsc::{Receiver, Sender, channel};

use crate::exchange::{self, REPORT, Reached, STEP, TimeStep};
use crate::given::Inputs;
use crate::machine::USARTS;

pub(super) struct Stops {
    /// The host's end of standard output.
    pub(super) to: Option<File>,
    steps: Receiver<TimeStep>,
    pub(super) at_ns: u64,
    /// Frames that each USART sent since the last stop, as records.
    pub(super) sent: [Vec<u8>; USARTS.len()],
    pub(super) log: Vec<u8>,
    pub(super) calls: u64,
    /// Instructions executed up to the last stop.
    pub(super) instructions: u64,
}

impl Stops {
    /// Begins with a stop at time 0. The sender is for [`listen`].
    pub(super) fn new() -> (Self, Sender<TimeStep>) {
        let (sender, steps) = channel();
        let stops = Self {
            to: None,
            steps,
            at_ns: 0,
            sent: Default::default(),
            log: Vec::new(),
            calls: 0,
            instructions: 0,
        };
        (stops, sender)
    }

    /// Sends the host the output since the last stop, and clears it.
    pub(super) fn tell(&mut self, reached: Reached) {
        let mut bytes = Vec::new();
        let mut sent = Vec::new();
        for records in &mut self.sent {
            sent.push(records.len());
            bytes.append(records);
        }
        bytes.append(&mut self.log);
        self.calls = 0;
        let reached = Reached { sent, ..reached };
        let to = self.to.as_mut();
        if to.is_none_or(|to| exchange::write_message(to, &reached, &bytes).is_err()) {
            without_host();
        }
    }

    /// Waits for the host. Returns the inputs up to the next stop, or `None` if the run ends here.
    pub(super) fn wait(&mut self) -> Option<Inputs> {
        let step = self.steps.recv().unwrap_or_else(|_| without_host());
        self.at_ns = step.to_ns?;
        Some(step.inputs)
    }
}

/// Blocks when the host is gone: the thread that listens to it ends QEMU.
fn without_host() -> ! {
    loop {
        std::thread::park();
    }
}

/// Passes the host's steps on, until it asks for the report (`true`) or closes its end.
pub(super) fn listen(mut from: File, steps: Option<&Sender<TimeStep>>) -> bool {
    loop {
        let mut what = [0];
        match (from.read(&mut what), what, steps) {
            (Ok(1), [STEP], Some(steps)) => {
                let Ok((mut step, rows)) = exchange::read_message::<TimeStep>(&mut from) else {
                    return false;
                };
                step.inputs.codes = exchange::rows(&rows);
                if steps.send(step).is_err() {
                    return false;
                }
            }
            (Ok(1), [REPORT], _) => return true,
            (Err(error), ..) if error.kind() == io::ErrorKind::Interrupted => {}
            _ => return false,
        }
    }
}
