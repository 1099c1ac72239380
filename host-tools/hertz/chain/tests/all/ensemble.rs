//! Ensembles against single runs, chain by chain.

use std::sync::Mutex;

use crate::common::{Draw, close, elastic, near, of_radius, softer, struck_by_a_bead};
use hertz_chain::{
    Accuracy, ContactForce, EnsembleOptions, EnsembleOutcome, Intruder, Material, Options, Oscillator,
    Scenario, SimulateError, Solution, Start, Wall, ensemble, simulate_with,
};

impl Draw {
    /// The paper's strike with another speed and another intruder.
    fn like_the_paper(&mut self) -> Scenario {
        let mut scenario = Scenario::paper();
        scenario.duration = 0.010;
        scenario.striker.velocity = self.between(0.2, 1.5);
        let intruder = &mut scenario.intruders[0];
        intruder.stiffness = self.between(5e4, 5e5);
        intruder.damping = self.between(5.0, 20.0);
        intruder.mass = self.between(2e-3, 6e-3);
        scenario
    }
}

fn exactly(scenario: &Scenario) -> Solution {
    let options = Options::with(Accuracy::new(1e-12, 0.25));
    simulate_with(scenario, &options).expect("the scenario runs")
}

fn all(scenarios: &[Scenario]) -> Vec<EnsembleOutcome> {
    ensemble(scenarios, &EnsembleOptions::default())
        .into_iter()
        .map(|outcome| outcome.expect("the scenario runs"))
        .collect()
}

/// Displacements, velocities and absorbed energy, bit for bit.
fn bits(outcome: &EnsembleOutcome) -> Vec<u64> {
    let end = outcome.end();
    let bodies = 0..outcome.model().bodies();
    let motion = bodies.flat_map(|body| [end.displacement(body), end.velocity(body)]);
    motion.chain([outcome.absorbed()]).map(f64::to_bits).collect()
}

#[test]
fn what_is_absorbed_has_an_error_of_a_millionth_at_most() {
    let mut draw = Draw(0x9e37_79b9_7f4a_7c15);
    let mut scenarios: Vec<_> = (0..600).map(|_| draw.like_the_paper()).collect();
    // An intruder may be in any bead, even the only one.
    let mut alone = elastic(1, 0.004);
    alone.intruders = vec![Intruder::new([1], Oscillator::PAPER)];
    scenarios.push(alone);
    // One may carry others.
    for depth in 1..3 {
        let mut nested = draw.like_the_paper();
        for carrier in 1..=depth {
            let mut inner = softer([8]);
            (inner.mass, inner.inside) = (0.7e-3, Some(carrier));
            nested.intruders.push(inner);
        }
        nested.intruders.push(softer([8]));
        scenarios.push(nested);
    }
    for (scenario, outcome) in scenarios.iter().zip(all(&scenarios)) {
        let solution = exactly(scenario);
        let exact = solution.at(solution.end()).energies();
        let energy = solution.model().striker_energy();
        near(outcome.absorbed(), exact.dissipated_intruders, 1e-6);
        near(outcome.injected(), energy - exact.striker, 1e-6);
        let lost = outcome.end().energies().dissipated_contacts;
        close(lost, exact.dissipated_contacts, 2e-7 * energy);
        assert_eq!(outcome.time(), scenario.duration);
    }
}

#[test]
fn what_a_stiff_intruder_absorbs_has_an_error_of_a_billionth_of_the_striker_s_energy() {
    let mut scenarios = Vec::new();
    for damping in [1.0, 12.0] {
        for stiffness in [1e6, 1e7, 1e8, 1e9, 1e10] {
            let mut scenario = Scenario::paper();
            (scenario.intruders[0].stiffness, scenario.intruders[0].damping) = (stiffness, damping);
            scenarios.push(scenario);
        }
    }
    for (scenario, outcome) in scenarios.iter().zip(all(&scenarios)) {
        let solution = exactly(scenario);
        let exact = solution.at(solution.end()).energies().dissipated_intruders;
        let energy = solution.model().striker_energy();
        close(outcome.absorbed(), exact, 1e-9 * energy);
    }
}

#[test]
fn a_chain_has_the_same_bits_in_any_company_and_on_any_number_of_threads() {
    let mut draw = Draw(0x2545_f491_4f6c_dd1d);
    let scenarios: Vec<_> = (0..43).map(|_| draw.like_the_paper()).collect();
    let together: Vec<_> = all(&scenarios).iter().map(bits).collect();
    let alone = scenarios.iter();
    let alone = alone.map(|one| bits(&all(std::slice::from_ref(one))[0]));
    assert!(alone.eq(together.iter().cloned()));
    let mut turned = scenarios.clone();
    turned.reverse();
    // Chains of other shapes between them.
    turned.insert(5, elastic(9, 0.002));
    turned.insert(20, struck_by_a_bead(30, 0.003));
    let mut found: Vec<_> = all(&turned).iter().map(bits).collect();
    found.remove(20);
    found.remove(5);
    found.reverse();
    assert_eq!(found, together);
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let again = pool.expect("threads can be had").install(|| all(&scenarios));
        assert!(again.iter().map(bits).eq(together.iter().cloned()));
    }
}

#[test]
fn chains_that_differ_in_their_intruders_alone_have_the_bits_that_each_has_alone() {
    let mut draw = Draw(0x1357_9bdf_0246_8ace);
    let mut scenarios = Vec::new();
    for kind in 0..4 {
        for _ in 0..13 {
            let mut scenario = draw.like_the_paper();
            scenario.striker.velocity = 0.45;
            match kind {
                1 => scenario.intruders.push(softer([11, 16])),
                2 => scenario.wall = Some(Wall::flat(Material::STEEL)),
                // Bead 16 comes from the far end and is the first to reach an intruder.
                3 => {
                    scenario.starts = vec![Start::apart([5], 1e-6), Start::moving([16], -0.3)];
                    scenario.intruders.push(softer([14]));
                }
                _ => {}
            }
            scenarios.push(scenario);
        }
    }
    let options = EnsembleOptions::default().with_peaks(&[1, 8, 12]);
    let found = |scenarios: &[Scenario]| -> Vec<_> {
        let outcomes = ensemble(scenarios, &options).into_iter();
        let of = |outcome: EnsembleOutcome| (bits(&outcome), outcome.peaks().to_vec(), outcome.steps());
        outcomes
            .map(|outcome| of(outcome.expect("the scenario runs")))
            .collect()
    };
    let together = found(&scenarios);
    for (one, together) in scenarios.iter().zip(together) {
        assert_eq!(found(std::slice::from_ref(one))[0], together);
    }
}

/// Chains of every kind that goes through the lanes, and those that do not.
fn of_every_kind() -> Vec<Scenario> {
    let mut scenarios = vec![elastic(1, 0.002), elastic(20, 0.006), struck_by_a_bead(20, 0.006)];
    let mut draw = Draw(0x0123_4567_89ab_cdef);
    let mut change = |change: &mut dyn FnMut(&mut Scenario, &mut Draw)| {
        for _ in 0..5 {
            let mut scenario = draw.like_the_paper();
            change(&mut scenario, &mut draw);
            scenarios.push(scenario);
        }
    };
    change(&mut |scenario, draw| {
        let mut wall = Wall::flat(Material::STEEL);
        wall.gap = draw.between(0.0, 1e-5);
        scenario.wall = Some(wall);
    });
    change(&mut |scenario, draw| {
        let mut small = of_radius([3, 7, 8, 12], draw.between(0.014, 0.025));
        small.relaxation = Some(draw.between(0.0, 1e-5));
        scenario.sections = vec![small];
    });
    change(&mut |scenario, draw| {
        // Bead 8 holds two then.
        scenario.intruders.push(softer([1, 8, 9, 16]));
        scenario.intruders[1].damping = draw.between(0.0, 5.0);
    });
    change(&mut |scenario, draw| {
        scenario.starts = vec![
            Start::apart([1], draw.between(0.0, 1e-5)),
            Start::apart([5, 6], draw.between(0.0, 1e-6)),
            Start::moving([16], draw.between(-0.3, 0.3)),
        ];
    });
    change(&mut |scenario, draw| scenario.chain.precompression = draw.between(0.1, 2.0));
    change(&mut |scenario, _| scenario.chain.contact_force = ContactForce::Clipped);
    scenarios
}

#[test]
fn ends_greatest_forces_and_strokes_of_chains_of_every_kind_are_those_of_single_runs() {
    let mut scenarios = of_every_kind();
    let mut draw = Draw(0x5555_4444_3333_2222);
    scenarios.extend((0..30).map(|_| draw.like_the_paper()));
    let options = EnsembleOptions::default()
        .with_peaks(&[8, 1, 5, 99, 8])
        .with_strokes();
    for (scenario, outcome) in scenarios.iter().zip(ensemble(&scenarios, &options)) {
        let outcome = outcome.expect("the scenario runs");
        let solution = exactly(scenario);
        let (exact, found) = (solution.at(solution.end()), outcome.end());
        let speed = scenario.striker.velocity;
        for body in 0..=scenario.chain.beads {
            close(found.velocity(body), exact.velocity(body), 3e-6 * speed);
            close(found.displacement(body), exact.displacement(body), 1e-5 * 1e-3);
        }
        let absorbed = solution.absorption(solution.end());
        for (one, other) in outcome.absorption().iter().zip(absorbed) {
            assert_eq!(one.bead, other.bead);
            let most = 1e-6 * solution.model().initial_energy();
            close(one.dissipated, other.dissipated, most);
        }
        let momentum = solution.model().mass(0) * speed;
        close(found.wall_impulse(), exact.wall_impulse(), 1e-5 * momentum);
        let mut summary = solution.summary();
        summary
            .peak_force
            .retain(|peak| [1, 5, 8].contains(&peak.contact));
        assert_eq!(outcome.peaks().len(), summary.peak_force.len());
        for (one, other) in outcome.peaks().iter().zip(summary.peak_force) {
            assert_eq!(one.contact, other.contact);
            near(one.force, other.force, 1e-5);
            close(one.time, other.time, 1e-8);
        }
        assert_eq!(outcome.strokes().len(), summary.intruders.len());
        // Strokes are some micrometres; an intruder that hardly moves errs as the wave does.
        for (stroke, intruder) in outcome.strokes().iter().zip(summary.intruders) {
            let exact = intruder.relative_displacement_max;
            close(*stroke, exact, 1e-6 * exact.max(1e-5 * speed));
        }
    }
}

#[test]
fn a_scenario_that_cannot_run_leaves_the_others_alone() {
    let mut scenarios = vec![Scenario::paper(); 4];
    scenarios[2].chain.radius = -1.0;
    scenarios[3].intruders[0].mass = 1e-13;
    let outcomes = ensemble(&scenarios, &EnsembleOptions::default());
    assert!(outcomes[0].is_ok() && outcomes[1].is_ok());
    let Err(SimulateError::Input(error)) = &outcomes[2] else {
        panic!("{:?}", outcomes[2])
    };
    assert_eq!(error.key, "chain.radius");
    let stiff = matches!(outcomes[3], Err(SimulateError::TooStiff { bead: 8, .. }));
    assert!(stiff, "{:?}", outcomes[3]);
    assert!(ensemble(&[], &EnsembleOptions::default()).is_empty());
}

#[test]
fn a_chain_that_comes_to_no_end_among_others_is_run_alone() {
    let mut scenarios = vec![Scenario::paper(); 4];
    scenarios[1].chain.radius = 1e10;
    scenarios[2].chain.radius = 1e20;
    let outcomes = all(&scenarios);
    for (scenario, outcome) in scenarios.iter().zip(&outcomes) {
        let exact = exactly(scenario).at(scenario.duration).velocity(0);
        near(outcome.end().velocity(0), exact, 1e-6);
    }
    assert_eq!(bits(&outcomes[0]), bits(&outcomes[3]));
}

#[test]
fn progress_goes_up_to_all() {
    let scenarios = vec![Scenario::paper(); 20];
    let seen = Mutex::new(Vec::new());
    let progress = |part: f64| seen.lock().expect("no thread has failed").push(part);
    let options = EnsembleOptions::default().with_progress(&progress);
    ensemble(&scenarios, &options);
    let mut seen = seen.into_inner().expect("no thread has failed");
    seen.sort_by(f64::total_cmp);
    assert_eq!((seen.len(), seen[2]), (3, 1.0));
}
