//! JSON schemas of what commands print with `--format json`, made from the types that they print.

use std::collections::BTreeMap;

use bead_wire::Kind;
use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde_json::Value;

use crate::cli::commands::{
    command, compare, compare_reference, compare_row, emulate, fetch, optimise, proof, recover, replay,
    settings, simulate, sweep_cluster, sweep_work,
};
use crate::cli::frame_schemas::{self, describe};
use bead_bench::run::RunReport;
use bead_recording::clock::ClockComparison;

/// The schema of each result by its name, which is that of a file in docs/schemas.
pub fn of_results() -> BTreeMap<&'static str, Value> {
    BTreeMap::from([
        ("clock", of::<ClockComparison>("clock")),
        ("command-done", of::<command::Done>("command arm")),
        ("command-raw", of::<command::Streamed>("command raw")),
        ("command-reboot", of::<command::Rebooted>("command reboot")),
        ("command-identity", frame_schemas::of_identity()),
        (
            "command-self-test",
            of::<Vec<command::CheckResult>>("command self-test"),
        ),
        ("command-status", frame_schemas::of_reports()),
        ("compare", of::<compare::Report<'_>>("compare")),
        (
            "compare-reference",
            of::<compare_reference::Report<'_>>("compare --reference"),
        ),
        (
            "compare-row",
            of::<compare_row::Report<'_>>("compare of several beads"),
        ),
        ("decode", frame_schemas::of_lines("decode", Kind::ALL)),
        ("emulate", of::<RunReport>("emulate")),
        (
            "emulate-several",
            of::<emulate::SeveralBeads>("emulate of several beads"),
        ),
        ("fetch", of::<fetch::Fetched<'_>>("fetch --out")),
        ("fetch-list", of::<fetch::KeptStrikes<'_>>("fetch")),
        ("optimise", of::<optimise::SearchReport>("optimise")),
        (
            "proof-accuracy",
            of::<Vec<proof::accuracy::StrikerCell>>("proof accuracy"),
        ),
        (
            "proof-spheres",
            of::<Vec<proof::spheres::SphereCell>>("proof spheres"),
        ),
        (
            "record",
            frame_schemas::of_lines("record", &[Kind::Strike, Kind::Fault]),
        ),
        ("recover", of::<recover::Report<'_>>("recover")),
        ("replay", of::<replay::Report<'_>>("replay")),
        ("settings", of::<settings::Report>("settings read")),
        ("simulate", of::<simulate::Report<'_>>("simulate")),
        ("sweep", of::<sweep_work::Report<'_>>("sweep")),
        ("sweep-plan", of::<sweep_cluster::PlanReport<'_>>("sweep plan")),
        (
            "sweep-status",
            of::<sweep_cluster::StatusReport<'_>>("sweep status"),
        ),
    ])
}

/// The schema of what `bead COMMAND` prints, with the version that [`print_json`](super::output::print_json)
/// puts into each object.
pub fn of<T: JsonSchema>(command: &str) -> Value {
    let generator = SchemaSettings::draft2020_12().for_serialize().into_generator();
    let mut schema = Value::from(generator.into_root_schema_for::<T>());
    describe(&mut schema, command);
    schema
}
