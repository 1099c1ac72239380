//! Figure 6: the striker's modulus, speed and size, seen at the first contact, at contact 30 and in the
//! spectrum there.

use std::sync::Arc;

use hertz_chain::{Collision, Pulse, Scenario};
use rayon::prelude::*;

use crate::check::{FigureCheck, checks};
use crate::curve::{dashed, force_over_time, guide, line, time_axis, told_apart};
use crate::error::Error;
use crate::lab::{FigureRun, Lab};
use crate::observe::{
    contact_time, half_power, least_growth, magnitudes, peak, pulse_spectrum, ratio, train,
};
use crate::plan::{Figure, plans};
use crate::setting::{ELASTIC, strike};
use hertz_charts::{Axis, Panel, Series};

const FAR: usize = 30;
const DURATION: f64 = 0.012;

const BY_MODULUS: &str = "45 beads, τ = 0, striker R 4.5 mm, 0.45 m/s, Y = 0.203 to 203 GPa";
const BY_SPEED: &str = "45 beads, τ = 0, striker R 4.5 mm, 203 GPa, 0.1 to 3.2 m/s";
const BY_SIZE: &str = "45 beads, τ = 0, striker 203 GPa, 0.45 m/s, R = 4.5 to 19 mm";

plans! {
    "6a": "force at the striker, by its modulus";
        BY_MODULUS => |lab| forces(lab, &MODULUS, 1, 0.0..0.6e-3, modulus_time),
    "6b": "force at the striker, by its speed";
        BY_SPEED => |lab| forces(lab, &SPEED, 1, 0.0..0.3e-3, speed_time),
    "6c": "force at the striker, by its size";
        BY_SIZE => |lab| forces(lab, &SIZE, 1, 0.0..2.5e-3, size_time),
    "6d": "force at contact 30, by the striker's modulus";
        BY_MODULUS => |lab| forces(lab, &MODULUS, FAR, 6.5e-3..8.5e-3, modulus_force),
    "6e": "force at contact 30, by the striker's speed";
        BY_SPEED => |lab| forces(lab, &SPEED, FAR, 4e-3..10.5e-3, speed_force),
    "6f": "force at contact 30, by the striker's size";
        BY_SIZE => |lab| forces(lab, &SIZE, FAR, 4e-3..9e-3, size_force),
    "6g": "spectrum at contact 30, by the striker's modulus";
        BY_MODULUS => |lab| far_spectrum(lab, &MODULUS, modulus_spectrum),
    "6h": "spectrum at contact 30, by the striker's speed";
        BY_SPEED => |lab| far_spectrum(lab, &SPEED, speed_spectrum),
    "6i": "spectra of the pulses at contact 30, by the striker's size";
        BY_SIZE => |lab| far_spectrum(lab, &SIZE, size_spectrum),
}

/// A change of the striker, and its values.
struct StrikerFamily {
    values: [f64; 4],
    name: fn(f64) -> String,
    set: fn(&mut Scenario, f64),
}

const MODULUS: StrikerFamily = StrikerFamily {
    values: [203e6, 2.03e9, 20.3e9, 203e9],
    name: |young| format!("{} GPa", young / 1e9),
    set: |scenario, young| scenario.striker.young = young,
};
const SPEED: StrikerFamily = StrikerFamily {
    values: [0.1, 0.45, 1.0, 3.2],
    name: |speed| format!("{speed} m/s"),
    set: |scenario, speed| scenario.striker.velocity = speed,
};
const SIZE: StrikerFamily = StrikerFamily {
    values: [0.0045, 0.009, 0.014, 0.019],
    name: |radius| format!("{} mm", radius * 1e3),
    set: |scenario, radius| scenario.striker.radius = radius,
};

impl StrikerFamily {
    fn runs(&self, lab: &Lab) -> Result<Vec<Arc<FigureRun>>, Error> {
        self.values
            .par_iter()
            .map(|&value| {
                let mut scenario = strike(45, ELASTIC, DURATION);
                (self.set)(&mut scenario, value);
                lab.run(&scenario)
            })
            .collect()
    }
}

type Checks = fn(&[Arc<FigureRun>]) -> Vec<FigureCheck>;

fn forces(
    lab: &Lab,
    family: &StrikerFamily,
    contact: usize,
    span: std::ops::Range<f64>,
    checks: Checks,
) -> Result<Figure, Error> {
    let runs = family.runs(lab)?;
    let named = runs.iter().zip(family.values).enumerate();
    let curve = |(place, (run, value)): (usize, (&Arc<FigureRun>, f64))| {
        let force = force_over_time(&run.solution, &span, contact);
        told_apart((family.name)(value), place, force)
    };
    let label = format!("force at contact {contact} (N)");
    let panel = Panel::new(label, named.map(curve).collect());
    Ok(Figure::over(time_axis(span.clone()), vec![panel], checks(&runs)))
}

fn far_spectrum(lab: &Lab, family: &StrikerFamily, checks: Checks) -> Result<Figure, Error> {
    let runs = family.runs(lab)?;
    let pulses: Vec<Vec<Pulse>> = runs.iter().map(|run| train(&run.solution, FAR)).collect();
    let trains = pulses.iter().any(|pulses| pulses.len() > 1);
    let mut curves: Vec<Series> = Vec::new();
    for (place, (run, value)) in runs.iter().zip(family.values).enumerate() {
        for (number, pulse) in pulses[place].iter().take(2).enumerate() {
            let points = magnitudes(&pulse_spectrum(&run.solution, pulse), 3000.0, 1e3);
            let name = (family.name)(value);
            curves.push(match (number, trains) {
                (0, false) => told_apart(name, place, points),
                (0, true) => line(name, place, points),
                _ => dashed("", place, points),
            });
        }
    }
    if trains {
        curves.push(guide("second pulses", Vec::new()));
    }
    let panel = Panel::new("force spectrum (mN·s)", curves).log();
    let axis = Axis::new("frequency (Hz)", 0.0..3000.0);
    Ok(Figure::over(axis, vec![panel], checks(&runs)))
}

fn modulus_time(runs: &[Arc<FigureRun>]) -> Vec<FigureCheck> {
    let factor = contact_time(&runs[0]) / contact_time(&runs[3]);
    let [soft, stiff] = [0, 3].map(|n| Collision::of_striker(runs[n].solution.model()).duration());
    let eq9 = soft / stiff;
    checks![
        // By eq. (9) the contact time of a free bead is proportional to κ^(-2/5).
        "contact time, softest over stiffest": factor => close(eq9, 0.01), paper "a factor 3";
        "highest force of the stiffest", "N": peak(&runs[3], 1) => close(37.460_897, 1e-5);
        "highest force of the softest", "N": peak(&runs[0], 1) => close(10.208_246, 1e-5);
    ]
}

fn speed_time(runs: &[Arc<FigureRun>]) -> Vec<FigureCheck> {
    checks![
        "contact time at 0.1 over that at 3.2 m/s: 32^(1/5)":
            contact_time(&runs[0]) / contact_time(&runs[3]) => close(2.0, 1e-6);
        "highest force at 3.2 over that at 0.1 m/s: 32^(6/5)":
            peak(&runs[3], 1) / peak(&runs[0], 1) => close(64.0, 1e-6);
    ]
}

fn size_time(runs: &[Arc<FigureRun>]) -> Vec<FigureCheck> {
    let times: Vec<f64> = runs.iter().map(|run| contact_time(run)).collect();
    checks![
        // Values of another integrator (symplectic, fourth order, equal steps). The largest striker stays
        // with bead 1 until the wave is back from the far end.
        "contact time, 4.5 mm", "µs": 1e6 * times[0] => close(127.08, 1e-4);
        "contact time, least growth from size to size": least_growth(&times) => close(1.5085, 2e-4);
        "contact time, 19 mm over 4.5 mm": times[3] / times[0] => close(78.974, 2e-4);
    ]
}

fn far_peaks(runs: &[Arc<FigureRun>]) -> Vec<f64> {
    runs.iter().map(|run| peak(run, FAR)).collect()
}

fn modulus_force(runs: &[Arc<FigureRun>]) -> Vec<FigureCheck> {
    let peaks = far_peaks(runs);
    checks![
        "highest force, stiffest striker", "N": peaks[3] => close(7.936_292, 1e-5);
        "highest force, softest striker", "N": peaks[0] => close(7.580_456, 1e-5);
        "greatest over least force, three decades of modulus": ratio(peaks) => at_most(1.06);
    ]
}

fn speed_force(runs: &[Arc<FigureRun>]) -> Vec<FigureCheck> {
    let peaks = far_peaks(runs);
    checks![
        "force at 3.2 over that at 0.1 m/s: 32^(6/5)": peaks[3] / peaks[0] => close(64.0, 1e-6);
    ]
}

fn size_force(runs: &[Arc<FigureRun>]) -> Vec<FigureCheck> {
    let count = |run: &Arc<FigureRun>| train(&run.solution, FAR).len() as f64;
    let pulses: Vec<f64> = runs.iter().map(count).collect();
    checks![
        "pulses from the striker of 4.5 mm": pulses[0] => near(1.0, 0.0);
        "pulses from the striker of 9 mm": pulses[1] => near(1.0, 0.0);
        "pulses from the striker of 14 mm": pulses[2] => near(2.0, 0.0);
        "pulses from the striker of 19 mm": pulses[3] => near(5.0, 0.0);
    ]
}

/// The -3 dB frequency of the first pulse, Hz.
fn frequencies(runs: &[Arc<FigureRun>]) -> Vec<f64> {
    let of_first = |run: &Arc<FigureRun>| {
        let pulses = train(&run.solution, FAR);
        let spectrum = pulses.first().map(|pulse| pulse_spectrum(&run.solution, pulse));
        spectrum.map_or(f64::NAN, |spectrum| half_power(&spectrum))
    };
    runs.iter().map(of_first).collect()
}

fn modulus_spectrum(runs: &[Arc<FigureRun>]) -> Vec<FigureCheck> {
    let frequencies = frequencies(runs);
    checks![
        // Both values are of another integrator.
        "-3 dB frequency, stiffest striker", "Hz": frequencies[3] => close(902.541, 2e-5), paper "some 900 Hz";
        "greatest over least, three decades of modulus": ratio(frequencies) => close(1.007_675, 1e-5);
    ]
}

fn speed_spectrum(runs: &[Arc<FigureRun>]) -> Vec<FigureCheck> {
    let frequencies = frequencies(runs);
    let factor = frequencies[3] / frequencies[0];
    checks![
        "-3 dB frequency at 3.2 over that at 0.1 m/s: 32^(1/5)":
            factor => close(2.0, 5e-3), paper "frequency content only slightly modified";
    ]
}

fn size_spectrum(runs: &[Arc<FigureRun>]) -> Vec<FigureCheck> {
    let scaled: Vec<f64> = frequencies(runs)
        .into_iter()
        .zip(runs)
        .map(|(frequency, run)| frequency / train(&run.solution, FAR)[0].force.powf(1.0 / 6.0))
        .collect();
    checks![
        "-3 dB frequency of the first pulse over F^(1/6), greatest over least":
            ratio(scaled) => at_most(1.05), paper "little effect on the frequency content";
    ]
}
