//! Arguments of `bead compare`.

use crate::cli::commands::prelude::*;
use crate::cli::waveform_options::WaveformOptions;
use bead_console::beads::BeadNumbers;

const AFTER_HELP: &str = "\
Goals: A within 0.2 % of the full chain, B within 0.5 %, replay identical, no frame lost, no overrun. \
Several strikes are judged together: the mean by these goals, the scatter of A by 0.5 % and of B by 1 %, \
each with its uncertainty. A single strike has the uncertainty of its own noise. A goal is missed if the deviation \
exceeds it by more than the expanded uncertainty of the deviation (JCGM 106, guarded rejection, 95 %). An \
emulated run must also leave a quarter of the core free while a strike is measured. Exit status 1 if a goal is \
missed.

The striker's velocity is rarely known to 0.1 %, and the energy goes with its square. --velocity fit finds \
the velocity from nothing but the recorded force, prints it with its uncertainty, and judges A and B against the \
chain at that velocity.

A wave that comes before the striker hits again, as beads that parted meet again, is an echo: it is replayed, \
but not compared with the chain. In a recording of real beads, an echo is a wave within the simulated time of the \
strike before it: the scenario's duration and 6 ms.

In a recording of several beads (`bead emulate --bead 7-16`, `bead record --port all`) all are compared with \
one simulation: each bead by the goals above; the arrival of the wave at each, on the time of their sync edges, and \
its speed; the energy E(n) that n intruders leave, and T, the part that each lets pass, by the beads' own A and B. \
docs/row.md says how to read it.

With --reference a strike is compared with the record of another instrument instead of the chain: the two are \
aligned, and correlation, gain, arrival, peak, energy and residual are printed \
(docs/waveforms.md). Exit status 1 if replay differs.

Examples:
  bead compare run/bead-8.mcap --scenario docs/scenarios/paper-strike.toml
  bead compare run/bead-8.mcap --velocity fit
  bead compare run/bead-8.mcap --report report.html
  bead compare run/bead-8.mcap --figures figures
  bead compare run/chain.mcap --report row.html
  bead compare run/chain.mcap --bead 9
  bead compare run/bead-8.mcap --reference scope.csv --read force=CH1:8.9N \\
      --report report.html";

#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// The recording.
    pub(super) recording: PathBuf,
    /// The scenario that was recorded [default: the one that the recording carries, if it was emulated].
    #[arg(long, value_name = "S.toml")]
    pub(super) scenario: Option<PathBuf>,
    /// The bead that sensed [default: as the recording says, else the only one with an intruder; of a
    /// recording of several, all of them]. Several side by side: 7-9, 7,9 or all.
    #[arg(long, value_name = "N")]
    pub(super) bead: Option<BeadNumbers>,
    /// Velocity of the striker in m/s, in place of the scenario's; `fit`: the one that gives the recorded
    /// forces.
    #[arg(long, value_name = "V|fit", value_parser = velocity)]
    pub(super) velocity: Option<Velocity>,
    /// Compare a strike with the record of another instrument: a text table (CSV), WAV, Parquet, or a
    /// recording.
    #[arg(long, value_name = "F", conflicts_with_all = ["scenario", "velocity", "figures"])]
    pub(super) reference: Option<PathBuf>,
    /// With --reference: which strike of the recording, counted from 0 [default: the first that is whole].
    #[arg(long, value_name = "N", requires = "reference")]
    pub(super) strike: Option<usize>,
    /// Write a report: one self-contained HTML file.
    #[arg(long, value_name = "F.html")]
    pub(super) report: Option<PathBuf>,
    /// Write the figures as SVG files into this directory, which is made if it is missing.
    #[arg(long, value_name = "DIR")]
    pub(super) figures: Option<PathBuf>,
    #[command(flatten)]
    pub(super) overwrite: Overwrite,
    /// Format of the result.
    #[arg(long, value_enum, default_value_t)]
    pub(super) format: Format,
    #[command(flatten)]
    pub(super) columns: WaveformOptions,
}

impl Arguments {
    pub(super) fn inputs(&self) -> Vec<&Path> {
        let files = [
            Some(&self.recording),
            self.scenario.as_ref(),
            self.reference.as_ref(),
        ];
        files.into_iter().flatten().map(PathBuf::as_path).collect()
    }
}

/// The striker's velocity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Velocity {
    /// The one that gives the recorded forces.
    Fit,
    /// In m/s.
    Given(f64),
}

/// Parses a velocity, m/s, or `fit`.
fn velocity(text: &str) -> Result<Velocity, String> {
    match text {
        "fit" => Ok(Velocity::Fit),
        _ => positive(text)
            .map(Velocity::Given)
            .map_err(|_| "give a velocity above 0, in m/s, or fit".to_owned()),
    }
}
