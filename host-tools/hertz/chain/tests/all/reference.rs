//! Every case of an independent program's converged results, `data/chain_cases.json`.
//!
//! That program is SciPy's DOP853 at a relative tolerance of 1e-13 over a right-hand side of its own. Its
//! states and energies repeat from one step sequence to another within the `rel_check` of each case, 2.4e-9
//! at worst, and this crate's within 1e-10, so the distances below are mostly the reference's.
//!
//! Some of its numbers were read off *samples* of its motion: peaks of force from the parabola through the
//! greatest sample and its neighbours, widths between straight lines, greatest energies and accelerations
//! from the samples as they are. The tests read them off the same samples of this crate's motion, every 0.1
//! µs in runs of up to 4 ms and every 0.2 µs in longer ones, and hold the summary against these to the error
//! of sampling.
//!
//! The last three contacts of the long chains carry a rising force when the run ends, and the peak of 10 µs
//! that the reference lists there is none. The last pulse's width of some runs is likewise beyond the end.

use std::collections::BTreeMap;

use crate::common::run;
use hertz_chain::{
    Chain, ContactForce, Energies, Intruder, Oscillator, Scenario, Solution, Striker, Summary,
};
use serde_json::{Map, Value};

fn cases() -> Map<String, Value> {
    let mut cases: Map<String, Value> =
        serde_json::from_str(include_str!("data/chain_cases.json")).expect("the file is JSON");
    cases.remove("_about");
    assert_eq!(cases.len(), 13);
    cases
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("{key} is a number"))
}

fn numbers(value: &Value, key: &str) -> Vec<f64> {
    let list = value[key].as_array().unwrap_or_else(|| panic!("{key} is a list"));
    list.iter()
        .map(|item| item.as_f64().expect("an item of a list is a number"))
        .collect()
}

/// Young's moduli and the striker's density are the paper's, as the file's stiffnesses and masses prove.
fn scenario(name: &str, case: &Value) -> Scenario {
    let p = &case["params"];
    let [hosts, k, c, m] = ["hosts_idx", "k", "c", "m"].map(|key| numbers(p, key));
    let intruder = |i: usize| Intruder::new([hosts[i] as usize], Oscillator::new(m[i], k[i], c[i]));
    let mut scenario = Scenario::new(number(p, "T_end"), Chain::PAPER, Striker::PAPER);
    name.clone_into(&mut scenario.title);
    let chain = &mut scenario.chain;
    chain.beads = number(p, "N_chain_beads") as usize;
    chain.radius = number(p, "R");
    chain.density = number(p, "rho");
    chain.poisson = number(p, "nu");
    chain.relaxation = number(p, "tau");
    if p["clip_contact_force"].as_bool().expect("a flag") {
        chain.contact_force = ContactForce::Clipped;
    }
    let striker = &mut scenario.striker;
    striker.radius = p["Rs"].as_f64().unwrap_or(striker.radius);
    striker.young = p["Ys"].as_f64().unwrap_or(striker.young);
    striker.velocity = number(p, "V_s");
    scenario.intruders = (0..hosts.len()).map(intruder).collect();
    scenario
}

/// The worst distance of each kind of quantity.
#[derive(Default)]
struct Distances(BTreeMap<&'static str, f64>);

impl Distances {
    /// Compares with the reference, as a part of `scale`.
    fn see(&mut self, kind: &'static str, ours: f64, theirs: f64, scale: f64) {
        let distance = (ours - theirs).abs() / scale;
        let worst = self.0.entry(kind).or_default();
        assert!(distance.is_finite(), "{kind}: {ours} against {theirs}");
        *worst = worst.max(distance);
    }

    /// Compares lists as parts of the greatest magnitude in the reference's.
    fn see_all(&mut self, kind: &'static str, ours: &[f64], theirs: &[f64]) {
        assert_eq!(ours.len(), theirs.len());
        let scale = theirs.iter().copied().map(f64::abs).fold(0.0, f64::max);
        for (ours, theirs) in ours.iter().zip(theirs) {
            // Zeros must be zeros.
            self.see(kind, *ours, *theirs, scale.max(f64::MIN_POSITIVE));
        }
    }
}

/// The motion at equal intervals, as the reference has it.
struct SampledMotion {
    interval: f64,
    /// Of every contact, from 1, at index 0.
    forces: Vec<Vec<f64>>,
    chain_energy: Vec<f64>,
    /// Of every intruder.
    accelerations: Vec<Vec<f64>>,
}

/// A peak read off samples.
struct SampledPeak {
    force: f64,
    time: f64,
    fwhm: Option<f64>,
}

impl SampledMotion {
    fn of(solution: &Solution) -> Self {
        let interval = if solution.end() <= 0.004 { 1e-7 } else { 2e-7 };
        let count = (solution.end() / interval).round() as usize;
        let model = solution.model();
        let mut samples = Self {
            interval: solution.end() / count as f64,
            forces: vec![Vec::with_capacity(count + 1); model.contacts()],
            chain_energy: Vec::with_capacity(count + 1),
            accelerations: vec![Vec::with_capacity(count + 1); model.intruders().len()],
        };
        let mut sampler = solution.sampler();
        for i in 0..=count {
            let snapshot = sampler.at((i as f64 * samples.interval).min(solution.end()));
            for (forces, contact) in samples.forces.iter_mut().zip(1..) {
                forces.push(snapshot.force(contact));
            }
            samples.chain_energy.push(snapshot.energies().chain_as_printed);
            for (accelerations, intruder) in samples.accelerations.iter_mut().zip(model.intruders()) {
                let acceleration = snapshot.intruder_acceleration(intruder.bead);
                accelerations.push(acceleration.expect("a host"));
            }
        }
        samples
    }

    /// The peak of a contact's force, or `None` if the force still rises at the end.
    fn peak(&self, contact: usize) -> Option<SampledPeak> {
        let force = &self.forces[contact - 1];
        let all = 0..force.len();
        let top = all.max_by(|&i, &j| force[i].total_cmp(&force[j])).expect("some");
        let (before, greatest, after) = (force[top - 1], force[top], *force.get(top + 1)?);
        let aside = 0.5 * (before - after) / (before - 2.0 * greatest + after);
        let half = 0.5 * greatest;
        let passage = |i: usize| i as f64 + (half - force[i]) / (force[i + 1] - force[i]);
        let rise = (0..top).rev().find(|&i| force[i] < half);
        let fall = (top..force.len()).find(|&i| force[i] < half);
        let width = |(rise, fall)| (passage(fall - 1) - passage(rise)) * self.interval;
        Some(SampledPeak {
            force: greatest - 0.25 * (before - after) * aside,
            time: (top as f64 + aside) * self.interval,
            fwhm: rise.zip(fall).map(width),
        })
    }
}

fn compare_peaks(worst: &mut Distances, case: &Value, samples: &SampledMotion, summary: &Summary) {
    let mut risen = 0;
    for reference in case["peaks"].as_array().expect("peaks") {
        let contact = number(reference, "contact") as usize;
        let ours = summary.peak_force.iter().find(|peak| peak.contact == contact);
        let ours = ours.expect("the contact carried force");
        let [force, time, fwhm] = ["F_max", "t", "fwhm"].map(|key| number(reference, key));
        let Some(sampled) = samples.peak(contact) else {
            assert_eq!(ours.time, summary.final_state.time);
            assert!(fwhm < 1.1e-5 && force < ours.force, "contact {contact}");
            continue;
        };
        risen += 1;
        worst.see("peak force", sampled.force, force, force);
        worst.see("peak time", sampled.time, time, time);
        worst.see("summary's force", ours.force, sampled.force, force);
        worst.see("summary's time", ours.time, sampled.time, time);
        assert_eq!(ours.fwhm.is_some(), sampled.fwhm.is_some());
        if let Some((ours, sampled)) = ours.fwhm.zip(sampled.fwhm) {
            worst.see("width", sampled, fwhm, fwhm);
            worst.see("summary's width", ours, sampled, fwhm);
        } else {
            assert!(time + 0.52 * fwhm > summary.final_state.time, "contact {contact}");
        }
    }
    assert!(risen + 3 >= case["peaks"].as_array().expect("peaks").len());
}

fn compare_states(worst: &mut Distances, case: &Value, solution: &Solution, summary: &Summary) {
    let end = &case["end_state"];
    let (displacement, velocity) = (numbers(end, "U"), numbers(end, "V"));
    let ours = &summary.final_state;
    assert_eq!(ours.time, number(end, "t"));
    // The striker is far away and fast: kept apart so that it does not lend the beads its scale.
    for bodies in [0..1, 1..displacement.len()] {
        let (kept, known) = (&ours.displacement[bodies.clone()], &displacement[bodies.clone()]);
        worst.see_all("displacement", kept, known);
        worst.see_all("velocity", &ours.velocity[bodies.clone()], &velocity[bodies]);
    }
    let snapshot = solution.at(ours.time);
    for (i, intruder) in summary.intruders.iter().enumerate() {
        let place = snapshot.intruder_displacement(intruder.bead).expect("a host");
        let greatest = intruder.relative_displacement_max;
        worst.see("displacement", place, numbers(end, "x")[i], greatest);
        let rate = snapshot.intruder_velocity(intruder.bead).expect("a host");
        let fastest = number(&case["params"], "V_s");
        worst.see("velocity", rate, numbers(end, "xdot")[i], fastest);
    }
    let momentum = number(case, "momentum_start");
    worst.see("momentum", snapshot.momentum(), momentum, momentum);
}

fn compare_energies(
    worst: &mut Distances,
    case: &Value,
    solution: &Solution,
    samples: &SampledMotion,
    summary: &Summary,
) {
    type Part = fn(&Energies) -> f64;
    let times = case["energies"].as_array().expect("energies");
    let at = |row: &Value| solution.at(number(row, "t")).energies();
    let ours: Vec<_> = times.iter().map(at).collect();
    let printed: Part = |e| e.chain_as_printed;
    for (kind, key, value) in [
        ("energy", "ET", printed),
        ("energy", "ET_hostMm", |e| e.chain),
        ("energy", "KE_striker", |e| e.striker),
        ("energy", "E_int", |e| e.intruders),
        ("dissipated", "D_contact", |e| e.dissipated_contacts),
        ("dissipated", "D_intruder", |e| e.dissipated_intruders),
    ] {
        let ours: Vec<f64> = ours.iter().map(value).collect();
        let theirs: Vec<f64> = times.iter().map(|row| number(row, key)).collect();
        worst.see_all(kind, &ours, &theirs);
    }
    let striker = number(case, "E0_striker");
    worst.see("energy", summary.energy.striker_initial, striker, striker);

    let mut compare = |sampled: &[f64], sign: f64, ours: f64, theirs: f64| {
        let greatest = sampled.iter().map(|value| sign * value).fold(f64::MIN, f64::max);
        worst.see("sampled peak", sign * greatest, theirs, theirs.abs());
        // No sample lies above the peak.
        assert!(
            sign * ours >= greatest - 1e-12 * greatest.abs(),
            "{ours} {greatest}"
        );
        worst.see("summary's peak", ours, sign * greatest, theirs.abs());
    };
    // The reference has M for hosts; the summary, M - m: alike where there are none.
    let printed = samples.chain_energy.iter().copied().fold(f64::MIN, f64::max);
    let theirs = number(case, "ET_max");
    if summary.intruders.is_empty() {
        compare(&samples.chain_energy, 1.0, summary.energy.chain_max, theirs);
    }
    for (i, intruder) in summary.intruders.iter().enumerate() {
        let [max, min] = ["max", "min"].map(|end| numbers(case, &format!("intruder_acc_{end}"))[i]);
        let sampled = &samples.accelerations[i];
        compare(sampled, 1.0, intruder.acceleration_max, max);
        compare(sampled, -1.0, intruder.acceleration_min, min);
    }
    worst.see("sampled peak", printed, theirs, theirs);
}

/// The bound for each kind, about twice the worst seen: for the reference at most 1e-8; for the summary
/// against samples, what sampling explains.
const ALLOWED: [(&str, f64); 14] = [
    ("parameter", 1e-15),
    ("peak force", 1e-10),
    ("peak time", 1e-10),
    ("width", 1e-10),
    ("displacement", 5e-9),
    ("velocity", 1e-9),
    ("energy", 6e-10),
    ("dissipated", 3e-9),
    ("momentum", 3e-14),
    ("sampled peak", 1e-10),
    ("summary's force", 3e-10),
    ("summary's time", 2e-7),
    ("summary's width", 4e-6),
    ("summary's peak", 6e-7),
];

#[test]
fn every_reference_case_is_met() {
    for (name, case) in cases() {
        let scenario = scenario(&name, &case);
        let solution = run(&scenario);
        let summary = solution.summary();
        let samples = SampledMotion::of(&solution);
        let model = solution.model();
        let mut worst = Distances::default();
        for (body, key) in [(0, "Ms"), (1, "M")] {
            let mass = number(&case["params"], key);
            worst.see("momentum", model.mass(body), mass, mass);
        }
        for (contact, key) in [(1, "kappa_striker"), (2, "kappa_bead")] {
            if let Some(stiffness) = case["params"][key].as_f64() {
                let ours = model.contact(contact).stiffness;
                worst.see("parameter", ours, stiffness, stiffness);
            }
        }
        compare_peaks(&mut worst, &case, &samples, &summary);
        compare_states(&mut worst, &case, &solution, &summary);
        compare_energies(&mut worst, &case, &solution, &samples, &summary);

        println!("{name}: {:?}", worst.0);
        for (kind, distance) in worst.0 {
            let allowed = ALLOWED.iter().find(|(name, _)| *name == kind);
            let (_, allowed) = allowed.expect("every kind has a line");
            assert!(distance <= *allowed, "{name}: {kind} {distance:e}");
        }
        let error = summary.energy.balance_error;
        assert!(error < 2e-12, "{name}: {error:e}");
    }
}
