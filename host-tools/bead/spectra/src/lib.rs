//! Spectra of strikes: shock response, power density, Fourier transform, transfer with coherence.
//!
//! # Design
//! `oscillator`, [`shock`], [`fourier`], [`transfer`] and [`statistics`] compute with slices of numbers and
//! know nothing of beads. [`strike`] makes signals in SI units of a recorded strike, or says why it has none;
//! [`plan`] holds what is computed of each, and [`bead`] gathers the strikes one after another, so memory
//! does not grow with them. [`table`] and [`picture`] show the result.

pub mod bead;
pub mod fourier;
pub mod oscillator;
pub mod picture;
pub mod plan;
pub mod shock;
pub mod statistics;
pub mod strike;
pub mod table;
pub mod transfer;
