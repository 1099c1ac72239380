//! The flash image in QEMU, fed with what a bead of a simulated chain would sense.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use bead_model::design::{Capture, Description, LEAST_WIDTH, Supply, Uncertainty};
use bead_model::layout::BASELINE;
use bead_model::settings::{BLOCK_MAX, Settings};
use bead_model::violation::{Bound, Violation};
use bead_wire::{Counters, Message};
use hertz_chain::{Scenario, Solution};
use stm32f405_qemu::{AnalogWire, Outcome, PinInput, Reset, Run, RunEnd, Since};

use crate::error::BenchError;
use crate::faults::{self, Planned};
use crate::image;
use crate::playback::{Playback, WithOtherNoise};
use bead_compare::emulated::{EmulatorReport, InstructionsPerSample, RunTruth};
use bead_compare::front_end::{AnalogFrontEnd, Digitised, REFERENCE_VOLTS, SAMPLE_RATE_HZ};
use bead_compare::sensed::{Sensed, Timing, Truth, bead_of, surroundings_of, unlike_the_reduced_chain};
use bead_instrument::Waveform;
use bead_recording::file::{RecordingError, RecordingWriter};
use bead_recording::frames::{self, Frame};
use bead_recording::physical::refusal;

/// Flash address at which the image finds settings that a probe wrote (`memory.x`).
pub const SETTINGS_ADDRESS: u32 = 0x0800_C000;
/// Quiet time after the last strike, s: the bead sends its status every second. The noise goes on, since a
/// sensor without noise counts as broken.
const TAIL: f64 = 1.2;

/// Longest run, s of the bead's time. Its codes take 2.4 MB a second.
const LONGEST: f64 = 1200.0;

/// The pin of the sync input (`firmware/src/sync.rs`).
const SYNC_PIN: &str = "PA15";
/// The pins of the trigger line (`firmware/src/line.rs`): the board joins them.
const PULL_PIN: &str = "PB10";
const LINE_PIN: &str = "PB11";
/// Length of a sync pulse, s. The bead uses its rising edge.
const SYNC_PULSE: f64 = 1e-3;
const CRYSTAL_HZ: f64 = 8e6;

/// A finished run.
pub struct Ran {
    /// The bytes that the bead sent.
    pub stream: Vec<u8>,
    /// The frames in them.
    pub frames: Vec<Frame>,
    /// Counts of frames received, refused and lost.
    pub counters: Counters,
    /// Time at which each byte was sent, in ns of true time since power-up.
    pub sent_ns: Vec<u64>,
    /// True time of the first triggered scan, in ns since power-up.
    pub first_scan_ns: u64,
    /// Intervals in which the bead held the trigger line low, in ns of true time since power-up; empty unless
    /// [`Emulation::pulls`] is set.
    pub pulls_ns: Vec<[u64; 2]>,
    /// The resets after power-up.
    pub resets: Vec<Reset>,
    /// Failure of an image that ended before its time was over; the other fields hold its work until then.
    pub failure: Option<String>,
    /// Counts of the emulator.
    pub report: EmulatorReport,
}

impl Ran {
    /// Returns the run if it reached its end.
    ///
    /// # Errors
    /// The image failed early.
    pub fn whole(self) -> Result<Self, BenchError> {
        match &self.failure {
            Some(why) => Err(BenchError::Mute(why.clone())),
            None => Ok(self),
        }
    }

    /// Records the bytes that were sent. A run of bytes has the time of its last byte: true time since the
    /// first triggered scan, plus `zero_ns`. Bytes sent before that scan get the scan's time.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, writer: &mut RecordingWriter, zero_ns: u64) -> Result<(), RecordingError> {
        self.pieces(zero_ns)
            .try_for_each(|(at, run)| writer.write(run, Some(at), |_| {}))
    }

    /// The runs of bytes that were sent, each with its time as in [`write`](Self::write), ns.
    pub fn pieces(&self, zero_ns: u64) -> impl Iterator<Item = (u64, &[u8])> {
        let mut sent = self.sent_ns.iter();
        self.stream.split_inclusive(|byte| *byte == 0).map(move |run| {
            let at = sent.nth(run.len() - 1).copied().unwrap_or(self.first_scan_ns);
            (zero_ns + at.saturating_sub(self.first_scan_ns), run)
        })
    }
}

/// A bead, its place in the chain and its start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placed {
    /// Its place in the chain, which must have an intruder.
    pub bead: usize,
    /// Its address on the line.
    pub address: u8,
    /// Seed of its noise; `None` without noise.
    pub seed: Option<u64>,
    /// Deviation of its crystal, ppm, rounded to whole hertz of the crystal: an eighth of a ppm.
    pub clock_ppm: f64,
    /// Time of its first scan, in s on the time that all beads of the run share.
    pub began: f64,
    /// Uncertainties that its settings state, if any.
    pub uncertainty: Option<Uncertainty>,
    /// Settings from its owner. `None` derives those that fit the bead and its front end.
    pub owners: Option<Settings>,
}

impl Placed {
    /// The only bead of a run, with an exact crystal.
    pub fn alone(bead: usize, seed: Option<u64>) -> Self {
        Self {
            bead,
            address: 0,
            seed,
            clock_ppm: 0.0,
            began: 0.0,
            uncertainty: None,
            owners: None,
        }
    }
}

/// A run that is ready to start.
pub struct Emulation {
    /// The bead's settings.
    pub settings: Settings,
    /// Settings block in flash.
    pub block: Vec<u8>,
    /// The truth of the run.
    pub truth: RunTruth,
    /// Faults to inject.
    pub faults: Vec<Planned>,
    /// Least time of an instruction: 2^`shift` ns, as `Run::shift`.
    pub shift: Option<u8>,
    /// TCP port for a debugger, as `Run::gdb`.
    pub gdb: Option<u16>,
    /// Greatest errors of A and of B that the chain explains, as parts; infinite without a bound.
    pub explained: [f64; 2],
    /// Waveform at the sensors, in place of a strike of the chain.
    pub waveform: Option<Waveform>,
    /// Wires from the part's outputs to its inputs. With one or more there are no sensors: inputs without a
    /// wire are open.
    pub wires: Vec<AnalogWire>,
    /// True to record [`Ran::pulls_ns`]. Each edge of any pin then takes memory.
    pub pulls: bool,
    codes: Digitised,
    again: WithOtherNoise,
    image: PathBuf,
}

impl Emulation {
    /// Derives the settings of a bead and digitises its sensors. `timing` is on the time that all beads
    /// share.
    ///
    /// # Errors
    /// The bead has no intruder, or no settings fit it.
    pub fn place(
        scenario: &Scenario,
        solution: &Solution,
        placed: Placed,
        front_end: &AnalogFrontEnd,
        timing: Timing,
        image: &Path,
    ) -> Result<Self, BenchError> {
        let truth = Truth::of(scenario, solution, placed.bead)?;
        let settings = settings_of(solution, placed, front_end)?;
        let timing = timing.since(placed.began);
        let sensed = Sensed::new(solution, placed.bead, timing);
        let emulation = Self::feeling(sensed, settings, truth, placed, front_end, timing, image)?;
        Ok(Self {
            explained: unlike_the_reduced_chain(solution, placed.bead).explained,
            ..emulation
        })
    }

    /// Derives the settings of a bead and digitises a given waveform in place of the chain's signals.
    /// `truth` becomes the truth of the run.
    ///
    /// # Errors
    /// The bead has no intruder, no settings fit it, or the waveform is too long.
    pub fn play(
        solution: &Solution,
        placed: Placed,
        front_end: &AnalogFrontEnd,
        timing: Timing,
        image: &Path,
        waveform: Waveform,
        truth: Truth,
    ) -> Result<Self, BenchError> {
        let settings = settings_of(solution, placed, front_end)?;
        let timing = timing.since(placed.began);
        let sensed = Sensed::playing(&waveform, timing);
        let emulation = Self::feeling(sensed, settings, truth, placed, front_end, timing, image)?;
        Ok(Self {
            waveform: Some(waveform),
            ..emulation
        })
    }

    /// Digitises what the bead senses. `timing` is on the bead's own time.
    fn feeling(
        sensed: Sensed,
        settings: Settings,
        truth: Truth,
        placed: Placed,
        front_end: &AnalogFrontEnd,
        timing: Timing,
        image: &Path,
    ) -> Result<Self, BenchError> {
        let lasts = sensed.long();
        if timing.strikes > 1 && timing.interval < lasts {
            // Rounded up, so that the time in the message suffices.
            let least = (lasts * 1e4).ceil() / 1e4;
            return Err(BenchError::Unfit(format!(
                "--strikes …:{}: a strike and its ring-down take {least} s; give at least that",
                timing.interval,
            )));
        }
        let long = placed.began + timing.start(timing.strikes.saturating_sub(1)) + lasts + TAIL;
        if long > LONGEST {
            return Err(BenchError::Unfit(format!(
                "{} strikes every {} s take {long:.0} s of the bead's time, but only {LONGEST} s fit in \
                 memory; give fewer --strikes or a shorter time between them",
                timing.strikes, timing.interval
            )));
        }
        let clock_ppm = (placed.clock_ppm * 1e-6 * CRYSTAL_HZ).round() / CRYSTAL_HZ * 1e6;
        let rate = 1.0 + clock_ppm * 1e-6;
        let sensed = sensed.on_clock(rate);
        let scans = timing.scans(lasts + TAIL);
        let codes = front_end.digitise(&sensed, scans, placed.seed);
        let behind = *front_end;
        let again: WithOtherNoise = Arc::new(move |seed| behind.digitise(&sensed, scans, Some(seed)).scans);
        let truth = RunTruth {
            bead: placed.bead,
            truth,
            starts: timing.starts(rate),
            front_end: *front_end,
            seed: placed.seed,
            clock_ppm,
            began: placed.began,
            ..RunTruth::default()
        };
        Ok(Self {
            block: block_of(&settings)?,
            settings,
            truth,
            faults: Vec::new(),
            shift: None,
            gdb: None,
            explained: [0.0; 2],
            waveform: None,
            wires: Vec::new(),
            pulls: false,
            codes,
            again,
            image: image.to_owned(),
        })
    }

    /// Adds edges at the sync input, at these shared times in s, up to the end of the codes.
    pub fn sync(&mut self, edges: impl IntoIterator<Item = f64>) {
        self.sync_until(edges, self.seconds());
    }

    /// Adds edges as [`sync`](Self::sync) does, up to a time on the bead's own clock, s.
    pub fn sync_until(&mut self, edges: impl IntoIterator<Item = f64>, until: f64) {
        let own = edges.into_iter().map(|edge| edge - self.truth.began);
        let on = own.take_while(|edge| *edge < until).filter(|edge| *edge > 0.0);
        self.truth.sync_edges = on.collect();
    }

    /// Lets others hold the trigger line low in these intervals of shared time, in s, while the bead is on.
    pub fn line(&mut self, low: impl IntoIterator<Item = [f64; 2]>) {
        let (began, seconds) = (self.truth.began, self.seconds());
        let own = low.into_iter().map(|times| times.map(|time| time - began));
        let on = own.filter(|[fall, rise]| *fall > 0.0 && *rise < seconds);
        self.truth.line_low = on.collect();
    }

    /// The codes of the run, repeated endlessly.
    pub(super) fn playback(&self) -> Playback {
        if !self.wires.is_empty() {
            return Playback::new(open_inputs(), None);
        }
        let noise = self.truth.seed.map(|seed| (seed, Arc::clone(&self.again)));
        Playback::new(self.codes.scans.clone(), noise)
    }

    /// Virtual time from the first scan to the end, s.
    pub fn seconds(&self) -> f64 {
        self.codes.scans.len() as f64 / f64::from(SAMPLE_RATE_HZ)
    }

    /// The machine with the image, its settings and its stimulus: what [`run`](Self::run) executes.
    pub fn machine(&self) -> Run {
        let mut run = Run::new(&self.image);
        run.stimulus = self.codes.scans.clone();
        run.sample_period_ns = u64::from(1_000_000_000 / SAMPLE_RATE_HZ);
        run.flash = vec![(SETTINGS_ADDRESS, self.block.clone())];
        run.functions = [
            ("observer", "bead_model::observer::"),
            ("reduced_chain", "bead_model::reduced_chain::"),
            ("window", "bead_model::window::"),
            ("window", "bead_model::meter::Measurement::"),
            ("trigger", "bead_model::waves::before_rise"),
            ("framing", "bead_wire::"),
        ]
        .map(|(label, pattern)| (label.to_owned(), pattern.to_owned()))
        .to_vec();
        run.work = ["observer", "reduced_chain"].map(str::to_owned).to_vec();
        run.tail_ns = 0;
        run.shift = self.shift;
        run.gdb = self.gdb;
        run.hse_ppm = self.truth.clock_ppm;
        let ns = |seconds: f64| (seconds * 1e9).round() as u64;
        let pulse = |edge: &f64| [ns(*edge), ns(edge + SYNC_PULSE)];
        run.pin_inputs = vec![PinInput {
            pin: SYNC_PIN.to_owned(),
            since: Since::FirstScan,
            changes_ns: self.truth.sync_edges.iter().flat_map(pulse).collect(),
        }];
        if !self.truth.line_low.is_empty() {
            // The line is high from the first scan.
            let low = self.truth.line_low.iter().flatten().map(|time| ns(*time));
            run.pin_inputs.push(PinInput {
                pin: LINE_PIN.to_owned(),
                since: Since::FirstScan,
                changes_ns: std::iter::once(0).chain(low).collect(),
            });
        }
        run.record_pins = self.pulls;
        run.analog_wires.clone_from(&self.wires);
        faults::provoke(&self.faults, &self.truth.front_end, &mut run);
        // An image that keeps the core busy runs some thirty times slower here than on silicon.
        run.timeout = Duration::from_secs(60) + Duration::from_secs_f64(60.0 * self.seconds());
        run
    }

    /// Runs the image.
    ///
    /// # Errors
    /// The file is no image, QEMU fails, or the image never samples. One that fails after its first sample is
    /// no error: [`Ran::failure`] says how.
    pub fn run(&self) -> Result<Ran, BenchError> {
        let outcome = self.machine().execute()?;
        let (frames, counters) = frames::decode(&outcome.uart);
        let report = self.report(&outcome, &frames)?;
        let pulled = outcome.pins.iter().find(|pin| pin.name == PULL_PIN);
        Ok(Ran {
            failure: failure(&outcome),
            pulls_ns: pulled.map_or_else(Vec::new, |pin| pulls(&pin.changes)),
            first_scan_ns: outcome.sampling.map_or(0, |sampling| sampling.first_ns),
            stream: outcome.uart,
            frames,
            counters,
            sent_ns: outcome.uart_ns,
            resets: outcome.resets,
            report,
        })
    }

    fn report(&self, outcome: &Outcome, frames: &[Frame]) -> Result<EmulatorReport, BenchError> {
        let Some(sampling) = &outcome.sampling else {
            let why = failure(outcome).unwrap_or_else(|| {
                let last = outcome.log.last().map(ToString::to_string);
                let last = last.as_deref().unwrap_or("nothing");
                let seconds = outcome.virtual_ns as f64 * 1e-9;
                format!("it did not start to sample within {seconds:.1} s; its last log line: {last}")
            });
            return Err(BenchError::Mute(format!("{}: {why}", image::shown(&self.image))));
        };
        let counted = outcome.instructions.as_ref().ok_or_else(|| {
            BenchError::Mute("the emulator counted no instructions although it was asked to".to_owned())
        })?;
        // `None` too if the compiler left no function with the label.
        let per_sample = |label: &str, samples: u64| {
            let function = counted.functions.iter().find(|function| function.label == label);
            let function = function.filter(|function| samples > 0 && function.symbols > 0)?;
            Some(function.instructions as f64 / samples as f64)
        };
        let (mut in_windows, mut estimated) = (0, 0);
        for frame in frames {
            if let Message::Strike(strike) = &frame.message {
                in_windows += u64::from(strike.samples);
                // An image of another firmware may send any length.
                estimated += u64::from(strike.samples.saturating_sub(BASELINE));
            }
        }
        let registers = outcome.unknown_registers.iter();
        Ok(EmulatorReport {
            image: image::file_name(&self.image),
            qemu: stm32f405_qemu::qemu_version(None).ok(),
            instructions_per_sample: InstructionsPerSample {
                observer: per_sample("observer", estimated),
                reduced_chain: per_sample("reduced_chain", estimated),
                window: per_sample("window", in_windows),
                framing: per_sample("framing", in_windows),
                trigger: per_sample("trigger", sampling.scans),
                total: counted.working.map(|blocks| blocks.instructions_per_scan()),
                worst_block: counted.worst_block.map(|block| block.instructions_per_scan()),
                idle: counted.idle.map(|blocks| blocks.instructions_per_scan()),
                run: counted.total as f64 / sampling.scans.max(1) as f64,
            },
            instructions_available: 1e9 / f64::from(outcome.instruction_ns) / f64::from(SAMPLE_RATE_HZ),
            overruns: outcome.overruns,
            resets: outcome.resets.len(),
            scans: sampling.scans,
            saturated: self.codes.saturated,
            unknown_registers: registers.map(|register| register.name.clone()).collect(),
            unmodelled: outcome.unmodelled.clone(),
            virtual_seconds: outcome.virtual_ns as f64 * 1e-9,
            log: outcome.log.iter().map(ToString::to_string).collect(),
        })
    }
}

/// The block of settings in flash.
pub(crate) fn block_of(settings: &Settings) -> Result<Vec<u8>, BenchError> {
    let mut block = [0; BLOCK_MAX];
    let length = settings.encode(&mut block);
    let length = length.map_err(|error| BenchError::unfit("cannot encode the settings", error))?;
    Ok(block[..length].to_vec())
}

/// Codes of open inputs for one period of the mains: 50 Hz hum and some noise.
fn open_inputs() -> Vec<[u16; 4]> {
    const PERIOD: u32 = SAMPLE_RATE_HZ / 50;
    let row = |n: u32| {
        let phase = std::f64::consts::TAU * f64::from(n) / f64::from(PERIOD);
        [900.0, 1100.0, 1300.0, 1000.0].map(|level| {
            let noise = f64::from(n.wrapping_mul(2_654_435_769) >> 30) - 1.5;
            (level + 60.0 * libm::sin(phase) + noise).round() as u16
        })
    };
    (0..PERIOD).map(row).collect()
}

/// Failure of an image that ended early. A fault followed by a reset is no failure.
fn failure(outcome: &Outcome) -> Option<String> {
    // Test firmware ends at a breakpoint; a bead's firmware never does.
    let RunEnd::Breakpoint(place) = &outcome.end else {
        return outcome.verdict().err();
    };
    let seconds = outcome.virtual_ns as f64 * 1e-9;
    Some(format!(
        "the image stopped at a breakpoint of its own, at {place}, at {seconds:.6} s"
    ))
}

/// Intervals in which a pin was low, ns. The pin is in use from its first rise; a last fall without a rise
/// is left out.
fn pulls(changes: &[(u64, bool)]) -> Vec<[u64; 2]> {
    let pairs = changes.windows(2).skip_while(|pair| !pair[0].1);
    let low = pairs.filter(|pair| !pair[0].1 && pair[1].1);
    low.map(|pair| [pair[0].0, pair[1].0]).collect()
}

/// The settings of a bead behind a front end: its owner's, or those that fit both.
///
/// # Errors
/// The bead has no intruder, or no settings fit it.
pub fn settings_of(
    solution: &Solution,
    placed: Placed,
    front_end: &AnalogFrontEnd,
) -> Result<Settings, BenchError> {
    let bead = placed.bead;
    let physics = bead_of(solution, bead)?;
    if let Some(owners) = placed.owners {
        return Ok(owners);
    }
    let exponent = solution.model().contact(bead + 1).law().exponent;
    if exponent != 1.5 {
        return Err(BenchError::Unfit(format!(
            "--bead {bead}: the contact behind it is F = κ δ^{exponent}, but a bead assumes Hertz's exponent \
             3/2; leave out [contact], or give settings of your own with --settings"
        )));
    }
    let front = front_end.calibration();
    let around = surroundings_of(solution, bead);
    let capture = Capture::of(&physics, &front);
    let description = Description {
        address: placed.address,
        supply: Some(Supply {
            voltage: REFERENCE_VOLTS,
        }),
        uncertainty: placed.uncertainty,
        ..Description::new(&physics, &around, &front, &capture)
    };
    Settings::new(&description).map_err(|violation| match violation {
        Violation {
            bound: Bound::Width { samples },
            ..
        } => {
            let diameter = 2e3 * solution.model().radius(bead);
            BenchError::Unfit(format!(
                "the sphere of bead {bead}, {diameter:.1} mm, is too small for {} kHz: this material needs at \
                 least {:.1} mm, since a wave of 1 m/s is {samples:.2} samples wide, and at least \
                 {LEAST_WIDTH} are needed to measure it",
                SAMPLE_RATE_HZ / 1000,
                diameter * LEAST_WIDTH / samples
            ))
        }
        violation => BenchError::unfit(
            &format!("no settings fit bead {bead} and this front end"),
            refusal(&description, violation),
        ),
    })
}

#[cfg(test)]
mod tests {
    use stm32f405_qemu::CodeAddress;

    use super::*;

    #[test]
    fn an_image_that_ends_before_its_time_has_failed() {
        let mut outcome = Outcome::default();
        assert_eq!(failure(&outcome), None);
        outcome.virtual_ns = 1_000_000;
        outcome.end = RunEnd::Panicked;
        assert!(failure(&outcome).unwrap().contains("the image panicked"));
        outcome.end = RunEnd::Breakpoint(CodeAddress {
            address: 0x0800_018a,
            function: Some("dead".to_owned()),
        });
        let expected = "a breakpoint of its own, at 0x0800018a (dead), at 0.001000 s";
        assert!(failure(&outcome).unwrap().ends_with(expected));
    }
}
