//! Sweeps over the paper's strike, for tests.

use hertz_chain::{InputError, Scenario};

use crate::definition::Definition;
use crate::plan::Plan;

/// The definition of a sweep over these axes, from a file called `sweep.toml`.
pub(crate) fn definition(axes: &str) -> Result<Definition, InputError> {
    let paper = Scenario::paper().to_toml();
    let inner = ["[intruder", "chain", "striker"]
        .into_iter()
        .fold(paper, |text, table| {
            let (bracket, name) = table.split_at(table.len() - table.trim_start_matches('[').len());
            text.replace(&format!("[{table}"), &format!("[{bracket}scenario.{name}"))
        });
    Definition::from_toml(&format!("{axes}\n[scenario]\n{inner}"), "sweep.toml")
}

/// The plan of a sweep over these axes.
pub(crate) fn plan(axes: &str) -> Plan {
    Plan::new(definition(axes).unwrap()).unwrap()
}
