//! The strikes of `bead analyse`: read one after another, computed on all cores.

use std::sync::Arc;

use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

use crate::cli::commands::analyse::arguments::Common;
use crate::cli::commands::prelude::*;
use bead_compare::report::count;
use bead_recording::beads::GatheredBead;
use bead_recording::strikes::LeftOut;
use bead_spectra::bead::{BeadSpectrum, BeadSums};
use bead_spectra::plan::{Plan, StrikeSpectrum, Wanted};
use bead_spectra::shock::ResponseKind;
use bead_spectra::strike::{SignalsWanted, StrikeSignal};
use bead_spectra::table;
use bead_tables::Writer;

/// Strikes whose signals are held in memory: enough for all cores.
const BATCH: usize = 512;

/// The strikes of all recordings, bead by bead.
pub(super) struct Gathered<'a> {
    pub(super) common: &'a Common,
    pub(super) wanted: Wanted,
    pub(super) signals: SignalsWanted,
    pub(super) response: ResponseKind,
    /// True for accelerations in g.
    pub(super) gravities: bool,
}

/// A bead with its sums; `None` before the first strike that gives a plan.
type Bead = GatheredBead<Option<BeadSums>>;

/// The strikes that wait for their spectra, each with the place of its bead.
type Waiting = Vec<(usize, StrikeSignal)>;

/// The spectra of all beads, and a row for each frequency of each strike in `table`.
pub(super) fn gather(
    of: &Gathered<'_>,
    mut table: Option<&mut Writer<'_>>,
) -> Result<Vec<BeadSpectrum>, Failure> {
    let progress = output::spinner("reading");
    let (mut beads, mut waiting, mut written) = (Vec::new(), Waiting::new(), 0);
    let choice = &of.common.strikes;
    choice.each_strike(&progress, &mut beads, |beads, place, (_, name), strike| {
        match planned(of, name, strike, &mut beads[place]) {
            Ok(signal) => waiting.push((place, signal)),
            Err(why) => leave_out(&mut beads[place], name, strike.said.strike, why),
        }
        if waiting.len() == BATCH {
            compute(beads, &mut waiting, table.as_deref_mut(), &mut written)?;
            progress.set_message(count(written, "strike"));
        }
        Ok(())
    })?;
    compute(&mut beads, &mut waiting, table, &mut written)?;
    progress.finish_and_clear();
    if written == 0 {
        return Err(nothing(of, &beads));
    }
    choice.check(&beads)?;
    let lines = beads
        .iter()
        .filter_map(|bead| LeftOut::line(bead.address, &bead.left_out));
    lines.for_each(|line| note!("{line}"));
    let spectra = beads.into_iter().filter_map(|bead| {
        let uid = bead.uid();
        let sums = bead.gathered.filter(|sums| !sums.is_empty())?;
        Some(sums.finish(bead.address, uid, bead.left_out))
    });
    Ok(spectra.collect())
}

fn leave_out(bead: &mut Bead, recording: &str, strike: u32, why: String) {
    bead.left_out.push(LeftOut {
        recording: recording.to_owned(),
        strike,
        why,
    });
}

/// The signals of a strike. The first strike of a bead determines the bead's plan.
fn planned(
    of: &Gathered<'_>,
    recording: &str,
    strike: &RecordedStrike,
    bead: &mut Bead,
) -> Result<StrikeSignal, String> {
    let signal = StrikeSignal::of(&Arc::from(recording), strike, of.signals)?;
    if bead.gathered.is_none() {
        let plan = Plan::new(&of.wanted, &signal)?;
        bead.gathered = Some(BeadSums::new(plan, of.response, of.gravities));
    }
    Ok(signal)
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
        .map(|bead| bead.gathered.as_ref().map(|sums| sums.plan().clone()))
        .collect();
    let spectra: Vec<Option<Result<StrikeSpectrum, String>>> = waiting
        .par_iter()
        .map(|(place, signal)| plans[*place].as_ref().map(|plan| plan.spectrum(signal)))
        .collect();
    for ((place, signal), spectrum) in waiting.drain(..).zip(spectra) {
        let bead = &mut beads[place];
        let uid = bead.uid();
        match (spectrum, &mut bead.gathered) {
            (Some(Ok(spectrum)), Some(sums)) => {
                sums.add(&signal, &spectrum);
                if let Some(table) = table.as_deref_mut() {
                    let who = (*written, bead.address, uid.as_deref());
                    table::rows(who, sums.plan(), &signal, &spectrum).try_for_each(|row| table.push(row))?;
                }
                *written += 1;
            }
            (Some(Err(why)), _) => leave_out(bead, &signal.recording, signal.strike, why),
            // Every waiting strike has a plan.
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
            more => format!(" ({} more left out)", more - 1),
        };
        return failure!(Input, "{recording}: strike {strike}: {why}{more}");
    }
    match of.common.strikes.check(beads) {
        Err(failure) => failure,
        Ok(()) => failure!(
            Input,
            "no strike in these recordings, so there is nothing to analyse; record one"
        ),
    }
}
