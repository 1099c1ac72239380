//! The peripherals, after RM0090: one file for each.
//!
//! # Design
//!
//! A model is a plain struct that implements [`Peripheral`]. It knows its registers, and the time in ns at
//! which they are accessed. It knows no bus, no interrupt controller and no QEMU. Nothing ticks: an access
//! first brings the state up to its own time. A model also says when something will next happen by itself
//! ([`Peripheral::next_interrupt`], [`adc::Adc::next_conversion`], …). The module `machine` puts these times
//! together.
//!
//! A register that a model lacks gives [`NoRegister`]. It never reads as zero without a report. Firmware may
//! ask a modelled register for a feature that is not modelled: this goes to the model's [`Notes`].

pub mod adc;
pub mod adc_common;
pub mod clock;
pub mod core;
pub mod dbgmcu;
pub mod dma;
pub mod dwt;
pub mod exti;
pub mod flash;
pub mod gpio;
pub mod iwdg;
mod peripheral;
pub mod pwr;
pub mod rcc;
mod register;
pub mod signature;
pub mod syscfg;
pub mod systick;
pub mod tim;
pub mod usart;

pub use peripheral::{NoRegister, Notes, Peripheral};
