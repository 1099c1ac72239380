//! Derivatives of results, against differences of runs, closed forms, and the scaling of elastic chains.

use crate::common::{Draw, close, elastic, near, of_radius, says, softer};
use hertz_chain::tangents::{Dual, Parameter, Sensitivities, sensitivities};
use hertz_chain::{
    ContactForce, ContactLaw, ContactPeak, Drive, DriveQuantity, Intruder, Material, Options, Oscillator,
    Scenario, Start, Summary, Wall, summarise,
};

const FIVE: [Parameter; 5] = [
    Parameter::Stiffness(0),
    Parameter::Damping(0),
    Parameter::IntruderMass(0),
    Parameter::Relaxation,
    Parameter::StrikerVelocity,
];

fn value(scenario: &mut Scenario, parameter: Parameter) -> &mut f64 {
    match parameter {
        Parameter::Stiffness(table) => &mut scenario.intruders[table].stiffness,
        Parameter::Damping(table) => &mut scenario.intruders[table].damping,
        Parameter::IntruderMass(table) => &mut scenario.intruders[table].mass,
        Parameter::CubicStiffness(table) => &mut scenario.intruders[table].cubic_stiffness,
        Parameter::Relaxation => &mut scenario.chain.relaxation,
        Parameter::StrikerVelocity => &mut scenario.striker.velocity,
        Parameter::Young => &mut scenario.chain.young,
        Parameter::Density => &mut scenario.chain.density,
        _ => unreachable!("not a value of these scenarios"),
    }
}

fn derived<const P: usize>(scenario: &Scenario, parameters: &[Parameter]) -> Sensitivities<P> {
    sensitivities(scenario, parameters, &Options::default()).expect("it can be run")
}

/// A chain of 3 to 12 beads with one or two equal intruders. One bead may be of another size; there is a wall
/// or a free end, with or without a load.
fn drawn(draw: &mut Draw) -> Scenario {
    let mut scenario = Scenario::paper();
    let beads = draw.between(3.0, 13.0) as usize;
    scenario.chain.beads = beads;
    scenario.duration = draw.between(1.5e-3, 4e-3);
    scenario.chain.relaxation = draw.between(1e-7, 1e-5);
    scenario.striker.velocity = draw.between(0.1, 1.5);
    scenario.striker.radius = draw.between(0.003, 0.02);
    let (mass, stiffness) = (draw.between(1e-3, 8e-3), 10f64.powf(draw.between(4.0, 6.0)));
    let oscillator = Oscillator::new(mass, stiffness, draw.between(1.0, 40.0));
    let host = draw.between(1.0, beads as f64) as usize;
    let hosts = if draw.between(0.0, 1.0) < 0.5 {
        host..=host
    } else {
        host..=host + 1
    };
    scenario.intruders = vec![Intruder::new(hosts, oscillator)];
    if draw.between(0.0, 1.0) < 0.4 {
        let bead = draw.between(1.0, beads as f64 + 1.0) as usize;
        scenario.sections = vec![of_radius([bead], draw.between(0.014, 0.025))];
    }
    if draw.between(0.0, 1.0) < 0.4 {
        scenario.wall = Some(Wall::flat(Material::STEEL));
    }
    if draw.between(0.0, 1.0) < 0.2 {
        scenario.chain.precompression = draw.between(0.1, 20.0);
    }
    scenario
}

/// Parts of a parameter by which differences are taken. Where a maximum or the time of an opening bends
/// sharply, the larger is too large; where a result is small, the lesser is lost in rounding.
const PARTS: [f64; 2] = [3e-4, 3e-5];

/// A difference of fourth order from results at -2, -1, 1 and 2 parts.
fn difference([a, b, c, d]: [f64; 4], part: f64) -> f64 {
    (a - 8.0 * b + 8.0 * c - d) / (12.0 * part)
}

/// Energies of a run, J, in the order of [`energy_duals`].
fn energies(summary: &Summary) -> Vec<f64> {
    let energy = &summary.energy;
    let intruders = summary.intruders.iter().map(|intruder| intruder.dissipated);
    let others = [
        energy.striker_initial,
        energy.striker_final,
        energy.chain_final,
        energy.intruders_final,
        energy.dissipated_contacts,
    ];
    intruders.chain(others).collect()
}

fn energy_duals<const P: usize>(found: &Sensitivities<P>) -> Vec<Dual<P>> {
    let others = [
        found.striker_initial,
        found.striker_final,
        found.chain_final,
        found.intruders_final,
        found.dissipated_contacts,
    ];
    found.dissipated.iter().copied().chain(others).collect()
}

/// The greatest force of a contact; none where its maximum is at the end of the run or leaps to another
/// pulse, which has no derivative.
fn peak(summary: &Summary, expected: &ContactPeak, end: f64) -> Option<f64> {
    let mut peaks = summary.peak_force.iter();
    let peak = peaks.find(|other| other.contact == expected.contact)?;
    let leaps = (peak.time - expected.time).abs() > 2e-2 * expected.time;
    (!leaps && peak.time < end && expected.time < end).then_some(peak.force)
}

/// Greatest distance between derivatives and differences of a scenario, each times the parameter: of energies
/// over the striker's, and of forces over the greatest.
fn distance(scenario: &Scenario, parameters: &[Parameter]) -> f64 {
    let ours = derived::<7>(scenario, parameters);
    let whole = ours.summary.energy.striker_initial;
    let peaks = &ours.summary.peak_force;
    let force = peaks.iter().fold(0.0_f64, |most, peak| most.max(peak.force));
    let mut worst = 0.0_f64;
    for (direction, &parameter) in parameters.iter().enumerate() {
        let at = *value(&mut scenario.clone(), parameter);
        let moved = PARTS.map(|part| {
            [-2.0, -1.0, 1.0, 2.0].map(|steps| {
                let mut moved = scenario.clone();
                *value(&mut moved, parameter) *= 1.0 + steps * part;
                summarise(&moved, &Options::default()).expect("it can be run")
            })
        });
        let mut compare = |ours: f64, results: [Option<[f64; 4]>; 2], scale: f64| {
            let off = results
                .into_iter()
                .zip(PARTS)
                .filter_map(|(results, part)| Some((at * ours - difference(results?, part)).abs() / scale));
            if let Some(off) = off.reduce(f64::min) {
                worst = worst.max(off);
            }
        };
        for (index, dual) in energy_duals(&ours).into_iter().enumerate() {
            let results = moved.each_ref().map(|runs| {
                let energies = runs.each_ref().map(|run| energies(run)[index]);
                Some(energies)
            });
            compare(dual.by[direction], results, whole);
        }
        for (expected, dual) in peaks.iter().zip(&ours.peak_force) {
            let results = moved.each_ref().map(|runs| {
                let forces = runs.each_ref().map(|run| peak(run, expected, scenario.duration));
                let [Some(a), Some(b), Some(c), Some(d)] = forces else {
                    return None;
                };
                Some([a, b, c, d])
            });
            compare(dual.by[direction], results, force);
        }
    }
    worst
}

#[test]
fn derivatives_are_differences_of_runs_of_random_chains() {
    let mut draw = Draw(38);
    let mut worst = 0.0_f64;
    for number in 0..12 {
        let off = distance(&drawn(&mut draw), &FIVE);
        assert!(off < 1e-6, "chain {number}: {off:e}");
        worst = worst.max(off);
    }
    println!("{worst:.1e}");
}

/// `cargo test --release -p hertz-chain --test all -- thousand_random --ignored --nocapture`
#[test]
#[ignore = "twenty thousand runs"]
fn derivatives_are_differences_of_runs_of_a_thousand_random_chains() {
    let mut draw = Draw(1411);
    let mut off: Vec<f64> = (0..1000).map(|_| distance(&drawn(&mut draw), &FIVE)).collect();
    off.sort_by(f64::total_cmp);
    println!(
        "median {:.1e}, 99 % {:.1e}, worst {:.1e}",
        off[500], off[990], off[999]
    );
    assert!(off[999] < 1e-6, "{:?}", &off[985..]);
}

#[test]
fn all_parameters_of_the_paper_have_derivatives() {
    let all = [&FIVE[..], &[Parameter::Young, Parameter::Density]].concat();
    let mut scenario = Scenario::paper();
    close(distance(&scenario, &all), 0.0, 1e-7);
    scenario.intruders.insert(0, softer([5, 6]));
    close(distance(&scenario, &all), 0.0, 1e-7);
    let off = distance(&scenario, &[Parameter::Stiffness(1), Parameter::Damping(1)]);
    close(off, 0.0, 1e-7);
}

#[test]
fn a_spring_that_hardens_or_softens_has_derivatives_too() {
    let all = [&FIVE[..], &[Parameter::CubicStiffness(0)]].concat();
    let mut scenario = Scenario::paper();
    for cubic in [1e17, -2e16] {
        scenario.intruders[0].cubic_stiffness = cubic;
        close(distance(&scenario, &all), 0.0, 1e-7);
    }
}

/// F ~ V^(6/5) and E ~ V² in an elastic chain, once the wave has passed.
#[test]
fn an_elastic_chain_has_the_derivatives_of_its_scaling() {
    let scenario = elastic(10, 4e-3);
    let found = derived::<1>(&scenario, &[Parameter::StrikerVelocity]);
    let speed = scenario.striker.velocity;
    for (force, peak) in found.peak_force.iter().zip(&found.summary.peak_force) {
        assert!(peak.time < scenario.duration);
        near(speed * force.by[0], 1.2 * force.value, 1e-8);
    }
    near(
        speed * found.striker_initial.by[0],
        2.0 * found.striker_initial.value,
        1e-12,
    );
    close(
        found.dissipated_contacts.by[0] * speed,
        0.0,
        1e-9 * found.striker_initial.value,
    );
}

#[test]
fn a_run_has_the_results_of_a_plain_one() {
    let plain = summarise(&Scenario::paper(), &Options::default()).expect("it can be run");
    let mut ours = derived::<1>(&Scenario::paper(), &[Parameter::Relaxation]).summary;
    ours.solver.seconds = plain.solver.seconds;
    assert_eq!(ours, plain);
}

#[test]
fn what_has_no_derivatives_is_refused() {
    let mut scenario = Scenario::paper();
    let refused = |scenario: &Scenario, parameters: &[Parameter]| {
        let found = sensitivities::<1>(scenario, parameters, &Options::default());
        found.expect_err("it has none").to_string()
    };
    assert!(refused(&scenario, &FIVE).contains("5 parameters are given, but there is only room for 1"));
    scenario.chain.contact_force = ContactForce::Clipped;
    assert!(refused(&scenario, &FIVE[..1]).contains("clipped forces have no tangents"));
    type Change = fn(&mut Scenario);
    let others: [(Change, &str); 4] = [
        (
            |one| {
                one.striker.velocity = 0.0;
                one.drive = Some(Drive::sine(DriveQuantity::Force, 0.1, 1000.0));
            },
            "a driven or vertical chain has",
        ),
        (|one| one.chain.gravity = 9.81, "a driven or vertical chain has"),
        (
            |one| one.starts = vec![Start::displaced([3], 1e-7)],
            "bodies displaced at t = 0 have",
        ),
        (
            |one| one.contact = Some(ContactLaw::power(2.0, 1e11)),
            "contacts of another law than Hertz' have",
        ),
    ];
    for (change, what) in others {
        let mut other = elastic(10, 2e-3);
        other.wall = Some(Wall::flat(Material::STEEL));
        other.intruders = vec![softer([4])];
        change(&mut other);
        let words = format!("{what} no tangents");
        says(&refused(&other, &FIVE[..1]), "", &words);
    }
}
