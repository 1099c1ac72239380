//! The example of docs/library.md.

use hertz_chain::{Scenario, simulate};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut scenario = Scenario::paper(); // or Scenario::load("my-chain.toml")?
    scenario.striker.velocity = 0.8; // m/s
    let solution = simulate(&scenario)?;
    let absorbed = solution.summary().intruders[0].dissipated; // J
    let force = solution.at(1.8e-3).force(8); // N, at 1.8 ms
    println!("{:.1} nJ absorbed; {force:.3} N at bead 8", 1e9 * absorbed);
    Ok(())
}
