//! Arguments of `bead calibrate`.

use bead_calibrate::points::Channel;
use bead_calibrate::quantity::{Dimension, Stated};
use bead_line::port::Address;
use bead_model::design::Day;
use clap::{Subcommand, ValueEnum};

use crate::cli::commands::calibrate::live_tones;
use crate::cli::commands::calibrate::point_files::{self, Gathered};
use crate::cli::commands::prelude::*;
use crate::cli::waveform_options::WaveformOptions;

const AFTER_HELP: &str = "\
A quantity that you state has its unit and its standard uncertainty (k = 1): 3.046g±1mg, 100mm±0.3%, 9.812±0.001. A \
number without a unit is in the SI unit; +- may replace ±. If a certificate states an expanded uncertainty with k = 2, \
give half of it.

Each procedure evaluates recordings or tables. With --port it records first, and says what to do when; with --from \
simulated it runs on a simulated bead, so that you can learn it without hardware, and prints the true values.

--update F.toml puts value, uncertainty, correlations, day and certificate into a bead's settings file, and keeps your \
comments; `bead settings write F.toml --port P` then sends them. --page writes the certificate.

Exit status 1 if a check fails, such as two heights that disagree: nothing is then put into the settings.

Examples:
  bead settings make --template bead.toml
  bead calibrate about certificate.toml
  bead calibrate drop --from simulated --ball-mass 3.046g±1mg \\
      --height 100mm±0.3mm --update bead.toml --page drop.html
  bead calibrate drop low.mcap high.mcap --ball-mass 3.046g±1mg \\
      --height 50mm±0.2mm --height 100mm±0.3mm
  bead calibrate reference shaker.csv --reference-u 0.5% --supply 3.3V±0.1% \\
      --divider 0.3224±0.1% --amplifier 2.0±0.1%
  bead calibrate front-mass tones --reference-u 0.5% --update bead.toml
  bead calibrate ring-down taps.mcap --intruder-mass 3.7g±4mg \\
      --bead-mass 51.0g±10mg --update bead.toml
  bead calibrate shaker sweep.csv --reference-u 0.5% --intruder-mass 3.7g±4mg";

/// Arguments of `bead calibrate`.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(super) procedure: ProcedureCommand,
}

#[derive(Debug, Subcommand)]
pub(super) enum ProcedureCommand {
    /// Gain of the force, from the momentum of a ball that falls on the cap.
    Drop(Box<DropArguments>),
    /// Gain of the acceleration and its flatness, against a reference accelerometer on a shaker.
    Reference(Box<ReferenceArguments>),
    /// Mass in front of the force sensor's crystal, from force over acceleration on a shaker.
    FrontMass(Box<FrontMassArguments>),
    /// Stiffness and damping of the intruder, from taps on a bead that is free or held fast.
    RingDown(Box<RingDownArguments>),
    /// Stiffness and damping of the intruder, from a sweep on a shaker.
    Shaker(Box<ShakerArguments>),
    /// Write a file of the texts of a certificate, to be edited: laboratory, owner, references.
    About(AboutArguments),
}

/// Arguments that all procedures have.
#[derive(Debug, Args)]
pub(super) struct Common {
    /// Put the results into this file of settings. Its comments and other keys stay.
    #[arg(long, value_name = "BEAD.toml")]
    pub(super) update: Option<PathBuf>,
    /// Texts of the certificate: a file that `bead calibrate about` wrote, and you edited.
    #[arg(long, value_name = "A.toml")]
    pub(super) about: Option<PathBuf>,
    /// Write the certificate as an HTML page.
    #[arg(long, value_name = "F.html")]
    pub(super) page: Option<PathBuf>,
    /// Day of the calibration [default: today, in UTC].
    #[arg(long, value_name = "DATE", value_parser = day)]
    pub(super) date: Option<Day>,
    /// Last day on which the calibration holds.
    #[arg(long, value_name = "DATE", value_parser = day)]
    pub(super) valid_until: Option<Day>,
    /// State whether the previous settings were within this tolerance: 1% or 0.01.
    #[arg(long, value_name = "PART", value_parser = part)]
    pub(super) tolerance: Option<f64>,
    /// Go on with an expired certificate of a reference. The page then says so.
    #[arg(long)]
    pub(super) doubtful: bool,
    #[command(flatten)]
    pub(super) overwrite: Overwrite,
    /// Format of the result.
    #[arg(long, value_enum, default_value_t)]
    pub(super) format: Format,
}

/// The bead that gives the data, if no recording does yet.
#[derive(Debug, Args)]
pub(super) struct SourceOptions {
    /// Record first, from a serial port or pty, tcp:HOST:PORT or unix:PATH, into the files that are named.
    #[arg(long, value_name = "P", conflicts_with = "from")]
    pub(super) port: Option<Address>,
    /// Bits a second of a serial port.
    #[arg(long, default_value_t = 2_000_000, value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) baud: u32,
    /// Run the procedure on a bead without hardware first; its recordings go to the files that are named.
    #[arg(long, value_enum)]
    pub(super) from: Option<MadeUpBead>,
    /// With --from: seed of the true values and of the noise; the same seed gives the same recording.
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub(super) seed: u64,
    /// Only the bead with this address, from recordings of several beads.
    #[arg(long, value_name = "N")]
    pub(super) bead: Option<u8>,
}

/// A bead without hardware.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum MadeUpBead {
    /// The bit-exact code of the bead on this computer.
    Simulated,
    /// The flash image in QEMU.
    Emulated,
}

/// `bead calibrate drop`.
#[derive(Debug, Args)]
pub(super) struct DropArguments {
    /// Recordings of drops, one for each height. With --port or --from they are made.
    #[arg(value_name = "F.mcap")]
    pub(super) recordings: Vec<PathBuf>,
    /// Mass of the ball.
    #[arg(long, value_name = "MASS±U", value_parser = mass)]
    pub(super) ball_mass: Stated,
    /// Height of the ball's lowest point above the cap; repeat for further recordings, or give it once for
    /// all.
    #[arg(long, value_name = "HEIGHT±U", required = true, value_parser = length)]
    pub(super) height: Vec<Stated>,
    /// Acceleration of free fall; the default holds for any place on Earth.
    #[arg(long, value_name = "G±U", default_value = "9.80±0.02", value_parser = gravity)]
    pub(super) gravity: Stated,
    /// Standard uncertainty of the axis's inclination, in each of two directions: 1deg.
    #[arg(long, value_name = "ANGLE", default_value = "1deg", value_parser = angle)]
    pub(super) tilt: f64,
    /// Time constant of the high-pass in front of the converter; 0 for none.
    #[arg(long, value_name = "TIME±U", default_value = "1.03s±20%", value_parser = high_pass)]
    pub(super) high_pass: HighPass,
    /// With --port or --from: drops from each height.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(2..=100))]
    pub(super) drops: u32,
    #[command(flatten)]
    pub(super) source: SourceOptions,
    #[command(flatten)]
    pub(super) common: Common,
}

/// `bead calibrate ring-down`.
#[derive(Debug, Args)]
pub(super) struct RingDownArguments {
    /// Recordings of taps. With --port or --from a single one is made.
    #[arg(value_name = "F.mcap")]
    pub(super) recordings: Vec<PathBuf>,
    /// Mass of the intruder [default: that of the settings, if they state its uncertainty].
    #[arg(long, value_name = "MASS±U", value_parser = mass)]
    pub(super) intruder_mass: Option<Stated>,
    /// Mass of the bead with its intruder [default: that of the settings, if they state its uncertainty].
    #[arg(long, value_name = "MASS±U", value_parser = mass, conflicts_with = "held")]
    pub(super) bead_mass: Option<Stated>,
    /// The bead is held fast, and does not swing against the intruder.
    #[arg(long)]
    pub(super) held: bool,
    /// With --port or --from: number of taps.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(2..=100))]
    pub(super) taps: u32,
    #[command(flatten)]
    pub(super) source: SourceOptions,
    #[command(flatten)]
    pub(super) common: Common,
}

/// Points of a shaker, for the procedures on one.
#[derive(Debug, Args)]
pub(super) struct PointOptions {
    /// A CSV table of frequency, reference rms and measured value, which --port makes; or a folder of steady
    /// tones: for each, scans-NAME.csv from `bead command raw`, and the reference's record,
    /// reference-NAME.csv, .wav or .parquet.
    #[arg(value_name = "TABLE.csv|FOLDER")]
    pub(super) points: PathBuf,
    /// Relative standard uncertainty of the reference accelerometer, by its certificate: 0.5%.
    #[arg(long, value_name = "PART", value_parser = part)]
    pub(super) reference_u: f64,
    /// Measure the tones first, with the bead on a serial port or pty, tcp:HOST:PORT or unix:PATH; you type
    /// the frequency and the reference's rms.
    #[arg(long, value_name = "P", conflicts_with = "from")]
    pub(super) port: Option<Address>,
    /// Bits a second of a serial port.
    #[arg(long, default_value_t = 2_000_000, value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) baud: u32,
    /// Make the folder first, with a simulated bead on a simulated shaker.
    #[arg(long, value_enum)]
    pub(super) from: Option<SimulatedShaker>,
    /// With --from: seed of the true values and of the noise.
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub(super) seed: u64,
}

impl PointOptions {
    /// The files that are read; those of --port and of a simulated shaker are made.
    pub(super) fn inputs(&self) -> Vec<&Path> {
        let is_read = self.from.is_none() && self.port.is_none();
        is_read.then_some(&*self.points).into_iter().collect()
    }

    /// Reads the points, and measures them first if there is a port. `pole`, in Hz, is that of the filter
    /// before the converter.
    pub(super) fn gather(
        &self,
        waveform: &WaveformOptions,
        overwrite: Overwrite,
        (channel, pole): (Channel, f64),
    ) -> Result<Gathered, Failure> {
        let choice = waveform.choice()?;
        if let Some(port) = &self.port {
            let target = place::target(&self.points, FileKind::Table, &[], overwrite)?;
            live_tones::record((port, self.baud), target, channel)?;
        }
        point_files::gather(&self.points, &choice, channel, pole)
    }
}

/// A shaker without hardware.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum SimulatedShaker {
    /// The bit-exact front end of the bead on this computer.
    Simulated,
}

/// `bead calibrate reference`.
#[derive(Debug, Args)]
pub(super) struct ReferenceArguments {
    #[command(flatten)]
    pub(super) points: PointOptions,
    /// Frequency at which the gain is taken, Hz; the other points show the flatness.
    #[arg(long, value_name = "HZ", default_value = "160", value_parser = positive)]
    pub(super) at: f64,
    /// For points in V: supply of the converter.
    #[arg(long, value_name = "V±U", value_parser = voltage)]
    pub(super) supply: Option<Stated>,
    /// For points in V: the divider, Rb/(Ra + Rb).
    #[arg(long, value_name = "PART±U", value_parser = number)]
    pub(super) divider: Option<Stated>,
    /// For points in V: the amplifier's gain in the high-gain channel.
    #[arg(long, value_name = "GAIN±U", value_parser = number)]
    pub(super) amplifier: Option<Stated>,
    /// For points in codes: the accelerometer is open, fixed to the reference, and not on its springs.
    #[arg(long)]
    pub(super) open: bool,
    #[command(flatten)]
    pub(super) waveform: WaveformOptions,
    #[command(flatten)]
    pub(super) common: Common,
}

/// `bead calibrate front-mass`.
#[derive(Debug, Args)]
pub(super) struct FrontMassArguments {
    #[command(flatten)]
    pub(super) points: PointOptions,
    /// Relative standard uncertainty of the force's gain [default: that of the settings].
    #[arg(long, value_name = "PART", value_parser = part)]
    pub(super) force_gain_u: Option<f64>,
    #[command(flatten)]
    pub(super) waveform: WaveformOptions,
    #[command(flatten)]
    pub(super) common: Common,
}

/// `bead calibrate shaker`.
#[derive(Debug, Args)]
pub(super) struct ShakerArguments {
    #[command(flatten)]
    pub(super) points: PointOptions,
    /// Mass of the intruder [default: that of the settings, if they state its uncertainty].
    #[arg(long, value_name = "MASS±U", value_parser = mass)]
    pub(super) intruder_mass: Option<Stated>,
    #[command(flatten)]
    pub(super) waveform: WaveformOptions,
    #[command(flatten)]
    pub(super) common: Common,
}

/// `bead calibrate about`.
#[derive(Debug, Args)]
pub(super) struct AboutArguments {
    /// The file to write.
    #[arg(value_name = "A.toml")]
    pub(super) file: PathBuf,
    #[command(flatten)]
    pub(super) overwrite: Overwrite,
}

/// A time constant, or none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct HighPass(pub(super) Option<Stated>);

fn day(text: &str) -> Result<Day, String> {
    Day::parse(text).ok_or_else(|| "give a date such as 2026-11-28".to_owned())
}

/// Parses a part, as 0.01 or 1%.
fn part(text: &str) -> Result<f64, String> {
    let (number, size) = match text.trim().strip_suffix('%') {
        Some(number) => (number, 0.01),
        None => (text, 1.0),
    };
    let part = number.trim().parse::<f64>().ok().map(|number| number * size);
    let part = part.filter(|part| *part > 0.0 && *part < 1.0);
    part.ok_or_else(|| "give a part above 0 and below 1, such as 1% or 0.01".to_owned())
}

fn mass(text: &str) -> Result<Stated, String> {
    Dimension::Mass
        .parse(text)?
        .positive()?
        .at_most(1.0, "1 kg, such as 3.046g±1mg")
}

fn voltage(text: &str) -> Result<Stated, String> {
    Dimension::Voltage.parse(text)?.positive()
}

fn number(text: &str) -> Result<Stated, String> {
    Dimension::Number.parse(text)?.positive()
}

fn length(text: &str) -> Result<Stated, String> {
    let height = Dimension::Length.parse(text)?.positive()?;
    height.at_most(10.0, "10 m, such as 100mm±0.3mm")
}

fn gravity(text: &str) -> Result<Stated, String> {
    let gravity = Dimension::Acceleration.parse(text)?;
    if (9.7..9.9).contains(&gravity.value) && gravity.u < 0.1 {
        return Ok(gravity);
    }
    Err("give 9.76 to 9.84 m/s² with its uncertainty, such as 9.812±0.001".to_owned())
}

/// Parses the standard uncertainty of an angle, rad.
fn angle(text: &str) -> Result<f64, String> {
    let wrong = || "give an angle from 0 to 10 degrees, such as 1deg".to_owned();
    let angle = Dimension::Angle
        .parse(&format!("{text}±0"))
        .map_err(|_| wrong())?;
    let most = 10.0_f64.to_radians();
    Some(angle.value)
        .filter(|angle| (0.0..=most).contains(angle))
        .ok_or_else(wrong)
}

fn high_pass(text: &str) -> Result<HighPass, String> {
    if text.trim() == "0" {
        return Ok(HighPass(None));
    }
    let tau = Dimension::Time.parse(text)?.positive()?;
    if tau.value < 0.05 {
        return Err("give 0.05 s or more, or 0 for none: a shorter one would distort the pulse".to_owned());
    }
    Ok(HighPass(Some(tau)))
}
