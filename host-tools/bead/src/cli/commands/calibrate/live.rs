//! Recording of a procedure from a live bead, with a guide for the person at the rig.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use bead_compare::front_end::SAMPLE_RATE_HZ;
use bead_line::port::{Address, open_all};
use bead_line::recorder::{Recorder, RecorderObserver, RecorderOptions};
use bead_recording::file::About;
use bead_recording::frames::Frame;
use bead_wire::{Counters, Message};

use crate::cli::commands::prelude::*;

/// Time after the last strike for its frames, and for lost ones to come again.
const AFTERWARDS: Duration = Duration::from_millis(1500);

/// An act that a person is asked for, and how often.
pub(super) struct Prompt {
    /// The act, such as `drop the ball from 100 mm`.
    pub(super) act: String,
    /// Number of acts.
    pub(super) wanted: u32,
    /// Strikes less than this apart, s, belong to one act.
    pub(super) apart: f64,
}

/// Records until the acts are done, or until Ctrl-C; true if they are done.
///
/// # Errors
/// The port does not open, nothing comes, or the file cannot be written.
pub(super) fn record(port: &Address, baud: u32, target: &Target, prompt: &Prompt) -> Result<bool, Failure> {
    let note = |line: String| note!("{line}");
    let open = open_all(&[Some(port.clone())], baud, note).map_err(|why| failure!(Device, "{why}"))?;
    let (addresses, ports): (Vec<_>, Vec<_>) = open.into_iter().unzip();
    let stop = interrupt::orderly(format!(
        "the frames received so far are in {}.partial, for `bead recover`",
        target.path().display()
    ));
    let mut guide = Guide {
        prompt,
        done: 0,
        last: None,
        since: None,
        is_done: false,
        stop: Arc::clone(&stop),
    };
    note!(
        "{}, {} times; wait a second after each; Ctrl-C ends it sooner",
        prompt.act,
        prompt.wanted
    );
    let options = RecorderOptions {
        baud,
        duration: None,
        split: Duration::from_secs(86_400),
        wait: Duration::from_secs(10),
        fetch: true,
    };
    guide.ask();
    let recorder = Recorder::new(target, &addresses, options, About::default(), &mut guide, &note)?;
    let recorded = recorder.run(ports, &stop).map_err(Failure::input)?;
    let (done, is_done) = (guide.done, guide.is_done);
    if is_done {
        // The next recording of this procedure needs a cleared flag.
        stop.store(false, Ordering::Relaxed);
    }
    match recorded.counters {
        Counters { frames: 1.., .. } if done > 0 => {
            note!("recorded: {recorded}");
            Ok(is_done)
        }
        Counters { frames: 1.., .. } => bail!(
            Device,
            "no strike came: is the bead armed (bead command arm), and the force above capture.threshold?"
        ),
        _ => bail!(
            Device,
            "no frame came: is the bead powered, does --baud match, and is its PA9 wired to the receive pin?"
        ),
    }
}

struct Guide<'a> {
    prompt: &'a Prompt,
    done: u32,
    /// Sample index of the last strike.
    last: Option<u64>,
    /// When the last act was done.
    since: Option<Instant>,
    /// True once the recording ends because all acts are done.
    is_done: bool,
    stop: Arc<AtomicBool>,
}

impl Guide<'_> {
    fn ask(&self) {
        if self.done < self.prompt.wanted {
            note!("now, {} of {}", self.done + 1, self.prompt.wanted);
        }
    }
}

impl RecorderObserver for Guide<'_> {
    fn message(&mut self, frame: &Frame, _: u64, is_fetched: bool) {
        let Message::Strike(strike) = &frame.message else {
            return;
        };
        if is_fetched {
            return;
        }
        let apart = (self.prompt.apart * f64::from(SAMPLE_RATE_HZ)) as u64;
        // After a restart of the bead the index begins anew.
        let is_next = self
            .last
            .is_none_or(|last| strike.trigger_index < last || strike.trigger_index - last > apart);
        self.last = Some(strike.trigger_index);
        self.since = Some(Instant::now());
        if is_next {
            self.done += 1;
            self.ask();
        }
    }

    fn progress(&mut self, _: &Counters, _: u64) {
        let is_over = self.since.is_some_and(|since| since.elapsed() > AFTERWARDS);
        if self.done >= self.prompt.wanted && is_over {
            self.is_done = true;
            self.stop.store(true, Ordering::Relaxed);
        }
    }
}
