//! Contacts beyond the limits of the model.

use crate::common::{changed, elastic, near, run, says};
use hertz_chain::{ContactLaw, Damping, Scenario, Validity};

fn of(scenario: &Scenario) -> Vec<Validity> {
    let peaks = run(scenario).summary().peak_force;
    Validity::of(scenario, &peaks).expect("the scenario is in order")
}

#[test]
fn the_papers_strike_is_elastic_and_one_of_twice_its_speed_is_not() {
    let contacts = of(&Scenario::paper());
    // As in `docs/hardware.md`. Without viscosity the force is greater, and the pressure is 253 MPa.
    near(contacts[0].pressure, 245e6, 2e-3);
    near(of(&elastic(16, 0.006))[0].pressure, 253e6, 5e-3);
    for contact in &contacts {
        assert!(contact.remarks().is_empty(), "{contact:?}");
        // A wave is longer by far than a sphere's own vibration, of some 40 µs.
        let is_wave = contact.contact > 1;
        assert!(
            !is_wave || contact.periods.is_none_or(|periods| periods > 3.0),
            "{contact:?}"
        );
        assert!(!is_wave || contact.pressure < 100e6 && contact.radius_ratio < 0.02);
    }
    // p₀ goes as V^(2/5).
    let faster = |times: f64| changed(Scenario::paper(), |one| one.striker.velocity *= times);
    assert!(of(&faster(1.8))[0].remarks().is_empty());
    let remarks = of(&faster(2.1))[0].remarks();
    says(&remarks[0], "", "Bakelite yields from 320 MPa on");
}

#[test]
fn metals_that_yield_are_remarked_on() {
    let text = include_str!("../../../../../docs/scenarios/own-chain.toml");
    let mut chain = Scenario::from_toml(text, "own-chain.toml").expect("the scenario is sound");
    let steel_and_brass = |chain: &Scenario| {
        let contacts = of(chain);
        [1, 11].map(|contact: usize| contacts[contact - 1].remarks().join(" "))
    };
    let [steel, brass] = steel_and_brass(&chain);
    says(&steel, "", "hardened bearing steel yields from 3200 MPa on");
    says(&brass, "", "hard brass yields from 560 MPa on");
    chain.striker.velocity *= 0.8;
    assert_eq!(steel_and_brass(&chain)[0], "");
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

#[test]
fn contacts_with_a_stiffness_of_their_own_have_no_pressure_of_hertz() {
    let with = |law: ContactLaw| of(&changed(elastic(6, 0.002), |one| one.contact = Some(law)));
    assert!(with(ContactLaw::power(2.0, 2e11)).is_empty());
    let damped = ContactLaw::default().damped(Damping::LammpsTsuji, 0.1);
    assert!(with(damped).iter().any(|contact| contact.pressure > 1e7));
}
