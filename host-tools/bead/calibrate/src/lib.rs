//! Calibration of a bead: the gains of its sensors, its front mass, stiffness and damping of its intruder.
//!
//! # Design
//! A procedure ([`mod@drop`], [`mod@reference`], [`front_mass`], [`ring_down`], [`shaker`]) takes recorded
//! strikes or points of a shaker ([`points`]), and quantities that an operator states with their uncertainty
//! ([`quantity`]). It is a measurement model with inputs ([`model`]), so each result has a budget.
//! [`settings`] writes the results into the bead's file, [`certificate`] writes a page. [`simulated`] has
//! rigs on which to learn and prove the procedures.

pub mod about;
pub mod calibration;
pub mod certificate;
pub mod conformity;
pub mod drop;
pub mod front_mass;
mod landing;
pub mod model;
mod momentum;
pub mod points;
pub mod quantity;
pub mod reference;
pub mod ring_down;
pub mod settings;
pub mod shaker;
pub mod simulated;
mod sine;
