#![doc = include_str!("../README.md")]

mod absorption;
mod bisection;
mod collision;
mod curve;
mod dispersion;
mod drive;
mod ensemble;
mod fit;
mod flow;
mod injection;
mod model;
mod optimise;
mod options;
mod oscillator;
mod oscillator_fit;
mod periodic;
mod power_law;
mod pulse;
mod quantity;
mod region;
mod run;
mod scenario;
mod shaker;
mod signal;
mod simulate;
mod snapshots;
pub mod solitary;
mod solution;
mod solver;
mod spectrum;
mod split;
mod summariser;
mod summary;
mod tableau;
pub mod tangents;
mod transmission;
mod validity;

pub use absorption::Absorption;
pub use collision::Collision;
pub use curve::Curve;
pub use dispersion::{Bands, Dispersion};
pub use ensemble::{EnsembleOptions, EnsembleOutcome, ensemble};
pub use fit::FitError;
pub use flow::{Flow, Transfer};
pub use injection::Injection;
pub use model::{Contact, Energies, HostedIntruder, Model};
pub use optimise::{
    Aim, BeadRadius, Catalogue, CatalogueSpring, Objective, OptimiseError, Optimum, Remaining, Robustness,
    Search, SearchObserver, SearchProgress, Sizes, Spread, SpringChoice, optimise, remaining,
};
pub use oscillator::Oscillator;
pub use oscillator_fit::{OscillatorFit, fit_response, fit_ring_down};
pub use periodic::{
    Bifurcation, Branch, BranchEnd, BranchOptions, BranchPoint, DriveParameter, PeriodExtremes,
    PeriodicError, PeriodicState,
};
pub use power_law::PowerLaw;
pub use pulse::{Pulse, PulseSearch};
pub use realfft::num_complex::Complex64;
pub use region::RegionEnergies;
pub use run::{Run, RunStep, StepView};
pub use scenario::{
    Chain, ContactForce, ContactLaw, Damping, Drive, DriveQuantity, InputError, Intruder, MOST_BEADS,
    Material, Scenario, Section, Start, Striker, TomlFile, Wall, plain_words, read_table, read_text,
};
pub use shaker::{FrequencySweep, ShakerResponse};
pub use signal::Signal;
pub use simulate::{Accuracy, Options, SimulateError, simulate, simulate_with};
pub use snapshots::Snapshots;
pub use solution::{IntruderMotion, Sampler, Snapshot, Solution};
pub use spectrum::Spectrum;
pub use split::Split;
pub use summariser::{Summariser, summarise};
pub use summary::{ContactPeak, EnergySummary, FinalState, IntruderSummary, SolverSummary, Summary};
pub use transmission::{TransmissionFit, energies_left};
pub use validity::Validity;
