//! Chains on a ground that drags: -M V/τ on each bead.

use crate::common::{close, elastic, run};
use hertz_chain::{Accuracy, EnsembleOptions, Intruder, Oscillator, Start, ensemble, remaining, simulate};

/// V = V₀ exp(-t/τ), and what the bead has lost is on the ground.
#[test]
fn a_free_bead_comes_to_rest_by_the_closed_form() {
    let (speed, time) = (0.3, 1.3e-3);
    let mut scenario = elastic(2, 5e-3);
    scenario.striker.velocity = 0.0;
    scenario.chain.drag_time = Some(time);
    scenario.starts = vec![Start::moving([1], speed)];
    scenario.starts.push(Start::apart([2], 1.0));
    let solution = run(&scenario);
    let whole = solution.model().initial_energy();
    for t in [1e-4, 1.7e-3, 5e-3] {
        let (at, left) = (solution.at(t), (-t / time).exp());
        close(at.velocity(1), speed * left, 1e-12 * speed);
        close(
            at.displacement(1),
            speed * time * (1.0 - left),
            1e-12 * speed * time,
        );
        close(
            at.energies().dissipated_ground,
            whole * (1.0 - left * left),
            1e-12 * whole,
        );
        close(at.energies().total(), whole, 1e-12 * whole);
    }
    let lost = solution.summary().energy.dissipated_ground.unwrap();
    close(lost, whole * (1.0 - (-2.0 * 5e-3 / time).exp()), 1e-12 * whole);
}

#[test]
fn energies_of_a_struck_chain_add_up_and_an_ensemble_gives_the_same() {
    let mut scenario = elastic(12, 4e-3);
    scenario.intruders = vec![Intruder::new([5, 8], Oscillator::PAPER)];
    scenario.chain.relaxation = 4.2e-6;
    scenario.chain.drag_time = Some(1e-3);
    let summary = simulate(&scenario).unwrap().summary();
    close(summary.energy.balance_error, 0.0, 1e-12);
    assert!(summary.energy.dissipated_ground.unwrap() > 0.1 * summary.energy.striker_initial);
    let outcome = ensemble(&[scenario.clone()], &EnsembleOptions::default())
        .remove(0)
        .unwrap();
    let absorbed = summary.energy.dissipated_intruders;
    close(outcome.absorbed(), absorbed, 1e-6 * absorbed);
    let left = remaining(&scenario, 0.45, Accuracy::REFERENCE).unwrap();
    let parts = left.before + left.within + left.after + left.contacts + left.ground.unwrap();
    close(parts, left.share, 1e-12);
    // The integral of the force, and the momentum that it has given to beads and ground.
    let solution = simulate(&scenario).unwrap();
    let impulse = solution.flow(4).between(0.0, 4e-3).impulse;
    close(solution.at(4e-3).impulse(4), impulse, 1e-10 * impulse);
    scenario.chain.drag_time = None;
    let free = hertz_chain::summarise(&scenario, &hertz_chain::Options::with(Accuracy::DRAFT)).unwrap();
    assert!(free.energy.dissipated_ground.is_none() && free.energy.dissipated_intruders > absorbed);
}
