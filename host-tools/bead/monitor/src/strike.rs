//! A strike as pages show it.

use std::sync::OnceLock;

use bead_recording::assembly::Assembled;
use bead_recording::signal::Signal;
use bead_recording::strike::RecordedStrike;
use bead_recording::uncertainties::{of_energies, of_force};
use schemars::JsonSchema;
use serde::Serialize;

/// Curves of a strike, a value for each scan of its window.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct Curves {
    /// Time of the first scan from the trigger, ms.
    pub from_ms: f64,
    /// Time from scan to scan, ms.
    pub step_ms: f64,
    /// Force at the incoming contact, N.
    pub force_n: Vec<f32>,
    /// Acceleration of the intruder, m/s².
    pub acceleration: Vec<f32>,
    /// Measured acceleration less the one that the force predicts, m/s².
    pub residual: Vec<f32>,
}

/// A strike that came, whole or with gaps. Its curves are computed when a page first asks for them.
#[derive(Debug, Serialize, JsonSchema)]
pub struct ShownStrike {
    /// Its place among all strikes of this monitor, from 1.
    pub serial: u64,
    /// Address of its bead.
    pub bead: u8,
    /// Number since the bead's reset.
    pub strike: u32,
    /// Time of the trigger since the bead's reset, s.
    pub at_s: Option<f64>,
    /// Time of the trigger since the last edge at the bead's sync input before it, and from edge to edge, s.
    pub since_edge_s: Option<[f64; 2]>,
    /// Receive time, ms since 1970. `None` for a fetched strike.
    pub received_ms: Option<f64>,
    /// Highest force, N.
    pub peak_force_n: f64,
    /// Its standard uncertainty, N.
    pub peak_force_u: Option<f64>,
    /// Lowest and highest acceleration, m/s².
    pub acceleration: [f64; 2],
    /// Estimate A, nJ.
    pub absorbed_measured_nj: f64,
    /// Its standard uncertainty, nJ.
    pub absorbed_measured_u: Option<f64>,
    /// Estimate B, nJ.
    pub absorbed_predicted_nj: f64,
    /// Its standard uncertainty, nJ.
    pub absorbed_predicted_u: Option<f64>,
    /// Rms of measured less predicted acceleration over that of the measured one.
    pub residual: Option<f64>,
    /// Flags in words.
    pub flags: Vec<String>,
    /// True if it was fetched later.
    pub fetched: bool,
    /// Number of samples that did not come.
    pub missing: usize,
    #[serde(skip)]
    recorded: RecordedStrike,
    #[serde(skip)]
    curves: OnceLock<Option<Curves>>,
}

impl ShownStrike {
    /// The strike with this serial number. `edges` are the positions of the last edges at the sync input of
    /// its bead, in samples, ascending.
    pub fn new(serial: u64, assembled: Assembled, edges: &[f64]) -> Self {
        let recorded = assembled.strike;
        let said = &recorded.said;
        let energies = recorded.shape.as_ref().and_then(|shape| of_energies(shape, said));
        let energy_u = |which: usize| energies.and_then(|all| all[which]).map(|u| u * 1e9);
        let stated = recorded
            .settings
            .and_then(|settings| settings.description().uncertainty);
        let waveform = recorded.shape.and_then(|shape| shape.waveform);
        let trigger = said.trigger_index as f64;
        let since_edge = |rate: u32| {
            let behind = edges.partition_point(|edge| *edge <= trigger);
            let [before, last] = edges.get(behind.checked_sub(2)?..behind)?.try_into().ok()?;
            Some([trigger - last, last - before].map(|samples: f64| samples / f64::from(rate)))
        };
        Self {
            since_edge_s: recorded.rate().and_then(since_edge),
            serial,
            bead: recorded.address,
            strike: said.strike,
            at_s: recorded
                .rate()
                .map(|rate| said.trigger_index as f64 / f64::from(rate)),
            received_ms: recorded.received_ns.map(|ns| ns as f64 * 1e-6),
            peak_force_n: said.peak_force.newtons(),
            peak_force_u: stated.and_then(|stated| of_force(said, &stated)).map(|[u, _]| u),
            acceleration: [said.acceleration_min, said.acceleration_max]
                .map(|a| a.metres_per_second_squared()),
            absorbed_measured_nj: said.absorbed_measured.joules() * 1e9,
            absorbed_measured_u: energy_u(0),
            absorbed_predicted_nj: said.absorbed_predicted.joules() * 1e9,
            absorbed_predicted_u: energy_u(1),
            residual: waveform.map(|waveform| waveform.residual.ratio()),
            flags: said.flags.names().map(|name| name.replace('_', " ")).collect(),
            fetched: assembled.fetched.is_some(),
            missing: recorded.missing(),
            recorded,
            curves: OnceLock::new(),
        }
    }

    /// Its curves, up to the first gap. `None` without settings or if the start of the window is missing.
    pub fn curves(&self) -> Option<&Curves> {
        let curves = || {
            let strike = &self.recorded;
            let settings = strike.settings.as_ref()?;
            let signal = Signal::of(&strike.scans, settings)?;
            let step_ms = 1e3 / f64::from(strike.rate()?);
            let before = strike.said.trigger_index.wrapping_sub(strike.said.first_index) as f64;
            let narrow = |values: &[f64]| values.iter().map(|value| *value as f32).collect();
            Some(Curves {
                from_ms: -before * step_ms,
                step_ms,
                residual: narrow(&signal.residual(settings)),
                force_n: narrow(&signal.force),
                acceleration: narrow(&signal.acceleration),
            })
        };
        self.curves.get_or_init(curves).as_ref()
    }

    /// Estimate A and two standard uncertainties, nJ, as `829.7 ± 38.7`, with the digits that these have.
    pub fn measured(&self) -> String {
        with_u(self.absorbed_measured_nj, self.absorbed_measured_u)
    }

    /// Estimate B and two standard uncertainties, nJ.
    pub fn predicted(&self) -> String {
        with_u(self.absorbed_predicted_nj, self.absorbed_predicted_u)
    }

    /// The highest force and two standard uncertainties, N.
    pub fn peak(&self) -> String {
        with_u(self.peak_force_n, self.peak_force_u)
    }
}

fn with_u(value: f64, u: Option<f64>) -> String {
    match u.map(|u| 2.0 * u) {
        Some(u) if u > 0.0 => {
            let digits = (2 - u.log10().floor() as i32).clamp(0, 6) as usize;
            format!("{value:.digits$} ± {u:.digits$}")
        }
        _ => format!("{value:.3}"),
    }
}
