//! A row of beads against the simulation, and the judgement.

use serde::Serialize;

use crate::error::CompareError;
use crate::row::arrivals::Arrivals;
use crate::row::chain::RowChain;
use crate::row::energy::EnergyAlong;
use crate::row::member::BeadOfRow;
use crate::row::strikes::BeadRow;

/// A row of beads against the simulation, as in the JSON. SI units.
#[derive(Debug, Serialize, schemars::JsonSchema)]
pub struct RowComparison {
    /// Strikes that at least one bead felt.
    pub strikes: usize,
    /// The beads, from the striker on.
    pub beads: Vec<BeadOfRow>,
    /// Arrivals and speeds of the wave.
    pub arrivals: Arrivals,
    /// The energy along the row.
    pub energy: EnergyAlong,
    /// Missing beads and values, a line each.
    pub notes: Vec<String>,
    /// True if every check passed.
    pub pass: bool,
    /// The first check that failed.
    pub failure: Option<String>,
}

/// Compares a row with its chain. `notes` list what is known to be missing.
///
/// # Errors
/// The scenario cannot be integrated.
pub fn compare(
    row: &BeadRow,
    chain: &RowChain,
    mut notes: Vec<String>,
) -> Result<RowComparison, CompareError> {
    let arrivals = Arrivals::of(row, chain);
    let energy = EnergyAlong::of(row, chain)?;
    notes.extend(row.missed());
    notes.extend(arrivals.notes(row));
    notes.extend(energy.notes());
    let beads: Vec<_> = row.members.iter().map(|member| member.compared.clone()).collect();
    let failed = |wrong: fn(&BeadOfRow) -> bool| {
        let first = beads.iter().find(|bead| bead.failure.is_some() && wrong(bead))?;
        Some(format!("bead {}: {}", first.bead, first.failure.as_ref()?))
    };
    // A replay that differs is the gravest failure, at whichever bead.
    let failure = failed(|bead| bead.first_difference.is_some()).or_else(|| failed(|_| true));
    Ok(RowComparison {
        strikes: row.strikes.len(),
        beads,
        arrivals,
        energy,
        notes,
        pass: failure.is_none(),
        failure,
    })
}
