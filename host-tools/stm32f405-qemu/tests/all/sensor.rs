//! A device at an I2C bus.

use stm32f405_qemu::{Device, Level};

/// Registers behind a pointer, as most sensors have them. Raises PB0 after a read.
#[derive(Default)]
pub(crate) struct Sensor {
    pub(crate) registers: [u8; 8],
    pub(crate) pointer: Option<usize>,
    pub(crate) starts: Vec<(bool, u64)>,
    /// Bytes that the master has read.
    pub(crate) reads: usize,
    pub(crate) stops: usize,
    pub(crate) levels: Vec<Level>,
}

impl Device for Sensor {
    fn start(&mut self, read: bool, at_ns: u64) -> bool {
        self.starts.push((read, at_ns));
        self.pointer = self.pointer.filter(|_| read);
        true
    }

    fn write(&mut self, byte: u8, _at_ns: u64) -> bool {
        match self.pointer {
            None => self.pointer = Some(byte.into()),
            Some(at) if at < 8 => {
                self.registers[at] = byte;
                self.pointer = Some(at + 1);
            }
            Some(_) => return false,
        }
        true
    }

    fn read(&mut self, at_ns: u64) -> u8 {
        let at = self.pointer.unwrap_or(0);
        self.pointer = Some(at + 1);
        self.reads += 1;
        self.levels.push(Level {
            pin: "PB0".into(),
            at_ns: at_ns + 1_000,
            high: true,
        });
        self.registers[at % 8]
    }

    fn stop(&mut self, _at_ns: u64) {
        self.stops += 1;
    }

    fn levels(&mut self) -> Vec<Level> {
        std::mem::take(&mut self.levels)
    }
}
