//! The strikes of `bead analyse`: read one after another, computed on all cores.

use std::sync::Arc;

use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

use crate::cli::commands::analyse::arguments::Common;
use crate::cli::commands::prelude::*;
use crate::cli::recordings::open_all;
use bead_compare::report::count;
use bead_recording::file::RecordingError;
use bead_recording::json::hex;
use bead_spectra::bead::{BeadSpectrum, BeadSums, LeftOut};
use bead_spectra::plan::{Plan, StrikeSpectrum, Wanted};
use bead_spectra::shock::ResponseKind;
use bead_spectra::strike::{SignalsWanted, StrikeSignal};
use bead_spectra::table;
use bead_tables::Writer;
use bead_tables::printable::first_of;

/// Strikes whose signals are held in memory: enough for all cores.
const BATCH: usize = 512;
/// Strikes left out that a bead's line names.
const NAMED: usize = 4;

/// The strikes of all recordings, bead by bead.
pub(super) struct Gathered<'a> {
    pub(super) common: &'a Common,
    pub(super) wanted: Wanted,
    pub(super) signals: SignalsWanted,
    pub(super) response: ResponseKind,
    /// True for accelerations in g.
    pub(super) gravities: bool,
}

/// A bead in the recordings.
struct Bead {
    address: u8,
    uid: Option<[u8; 12]>,
    /// Strikes so far, wanted or not.
    seen: usize,
    /// The sums, from the first strike on that has a spectrum.
    sums: Option<BeadSums>,
    left_out: Vec<LeftOut>,
}

impl Bead {
    fn leave_out(&mut self, recording: &str, strike: u32, why: String) {
        self.left_out.push(LeftOut {
            recording: recording.to_owned(),
            strike,
            why,
        });
    }
}

/// The strikes that wait for their spectra, each with the place of its bead.
type Waiting = Vec<(usize, StrikeSignal)>;

/// The spectra of all beads, and a row for each frequency of each strike in `table`.
pub(super) fn gather(
    of: &Gathered<'_>,
    mut table: Option<&mut Writer<'_>>,
) -> Result<Vec<BeadSpectrum>, Failure> {
    let recordings = open_all(&of.common.recordings)?;
    let progress = output::spinner("reading");
    let (mut beads, mut waiting, mut written) = (Vec::new(), Waiting::new(), 0);
    for received in &recordings {
        let name: Arc<str> = received.path.display().to_string().into();
        let mut strikes = received.strikes()?;
        let mut none = true;
        for strike in strikes.by_ref() {
            none = false;
            take(of, &name, &strike, &mut beads, &mut waiting);
            if waiting.len() == BATCH {
                compute(&mut beads, &mut waiting, table.as_deref_mut(), &mut written)?;
                progress.set_message(count(written, "strike"));
            }
        }
        if none {
            match received.no_strike(strikes.frames()) {
                future @ RecordingError::FromTheFuture { .. } => return Err(future.into()),
                error if recordings.len() == 1 => return Err(error.into()),
                _ => progress.suspend(|| note!("{name}: no strike in it")),
            }
        }
    }
    compute(&mut beads, &mut waiting, table, &mut written)?;
    progress.finish_and_clear();
    if written == 0 {
        return Err(nothing(of, &beads));
    }
    say_what_is_left_out(of, &beads);
    let spectra = beads.into_iter().filter_map(|bead| {
        let uid = bead.uid.map(|uid| hex(&uid));
        let sums = bead.sums.filter(|sums| !sums.is_empty())?;
        Some(sums.finish(bead.address, uid, bead.left_out))
    });
    Ok(spectra.collect())
}

/// Takes a strike if it is wanted and has signals.
fn take(
    of: &Gathered<'_>,
    recording: &Arc<str>,
    strike: &RecordedStrike,
    beads: &mut Vec<Bead>,
    waiting: &mut Waiting,
) {
    let address = strike.address;
    // A strike may come before the identity of its bead.
    let same = |bead: &Bead| {
        let uids = bead.uid.zip(strike.uid);
        bead.address == address && uids.is_none_or(|(one, other)| one == other)
    };
    let place = beads.iter().position(same).unwrap_or_else(|| {
        beads.push(Bead {
            address,
            uid: None,
            seen: 0,
            sums: None,
            left_out: Vec::new(),
        });
        beads.len() - 1
    });
    let bead = &mut beads[place];
    bead.uid = bead.uid.or(strike.uid);
    let number = bead.seen;
    bead.seen += 1;
    let is_other_strike = !of.common.strike.is_empty() && !of.common.strike.contains(&number);
    if is_other_strike || of.common.bead.is_some_and(|wanted| wanted != address) {
        return;
    }
    let signal = StrikeSignal::of(recording, strike, of.signals);
    let planned = signal.and_then(|signal| {
        if bead.sums.is_none() {
            let plan = Plan::new(&of.wanted, &signal)?;
            bead.sums = Some(BeadSums::new(plan, of.response, of.gravities));
        }
        Ok(signal)
    });
    match planned {
        Ok(signal) => waiting.push((place, signal)),
        Err(why) => bead.leave_out(recording, strike.said.strike, why),
    }
}

/// Computes the spectra of the strikes that wait, and adds them in their order.
fn compute(
    beads: &mut [Bead],
    waiting: &mut Waiting,
    mut table: Option<&mut Writer<'_>>,
    written: &mut u64,
) -> Result<(), Failure> {
    let plans: Vec<Option<Plan>> = beads
        .iter()
        .map(|bead| bead.sums.as_ref().map(|sums| sums.plan().clone()))
        .collect();
    let spectra: Vec<Option<Result<StrikeSpectrum, String>>> = waiting
        .par_iter()
        .map(|(place, signal)| plans[*place].as_ref().map(|plan| plan.spectrum(signal)))
        .collect();
    for ((place, signal), spectrum) in waiting.drain(..).zip(spectra) {
        let bead = &mut beads[place];
        match (spectrum, &mut bead.sums) {
            (Some(Ok(spectrum)), Some(sums)) => {
                sums.add(&signal, &spectrum);
                if let Some(table) = table.as_deref_mut() {
                    let uid = bead.uid.map(|uid| hex(&uid));
                    let who = (*written, bead.address, uid.as_deref());
                    table::rows(who, sums.plan(), &signal, &spectrum).try_for_each(|row| table.push(row))?;
                }
                *written += 1;
            }
            (Some(Err(why)), _) => bead.leave_out(&signal.recording, signal.strike, why),
            // A strike waits only for a plan that is there.
            _ => {}
        }
    }
    Ok(())
}

/// The failure where no strike has a spectrum.
fn nothing(of: &Gathered<'_>, beads: &[Bead]) -> Failure {
    let left_out = beads.iter().flat_map(|bead| &bead.left_out);
    let count_of_left_out = left_out.clone().count();
    if let Some(LeftOut {
        recording,
        strike,
        why,
    }) = left_out.clone().next()
    {
        let more = match count_of_left_out {
            1 => String::new(),
            more => format!(" ({} more are left out)", more - 1),
        };
        return failure!(Input, "{recording}: strike {strike}: {why}{more}");
    }
    let addresses: Vec<u8> = beads.iter().map(|bead| bead.address).collect();
    if let Some(bead) = of.common.bead.filter(|bead| !addresses.contains(bead)) {
        return failure!(
            Input,
            "--bead {bead}: no strike is of it; the beads are {addresses:?}"
        );
    }
    match missing(of, beads) {
        Some(missing) => failure!(Input, "{missing}"),
        None => failure!(
            Input,
            "no strike in these recordings, so there is nothing to analyse; record one"
        ),
    }
}

/// A line about strikes that were asked for and are nowhere.
fn missing(of: &Gathered<'_>, beads: &[Bead]) -> Option<String> {
    let is_of = |bead: &&Bead| of.common.bead.is_none_or(|wanted| wanted == bead.address);
    let most = beads
        .iter()
        .filter(is_of)
        .map(|bead| bead.seen)
        .max()
        .unwrap_or(0);
    let missing: Vec<_> = of
        .common
        .strike
        .iter()
        .filter(|wanted| **wanted >= most)
        .collect();
    (!missing.is_empty()).then(|| {
        format!(
            "--strike {} is not there: {}, counted from 0",
            first_of(missing, NAMED),
            count(most as u64, "strike")
        )
    })
}

fn say_what_is_left_out(of: &Gathered<'_>, beads: &[Bead]) {
    if let Some(missing) = missing(of, beads) {
        note!("{missing}");
    }
    for bead in beads.iter().filter(|bead| !bead.left_out.is_empty()) {
        let all = bead.left_out.len() as u64;
        let named = bead.left_out.iter();
        let named = named.map(|out| format!("{}, strike {}: {}", out.recording, out.strike, out.why));
        let named = first_of(named, NAMED);
        note!(
            "bead {}: {} left out: {named}",
            bead.address,
            count(all, "strike")
        );
    }
}
