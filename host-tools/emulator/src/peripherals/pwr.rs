//! Power control (RM0090 section 5.4). The regulator is ready at once. The supply has the voltage that is set
//! from outside, and the programmable voltage detector compares it with its threshold.

use super::peripheral::{NoRegister, Peripheral};
use super::register::{bit, field};

const VOS: u32 = 1 << 14;
const DBP: u32 = 1 << 8;
const PVDE: u32 = 1 << 4;

/// The detector's thresholds in mV for a falling and for a rising supply, by CR.PLS. Typical values of
/// DocID022152, table of the reset and power control block.
const DETECTOR: [[u32; 2]; 8] = [
    [2040, 2140],
    [2190, 2300],
    [2350, 2450],
    [2510, 2600],
    [2660, 2760],
    [2840, 2930],
    [2930, 3030],
    [3030, 3140],
];
/// A good supply.
const GOOD_MV: u32 = 3300;

/// PWR's registers.
#[derive(Debug, Clone)]
pub struct Pwr {
    cr: u32,
    csr: u32,
    supply_mv: u32,
    /// The detector's comparator: the supply is below the threshold.
    below: bool,
}

impl Default for Pwr {
    fn default() -> Self {
        Self {
            cr: VOS,
            csr: 0,
            supply_mv: GOOD_MV,
            below: false,
        }
    }
}

impl Pwr {
    /// The supply has this voltage from now on, in mV.
    pub fn set_supply(&mut self, millivolts: u32) {
        self.supply_mv = millivolts;
        self.compare();
    }

    /// The supply, in mV.
    pub fn supply(&self) -> u32 {
        self.supply_mv
    }

    fn compare(&mut self) {
        let [falling, rising] = DETECTOR[field(self.cr, 5, 3) as usize];
        let threshold = if self.below { rising } else { falling };
        self.below = self.cr & PVDE != 0 && self.supply_mv < threshold;
    }

    /// The backup domain may be written (CR.DBP).
    pub fn backup_domain_open(&self) -> bool {
        self.cr & DBP != 0
    }
}

impl Peripheral for Pwr {
    fn read(&mut self, offset: u32, _now: u64) -> Result<u32, NoRegister> {
        match offset {
            0x00 => Ok(self.cr),
            // VOSRDY always; BRR follows BRE; PVDO.
            0x04 => Ok(self.csr | 1 << 14 | (u32::from(bit(self.csr, 9)) << 3) | u32::from(self.below) << 2),
            _ => Err(NoRegister),
        }
    }

    fn write(&mut self, offset: u32, value: u32, _now: u64) -> Result<(), NoRegister> {
        match offset {
            0x00 => {
                // CWUF and CSBF read as 0.
                self.cr = value & 0x43f3;
                self.compare();
            }
            0x04 => self.csr = value & 0x300,
            _ => return Err(NoRegister),
        }
        Ok(())
    }

    /// The supply stays.
    fn reset(&mut self, _now: u64) {
        *self = Self {
            supply_mv: self.supply_mv,
            ..Self::default()
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_regulator_is_ready_and_dbp_opens_the_backup_domain() {
        let mut pwr = Pwr::default();
        assert_eq!(pwr.read(0x04, 0), Ok(1 << 14));
        assert!(!pwr.backup_domain_open());
        pwr.write(0x00, VOS | DBP, 0).unwrap();
        assert!(pwr.backup_domain_open());
        assert_eq!(pwr.read(0x00, 0), Ok(VOS | DBP));
    }

    #[test]
    fn the_detector_finds_a_supply_below_its_threshold_and_lets_go_above_the_hysteresis() {
        let mut pwr = Pwr::default();
        let low = |pwr: &mut Pwr| pwr.read(0x04, 0).unwrap() & 1 << 2 != 0;
        pwr.set_supply(2800);
        assert!(!low(&mut pwr), "the detector is off");
        pwr.write(0x00, VOS | PVDE | 6 << 5, 0).unwrap();
        assert!(low(&mut pwr));
        for (millivolts, expected) in [
            (2940, true),
            (3029, true),
            (3030, false),
            (2930, false),
            (2929, true),
        ] {
            pwr.set_supply(millivolts);
            assert_eq!(low(&mut pwr), expected, "{millivolts} mV");
        }
        pwr.write(0x00, VOS | PVDE, 0).unwrap();
        assert!(!low(&mut pwr), "2.0 V is the threshold now");
    }

    #[test]
    fn the_supply_outlives_a_reset_and_the_detector_is_off_after_it() {
        let mut pwr = Pwr::default();
        pwr.write(0x00, VOS | PVDE | 6 << 5, 0).unwrap();
        pwr.set_supply(2800);
        pwr.reset(0);
        assert_eq!(pwr.read(0x04, 0), Ok(1 << 14));
        pwr.write(0x00, VOS | PVDE | 6 << 5, 0).unwrap();
        assert_eq!(pwr.read(0x04, 0), Ok(1 << 14 | 1 << 2));
    }

    #[test]
    fn the_backup_regulator_is_ready_when_on() {
        let mut pwr = Pwr::default();
        pwr.write(0x04, 1 << 9, 0).unwrap();
        assert_eq!(pwr.read(0x04, 0), Ok(1 << 14 | 1 << 9 | 1 << 3));
    }
}
