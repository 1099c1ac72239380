//! Checks of what a caller names: pins, USARTs, codes.

use super::error::RunError;
use crate::machine::{USARTS, pin};

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
