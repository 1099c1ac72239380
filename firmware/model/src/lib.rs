//! The bead's computation from the codes of its two sensors, sample by sample, in fixed point.
//!
//! # Design
//!
//! A [`Meter`] watches the force. When a strike comes it opens a [`Window`], which starts some samples
//! *before* the trigger. Two estimates of the energy that the intruder absorbs, `∫ c ẋ² dt`, run in the
//! window:
//!
//! * **A**, [`observer`], *measures* the energy, from the acceleration of the intruder alone;
//! * **B**, [`reduced_chain`], *predicts* the energy, from the contact force alone, by a model of the host,
//!   its intruder and the six beads behind it.
//!
//! They share nothing but the calibration. So a difference between them is a diagnosis.
//!
//! The window is a pure function of [`Settings`] and of the ADC codes in it: a host that has both reproduces
//! the result of the bead bit for bit. Every estimator is `config` (immutable) + `state` + `process(&self,
//! &mut state, sample)`. The work per sample uses no float, except for one root in estimate B when the wave
//! behind its last bead grows. Bead and host derive the coefficients once, in f64, when settings are taken
//! ([`Settings::new`]).
//!
//! # Units
//!
//! Lengths are in µm and times in samples, so that the Q formats of [`quantity`] fit the motion of a bead. A
//! value that leaves the range of its format saturates and sets a bit of [`StrikeFlags`]; nothing wraps.
//!
//! # Results
//!
//! A [`Sink`] takes the result of a strike as [`Strike`], [`Shape`] and [`Chunk`]s, in the quantities of
//! [`bead_wire`] in which they are sent.
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

pub mod calibration;
mod capture;
mod coefficients;
pub mod company;
pub mod converter;
mod correction;
mod day;
mod description;
pub mod design;
pub mod energy_uncertainty;
mod far_end;
mod front_end;
pub mod layout;
pub mod made_up;
pub mod meter;
pub mod name;
pub mod observer;
mod physics;
pub mod quantity;
mod quiet;
pub mod reduced_chain;
mod relative;
mod ring_down;
pub mod scale;
pub mod sensor;
pub mod settings;
pub mod shape;
pub mod sqrt;
mod uncertainty;
pub mod violation;
pub mod waveform;
mod waves;
pub mod window;

pub use bead_wire::{Energy, Shape, Strike, StrikeFlags};
pub use meter::{Chunk, Meter, Sink, scans};
pub use quantity::{AdcCode, Pair, Scan};
pub use settings::{Settings, SettingsError};
pub use shape::WindowRecord;
pub use violation::Violation;
pub use waves::Origin;
pub use window::Window;
