//! JSON schemas of what commands print with `--format json`, made from the types that they print.

use std::collections::BTreeMap;

use bead_wire::Kind;
use serde_json::{Value, json};

use crate::cli::commands::analyse::report::AnalyseReport;
use crate::cli::commands::calibrate::report::CalibrateReport;
use crate::cli::commands::command::{SENT, SENT_LATELY};
use crate::cli::commands::compare_reference::ReferenceReport;
use crate::cli::commands::compare_row::RowReport;
use crate::cli::commands::emulate::SeveralBeads;
use crate::cli::commands::proof::accuracy::StrikerCell;
use crate::cli::commands::proof::calibrate::CalibrateProof;
use crate::cli::commands::proof::coverage::CoverageProof;
use crate::cli::commands::proof::identify::IdentifyProof;
use crate::cli::commands::proof::spheres::SphereCell;
use crate::cli::commands::{
    budget, command, compare, fetch, flash, judge, list, note, recover, replay, settings, trend,
};
use bead_bench::loopback::BenchReport;
use bead_bench::run::RunReport;
use bead_bench::silent::SilentOutcome;
use bead_console::schema::{described, of};
use bead_identify::report::IdentifyReport;
use bead_recording::clock::ClockComparison;
use bead_recording::schemas::{of_bodies, of_body, of_frames};
use hertz_commands::{optimise, optimise_front, periodic, simulate, sweep_cluster, sweep_work};

/// The schema of each result by its name, which is that of a file in docs/schemas.
pub fn of_results() -> BTreeMap<&'static str, Value> {
    let mut all = BTreeMap::new();
    let mut add = |name, schema| all.insert(name, schema);
    add("analyse", of::<AnalyseReport>("analyse"));
    add("bench", of::<BenchReport>("bench"));
    add("budget", of::<budget::BudgetReport>("budget"));
    add("calibrate", of::<CalibrateReport>("calibrate"));
    add("clock", of::<ClockComparison>("clock"));
    add("command-done", of::<command::Done>("command arm"));
    add("command-raw", of::<command::Streamed>("command raw"));
    add("command-reboot", of::<command::Rebooted>("command reboot"));
    let mut identity = of_body(Kind::Identity);
    // `board` is null from a bead that sends none.
    identity["properties"]["board"] = json!({ "anyOf": [of_body(Kind::Board), { "type": "null" }] });
    add("command-identity", described(identity, "command identity"));
    add("command-keep", of::<command::Kept>("command keep"));
    add(
        "command-self-test",
        of::<Vec<command::CheckResult>>("command self-test"),
    );
    add(
        "command-status",
        described(of_bodies(&SENT, &SENT_LATELY), "command status"),
    );
    add("compare", of::<compare::CompareReport<'_>>("compare"));
    add(
        "compare-reference",
        of::<ReferenceReport<'_>>("compare --reference"),
    );
    add("compare-row", of::<RowReport<'_>>("compare of several beads"));
    add("decode", of_lines("decode", Kind::ALL));
    add("emulate", of::<RunReport>("emulate"));
    add("emulate-several", of::<SeveralBeads>("emulate of several beads"));
    add("fetch", of::<fetch::FetchReport<'_>>("fetch --out"));
    add("fetch-list", of::<fetch::KeptStrikes<'_>>("fetch"));
    add("flash", of::<flash::FlashReport>("flash"));
    add("identify", of::<IdentifyReport>("identify"));
    add("judge", of::<judge::JudgeReport>("judge"));
    add("list", of::<list::ListReport>("list"));
    add("note", of::<note::NotesReport>("note"));
    add("optimise", of::<optimise::SearchReport>("optimise"));
    add(
        "optimise-front",
        of::<optimise_front::FrontReport>("optimise with several masses"),
    );
    add("periodic", of::<periodic::PeriodicReport>("periodic"));
    add("proof-accuracy", of::<Vec<StrikerCell>>("proof accuracy"));
    add("proof-calibrate", of::<CalibrateProof>("proof calibrate"));
    add("proof-coverage", of::<CoverageProof>("proof coverage"));
    add("proof-identify", of::<IdentifyProof>("proof identify"));
    add("proof-spheres", of::<Vec<SphereCell>>("proof spheres"));
    add("proof-silent", of::<Vec<SilentOutcome>>("proof silent"));
    add("record", of_lines("record", &[Kind::Strike, Kind::Fault]));
    add("recover", of::<recover::RecoverReport>("recover"));
    add("replay", of::<replay::ReplayReport>("replay"));
    add("settings", of::<settings::SettingsReport>("settings read"));
    add("simulate", of::<simulate::SimulateReport>("simulate"));
    add("sweep", of::<sweep_work::SweepReport<'_>>("sweep"));
    add("sweep-plan", of::<sweep_cluster::PlanReport<'_>>("sweep plan"));
    add(
        "sweep-status",
        of::<sweep_cluster::StatusReport<'_>>("sweep status"),
    );
    add("trend", of::<trend::TrendReport>("trend"));
    all
}

/// The schema of the lines of `bead COMMAND`: frames of these kinds.
fn of_lines(command: &str, kinds: &[Kind]) -> Value {
    let mut schema = of_frames(kinds);
    schema["title"] = format!("A line that `bead {command}` prints").into();
    schema
}
