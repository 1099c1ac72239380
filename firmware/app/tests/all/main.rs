//! The bead on a fake device: what it measures, answers and keeps, without QEMU.

mod any_settings;
mod bead;
mod boots;
mod conditions;
mod kept;
mod key;
mod line;
mod played;
mod requests;
mod sensors;
mod settings;
mod update;
