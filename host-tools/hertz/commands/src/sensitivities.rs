//! The derivatives of `bead simulate --sensitivities`: their run, their table and their JSON.

use hertz_chain::tangents::{Dual, Parameter, Sensitivities, sensitivities};
use hertz_chain::{Options, Summary};

use bead_console::prelude::*;

/// Parameters of one run.
const TOGETHER: usize = 8;

/// Derivatives of the results by one parameter, each in its unit over that of the parameter.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct ParameterSensitivities {
    /// Its key in the scenario.
    parameter: String,
    /// Its value, in SI units.
    value: f64,
    /// Of each entry of `peak_force`.
    peak_force: Vec<f64>,
    /// Of the energy dissipated by each entry of `intruders`.
    dissipated: Vec<f64>,
    striker_initial: f64,
    striker_final: f64,
    chain_final: f64,
    intruders_final: f64,
    dissipated_contacts: f64,
}

/// The derivatives of a run's results by every parameter that has some, and the results.
pub(crate) fn of_all(
    scenario: &Scenario,
    options: &Options<'_>,
) -> Result<(Summary, Vec<ParameterSensitivities>), Failure> {
    let mut all = vec![
        ("striker.velocity".to_owned(), Parameter::StrikerVelocity),
        ("chain.young".to_owned(), Parameter::Young),
        ("chain.density".to_owned(), Parameter::Density),
        ("chain.relaxation".to_owned(), Parameter::Relaxation),
    ];
    for (table, intruder) in scenario.intruders.iter().enumerate() {
        let key = |name: &str| format!("intruder[{}].{name}", table + 1);
        all.push((key("stiffness"), Parameter::Stiffness(table)));
        all.push((key("damping"), Parameter::Damping(table)));
        all.push((key("mass"), Parameter::IntruderMass(table)));
        if intruder.cubic_stiffness != 0.0 {
            all.push((key("cubic_stiffness"), Parameter::CubicStiffness(table)));
        }
    }
    let (mut summary, mut rows) = (None, Vec::new());
    for group in all.chunks(TOGETHER) {
        let parameters: Vec<_> = group.iter().map(|(_, parameter)| *parameter).collect();
        let found = sensitivities::<TOGETHER>(scenario, &parameters, options)?;
        for (direction, (key, parameter)) in group.iter().enumerate() {
            let value = parameter.value(scenario).unwrap_or_default();
            rows.push(ParameterSensitivities::of(&found, direction, key.clone(), value));
        }
        summary.get_or_insert(found.summary);
    }
    let summary = summary.ok_or_else(|| failure!(Input, "there is no parameter"))?;
    Ok((summary, rows))
}

impl ParameterSensitivities {
    fn of(found: &Sensitivities<TOGETHER>, direction: usize, parameter: String, value: f64) -> Self {
        let by = |dual: &Dual<TOGETHER>| dual.by[direction];
        Self {
            parameter,
            value,
            peak_force: found.peak_force.iter().map(by).collect(),
            dissipated: found.dissipated.iter().map(by).collect(),
            striker_initial: by(&found.striker_initial),
            striker_final: by(&found.striker_final),
            chain_final: by(&found.chain_final),
            intruders_final: by(&found.intruders_final),
            dissipated_contacts: by(&found.dissipated_contacts),
        }
    }
}

/// Writes a relative change with four decimals; `0` if it rounds to zero.
fn percent(change: f64) -> String {
    if change.abs() < 5e-5 {
        "0".to_owned()
    } else {
        format!("{change:+.4}")
    }
}

/// The change of each result in per cent if a parameter is 1 % greater: dimensionless, to first order.
pub(crate) fn table(summary: &Summary, rows: &[ParameterSensitivities]) -> String {
    let energy = &summary.energy;
    let mut results: Vec<(String, f64, Vec<f64>)> = Vec::new();
    let mut add = |name: String, value: f64, by: &dyn Fn(&ParameterSensitivities) -> f64| {
        let relative = |row: &ParameterSensitivities| by(row) * row.value / value;
        results.push((name, value, rows.iter().map(relative).collect()));
    };
    for (index, peak) in summary.peak_force.iter().enumerate() {
        let name = format!("force of contact {}", peak.contact);
        add(name, peak.force, &|row| row.peak_force[index]);
    }
    for (index, intruder) in summary.intruders.iter().enumerate() {
        let name = format!("dissipated in bead {}", intruder.bead);
        add(name, intruder.dissipated, &|row| row.dissipated[index]);
    }
    type Of = fn(&ParameterSensitivities) -> f64;
    let energies: [(&str, f64, Of); 4] = [
        ("striker, final", energy.striker_final, |row| row.striker_final),
        ("chain, final", energy.chain_final, |row| row.chain_final),
        ("intruders, final", energy.intruders_final, |row| {
            row.intruders_final
        }),
        ("dissipated in contacts", energy.dissipated_contacts, |row| {
            row.dissipated_contacts
        }),
    ];
    for (name, value, by) in energies {
        add(name.to_owned(), value, &by);
    }
    let header = rows.iter().fold("% for 1 % more of".to_owned(), |header, row| {
        format!("{header} | {}", row.parameter)
    });
    // A result of 0 has no relative change.
    let shown = results.into_iter().filter(|(_, value, _)| value.abs() > 0.0);
    let cells = shown.map(|(name, _, relative)| {
        let numbers = relative.into_iter().map(percent);
        std::iter::once(name).chain(numbers).collect::<Vec<_>>()
    });
    let end = summary.final_state.time;
    let at_end = summary.peak_force.iter().filter(|peak| peak.time >= end);
    let at_end: Vec<_> = at_end.map(|peak| peak.contact.to_string()).collect();
    let table = output::table(&header, cells);
    if at_end.is_empty() {
        return table;
    }
    let contacts = at_end.join(", ");
    format!(
        "{table}\n\nRemark: the force of contact {contacts} still rises at the end of the run; its row is for the force at that time."
    )
}
