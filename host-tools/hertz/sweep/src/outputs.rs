//! Results that a sweep keeps of each run.

use std::collections::HashMap;

use hertz_chain::{ContactPeak, EnsembleOutcome};
use serde::Deserialize;

use bead_tables::{Cell, CellKind, Column};

/// The results to keep.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SweepOutputs {
    /// Energy dissipated by all intruders at the end: in J, and as parts of the striker's and the injected
    /// energy.
    pub absorbed: bool,
    /// Energies at the end, J.
    pub energies: bool,
    /// Hosts whose intruders' dissipated energy is kept.
    pub intruders: Vec<usize>,
    /// Contacts whose greatest force is kept.
    pub peaks: Vec<usize>,
    /// Contacts whose time of the greatest force is kept.
    pub arrivals: Vec<usize>,
    /// Beads behind which the energy at the end is kept: in J, and as a part of the injected.
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
                "dissipated_ground_j",
            ];
            names.extend(energies.map(str::to_owned));
        }
        let [intruders, peaks, arrivals] = [&self.intruders, &self.peaks, &self.arrivals].map(|of| of.iter());
        names.extend(intruders.map(|bead| format!("bead_{bead}_intruder_dissipated_j")));
        names.extend(peaks.map(|contact| format!("contact_{contact}_peak_force_n")));
        names.extend(arrivals.map(|contact| format!("contact_{contact}_peak_time_s")));
        let behind = |bead: &usize| ["j", "of_injected"].map(|unit| format!("behind_bead_{bead}_{unit}"));
        names.extend(self.transmission.iter().flat_map(behind));
        let column = |name| Column::new(name, CellKind::Number);
        names.into_iter().map(column).collect()
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
        // A part of zero energy is null.
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
            let at_end = end.energies();
            let of_bodies = [injected, at_end.striker, at_end.chain, at_end.intruders];
            let dissipated = [
                at_end.dissipated_contacts,
                at_end.dissipated_intruders,
                at_end.dissipated_ground,
            ];
            cells.extend(of_bodies.into_iter().chain(dissipated).map(Cell::Number));
        }
        let hosts = self.intruders.iter().copied();
        cells.extend(hosts.map(|bead| {
            let intruders = model.intruders_of(bead);
            let dissipated: f64 = intruders.clone().map(|number| end.dissipated_by(number)).sum();
            Cell::number(Some(dissipated).filter(|_| !intruders.is_empty()))
        }));
        let peaks: HashMap<usize, &ContactPeak> =
            outcome.peaks().iter().map(|peak| (peak.contact, peak)).collect();
        let of_peaks = |contacts: &[usize], value: fn(&ContactPeak) -> f64| -> Vec<Cell> {
            let peaks = contacts.iter().map(|contact| peaks.get(contact));
            peaks
                .map(|peak| Cell::number(peak.map(|peak| value(peak))))
                .collect()
        };
        cells.extend(of_peaks(&self.peaks, |peak| peak.force));
        cells.extend(of_peaks(&self.arrivals, |peak| peak.time));
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
