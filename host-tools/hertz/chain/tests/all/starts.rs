//! Chains that do not begin at rest and in touch: several strikers, gaps, beads that fly.

use crate::common::{close, elastic, from_height, run, struck_by_a_bead};
use hertz_chain::{Material, Start, Wall};

/// Sokolow, Bittle and Sen, and Job et al. (PRE 67, 066607): as many waves leave as grains come in, one
/// behind another, each weaker than the one before it.
#[test]
fn as_many_waves_run_through_the_chain_as_grains_strike_it() {
    let waves = |strikers: usize| {
        let mut scenario = struck_by_a_bead(60, 0.012);
        // Body 0 and the first beads come together.
        scenario.starts = vec![Start::moving(1..strikers, 0.45)];
        scenario.starts.retain(|start| !start.beads.is_empty());
        let solution = run(&scenario);
        let pulses = solution.pulses(40, &from_height(0.1));
        assert!(pulses.is_sorted_by(|a, b| a.force > b.force), "{pulses:?}");
        assert!(solution.summary().energy.balance_error < 1e-12);
        pulses.len()
    };
    for strikers in 1..=4 {
        assert_eq!(waves(strikers), strikers);
    }
}

/// Two bodies that stand apart meet later, and then do what they would have done at once.
#[test]
fn a_gap_before_the_first_bead_only_delays_the_strike() {
    let touching = elastic(12, 0.003);
    let mut apart = touching.clone();
    let gap = 0.45e-3;
    apart.starts = vec![Start::apart([1], gap)];
    apart.duration += 1e-3;
    let (touching, apart) = (run(&touching), run(&apart));
    for body in 1..=12 {
        let (one, other) = (touching.at(0.003), apart.at(0.004));
        close(one.velocity(body), other.velocity(body), 1e-11 * 0.45);
        // Displacements count from where each body was at t = 0.
        close(one.displacement(body), other.displacement(body), 1e-10 * 1e-4);
    }
    let way = apart.at(0.004).displacement(0) - touching.at(0.003).displacement(0);
    close(way, gap, 1e-14);
    let start = apart.at(0.0);
    close(start.overlap(1), -gap, 1e-18);
    assert_eq!((start.overlap(2), start.displacement(12)), (0.0, 0.0));
}

/// A mirror image: two strikers that meet the chain from both ends at once.
#[test]
fn strikers_from_both_ends_leave_the_middle_at_rest() {
    let mut scenario = struck_by_a_bead(20, 0.006);
    scenario.starts = vec![Start::moving([20], -0.45)];
    let solution = run(&scenario);
    for t in [0.001, 0.003, 0.006] {
        let state = solution.at(t);
        assert!(state.momentum().abs() < 1e-15);
        for body in 0..=10 {
            close(state.velocity(body), -state.velocity(20 - body), 1e-11);
        }
    }
    let model = solution.model();
    close(model.initial_energy() / model.striker_energy(), 2.0, 1e-15);
    assert!(solution.summary().energy.balance_error < 1e-12);
}

/// A row of separate elastic beads of one mass passes the velocity on without loss, whatever the gaps are.
#[test]
fn separate_beads_pass_the_velocity_on_whole() {
    let mut scenario = struck_by_a_bead(6, 0.02);
    scenario.starts = vec![Start::apart(1..=3, 1e-4), Start::apart(4..=6, 3e-4)];
    let solution = run(&scenario);
    let end = solution.at(0.02);
    for body in 0..6 {
        close(end.velocity(body), 0.0, 1e-11);
    }
    close(end.velocity(6) / 0.45, 1.0, 1e-11);
}

#[test]
fn a_gap_at_the_wall_is_crossed_before_the_wall_feels_anything() {
    let free = struck_by_a_bead(10, 0.004);
    let mut walled = free.clone();
    let mut wall = Wall::flat(Material::STEEL);
    wall.gap = 1e-4;
    walled.wall = Some(wall);
    let (free, walled) = (run(&free), run(&walled));
    close(walled.at(0.0).overlap(11), -1e-4, 1e-18);
    // Until the last bead has come this far, there might as well be no wall.
    let crossed = (0..4000)
        .map(|i| 1e-6 * f64::from(i))
        .find(|t| free.at(*t).displacement(10) > 1e-4)
        .expect("it flies away");
    let (before, after) = (crossed - 2e-6, crossed + 1e-5);
    for body in 0..=10 {
        let [one, other] = [&walled, &free].map(|solution| solution.at(before).velocity(body));
        close(one, other, 1e-11);
    }
    assert_eq!(walled.at(before).force(11), 0.0);
    assert!(walled.at(after).force(11) > 1.0);
}
