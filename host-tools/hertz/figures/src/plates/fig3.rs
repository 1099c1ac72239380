//! Figure 3: how much energy the intruder takes, by its stiffness. 38 elastic beads, intruder in bead 8.

use std::f64::consts::TAU;
use std::sync::Arc;

use hertz_chain::{Energies, Snapshot};

use crate::check::checks;
use crate::curve::{dashed, guide, line, over_time, time_axis, told_apart};
use crate::error::Error;
use crate::lab::{FigureRun, Lab};
use crate::observe::{greatest, half_power, magnitudes, spectrum};
use crate::plan::{Figure, plans};
use crate::setting::{AS_PRINTED, DAMPING, ELASTIC, MASS, intruder, strike, with};
use hertz_charts::{Axis, Panel};

const HOST: usize = 8;
const DURATION: f64 = 0.006;
/// The darkest colour of a family of curves: the paper's black.
const BLACK: usize = 6;
const STIFFNESSES: [f64; 3] = [1e3, 1e5, 1e7];

const SETTING: &str = "38 beads, τ = 0, intruder m 3.7 g, c 12 N·s/m in bead 8";

plans! {
    "3a": "motion of host and intruder, k = 10³ N/m"; SETTING => |lab| motion(lab, 0),
    "3b": "motion of host and intruder, k = 10⁵ N/m"; SETTING => |lab| motion(lab, 1),
    "3c": "motion of host and intruder, k = 10⁷ N/m"; SETTING => |lab| motion(lab, 2),
    "3d": "energy of the chain for three stiffnesses, and the share of the striker's energy that enters it";
        "38 beads, τ = 0, no intruder and k = 10³, 10⁵, 10⁷ N/m in bead 8; E_T as printed, with M for the host"
        => energy,
    "3e": "spectrum of the incident pulse over the intruder's responses";
        "38 beads, τ = 0, force at contact 8 without intruder; responses by eq. A1" => responses,
}

fn plain(lab: &Lab) -> Result<Arc<FigureRun>, Error> {
    lab.run(&strike(38, ELASTIC, DURATION))
}

fn run(lab: &Lab, stiffness: f64) -> Result<Arc<FigureRun>, Error> {
    let intruder = intruder([HOST], MASS, stiffness, DAMPING);
    lab.run(&with(strike(38, ELASTIC, DURATION), intruder))
}

/// Lead of the intruder over its host, m.
fn overshoot(run: &FigureRun) -> f64 {
    let ahead = |at: &Snapshot<'_>| at.intruder_displacement(HOST).unwrap_or(f64::NAN);
    greatest(&over_time(&run.solution, 0.0..DURATION, ahead))
}

fn motion(lab: &Lab, which: usize) -> Result<Figure, Error> {
    let runs = STIFFNESSES.map(|stiffness| run(lab, stiffness));
    let runs = runs.into_iter().collect::<Result<Vec<_>, _>>()?;
    let [soft, medium, stiff] = [0, 1, 2].map(|n| 1e6 * overshoot(&runs[n]));
    let this = &runs[which];
    let span = 1.2e-3..3.6e-3;
    let of = |intruder: bool| {
        over_time(&this.solution, span.clone(), |at| {
            let ahead = at.intruder_displacement(HOST).unwrap_or(f64::NAN);
            1e6 * (at.displacement(HOST) + if intruder { ahead } else { 0.0 })
        })
    };
    let checks = match which {
        0 => {
            let lag = 1e6 * this.summary.intruders[0].relative_displacement_max;
            checks![
                "intruder falls behind its soft-sprung host by", "µm": lag => at_least(6.4);
                "overshoot, of that at k = 10⁵": soft / medium => at_most(0.09);
            ]
        }
        1 => checks![
            "overshoot, of that at k = 10³": medium / soft => at_least(12.0);
            "overshoot, of that at k = 10⁷": medium / stiff => at_least(80.0);
        ],
        _ => {
            // A stiff spring carries the intruder along: x = -m a / k, as in statics.
            let summary = &this.summary.intruders[0];
            let expected = summary.acceleration_max.max(-summary.acceleration_min) * MASS / STIFFNESSES[2];
            let seen = summary.relative_displacement_max;
            checks![
                "relative displacement, against m a / k", "nm": 1e9 * seen => close(1e9 * expected, 2e-4);
                "overshoot, of that at k = 10⁵": stiff / medium => at_most(0.0125);
            ]
        }
    };
    // On the stiff spring both move as one: dashes let the host be seen under its intruder.
    let curves = vec![line("host", 0, of(false)), dashed("intruder", 1, of(true))];
    let panel = Panel::new("displacement (µm)", curves);
    Ok(Figure::over(time_axis(span.clone()), vec![panel], checks))
}

fn energy(lab: &Lab) -> Result<Figure, Error> {
    let plain = plain(lab)?;
    let span = 1.2e-3..4.5e-3;
    let of_chain = |at: &Snapshot<'_>| 1e6 * at.energies().chain_as_printed;
    let micro = |run: &FigureRun| over_time(&run.solution, span.clone(), of_chain);
    let mut curves = vec![guide("no intruder", micro(&plain))];
    let mut losses = Vec::new();
    for (place, stiffness) in STIFFNESSES.into_iter().enumerate() {
        let run = run(lab, stiffness)?;
        let name = format!("k = 10{} N/m", ["³", "⁵", "⁷"][place]);
        curves.push(told_apart(name, place, micro(&run)));
        let before = plain.summary.energy.chain_final;
        losses.push(100.0 * run.summary.energy.dissipated_intruders / before);
    }
    let start = plain.summary.energy.striker_initial;
    let share = |of: fn(Energies) -> f64| {
        let percent = |at: &Snapshot<'_>| 100.0 * of(at.energies()) / start;
        over_time(&plain.solution, 0.0..0.4e-3, percent)
    };
    let shares = vec![
        line("chain", 4, share(|e| e.chain)),
        line("striker", 5, share(|e| e.striker)),
    ];
    let injected = 100.0 * plain.summary.energy.chain_final / start;
    let checks = checks![
        "absorbed for good at k = 10⁵", "%": losses[1] => close(4.79, 2e-3);
        "absorbed for good at k = 10⁷", "%": losses[2] => at_most(1e-3);
        "absorbed for good at k = 10³, of that at 10⁵": losses[0] / losses[1] => at_most(0.6);
        "of the striker's energy into the chain", "%": injected => close(21.2, 1e-3);
    ];
    let chain = Panel::new("energy of the chain (µJ)", curves).note(AS_PRINTED);
    let chain = chain.over(time_axis(span.clone()));
    let injection = Panel::new("share of the energy (%)", shares).height(180);
    let panels = vec![chain, injection.over(time_axis(0.0..0.4e-3))];
    Ok(Figure::over(time_axis(span.clone()), panels, checks))
}

fn responses(lab: &Lab) -> Result<Figure, Error> {
    let plain = plain(lab)?;
    let pulse = spectrum(&plain.solution, HOST, 0.0..4e-3);
    let half = half_power(&pulse);
    let impulse = pulse.values()[0].norm();
    let frequencies: Vec<f64> = (0..=300).map(|n| f64::from(n) * 10.0).collect();
    let mut curves = vec![line("pulse", BLACK, magnitudes(&pulse, 3000.0, 1.0 / impulse))];
    for (place, stiffness) in STIFFNESSES.into_iter().enumerate() {
        let points = frequencies.iter().map(|frequency| {
            let omega = TAU * frequency;
            let (spring, damper) = (stiffness, omega * DAMPING);
            let left = f64::hypot(spring - MASS * omega * omega, damper);
            (*frequency, f64::hypot(spring, damper) / left)
        });
        let name = format!("k = 10{} N/m", ["³", "⁵", "⁷"][place]);
        curves.push(told_apart(name, place, points.collect()));
    }
    let resonance = (STIFFNESSES[1] / MASS).sqrt() / TAU;
    let checks = checks![
        // Values of another integrator (symplectic, fourth order, equal steps).
        "pulse down by 3 dB at", "Hz": half => close(909.390, 2e-5), paper "some 900 Hz";
        "resonance at k = 10⁵, of that frequency": resonance / half => at_most(1.0);
    ];
    let panel = Panel::new("response, pulse (relative)", curves);
    let panels = vec![panel.log().range(1e-2, 10.0)];
    let axis = Axis::new("frequency (Hz)", 0.0..3000.0);
    Ok(Figure::over(axis, panels, checks))
}
