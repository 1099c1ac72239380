//! Power control (RM0090 section 5.4). The regulator is ready at once. The supply has the voltage that is set
//! from outside, and the programmable voltage detector compares it with its threshold. A deep sleep is STOP
//! or STANDBY, as CR.PDDS says.

use super::clock::ClockTree;
use super::peripheral::{NoRegister, Notes, Peripheral};
use super::register::{bit, field};

const VOS: u32 = 1 << 14;
const DBP: u32 = 1 << 8;
/// ODEN and ODSWEN of CR; ODRDY and ODSWRDY of CSR.
const OVERDRIVE: u32 = 0b11 << 16;
const PVDE: u32 = 1 << 4;
const PDDS: u32 = 1 << 1;
/// CSR: wake-up flag, standby flag.
const WUF: u32 = 1 << 0;
const SBF: u32 = 1 << 1;
const EWUP: u32 = 1 << 8;
/// With VOS clear the regulator is in scale 2, which is for HCLK up to 144 MHz (section 5.1.3). A crystal may
/// be off by less than 1/1000.
const SCALE_2_HZ: u32 = 144_144_000;

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
const GOOD_MV: u32 = 3300;

#[derive(Debug, Clone, Default)]
pub(crate) struct Pwr {
    cr: u32,
    csr: u32,
    pub(crate) supply_mv: u32,
    /// The detector finds the supply below its threshold: EXTI line 16.
    pub(crate) below: bool,
    /// WUF and SBF, which outlive a reset.
    pub(crate) flags: u32,
    hclk: u32,
    /// The part has ODEN and ODSWEN (section 5.4.2, for the STM32F42x).
    pub(crate) has_overdrive: bool,
    pub(crate) notes: Notes,
}

impl Pwr {
    pub(crate) fn new() -> Self {
        Self {
            cr: VOS,
            supply_mv: GOOD_MV,
            ..Self::default()
        }
    }

    /// Sets the voltage of the supply, mV.
    pub(crate) fn set_supply(&mut self, millivolts: u32) {
        self.supply_mv = millivolts;
        self.compare();
    }

    /// Returns `true` if a deep sleep is STANDBY, not STOP.
    pub(crate) fn chooses_standby(&self) -> bool {
        self.cr & PDDS != 0
    }

    /// Returns `true` if a rising edge on WKUP (PA0) ends STANDBY.
    pub(crate) fn wakes_by_pin(&self) -> bool {
        self.csr & EWUP != 0
    }

    /// STANDBY has ended, by the pin.
    pub(crate) fn woken(&mut self) {
        self.flags = SBF | WUF;
    }

    fn check_scale(&mut self) {
        let fast = self.cr & VOS == 0 && self.hclk > SCALE_2_HZ;
        self.notes
            .note_if(fast, "CR.VOS: scale 2 is for HCLK up to 144 MHz");
    }

    fn compare(&mut self) {
        let [falling, rising] = DETECTOR[field(self.cr, 5, 3) as usize];
        let threshold = if self.below { rising } else { falling };
        self.below = self.cr & PVDE != 0 && self.supply_mv < threshold;
    }

    /// Returns `true` if the backup domain may be written (CR.DBP).
    pub(crate) fn backup_domain_open(&self) -> bool {
        self.cr & DBP != 0
    }
}

impl Peripheral for Pwr {
    fn read(&mut self, offset: u32, _now: u64) -> Result<u32, NoRegister> {
        match offset {
            0x00 => Ok(self.cr),
            // VOSRDY always; BRR follows BRE; PVDO.
            0x04 => {
                let ready = 1 << 14 | u32::from(bit(self.csr, 9)) << 3;
                // ODRDY and ODSWRDY follow ODEN and ODSWEN.
                let ready = ready | self.cr & OVERDRIVE;
                Ok(self.csr | self.flags | ready | u32::from(self.below) << 2)
            }
            _ => Err(NoRegister),
        }
    }

    fn holds_until(&self, _offset: u32, _now: u64) -> Option<u64> {
        Some(u64::MAX)
    }

    fn write(&mut self, offset: u32, value: u32, _now: u64) -> Result<(), NoRegister> {
        match offset {
            0x00 => {
                // CWUF and CSBF read as 0.
                let overdrive = if self.has_overdrive { OVERDRIVE } else { 0 };
                self.cr = value & (0x43f3 | overdrive);
                // CWUF and CSBF have the order of WUF and SBF.
                self.flags &= !(value >> 2);
                self.compare();
                self.check_scale();
            }
            0x04 => self.csr = value & 0x300,
            _ => return Err(NoRegister),
        }
        Ok(())
    }

    /// Keeps the supply, and the flags that say why the part was woken.
    fn reset(&mut self, _now: u64) {
        let old = std::mem::replace(self, Self::new());
        (self.supply_mv, self.flags) = (old.supply_mv, old.flags);
        (self.hclk, self.notes) = (old.hclk, old.notes);
        self.has_overdrive = old.has_overdrive;
    }

    fn set_clocks(&mut self, clocks: &ClockTree, _now: u64) {
        self.hclk = clocks.hclk;
        self.check_scale();
    }
}

#[cfg(test)]
mod tests {
    use super::super::peripheral::Access;
    use super::*;

    const CR: u32 = 0x00;
    const CSR: u32 = 0x04;
    const VOSRDY: u32 = 1 << 14;
    const PVDO: u32 = 1 << 2;
    const CSBF: u32 = 1 << 3;
    /// The detector at 2.93 V.
    const DETECTING: u32 = VOS | PVDE | 6 << 5;

    #[test]
    fn regulators_are_ready_and_dbp_opens_the_backup_domain() {
        let mut pwr = Pwr::new();
        assert_eq!(pwr.get(CSR, 0), VOSRDY);
        assert!(!pwr.backup_domain_open());
        pwr.put(0, [(CR, VOS | DBP), (CSR, 1 << 9)]);
        assert!(pwr.backup_domain_open());
        assert_eq!(pwr.get(CSR, 0), VOSRDY | 1 << 9 | 1 << 3, "BRE and BRR");
    }

    #[test]
    fn the_detector_finds_a_supply_below_its_threshold_and_lets_go_above_the_hysteresis() {
        let mut pwr = Pwr::new();
        pwr.set_supply(2800);
        assert_eq!(pwr.get(CSR, 0), VOSRDY, "the detector is off");
        pwr.put(0, [(CR, DETECTING)]);
        let supplies = [2800, 2940, 3029, 3030, 2930, 2929];
        let low = supplies.map(|millivolts| {
            pwr.set_supply(millivolts);
            pwr.get(CSR, 0) & PVDO != 0
        });
        assert_eq!(low, [true, true, true, false, false, true]);
        pwr.put(0, [(CR, VOS | PVDE)]);
        assert_eq!(pwr.get(CSR, 0), VOSRDY, "2.0 V is the threshold now");
    }

    #[test]
    fn the_supply_outlives_a_reset_and_the_detector_is_off_after_it() {
        let mut pwr = Pwr::new();
        pwr.put(0, [(CR, DETECTING)]);
        pwr.set_supply(2800);
        pwr.reset(0);
        assert_eq!(pwr.get(CSR, 0), VOSRDY);
        pwr.put(0, [(CR, DETECTING)]);
        assert_eq!(pwr.get(CSR, 0), VOSRDY | PVDO);
    }

    #[test]
    fn scale_2_is_noted_above_144_mhz() {
        let mut pwr = Pwr::new();
        pwr.put(0, [(CR, 0)]);
        let mut clocks = ClockTree::HSI;
        for (hclk, notes) in [(144_000_000, 0), (168_000_000, 1)] {
            clocks.hclk = hclk;
            pwr.set_clocks(&clocks, 0);
            assert_eq!(pwr.notes.iter().count(), notes);
        }
    }

    #[test]
    fn the_flags_of_standby_outlive_a_reset_and_are_cleared_by_software() {
        let mut pwr = Pwr::new();
        pwr.woken();
        pwr.reset(0);
        assert_eq!(pwr.get(CSR, 0), VOSRDY | SBF | WUF);
        pwr.put(0, [(CR, VOS | CSBF)]);
        assert_eq!(pwr.get(CSR, 0), VOSRDY | WUF);
    }
}
