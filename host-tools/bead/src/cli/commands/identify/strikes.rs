//! The strikes of `bead identify`, bead by bead.

use std::sync::Arc;

use crate::cli::commands::identify::arguments::Arguments;
use crate::cli::commands::prelude::*;
use crate::cli::recordings::open_all;
use bead_compare::report::count;
use bead_identify::report::LeftOut;
use bead_identify::series::StrikeSeries;
use bead_recording::file::RecordingError;
use bead_recording::json::hex;
use bead_tables::printable::first_of;
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
/// Strikes left out that a bead's line names.
const NAMED: usize = 4;

/// A strike that has signals.
pub(super) struct TakenStrike {
    /// Place of its recording.
    pub(super) recording: usize,
    /// Number, as its bead counts.
    pub(super) number: u32,
    pub(super) series: StrikeSeries,
}

/// A bead in the recordings.
pub(super) struct BeadStrikes {
    pub(super) address: u8,
    uid: Option<[u8; 12]>,
    /// Strikes so far, wanted or not.
    seen: usize,
    pub(super) strikes: Vec<TakenStrike>,
    pub(super) left_out: Vec<LeftOut>,
}

impl BeadStrikes {
    /// Device id, hexadecimal.
    pub(super) fn uid(&self) -> Option<String> {
        self.uid.map(|uid| hex(&uid))
    }
}

/// Reads the strikes of all recordings.
pub(super) fn read(arguments: &Arguments) -> Result<(Vec<BeadStrikes>, Vec<String>), Failure> {
    let recordings = open_all(&arguments.recordings)?;
    let progress = output::spinner("reading");
    let (mut beads, mut names) = (Vec::new(), Vec::new());
    for (place, received) in recordings.iter().enumerate() {
        let name: Arc<str> = received.path.display().to_string().into();
        let mut strikes = received.strikes()?;
        let mut none = true;
        for strike in strikes.by_ref() {
            none = false;
            take(arguments, (place, &name), &strike, &mut beads);
        }
        if none {
            match received.no_strike(strikes.frames()) {
                future @ RecordingError::FromTheFuture { .. } => return Err(future.into()),
                error if recordings.len() == 1 => return Err(error.into()),
                _ => progress.suspend(|| note!("{name}: no strike in it")),
            }
        }
        names.push(name.to_string());
    }
    progress.finish_and_clear();
    check_wanted(arguments, &beads)?;
    beads.retain(|bead| arguments.bead.is_none_or(|wanted| wanted == bead.address));
    Ok((beads, names))
}

fn take(
    arguments: &Arguments,
    (place, recording): (usize, &Arc<str>),
    strike: &RecordedStrike,
    beads: &mut Vec<BeadStrikes>,
) {
    let address = strike.address;
    // A strike may come before the identity of its bead.
    let same = |bead: &BeadStrikes| {
        let uids = bead.uid.zip(strike.uid);
        bead.address == address && uids.is_none_or(|(one, other)| one == other)
    };
    let at = beads.iter().position(same).unwrap_or_else(|| {
        beads.push(BeadStrikes {
            address,
            uid: None,
            seen: 0,
            strikes: Vec::new(),
            left_out: Vec::new(),
        });
        beads.len() - 1
    });
    let bead = &mut beads[at];
    bead.uid = bead.uid.or(strike.uid);
    let number = bead.seen;
    bead.seen += 1;
    let is_other_strike = !arguments.strike.is_empty() && !arguments.strike.contains(&number);
    if is_other_strike || arguments.bead.is_some_and(|wanted| wanted != address) {
        return;
    }
    let spoiled = Flags::from_bits(strike.said.flags.bits() & SPOILED.bits());
    let series = if spoiled != Flags::NONE && !arguments.doubtful {
        let names: Vec<_> = spoiled.names().collect();
        Err(format!("it is flagged: {}", names.join(", ")))
    } else {
        StrikeSeries::of(strike)
    };
    match series {
        Ok(series) => bead.strikes.push(TakenStrike {
            recording: place,
            number: strike.said.strike,
            series,
        }),
        Err(why) => bead.left_out.push(LeftOut {
            recording: recording.to_string(),
            strike: strike.said.strike,
            why,
        }),
    }
}

/// Refuses a bead that is nowhere; names strikes that are not there.
fn check_wanted(arguments: &Arguments, beads: &[BeadStrikes]) -> Result<(), Failure> {
    let addresses: Vec<u8> = beads.iter().map(|bead| bead.address).collect();
    if let Some(bead) = arguments.bead.filter(|bead| !addresses.contains(bead)) {
        bail!(
            Input,
            "--bead {bead}: no strike is of it; the beads are {addresses:?}"
        );
    }
    let is_of = |bead: &&BeadStrikes| arguments.bead.is_none_or(|wanted| wanted == bead.address);
    let most = beads
        .iter()
        .filter(is_of)
        .map(|bead| bead.seen)
        .max()
        .unwrap_or(0);
    let missing: Vec<_> = arguments
        .strike
        .iter()
        .filter(|wanted| **wanted >= most)
        .collect();
    if missing.is_empty() {
        return Ok(());
    }
    let line = format!(
        "--strike {} is not there: {}, counted from 0",
        first_of(missing.iter(), NAMED),
        count(most as u64, "strike")
    );
    if missing.len() == arguments.strike.len() {
        bail!(Input, "{line}");
    }
    note!("{line}");
    Ok(())
}

/// A line about strikes of a bead that had no part; `None` if all had one.
pub(super) fn left_out(address: u8, left_out: &[LeftOut]) -> Option<String> {
    let named = left_out.iter();
    let named = named.map(|out| format!("{}, strike {}: {}", out.recording, out.strike, out.why));
    (!left_out.is_empty()).then(|| {
        format!(
            "bead {address}: {} left out: {}",
            count(left_out.len() as u64, "strike"),
            first_of(named, NAMED)
        )
    })
}
