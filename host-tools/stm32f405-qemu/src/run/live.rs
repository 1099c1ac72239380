//! A run whose time the host advances.

use std::time::Duration;

use super::checks::{TWELVE_BITS, check_pin, check_usart};
use super::error::RunError;
use super::image::Image;
use super::log::Log;
use super::process::{QemuJob, QemuProcess, StopReport};
use super::sent;
use crate::exchange::{self, Reached, TimeStep};
use crate::given::{Inputs, Run};
use crate::machine::USARTS;
use crate::outcome::{LogLine, Outcome, Sampling, StretchWork, Uart};

/// An image whose virtual time the host advances. Between two calls it stands still for any length of time.
///
/// Equal inputs at equal virtual times give equal bytes, wherever the stops are and however long the host
/// takes. Output that was returned is not kept, so a run may last for any time. Dropping the run ends QEMU.
///
/// ```no_run
/// use stm32f405_qemu::{Inputs, Run, UartInput};
///
/// let mut live = Run::new("firmware.elf").start()?;
/// live.advance(100_000_000, Inputs::default())?;
/// let question = Inputs {
///     uart: vec![UartInput::usart1(100_500_000, *b"status\n")],
///     ..Inputs::default()
/// };
/// let passed = live.advance(200_000_000, question)?;
/// println!("{:?}", passed.usart1());
/// let outcome = live.finish()?;
/// # Ok::<(), stm32f405_qemu::RunError>(())
/// ```
pub struct Live {
    run: Run,
    image: Image,
    job: QemuJob,
    running: QemuProcess,
    log: Log,
    reached: Reached,
}

/// Output of a [`Live`] run from one stop to the next.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Passed {
    /// Virtual time of the stop, in ns: the one asked for, or up to an instruction later.
    pub now_ns: u64,
    /// Frames of the USARTs that sent anything.
    pub uarts: Vec<Uart>,
    /// The image's log.
    pub log: Vec<LogLine>,
    /// Text that the image wrote by semihosting.
    pub semihosting: String,
    /// The externally triggered scans since power-up. `None` before the first.
    pub sampling: Option<Sampling>,
    /// End of the last row of the stimulus, if the first row has begun.
    pub codes_until_ns: Option<u64>,
    /// Cost of this stretch.
    pub work: StretchWork,
    /// True if the image has ended the run. [`Live::finish`] returns the outcome.
    pub ended: bool,
}

impl Passed {
    /// The bytes from USART1.
    pub fn usart1(&self) -> &[u8] {
        let uart = self.uarts.iter().find(|uart| uart.port == USARTS[0]);
        uart.map_or(&[], |uart| &uart.bytes)
    }
}

impl Live {
    /// Starts QEMU. The image stands before its first instruction.
    pub(super) fn start(run: Run, image: Image, job: QemuJob) -> Result<Self, RunError> {
        let log = Log::new(&run.elf, &image.bytes)?;
        let (running, (reached, _)) = job.start_live(run.limit())?;
        Ok(Self {
            run,
            image,
            job,
            running,
            log,
            reached,
        })
    }

    /// Virtual time, in ns since power-up.
    pub fn now_ns(&self) -> u64 {
        self.reached.now_ns
    }

    /// Advances time to `to_ns`, with these inputs on the way. If the image ends the run before, time stops
    /// there.
    ///
    /// # Errors
    /// [`RunError::Input`]: an input or `to_ns` is in the past, or an input is for something that the part
    /// does not have. Then no time has passed. Otherwise see [`RunError`].
    pub fn advance(&mut self, to_ns: u64, inputs: Inputs) -> Result<Passed, RunError> {
        let now_ns = self.now_ns();
        if to_ns < now_ns {
            let what = format!("the image is already at {now_ns} ns; time cannot go back to {to_ns} ns");
            return Err(RunError::Input(what));
        }
        self.check(&inputs)?;
        if self.reached.ended {
            return Ok(self.passed((self.reached.clone(), Vec::new())));
        }
        let to_ns = Some(to_ns);
        let rows = inputs.codes.clone();
        self.running.say(&TimeStep { to_ns, inputs }, &rows);
        let report = self.next_stop()?;
        Ok(self.passed(report))
    }

    /// Ends the run here. Output returned before is not in the outcome.
    ///
    /// # Errors
    /// See [`RunError`].
    pub fn finish(mut self) -> Result<Outcome, RunError> {
        if !self.reached.ended {
            self.running.say(&TimeStep::default(), &[]);
            self.next_stop()?;
        }
        let ended = self.job.end(self.running.take()?, Some(self.run.timeout))?;
        let outcome = ended.outcome(&self.job.folder)?;
        self.run.complete(&self.image, &self.job, outcome)
    }

    /// Waits for QEMU's report at the next stop.
    fn next_stop(&mut self) -> Result<StopReport, RunError> {
        if let Some(report) = self.running.next_stop(self.run.limit()) {
            return Ok(report);
        }
        // QEMU has ended, or takes too long and is asked for its report now.
        self.reached.ended = true;
        let ended = self.job.end(self.running.take()?, Some(Duration::ZERO))?;
        let outcome = ended.outcome(&self.job.folder)?;
        let completed = self.run.complete(&self.image, &self.job, outcome)?;
        let why = completed.verdict().err();
        Err(RunError::Input(why.unwrap_or_else(|| "the run is over".into())))
    }

    fn passed(&mut self, (reached, bytes): StopReport) -> Passed {
        let mut rest = bytes.as_slice();
        let mut uarts = Vec::new();
        for (port, length) in USARTS.iter().zip(&reached.sent) {
            let (records, behind) = rest.split_at(rest.len().min(*length));
            rest = behind;
            uarts.push(sent::read(port, records));
        }
        uarts.retain(|uart| !uart.bytes.is_empty());
        let passed = Passed {
            now_ns: reached.now_ns,
            uarts,
            log: self.log.take(rest),
            semihosting: self.job.folder.take_text(exchange::SEMIHOSTING),
            sampling: reached.sampling,
            codes_until_ns: reached.codes_until_ns,
            work: reached.work,
            ended: reached.ended,
        };
        self.reached = reached;
        passed
    }

    /// Refuses inputs that are in the past, and those for something that the part lacks.
    fn check(&self, inputs: &Inputs) -> Result<(), RunError> {
        let refused = |text: String| Err(RunError::Input(text));
        let now_ns = self.now_ns();
        let late = |what: &str, at_ns: u64| {
            format!("{what} should come at {at_ns} ns, but the image is already at {now_ns} ns")
        };
        for input in &inputs.uart {
            check_usart(&input.port)?;
            if input.at_ns < now_ns {
                return refused(late(&format!("a byte for {}", input.port), input.at_ns));
            }
        }
        for level in &inputs.levels {
            check_pin(self.run.chip, &level.pin)?;
            if level.at_ns < now_ns {
                return refused(late(&format!("an edge on {}", level.pin), level.at_ns));
            }
        }
        let too_high = |row: &&[u16; 4]| row.iter().any(|code| *code > 4095);
        if let Some(row) = inputs.codes.iter().find(too_high) {
            return refused(format!("a row is {row:?}; {TWELVE_BITS}"));
        }
        let until = self
            .reached
            .codes_until_ns
            .filter(|until| *until < now_ns && !inputs.codes.is_empty());
        until.map_or(Ok(()), |until| refused(late("the next row of codes", until)))
    }
}
