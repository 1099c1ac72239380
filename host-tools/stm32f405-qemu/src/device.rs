//! Devices at the buses of the part.
//!
//! # Design
//!
//! A device is in the host's process and the part in QEMU's. At the end of each byte the overlay queries the
//! host over a socket in the run's folder, and the image stands still until the answer arrives. So a device
//! sees virtual times, and equal runs give equal bytes.

use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

use serde::{Deserialize, Serialize};

use crate::level::Level;

/// A device at an I2C or SPI bus: a sensor, a memory, a display. Implement what its bus needs. All times are
/// virtual, in ns since power-up.
///
/// ```
/// use stm32f405_qemu::{Device, Run};
///
/// /// Two bytes of temperature, whatever is asked.
/// struct Thermometer(i16, usize);
///
/// impl Device for Thermometer {
///     fn start(&mut self, _read: bool, _at_ns: u64) -> bool {
///         self.1 = 0;
///         true
///     }
///     fn read(&mut self, _at_ns: u64) -> u8 {
///         self.1 += 1;
///         self.0.to_be_bytes()[(self.1 - 1) % 2]
///     }
/// }
///
/// let mut run = Run::new("firmware.elf");
/// let thermometer = run.devices.on_i2c("I2C1", 0x48, Thermometer(2150, 0));
/// // ... after the run, `thermometer.lock()` is the device as the image left it.
/// ```
pub trait Device: Send {
    /// I2C: the master sends START and the device's address. Returns `true` to acknowledge.
    fn start(&mut self, _read: bool, _at_ns: u64) -> bool {
        true
    }

    /// I2C: a byte from the master. Returns `true` to acknowledge.
    fn write(&mut self, _byte: u8, _at_ns: u64) -> bool {
        true
    }

    /// I2C: the next byte to the master.
    fn read(&mut self, _at_ns: u64) -> u8 {
        0xff
    }

    /// I2C: the master sends STOP.
    fn stop(&mut self, _at_ns: u64) {}

    /// SPI: the select pin of the device falls (`true`) or rises.
    fn select(&mut self, _selected: bool, _at_ns: u64) {}

    /// SPI: a frame from the master. Returns the frame that goes back at the same time.
    fn exchange(&mut self, _frame: SpiFrame, _at_ns: u64) -> u16 {
        u16::MAX
    }

    /// Levels that the device puts on pins of the part from now on, for example of a line that signals that
    /// data is ready. Called after each call of another method. A level in the past takes effect now.
    fn levels(&mut self) -> Vec<Level> {
        Vec::new()
    }
}

/// A frame from an SPI master.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct SpiFrame {
    /// The frame's bits: the first on the line is the highest.
    pub word: u16,
    /// Number of bits: 8 or 16.
    pub bits: u32,
    /// CPOL and CPHA: mode 0 to 3.
    pub mode: u8,
    /// Frequency of the clock, Hz.
    pub hz: u32,
}

/// Place of a device.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum DevicePlace {
    I2c { bus: String, address: u8 },
    Spi { bus: String, select: String },
}

/// Devices at the buses of the part.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Devices(Vec<ConnectedDevice>);

#[derive(Debug, Clone, Serialize, Deserialize)]
struct ConnectedDevice {
    place: DevicePlace,
    #[serde(skip)]
    device: Option<DeviceHandle>,
}

#[derive(Clone)]
struct DeviceHandle(Arc<Mutex<dyn Device>>);

impl fmt::Debug for DeviceHandle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a device")
    }
}

impl Devices {
    /// Puts a device at an I2C bus (`I2C1` to `I2C3`), with its address of 7 bits. Returns a handle on it.
    pub fn on_i2c<D: Device + 'static>(
        &mut self,
        bus: impl Into<String>,
        address: u8,
        device: D,
    ) -> Arc<Mutex<D>> {
        let bus = bus.into();
        self.connect(DevicePlace::I2c { bus, address }, device)
    }

    /// Puts a device at an SPI bus (`SPI1` to `SPI3`), with the pin of the part that selects it when low, for
    /// example `PA4`. Returns a handle on it.
    pub fn on_spi<D: Device + 'static>(
        &mut self,
        bus: impl Into<String>,
        select: impl Into<String>,
        device: D,
    ) -> Arc<Mutex<D>> {
        let (bus, select) = (bus.into(), select.into());
        self.connect(DevicePlace::Spi { bus, select }, device)
    }

    fn connect<D: Device + 'static>(&mut self, place: DevicePlace, device: D) -> Arc<Mutex<D>> {
        let device = Arc::new(Mutex::new(device));
        self.0.push(ConnectedDevice {
            place,
            device: Some(DeviceHandle(device.clone())),
        });
        device
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(crate) fn places(&self) -> impl Iterator<Item = &DevicePlace> {
        self.0.iter().map(|connected| &connected.place)
    }

    /// Queries a device. A missing one answers as an empty bus does.
    pub fn answer(&self, call: BusCall) -> BusAnswer {
        let device = self.0.get(call.device).and_then(|found| found.device.as_ref());
        let Some(DeviceHandle(device)) = device else {
            return BusAnswer::default();
        };
        let mut device = device.lock().unwrap_or_else(PoisonError::into_inner);
        let at = call.at_ns;
        let value = match call.what {
            BusEvent::Start { read } => device.start(read, at).into(),
            BusEvent::Write(byte) => device.write(byte, at).into(),
            BusEvent::Read => device.read(at).into(),
            BusEvent::Stop => {
                device.stop(at);
                0
            }
            BusEvent::Select(selected) => {
                device.select(selected, at);
                0
            }
            BusEvent::Exchange(frame) => device.exchange(frame, at),
        };
        BusAnswer {
            value,
            levels: device.levels(),
        }
    }
}

/// An event at a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum BusEvent {
    /// The master sends the device's address.
    Start {
        /// True if the bytes go to the master.
        read: bool,
    },
    /// The master sends a byte.
    Write(u8),
    /// The master reads a byte.
    Read,
    /// The master sends STOP.
    Stop,
    /// The device's select pin falls or rises.
    Select(bool),
    /// The master sends a frame.
    Exchange(SpiFrame),
}

/// A query from the machine to a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct BusCall {
    /// Its number in [`Devices`].
    pub device: usize,
    /// Virtual time, ns.
    pub at_ns: u64,
    /// The event.
    pub what: BusEvent,
}

/// The answer of a device.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct BusAnswer {
    /// The byte or frame, or 1 for an acknowledge.
    pub value: u16,
    /// Levels that the device puts on pins.
    pub levels: Vec<Level>,
}
