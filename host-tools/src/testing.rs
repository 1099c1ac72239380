//! What the unit tests of several files share.

use hertz_chain::Scenario;

/// The paper's strike, as every user has it.
pub(crate) fn paper_scenario() -> Scenario {
    Scenario::from_toml(
        include_str!("../../docs/scenarios/paper-strike.toml"),
        "paper-strike.toml",
    )
    .unwrap()
}

/// Its first millisecond: the wave does not reach the intruder.
pub(crate) fn short_scenario() -> Scenario {
    Scenario {
        duration: 1e-3,
        ..paper_scenario()
    }
}
