//! Arguments of `bead identify`.

use clap::ValueEnum;

use crate::cli::chosen::StrikeChoice;
use crate::cli::commands::prelude::*;
use bead_console::beads::one_bead;
use bead_identify::quantity::{QUANTITIES, Quantity};
use bead_identify::ring_down::Mounting;

const AFTER_HELP: &str = "\
ring-down, the default: the ringing of the intruder after each tap, once nothing touches the bead, gives k and c. \
Hang the bead on threads or lay it on foam, out of the chain, and tap its cap (docs/identify.md).

pairs: the acceleration of such a tap follows from the force, which gives the ratio of the gains too.

chain, with --scenario: the whole chain is simulated, from the striker to the bead, and k, c, Young's modulus and \
tau are fitted to the samples of force and acceleration, together with the speed and time of each strike.

Quantities that the data cannot tell apart are held at their start values, and the result says so. Standard errors \
come from the noise before each trigger; u includes the uncertainties of held quantities, as far as [uncertainty] of \
the settings states them.

Examples:
  bead identify taps.mcap
  bead identify monday.mcap tuesday.mcap --picture fit.svg --format json
  bead identify taps.mcap --method pairs
  bead identify taps.mcap --out-settings bead.toml
  bead settings make bead.toml
  bead identify run/bead-8.mcap --scenario docs/scenarios/paper-strike.toml
  bead identify run/bead-8.mcap --scenario own.toml \\
      --fit k,c,young,tau,acceleration-gain";

/// Arguments of `bead identify`.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    #[command(flatten)]
    pub(super) strikes: StrikeChoice,
    /// The chain in which the bead was struck. The fit starts from its values.
    #[arg(long, value_name = "S.toml", conflicts_with_all = ["mounting", "from"])]
    pub(super) scenario: Option<PathBuf>,
    /// Place of the bead in that chain [default: its address if that place has an intruder, else the only
    /// place with one].
    #[arg(long, value_name = "N", requires = "scenario", value_parser = one_bead)]
    pub(super) place: Option<usize>,
    /// The data and their model [default: chain with --scenario, else ring-down].
    #[arg(long, value_enum)]
    pub(super) method: Option<Method>,
    /// Support of the bead while it rings.
    #[arg(long, value_enum, default_value_t)]
    pub(super) mounting: MountingOption,
    /// Quantities to fit, by letter or name: k, c, m, M, Y, tau, gF, ga, or stiffness, damping,
    /// intruder-mass, bead-mass, young, relaxation, force-gain, acceleration-gain [default: k,c; pairs
    /// k,c,ga; chain k,c,Y,tau].
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = quantity)]
    pub(super) fit: Vec<Quantity>,
    /// Begin the fit with these settings in place of those in the recording.
    #[arg(long, value_name = "F.toml|F.settings")]
    pub(super) from: Option<PathBuf>,
    /// Take the uncertainties of the held masses and gains from these settings.
    #[arg(long, value_name = "F.toml|F.settings")]
    pub(super) uncertainty: Option<PathBuf>,
    /// Also take strikes that are railed, cut, or met by another wave.
    #[arg(long)]
    pub(super) doubtful: bool,
    /// Write the settings with the identified values and their uncertainties.
    #[arg(long, value_name = "F.toml")]
    pub(super) out_settings: Option<PathBuf>,
    /// Write the samples of all strikes, measured and computed, as a table: Parquet, or CSV if the name
    /// ends in .csv.
    #[arg(long, value_name = "F.parquet|F.csv")]
    pub(super) out: Option<PathBuf>,
    /// Draw the loudest strike before and after the fit.
    #[arg(long, value_name = "F.svg")]
    pub(super) picture: Option<PathBuf>,
    #[command(flatten)]
    pub(super) overwrite: Overwrite,
    /// Format of the result.
    #[arg(long, value_enum, default_value_t)]
    pub(super) format: Format,
}

/// The data of a fit, and their model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Method {
    /// Ringing after taps.
    RingDown,
    /// Force and acceleration of taps at a free bead.
    Pairs,
    /// Strikes of a chain.
    Chain,
}

impl From<Method> for bead_identify::method::Method {
    fn from(method: Method) -> Self {
        match method {
            Method::RingDown => Self::RingDown,
            Method::Pairs => Self::Pairs,
            Method::Chain => Self::Chain,
        }
    }
}

impl From<MountingOption> for Mounting {
    fn from(option: MountingOption) -> Self {
        match option {
            MountingOption::Free => Self::Free,
            MountingOption::Held => Self::Held,
        }
    }
}

impl Arguments {
    /// The method that is asked for.
    pub(super) fn chosen(&self) -> Method {
        let usual = if self.scenario.is_some() {
            Method::Chain
        } else {
            Method::RingDown
        };
        self.method.unwrap_or(usual)
    }
}

/// Support of a bead.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub(super) enum MountingOption {
    /// Hung on threads, or on foam.
    #[default]
    Free,
    /// Clamped to something heavy.
    Held,
}

/// Parses the name of a quantity.
fn quantity(text: &str) -> Result<Quantity, String> {
    Quantity::named(text).ok_or_else(|| {
        let names: Vec<_> = QUANTITIES.iter().map(|one| one.symbol()).collect();
        format!("give one or more of {}", names.join(", "))
    })
}
