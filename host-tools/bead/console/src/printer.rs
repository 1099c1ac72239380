//! Lines for standard output, and a spinner, that must not hold up the work.

use std::sync::mpsc::{self, SyncSender, TrySendError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use crate::failure::Failure;
use crate::output;

/// Lines that wait while the reader of standard output pauses. Further lines are left out.
const WAITING: usize = 4096;
/// Time that a paused reader gets at the end.
const PATIENCE: Duration = Duration::from_secs(1);
/// Least time between two changes of the spinner's text.
const STATUS_EVERY: Duration = Duration::from_millis(100);

#[derive(Debug)]
enum Said {
    Line(String),
    Status(String),
}

/// Prints lines on a separate thread. Only that thread writes to the terminal, since a paused terminal
/// blocks its writer.
#[derive(Debug)]
pub struct Printer {
    said: SyncSender<Said>,
    thread: JoinHandle<Result<(), Failure>>,
    left_out: u64,
    status: Option<Instant>,
}

impl Printer {
    /// Starts the thread, with a spinner that names `step`.
    pub fn new(step: String) -> Self {
        let (said, receiver) = mpsc::sync_channel(WAITING);
        let thread = thread::spawn(move || {
            let spinner = output::spinner(step);
            let printed = receiver.iter().try_for_each(|said| match said {
                Said::Line(line) => spinner.suspend(|| output::print_line(&line)),
                Said::Status(status) => {
                    spinner.set_message(status);
                    Ok(())
                }
            });
            spinner.finish_and_clear();
            printed
        });
        Self {
            said,
            thread,
            left_out: 0,
            status: None,
        }
    }

    /// Prints a line when the reader is ready for it.
    pub fn line(&mut self, line: String) {
        // If printing has failed, `finish` returns the reason.
        if let Err(TrySendError::Full(_)) = self.said.try_send(Said::Line(line)) {
            self.left_out += 1;
        }
    }

    /// Changes the spinner's text, ten times a second at most.
    pub fn status(&mut self, status: impl FnOnce() -> String) {
        if self.status.is_none_or(|last| last.elapsed() >= STATUS_EVERY) {
            self.status = Some(Instant::now());
            // A text that is left out is soon followed by the next.
            let _ = self.said.try_send(Said::Status(status()));
        }
    }

    /// Waits for the remaining lines to be printed, if the reader continues.
    ///
    /// # Errors
    /// Standard output is closed or full.
    ///
    /// # Panics
    /// Printing panicked.
    pub fn finish(self) -> Result<(), Failure> {
        drop(self.said);
        let deadline = Instant::now() + PATIENCE;
        while !self.thread.is_finished() && Instant::now() < deadline {
            thread::sleep(Duration::from_millis(5));
        }
        let paused = !self.thread.is_finished();
        if self.left_out > 0 || paused {
            note!(
                "the reader of standard output was too slow: lines are missing there, but the recording has them all"
            );
        }
        if paused {
            // The thread ends with the program.
            return Ok(());
        }
        self.thread.join().expect("printing does not panic")
    }
}
