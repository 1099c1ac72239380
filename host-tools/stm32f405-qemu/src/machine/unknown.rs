//! Registers that the firmware accesses and no model knows.

use std::collections::BTreeMap;

use super::registers::name;
use crate::chip::Chip;
use crate::outcome::UnknownRegister;

/// Accesses by address, and by whether the clock of the peripheral was off.
#[derive(Debug, Clone, Default)]
pub(super) struct UnknownRegisters(BTreeMap<(u32, bool), UnknownRegister>);

impl UnknownRegisters {
    pub(super) fn read(&mut self, address: u32, clock_off: bool) {
        self.register(address, clock_off).reads += 1;
    }

    pub(super) fn written(&mut self, address: u32, clock_off: bool, value: u32) {
        let register = self.register(address, clock_off);
        register.writes += 1;
        register.last_write = Some(value);
    }

    fn register(&mut self, address: u32, clock_off: bool) -> &mut UnknownRegister {
        self.0
            .entry((address, clock_off))
            .or_insert_with(|| UnknownRegister {
                name: name(address) + if clock_off { " (clock off)" } else { "" },
                address,
                clock_off,
                reads: 0,
                writes: 0,
                last_write: None,
            })
    }

    /// Lists the registers in order of address, by the names that they have on this part.
    pub(super) fn list(&self, part: Chip) -> Vec<UnknownRegister> {
        let named = |register: &UnknownRegister| UnknownRegister {
            name: name_on(part, register),
            ..register.clone()
        };
        self.0.values().map(named).collect()
    }
}

/// Name of a register on a part. The table of names is that of the STM32F405: where it has none, or where
/// this part has something else, the name is made of the part's peripheral.
fn name_on(part: Chip, register: &UnknownRegister) -> String {
    let UnknownRegister { name, address, .. } = register;
    match part.peripheral_at(*address) {
        Some((start, peripheral)) if name.contains("(reserved)") || name.starts_with("I2S") => {
            format!("{peripheral}+{:#04x}", address - start)
        }
        None if part.lacks(*address) => format!("{name} (not on the {part})"),
        _ => name.clone(),
    }
}
