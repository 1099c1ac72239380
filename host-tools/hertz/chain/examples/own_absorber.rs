//! Your own absorber: what do a mass, a stiffness and a damping of your choice take from the paper's strike,
//! in one bead or in several? Change the table and run it.

use hertz_chain::{Intruder, Oscillator, PulseSearch, Scenario, simulate};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut scenario = Scenario::paper();
    scenario.chain.beads = 30;
    // Long enough for all intruders to ring down.
    scenario.duration = 0.012;

    println!(
        "absorber          in beads     absorbed   of the wave at 8   of what the striker gave   still ringing"
    );
    let paper = Oscillator::PAPER;
    let softer = Oscillator {
        stiffness: 1.0e5,
        ..paper
    };
    for (name, beads, oscillator) in [
        ("the paper's", 8..=8, paper),
        ("a softer spring", 8..=8, softer),
        ("ten of these", 8..=17, softer),
    ] {
        scenario.intruders = vec![Intruder::new(beads.clone(), oscillator)];
        let solution = simulate(&scenario)?;
        let each = solution.absorption(solution.end());
        let absorbed: f64 = each.iter().map(|one| one.dissipated).sum();
        let share: f64 = each.iter().map(|one| one.of_injected).sum();
        let wave = solution.pulses(8, &PulseSearch::default())[0].energy;
        let stored: f64 = each.iter().map(|one| one.stored).sum();
        println!(
            "{name:15}   {:>8}   {:7.4} µJ   {:14.3} %   {:22.3} %   {:10.4} µJ",
            format!("{}-{}", beads.start(), beads.end()),
            1e6 * absorbed,
            1e2 * absorbed / wave,
            1e2 * share,
            1e6 * stored,
        );
    }
    Ok(())
}
