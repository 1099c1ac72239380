//! General-purpose pins (RM0090 section 8). An output reads back what it drives. An input reads the level
//! that is put on it from outside. Where nothing is wired to it, it reads high if its pull-up is on, else
//! low. Analog values are not seen here: they are the converter's stimulus.

use super::peripheral::{NoRegister, Peripheral};
use super::register::field;

/// One port of 16 pins.
#[derive(Debug, Clone, Default)]
pub struct Gpio {
    port: usize,
    moder: u32,
    otyper: u32,
    ospeedr: u32,
    pupdr: u32,
    odr: u32,
    lckr: u32,
    afr: [u32; 2],
    /// Levels from outside. `None` where nothing is wired.
    wired: [Option<bool>; 16],
    /// How often each pin changed its level as an output.
    pub edges: [u64; 16],
}

impl Gpio {
    /// A port after reset: 0 is A, 8 is I. The debug pins of A and B are in use (section 8.4.1).
    pub fn new(port: usize) -> Self {
        let (moder, ospeedr, pupdr) = match port {
            0 => (0xa800_0000, 0, 0x6400_0000),
            1 => (0x0000_0280, 0x0000_00c0, 0x0000_0100),
            _ => (0, 0, 0),
        };
        Self {
            port,
            moder,
            ospeedr,
            pupdr,
            ..Self::default()
        }
    }

    /// Puts a level on a pin from outside.
    pub fn drive(&mut self, pin: usize, level: bool) {
        self.wired[pin] = Some(level);
    }

    /// The alternate function that a pin is set to (section 8.3.2). `None` if it has another mode.
    pub fn alternate(&self, pin: usize) -> Option<u32> {
        let function = field(self.afr[pin / 8], 4 * (pin as u32 % 8), 4);
        (field(self.moder, 2 * pin as u32, 2) == 0b10).then_some(function)
    }

    fn input(&self) -> u32 {
        (0..16).fold(0, |levels, pin| {
            let wired = self.wired[pin as usize];
            let level = match (field(self.moder, 2 * pin, 2), field(self.pupdr, 2 * pin, 2)) {
                (0b01, _) => field(self.odr, pin, 1),
                (0b00 | 0b10, _) if wired.is_some() => wired.map_or(0, u32::from),
                (0b00, 0b01) => 1,
                _ => 0,
            };
            levels | level << pin
        })
    }

    fn outputs(&self) -> u32 {
        (0..16).fold(0, |levels, pin| {
            let driven = field(self.moder, 2 * pin, 2) == 0b01;
            levels | (u32::from(driven) & field(self.odr, pin, 1)) << pin
        })
    }
}

impl Peripheral for Gpio {
    fn read(&mut self, offset: u32, _now: u64) -> Result<u32, NoRegister> {
        Ok(match offset {
            0x00 => self.moder,
            0x04 => self.otyper,
            0x08 => self.ospeedr,
            0x0c => self.pupdr,
            0x10 => self.input(),
            0x14 => self.odr,
            0x18 => 0,
            0x1c => self.lckr,
            0x20 => self.afr[0],
            0x24 => self.afr[1],
            _ => return Err(NoRegister),
        })
    }

    fn write(&mut self, offset: u32, value: u32, _now: u64) -> Result<(), NoRegister> {
        let before = self.outputs();
        match offset {
            0x00 => self.moder = value,
            0x04 => self.otyper = value & 0xffff,
            0x08 => self.ospeedr = value,
            0x0c => self.pupdr = value,
            0x10 => {}
            0x14 => self.odr = value & 0xffff,
            // Set wins over reset (section 8.4.7).
            0x18 => self.odr = (self.odr & !(value >> 16)) | (value & 0xffff),
            0x1c => self.lckr = value & 0x1_ffff,
            0x20 => self.afr[0] = value,
            0x24 => self.afr[1] = value,
            _ => return Err(NoRegister),
        }
        let changed = before ^ self.outputs();
        for (pin, edges) in self.edges.iter_mut().enumerate() {
            *edges += u64::from((changed >> pin) & 1);
        }
        Ok(())
    }

    /// The count of edges goes on, and so do the levels from outside.
    fn reset(&mut self, _now: u64) {
        *self = Self {
            edges: self.edges,
            wired: self.wired,
            ..Self::new(self.port)
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bsrr_sets_and_resets_without_touching_other_pins_and_set_wins() {
        let mut port = Gpio::new(2);
        port.write(0x14, 0x0f0f, 0).unwrap();
        port.write(0x18, 0x0001_0010, 0).unwrap();
        assert_eq!(port.read(0x14, 0), Ok(0x0f1e));
        port.write(0x18, 0x0002_0002, 0).unwrap();
        assert_eq!(port.read(0x14, 0), Ok(0x0f1e));
    }

    #[test]
    fn an_output_reads_back_an_input_reads_its_pull_up() {
        let mut port = Gpio::new(2);
        port.write(0x00, 0b01, 0).unwrap();
        port.write(0x0c, 0b01 << 2, 0).unwrap();
        assert_eq!(port.read(0x10, 0), Ok(0b10));
        port.write(0x18, 1, 0).unwrap();
        assert_eq!(port.read(0x10, 0), Ok(0b11));
    }

    #[test]
    fn a_level_from_outside_is_read_by_inputs_and_goes_on_over_a_reset() {
        let mut port = Gpio::new(2);
        port.drive(3, true);
        port.drive(4, false);
        port.write(0x0c, 0b01 << 8, 0).unwrap();
        assert_eq!(
            port.read(0x10, 0),
            Ok(1 << 3),
            "and the pull-up of PC4 is overcome"
        );
        port.reset(0);
        assert_eq!(port.read(0x10, 0), Ok(1 << 3));
        port.write(0x00, 0b11 << 6, 0).unwrap();
        assert_eq!(
            port.read(0x10, 0),
            Ok(0),
            "an analog pin reads low (section 8.3.12)"
        );
    }

    #[test]
    fn the_alternate_function_is_known_only_while_it_is_in_use() {
        let mut port = Gpio::new(2);
        port.write(0x24, 3 << 28, 0).unwrap();
        assert_eq!(port.alternate(15), None);
        port.write(0x00, 0b10 << 30, 0).unwrap();
        assert_eq!((port.alternate(15), port.alternate(14)), (Some(3), None));
    }

    #[test]
    fn edges_are_counted_for_outputs_only_and_once_a_change() {
        let mut port = Gpio::new(2);
        port.write(0x00, 0b01, 0).unwrap();
        for value in [0b11, 0b11, 0b00, 0b11] {
            port.write(0x14, value, 0).unwrap();
        }
        assert_eq!(port.edges[..2], [3, 0]);
    }

    #[test]
    fn the_debug_pins_are_in_use_after_reset() {
        assert_eq!(Gpio::new(0).read(0x00, 0), Ok(0xa800_0000));
        assert_eq!(Gpio::new(1).read(0x00, 0), Ok(0x0000_0280));
    }
}
