//! A small steel ball strikes sixteen Bakelite beads; the eighth holds a mass on a spring.

use hertz_chain::{Options, Scenario, simulate};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scenario = Scenario::from_toml(include_str!("paper_strike.toml"), "paper_strike.toml")?;
    let solution = simulate(&scenario, &Options::default())?;
    let summary = solution.summary();
    for peak in &summary.peak_force {
        println!(
            "contact {:2}: {:8.4} N at {:6.1} µs",
            peak.contact,
            peak.force,
            1e6 * peak.time
        );
    }
    let (energy, absorber) = (summary.energy, &summary.intruders[0]);
    println!(
        "striker: {:.2} µJ, of which {:.2} µJ came back",
        1e6 * energy.striker_initial,
        1e6 * energy.striker_final
    );
    println!(
        "the intruder of bead {} took {:.1} nJ",
        absorber.bead,
        1e9 * absorber.dissipated
    );
    println!(
        "its acceleration 2.2 ms after the strike: {:.2?} m/s²",
        solution.intruder_acceleration(8, 2.2e-3)
    );
    println!(
        "energy balance closes to {:.0e}; {} steps",
        energy.balance_error, summary.solver.steps
    );
    Ok(())
}
