//! General-purpose pins (RM0090 section 8). An output reads back what it drives. So does a pin that a timer
//! moves. An input reads the level that is put on it from outside. Where nothing is wired to it, it reads
//! high if its pull-up is on, else low. Analog values are not seen here: they are the converter's stimulus.

use super::peripheral::{NoRegister, Notes, Peripheral};
use super::register::{bit, field};

const LCKK: u32 = 1 << 16;

/// Most changes of a port that are recorded, 16 bytes each. An image that only moves its pins makes tens of
/// millions a second.
const MOST_CHANGES: usize = 1 << 21;
/// Ports and pins of the clock outputs, which are alternate function 0 (section 7.2.10).
const CLOCK_OUTPUTS: [(usize, usize, &str); 2] = [
    (0, 8, "PA8 is the output of a clock (MCO1): it does not move"),
    (2, 9, "PC9 is the output of a clock (MCO2): it does not move"),
];
const NOT_RECORDED: &str = "later changes are counted, but not recorded";

/// The lock key (section 8.4.8): LCKK is written as 1, 0, 1 with the same pins, and then read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum LockKey {
    #[default]
    Open,
    /// Number of the lock sequence's three writes that were made, and their pins.
    Turning(u32, u32),
    Closed,
}

#[derive(Debug, Clone, Default)]
pub(crate) struct Gpio {
    port: usize,
    moder: u32,
    otyper: u32,
    ospeedr: u32,
    pupdr: u32,
    odr: u32,
    lckr: u32,
    key: LockKey,
    afr: [u32; 2],
    /// Levels from outside. `None` where nothing is wired.
    wired: [Option<bool>; 16],
    /// Levels from outputs at the other ends of wires. `None` where there is no wire, or nothing drives it.
    by_wire: [Option<bool>; 16],
    /// Levels of the timers behind the pins' alternate functions. `None` where there is none.
    by_timer: [Option<bool>; 16],
    /// Alternate functions that pins have on other parts only, a bit for each.
    pub(crate) foreign: [u16; 16],
    /// Number of changes of each pin's level as an output.
    pub(crate) edges: [u64; 16],
    /// True if the times of these changes are recorded.
    pub(crate) records: bool,
    /// When each pin changed its level as an output, in ns, and the level from then on.
    pub(crate) changes: [Vec<(u64, bool)>; 16],
    /// Number of recorded changes of the whole port.
    recorded: usize,
    pub(crate) notes: Notes,
}

impl Gpio {
    /// A port after reset: 0 is A, 8 is I. The debug pins of A and B are in use (section 8.4.1).
    pub(crate) fn new(port: usize) -> Self {
        const DEBUG_PINS: [[u32; 3]; 2] = [[0xa800_0000, 0, 0x6400_0000], [0x0280, 0x00c0, 0x0100]];
        let [moder, ospeedr, pupdr] = DEBUG_PINS.get(port).copied().unwrap_or_default();
        Self {
            port,
            moder,
            ospeedr,
            pupdr,
            ..Self::default()
        }
    }

    pub(crate) fn drive(&mut self, pin: usize, level: bool) {
        self.wired[pin] = Some(level);
    }

    /// Sets the level that an output at the other end of a wire puts on a pin, `None` if nothing drives the
    /// wire. Returns the pin's new level if it has changed.
    pub(crate) fn drive_by_wire(&mut self, pin: usize, level: Option<bool>) -> Option<bool> {
        let before = self.level_at(pin);
        self.by_wire[pin] = level;
        let after = self.level_at(pin);
        (before != after).then_some(after)
    }

    /// The level on a pin that the part itself does not drive: from a wire, from outside, or by its pull-up.
    fn level_at(&self, pin: usize) -> bool {
        let pulled_up = field(self.pupdr, 2 * pin as u32, 2) == 0b01;
        self.by_wire[pin].or(self.wired[pin]).unwrap_or(pulled_up)
    }

    /// The level that a pin drives as an output. An open drain drives low only.
    pub(crate) fn driven(&self, pin: usize) -> Option<bool> {
        let level = match field(self.moder, 2 * pin as u32, 2) {
            0b01 => bit(self.odr, pin as u32),
            0b10 => self.by_timer[pin]?,
            _ => return None,
        };
        (!(level && bit(self.otyper, pin as u32))).then_some(level)
    }

    /// Gives a pin the level of the timer behind its alternate function.
    pub(crate) fn move_by_timer(&mut self, pin: usize, level: Option<bool>, now: u64) {
        let before = self.outputs();
        self.by_timer[pin] = level;
        self.count(before ^ self.outputs(), now);
    }

    /// The alternate function that a pin is set to (section 8.3.2). `None` if it has another mode.
    pub(crate) fn alternate(&self, pin: usize) -> Option<u32> {
        let function = field(self.afr[pin / 8], 4 * (pin as u32 % 8), 4);
        let is_own = self.foreign[pin] >> function & 1 == 0;
        (field(self.moder, 2 * pin as u32, 2) == 0b10 && is_own).then_some(function)
    }

    /// The levels of the port, as IDR shows them.
    pub(crate) fn input(&self) -> u32 {
        (0..16).fold(0, |levels, pin| {
            let n = pin as usize;
            let wired = self.by_wire[n].or(self.wired[n]).is_some();
            let level = match field(self.moder, 2 * pin, 2) {
                // A released open drain has the level from outside. Where nothing is wired, it reads its
                // output register.
                0b01 if wired => self.driven(n).unwrap_or_else(|| self.level_at(n)),
                0b01 => bit(self.odr, pin),
                0b10 => self.driven(n).unwrap_or_else(|| self.level_at(n)),
                0b00 => self.level_at(n),
                _ => false,
            };
            levels | u32::from(level) << pin
        })
    }

    fn outputs(&self) -> u32 {
        (0..16).fold(0, |levels, pin| {
            let level = match field(self.moder, 2 * pin, 2) {
                0b01 => bit(self.odr, pin),
                0b10 => self.by_timer[pin as usize] == Some(true),
                _ => false,
            };
            levels | u32::from(level) << pin
        })
    }

    fn locked(&self) -> u32 {
        if self.key == LockKey::Closed { self.lckr } else { 0 }
    }

    /// Returns a setting of `width` bits for each pin after a write: locked pins keep theirs.
    fn unlocked(&self, width: u32, first: u32, old: u32, new: u32) -> u32 {
        let ones = (1 << width) - 1;
        let pins = (0..32 / width).filter(|pin| bit(self.locked(), first + pin));
        let kept = pins.fold(0, |kept, pin| kept | ones << (width * pin));
        (old & kept) | (new & !kept)
    }

    fn count(&mut self, changed: u32, now: u64) {
        let levels = self.outputs();
        for pin in (0..16).filter(|pin| bit(changed, *pin)) {
            self.edges[pin as usize] += 1;
            self.record(pin as usize, now, bit(levels, pin));
        }
    }

    fn record(&mut self, pin: usize, now: u64, level: bool) {
        if !self.records {
            return;
        }
        if self.recorded == MOST_CHANGES {
            self.notes.note(format!(
                "its pins changed more than {MOST_CHANGES} times: {NOT_RECORDED}"
            ));
        } else {
            self.recorded += 1;
            self.changes[pin].push((now, level));
        }
    }

    fn write_lock(&mut self, value: u32) {
        let (key, pins) = (value & LCKK != 0, value & 0xffff);
        self.key = match self.key {
            LockKey::Closed => return,
            LockKey::Turning(1, before) if !key && before == pins => LockKey::Turning(2, pins),
            LockKey::Turning(2, before) if key && before == pins => LockKey::Turning(3, pins),
            _ if key => LockKey::Turning(1, pins),
            _ => LockKey::Open,
        };
        self.lckr = pins;
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
            0x1c => {
                if let LockKey::Turning(3, _) = self.key {
                    self.key = LockKey::Closed;
                }
                self.lckr | if self.key == LockKey::Closed { LCKK } else { 0 }
            }
            0x20 => self.afr[0],
            0x24 => self.afr[1],
            _ => return Err(NoRegister),
        })
    }

    fn holds_until(&self, offset: u32, _now: u64) -> Option<u64> {
        // Reading LCKR is a step of its key.
        (offset != 0x1c).then_some(u64::MAX)
    }

    fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), NoRegister> {
        let before = self.outputs();
        match offset {
            0x00 => self.moder = self.unlocked(2, 0, self.moder, value),
            0x04 => self.otyper = self.unlocked(1, 0, self.otyper, value) & 0xffff,
            0x08 => self.ospeedr = self.unlocked(2, 0, self.ospeedr, value),
            0x0c => self.pupdr = self.unlocked(2, 0, self.pupdr, value),
            0x10 => {}
            0x14 => self.odr = value & 0xffff,
            // Set wins over reset (section 8.4.7).
            0x18 => self.odr = (self.odr & !(value >> 16)) | (value & 0xffff),
            0x1c => self.write_lock(value),
            0x20 => self.afr[0] = self.unlocked(4, 0, self.afr[0], value),
            0x24 => self.afr[1] = self.unlocked(4, 8, self.afr[1], value),
            _ => return Err(NoRegister),
        }
        self.count(before ^ self.outputs(), now);
        for (_, pin, what) in CLOCK_OUTPUTS.iter().filter(|(port, ..)| *port == self.port) {
            let is_on = self.alternate(*pin) == Some(0);
            self.notes.keep_while(is_on, (*what).into());
        }
        Ok(())
    }

    /// The count of edges goes on, and so do the levels from outside.
    fn reset(&mut self, now: u64) {
        let high = self.outputs();
        let old = std::mem::replace(self, Self::new(self.port));
        (self.edges, self.records, self.recorded) = (old.edges, old.records, old.recorded);
        (self.changes, self.notes) = (old.changes, old.notes);
        (self.wired, self.by_wire, self.foreign) = (old.wired, old.by_wire, old.foreign);
        self.count(high, now);
    }
}

#[cfg(test)]
mod tests {
    use super::super::peripheral::Access;
    use super::*;

    const MODER: u32 = 0x00;
    const OTYPER: u32 = 0x04;
    const PUPDR: u32 = 0x0c;
    const IDR: u32 = 0x10;
    const ODR: u32 = 0x14;
    const BSRR: u32 = 0x18;
    const LCKR: u32 = 0x1c;
    const AFRL: u32 = 0x20;
    const AFRH: u32 = 0x24;

    #[test]
    fn bsrr_sets_and_resets_without_touching_other_pins_and_set_wins() {
        let mut port = Gpio::new(2);
        port.put(0, [(ODR, 0x0f0f), (BSRR, 0x0001_0010)]);
        assert_eq!(port.get(ODR, 0), 0x0f1e);
        port.put(0, [(BSRR, 0x0002_0002)]);
        assert_eq!(port.get(ODR, 0), 0x0f1e);
    }

    #[test]
    fn an_output_reads_back_an_input_reads_its_pull_up() {
        let mut port = Gpio::new(2);
        port.put(0, [(MODER, 0b01), (PUPDR, 0b01 << 2)]);
        assert_eq!(port.get(IDR, 0), 0b10);
        port.put(0, [(BSRR, 1)]);
        assert_eq!(port.get(IDR, 0), 0b11);
    }

    #[test]
    fn a_level_from_outside_is_read_by_inputs_and_goes_on_over_a_reset() {
        let mut port = Gpio::new(2);
        port.drive(3, true);
        port.drive(4, false);
        port.put(0, [(PUPDR, 0b01 << 8)]);
        assert_eq!(port.get(IDR, 0), 1 << 3, "and the pull-up of PC4 is overcome");
        port.reset(0);
        assert_eq!(port.get(IDR, 0), 1 << 3);
        port.put(0, [(MODER, 0b11 << 6)]);
        assert_eq!(port.get(IDR, 0), 0, "an analog pin reads low (section 8.3.12)");
    }

    #[test]
    fn edges_are_counted_for_outputs_only_and_once_a_change_and_a_reset_is_one() {
        let mut port = Gpio::new(2);
        port.put(0, [(MODER, 0b01)]);
        port.put(0, [0b11, 0b11, 0b00, 0b11].map(|value| (ODR, value)));
        assert_eq!(port.edges[..2], [3, 0]);
        port.reset(0);
        assert_eq!(port.edges[..2], [4, 0]);
    }

    #[test]
    fn a_clock_output_is_noted_for_as_long_as_the_pin_is_one() {
        let mut port = Gpio::new(0);
        let noted = [(MODER, 0b10 << 16), (AFRH, 1), (AFRH, 0), (MODER, 0)].map(|write| {
            port.put(0, [write]);
            port.notes.iter().count()
        });
        assert_eq!(noted, [1, 0, 1, 0]);
    }

    #[test]
    fn changes_beyond_what_is_kept_are_only_counted_and_noted() {
        let mut port = Gpio::new(2);
        (port.records, port.recorded) = (true, MOST_CHANGES - 2);
        port.put(0, [(MODER, 0b01)]);
        for now in 0..4 {
            port.put(u64::from(now), [(ODR, now & 1 ^ 1)]);
        }
        assert_eq!(port.edges[0], 4);
        assert_eq!(port.changes[0], [(0, true), (1, false)]);
        port.reset(4);
        assert_eq!(port.notes.iter().count(), 1);
    }

    #[test]
    fn a_locked_pin_keeps_its_setting_until_the_next_reset_and_others_do_not() {
        let lock = |writes: &[u32]| {
            let mut port = Gpio::new(2);
            writes.iter().for_each(|value| port.put(0, [(LCKR, *value)]));
            port.get(LCKR, 0);
            port.put(0, [MODER, AFRL, AFRH, ODR].map(|register| (register, u32::MAX)));
            port
        };
        let pins = 1 << 0 | 1 << 9;
        let mut port = lock(&[LCKK | pins, pins, LCKK | pins]);
        let settings = [MODER, AFRL, AFRH, ODR].map(|register| port.get(register, 0));
        assert_eq!(settings, [0xfff3_fffc, 0xffff_fff0, 0xffff_ff0f, 0xffff]);
        assert_eq!(port.get(LCKR, 0), LCKK | pins);
        port.reset(0);
        assert_eq!(port.get(LCKR, 0), 0);
        let wrong: [&[u32]; 3] = [
            &[LCKK | pins, pins],
            &[LCKK | pins, pins, LCKK | 1],
            &[pins, LCKK | pins],
        ];
        for writes in wrong {
            assert_eq!(lock(writes).get(MODER, 0), u32::MAX, "{writes:x?}");
        }
    }

    #[test]
    fn an_open_drain_drives_low_only_and_reads_what_the_wire_carries() {
        let mut port = Gpio::new(2);
        port.put(0, [(OTYPER, 1), (MODER, 0b01)]);
        assert_eq!((port.driven(0), port.driven(1)), (Some(false), None));
        port.put(0, [(ODR, 1)]);
        assert_eq!(port.driven(0), None);
        assert_eq!(port.drive_by_wire(0, Some(false)), None, "it was low already");
        assert_eq!(port.get(IDR, 0), 0);
        assert_eq!(port.drive_by_wire(0, Some(true)), Some(true));
        assert_eq!(port.get(IDR, 0), 1);
    }
}
