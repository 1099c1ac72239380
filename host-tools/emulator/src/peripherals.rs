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
pub mod pwr;
pub mod rcc;
pub mod signature;
pub mod syscfg;
pub mod tim;
pub mod usart;

use std::collections::BTreeSet;

/// There is no such register in the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NoRegister;

/// What the firmware asked of a peripheral that its model does not do.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Notes(BTreeSet<&'static str>);

impl Notes {
    /// Takes a note once.
    pub(crate) fn note_if(&mut self, asked: bool, what: &'static str) {
        if asked {
            self.0.insert(what);
        }
    }

    /// In alphabetical order.
    pub fn iter(&self) -> impl Iterator<Item = &'static str> + '_ {
        self.0.iter().copied()
    }
}

/// Bits `low..low + width` of a register.
pub(crate) const fn field(register: u32, low: u32, width: u32) -> u32 {
    (register >> low) & ((1 << width) - 1)
}

/// One bit of a register.
pub(crate) const fn bit(register: u32, n: u32) -> bool {
    (register >> n) & 1 == 1
}
