//! One bead of a row, strike by strike.

use std::collections::BTreeSet;

use bead_model::layout::WindowSettings;
use serde::Serialize;

use crate::emulated::EmulatorReport;
use crate::replay::replay;
use crate::row::later::{LaterWave, later_wave};
use crate::spread::{Deviations, Spread};
use crate::strike::{FullChain, Traces, Values, force_railed};
use crate::verdict::{Echoes, Soundness, failure, overruns};
use bead_recording::arrival::rise;
use bead_recording::clock::CommonTime;
use bead_recording::file::{Part, RecordingError};
use bead_recording::received::Received;
use bead_recording::signal::Signal;
use bead_recording::strikes::RecordedStrike;

/// Strikes of a bead that are kept at most. Means and verdicts are over all.
const STRIKES_MOST: usize = 10_000;
/// Strikes whose curves are kept, for the pictures.
const DRAWN_MOST: usize = 8;

/// One strike, as a bead told it.
#[derive(Debug, Clone)]
pub struct Felt {
    /// Its number since the bead's reset.
    pub number: u32,
    /// By the bead.
    pub device: Values,
    /// Energy that the main wave brought, by the bead's force, J; none if its force left the range of the
    /// sensor, samples are missing, or the chain is under a load.
    pub incident: Option<f64>,
    /// The instant of the striker's hit, by the host's time and the simulated way of the wave, s.
    pub struck: Option<f64>,
    /// The instant at which the force rose through half of its height, s on the time in common; none if it
    /// left the range of the sensor.
    pub rise: Option<f64>,
    /// `rise` on the time of [`Felt::traces`].
    pub rise_drawn: Option<f64>,
    /// The strongest wave after the main one.
    pub later: Option<LaterWave>,
    /// Values of the sensors, and the chain's beside them.
    pub traces: Option<Traces>,
}

/// A bead of a row.
pub struct Member {
    /// Its place.
    pub bead: usize,
    /// Its address.
    pub address: u8,
    /// The chain around it.
    pub chain: FullChain,
    /// Its strikes.
    pub felt: Vec<Felt>,
    /// Its window at the first of them.
    pub window: Option<WindowSettings>,
    /// Echoes that it measured, and which are left out.
    pub echoes: usize,
    told: BeadOfRow,
}

/// The bead's value and the chain's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Pair {
    /// By the bead: the mean over its strikes.
    pub device: f64,
    /// By the chain.
    pub f64_chain: f64,
}

impl Pair {
    /// Deviation of the bead, as a part of the chain's value.
    pub fn off(&self) -> f64 {
        self.device / self.f64_chain - 1.0
    }
}

/// A bead of a row against the simulation, as in the JSON. SI units.
#[derive(Debug, Clone, Serialize, schemars::JsonSchema)]
pub struct BeadOfRow {
    /// Its place in the chain.
    pub bead: usize,
    /// Its address.
    pub address: u8,
    /// Strikes that it told of.
    pub strikes: usize,
    /// Strikes that are only in the means, as there are so many.
    pub strikes_left_out: usize,
    /// Highest force, N.
    pub peak_force: Option<Pair>,
    /// Full width at half height of the force, s.
    pub width: Option<Pair>,
    /// Energy that the main wave brought, J: by the bead's force and the reduced chain of estimate B, in f64.
    pub incident: Option<Pair>,
    /// Estimate A, J.
    pub absorbed_measured: Option<Pair>,
    /// Estimate B, J.
    pub absorbed_predicted: Option<Pair>,
    /// The strongest wave after the main one, of the first strike that has one.
    pub later_wave: Option<LaterWave>,
    /// A and B against their goals; empty without a strike.
    pub spread: Vec<Spread>,
    /// Names of the flags of its strikes.
    pub flags: Vec<&'static str>,
    /// True if every strike replays to the same bits; none without a strike.
    pub replay_identical: Option<bool>,
    /// The first difference of a replay.
    pub first_difference: Option<String>,
    /// Frames lost.
    pub frames_lost: u64,
    /// Runs of bytes that are no frame.
    pub frames_corrupt: u64,
    /// ADC overruns.
    pub overruns: u64,
    /// Of an emulated run: instructions a sample while a strike was measured.
    pub instructions_per_sample: Option<f64>,
    /// True if every check passed.
    pub pass: bool,
    /// The first check that failed.
    pub failure: Option<String>,
}

/// A mean, value by value.
#[derive(Default)]
struct Mean {
    sum: f64,
    count: f64,
}

impl Mean {
    fn push(&mut self, value: f64) {
        self.sum += value;
        self.count += 1.0;
    }

    fn beside(&self, f64_chain: f64) -> Option<Pair> {
        (self.count > 0.0).then(|| Pair {
            device: self.sum / self.count,
            f64_chain,
        })
    }
}

impl Member {
    /// Reads what came from a bead and holds it against the chain, whose energy is known within `truth`, as a
    /// part of it. `echoes` tells which strikes are none.
    ///
    /// # Errors
    /// The recording cannot be read.
    pub fn read(
        bead: usize,
        received: &Received,
        chain: FullChain,
        time: &CommonTime,
        truth: f64,
        mut echoes: Echoes,
    ) -> Result<Self, RecordingError> {
        let emulator: Option<EmulatorReport> = received.json(Part::EmulatorReport)?;
        let mut recorded = received.strikes()?;
        let mut deviations = Deviations::within(truth);
        let [mut peak, mut width, mut incident, mut measured, mut predicted] =
            [(); 5].map(|()| Mean::default());
        let (mut count, mut again, mut felt, mut window) = (0, 0, Vec::new(), None);
        let (mut flags, mut differs) = (BTreeSet::new(), None);
        let (mut address, mut drawn) = (0, 0);
        for strike in recorded.by_ref() {
            address = strike.address;
            if echoes.has(&strike) {
                again += 1;
                differs = differs.or_else(|| replay(&strike).first_difference);
                continue;
            }
            count += 1;
            window = window.or(strike.settings.map(|settings| settings.window));
            let comparison = chain.compare(&strike);
            deviations.push(&comparison.deviation);
            peak.push(comparison.device.peak_force);
            measured.push(comparison.device.absorbed_measured);
            predicted.push(comparison.device.absorbed_predicted);
            if let Some(shape) = comparison.shape {
                width.push(shape.device.width);
            }
            differs = differs.or(comparison.first_difference);
            flags.extend(comparison.flags);
            if felt.len() == STRIKES_MOST {
                chain
                    .incident_by(&strike)
                    .into_iter()
                    .for_each(|energy| incident.push(energy));
                continue;
            }
            let kept = Some(()).filter(|()| drawn < DRAWN_MOST);
            let one = Felt::of(&strike, comparison.device, comparison.traces, &chain, time);
            one.incident.into_iter().for_each(|energy| incident.push(energy));
            drawn += usize::from(one.traces.is_some());
            felt.push(Felt {
                traces: kept.and(one.traces),
                ..one
            });
        }
        let heard = recorded.frames();
        let soundness = Soundness::of(heard.counters(), overruns(received)?, emulator.as_ref());
        let spread = match count {
            0 => Vec::new(),
            _ => deviations.spread().to_vec(),
        };
        let failure = failure(differs.as_deref(), &soundness, &spread);
        let truth = chain.truth();
        let told = BeadOfRow {
            bead,
            address,
            strikes: count,
            strikes_left_out: count - felt.len(),
            peak_force: peak.beside(truth.peak_force),
            width: chain.pulse().and_then(|pulse| width.beside(pulse.fwhm?)),
            incident: chain.incident().and_then(|brought| incident.beside(brought)),
            absorbed_measured: measured.beside(truth.absorbed),
            absorbed_predicted: predicted.beside(truth.absorbed),
            later_wave: felt.iter().find_map(|felt| felt.later),
            spread,
            flags: flags.into_iter().collect(),
            replay_identical: (count > 0).then_some(differs.is_none()),
            first_difference: differs,
            frames_lost: soundness.lost,
            frames_corrupt: soundness.corrupt,
            overruns: soundness.overruns,
            instructions_per_sample: soundness.instructions.map(|(total, _)| total),
            pass: failure.is_none(),
            failure,
        };
        Ok(Self {
            bead,
            address,
            chain,
            felt,
            window,
            echoes: again,
            told,
        })
    }

    /// Its results beside the simulation.
    pub fn told(&self) -> BeadOfRow {
        self.told.clone()
    }
}

impl Felt {
    fn of(
        strike: &RecordedStrike,
        device: Values,
        traces: Option<Traces>,
        chain: &FullChain,
        time: &CommonTime,
    ) -> Self {
        let said = &strike.said;
        let whole = strike.settings.filter(|_| strike.missing() == 0);
        let inside = whole.filter(|_| !force_railed(strike));
        let signal = inside.and_then(|settings| Signal::of(&strike.scans, &settings));
        let rise = signal.as_ref().and_then(rise);
        let on = |sample: f64| time.common(strike, said.first_index as f64 + sample);
        let host = time.host(strike, said.trigger_index as f64);
        let per_sample = strike.rate().map(|rate| 1.0 / f64::from(rate));
        let start = traces
            .as_ref()
            .and_then(|traces| Some(traces.force.first()?.time));
        Self {
            number: said.strike,
            device,
            incident: chain.incident_by(strike),
            struck: host.map(|host| host - chain.front()),
            rise: rise.and_then(on),
            rise_drawn: start
                .zip(rise.zip(per_sample))
                .map(|(start, (rise, step))| start + rise * step),
            later: traces.as_ref().and_then(|traces| later_wave(&traces.force)),
            traces,
        }
    }
}
