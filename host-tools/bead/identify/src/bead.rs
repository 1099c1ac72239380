//! One bead, from its strikes in recordings to its quantities.

use bead_model::design::{Description, Uncertainty};
use bead_recording::beads::GatheredBead;
use bead_recording::strikes::{LeftOut, RecordedStrike};
use bead_wire::StrikeFlags as Flags;
use hertz_chain::Scenario;
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

use crate::chain::ChainOfScenario;
use crate::chain_runs::ChainRuns;
use crate::chain_strike::ChainStrike;
use crate::identified::{Candidate, Identified, Wanted, identify};
use crate::method::Method;
use crate::model::{SignalSample, StrikeModel};
use crate::noise::Noise;
use crate::pair::Tap;
use crate::picture;
use crate::quantity::{Quantity, Values};
use crate::report::{About, BeadResult, NoiseResult, QuantityResult};
use crate::ring_down::{Mounting, RingDown};
use crate::series::{CHANNELS, StrikeSeries, noises};
use crate::settings;
use crate::table::channel_name;

/// Young's modulus where no scenario states one: a ringing does not depend on it.
const NO_MODULUS: f64 = 1.0;
/// Flags of strikes whose samples no model describes.
const SPOILED: Flags = Flags::FORCE_RAILED
    .with(Flags::ACCELERATION_RAILED)
    .with(Flags::WINDOW_CUT)
    .with(Flags::ANOTHER_WAVE)
    .with(Flags::SENSOR_END)
    .with(Flags::SENSOR_FAULT)
    .with(Flags::SENSOR_STILL)
    .with(Flags::PLAYED);

/// Request to identify all beads of the recordings.
#[derive(Debug, Clone)]
pub struct Request<'a> {
    /// The data and their model.
    pub method: Method,
    /// Support of the bead while it rings.
    pub mounting: Mounting,
    /// Quantities to fit; empty for those of the method.
    pub fit: Vec<Quantity>,
    /// The chain; [`Method::Chain`] needs one.
    pub scenario: Option<&'a Scenario>,
    /// Place of the bead in the chain; by default its address, or the only bead with an intruder.
    pub place: Option<usize>,
    /// Uncertainties of the held quantities; by default those of the settings.
    pub stated: Option<Uncertainty>,
    /// Quantities at which the fit begins; by default those of the settings.
    pub from: Option<Description>,
    /// Names of the recordings.
    pub names: &'a [String],
    /// True if a picture is wanted.
    pub draws: bool,
    /// True if the samples of the strikes are wanted.
    pub samples: bool,
}

/// A strike that has signals.
#[derive(Debug)]
pub struct TakenStrike {
    /// Place of its recording.
    pub recording: usize,
    /// Number, as its bead counts.
    pub number: u32,
    /// Its samples.
    pub series: StrikeSeries,
}

/// A bead with those of its strikes that have signals.
pub type BeadStrikes = GatheredBead<Vec<TakenStrike>>;

/// Adds a strike of recording `recording` to those of its bead. A strike that is flagged as spoiled is left
/// out unless `doubtful`.
pub fn take(bead: &mut BeadStrikes, recording: (usize, &str), strike: &RecordedStrike, doubtful: bool) {
    let (place, name) = recording;
    let number = strike.said.strike;
    let spoiled = Flags::from_bits(strike.said.flags.bits() & SPOILED.bits());
    let series = if spoiled == Flags::NONE || doubtful {
        StrikeSeries::of(strike)
    } else {
        let names: Vec<_> = spoiled.names().collect();
        Err(format!("it is flagged: {}", names.join(", ")))
    };
    match series {
        Ok(series) => bead.gathered.push(TakenStrike {
            recording: place,
            number,
            series,
        }),
        Err(why) => bead.left_out.push(LeftOut {
            recording: name.to_owned(),
            strike: number,
            why,
        }),
    }
}

/// A bead with its quantities.
#[derive(Debug)]
pub struct IdentifiedBead {
    /// The result.
    pub result: BeadResult,
    /// The settings with what was identified.
    pub description: Description,
    /// The loudest strike before and after the fit, as SVG.
    pub svg: Option<String>,
    /// Samples of each used strike.
    pub samples: Vec<Vec<SignalSample>>,
}

/// A bead of which nothing can be identified.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BeadError {
    /// No strike is usable.
    #[error("{}", nothing(*.address, .left_out))]
    NoStrike {
        /// Address of the bead.
        address: u8,
        /// Strikes without signals.
        left_out: Vec<LeftOut>,
    },
    /// The chain or the fit has no solution.
    #[error("{0}")]
    Unfit(String),
}

fn nothing(address: u8, left_out: &[LeftOut]) -> String {
    LeftOut::line(address, left_out).unwrap_or_else(|| format!("bead {address}: no strike was chosen"))
}

/// Identifies one bead.
///
/// # Errors
/// No strike of the bead is usable, the scenario has no such bead, or the fit does not converge.
pub fn identify_bead(request: &Request<'_>, bead: &BeadStrikes) -> Result<IdentifiedBead, BeadError> {
    let no_strike = |left_out: &[LeftOut]| BeadError::NoStrike {
        address: bead.address,
        left_out: left_out.to_vec(),
    };
    let last = bead.gathered.last().ok_or_else(|| no_strike(&bead.left_out))?;
    let description = request.from.unwrap_or(last.series.description);
    let noises = noises(bead.gathered.iter().map(|strike| &strike.series));
    let chain = request.scenario.filter(|_| request.method == Method::Chain);
    let chain = chain.map(|scenario| ChainOfScenario::of_bead(scenario, request.place, bead.address));
    let chain = chain.transpose().map_err(BeadError::Unfit)?;
    let start = chain.as_ref().map_or_else(
        || settings::values(&description, NO_MODULUS),
        ChainOfScenario::values,
    );
    let (candidates, mut out) = candidates(request, bead, chain.as_ref(), &noises, &start);
    let mut left_out = bead.left_out.clone();
    left_out.append(&mut out);
    if candidates.is_empty() {
        return Err(no_strike(&left_out));
    }
    let stated = request.stated.or(description.uncertainty);
    let wanted = wanted(request, stated.as_ref(), &noises, start);
    let found = identify(&candidates, &wanted);
    let found = found.map_err(|error| BeadError::Unfit(format!("bead {}: {error}", bead.address)))?;
    let about = About {
        address: bead.address,
        uid: bead.uid(),
        noise: noise_results(&noises),
        left_out,
    };
    let result = BeadResult::new(&found, &candidates, &wanted, about);
    let before = Description {
        uncertainty: stated,
        ..description
    };
    made_of(request, (&found, &wanted), result, &before, chain.as_ref()).map_err(BeadError::Unfit)
}

fn wanted(
    request: &Request<'_>,
    stated: Option<&Uncertainty>,
    noises: &[Option<Noise>; 4],
    start: Values,
) -> Wanted {
    let mut free = request.fit.clone();
    if free.is_empty() {
        free = request.method.usual();
    }
    // A ringing does not use the force.
    let of_ringing = request.method == Method::RingDown;
    let used = CHANNELS
        .into_iter()
        .filter(|channel| !of_ringing || !channel.is_force())
        .filter_map(|channel| noises[channel.place()].as_ref());
    Wanted {
        start,
        free,
        stated: settings::stated(stated),
        noise_free: used.map(Noise::free).sum(),
        recordings: request.names.to_vec(),
    }
}

fn noise_results(noises: &[Option<Noise>; 4]) -> Vec<NoiseResult> {
    let noise = CHANNELS.into_iter().filter_map(|channel| {
        let noise = noises[channel.place()].as_ref()?;
        Some(NoiseResult {
            channel: channel_name(channel),
            deviation: noise.deviation(),
            order: noise.order(),
        })
    });
    noise.collect()
}

fn made_of(
    request: &Request<'_>,
    (found, wanted): (&Identified<'_>, &Wanted),
    result: BeadResult,
    before: &Description,
    chain: Option<&ChainOfScenario>,
) -> Result<IdentifiedBead, String> {
    let known = |quantity: Quantity| {
        let of = |one: &&QuantityResult| one.quantity == quantity;
        let one = result.quantities.iter().find(of);
        one.is_some_and(|one| one.relative_uncertainty.is_some())
    };
    let description = settings::identified(before, found, chain, known)?;
    let svg = request.draws.then(|| picture::svg(found, wanted)).transpose()?;
    let strikes = found.best.strikes.iter().filter(|_| request.samples);
    let samples = strikes.map(|strike| strike.model.samples(&found.best.values, &strike.own));
    let samples = samples.collect::<Result<_, _>>()?;
    Ok(IdentifiedBead {
        result,
        description,
        svg,
        samples,
    })
}

/// The models of the strikes, and the strikes without a model.
fn candidates(
    request: &Request<'_>,
    bead: &BeadStrikes,
    chain: Option<&ChainOfScenario>,
    noises: &[Option<Noise>; 4],
    start: &Values,
) -> (Vec<Candidate>, Vec<LeftOut>) {
    let runs = chain.map(|chain| ChainRuns::new(chain.clone()));
    let model = |strike: &TakenStrike| -> Result<Box<dyn StrikeModel + Send>, String> {
        Ok(match (&runs, request.method) {
            (Some(runs), _) => Box::new(ChainStrike::new(runs, &strike.series, noises, start)?),
            (None, Method::Pairs) => Box::new(Tap::new(&strike.series, noises)?),
            (None, _) => Box::new(RingDown::new(&strike.series, noises, start, request.mounting)?),
        })
    };
    let models: Vec<_> = bead.gathered.par_iter().map(model).collect();
    let (mut candidates, mut left_out) = (Vec::new(), Vec::new());
    for (strike, model) in bead.gathered.iter().zip(models) {
        match model {
            Ok(model) => candidates.push(Candidate {
                recording: strike.recording,
                number: strike.number,
                model,
            }),
            Err(why) => left_out.push(LeftOut {
                recording: request.names[strike.recording].clone(),
                strike: strike.number,
                why,
            }),
        }
    }
    (candidates, left_out)
}
