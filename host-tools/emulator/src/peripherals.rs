//! The peripherals, a file each, after RM0090.
//!
//! # Design
//!
//! A model is a plain struct. It knows its registers and the time in ns at which they are touched; it knows no bus, no
//! interrupt controller and no QEMU. Nothing ticks: state is brought up to the time of an access when the access
//! comes, and what will happen by itself is a question that a model answers ([`tim::Tim::next_interrupt`],
//! [`adc::Adc::next_conversion`], …) and [`crate::machine`] puts together.
//!
//! A register that a model lacks is [`NoRegister`], never zero in silence. A feature of a modelled register that the
//! firmware asks for and that is not modelled goes to the model's [`Notes`].

pub mod adc;
pub mod clock;
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
pub mod tim;
pub mod usart;

pub use peripheral::{NoRegister, Notes, Peripheral};
