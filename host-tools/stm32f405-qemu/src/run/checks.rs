//! Checks of what a caller names: pins, USARTs, codes.

use std::collections::BTreeSet;

use super::error::RunError;
use crate::device::{DevicePlace, Devices};
use crate::machine::{I2CS, SPIS, USARTS, pin};

pub(super) const TWELVE_BITS: &str = "codes of the 12-bit ADC are 0..=4095";

pub(super) fn check_pin(name: &str) -> Result<(), RunError> {
    let unknown = || RunError::Input(format!("there is no pin {name:?}; pins are PA0 to PI15"));
    pin(name).map(drop).ok_or_else(unknown)
}

pub(super) fn check_usart(port: &str) -> Result<(), RunError> {
    let all = USARTS.join(", ");
    let unknown = || RunError::Input(format!("there is no USART {port:?}; give one of {all}"));
    USARTS.contains(&port).then_some(()).ok_or_else(unknown)
}

/// Refuses devices at places that the part does not have, and two at one address.
pub(super) fn check_devices(devices: &Devices) -> Result<(), RunError> {
    let refused = |what: String| Err(RunError::Input(what));
    let mut taken = BTreeSet::new();
    for place in devices.places() {
        let (names, bus) = match place {
            DevicePlace::I2c { bus, address } => {
                // Section 3.1.12 of the I2C specification (UM10204): the others are reserved.
                if !(0x08..0x78).contains(address) {
                    return refused(format!(
                        "a device at {bus} has the address {address:#04x}; give one of 7 bits, 0x08 to 0x77"
                    ));
                }
                if !taken.insert((bus, address)) {
                    return refused(format!("two devices at {bus} have the address {address:#04x}"));
                }
                (I2CS, bus)
            }
            DevicePlace::Spi { bus, select } => {
                check_pin(select)?;
                (SPIS, bus)
            }
        };
        if !names.contains(&&**bus) {
            return refused(format!(
                "there is no bus {bus:?} for a device; give one of {}",
                names.join(", ")
            ));
        }
    }
    Ok(())
}
