//! How the time grows with the chain, for a pulse that crosses it.

use hertz_chain::{Accuracy, Scenario};

use crate::ours;
use crate::report::{Aim, Measurements};

const ACCURACY: Accuracy = Accuracy::new(1e-10, 1.0);

fn scenario(beads: usize, relaxation: f64) -> Scenario {
    let mut scenario = Scenario::paper();
    scenario.intruders.clear();
    scenario.chain.beads = beads;
    scenario.chain.relaxation = relaxation;
    scenario.duration = 0.235e-3 * beads as f64;
    scenario
}

/// Shortest time, s, to simulate a strike on a chain of this many beads until the pulse has crossed it.
fn seconds(beads: usize, relaxation: f64, rounds: usize) -> f64 {
    let scenario = scenario(beads, relaxation);
    ours::least_seconds(rounds, || ours::end(&scenario, ACCURACY))
}

/// The most memory that this process has had, GB; `None` where the system does not report it.
fn memory() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kilobytes: f64 = peak.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kilobytes / 1e6)
}

/// From 256 beads to 16,384.
pub(crate) fn measure(report: &mut Measurements, quick: bool) {
    let (most, rounds) = if quick { (4096, 3) } else { (16_384, 7) };
    for (name, relaxation, target) in [("elastic", 0.0, 1.1), ("viscoelastic", 4.2e-6, 1.3)] {
        let (short, long) = (
            seconds(256, relaxation, 4 * rounds),
            seconds(most, relaxation, if relaxation > 0.0 { 1 } else { rounds }),
        );
        let exponent = (long / short).log2() / (most as f64 / 256.0).log2();
        let name = format!("{name} chain: exponent of time, 256 to {most} beads");
        report.goal(name, Some(exponent), Aim::AtMost(target), "");
    }
    let milliseconds = 1e3 * seconds(16_384, 0.0, rounds);
    let name = "16,384 elastic beads crossed at tolerance 1e-10";
    report.goal(name, Some(milliseconds), Aim::AtMost(100.0), "ms");
    let mut huge = scenario(100_000, 4.2e-6);
    huge.duration = 1e-3;
    std::hint::black_box(ours::end(&huge, ACCURACY));
    let name = "100,000 beads: greatest memory of the whole process";
    report.goal(name, memory(), Aim::AtMost(1.0), "GB");
}
