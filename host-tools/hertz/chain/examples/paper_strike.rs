//! The paper's strike: a small steel ball hits sixteen Bakelite beads, and the eighth holds a mass on a
//! spring. The example first prints the strike as a scenario file.

use hertz_chain::{Scenario, simulate};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scenario = Scenario::paper();
    println!("{}", scenario.to_toml());
    let summary = simulate(&scenario)?.summary();

    println!("contact   peak force     arrives");
    for peak in &summary.peak_force {
        let (contact, force, time) = (peak.contact, peak.force, 1e3 * peak.time);
        println!("{contact:7}   {force:8.4} N   {time:6.4} ms");
    }
    let (energy, absorber) = (summary.energy, &summary.intruders[0]);
    let (brought, kept) = (1e6 * energy.striker_initial, 1e6 * energy.striker_final);
    println!("\nthe striker brought {brought:.2} µJ and kept {kept:.2} µJ");
    let (bead, absorbed) = (absorber.bead, 1e6 * absorber.dissipated);
    println!("the intruder of bead {bead} absorbed {absorbed:.4} µJ");
    println!("the energy balance closes to {:.0e}", energy.balance_error);
    Ok(())
}
