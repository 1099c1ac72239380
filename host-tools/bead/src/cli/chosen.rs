//! The strikes of recordings that a command is asked for, bead by bead.

use std::path::PathBuf;

use bead_compare::report::count;
use bead_recording::beads::GatheredBead;
use bead_recording::file::RecordingError;
use bead_recording::strikes::RecordedStrike;
use bead_tables::printable::first_of;
use clap::Args;
use indicatif::ProgressBar;

use crate::cli::recordings::open_all;
use bead_console::failure::Failure;

/// Greatest number of strikes that a line names.
const NAMED: usize = 4;

/// Options of commands that take some strikes of one or many recordings.
#[derive(Debug, Args)]
pub(crate) struct StrikeChoice {
    /// Recordings made by `bead record` or `bead emulate`.
    #[arg(value_name = "F.mcap", required = true)]
    pub(crate) recordings: Vec<PathBuf>,
    /// Only these strikes of each bead, counted from 0 over the recordings: 3 or 0,2,5 [default: all].
    #[arg(long, value_name = "N", value_delimiter = ',')]
    strike: Vec<usize>,
    /// Only the bead with this address.
    #[arg(long, value_name = "N")]
    bead: Option<u8>,
}

/// A recording among all: its place, and its name.
pub(crate) type NamedPlace<'a> = (usize, &'a str);

impl StrikeChoice {
    /// Calls `take` for each chosen strike with the beads so far, the place of its bead among them, and its
    /// recording. Returns the names of the recordings.
    ///
    /// # Errors
    /// A recording cannot be read, the only one has no strike, or `take` fails.
    pub(crate) fn each_strike<T: Default>(
        &self,
        progress: &ProgressBar,
        beads: &mut Vec<GatheredBead<T>>,
        mut take: impl FnMut(
            &mut Vec<GatheredBead<T>>,
            usize,
            NamedPlace<'_>,
            &RecordedStrike,
        ) -> Result<(), Failure>,
    ) -> Result<Vec<String>, Failure> {
        let recordings = open_all(&self.recordings)?;
        let mut names = Vec::new();
        for (number, received) in recordings.iter().enumerate() {
            let name = received.path.display().to_string();
            let mut strikes = received.strikes()?;
            let mut none = true;
            for strike in strikes.by_ref() {
                none = false;
                let (place, count) = GatheredBead::count(beads, &strike);
                let is_chosen = self.strike.is_empty() || self.strike.contains(&count);
                if is_chosen && self.has(strike.address) {
                    take(beads, place, (number, &name), &strike)?;
                }
            }
            if none {
                match received.no_strike(strikes.frames()) {
                    future @ RecordingError::FromTheFuture { .. } => return Err(future.into()),
                    error if recordings.len() == 1 => return Err(error.into()),
                    _ => progress.suspend(|| note!("{name}: no strike in it")),
                }
            }
            names.push(name);
        }
        Ok(names)
    }

    /// True for a bead that was chosen.
    pub(crate) fn has(&self, address: u8) -> bool {
        self.bead.is_none_or(|wanted| wanted == address)
    }

    /// Refuses a bead without strikes, and a choice of strikes of which none exists. A note names single
    /// missing ones.
    pub(crate) fn check<T>(&self, beads: &[GatheredBead<T>]) -> Result<(), Failure> {
        let addresses: Vec<u8> = beads.iter().map(|bead| bead.address).collect();
        if let Some(bead) = self.bead.filter(|bead| !addresses.contains(bead)) {
            bail!(
                Input,
                "--bead {bead}: no strike is from this bead; those with strikes are {addresses:?}"
            );
        }
        let of_chosen = beads.iter().filter(|bead| self.has(bead.address));
        let most = of_chosen.map(|bead| bead.seen).max().unwrap_or(0);
        let missing: Vec<_> = self.strike.iter().filter(|wanted| **wanted >= most).collect();
        if missing.is_empty() {
            return Ok(());
        }
        let line = format!(
            "--strike {} does not exist: a bead has at most {}, counted from 0",
            first_of(missing.iter(), NAMED),
            count(most as u64, "strike")
        );
        if missing.len() == self.strike.len() {
            bail!(Input, "{line}");
        }
        note!("{line}");
        Ok(())
    }
}
