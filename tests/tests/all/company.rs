//! Beads in a row of absorbers: each knows the intruders behind it. The scenario is that of the paper's Fig.
//! 5.

use bead_bench::emulation::{Emulation, Placed};
use bead_compare::emulated::EmulatorReport;
use bead_compare::replay::replay;
use bead_tests::{RunFrames, place, scenario, solved, timed};
use bead_wire::StrikeFlags;
use hertz_chain::{Scenario, Solution};

/// Hosts of the row.
const HOSTS: std::ops::RangeInclusive<usize> = 7..=16;

pub(crate) fn emulation(
    scenario: &Scenario,
    solution: &Solution,
    host: usize,
    noise: Option<u64>,
) -> Emulation {
    place(
        scenario,
        solution,
        Placed::alone(host, noise),
        timed(0.02, 1, 0.1),
    )
}

/// Errors of A and B in per cent, the strike's flags, and what the run cost.
fn measured(emulation: &Emulation) -> ([f64; 2], StrikeFlags, EmulatorReport) {
    let run = emulation.run().unwrap_or_else(|failure| panic!("{failure}"));
    let strikes = RunFrames::new(run.stream).strikes();
    let [strike] = &strikes[..] else {
        panic!("{} strikes", strikes.len())
    };
    assert_eq!(replay(strike).first_difference, None);
    let truth = emulation.truth.truth.absorbed;
    let error = |energy: bead_wire::Energy| (energy.joules() / truth - 1.0) * 100.0;
    let errors = [
        error(strike.said.absorbed_measured),
        error(strike.said.absorbed_predicted),
    ];
    (errors, strike.said.flags, run.report)
}

#[test]
fn every_bead_of_the_row_measures_a_and_predicts_b_and_none_is_flagged() {
    let scenario = scenario("ten-intruders");
    let solution = solved(&scenario);
    let mut worst = [0.0_f64; 2];
    for host in HOSTS {
        let (errors, flags, report) = measured(&emulation(&scenario, &solution, host, Some(1)));
        let cost = report.instructions_per_sample;
        println!(
            "bead {host}: A {:+.3} %, B {:+.3} %, flags {flags:?}; {:.1} instructions a sample in a strike, {:.1} in the busiest block",
            errors[0],
            errors[1],
            cost.total.unwrap_or(f64::NAN),
            cost.worst_block.unwrap_or(f64::NAN)
        );
        worst = std::array::from_fn(|n| worst[n].max(errors[n].abs()));
        assert_eq!(flags, StrikeFlags::NONE, "bead {host}");
        assert!(cost.total.is_some_and(|cost| cost < 500.0), "bead {host}");
        assert!(cost.worst_block.is_some_and(|cost| cost < 617.0), "bead {host}");
    }
    assert!(worst[0] < 0.2 && worst[1] < 0.5, "{worst:?}");
}
