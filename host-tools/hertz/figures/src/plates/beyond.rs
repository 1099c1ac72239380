//! Figures beyond the paper: rebound, the solitary wave's invariants, exact scaling, and how the error falls
//! with the effort.

use std::sync::Arc;

use hertz_chain::solitary::{KINETIC_SHARE, SPEED_FROM_FORCE, SPEED_FROM_VELOCITY};
use hertz_chain::{
    Accuracy, Collision, ContactForce, Options, PulseSearch, Scenario, Solution, simulate_with,
};
use rayon::prelude::*;

use crate::check::checks;
use crate::curve::{dashed, discs, dotted, force_over_time, geometric, guide, line};
use crate::error::Error;
use crate::lab::{FigureRun, Lab};
use crate::observe::{peak, ratio};
use crate::plan::{Figure, plans};
use crate::setting::{DAMPING, ELASTIC, MASS, STIFFNESS, VISCOUS, intruder, strike, with};
use hertz_charts::{Axis, Panel};

plans! {
    "restitution": "rebound of two viscoelastic spheres against Kuwabara and Kono's theory";
        "steel striker R 4.5 mm at 0.45 m/s on one free bead, τ for α = τ (κ/μ)^(2/5) V^(1/5) from 0.001 to 0.3"
        => restitution,
    "solitary": "speed of the solitary wave against its force";
        "50 beads, τ = 0, striker at 0.05 to 5 m/s, between contacts 30 and 36" => solitary,
    "scaling": "one curve for all speeds: F / V^(6/5) against t V^(1/5)";
        "30 beads, τ = 0, striker at 0.1 to 10 m/s, intruder in bead 8 with k ~ V^(2/5), c ~ V^(1/5)"
        => scaling,
    "convergence": "error against effort";
        "Fig. 2b (16 viscous beads, one intruder) and Fig. 3d (38 elastic beads, none), against a run at 2e-14"
        => convergence,
}

/// Simulated coefficient of restitution, at the relaxation time that gives the collision this `alpha`.
fn rebound(lab: &Lab, alpha: f64, force: ContactForce) -> Result<(Collision, f64), Error> {
    let mut scenario = strike(1, ELASTIC, 0.6e-3);
    scenario.chain.contact_force = force;
    let collision = Collision::of_striker(lab.run(&scenario)?.solution.model());
    scenario.chain.relaxation = alpha / collision.viscosity(1.0);
    let run = lab.run(&scenario)?;
    let end = &run.summary.final_state.velocity;
    Ok((collision, (end[1] - end[0]) / collision.speed))
}

fn restitution(lab: &Lab) -> Result<Figure, Error> {
    let alphas = geometric(1e-3, 0.3, 21);
    let simulated = |force| -> Result<Vec<(f64, f64)>, Error> {
        let one = |&alpha: &f64| Ok((alpha, rebound(lab, alpha, force)?.1));
        alphas.iter().map(one).collect()
    };
    let printed = simulated(ContactForce::Printed)?;
    let clipped = simulated(ContactForce::Clipped)?;
    let (collision, _) = rebound(lab, 1e-3, ContactForce::Printed)?;
    let series = |alpha: f64| collision.restitution(alpha / collision.viscosity(1.0));
    let fine = geometric(1e-3, 0.3, 100).into_iter();
    let curve = fine.map(|alpha| (alpha, series(alpha))).collect();
    let farthest = printed
        .iter()
        .filter(|(alpha, _)| *alpha < 0.05)
        .map(|(alpha, e)| (e - series(*alpha)).abs() / (1e-9 + 1.8 * alpha.powi(5)))
        .fold(0.0, f64::max);
    // With the second and third terms known, the first follows from one weakly viscous collision.
    let (alpha, e) = printed[0];
    let first = (1.0 - e) / alpha + 1.79610 * alpha - 1.76473 * alpha * alpha;
    let checks = checks![
        "first coefficient of e = 1 - C₁ α + C₂ α² - …": first => near(1.730_173, 1e-6);
        "simulated from the series, over its own error 1e-9 + 1.8 α⁵": farthest => at_most(1.0);
    ];
    let curves = vec![
        line("series to α⁴", 0, curve),
        discs("simulated", 1, printed),
        dashed("clipped: never pulling", 2, clipped),
    ];
    let panel = Panel::new("coefficient of restitution", curves);
    let axis = Axis::log("α = τ (κ/μ)^(2/5) V^(1/5)", 1e-3..0.3);
    Ok(Figure::over(axis, vec![panel], checks))
}

fn solitary(lab: &Lab) -> Result<Figure, Error> {
    let mut points = Vec::new();
    let mut invariants = Vec::new();
    let mut unit = f64::NAN;
    for speed in geometric(0.05, 5.0, 7) {
        // Weak waves are slow: time goes as V^(-1/5).
        let mut scenario = strike(50, ELASTIC, 0.011 * (0.45 / speed).powf(0.2));
        scenario.striker.velocity = speed;
        let run = lab.run(&scenario)?;
        let [early, late] = [30, 36].map(|contact| run.solution.pulses(contact, &PulseSearch::default()));
        let (Some(early), Some(late)) = (early.first(), late.first()) else {
            return Err(Error::Missing("no pulse passes contacts 30 and 36".to_owned()));
        };
        let found = run.solution.solitary_invariants(early, late);
        let wave = run.solution.speed(early, late);
        points.push((late.force, wave));
        unit = wave / late.force.powf(1.0 / 6.0) / found.speed_from_force;
        invariants.push(found);
    }
    let through = |factor: f64| -> Vec<(f64, f64)> {
        let speed = |force: f64| factor * unit * force.powf(1.0 / 6.0);
        let forces = geometric(0.3, 300.0, 30).into_iter();
        forces.map(|force| (force, speed(force))).collect()
    };
    let farthest = |of: fn(&hertz_chain::solitary::Invariants) -> f64, expected: f64| {
        let off = invariants.iter().map(|found| of(found) - expected);
        off.fold(0.0_f64, |far, off| if off.abs() > far.abs() { off } else { far }) + expected
    };
    let checks = checks![
        "c / F^(1/6), farthest, κ = M = 1":
            farthest(|found| found.speed_from_force, SPEED_FROM_FORCE) => near(SPEED_FROM_FORCE, 1e-5);
        "c / v^(1/5), farthest, κ = M = 1":
            farthest(|found| found.speed_from_velocity, SPEED_FROM_VELOCITY)
            => near(SPEED_FROM_VELOCITY, 1e-5);
        "kinetic share of the energy, farthest":
            farthest(|found| found.kinetic_share, KINETIC_SHARE) => near(KINETIC_SHARE, 1e-6);
    ];
    let curves = vec![
        line("0.90552 F^(1/6)", 0, through(SPEED_FROM_FORCE)),
        dashed("long waves: √0.8 F^(1/6)", 2, through(0.8_f64.sqrt())),
        discs("simulated", 1, points),
    ];
    let panel = Panel::new("speed of the wave (m/s)", curves).log();
    let axis = Axis::log("highest force (N)", 0.3..300.0);
    Ok(Figure::over(axis, vec![panel], checks))
}

fn scaling(lab: &Lab) -> Result<Figure, Error> {
    const CONTACT: usize = 20;
    const END: f64 = 7e-3;
    let speeds: [f64; 5] = [0.1, 0.3, 1.0, 3.0, 10.0];
    let runs = speeds
        .par_iter()
        .map(|&speed| {
            let mut scenario = strike(30, ELASTIC, END * speed.powf(-0.2));
            scenario.striker.velocity = speed;
            let (stiffness, damping) = (STIFFNESS * speed.powf(0.4), DAMPING * speed.powf(0.2));
            lab.run(&with(scenario, intruder([8], MASS, stiffness, damping)))
        })
        .collect::<Result<Vec<Arc<FigureRun>>, Error>>()?;
    let struck = || runs.iter().zip(speeds);
    let scaled = |(run, speed): (&Arc<FigureRun>, f64)| -> Vec<(f64, f64)> {
        force_over_time(&run.solution, &(0.0..run.solution.end()), CONTACT)
            .into_iter()
            .map(|(time, force)| (time * speed.powf(0.2), force / speed.powf(1.2)))
            .collect()
    };
    let curves: Vec<Vec<(f64, f64)>> = struck().map(scaled).collect();
    let whole = peak(&runs[2], CONTACT);
    let farthest = curves
        .iter()
        .flat_map(|curve| curve.iter().zip(&curves[2]))
        .map(|(one, other)| (one.1 - other.1).abs())
        .fold(0.0, f64::max)
        / whole;
    let per_speed = |of: fn(&FigureRun) -> f64, power: f64| {
        ratio(struck().map(|(run, speed)| of(run) / speed.powf(power))) - 1.0
    };
    let mut series = vec![guide("whole curve, 1 m/s", curves[2].clone())];
    for (place, (curve, speed)) in curves.iter().zip(speeds).enumerate() {
        // A few points of each curve, shifted from curve to curve, so that all curves are seen.
        let some = curve.iter().skip(8 * place).step_by(40).copied().collect();
        series.push(discs(format!("{speed} m/s"), place, some));
    }
    let checks = checks![
        "curves apart, of the highest": farthest => at_most(2e-11);
        "F ~ V^(6/5): highest force at contact 20, greatest over least, less 1":
            per_speed(|run| peak(run, CONTACT), 1.2) => at_most(1e-11);
        "t ~ V^(-1/5): its time, greatest over least, less 1":
            per_speed(|run| run.summary.peak_force[CONTACT - 1].time, -0.2) => at_most(1e-9);
        "E ~ V²: energy absorbed, greatest over least, less 1":
            per_speed(|run| run.summary.energy.dissipated_intruders, 2.0) => at_most(1e-11);
    ];
    let panel = Panel::new("F (V₀/V)^(6/5) (N)", series);
    let axis = Axis::new("t (V/V₀)^(1/5) (ms), V₀ = 1 m/s", 3.0..6.0);
    Ok(Figure::over(axis, vec![panel], checks))
}

/// One effort: evaluations, and the errors of the peak forces, of the energies, and of the energy balance.
struct Effort {
    evaluations: f64,
    force: f64,
    energy: f64,
    balance: f64,
}

fn at(scenario: &Scenario, tolerance: f64, longest_step: f64) -> Result<Solution, Error> {
    let options = Options::with(Accuracy::new(tolerance, longest_step));
    Ok(simulate_with(scenario, &options)?)
}

fn efforts(scenario: &Scenario) -> Result<Vec<Effort>, Error> {
    let truth = at(scenario, 2e-14, 1.0 / 60.0)?.summary();
    let whole = truth.peak_force.iter().map(|peak| peak.force).fold(0.0, f64::max);
    geometric(1e-13, 1e-4, 10)
        .into_par_iter()
        .map(|tolerance| {
            // From the draft's longest step down to the reference's, as the tolerance falls.
            let part = (tolerance / 1e-13).log10() / 5.0;
            let longest = 1.0 / (24.0 - 16.0 * part.min(1.0));
            let summary = at(scenario, tolerance, longest)?.summary();
            // When the run ends, the wave is still in the last contacts.
            let force = summary
                .peak_force
                .iter()
                .zip(&truth.peak_force)
                .map(|(one, other)| (one.force - other.force).abs() / whole)
                .fold(0.0, f64::max);
            let lost = |summary: &hertz_chain::Summary| {
                summary.energy.dissipated_contacts
                    + summary.energy.dissipated_intruders
                    + summary.energy.chain_final
            };
            Ok(Effort {
                evaluations: summary.solver.evaluations as f64,
                force,
                energy: (lost(&summary) / lost(&truth) - 1.0).abs(),
                balance: summary.energy.balance_error,
            })
        })
        .collect()
}

fn convergence(_: &Lab) -> Result<Figure, Error> {
    let intruder = intruder([8], MASS, STIFFNESS, DAMPING);
    let viscous = with(strike(16, VISCOUS, 0.004), intruder);
    let elastic = strike(38, ELASTIC, 0.006);
    let mut panels = Vec::new();
    let mut checks = Vec::new();
    for (name, scenario) in [
        ("16 viscous beads, one intruder", viscous),
        ("38 elastic beads", elastic),
    ] {
        let efforts = efforts(&scenario)?;
        let of = |value: fn(&Effort) -> f64| -> Vec<(f64, f64)> {
            // An error of 0 would have no place on a logarithmic axis.
            let point = |effort: &Effort| (effort.evaluations, value(effort).max(1e-16));
            efforts.iter().map(point).collect()
        };
        let best = &efforts[0];
        checks.extend(checks![
            "{name}: peak forces at 1e-13": best.force => at_most(1e-12);
            "{name}: energies at 1e-13": best.energy => at_most(2e-12);
            "{name}: balance at 1e-13": best.balance => at_most(1e-12);
        ]);
        let curves = [
            dotted("peak forces", 0, of(|effort| effort.force)),
            dotted("energies", 1, of(|effort| effort.energy)),
            dotted("balance", 2, of(|effort| effort.balance)),
        ];
        let panel = Panel::new("relative error", curves.concat())
            .log()
            .range(1e-16, 1e-3);
        let axis = Axis::log(format!("evaluations ({name})"), 3e3..2e4);
        panels.push(panel.height(200).over(axis));
    }
    let axis = Axis::log("evaluations", 3e3..2e4);
    Ok(Figure::over(axis, panels, checks))
}
