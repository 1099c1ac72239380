//! The strikes of a recording against limits.
//!
//! # Design
//! Each limit is applied to each strike of each of its beads, and its result is the worst strike: one that
//! fails before one that is not decided, and of equal ones the one with the least room. Strikes are read in
//! batches, and only their values are kept.

use std::collections::BTreeMap;
use std::sync::Arc;

use bead_model::design::Uncertainty;
use bead_recording::clock::CommonTime;
use bead_recording::file::{Recording, RecordingError};
use bead_recording::strikes::RecordedStrike;
use bead_spectra::strike::{Sensors, SignalsWanted, StrikeSignal};
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

use crate::drift::{STRIKES_LEAST, StrikeDrift};
use crate::file::{Limit, Limits};
use crate::judged::{EnvelopePoint, JudgedLimit, JudgedRecording, JudgedValue, too_few};
use crate::mask::MaskedPoint;
use crate::quantity::{Quantity, Scalar};
use crate::row::{FeltStrike, shares};
use crate::rule::Outcome;
use crate::values::{Measured, StrikeValues};

/// Number of strikes in memory: enough for all cores.
const BATCH: usize = 64;

/// The strikes of a bead, as far as limits need them.
#[derive(Default)]
struct BeadStrikes {
    values: Vec<StrikeValues>,
    felt: Vec<FeltStrike>,
    /// By the number of the limit: the worst point of each strike, and the envelope.
    masked: BTreeMap<usize, (Vec<JudgedValue>, Vec<EnvelopePoint>)>,
}

/// Judges the strikes of a recording by limits. `stated` uncertainties replace those in the recording.
///
/// # Errors
/// The recording cannot be read, or is of a later version of the protocol.
pub fn judge(
    recording: &Recording,
    limits: &Limits,
    stated: Option<&Uncertainty>,
) -> Result<JudgedRecording, RecordingError> {
    let name: Arc<str> = recording.path.display().to_string().into();
    let order = order(recording);
    let time = limits.has_row().then(|| CommonTime::of(recording)).transpose()?;
    let mut beads: BTreeMap<u8, BeadStrikes> = order
        .iter()
        .map(|address| (*address, BeadStrikes::default()))
        .collect();
    let mut strikes = recording.strikes()?;
    let mut none = true;
    loop {
        let batch: Vec<RecordedStrike> = strikes.by_ref().take(BATCH).collect();
        if batch.is_empty() {
            break;
        }
        none = false;
        let energies = limits.has_energy();
        let values: Vec<StrikeValues> = batch
            .par_iter()
            .map(|strike| StrikeValues::of(strike, stated, energies))
            .collect();
        for (strike, values) in batch.iter().zip(values) {
            let bead = beads.entry(strike.address).or_default();
            if let Some(time) = &time {
                let is_first = order.first().is_none_or(|first| *first == strike.address);
                bead.felt
                    .extend(FeltStrike::of(strike, &values, time, stated, is_first));
            }
            if limits.has_mask() {
                bead.hold_masks(&name, strike, limits, stated);
            }
            bead.values.push(values);
        }
    }
    if none && let error @ RecordingError::FromTheFuture { .. } = recording.no_strike(strikes.frames()) {
        return Err(error);
    }
    let mut judged: Vec<JudgedLimit> = beads
        .iter()
        .filter(|(_, bead)| bead.values.len() < limits.strikes)
        .map(|(address, bead)| too_few(*address, bead.values.len(), limits.strikes))
        .collect();
    for (number, limit) in limits.limits.iter().enumerate() {
        if beads.is_empty() {
            judged.push(limit.result(None, Vec::new(), Vec::new()));
        } else {
            judged.extend(limit.judge(number, &beads, &order));
        }
    }
    let worst = judged.iter().map(|limit| limit.outcome).max();
    Ok(JudgedRecording {
        recording: name.to_string(),
        outcome: worst.unwrap_or(Outcome::Undecided),
        incomplete: recording.incomplete(),
        limits: judged,
    })
}

/// The addresses of the beads of a recording of several, from the striker on.
fn order(recording: &Recording) -> Vec<u8> {
    let mut beads: Vec<_> = recording.beads.iter().collect();
    beads.sort_by_key(|bead| bead.place());
    beads.into_iter().map(|bead| bead.origin.address).collect()
}

impl BeadStrikes {
    /// Compares the spectra of a strike with the masks for its bead.
    fn hold_masks(
        &mut self,
        recording: &Arc<str>,
        strike: &RecordedStrike,
        limits: &Limits,
        stated: Option<&Uncertainty>,
    ) {
        let wanted = SignalsWanted {
            sensors: Sensors::Acceleration,
            doubtful: false,
            stated: stated.copied(),
        };
        let signal = StrikeSignal::of(recording, strike, wanted);
        for (number, limit) in limits.limits.iter().enumerate() {
            let Some(mask) = limit.mask.as_ref().filter(|_| limit.is_for(strike.address)) else {
                continue;
            };
            let points = match &signal {
                Ok(signal) => mask.hold(signal, limit.rule),
                Err(why) => Err(format!("{why}; strike again")),
            };
            let (worst, envelope) = self.masked.entry(number).or_default();
            let number = Some(strike.said.strike);
            worst.push(match points {
                Ok(points) => {
                    widen(envelope, &points);
                    let values = points.into_iter().map(|point| JudgedValue::masked(number, point));
                    JudgedValue::worst(values).unwrap_or_else(|| {
                        JudgedValue::absent(number, "the mask has no frequency".to_owned())
                    })
                }
                Err(why) => JudgedValue::absent(number, why),
            });
        }
    }
}

/// Adds a spectrum to an envelope, whose frequencies are those of the first spectrum.
fn widen(envelope: &mut Vec<EnvelopePoint>, points: &[MaskedPoint]) {
    if envelope.is_empty() {
        envelope.extend(points.iter().map(|point| EnvelopePoint {
            frequency: point.frequency,
            greatest: point.value,
            limits: point.limits,
        }));
        return;
    }
    for (most, point) in envelope.iter_mut().zip(points) {
        most.greatest = most.greatest.max(point.value);
    }
}

impl Limit {
    /// True if the limit applies to a bead.
    pub fn is_for(&self, address: u8) -> bool {
        self.beads.is_empty() || self.beads.contains(&address)
    }

    fn judge(&self, number: usize, beads: &BTreeMap<u8, BeadStrikes>, order: &[u8]) -> Vec<JudgedLimit> {
        if self.quantity == Quantity::RowShare {
            let row = |address: &u8| Some((*address, beads.get(address)?.felt.clone()));
            let row: Vec<_> = match order {
                [] => beads.keys().filter_map(row).collect(),
                _ => order.iter().filter_map(row).collect(),
            };
            let values = shares(&row).into_iter().map(|(strike, share)| match share {
                Ok(share) => JudgedValue::decided(Some(strike), share.value, share.expanded(), self),
                Err(why) => JudgedValue::absent(Some(strike), why),
            });
            return vec![self.result(None, values.collect(), Vec::new())];
        }
        let missing = self.beads.iter().filter(|address| !beads.contains_key(address));
        let there: Vec<String> = beads.keys().map(u8::to_string).collect();
        let missing = missing.map(|address| {
            let why = format!(
                "bead {address} is not in the recording (beads there: {}); leave it out of `beads`, or record it",
                there.join(", ")
            );
            self.result(Some(*address), vec![JudgedValue::absent(None, why)], Vec::new())
        });
        let own = beads.iter().filter(|(address, _)| self.is_for(**address));
        let own = own.map(|(address, bead)| {
            let (values, envelope) = match self.quantity {
                Quantity::Scalar(scalar) => (
                    bead.values.iter().map(|one| self.scalar(one, scalar)).collect(),
                    Vec::new(),
                ),
                Quantity::Drift(of) => (vec![self.drift(&bead.values, of)], Vec::new()),
                Quantity::Srs | Quantity::RowShare => bead.masked.get(&number).cloned().unwrap_or_default(),
            };
            self.result(Some(*address), values, envelope)
        });
        own.chain(missing).collect()
    }

    fn scalar(&self, strike: &StrikeValues, scalar: Scalar) -> JudgedValue {
        match strike.get(scalar) {
            Ok(found) => JudgedValue::decided(Some(strike.strike), found.value, found.expanded(), self),
            Err(why) => JudgedValue::absent(Some(strike.strike), why.to_owned()),
        }
    }

    fn drift(&self, strikes: &[StrikeValues], of: Scalar) -> JudgedValue {
        let known = strikes.iter().filter_map(|strike| strike.get(of).ok());
        let values: Vec<f64> = known.map(|found: Measured| found.value).collect();
        match StrikeDrift::of(&values) {
            Some(drift) => JudgedValue::decided(None, drift.part, Some(drift.expanded), self),
            None if values.len() >= STRIKES_LEAST => {
                let why = format!(
                    "the mean of {} is 0, so its drift has no relative size",
                    of.name()
                );
                JudgedValue::absent(None, why)
            }
            None => JudgedValue::absent(
                None,
                format!(
                    "a drift needs at least {STRIKES_LEAST} strikes, and {} of those recorded have {}; record more",
                    values.len(),
                    of.name()
                ),
            ),
        }
    }

    /// The result of a bead's values: the worst of them.
    fn result(
        &self,
        bead: Option<u8>,
        values: Vec<JudgedValue>,
        envelope: Vec<EnvelopePoint>,
    ) -> JudgedLimit {
        let none = || JudgedValue::absent(None, "there is no strike to judge; record one".to_owned());
        let worst = JudgedValue::worst(values.iter().cloned()).unwrap_or_else(none);
        let count = |outcome| values.iter().filter(|value| value.outcome == outcome).count();
        let unit = match (self.quantity, &self.mask) {
            (Quantity::Scalar(scalar), _) => scalar.unit(),
            (_, Some(mask)) => mask.unit(),
            _ => "",
        };
        JudgedLimit {
            name: self.name.clone(),
            quantity: self.quantity.name(),
            unit,
            rule: self.rule,
            bead,
            outcome: worst.outcome,
            passed: count(Outcome::Pass),
            undecided: count(Outcome::Undecided),
            failed: count(Outcome::Fail),
            strike: worst.strike,
            value: worst.value,
            expanded: worst.expanded,
            frequency_hz: worst.frequency,
            interval: if worst.value.is_some() {
                worst.interval
            } else {
                self.interval
            },
            why: worst.why,
            points: values,
            envelope,
        }
    }
}
