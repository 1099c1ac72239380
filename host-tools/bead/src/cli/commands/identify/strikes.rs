//! The strikes of `bead identify`, bead by bead.

use crate::cli::chosen::GatheredBead;
use crate::cli::commands::identify::arguments::Arguments;
use crate::cli::commands::prelude::*;
use bead_identify::series::StrikeSeries;
use bead_recording::strikes::LeftOut;
use bead_wire::StrikeFlags as Flags;

/// Flags of samples that no model has.
const SPOILED: Flags = Flags::FORCE_RAILED
    .with(Flags::ACCELERATION_RAILED)
    .with(Flags::WINDOW_CUT)
    .with(Flags::ANOTHER_WAVE)
    .with(Flags::SENSOR_END)
    .with(Flags::SENSOR_FAULT)
    .with(Flags::SENSOR_STILL)
    .with(Flags::PLAYED);

/// A strike that has signals.
pub(super) struct TakenStrike {
    /// Place of its recording.
    pub(super) recording: usize,
    /// Number, as its bead counts.
    pub(super) number: u32,
    pub(super) series: StrikeSeries,
}

/// A bead with those of its strikes that have signals.
pub(super) type BeadStrikes = GatheredBead<Vec<TakenStrike>>;

/// Reads the chosen strikes of all recordings. Returns the names of the recordings too.
pub(super) fn read(arguments: &Arguments) -> Result<(Vec<BeadStrikes>, Vec<String>), Failure> {
    let choice = &arguments.strikes;
    let progress = output::spinner("reading");
    let mut beads: Vec<BeadStrikes> = Vec::new();
    let names = choice.each_strike(&progress, &mut beads, |beads, place, (number, name), strike| {
        let bead = &mut beads[place];
        match series(strike, arguments.doubtful) {
            Ok(series) => bead.gathered.push(TakenStrike {
                recording: number,
                number: strike.said.strike,
                series,
            }),
            Err(why) => bead.left_out.push(LeftOut {
                recording: name.to_owned(),
                strike: strike.said.strike,
                why,
            }),
        }
        Ok(())
    })?;
    progress.finish_and_clear();
    choice.check(&beads)?;
    beads.retain(|bead| choice.has(bead.address));
    Ok((beads, names))
}

/// The signals of a strike, or why it has none that a model explains.
fn series(strike: &RecordedStrike, doubtful: bool) -> Result<StrikeSeries, String> {
    let spoiled = Flags::from_bits(strike.said.flags.bits() & SPOILED.bits());
    if spoiled != Flags::NONE && !doubtful {
        let names: Vec<_> = spoiled.names().collect();
        return Err(format!("it is flagged: {}", names.join(", ")));
    }
    StrikeSeries::of(strike)
}
