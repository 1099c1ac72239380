//! Every case of an independent program's converged results, `data/chain_cases.json`.
//!
//! That program is SciPy's DOP853 at a relative tolerance of 1e-13 over a right-hand side of its own. Its states and
//! energies repeat from one step sequence to another within the `rel_check` of each case, 2.4e-9 at worst; this crate's
//! own repeat within 1e-10 (`tests/accuracy.rs`), so the distances below are mostly the reference's.
//!
//! Four kinds of its numbers were read off *samples* of its motion and are no better than that; each is held to what
//! sampling explains, on the side that sampling errs:
//! - peak times, from a parabola through three samples: 1e-7;
//! - widths, from straight lines between samples: 2e-6;
//! - greatest chain energy and intruder accelerations, from the samples as they are: below the truth, by 3e-7 at most;
//! - the last three contacts of the long chains carry a rising force when the run ends. It has no peak yet, and what the
//!   reference lists there (10 µs wide) is none. The last pulse's width of some runs is likewise beyond the end.

use std::collections::BTreeMap;

use hertz_chain::{Chain, ContactForce, Intruder, Options, Scenario, Solution, Striker, Summary, simulate};
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

/// Young's moduli and the striker's density are not in the file; they are the paper's, and the file's stiffnesses and
/// masses prove them.
fn scenario(name: &str, case: &Value) -> Scenario {
    let p = &case["params"];
    let (hosts, k, c, m) = (
        numbers(p, "hosts_idx"),
        numbers(p, "k"),
        numbers(p, "c"),
        numbers(p, "m"),
    );
    let intruder = |i: usize| Intruder {
        beads: vec![hosts[i] as usize],
        mass: m[i],
        stiffness: k[i],
        damping: c[i],
    };
    Scenario {
        title: name.to_owned(),
        duration: number(p, "T_end"),
        chain: Chain {
            beads: number(p, "N_chain_beads") as usize,
            radius: number(p, "R"),
            density: number(p, "rho"),
            young: 4.5e9,
            poisson: number(p, "nu"),
            relaxation: number(p, "tau"),
            contact_force: match p["clip_contact_force"].as_bool().expect("a flag") {
                true => ContactForce::Clipped,
                false => ContactForce::Printed,
            },
            precompression: 0.0,
        },
        striker: Striker {
            radius: p["Rs"].as_f64().unwrap_or(0.0045),
            density: 7980.0,
            young: p["Ys"].as_f64().unwrap_or(203e9),
            poisson: 0.27,
            velocity: number(p, "V_s"),
            mass: None,
            relaxation: None,
        },
        wall: None,
        intruders: (0..hosts.len()).map(intruder).collect(),
        sections: vec![],
    }
}

/// The worst distance of each kind of quantity.
#[derive(Default)]
struct Worst(BTreeMap<&'static str, f64>);

impl Worst {
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
        let scale = theirs
            .iter()
            .fold(0.0_f64, |greatest, value| greatest.max(value.abs()));
        for (ours, theirs) in ours.iter().zip(theirs) {
            match scale {
                0.0 => assert_eq!(*ours, 0.0, "{kind}"),
                _ => self.see(kind, *ours, *theirs, scale),
            }
        }
    }
}

fn compare_peaks(worst: &mut Worst, case: &Value, summary: &Summary) {
    let mut risen = 0;
    for reference in case["peaks"].as_array().expect("peaks") {
        let contact = number(reference, "contact") as usize;
        let ours = summary
            .peak_force
            .iter()
            .find(|peak| peak.contact == contact)
            .expect("the contact carried force");
        let (force, time, fwhm) = (
            number(reference, "F_max"),
            number(reference, "t"),
            number(reference, "fwhm"),
        );
        if ours.time == summary.final_state.time {
            assert!(
                fwhm < 1.1e-5 && force < ours.force,
                "contact {contact} has no peak yet"
            );
            continue;
        }
        risen += 1;
        worst.see("peak force", ours.force, force, force);
        worst.see("peak time", ours.time, time, time);
        if let Some(ours) = ours.fwhm {
            worst.see("width", ours, fwhm, fwhm);
        } else {
            assert!(
                time + 0.52 * fwhm > summary.final_state.time,
                "contact {contact} has no width"
            );
        }
    }
    assert!(risen + 3 >= case["peaks"].as_array().expect("peaks").len());
}

fn compare_states(worst: &mut Worst, case: &Value, solution: &Solution, summary: &Summary) {
    let end = &case["end_state"];
    let (displacement, velocity) = (numbers(end, "U"), numbers(end, "V"));
    let ours = &summary.final_state;
    assert_eq!(ours.time, number(end, "t"));
    // The striker is far away and fast: kept apart so that it does not lend the beads its scale.
    worst.see_all("displacement", &ours.displacement[..1], &displacement[..1]);
    worst.see_all("displacement", &ours.displacement[1..], &displacement[1..]);
    worst.see_all("velocity", &ours.velocity[..1], &velocity[..1]);
    worst.see_all("velocity", &ours.velocity[1..], &velocity[1..]);
    let snapshot = solution.at(ours.time);
    for (i, intruder) in summary.intruders.iter().enumerate() {
        let (x, x_rate) = (numbers(end, "x")[i], numbers(end, "xdot")[i]);
        let greatest = intruder.relative_displacement_max;
        worst.see(
            "displacement",
            snapshot.intruder_displacement(intruder.bead).expect("a host"),
            x,
            greatest,
        );
        let fastest = number(&case["params"], "V_s");
        worst.see(
            "velocity",
            snapshot.intruder_velocity(intruder.bead).expect("a host"),
            x_rate,
            fastest,
        );
    }
    let momentum = number(case, "momentum_start");
    worst.see("momentum", snapshot.momentum(), momentum, momentum);
}

fn compare_energies(worst: &mut Worst, case: &Value, solution: &Solution, summary: &Summary) {
    let times = case["energies"].as_array().expect("energies");
    let ours: Vec<_> = times
        .iter()
        .map(|row| solution.energy(number(row, "t")))
        .collect();
    for (kind, key, value) in [
        (
            "energy",
            "ET",
            (|e| e.chain_as_printed) as fn(&hertz_chain::Energies) -> f64,
        ),
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

    let sampled = |worst: &mut Worst, ours: f64, theirs: f64| {
        assert!(
            ours.abs() >= theirs.abs() * (1.0 - 1e-12),
            "a sample {theirs} lies above the peak {ours}"
        );
        worst.see("sampled peak", ours, theirs, theirs.abs());
    };
    sampled(worst, summary.energy.chain_max, number(case, "ET_max"));
    for (i, intruder) in summary.intruders.iter().enumerate() {
        sampled(
            worst,
            intruder.acceleration_max,
            numbers(case, "intruder_acc_max")[i],
        );
        sampled(
            worst,
            intruder.acceleration_min,
            numbers(case, "intruder_acc_min")[i],
        );
    }
}

/// What each kind is held to, about twice the worst seen.
const ALLOWED: [(&str, f64); 10] = [
    ("parameter", 1e-15),
    ("peak force", 3e-10),
    ("peak time", 2e-7),
    ("width", 4e-6),
    ("displacement", 5e-9),
    ("velocity", 1e-9),
    ("energy", 6e-10),
    ("dissipated", 3e-9),
    ("momentum", 3e-14),
    ("sampled peak", 4e-7),
];

#[test]
fn every_reference_case_is_met() {
    for (name, case) in cases() {
        let scenario = scenario(&name, &case);
        let solution = simulate(&scenario, &Options::default()).expect("the case runs");
        let summary = solution.summary();
        let model = solution.model();
        let mut worst = Worst::default();
        worst.see(
            "momentum",
            model.mass(0),
            number(&case["params"], "Ms"),
            model.mass(0),
        );
        worst.see(
            "momentum",
            model.mass(1),
            number(&case["params"], "M"),
            model.mass(1),
        );
        for (contact, key) in [(1, "kappa_striker"), (2, "kappa_bead")] {
            if let Some(stiffness) = case["params"][key].as_f64() {
                worst.see(
                    "parameter",
                    model.contact(contact).stiffness,
                    stiffness,
                    stiffness,
                );
            }
        }
        compare_peaks(&mut worst, &case, &summary);
        compare_states(&mut worst, &case, &solution, &summary);
        compare_energies(&mut worst, &case, &solution, &summary);

        let distances: Vec<_> = worst
            .0
            .iter()
            .map(|(kind, distance)| format!("{kind} {distance:.1e}"))
            .collect();
        println!(
            "{name}: {}; balance {:.1e}",
            distances.join(", "),
            summary.energy.balance_error
        );
        for (kind, distance) in worst.0 {
            let (_, allowed) = ALLOWED
                .iter()
                .find(|(name, _)| *name == kind)
                .expect("every kind has a line");
            assert!(
                distance <= *allowed,
                "{name}: {kind} {distance:e} is over {allowed:e}"
            );
        }
        assert!(
            summary.energy.balance_error < 2e-12,
            "{name}: {:e}",
            summary.energy.balance_error
        );
    }
}
