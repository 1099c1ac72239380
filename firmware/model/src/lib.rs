//! What the bead computes from its two sensors, in fixed point, sample by sample.
//!
//! # Design
//!
//! A [`Meter`] watches the force channel. When a strike comes it opens a
//! [`Window`] that starts some samples *before* the trigger, and runs two estimates of
//! the energy that the intruder absorbs, `∫ c ẋ² dt`:
//!
//! * **A**, [`observer`]: from the intruder's own acceleration alone, which *measures* it;
//! * **B**, [`reduced_chain`]: from the contact force alone, which *predicts* it by a model of the host,
//!   its intruder and the four beads behind it.
//!
//! They share nothing but the calibration, so that their difference is a diagnosis.
//!
//! The window is a pure function of [`Settings`] and the ADC codes in it: a host that
//! has both gets the device's result bit for bit. Every estimator is `config` (immutable) + `state` +
//! `process(&self, &mut state, sample)`. There is no float in the work per sample; coefficients are
//! derived once, in f64, by `design` (a feature) on the host ([`coefficients`]).
//!
//! # Units
//!
//! Lengths are in µm and times in samples, so that the Q formats of [`quantity`] fit what a bead does. What
//! leaves a format's range saturates and sets a [`Flags`] bit; nothing wraps.
#![cfg_attr(not(feature = "design"), no_std)]
#![forbid(unsafe_code)]

#[cfg(all(doctest, feature = "design"))]
#[doc = include_str!("../README.md")]
struct Readme;

pub mod calibration;
pub mod coefficients;
#[cfg(feature = "design")]
pub mod design;
pub mod layout;
pub mod meter;
pub mod observer;
pub mod quantity;
pub mod reduced_chain;
pub mod sensor;
pub mod settings;
pub mod shape;
pub mod sqrt;
pub mod window;

pub use meter::{Chunk, Meter, Sink};
pub use quantity::{Acceleration, AdcCode, Energy, Force, Pair, Scan};
pub use settings::{Settings, SettingsError};
pub use shape::{Record, Shape};
pub use window::{Flags, StrikeReport, Window};
