//! Arguments of `bead analyse`.

use clap::{Subcommand, ValueEnum};

use crate::cli::chosen::StrikeChoice;
use crate::cli::commands::prelude::*;
use bead_spectra::strike::Sensors;

const AFTER_HELP: &str = "\
The signals are those of `bead export`: SI units, both gains merged, filter and delay removed, relative to the \
quiet before the trigger. For several strikes the table shows mean, scatter and envelope; --out has each strike. \
Strikes that are railed or cut, or that miss samples, are left out and named.

Examples:
  bead analyse srs run/bead-8.mcap
  bead analyse srs monday/*.mcap --response pseudo-velocity --picture srs.svg
  bead analyse srs run/bead-8.mcap --q 50 --from 500 --to 5000 --per-octave 6
  bead analyse psd run/bead-8.mcap --of force --segment 512
  bead analyse fft run/bead-8.mcap --unit g --format json
  bead analyse transfer monday/*.mcap --out transfer.parquet";

/// Arguments of `bead analyse`.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(super) spectrum: SpectrumCommand,
}

#[derive(Debug, Subcommand)]
pub(super) enum SpectrumCommand {
    /// Shock response spectrum of the acceleration (ISO 18431-4).
    Srs(ShockArguments),
    /// Power spectral density by Welch's method, with the windows of ISO 18431-2.
    Psd(DensityArguments),
    /// Fourier transform of the window.
    Fft(FourierArguments),
    /// Transfer from force to acceleration, with coherence over the strikes.
    Transfer(TransferArguments),
}

/// Arguments that all spectra have.
#[derive(Debug, Args)]
pub(super) struct Common {
    #[command(flatten)]
    pub(super) strikes: StrikeChoice,
    /// Lowest frequency, Hz [default: that of one period in the window].
    #[arg(long, value_name = "HZ", value_parser = positive)]
    pub(super) from: Option<f64>,
    /// Highest frequency, Hz [default: a tenth of the sampling rate].
    #[arg(long, value_name = "HZ", value_parser = positive)]
    pub(super) to: Option<f64>,
    /// Also take strikes that are railed, cut, or too short for --from.
    #[arg(long)]
    pub(super) doubtful: bool,
    /// Take the uncertainties that these settings state in place of those in the recording.
    #[arg(long, value_name = "F.toml|F.settings")]
    pub(super) uncertainty: Option<PathBuf>,
    /// Unit of accelerations in table, JSON and picture.
    #[arg(long, value_enum, default_value_t)]
    pub(super) unit: AccelerationUnit,
    /// Write the spectrum of each strike as a table in SI units: Parquet, or CSV if the name ends in .csv.
    #[arg(long, value_name = "F.parquet|F.csv")]
    pub(super) out: Option<PathBuf>,
    /// Draw the spectrum.
    #[arg(long, value_name = "F.svg")]
    pub(super) picture: Option<PathBuf>,
    #[command(flatten)]
    pub(super) overwrite: Overwrite,
    /// Format of the result.
    #[arg(long, value_enum, default_value_t)]
    pub(super) format: Format,
}

/// Unit of an acceleration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub(super) enum AccelerationUnit {
    /// m/s².
    #[default]
    Si,
    /// Standard gravity, 9.80665 m/s².
    G,
}

/// `bead analyse srs`.
#[derive(Debug, Args)]
pub(super) struct ShockArguments {
    #[command(flatten)]
    pub(super) common: Common,
    /// The response that is shown; --out has all.
    #[arg(long, value_enum, default_value_t)]
    pub(super) response: ShownResponse,
    /// Quality of the oscillators, 1/(2ζ): 10 is 5 % of critical damping.
    #[arg(long, value_name = "Q", default_value = "10", value_parser = quality)]
    pub(super) q: f64,
    /// Natural frequencies per octave; one of them is 1 kHz.
    #[arg(long, value_name = "N", default_value = "12", value_parser = clap::value_parser!(u32).range(1..=96))]
    pub(super) per_octave: u32,
}

/// A response of an oscillator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub(super) enum ShownResponse {
    /// Of the mass against the ground.
    #[default]
    AbsoluteAcceleration,
    /// ω times the relative displacement, m/s.
    PseudoVelocity,
    /// Of the mass against its base, m.
    RelativeDisplacement,
}

/// The signal of a spectrum.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub(super) enum Signal {
    /// Of the intruder.
    #[default]
    Acceleration,
    /// At the incoming contact.
    Force,
}

impl From<Signal> for Sensors {
    fn from(signal: Signal) -> Self {
        match signal {
            Signal::Acceleration => Self::Acceleration,
            Signal::Force => Self::Force,
        }
    }
}

/// `bead analyse psd`.
#[derive(Debug, Args)]
pub(super) struct DensityArguments {
    #[command(flatten)]
    pub(super) common: Common,
    /// The signal.
    #[arg(long, value_enum, default_value_t)]
    pub(super) of: Signal,
    /// Samples of a segment; segments overlap by half.
    #[arg(long, value_name = "N", default_value = "256", value_parser = clap::value_parser!(u32).range(8..=65536))]
    pub(super) segment: u32,
    /// Window over each segment.
    #[arg(long, value_enum, default_value_t)]
    pub(super) window: SegmentWindow,
}

/// A window of ISO 18431-2.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub(super) enum SegmentWindow {
    /// sin², for noise.
    #[default]
    Hann,
    /// For the amplitude of a tone.
    FlatTop,
    /// No window.
    Rectangular,
}

/// `bead analyse fft`.
#[derive(Debug, Args)]
pub(super) struct FourierArguments {
    #[command(flatten)]
    pub(super) common: Common,
    /// The signal.
    #[arg(long, value_enum, default_value_t)]
    pub(super) of: Signal,
}

/// `bead analyse transfer`.
#[derive(Debug, Args)]
pub(super) struct TransferArguments {
    #[command(flatten)]
    pub(super) common: Common,
}

/// Parses the quality of an oscillator.
fn quality(text: &str) -> Result<f64, String> {
    let number = positive(text)
        .ok()
        .filter(|number| *number > 0.5 && *number <= 1e6);
    number.ok_or_else(|| "give a number above 0.5, such as 10 (5 % of critical damping)".to_owned())
}
