//! The command line.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use clap::Parser;
use regex::Regex;
use stm32f405_qemu::{Chip, Run, RunError, Scenario};

const ABOUT: &str = "Runs the firmware image of an STM32F4 in QEMU, shows its log and its UARTs while it runs, and \
                     reports the result by the exit status.";

const MORE: &str = "\
Examples:
  stm32-emu firmware.elf                                two seconds of the image's time
  stm32-emu --until 'Test OK' --for 10s firmware.elf    ends at that line; fails if it does not come
  stm32-emu --uart USART2=stdout firmware.elf           with the text of a UART
  stm32-emu --scenario button.toml firmware.elf         with levels, bytes and waveforms from a file
  stm32-emu --uart USART1=pty firmware.elf              a terminal program can talk to it
  stm32-emu --strict --junit report.xml firmware.elf    for CI
  stm32-emu --chip STM32F411CE firmware.elf             on another part of the STM32F4

As a runner of cargo, in .cargo/config.toml:
  [target.thumbv7em-none-eabihf]
  runner = \"stm32-emu --chip STM32F405RG\"
An image made with embedded-test is run case by case, each from a reset; it takes the arguments of `cargo test`:
  cargo test -- --list
  cargo test -- --exact tests::it_adds

Exit status:
  0  passed: used up its time, stopped at a breakpoint, exited with 0, or printed what --until waits for
  1  panicked, exited with another status, or a test case failed
  2  wrong arguments
  3  no run: the image is missing or for another part, or there is no QEMU
  4  a fault or a lockup
  5  hung: an endless loop, a register without a model, or --timeout
  6  accessed a register without a model, wrote to one without a clock, or moved a pin that the part
  lacks, under --strict
  7  did not print what --until waits for
  141  nobody reads the output any more";

/// Command-line arguments.
#[derive(Debug, Clone, Parser)]
#[command(name = "stm32-emu", version, about = ABOUT, after_help = MORE, max_term_width = 100)]
pub(crate) struct Arguments {
    /// Part, from the lines F401, F405, F407, F411, F415, F427, F429 and F446. Letters for package and
    /// temperature may follow.
    #[arg(long, value_name = "NAME", default_value = "STM32F405RG")]
    pub(crate) chip: Chip,
    /// Length of the run in the image's time: 2s, 500ms, or a number of seconds. Without a scenario, an image
    /// that samples gets a stimulus and runs to its end instead.
    #[arg(long = "for", alias = "seconds", value_name = "TIME", default_value = "2s", value_parser = duration)]
    pub(crate) time: Duration,
    /// Limit of real time.
    #[arg(long, value_name = "TIME", default_value = "120s", value_parser = duration)]
    pub(crate) timeout: Duration,
    /// End the run at a line of the log, of a UART or of semihosting in which this regular expression is
    /// found; fail if there is none.
    #[arg(long, value_name = "PATTERN")]
    pub(crate) until: Option<Regex>,
    /// Give the part the inputs of a scenario: pins, buttons, UARTs, waveforms, wires, faults. The run then
    /// lasts for the whole of --for.
    #[arg(long, value_name = "FILE", value_parser = scenario)]
    pub(crate) scenario: Option<Arc<Scenario>>,
    /// Fail if the image accesses a register that has no model, writes to one whose clock is off, or moves a
    /// pin that the part lacks.
    #[arg(long)]
    pub(crate) strict: bool,
    /// Connect a UART to the output, a pseudo-terminal, a TCP port that one program may connect to, or a
    /// file: USART2=stdout, =pty, =tcp:127.0.0.1:4000, =file:PATH. Can be given for each UART.
    #[arg(long, value_name = "UART=WHERE", value_parser = super::uart::way)]
    pub(crate) uart: Vec<super::uart::Way>,
    /// Let the image call the host: only for an image that you trust. The words after ELF are its command
    /// line.
    #[arg(long)]
    pub(crate) semihosting: bool,
    /// Write the levels of output pins over time, for a waveform viewer such as GTKWave.
    #[arg(long, value_name = "FILE")]
    pub(crate) vcd: Option<PathBuf>,
    /// Write the result of the run as JSON.
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
    /// Write the result of the run as a JUnit report.
    #[arg(long, value_name = "FILE")]
    pub(crate) junit: Option<PathBuf>,
    /// Wait for a debugger at this TCP port of this computer.
    #[arg(long, value_name = "PORT")]
    gdb: Option<u16>,
    /// The image.
    pub(crate) elf: PathBuf,
    /// Words for the image, or for its test cases.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    pub(crate) words: Vec<String>,
}

impl Arguments {
    /// Refuses words after the image if nothing takes them.
    ///
    /// # Errors
    /// [`RunError::Input`].
    pub(crate) fn check_words(&self) -> Result<(), RunError> {
        match self.words.first() {
            Some(word) if !self.semihosting => {
                let what = format!("the word {word:?} after the image has no meaning here");
                let next = "put options before the image, or add --semihosting to pass words to it";
                Err(RunError::Input(format!("{what}; {next}")))
            }
            _ => Ok(()),
        }
    }

    /// Refuses an output that is an input, which would be emptied, or another output, or a path that cannot
    /// be a file: a run of minutes should not end without its report.
    pub(crate) fn check_outputs(&self) -> Result<(), RunError> {
        let named = self.uart.iter().filter_map(super::uart::Way::file);
        let outputs: Vec<_> = named
            .chain(&self.vcd)
            .chain(&self.json)
            .chain(&self.junit)
            .collect();
        if let Some(twice) = (1..outputs.len()).find(|n| outputs[..*n].contains(&outputs[*n])) {
            let what = format!("{} is given for two outputs", outputs[twice].display());
            return Err(RunError::Input(what + "; give each a name of its own"));
        }
        if let Some(folder) = outputs.iter().find(|out| out.is_dir()) {
            let what = format!("{} is a folder; give the name of a file in it", folder.display());
            return Err(RunError::Input(what));
        }
        let has_folder = |out: &Path| match out.parent() {
            Some(folder) => folder.as_os_str().is_empty() || folder.is_dir(),
            None => true,
        };
        if let Some(lost) = outputs.iter().find(|out| !has_folder(out)) {
            let what = format!("the folder of {} does not exist; make it first", lost.display());
            return Err(RunError::Input(what));
        }
        let scenario = self.scenario.iter().flat_map(|scenario| scenario.paths());
        let inputs = std::iter::once(&self.elf).chain(scenario);
        let inputs: Vec<_> = inputs.filter_map(|input| input.canonicalize().ok()).collect();
        let is_input = |out: &&PathBuf| out.canonicalize().is_ok_and(|out| inputs.contains(&out));
        match outputs.into_iter().find(is_input) {
            Some(out) => Err(RunError::Input(format!(
                "{} is an input of this run, the image or its scenario; give the output another name",
                out.display()
            ))),
            None => Ok(()),
        }
    }

    /// These arguments with another time of the image.
    pub(crate) fn with_time(&self, time: Duration) -> Self {
        Self { time, ..self.clone() }
    }

    /// The run that the arguments describe.
    pub(crate) fn run(&self) -> Run {
        let mut run = Run::new(&self.elf);
        run.chip = self.chip;
        run.timeout = self.timeout;
        run.semihosting = self.semihosting;
        run.semihosting_arguments.clone_from(&self.words);
        run.record_pins = self.vcd.is_some();
        run.gdb = self.gdb;
        if let Some(scenario) = &self.scenario {
            scenario.apply(&mut run);
        } else {
            // A sine on both inputs, for images that sample.
            run.stimulus = (0..5000)
                .map(|i| {
                    let phase = f64::from(i) * std::f64::consts::TAU / 100.0;
                    [phase.sin(), phase.cos(), 0.0, 0.0].map(|x| (2048.0 + 100.0 * x) as u16)
                })
                .collect();
        }
        // A byte received by a UART may end a loop.
        run.stop_when_hung = !self.uart.iter().any(super::uart::Way::has_input);
        run
    }
}

fn scenario(path: &str) -> Result<Arc<Scenario>, String> {
    Scenario::read(path)
        .map(Arc::new)
        .map_err(|error| error.to_string())
}

/// A time: `2s`, `500ms`, `20us`, or seconds.
fn duration(text: &str) -> Result<Duration, String> {
    let units = [("ms", 1e-3), ("us", 1e-6), ("s", 1.0)];
    let unit = units
        .iter()
        .find_map(|(unit, s)| Some((text.strip_suffix(unit)?, *s)));
    let (number, seconds) = unit.unwrap_or((text, 1.0));
    let number: Option<f64> = number.trim().parse().ok();
    let time = number.and_then(|number| Duration::try_from_secs_f64(number * seconds).ok());
    // A century is enough, and fits into 64 bits of ns.
    let time = time.filter(|time| time.as_secs() < 3_000_000_000);
    time.ok_or_else(|| "give a time such as 2s, 500ms or 0.5".to_owned())
}
