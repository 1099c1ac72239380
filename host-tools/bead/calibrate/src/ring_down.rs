//! Ring-downs: stiffness and damping of the intruder from taps on a bead that is free, or held fast.
//!
//! # Design
//! Once a tap is over, the intruder's acceleration dies as exp(-βt), and k = μ (ω² + β²), c = 2 μ β
//! ([`hertz_chain::fit_ring_down`]). μ is m (M - m)/M in a bead that is free, m in one that is held. So k
//! and c share the errors of the masses, and the fit's own errors are correlated, too; the correlations of
//! the results include both. An error of the gain cancels.

use bead_model::layout::BASELINE;
use bead_recording::clock::QUARTZ;
use bead_recording::signal::Signal as BeadSignal;
use bead_recording::strikes::RecordedStrike;
use bead_wire::StrikeFlags;
use hertz_chain::{OscillatorFit, Signal, fit_ring_down};

use crate::calibration::{
    BeadIdentity, Calibration, LeftOut, Observation, ObservedValue, all_samples, because, no_flag,
};
use crate::model::{ModelInput, ResultCorrelation, ResultName, mean_and_scatter, median, propagate};
use crate::quantity::Stated;

/// Least number of taps: one has no scatter.
const FEWEST: usize = 2;
/// Number of taps from which the correlation of k and c comes from their scatter instead of the fits.
const MANY: usize = 8;
/// Samples between the end of the force and the start of the fit.
const AFTER: usize = 8;
/// Least amplitude, as a multiple of the noise of the quiet.
const LOUD: f64 = 30.0;
/// Least duration of the ringing, in units of 1/β.
const LONG: f64 = 2.0;
/// Greatest residual of a fit over its amplitude, and over the noise. A fit is refused if it exceeds both.
const RESIDUAL: f64 = 0.01;
const RESIDUAL_NOISE: f64 = 2.0;
/// Greatest relative deviation of a tap's k from the median of all.
const ODD: f64 = 0.1;

/// A mass, from this calibration or from the settings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StatedMass {
    /// The mass, kg.
    pub mass: Stated,
    /// True if it goes into the settings; false if it came from there.
    pub is_new: bool,
}

/// Quantities that an operator states about ring-downs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RingDownInputs {
    /// m, the intruder.
    pub intruder: StatedMass,
    /// M, the bead with its intruder; `None` for a bead that is held fast.
    pub bead: Option<StatedMass>,
}

/// Name of k, c, m and M as results.
pub const STIFFNESS: ResultName = ResultName {
    name: "stiffness k",
    unit: "N/m",
    key: Some("intruder.stiffness"),
    uncertainty_key: Some("uncertainty.stiffness"),
};
/// See [`STIFFNESS`].
pub const DAMPING: ResultName = ResultName {
    name: "damping c",
    unit: "N·s/m",
    key: Some("intruder.damping"),
    uncertainty_key: Some("uncertainty.damping"),
};

/// The intruder's mass as a result, or as an input that correlations name.
pub fn intruder_mass(is_new: bool) -> ResultName {
    ResultName {
        name: "intruder mass m",
        unit: "kg",
        key: is_new.then_some("intruder.mass"),
        uncertainty_key: is_new.then_some("uncertainty.intruder_mass"),
    }
}

/// Sets the keys of the correlations of k, c and m.
pub fn key_correlations(correlations: &mut [ResultCorrelation]) {
    let keys = [
        (STIFFNESS.name, DAMPING.name, "uncertainty.stiffness_with_damping"),
        (
            STIFFNESS.name,
            "intruder mass m",
            "uncertainty.stiffness_with_mass",
        ),
        (DAMPING.name, "intruder mass m", "uncertainty.damping_with_mass"),
    ];
    for one in correlations {
        let found = keys.iter().find(|(a, b, _)| one.results == [*a, *b]);
        one.key = found.map(|(.., key)| *key);
    }
}

struct Tap {
    subject: String,
    fit: OscillatorFit,
    /// m/s².
    amplitude: f64,
    /// Hz.
    frequency: f64,
}

/// Evaluates taps: recordings by name, with their strikes.
///
/// # Errors
/// One line: too few taps, or masses that do not belong together.
pub fn evaluate(
    recordings: &[(String, Vec<RecordedStrike>)],
    stated: &RingDownInputs,
) -> Result<Calibration, String> {
    let m = stated.intruder.mass.value;
    let reduced = match stated.bead {
        Some(bead) if bead.mass.value <= m => {
            return Err(
                "the intruder is not lighter than the bead; M is the mass of the bead with its intruder"
                    .to_owned(),
            );
        }
        Some(bead) => m * (bead.mass.value - m) / bead.mass.value,
        None => m,
    };
    let (mut taps, mut left_out) = (Vec::new(), Vec::new());
    for (recording, strikes) in recordings {
        for (number, strike) in strikes.iter().enumerate() {
            let subject = format!("{recording}, tap {number}");
            match tap(&subject, strike, reduced) {
                Ok(tap) => taps.push(tap),
                Err(why) => left_out.push(LeftOut { subject, why }),
            }
        }
    }
    let stiffnesses: Vec<f64> = taps.iter().map(|tap| tap.fit.stiffness).collect();
    let middle = median(&stiffnesses).unwrap_or(0.0);
    let (kept, odd): (Vec<Tap>, Vec<Tap>) = taps
        .into_iter()
        .partition(|tap| (tap.fit.stiffness / middle - 1.0).abs() < ODD);
    left_out.extend(odd.into_iter().map(|tap| LeftOut {
        why: format!(
            "its k differs from the others' by {:+.0} %: something else touched the bead",
            100.0 * (tap.fit.stiffness / middle - 1.0)
        ),
        subject: tap.subject,
    }));
    if kept.len() < FEWEST {
        let why = because(&left_out);
        return Err(format!(
            "{} of the taps can be used, but at least {FEWEST} are needed{why}; record more, ten for a good \
             mean",
            kept.len()
        ));
    }
    let (results, correlations) = combine(stated, &kept);
    let strikes = || recordings.iter().flat_map(|(_, strikes)| strikes);
    Ok(Calibration {
        procedure: "ring-down",
        title: "Stiffness and damping by ring-down",
        bead: strikes().next().map(BeadIdentity::of),
        results,
        correlations,
        observations: kept.iter().map(observed).collect(),
        left_out,
        method: METHOD.map(str::to_owned).to_vec(),
        // The gains, and with them the supply, cancel.
        ..Calibration::default()
    })
}

const METHOD: [&str; 2] = [
    "The bead is tapped. Once the force on its cap has ended, exp(−βt)(A cos ωt + B sin ωt) is fitted to the acceleration \
     of the intruder by least squares; k = μ (ω² + β²) and c = 2 μ β. μ is m (M − m)/M in a bead that is free, m in one \
     that is held fast.",
    "The results are the means over the taps. A constant error of the gain drops out. Nothing else may touch the bead \
     while it rings.",
];

/// The tap of a strike.
fn tap(subject: &str, strike: &RecordedStrike, reduced: f64) -> Result<Tap, String> {
    all_samples(strike)?;
    let spoilt = [
        StrikeFlags::ACCELERATION_RAILED,
        StrikeFlags::SENSOR_END,
        StrikeFlags::ANOTHER_WAVE,
        StrikeFlags::WINDOW_CUT,
    ];
    no_flag(strike, &spoilt, "tap more softly, and only once")?;
    let signal = strike
        .settings
        .and_then(|settings| BeadSignal::of(&strike.scans, &settings));
    let (Some(signal), Some(rate)) = (signal, strike.rate()) else {
        return Err(
            "it came without settings, so its samples have no units; record from the bead's start".to_owned(),
        );
    };
    let baseline = usize::from(BASELINE).min(signal.force.len());
    let end = force_end(&signal.force, baseline);
    let values = signal.acceleration.get(end + AFTER..).unwrap_or_default();
    let noise = mean_and_scatter(&signal.acceleration[..baseline]).1;
    let amplitude = values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    if amplitude < LOUD * noise {
        return Err(format!(
            "it rings with {amplitude:.2} m/s², less than {LOUD} times the noise of {noise:.2}; tap harder"
        ));
    }
    let ringing = Signal {
        start: 0.0,
        interval: 1.0 / f64::from(rate),
        values: values.to_vec(),
    };
    let fit = fit_ring_down(&ringing, reduced).map_err(|error| error.to_string())?;
    let beta = 0.5 * fit.damping / reduced;
    let lasts = ringing.interval * values.len() as f64;
    if lasts * beta < LONG {
        return Err(format!(
            "the window ends {:.1} ms after the tap, and the ringing decays in {:.1} ms; make capture.length longer, or \
             tap more briefly",
            1e3 * lasts,
            1e3 / beta
        ));
    }
    if fit.residual > RESIDUAL * amplitude && fit.residual > RESIDUAL_NOISE * noise {
        return Err(format!(
            "its ringing is not a single decaying sine: {:.1} % is left after the fit; let nothing touch the \
             bead while it rings",
            100.0 * fit.residual / amplitude
        ));
    }
    let omega = (fit.stiffness / reduced - beta * beta).max(0.0).sqrt();
    Ok(Tap {
        subject: subject.to_owned(),
        fit,
        amplitude,
        frequency: omega / std::f64::consts::TAU,
    })
}

/// First sample after the force has ended.
fn force_end(force: &[f64], baseline: usize) -> usize {
    let noise = mean_and_scatter(&force[..baseline]).1;
    let peak = force.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    let limit = f64::max(5.0 * noise, 0.005 * peak);
    let acts = |pair: &[f64]| pair.iter().all(|value| value.abs() > limit);
    let last = force.windows(2).rposition(acts);
    last.map_or(baseline, |last| last + 2)
}

/// Indices of the inputs.
const MASS: usize = 0;
const HOST: usize = 1;
const CLOCK_RATE: usize = 2;
const OF_STIFFNESS: usize = 3;
const OF_DAMPING: usize = 4;

fn combine(
    stated: &RingDownInputs,
    kept: &[Tap],
) -> (Vec<crate::model::CalibrationResult>, Vec<ResultCorrelation>) {
    let of = |value: fn(&OscillatorFit) -> f64| kept.iter().map(|tap| value(&tap.fit)).collect::<Vec<_>>();
    let (stiffnesses, dampings) = (of(|fit| fit.stiffness), of(|fit| fit.damping));
    let [(k, k_scatter), (c, c_scatter)] = [&stiffnesses, &dampings].map(|values| mean_and_scatter(values));
    let count = kept.len();
    let together = if count < MANY {
        kept.iter().map(|tap| tap.fit.correlation).sum::<f64>() / count as f64
    } else {
        let products = stiffnesses.iter().zip(&dampings).map(|(a, b)| (a - k) * (b - c));
        products.sum::<f64>() / ((count - 1) as f64 * k_scatter * c_scatter).max(f64::MIN_POSITIVE)
    };
    let m = stated.intruder.mass;
    let host = stated
        .bead
        .map_or(Stated { value: 1.0, u: 0.0 }, |bead| bead.mass);
    let is_free = stated.bead.is_some();
    let free = count as f64 - 1.0;
    let named = |name: &str, scatter: f64| ModelInput {
        name: format!("repeatability of {name}, {count} taps"),
        ..ModelInput::repeatability(scatter, count, free)
    };
    let inputs = [
        ModelInput::normal("intruder mass m", "kg", m.value, m.u),
        ModelInput::normal(
            if is_free { "bead mass M" } else { "bead held fast" },
            if is_free { "kg" } else { "" },
            host.value,
            host.u,
        ),
        ModelInput::within("sample clock", "", 1.0, QUARTZ),
        named("k", k_scatter / k),
        named("c", c_scatter / c),
    ];
    let correlated = [(OF_STIFFNESS, OF_DAMPING, together.clamp(-1.0, 1.0))];
    let reduced = |m: f64, host: f64| if is_free { m * (host - m) / host } else { m };
    let nominal = reduced(m.value, host.value);
    let model = |values: &[f64]| {
        let mass = reduced(values[MASS], values[HOST]) / nominal;
        let clock = values[CLOCK_RATE];
        let mut results = vec![
            k * mass / (clock * clock) * values[OF_STIFFNESS],
            c * mass / clock * values[OF_DAMPING],
            values[MASS],
        ];
        results.extend(is_free.then_some(values[HOST]));
        results
    };
    let mut names = vec![STIFFNESS, DAMPING, intruder_mass(stated.intruder.is_new)];
    names.extend(stated.bead.map(|bead| ResultName {
        name: "bead mass M",
        unit: "kg",
        key: bead.is_new.then_some("bead.mass"),
        uncertainty_key: bead.is_new.then_some("uncertainty.bead_mass"),
    }));
    let (results, mut correlations) = propagate(&names, &inputs, &correlated, model);
    key_correlations(&mut correlations);
    correlations.retain(|one| one.key.is_some());
    (results, correlations)
}

fn observed(tap: &Tap) -> Observation {
    let fit = &tap.fit;
    Observation {
        subject: tap.subject.clone(),
        values: vec![
            ObservedValue::new("amplitude", "m/s²", tap.amplitude),
            ObservedValue::new("frequency", "Hz", tap.frequency),
            ObservedValue::new("residual", "m/s²", fit.residual),
            ObservedValue::new("c", "N·s/m", fit.damping),
            ObservedValue::new("u of c", "N·s/m", fit.damping_error),
            ObservedValue::new("u of k", "N/m", fit.stiffness_error),
            ObservedValue::new("k", "N/m", fit.stiffness),
        ],
    }
}
