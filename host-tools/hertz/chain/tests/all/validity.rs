//! Where the model's contacts are not what bodies do.

use crate::common::{elastic, near, run};
use hertz_chain::{Scenario, Validity};

fn of(scenario: &Scenario) -> Vec<Validity> {
    let peaks = run(scenario).summary().peak_force;
    Validity::of(scenario, &peaks).expect("the scenario is in order")
}

#[test]
fn the_papers_striker_presses_bakelite_beyond_its_strength_and_the_wave_does_not() {
    let contacts = of(&Scenario::paper());
    // As `docs/hardware.md` has it. Without viscosity the force is greater, and it is 253 MPa.
    near(contacts[0].pressure, 245e6, 2e-3);
    near(of(&elastic(16, 0.006))[0].pressure, 253e6, 5e-3);
    let remarks = contacts[0].remarks();
    assert!(remarks[0].contains("Bakelite yields near 200 MPa"), "{remarks:?}");
    for contact in &contacts[1..] {
        assert!(contact.remarks().is_empty(), "{contact:?}");
        assert!(contact.pressure < 100e6 && contact.radius_ratio < 0.02);
        // A wave is longer by far than a sphere's own vibration, of some 40 µs.
        assert!(contact.periods.is_none_or(|periods| periods > 3.0), "{contact:?}");
    }
}

#[test]
fn wide_contacts_and_short_pulses_are_remarked_on() {
    let mut wide = Scenario::paper();
    wide.chain.young = 1e6;
    let mut short = Scenario::paper();
    (short.striker.velocity, short.striker.radius) = (100.0, 0.0005);
    short.duration = 0.001;
    for (scenario, words) in [(wide, "radius wide"), (short, "own period")] {
        let remarks = of(&scenario)[0].remarks();
        assert!(remarks.iter().any(|remark| remark.contains(words)), "{remarks:?}");
    }
}
