//! I2C and SPI: frames on their way between the part's controllers and the devices at their buses.

use std::mem::{replace, take};

use super::board::Exterior;
use super::chip::Chip;
use super::levels::Levels;
use super::wiring::{self, I2CS, PinIndex, SPIS};
use crate::device::{BusAnswer, BusCall, BusEvent, SpiFrame};
use crate::peripherals::i2c::I2cStep;

const NO_DEVICE: &str = "START: no device of this run is on its bus: no address is acknowledged";
const NO_I2C_PINS: &str = "START: no pins are set as its SCL and SDA: nobody answers";
const NO_SPI_CLOCK: &str = "CR1.SPE: no pin is set as its SCK: nothing leaves the part";

/// Asks a device, which may put levels on pins.
fn ask(call: BusCall, levels: &mut Levels, board: &mut impl Exterior) -> u16 {
    let BusAnswer { value, levels: new } = board.ask(call);
    for level in new {
        levels.add(
            wiring::known_pin(&level.pin),
            level.at_ns.max(call.at_ns + 1),
            level.high,
        );
    }
    value
}

impl Chip {
    /// The levels of select pins may have changed.
    pub(super) fn select_devices(&mut self, now: u64) {
        for device in &mut self.buses.spi {
            let (port, number) = device.select;
            let selected = self.units.gpio[port].driven(number) == Some(false);
            if replace(&mut device.selected, selected) != selected {
                self.buses.selections.push(BusCall {
                    device: device.number,
                    at_ns: now,
                    what: BusEvent::Select(selected),
                });
            }
        }
    }

    /// Notifies devices that were selected or released.
    pub(super) fn tell_selections(&mut self, levels: &mut Levels, board: &mut impl Exterior) {
        // After every access.
        if self.buses.selections.is_empty() {
            return;
        }
        for call in take(&mut self.buses.selections) {
            ask(call, levels, board);
        }
    }

    fn pin_of(&self, peripheral: &'static str, signal: &'static str) -> Option<PinIndex> {
        self.connected(wiring::pins(peripheral, signal))
    }

    /// The device on an I2C bus with an address, if the controller's pins lead there.
    fn target(&mut self, n: usize, address: u8) -> Option<usize> {
        let wired = self.pin_of(I2CS[n], "SCL").is_some() && self.pin_of(I2CS[n], "SDA").is_some();
        let mut devices = self.buses.i2c.iter().filter(|(_, bus, _)| *bus == n).peekable();
        let notes = &mut self.units.i2c[n].notes;
        notes.note_if(!wired, NO_I2C_PINS);
        notes.note_if(devices.peek().is_none(), NO_DEVICE);
        let found = devices.find(|(_, _, own)| *own == address && wired);
        found.map(|(number, ..)| *number)
    }

    /// A phase of an I2C bus ends.
    pub(super) fn step_i2c(&mut self, n: usize, at: u64, levels: &mut Levels, board: &mut impl Exterior) {
        let Some(step) = self.units.i2c[n].step(at) else {
            return;
        };
        let target = match step {
            I2cStep::Address { address, .. } => self.target(n, address),
            _ => self.buses.answering[n],
        };
        let what = match step {
            I2cStep::Started => return,
            I2cStep::Address { read, .. } => BusEvent::Start { read },
            I2cStep::Sent(byte) => BusEvent::Write(byte),
            I2cStep::Receive => BusEvent::Read,
            I2cStep::Stopped => BusEvent::Stop,
        };
        let answer = target.map(|device| {
            let call = BusCall {
                device,
                at_ns: at,
                what,
            };
            ask(call, levels, board)
        });
        let acknowledged = answer.is_some_and(|answer| answer != 0);
        match step {
            I2cStep::Started => {}
            I2cStep::Address { .. } => {
                self.buses.answering[n] = target.filter(|_| acknowledged);
                self.units.i2c[n].addressed(acknowledged, at);
            }
            I2cStep::Sent(_) => self.units.i2c[n].sent(acknowledged, at),
            // A line that nobody pulls low reads as ones.
            I2cStep::Receive => self.units.i2c[n].received(answer.unwrap_or(0xff) as u8, at),
            I2cStep::Stopped => self.buses.answering[n] = None,
        }
    }

    /// A frame of an SPI bus ends.
    pub(super) fn exchange_spi(&mut self, n: usize, at: u64, levels: &mut Levels, board: &mut impl Exterior) {
        self.tell_selections(levels, board);
        let spi = &mut self.units.spi[n];
        let (mode, hz) = (spi.mode(), spi.hz());
        let Some(sent) = spi.shifted() else { return };
        let ones = u16::MAX >> (16 - sent.bits);
        let [clock, output, input] = ["SCK", "MOSI", "MISO"].map(|signal| self.pin_of(SPIS[n], signal));
        if clock.is_none() {
            self.units.spi[n].notes.note(NO_SPI_CLOCK);
        }
        let frame = SpiFrame {
            word: if output.is_some() { sent.word } else { ones },
            bits: sent.bits,
            mode,
            hz,
        };
        let selected = self
            .buses
            .spi
            .iter()
            .filter(|device| device.bus == n && device.selected);
        let devices: Vec<usize> = selected.map(|device| device.number).collect();
        let mut answers = Vec::new();
        for device in devices.into_iter().filter(|_| clock.is_some()) {
            let call = BusCall {
                device,
                at_ns: at,
                what: BusEvent::Exchange(frame),
            };
            answers.push(ask(call, levels, board));
        }
        let came = match input {
            // On one line, the output is the input.
            None => answers.into_iter().reduce(|one, other| one & other),
            Some(input) if output.is_some_and(|output| self.wires.from(output).any(|end| end == input)) => {
                Some(frame.word)
            }
            Some(input) => answers.into_iter().reduce(|one, other| one & other).or_else(|| {
                let high = self.units.gpio[input.0].input() >> input.1 & 1 == 1;
                Some(if high { ones } else { 0 })
            }),
        };
        self.units.spi[n].took(came.unwrap_or(ones) & ones, at);
    }
}
