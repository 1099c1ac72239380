//! Results that a sweep keeps of each run.

use std::collections::HashMap;

use hertz_chain::{ContactPeak, EnsembleOutcome};
use serde::{Deserialize, Serialize};

use bead_tables::{Cell, Column, Kind};

/// The results to keep.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SweepOutputs {
    /// Energy dissipated by all intruders at the end: in J, and as parts of the striker's and the injected
    /// energy.
    pub absorbed: bool,
    /// Energies at the end, J.
    pub energies: bool,
    /// Hosts whose intruders' dissipated energy is kept.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub intruders: Vec<usize>,
    /// Contacts whose greatest force is kept.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub peaks: Vec<usize>,
    /// Contacts whose time of the greatest force is kept.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub arrivals: Vec<usize>,
    /// Beads behind which the energy at the end is kept: in J, and as a part of the injected.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub transmission: Vec<usize>,
}

impl Default for SweepOutputs {
    fn default() -> Self {
        Self {
            absorbed: true,
            energies: false,
            intruders: Vec::new(),
            peaks: Vec::new(),
            arrivals: Vec::new(),
            transmission: Vec::new(),
        }
    }
}

impl SweepOutputs {
    /// The columns, all of numbers.
    pub fn columns(&self) -> Vec<Column> {
        let mut names: Vec<String> = Vec::new();
        if self.absorbed {
            names.extend(["absorbed_j", "absorbed_of_striker", "absorbed_of_injected"].map(str::to_owned));
        }
        if self.energies {
            let energies = [
                "injected_j",
                "striker_final_j",
                "chain_final_j",
                "intruders_final_j",
                "dissipated_contacts_j",
                "dissipated_intruders_j",
            ];
            names.extend(energies.map(str::to_owned));
        }
        let each = |of: &[usize], name: fn(usize) -> Vec<String>| {
            of.iter().flat_map(|n| name(*n)).collect::<Vec<_>>()
        };
        names.extend(each(&self.intruders, |bead| {
            vec![format!("bead_{bead}_intruder_dissipated_j")]
        }));
        names.extend(each(&self.peaks, |contact| {
            vec![format!("contact_{contact}_peak_force_n")]
        }));
        names.extend(each(&self.arrivals, |contact| {
            vec![format!("contact_{contact}_peak_time_s")]
        }));
        names.extend(each(&self.transmission, |bead| {
            vec![
                format!("behind_bead_{bead}_j"),
                format!("behind_bead_{bead}_of_injected"),
            ]
        }));
        names
            .into_iter()
            .map(|name| Column::new(name, Kind::Number))
            .collect()
    }

    /// Contacts whose greatest force must be found.
    pub fn contacts(&self) -> Vec<usize> {
        [self.peaks.as_slice(), &self.arrivals].concat()
    }

    /// The cells of a run, one for each of the [`columns`](Self::columns); null for a bead or contact that
    /// the chain does not have.
    pub fn cells(&self, outcome: &EnsembleOutcome) -> Vec<Cell> {
        let (end, model) = (outcome.end(), outcome.model());
        let (absorbed, injected) = (outcome.absorbed(), outcome.injected());
        // A part of no energy is null.
        let part = |energy: f64, of: f64| Cell::number(Some(energy / of).filter(|part| part.is_finite()));
        let mut cells = Vec::new();
        if self.absorbed {
            cells.extend([
                Cell::Number(absorbed),
                part(absorbed, model.striker_energy()),
                part(absorbed, injected),
            ]);
        }
        if self.energies {
            let energies = end.energies();
            cells.extend(
                [
                    injected,
                    energies.striker,
                    energies.chain,
                    energies.intruders,
                    energies.dissipated_contacts,
                    energies.dissipated_intruders,
                ]
                .map(Cell::Number),
            );
        }
        cells.extend(
            self.intruders
                .iter()
                .map(|bead| Cell::number(end.intruder_dissipated(*bead))),
        );
        let peaks: HashMap<usize, &ContactPeak> =
            outcome.peaks().iter().map(|peak| (peak.contact, peak)).collect();
        let peak = |contact: &usize| peaks.get(contact);
        cells.extend(
            self.peaks
                .iter()
                .map(|c| Cell::number(peak(c).map(|peak| peak.force))),
        );
        cells.extend(
            self.arrivals
                .iter()
                .map(|c| Cell::number(peak(c).map(|peak| peak.time))),
        );
        for bead in &self.transmission {
            let last = model.bodies() - 1;
            cells.extend(if *bead < last {
                let energy = end.region(bead + 1..=last).mechanical();
                [Cell::Number(energy), part(energy, injected)]
            } else {
                [Cell::Null, Cell::Null]
            });
        }
        cells
    }
}
