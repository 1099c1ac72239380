//! The devices at the I2C and SPI buses, by their places.

use super::wiring::{self, I2CS, PinIndex, SPIS};
use crate::device::{BusCall, DevicePlace, Devices};

/// A device with its number in the run's list.
#[derive(Debug, Clone)]
pub(super) struct SpiDevice {
    pub(super) number: usize,
    pub(super) bus: usize,
    pub(super) select: PinIndex,
    pub(super) selected: bool,
}

/// The devices of a run, by their places.
#[derive(Debug, Clone, Default)]
pub(super) struct Buses {
    /// Number, bus and address.
    pub(super) i2c: Vec<(usize, usize, u8)>,
    pub(super) spi: Vec<SpiDevice>,
    /// The device that has acknowledged its address, on each I2C bus.
    pub(super) answering: [Option<usize>; I2CS.len()],
    /// Calls to devices that were selected or released, not made yet.
    pub(super) selections: Vec<BusCall>,
}

impl Buses {
    /// Panics if a bus or pin does not exist: the host checks them before.
    pub(super) fn new(devices: &Devices) -> Self {
        let mut buses = Self::default();
        let position = |names: &[&str], bus: &str| {
            let found = names.iter().position(|name| *name == bus);
            found.unwrap_or_else(|| panic!("there is no bus {bus:?}"))
        };
        for (number, place) in devices.places().enumerate() {
            match place {
                DevicePlace::I2c { bus, address } => {
                    buses.i2c.push((number, position(&I2CS, bus), *address));
                }
                DevicePlace::Spi { bus, select } => buses.spi.push(SpiDevice {
                    number,
                    bus: position(&SPIS, bus),
                    select: wiring::known_pin(select),
                    selected: false,
                }),
            }
        }
        buses
    }
}
