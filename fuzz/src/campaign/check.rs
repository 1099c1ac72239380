//! Invariants of a run, whatever fails in it.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use bead_bench::emulation::{Emulation, Placed, Ran};
use bead_bench::faults::{Planned, PlannedKind};
use bead_bench::image::find_image;
use bead_bench::run::RunReport;
use bead_compare::front_end::{AnalogFrontEnd, SAMPLE_RATE_HZ};
use bead_compare::sensed::{load_scenario, simulate_with_ring_down};
use bead_recording::strikes::{RecordedStrike, assemble};
use bead_wire::StrikeFlags;
use hertz_chain::{Scenario, Solution};

use super::Script;

/// The bead that is struck.
const BEAD: usize = 8;
/// Time from the striker's touch of the chain to the trigger, s.
const ARRIVES: std::ops::Range<f64> = 1.3e-3..1.6e-3;
/// A supply that is off by more than this part flags strikes, up to this long after, s.
const OFF: f64 = 2.5e-3;
const OVER: f64 = 0.2;
/// A window ends this long after its strike began, s.
const WINDOW: f64 = 0.013;
/// A sensor that stood still counts as sound with the first block that moved, s.
const LET_GO: f64 = 0.01;
/// Greatest errors of estimates A and B of a strike that no fault touched.
const LIMITS: [f64; 2] = [2e-3, 5e-3];

/// The paper's strike, simulated once, and the image.
pub struct CampaignBench {
    scenario: Scenario,
    solution: Solution,
    image: PathBuf,
}

impl CampaignBench {
    /// Simulates the strike and finds the image.
    ///
    /// # Errors
    /// There is no image; the line says how to build it.
    pub fn new() -> Result<Self, String> {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/scenarios/paper-strike.toml");
        let (scenario, _) = load_scenario(&path).map_err(|error| error.to_string())?;
        let solution = simulate_with_ring_down(&scenario).map_err(|error| error.to_string())?;
        let image = find_image(None).map_err(|error| error.to_string())?;
        Ok(Self {
            scenario,
            solution,
            image,
        })
    }
}

/// Runs a script. Returns the number of strikes measured.
///
/// # Errors
/// The first invariant that does not hold, in a line.
pub fn check(bench: &CampaignBench, script: &Script) -> Result<usize, String> {
    let checked = catch_unwind(AssertUnwindSafe(|| check_unguarded(bench, script)));
    checked.unwrap_or_else(|_| Err("a panic, told above".to_owned()))
}

fn check_unguarded(bench: &CampaignBench, script: &Script) -> Result<usize, String> {
    let emulation = Emulation::place(
        &bench.scenario,
        &bench.solution,
        Placed::alone(BEAD, Some(script.seed)),
        &AnalogFrontEnd::default(),
        script.timing(),
        &bench.image,
    );
    let mut emulation = emulation.map_err(|error| error.to_string())?;
    emulation.faults = script.faults.clone();
    let ran = emulation.run().map_err(|error| error.to_string())?;
    let measured = strikes(&emulation, &ran)?;
    let report = RunReport::of(&emulation, ran, None);
    report
        .verdict(script.strikes)
        .map_err(|error| error.to_string())?;
    Ok(measured)
}

/// Each window is one piece of what the sensors gave, and a strike that no fault touched is measured as
/// without faults.
fn strikes(emulation: &Emulation, ran: &Ran) -> Result<usize, String> {
    let rows = emulation.machine().stimulus;
    let absorbed = emulation.truth.truth.absorbed;
    let strikes = assemble(ran.frames.clone(), Some(emulation.settings));
    for strike in strikes.iter().filter(|strike| strike.missing() == 0) {
        let name = format!("strike {} of boot {}", strike.said.strike, strike.boot);
        let history = (strike.said.trigger_index - strike.said.first_index) as usize;
        let places = places(&rows, strike);
        if places.is_empty() {
            return Err(format!(
                "{name}: no stretch of what the sensors gave is its window"
            ));
        }
        let began = |place: usize| {
            let trigger = (place + history) as f64 / f64::from(SAMPLE_RATE_HZ);
            let starts = emulation.truth.starts.iter();
            let mut starts = starts.map(|start| (start - 1.0) / f64::from(SAMPLE_RATE_HZ));
            starts.find(|start| ARRIVES.contains(&(trigger - start)))
        };
        // Where nothing moves, a window may be anywhere.
        let &[place] = &places[..] else { continue };
        let Some(start) = began(place) else { continue };
        if emulation.faults.iter().any(|fault| touches(fault, start)) {
            continue;
        }
        let said = &strike.said;
        if said.flags != StrikeFlags::NONE {
            let flags: Vec<_> = said.flags.names().collect();
            return Err(format!(
                "{name} at {start:.4} s, which no fault touched, is flagged {flags:?}"
            ));
        }
        let estimates = [said.absorbed_measured, said.absorbed_predicted];
        for ((estimate, limit), which) in estimates.into_iter().zip(LIMITS).zip(["A", "B"]) {
            let off = estimate.joules() / absorbed - 1.0;
            if off.abs() >= limit {
                let off = off * 100.0;
                return Err(format!(
                    "{name} at {start:.4} s, which no fault touched: {which} is off by {off:.3} %"
                ));
            }
        }
    }
    Ok(strikes.len())
}

/// The rows at which the window of a strike may have begun.
fn places(rows: &[[u16; 4]], strike: &RecordedStrike) -> Vec<usize> {
    let is = |place: &usize| {
        let rows = &rows[*place..*place + strike.scans.len()];
        rows.iter().zip(&strike.scans).all(|(row, codes)| {
            let [force, force_wide, acceleration, acceleration_wide] = *row;
            codes.sensitive == [force, acceleration]
                && codes
                    .wide
                    .is_none_or(|wide| wide == [force_wide, acceleration_wide])
        })
    };
    (0..=rows.len().saturating_sub(strike.scans.len()))
        .filter(is)
        .collect()
}

/// Returns `true` if a fault affects the signals of a strike that begins at `start`.
fn touches(fault: &Planned, start: f64) -> bool {
    let ends = fault.at + fault.duration.unwrap_or(f64::INFINITY);
    match fault.kind {
        PlannedKind::ForceStuck
        | PlannedKind::AccelerationStuck
        | PlannedKind::ForceRailed
        | PlannedKind::AccelerationRailed => fault.at < start + WINDOW && start < ends + LET_GO,
        PlannedKind::Supply => {
            let is_off = fault.volts.is_none_or(|volts| (volts / 3.3 - 1.0).abs() > OFF);
            is_off && fault.at < start + WINDOW && start < ends + OVER
        }
        _ => false,
    }
}
