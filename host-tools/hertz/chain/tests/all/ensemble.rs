//! Ensembles against single runs, chain by chain.

use std::sync::Mutex;

use crate::common::{elastic, softer, struck_by_a_bead};
use hertz_chain::{
    Accuracy, ContactForce, EnsembleOptions, EnsembleOutcome, Intruder, Material, Options, Oscillator,
    Scenario, Section, SimulateError, Solution, Start, Wall, ensemble, simulate_with,
};

/// Random numbers between bounds, equal in every run.
struct ScenarioDraw(u64);

impl ScenarioDraw {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        low + (high - low) * ((self.0 >> 11) as f64 / (1_u64 << 53) as f64)
    }

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
    let accuracy = Accuracy::new(1e-12, 0.25);
    let options = Options::with(accuracy);
    simulate_with(scenario, &options).expect("the scenario runs")
}

fn all(scenarios: &[Scenario]) -> Vec<EnsembleOutcome> {
    ensemble(scenarios, &EnsembleOptions::default())
        .into_iter()
        .map(|outcome| outcome.expect("the scenario runs"))
        .collect()
}

/// Displacements, velocities and what the intruders took, bit for bit.
fn bits(outcome: &EnsembleOutcome) -> Vec<u64> {
    let end = outcome.end();
    let bodies = 0..outcome.model().bodies();
    let mut bits: Vec<u64> = bodies
        .flat_map(|body| [end.displacement(body).to_bits(), end.velocity(body).to_bits()])
        .collect();
    bits.push(outcome.absorbed().to_bits());
    bits
}

#[test]
fn what_is_absorbed_has_an_error_of_a_millionth_at_most() {
    let mut draw = ScenarioDraw(0x9e37_79b9_7f4a_7c15);
    let scenarios: Vec<_> = (0..600).map(|_| draw.like_the_paper()).collect();
    let mut worst = 0.0_f64;
    for (scenario, outcome) in scenarios.iter().zip(all(&scenarios)) {
        let solution = exactly(scenario);
        let exact = solution.at(solution.end()).energies();
        let found = outcome.end().energies();
        worst = worst.max((outcome.absorbed() / exact.dissipated_intruders - 1.0).abs());
        let injected = solution.model().striker_energy() - exact.striker;
        assert!((outcome.injected() / injected - 1.0).abs() < 1e-6);
        let lost = (found.dissipated_contacts - exact.dissipated_contacts).abs();
        assert!(lost < 2e-7 * solution.model().striker_energy(), "{lost:e}");
        assert_eq!(outcome.time(), scenario.duration);
    }
    println!("worst of {}: {worst:.1e}", scenarios.len());
    assert!(worst < 1e-6, "{worst:e}");
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
    let (mut worst, mut of_absorbed) = (0.0_f64, 0.0_f64);
    for (scenario, outcome) in scenarios.iter().zip(all(&scenarios)) {
        let solution = exactly(scenario);
        let exact = solution.at(solution.end()).energies().dissipated_intruders;
        let error = (outcome.absorbed() - exact).abs();
        worst = worst.max(error / solution.model().striker_energy());
        of_absorbed = of_absorbed.max(error / exact);
    }
    println!("worst: {worst:.1e} of the striker's energy, {of_absorbed:.1e} of what is absorbed");
    assert!(worst < 1e-9, "{worst:e}");
}

#[test]
fn a_chain_has_the_same_bits_in_any_company_and_on_any_number_of_threads() {
    let mut draw = ScenarioDraw(0x2545_f491_4f6c_dd1d);
    let scenarios: Vec<_> = (0..43).map(|_| draw.like_the_paper()).collect();
    let together: Vec<_> = all(&scenarios).iter().map(bits).collect();
    let alone = scenarios
        .iter()
        .map(|one| bits(&all(std::slice::from_ref(one))[0]));
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
    let mut draw = ScenarioDraw(0x1357_9bdf_0246_8ace);
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
    let mut draw = ScenarioDraw(0x0123_4567_89ab_cdef);
    let mut change = |change: &mut dyn FnMut(&mut Scenario, &mut ScenarioDraw)| {
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
        let mut small = Section::of([3, 7, 8, 12]);
        small.radius = Some(draw.between(0.014, 0.025));
        small.relaxation = Some(draw.between(0.0, 1e-5));
        scenario.sections = vec![small];
    });
    change(&mut |scenario, draw| {
        scenario.intruders.push(softer([1, 9, 16]));
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
fn chains_of_every_kind_end_as_in_a_single_run() {
    let scenarios = of_every_kind();
    for (scenario, outcome) in scenarios.iter().zip(all(&scenarios)) {
        let solution = exactly(scenario);
        let (exact, found) = (solution.at(solution.end()), outcome.end());
        for body in 0..=scenario.chain.beads {
            let error = (exact.velocity(body) - found.velocity(body)).abs() / scenario.striker.velocity;
            assert!(error < 3e-6, "body {body}: {error:e} in {}", scenario.to_toml());
            let error = (exact.displacement(body) - found.displacement(body)).abs();
            assert!(error < 1e-5 * 1e-3, "body {body}: {error:e}");
        }
        for (one, other) in outcome
            .absorption()
            .iter()
            .zip(solution.absorption(solution.end()))
        {
            assert_eq!(one.bead, other.bead);
            assert!((one.dissipated - other.dissipated).abs() <= 1e-6 * solution.model().initial_energy());
        }
        let impulse = (exact.wall_impulse() - found.wall_impulse()).abs();
        assert!(impulse < 1e-5 * solution.model().mass(0) * scenario.striker.velocity);
    }
}

#[test]
fn the_greatest_forces_of_chosen_contacts_are_those_of_a_single_run() {
    let mut scenarios = of_every_kind();
    let mut draw = ScenarioDraw(0x5555_4444_3333_2222);
    scenarios.extend((0..30).map(|_| draw.like_the_paper()));
    let options = EnsembleOptions::default().with_peaks(&[8, 1, 5, 99, 8]);
    let (mut worst, mut latest) = (0.0_f64, 0.0_f64);
    for (scenario, outcome) in scenarios.iter().zip(ensemble(&scenarios, &options)) {
        let outcome = outcome.expect("the scenario runs");
        let peaks = exactly(scenario).summary().peak_force;
        let wanted: Vec<_> = peaks
            .iter()
            .filter(|peak| [1, 5, 8].contains(&peak.contact))
            .collect();
        assert_eq!(outcome.peaks().len(), wanted.len());
        for (one, other) in outcome.peaks().iter().zip(wanted) {
            assert_eq!(one.contact, other.contact);
            worst = worst.max((one.force / other.force - 1.0).abs());
            latest = latest.max((one.time - other.time).abs());
        }
    }
    println!("worst force {worst:.1e}, worst time {latest:.1e} s");
    assert!(worst < 1e-5 && latest < 1e-8, "{worst:e} {latest:e}");
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
    assert!(
        matches!(outcomes[3], Err(SimulateError::TooStiff { bead: 8, .. })),
        "{:?}",
        outcomes[3]
    );
    assert!(ensemble(&[], &EnsembleOptions::default()).is_empty());
}

#[test]
fn a_chain_that_comes_to_no_end_among_others_is_run_alone() {
    let mut scenarios = vec![Scenario::paper(); 4];
    scenarios[1].chain.radius = 1e10;
    scenarios[2].chain.radius = 1e20;
    let outcomes = all(&scenarios);
    for (scenario, outcome) in scenarios.iter().zip(&outcomes) {
        let wanted = exactly(scenario);
        let (found, wanted) = (
            outcome.end().velocity(0),
            wanted.at(scenario.duration).velocity(0),
        );
        assert!(
            (found / wanted - 1.0).abs() < 1e-6,
            "{found} m/s, not {wanted} m/s"
        );
    }
    assert_eq!(bits(&outcomes[0]), bits(&outcomes[3]));
}

#[test]
fn progress_goes_up_to_all() {
    let scenarios = vec![Scenario::paper(); 20];
    let seen = Mutex::new(Vec::new());
    let told = |part: f64| seen.lock().expect("no thread has failed").push(part);
    let options = EnsembleOptions::default().with_progress(&told);
    ensemble(&scenarios, &options);
    let mut seen = seen.into_inner().expect("no thread has failed");
    seen.sort_by(f64::total_cmp);
    assert_eq!((seen.len(), seen[2]), (3, 1.0));
}

#[test]
fn an_intruder_may_be_in_any_bead_even_the_only_one() {
    let mut scenario = elastic(1, 0.004);
    scenario.intruders = vec![Intruder::new([1], Oscillator::PAPER)];
    let (outcome, solution) = (&all(std::slice::from_ref(&scenario))[0], exactly(&scenario));
    let exact = solution.at(0.004).energies().dissipated_intruders;
    assert!((outcome.absorbed() / exact - 1.0).abs() < 1e-6);
}
