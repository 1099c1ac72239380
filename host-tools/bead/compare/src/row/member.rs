//! One bead of a row, strike by strike.

use std::collections::BTreeSet;

use bead_model::layout::WindowSettings;
use serde::Serialize;

use crate::bead::{ComparedBead, STRIKES_MOST};
use crate::error::CompareError;
use crate::row::chain::{PlacedBead, RowChain};
use crate::row::later::{LaterWave, later_wave};
use crate::row::mean::mean;
use crate::spread::Spread;
use crate::strike::{FullChain, StrikeComparison, force_railed};
use crate::traces::Traces;
use crate::values::StrikeValues;
use crate::velocity::FittedVelocity;
use crate::verdict::Echoes;
use bead_recording::arrival::rise;
use bead_recording::clock::CommonTime;
use bead_recording::file::Part;
use bead_recording::signal::Signal;
use bead_recording::strikes::RecordedStrike;

/// Strikes whose curves are kept, for the pictures.
const DRAWN_MOST: usize = 8;

/// A strike at one bead of a row.
#[derive(Debug, Clone)]
pub(crate) struct FeltStrike {
    /// Its number since the bead's reset.
    pub(super) number: u32,
    /// By the bead.
    pub(super) device: StrikeValues,
    /// Energy that the main wave brought, by the bead's force, J; none if its force left the range of the
    /// sensor, samples are missing, or the chain is under a load.
    pub(super) incident: Option<f64>,
    /// The instant of the striker's hit, by the host's time less the simulated travel time of the wave, s.
    pub(super) struck: Option<f64>,
    /// The instant at which the force rose through half of its height, s in the common time; `None` if it
    /// left the range of the sensor.
    pub(super) rise: Option<f64>,
    /// `rise` on the time of [`FeltStrike::traces`].
    pub(super) rise_drawn: Option<f64>,
    pub(super) later: Option<LaterWave>,
    /// Curves of the sensors, and the chain's beside them.
    pub(super) traces: Option<Traces>,
}

/// A bead of a row.
pub struct RowBead {
    /// Its place.
    pub bead: usize,
    /// The chain around it.
    pub chain: FullChain,
    pub(crate) felt: Vec<FeltStrike>,
    /// Its window at the first strike.
    pub window: Option<WindowSettings>,
    /// Echoes that it measured, which are left out.
    pub echoes: usize,
    /// Its results beside the simulation.
    pub compared: BeadOfRow,
}

/// The bead's value and the chain's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct DeviceAndChain {
    /// By the bead: the mean over its strikes.
    pub device: f64,
    /// By the chain.
    pub f64_chain: f64,
}

impl DeviceAndChain {
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
    /// Strikes that it measured.
    pub strikes: usize,
    /// Strikes that are only in the means: there are more than a list takes.
    pub strikes_left_out: usize,
    /// Highest force, N.
    pub peak_force: Option<DeviceAndChain>,
    /// Full width at half height of the force, s.
    pub width: Option<DeviceAndChain>,
    /// Energy that the main wave brought, J: by the bead's force and the reduced chain of estimate B, in f64.
    pub incident: Option<DeviceAndChain>,
    /// Estimate A, J.
    pub absorbed_measured: Option<DeviceAndChain>,
    /// Estimate B, J.
    pub absorbed_predicted: Option<DeviceAndChain>,
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
    /// Frames of it that are missing.
    pub incomplete: Option<String>,
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

/// The mean of the bead's values beside the chain's; `None` where either is missing.
fn beside(values: &[f64], f64_chain: Option<f64>) -> Option<DeviceAndChain> {
    let device = mean(values)?;
    f64_chain.map(|f64_chain| DeviceAndChain { device, f64_chain })
}

impl RowBead {
    /// Reads a bead's frames and compares them with the chain. `fitted` is the striker's velocity in it, if
    /// it was fitted.
    pub(super) fn read(
        placed: &PlacedBead,
        chain: &RowChain,
        time: &CommonTime,
        fitted: Option<&FittedVelocity>,
    ) -> Result<Self, CompareError> {
        let PlacedBead { bead, received } = placed;
        let echoes = Echoes::of(&chain.scenario, received.json(Part::Truth)?);
        let chain = FullChain::of(&chain.scenario, &chain.solution, *bead)?;
        let mut all: [Vec<f64>; 5] = Default::default();
        let (mut felt, mut flags) = (Vec::new(), BTreeSet::new());
        let (mut address, mut drawn) = (0, 0);
        let each = |strike: &RecordedStrike, comparison: &mut StrikeComparison| {
            address = strike.address;
            let device = &comparison.device;
            let values = [
                Some(device.peak_force),
                comparison.shape.map(|shape| shape.device.width),
                comparison.incident,
                Some(device.absorbed_measured),
                Some(device.absorbed_predicted),
            ];
            all.iter_mut()
                .zip(values)
                .for_each(|(all, value)| all.extend(value));
            flags.extend(&comparison.flags);
            if felt.len() < STRIKES_MOST {
                let mut one = FeltStrike::of(strike, comparison, &chain, time);
                one.traces = one.traces.filter(|_| drawn < DRAWN_MOST);
                drawn += usize::from(one.traces.is_some());
                felt.push(one);
            }
        };
        let compared = ComparedBead::read(received, &chain, echoes, fitted, each)?;
        let (soundness, count, truth) = (compared.soundness, compared.count, chain.truth);
        let is_same = compared.first_difference.is_none() && compared.replay_incomplete.is_none();
        let [peak_force, width, incident, measured, predicted] = &all;
        let of_row = BeadOfRow {
            bead: *bead,
            address,
            strikes: count,
            strikes_left_out: count - felt.len(),
            peak_force: beside(peak_force, Some(truth.peak_force)),
            width: beside(width, chain.pulse.and_then(|pulse| pulse.fwhm)),
            incident: beside(incident, chain.incident()),
            absorbed_measured: beside(measured, Some(truth.absorbed)),
            absorbed_predicted: beside(predicted, Some(truth.absorbed)),
            later_wave: felt.iter().find_map(|felt: &FeltStrike| felt.later),
            spread: compared.spread.into_iter().filter(|_| count > 0).collect(),
            flags: flags.into_iter().collect(),
            replay_identical: (count > 0).then_some(is_same),
            first_difference: compared.first_difference,
            incomplete: soundness.incomplete,
            frames_lost: soundness.lost,
            frames_corrupt: soundness.corrupt,
            overruns: soundness.overruns,
            instructions_per_sample: soundness.instructions.map(|(total, _)| total),
            pass: compared.failure.is_none(),
            failure: compared.failure,
        };
        Ok(Self {
            bead: *bead,
            window: compared.settings.map(|settings| settings.window),
            echoes: compared.echoes,
            compared: of_row,
            chain,
            felt,
        })
    }
}

impl FeltStrike {
    fn of(
        strike: &RecordedStrike,
        comparison: &mut StrikeComparison,
        chain: &FullChain,
        time: &CommonTime,
    ) -> Self {
        let (said, traces) = (&strike.said, comparison.traces.take());
        let inside = strike
            .settings
            .filter(|_| strike.missing() == 0 && !force_railed(strike));
        let signal = inside.and_then(|settings| Signal::of(&strike.scans, &settings));
        let rise = signal.as_ref().and_then(rise);
        let host = time.host(strike, said.trigger_index as f64);
        let start = traces.as_ref().and_then(|traces| traces.force.first());
        let rise_drawn = start.zip(rise).zip(strike.rate());
        Self {
            number: said.strike,
            device: comparison.device,
            incident: comparison.incident,
            struck: host.map(|host| host - chain.front()),
            rise: rise.and_then(|rise| time.common(strike, said.first_index as f64 + rise)),
            rise_drawn: rise_drawn.map(|((start, rise), rate)| start.time + rise / f64::from(rate)),
            later: traces.as_ref().and_then(|traces| later_wave(&traces.force)),
            traces,
        }
    }
}
