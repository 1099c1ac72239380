//! Integration of a chain: a Runge-Kutta method of order 9 on vectors of eight beads.
//!
//! # Design
//!
//! Order 9 pays because the accuracy asked for lies near rounding ([`method`]). Contacts that open and close,
//! which would spoil it, are integrated exactly ([`crossing`]). Bodies are lanes of vectors ([`lanes`]), and
//! a step works in memory allocated once ([`work`]). Only moving blocks of beads are computed ([`stepper`],
//! [`rest`]), and blocks that a wave has left in contact take longer steps ([`multirate`]).
//!
//! A run that keeps its motion stores the stages of each step ([`step_log`]), and [`Dense`] computes the
//! motion inside it from these. Other runs pay nothing for it.

#[cfg(test)]
mod against;
mod aligned;
mod attempt;
mod crossing;
mod dense;
mod events;
mod glimpse;
mod kernel;
mod lanes;
mod method;
mod multirate;
mod overlap;
mod parting;
mod rest;
#[cfg(test)]
mod small;
mod step_log;
mod stepper;
#[cfg(test)]
pub(crate) mod testing;
mod verner;
#[cfg(test)]
mod window;
mod work;

pub(crate) use dense::Dense;
pub(crate) use glimpse::Glimpse;
pub(crate) use lanes::{BLOCK, Lanes};
pub(crate) use method::step;
pub(crate) use step_log::StepLog;
pub(crate) use stepper::{StepMoment, Stepper};
