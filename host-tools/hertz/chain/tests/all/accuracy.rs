//! Errors of the integration, measured against finer runs and known results.

use crate::common::{elastic, run};
use hertz_chain::{Accuracy, Material, Options, Scenario, Section, Solution, Wall, simulate_with};

/// The paper's strike, for the 4 ms that its figure shows.
fn paper() -> Scenario {
    let mut scenario = Scenario::paper();
    scenario.duration = 0.004;
    scenario
}

fn with(options: &Options<'_>) -> Solution {
    simulate_with(&paper(), options).expect("the scenario runs")
}

/// More steps, each of a fifth of the error.
fn run_finer(scenario: &Scenario) -> Solution {
    let accuracy = Accuracy::new(2e-14, 1.0 / 50.0);
    simulate_with(scenario, &Options::with(accuracy)).expect("the scenario runs")
}

/// Worst distance of forces (in parts of the greatest at the last contact) and of energies (in parts of the
/// striker's), at times where no step ends.
fn distance(one: &Solution, other: &Solution) -> (f64, f64) {
    let summary = other.summary();
    let weakest = summary
        .peak_force
        .iter()
        .map(|peak| peak.force)
        .filter(|force| *force > 1.0)
        .fold(1e9, f64::min);
    let (mut ours, mut theirs) = (one.sampler(), other.sampler());
    let (mut force, mut energy) = (0.0_f64, 0.0_f64);
    for i in 0..700 {
        let t = one.end() * (f64::from(i) + 0.37) / 700.0;
        let (a, b) = (ours.at(t), theirs.at(t));
        for contact in 1..=one.model().contacts() {
            force = force.max((a.force(contact) - b.force(contact)).abs() / weakest);
        }
        let (a, b) = (a.energies(), b.energies());
        for (a, b) in [
            (a.chain, b.chain),
            (a.striker, b.striker),
            (a.intruders, b.intruders),
            (a.dissipated_contacts, b.dissipated_contacts),
            (a.dissipated_intruders, b.dissipated_intruders),
        ] {
            energy = energy.max((a - b).abs() / summary.energy.striker_initial);
        }
    }
    (force, energy)
}

#[test]
fn dense_output_agrees_with_a_run_of_other_steps() {
    let mut clipped = paper();
    clipped.chain.contact_force = hertz_chain::ContactForce::Clipped;
    for (name, scenario, forces, energies) in [
        ("paper", paper(), 2e-12, 1e-13),
        ("clipped", clipped, 2e-12, 1e-13),
        ("elastic", elastic(38, 0.006), 3e-11, 2e-13),
    ] {
        let (force, energy) = distance(&run(&scenario), &run_finer(&scenario));
        println!("{name}: forces {force:.1e}, energies {energy:.1e}");
        assert!(
            force < forces && energy < energies,
            "{name}: forces {force:e}, energies {energy:e}"
        );
    }
}

#[test]
fn peaks_and_widths_repeat_with_other_steps() {
    for scenario in [paper(), elastic(38, 0.006)] {
        let (ours, finer) = (run(&scenario).summary(), run_finer(&scenario).summary());
        let mut compared = 0;
        for (a, b) in ours.peak_force.iter().zip(&finer.peak_force) {
            assert_eq!(a.contact, b.contact);
            let (Some(width), Some(finer_width)) = (a.fwhm, b.fwhm) else {
                continue;
            };
            compared += 1;
            assert!((a.force / b.force - 1.0).abs() < 1e-12, "{a:?} {b:?}");
            assert!((a.time / b.time - 1.0).abs() < 1e-12, "{a:?} {b:?}");
            assert!((width / finer_width - 1.0).abs() < 1e-11, "{a:?} {b:?}");
        }
        assert!(compared >= 15);
    }
}

#[test]
fn the_draft_is_good_for_pictures() {
    let draft = Options::with(Accuracy::DRAFT);
    let (force, energy) = distance(&with(&draft), &run(&paper()));
    assert!(
        force < 3e-6 && energy < 3e-6,
        "forces {force:e}, energies {energy:e}"
    );
}

#[test]
fn momentum_is_kept() {
    for scenario in [paper(), elastic(38, 0.006)] {
        let solution = run(&scenario);
        let start = solution.model().mass(0) * scenario.striker.velocity;
        for i in 0..=100 {
            let momentum = solution.at(solution.end() * f64::from(i) / 100.0).momentum();
            assert!((momentum / start - 1.0).abs() < 1e-12, "{momentum} of {start}");
        }
    }
}

#[test]
fn the_energy_balance_closes() {
    let solution = run(&paper());
    let energy = solution.summary().energy;
    assert!(energy.balance_error < 1e-14, "{:e}", energy.balance_error);
    // With M for the host, as the paper prints it, the sum misses by the intruder's share of the motion.
    let end = solution.at(0.002).energies();
    let as_printed = end.total() - end.chain + end.chain_as_printed;
    assert!((as_printed / energy.striker_initial - 1.0).abs() > 1e-3);
}

/// The factors between the numbers of two runs.
struct Scale {
    force: f64,
    time: f64,
    energy: f64,
}

/// The worst distance of peaks, widths, energies and absorbed energies from what the factors say.
fn off_scale(one: &Scenario, other: &Scenario, scale: &Scale) -> f64 {
    let (one, other) = (run(one).summary(), run(other).summary());
    assert_eq!(one.peak_force.len(), other.peak_force.len());
    let mut worst = 0.0_f64;
    let mut see = |a: f64, b: f64, factor: f64| worst = worst.max((b / a / factor - 1.0).abs());
    for (a, b) in one.peak_force.iter().zip(&other.peak_force) {
        see(a.force, b.force, scale.force);
        see(a.time, b.time, scale.time);
        assert_eq!(a.fwhm.is_some(), b.fwhm.is_some());
        if let Some((a, b)) = a.fwhm.zip(b.fwhm) {
            see(a, b, scale.time);
        }
    }
    see(one.energy.chain_final, other.energy.chain_final, scale.energy);
    see(one.energy.striker_final, other.energy.striker_final, scale.energy);
    if one.energy.dissipated_contacts > 0.0 {
        let (a, b) = (&one.energy, &other.energy);
        see(a.dissipated_contacts, b.dissipated_contacts, scale.energy);
    }
    for (a, b) in one.intruders.iter().zip(&other.intruders) {
        see(a.dissipated, b.dissipated, scale.energy);
    }
    worst
}

/// F ~ V^(6/5), t ~ V^(-1/5), E ~ V². The motion follows if an intruder's stiffness goes as V^(2/5) and its
/// damping as V^(1/5).
#[test]
fn an_elastic_chain_scales_with_the_speed() {
    let plain = elastic(12, 0.003);
    let mut hosting = plain.clone();
    hosting.intruders = paper().intruders;
    for (name, slow) in [("plain", plain), ("hosting", hosting)] {
        let mut slow = slow;
        slow.striker.velocity = 0.05;
        slow.duration *= (0.05_f64 / 0.45).powf(-0.2);
        for ratio in [2.0_f64, 10.0, 100.0] {
            let mut fast = slow.clone();
            fast.striker.velocity *= ratio;
            fast.duration *= ratio.powf(-0.2);
            for intruder in &mut fast.intruders {
                intruder.stiffness *= ratio.powf(0.4);
                intruder.damping *= ratio.powf(0.2);
            }
            let scale = Scale {
                force: ratio.powf(1.2),
                time: ratio.powf(-0.2),
                energy: ratio.powi(2),
            };
            let error = off_scale(&slow, &fast, &scale);
            println!("{name}, {ratio} times as fast: {error:.1e}");
            assert!(error < 1e-11, "{name}, {ratio}: {error:e}");
        }
    }
}

/// Lengths times l, densities times r, moduli times y: times go as l √(r/y), forces as y l², energies as y
/// l³, whatever else is in the chain.
#[test]
fn a_chain_of_other_size_and_material_is_the_same_on_another_scale() {
    let mut small = paper();
    small.chain.precompression = 0.3;
    let mut wall = Wall::flat(Material::STEEL);
    wall.radius = Some(0.05);
    small.wall = Some(wall);
    let mut thin = Section::of([4, 5]);
    thin.radius = Some(0.012);
    small.sections = vec![thin];
    for (l, r, y) in [
        (3.0, 1.0, 1.0),
        (1.0, 4.4, 1.0),
        (1.0, 1.0, 45.0),
        (0.2, 1.7, 0.03),
    ] {
        let mut large = small.clone();
        let time = l * f64::sqrt(r / y);
        large.duration *= time;
        for radius in [&mut large.chain.radius, &mut large.striker.radius] {
            *radius *= l;
        }
        for density in [&mut large.chain.density, &mut large.striker.density] {
            *density *= r;
        }
        for young in [&mut large.chain.young, &mut large.striker.young] {
            *young *= y;
        }
        let wall = large.wall.as_mut().expect("it has one");
        wall.young *= y;
        wall.radius = wall.radius.map(|radius| radius * l);
        large.sections[0].radius = large.sections[0].radius.map(|radius| radius * l);
        large.chain.relaxation *= time;
        large.chain.precompression *= y * l * l;
        large.striker.velocity *= f64::sqrt(y / r);
        large.intruders[0].mass *= r * l.powi(3);
        large.intruders[0].stiffness *= y * l;
        large.intruders[0].damping *= l * l * f64::sqrt(r * y);
        let scale = Scale {
            force: y * l * l,
            time,
            energy: y * l.powi(3),
        };
        let error = off_scale(&small, &large, &scale);
        println!("lengths {l}, densities {r}, moduli {y}: {error:.1e}");
        assert!(error < 1e-11, "{l} {r} {y}: {error:e}");
    }
}

/// Eqs. (9) and (10) with the right factor of (10), (5/4)^(3/5).
#[test]
fn two_elastic_bodies_touch_as_hertz_says() {
    let scenario = elastic(1, 0.0003);
    let solution = run(&scenario);
    let model = solution.model();
    let (kappa, speed) = (model.contact(1).stiffness, model.striker_speed());
    let mass = model.mass(0) * model.mass(1) / (model.mass(0) + model.mass(1));
    let force = 1.25_f64.powf(0.6) * kappa.powf(0.4) * mass.powf(0.6) * speed.powf(1.2);
    let time = 2.943_275_184 * 1.25_f64.powf(0.4) * (mass / kappa).powf(0.4) * speed.powf(-0.2);
    let peak = solution.summary().peak_force[0];
    assert!((peak.force / force - 1.0).abs() < 1e-12, "{} {force}", peak.force);
    // The contact is symmetric in time: it peaks half way.
    assert!(
        (peak.time / (0.5 * time) - 1.0).abs() < 1e-9,
        "{} {time}",
        peak.time
    );
    assert_eq!(solution.at(1.0001 * time).force(1), 0.0);
    assert!(solution.at(0.9999 * time).force(1) > 0.0);
}

/// Ramírez et al. 1999: e = 1 - 1.15344 A + 0.79826 A² ..., with A = (3/2) α, α = τ (κ/μ)^(2/5) V^(1/5).
#[test]
fn two_viscoelastic_bodies_part_at_the_known_speed() {
    for alpha in [0.01, 0.02] {
        let mut scenario = elastic(1, 0.0003);
        let elastic = run(&scenario);
        let model = elastic.model();
        let mass = model.mass(0) * model.mass(1) / (model.mass(0) + model.mass(1));
        let speed = model.striker_speed();
        scenario.chain.relaxation = alpha / ((model.contact(1).stiffness / mass).powf(0.4) * speed.powf(0.2));
        let end = run(&scenario).summary().final_state;
        let restitution = (end.velocity[1] - end.velocity[0]) / speed;
        let series = 1.0 - 1.73016 * alpha + 1.79609 * alpha * alpha;
        // The next term of the series is some -1.5 α³.
        assert!(
            (restitution - series).abs() < 2.0 * alpha.powi(3) + 2e-6 * alpha,
            "{alpha}: {restitution} {series}"
        );
    }
}

/// Discrete solitary wave (κ = M = 1): c = 0.90552 F^(1/6), to the digits known.
#[test]
fn a_pulse_becomes_the_solitary_wave() {
    let solution = run(&elastic(50, 0.010));
    let peaks = solution.summary().peak_force;
    let (early, late) = (peaks[32], peaks[36]);
    let speed = 4.0 / (late.time - early.time);
    let (kappa, mass) = (solution.model().contact(2).stiffness, solution.model().mass(1));
    let unit = kappa.powf(1.0 / 3.0) * mass.powf(-0.5) * late.force.powf(1.0 / 6.0);
    assert!((speed / unit - 0.90552).abs() < 1e-5, "{}", speed / unit);
}

#[test]
fn a_longer_run_leaves_the_summary_as_it_is() {
    let longer = Options::default().with_duration(0.006);
    let (longer, plain) = (with(&longer), run(&paper()));
    assert_eq!(longer.end(), 0.006);
    assert_eq!(longer.summary().peak_force, plain.summary().peak_force);
    assert_eq!(longer.summary().final_state, plain.summary().final_state);
    assert!(longer.at(0.0041).force(16) > 1.0);
}

#[test]
fn a_shorter_run_is_summed_up_to_its_own_end() {
    let shorter = Options::default().with_duration(0.001);
    let solution = with(&shorter);
    let end = solution.summary().final_state;
    assert_eq!((solution.end(), end.time), (0.001, 0.001));
    let displacement = run(&paper()).at(0.001).displacement(1);
    assert!((end.displacement[1] / displacement - 1.0).abs() < 1e-11);
}

#[test]
#[should_panic = "0.0041 s is not within the run, 0 to 0.004 s"]
fn a_time_after_the_end_is_refused() {
    run(&paper()).at(0.0041).force(1);
}

#[test]
fn sections_make_their_beads_unlike_the_rest() {
    let mut scenario = paper();
    let mut thin = Section::of([3, 4]);
    (thin.radius, thin.relaxation) = (Some(0.0095), Some(0.0));
    scenario.sections = vec![thin];
    let solution = run(&scenario);
    let model = solution.model();
    assert!((model.mass(3) / model.mass(2) - 0.125).abs() < 1e-15);
    assert_eq!(model.mass(2), model.mass(5));
    // κ goes with 1/√(1/Ra + 1/Rb): 1/2R among the small ones, 3/2 of the large ones' curvature at the step.
    let plain = model.contact(2).stiffness;
    assert!((model.contact(3).stiffness / plain - (2.0_f64 / 3.0).sqrt()).abs() < 1e-14);
    assert!((model.contact(4).stiffness / plain - 0.5_f64.sqrt()).abs() < 1e-14);
    let relaxation: Vec<f64> = (1..=6).map(|contact| model.contact(contact).relaxation).collect();
    assert_eq!(relaxation, [4.2e-6, 4.2e-6, 2.1e-6, 0.0, 2.1e-6, 4.2e-6]);
    assert!(solution.summary().energy.balance_error < 1e-12);
}

#[test]
fn the_striker_may_have_mass_and_relaxation_of_its_own() {
    let mut scenario = paper();
    (scenario.striker.mass, scenario.striker.relaxation) = (Some(3.0e-3), Some(0.0));
    let solution = run(&scenario);
    assert_eq!(solution.model().mass(0), 3.0e-3);
    assert_eq!(solution.model().contact(1).relaxation, 0.0);
    assert_eq!(solution.model().contact(2).relaxation, 4.2e-6);
}

#[test]
fn progress_is_told() {
    let last = std::sync::Mutex::new(0.0);
    let progress = |part: f64| {
        let mut last = last.lock().expect("no panic");
        assert!(part > *last && part <= 1.0);
        *last = part;
    };
    let options = Options::default().with_progress(&progress);
    with(&options);
    assert_eq!(*last.lock().expect("no panic"), 1.0);
}

#[test]
fn the_json_has_the_names_of_the_contract() {
    let json = serde_json::to_value(run(&paper()).summary()).expect("numbers");
    let keys = |value: &serde_json::Value| -> Vec<String> {
        let mut keys: Vec<String> = value.as_object().expect("an object").keys().cloned().collect();
        // Whether a map of serde_json keeps its order depends on who else is built with it.
        keys.sort();
        keys
    };
    assert_eq!(
        keys(&json),
        ["energy", "final", "intruders", "peak_force", "solver"]
    );
    assert_eq!(keys(&json["peak_force"][0]), ["contact", "force", "fwhm", "time"]);
    assert!(json["peak_force"][15]["fwhm"].is_null());
    assert_eq!(keys(&json["final"]), ["displacement", "time", "velocity"]);
    assert_eq!(
        keys(&json["energy"]),
        [
            "balance_error",
            "chain_final",
            "chain_max",
            "dissipated_contacts",
            "dissipated_intruders",
            "intruders_final",
            "striker_final",
            "striker_initial",
        ]
    );
    assert_eq!(
        keys(&json["intruders"][0]),
        [
            "acceleration_max",
            "acceleration_min",
            "bead",
            "dissipated",
            "relative_displacement_max"
        ]
    );
    assert_eq!(keys(&json["solver"]), ["evaluations", "seconds", "steps"]);
}

#[test]
fn a_contact_that_nothing_reached_is_not_among_the_peaks() {
    let summary = run(&elastic(38, 0.002)).summary();
    let contacts: Vec<usize> = summary.peak_force.iter().map(|peak| peak.contact).collect();
    assert_eq!(contacts, (1..=contacts.len()).collect::<Vec<_>>());
    assert!(contacts.len() < 15, "{contacts:?}");
    let last = summary.peak_force.last().expect("some");
    assert_eq!((last.time, last.fwhm), (0.002, None));
}
