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
//! An access to a register that a model lacks returns [`NoRegister`]. It never reads as zero without a
//! report. A request for a feature that a modelled register lacks goes to the model's [`Notes`].

pub(crate) mod adc;
pub(crate) mod adc_common;
pub(crate) mod clock;
pub(crate) mod core;
pub(crate) mod crc;
pub(crate) mod dac;
pub(crate) mod dbgmcu;
pub(crate) mod dma;
pub(crate) mod dwt;
pub(crate) mod exti;
pub(crate) mod flash;
pub(crate) mod gpio;
pub(crate) mod i2c;
pub(crate) mod iwdg;
mod peripheral;
pub(crate) mod pwr;
pub(crate) mod rcc;
mod register;
pub(crate) mod rng;
pub(crate) mod rtc;
pub(crate) mod signature;
pub(crate) mod spi;
pub(crate) mod syscfg;
pub(crate) mod systick;
pub(crate) mod tim;
pub(crate) mod usart;
pub(crate) mod wwdg;

pub(crate) use peripheral::{NoRegister, Notes, Peripheral};
