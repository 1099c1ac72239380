//! Arguments of `bead trend`.

use clap::ValueEnum;

use crate::cli::commands::prelude::*;
use crate::cli::folder_options::FolderOptions;
use bead_logbook::control::BASE_LEAST;
use bead_logbook::quantity::Quantity;
use bead_logbook::trend::PointBy;

const AFTER_HELP: &str = "\
A point is the mean over the strikes of a recording, or as --by says. Its u is the mean of the strikes' u, since \
nearly all of it comes from the calibration. The limits are those of Shewhart's chart of individual values (ISO 7870-2): \
the mean of the base ± 3 s, with s from the mean moving range. They follow only from the scatter of the points, so they \
show changes that are much smaller than u. The base is all points, or with --base N the first N, to which later points \
are compared.

Each point beyond its limits is named in a line. The exit status is then 1 only with --check.

Energies depend on the strike: a trend of A and B means something only if the strikes are alike. A/B, the frequency and \
the gains depend only on the bead.

Examples:
  bead trend archive --picture trend.svg
  bead trend archive --bead 8 --note specimen=A12 --base 20 --check
  bead trend archive --quantity ratio --quantity clock --by day --format json
  bead trend archive --by strike --out trend.parquet";

#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    #[command(flatten)]
    pub(super) folder: FolderOptions,
    /// A quantity; repeat for more [default: all that are known].
    #[arg(long, value_enum, value_name = "NAME")]
    pub(super) quantity: Vec<QuantityName>,
    /// The strikes that make a point.
    #[arg(long, value_enum, default_value = "recording")]
    pub(super) by: Grouping,
    /// Take the limits from the first N points of each quantity [default: from all].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(BASE_LEAST as i64..))]
    pub(super) base: Option<u32>,
    /// End with exit status 1 if a point is beyond its limits.
    #[arg(long)]
    pub(super) check: bool,
    /// Draw the trends.
    #[arg(long, value_name = "F.svg")]
    pub(super) picture: Option<PathBuf>,
    /// Write the points as a table: Parquet, or CSV if the name ends in .csv.
    #[arg(long, value_name = "F.parquet|F.csv")]
    pub(super) out: Option<PathBuf>,
    #[command(flatten)]
    pub(super) overwrite: Overwrite,
    /// Format of the result.
    #[arg(long, value_enum, default_value_t)]
    pub(super) format: Format,
}

/// A quantity of a strike.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum QuantityName {
    /// Absorbed energy by estimate A.
    AbsorbedMeasured,
    /// Absorbed energy by estimate B.
    AbsorbedPredicted,
    /// A over B.
    Ratio,
    /// Highest force.
    PeakForce,
    /// Frequency of the intruder's ringing.
    RingFrequency,
    /// Low over high gain of the force, less 1.
    ForceGains,
    /// Low over high gain of the acceleration, less 1.
    AccelerationGains,
    /// The bead's clock against the host's.
    Clock,
}

impl From<QuantityName> for Quantity {
    fn from(name: QuantityName) -> Self {
        match name {
            QuantityName::AbsorbedMeasured => Self::Measured,
            QuantityName::AbsorbedPredicted => Self::Predicted,
            QuantityName::Ratio => Self::Ratio,
            QuantityName::PeakForce => Self::PeakForce,
            QuantityName::RingFrequency => Self::RingFrequency,
            QuantityName::ForceGains => Self::ForceGains,
            QuantityName::AccelerationGains => Self::AccelerationGains,
            QuantityName::Clock => Self::Clock,
        }
    }
}

/// The strikes of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Grouping {
    /// All strikes of a recording.
    Recording,
    /// All strikes of a day, UTC.
    Day,
    /// One strike.
    Strike,
}

impl From<Grouping> for PointBy {
    fn from(by: Grouping) -> Self {
        match by {
            Grouping::Recording => Self::Recording,
            Grouping::Day => Self::Day,
            Grouping::Strike => Self::Strike,
        }
    }
}
