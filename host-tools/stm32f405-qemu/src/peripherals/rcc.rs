//! Reset and clock control (RM0090 section 7).
//!
//! Oscillators and PLLs are ready as soon as they are on. The clock tree follows what the firmware programs.
//! A wrong divider shows as a wrong sample rate or baud rate, as it would on silicon.
//!
//! A crystal that stops takes the PLL with it. If the processor is clocked by them, the clock security system
//! puts it on the internal oscillator and raises an NMI (section 7.2.7). Without that system the clock is
//! gone. On silicon a PLL without input may go on at some low frequency, which the manual does not give.

use crate::chip::ClockLimits;

use super::clock::{ClockTree, HSI_HZ, LSE_HZ, LSI_HZ};
use super::peripheral::{NoRegister, Notes, Peripheral};
use super::register::{bit, field, index};
use crate::outcome::ResetCause;

/// Reset flags in CSR (section 7.3.21).
const RMVF: u32 = 1 << 24;
const PINRSTF: u32 = 1 << 26;
const SFTRSTF: u32 = 1 << 28;
const IWDGRSTF: u32 = 1 << 29;
const WWDGRSTF: u32 = 1 << 30;
const RESET_FLAGS: u32 = 0xfe00_0000;
/// Brown-out, pin and power-on reset: the flags after power-up.
const POWER_ON_FLAGS: u32 = 0x0e00_0000;

/// A crystal may be off by less than 1/1000. Limits apply to its nominal frequency, so they are wider by
/// that much.
const TOLERANCE: u32 = 1000;

const HSION: u32 = 1 << 0;
const HSEON: u32 = 1 << 16;
const CSSON: u32 = 1 << 19;
const PLLON: u32 = 1 << 24;
const PLLI2SON: u32 = 1 << 26;
/// Each ready flag of CR is one bit above its enable.
const ON_BITS: u32 = HSION | HSEON | PLLON | PLLI2SON;

/// Writable bits of CR, PLLCFGR, CFGR (without SWS), SSCGR and PLLI2SCFGR (sections 7.3.1 to 7.3.3, 7.3.22,
/// 7.3.23).
const CR_BITS: u32 = 0x050d_00f9;
const PLLCFGR_BITS: u32 = 0x0f43_7fff;
/// A reserved bit that is set after reset and stays.
const PLLCFGR_FIXED: u32 = 1 << 29;
const CFGR_BITS: u32 = 0xffff_fcf3;
const SSCGR_BITS: u32 = 0xcfff_ffff;
const PLLI2SCFGR_BITS: u32 = 0x7000_7fc0;
/// Number of places for buses in the register map: AHB1 to AHB3, one that is reserved, APB1 and APB2.
pub(crate) const BUSES: usize = 6;
/// Bits of the reset and enable registers (sections 7.3.5 to 7.3.19) in a part without Ethernet, in the order
/// of [`Rcc::reset`].
const RESET_BITS: [u32; BUSES] = [0x2060_11ff, 0xc1, 1, 0, 0x36fe_c9ff, 0x0007_5933];
const ENABLE_BITS: [u32; BUSES] = [0x6074_11ff, 0xc1, 1, 0, 0x36fe_c9ff, 0x0007_5f33];
const SLEEP_BITS: [u32; BUSES] = [0x6067_91ff, 0xc1, 1, 0, 0x36fe_c9ff, 0x0007_5f33];
const SLEEP_AT_RESET: [u32; BUSES] = [0x7e67_91ff, 0xf1, 1, 0, 0x36fe_c9ff, 0x0007_5f33];

/// DCKCFGR.TIMPRE, on parts other than the F405.
const TIMPRE: u32 = 1 << 24;
const NO_TIMPRE: &str = "DCKCFGR.TIMPRE is ignored: the timers keep their clock";
const STOPPED: &str =
    "the crystal stopped, and the processor's clock with it: with CR.CSSON it would continue on HSI";
const PLL_RANGE: &str = "the PLL is outside its range: VCO input 1-2 MHz, VCO 100-432 MHz";

/// CR.HSICAL: what the factory found for the internal oscillator (section 7.3.1). It differs from part to
/// part.
const HSICAL: u32 = 0x77 << 8;

/// Ready and failure flags of CIR (section 7.3.4): enables stand 8 bits higher, clear bits 16 bits.
const READY_FLAGS: u32 = 0x3f;
const CSSF: u32 = 1 << 7;
const READY_ENABLES: u32 = READY_FLAGS << 8;
const CLEAR_AT: u32 = 16;

/// A bus with its own enable and reset registers: their number within each row of registers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Bus {
    Ahb1 = 0,
    Ahb2 = 1,
    Apb1 = 4,
    Apb2 = 5,
}

#[derive(Debug, Clone, Default)]
pub(crate) struct Rcc {
    hse_hz: u32,
    pub(crate) limits: ClockLimits,
    /// Bits of DCKCFGR and DCKCFGR2 that the part has, and what was written there. All but TIMPRE choose
    /// clocks of peripherals without a model.
    pub(crate) selectable: [u32; 2],
    selections: [u32; 2],
    cr: u32,
    pllcfgr: u32,
    cfgr: u32,
    system_source: u32,
    /// AHB1, AHB2, AHB3, (reserved), APB1, APB2.
    reset: [u32; BUSES],
    enable: [u32; BUSES],
    enable_in_sleep: [u32; BUSES],
    bdcr: u32,
    csr: u32,
    sscgr: u32,
    plli2scfgr: u32,
    cir: u32,
    /// True while the crystal has stopped.
    crystal_stopped: bool,
    /// The crystal was started since power-up.
    pub(crate) crystal_started: bool,
    /// STOP or STANDBY: no oscillator runs.
    pub(crate) asleep: bool,
    /// Frequency of LSI.
    pub(crate) lsi_hz: u32,
    /// BDRST was written. Cleared once it is passed on.
    pub(crate) backup_domain_reset: bool,
    /// PWR_CR.DBP: BDCR may be written (section 7.3.20).
    pub(crate) backup_domain_open: bool,
    pub(crate) notes: Notes,
}

impl Rcc {
    pub(crate) fn new(hse_hz: u32) -> Self {
        Self {
            hse_hz,
            cr: HSICAL | 0x83,
            pllcfgr: 0x2400_3010,
            enable: [0x0010_0000, 0, 0, 0, 0, 0],
            enable_in_sleep: SLEEP_AT_RESET,
            csr: POWER_ON_FLAGS,
            plli2scfgr: 0x2000_3000,
            lsi_hz: LSI_HZ,
            ..Self::default()
        }
    }

    /// Sets the flags by which firmware finds out why it was reset. The device pulls its own reset pin low,
    /// so the flag of the pin is set too.
    pub(crate) fn set_reset_cause(&mut self, cause: ResetCause) {
        match cause {
            // The backup domain is reset too: VBAT is taken to come from the same supply.
            ResetCause::PowerCut => (self.bdcr, self.csr) = (0, POWER_ON_FLAGS),
            // The flags of PWR report this cause.
            ResetCause::Standby => {}
            ResetCause::Software => self.csr |= SFTRSTF | PINRSTF,
            ResetCause::WindowWatchdog => self.csr |= WWDGRSTF | PINRSTF,
            ResetCause::Watchdog => self.csr |= IWDGRSTF | PINRSTF,
        }
    }

    /// Stops the crystal, or lets it start again.
    pub(crate) fn set_crystal(&mut self, works: bool) {
        let ready = self.ready();
        self.crystal_stopped = !works;
        if !works && ready & HSEON != 0 && self.cr & CSSON != 0 {
            self.cir |= CSSF;
            // The PLL is turned off with the crystal if it is the system clock.
            let of_system = match self.system_source {
                1 => HSEON,
                2.. if self.pll_source() == HSEON => HSEON | PLLON,
                _ => 0,
            };
            if of_system != 0 {
                self.system_source = 0;
                self.cfgr &= !3;
                self.cr |= HSION;
            }
            self.cr &= !(HSEON | of_system);
        }
        self.flag_ready(ready);
        self.notes.note_if(self.clocks().sysclk == 0, STOPPED);
    }

    /// STOP ends: the processor goes on with HSI, all else is off (section 5.3.4).
    pub(crate) fn wake(&mut self) {
        self.asleep = false;
        self.cr = (self.cr | HSION) & !(HSEON | PLLON | PLLI2SON);
        self.cfgr &= !3;
        self.system_source = 0;
    }

    /// The enable bits of CR whose clock runs.
    fn ready(&self) -> u32 {
        let dead = if self.crystal_stopped { HSEON } else { 0 };
        let on = self.cr & ON_BITS & !dead;
        let fed = on & self.pll_source() != 0;
        if fed { on } else { on & !(PLLON | PLLI2SON) }
    }

    /// Sets the flags of clocks that have just started, if their interrupts are on (section 7.3.4).
    fn flag_ready(&mut self, before: u32) {
        let started = self.ready() & !before;
        self.crystal_started |= started & HSEON != 0;
        // HSI is flag 2, HSE 3, PLL 4, PLLI2S 5.
        let flags = [(HSION, 2), (HSEON, 3), (PLLON, 4), (PLLI2SON, 5)]
            .iter()
            .fold(0, |flags, (on, n)| flags | u32::from(started & on != 0) << n);
        self.cir |= flags & (self.cir >> 8);
    }

    /// The clock tree as programmed. A clock that has stopped has 0 Hz.
    pub(crate) fn clocks(&self) -> ClockTree {
        let sysclk = match self.system_source {
            _ if self.asleep => 0,
            0 => HSI_HZ,
            1 if self.ready() & HSEON != 0 => self.hse_hz,
            2.. if self.ready() & PLLON != 0 => self.pll_hz(),
            _ => 0,
        };
        // HPRE skips 32: 0b1000 divides by 2, 0b1011 by 16, 0b1100 by 64.
        let hclk = match field(self.cfgr, 4, 4) {
            n @ 8..=11 => sysclk >> (n - 7),
            n @ 12..=15 => sysclk >> (n - 6),
            _ => sysclk,
        };
        let apb = |ppre: u32| if ppre & 4 == 0 { 0 } else { (ppre & 3) + 1 };
        let (shift1, shift2) = (apb(field(self.cfgr, 10, 3)), apb(field(self.cfgr, 13, 3)));
        // Section 7.2: timers get twice the bus clock wherever the bus is divided.
        let timers = |shift: u32| hclk >> shift.saturating_sub(1);
        ClockTree {
            sysclk,
            hclk,
            pclk1: hclk >> shift1,
            pclk2: hclk >> shift2,
            timers1: timers(shift1),
            timers2: timers(shift2),
            pll48: if self.ready() & PLLON != 0 && !self.asleep {
                self.pll48_hz()
            } else {
                0
            },
            rtc: self.rtc_clock(),
            crystal: self.rtc_crystal(),
        }
    }

    /// The crystal on its way to the RTC (section 7.3.3). Dividers 0 and 1 let nothing through.
    fn rtc_crystal(&self) -> (u32, u32) {
        let divider = field(self.cfgr, 16, 5);
        let runs = self.ready() & HSEON != 0 && !self.asleep && divider > 1;
        if runs { (self.hse_hz, divider) } else { (0, 0) }
    }

    /// RTCCLK (sections 7.2.8, 7.3.20): its frequency, and its divider. LSE and LSI run in deep sleep too.
    fn rtc_clock(&self) -> (u32, u32) {
        let source = match field(self.bdcr, 8, 2) {
            0b01 if self.bdcr & 1 != 0 => (LSE_HZ, 1),
            0b10 if self.csr & 1 != 0 => (self.lsi_hz, 1),
            0b11 => self.rtc_crystal(),
            _ => (0, 1),
        };
        let runs = bit(self.bdcr, 15) && source.0 != 0;
        if runs { source } else { (0, 1) }
    }

    /// The enable bit of the oscillator that feeds the PLLs.
    fn pll_source(&self) -> u32 {
        if bit(self.pllcfgr, 22) { HSEON } else { HSION }
    }

    fn pll_input_hz(&self) -> u32 {
        let by_crystal = self.pll_source() == HSEON;
        if by_crystal { self.hse_hz } else { HSI_HZ }
    }

    /// PLLCFGR (section 7.3.2): VCO = input / M * N, output = VCO / P.
    fn pll_hz(&self) -> u32 {
        self.vco_hz_by(2 * (field(self.pllcfgr, 16, 2) + 1))
    }

    /// PLL48CLK = VCO / Q. Q is 2 at least.
    fn pll48_hz(&self) -> u32 {
        self.vco_hz_by(field(self.pllcfgr, 24, 4).max(2))
    }

    fn vco_hz_by(&self, divider: u32) -> u32 {
        let input = self.pll_input_hz();
        let (m, n) = (field(self.pllcfgr, 0, 6).max(1), field(self.pllcfgr, 6, 9));
        (u64::from(input) * u64::from(n) / u64::from(m * divider)) as u32
    }

    /// Returns `true` if one of these bits in the bus's enable register is set.
    pub(crate) fn enabled(&self, bus: Bus, bits: u32) -> bool {
        self.enable[bus as usize] & bits != 0
    }

    /// The buses' reset registers.
    pub(crate) fn resets(&self) -> &[u32; BUSES] {
        &self.reset
    }

    /// Returns `true` if the firmware holds a peripheral in reset: one of these bits in the bus's reset
    /// register is set.
    pub(crate) fn held_in_reset(&self, bus: Bus, bits: u32) -> bool {
        self.reset[bus as usize] & bits != 0
    }

    fn write_cr(&mut self, value: u32) {
        // The clock that runs the system cannot be stopped (section 7.3.1).
        let held = match self.system_source {
            0 => HSION,
            1 => HSEON,
            _ => PLLON | self.pll_source(),
        };
        let turned_on = value & !self.cr;
        let ready = self.ready();
        self.cr = HSICAL | (value & CR_BITS) | held;
        self.flag_ready(ready);
        if turned_on & PLLON != 0 {
            let vco_input = self.pll_input_hz() / field(self.pllcfgr, 0, 6).max(1);
            let vco = u64::from(vco_input) * u64::from(field(self.pllcfgr, 6, 9));
            let within = |hz: u64, low: u64, high: u64| {
                let off = u64::from(TOLERANCE);
                (low - low / off..=high + high / off).contains(&hz)
            };
            let good_input = within(vco_input.into(), 1_000_000, 2_000_000);
            self.notes
                .note_if(!good_input || !within(vco, 100_000_000, 432_000_000), PLL_RANGE);
        }
        self.switch();
    }

    /// The system clock follows SW once the source is ready.
    fn switch(&mut self) {
        let wanted = self.cfgr & 3;
        let on = [HSION, HSEON, PLLON, 0][wanted as usize];
        if self.ready() & on != 0 {
            self.system_source = wanted;
        }
        let tree = self.clocks();
        let limits = self.limits;
        for (hz, limit, what) in [
            (tree.sysclk, limits.sysclk, "SYSCLK"),
            (tree.pclk1, limits.pclk1, "PCLK1"),
            (tree.pclk2, limits.pclk2, "PCLK2"),
        ] {
            if hz > limit + limit / TOLERANCE {
                self.notes
                    .note(format!("{what} is above {} MHz", limit / 1_000_000));
            }
        }
    }
}

impl Peripheral for Rcc {
    fn read(&mut self, offset: u32, _now: u64) -> Result<u32, NoRegister> {
        Ok(match offset {
            0x00 => self.cr | (self.ready() << 1),
            0x04 => self.pllcfgr,
            0x08 => (self.cfgr & !0xc) | (self.system_source << 2),
            0x0c => self.cir,
            0x10 | 0x14 | 0x18 | 0x20 | 0x24 => self.reset[index(offset, 0x10)],
            0x30 | 0x34 | 0x38 | 0x40 | 0x44 => self.enable[index(offset, 0x30)],
            0x50 | 0x54 | 0x58 | 0x60 | 0x64 => self.enable_in_sleep[index(offset, 0x50)],
            0x70 => self.bdcr | ((self.bdcr & 1) << 1),
            0x74 => self.csr | ((self.csr & 1) << 1),
            0x80 => self.sscgr,
            0x84 => self.plli2scfgr,
            // DCKCFGR, reserved on the F405; embassy-stm32 writes it on every F4.
            0x8c => self.selections[0],
            0x94 if self.selectable[1] != 0 => self.selections[1],
            _ => return Err(NoRegister),
        })
    }

    fn holds_until(&self, _offset: u32, _now: u64) -> Option<u64> {
        Some(u64::MAX)
    }

    fn write(&mut self, offset: u32, value: u32, _now: u64) -> Result<(), NoRegister> {
        match offset {
            0x00 => self.write_cr(value),
            // Writable with the PLL off only.
            0x04 if self.cr & PLLON == 0 => self.pllcfgr = PLLCFGR_FIXED | (value & PLLCFGR_BITS),
            0x04 => self.notes.note("PLLCFGR written while the PLL is on: ignored"),
            0x08 => {
                self.cfgr = value & CFGR_BITS;
                self.switch();
            }
            0x0c => {
                let cleared = (value >> CLEAR_AT) & (READY_FLAGS | CSSF);
                self.cir = (self.cir & (READY_FLAGS | CSSF) & !cleared) | (value & READY_ENABLES);
            }
            0x10 | 0x14 | 0x18 | 0x20 | 0x24 => {
                let n = index(offset, 0x10);
                self.reset[n] = value & RESET_BITS[n];
            }
            0x30 | 0x34 | 0x38 | 0x40 | 0x44 => {
                let n = index(offset, 0x30);
                self.enable[n] = value & ENABLE_BITS[n];
            }
            0x50 | 0x54 | 0x58 | 0x60 | 0x64 => {
                let n = index(offset, 0x50);
                self.enable_in_sleep[n] = (value & SLEEP_BITS[n]) | (SLEEP_AT_RESET[n] & !SLEEP_BITS[n]);
            }
            0x70 if !self.backup_domain_open => {
                self.notes.note("BDCR written with PWR_CR.DBP clear: ignored");
            }
            // BDRST resets all of the backup domain but itself.
            0x70 if bit(value, 16) => (self.bdcr, self.backup_domain_reset) = (1 << 16, true),
            0x70 => {
                // RTCSEL can be chosen once (section 7.3.20).
                let chosen = self.bdcr & 0x300;
                let others = if chosen == 0 { 0x8305 } else { 0x8005 };
                self.bdcr = chosen | (value & others);
            }
            0x74 => {
                let kept = if value & RMVF != 0 { 0 } else { RESET_FLAGS };
                self.csr = (self.csr & kept) | (value & 1);
            }
            0x80 => self.sscgr = value & SSCGR_BITS,
            0x84 => self.plli2scfgr = value & PLLI2SCFGR_BITS,
            0x8c | 0x94 if offset == 0x8c || self.selectable[1] != 0 => {
                let n = index(offset, 0x8c) / 2;
                self.selections[n] = value & self.selectable[n];
                self.notes.note_if(self.selections[0] & TIMPRE != 0, NO_TIMPRE);
            }
            _ => return Err(NoRegister),
        }
        Ok(())
    }

    /// A system reset. The backup domain and the reset flags stay (section 7.1.1).
    fn reset(&mut self, _now: u64) {
        let old = std::mem::replace(self, Self::new(self.hse_hz));
        (self.bdcr, self.csr) = (old.bdcr, old.csr & RESET_FLAGS);
        (self.crystal_stopped, self.notes) = (old.crystal_stopped, old.notes);
        self.crystal_started = old.crystal_started;
        (self.lsi_hz, self.limits, self.selectable) = (old.lsi_hz, old.limits, old.selectable);
    }

    /// RCC's interrupt, and the NMI of the clock security system.
    fn interrupt(&self, output: usize) -> bool {
        match output {
            0 => self.cir & (self.cir >> 8) & READY_FLAGS != 0,
            _ => self.cir & CSSF != 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::peripheral::Access;
    use super::*;

    const CR: u32 = 0x00;
    const PLLCFGR: u32 = 0x04;
    const CFGR: u32 = 0x08;
    const CIR: u32 = 0x0c;
    const BDCR: u32 = 0x70;
    const CSR: u32 = 0x74;
    const HZ: u32 = 8_000_000;
    /// The crystal by 4, times 168, by 2.
    const PLL: u32 = 4 | 168 << 6 | 1 << 22 | 7 << 24;

    /// The crystal and the PLL are on: 168 MHz, APB1 /4, APB2 /2, as the data sheet's maxima ask for.
    fn on_pll(mut rcc: Rcc) -> Rcc {
        let buses = 2 | 0b101 << 10 | 0b100 << 13;
        rcc.put(0, [(CR, 0x83 | HSEON), (PLLCFGR, PLL)]);
        rcc.put(0, [(CR, 0x83 | HSEON | PLLON), (CFGR, buses)]);
        rcc
    }

    fn at_168_mhz() -> Rcc {
        on_pll(Rcc::new(HZ))
    }

    fn reset(rcc: &mut Rcc, cause: ResetCause) {
        rcc.reset(0);
        rcc.set_reset_cause(cause);
    }

    #[test]
    fn the_tree_follows_the_dividers_and_timers_get_twice_a_divided_bus() {
        assert_eq!(Rcc::new(HZ).clocks(), ClockTree::HSI);
        let expected = ClockTree {
            sysclk: 168_000_000,
            hclk: 168_000_000,
            pclk1: 42_000_000,
            pclk2: 84_000_000,
            timers1: 84_000_000,
            timers2: 168_000_000,
            pll48: 48_000_000,
            rtc: (0, 1),
            crystal: (0, 0),
        };
        assert_eq!(at_168_mhz().clocks(), expected);
    }

    #[test]
    fn the_ahb_prescaler_skips_32() {
        let mut rcc = Rcc::new(HZ);
        let divided = [7, 8, 11, 12, 15].map(|hpre| {
            rcc.put(0, [(CFGR, hpre << 4)]);
            HSI_HZ / rcc.clocks().hclk
        });
        assert_eq!(divided, [1, 2, 16, 64, 512], "section 7.3.3, HPRE");
    }

    #[test]
    fn the_system_clock_does_not_switch_to_a_source_that_is_off() {
        let mut rcc = Rcc::new(HZ);
        rcc.put(0, [(CFGR, 1)]);
        assert_eq!(rcc.get(CFGR, 0) & 0xf, 1, "SW asks for HSE, SWS says HSI");
        rcc.put(0, [(CR, 0x83 | HSEON)]);
        assert_eq!(rcc.get(CFGR, 0) & 0xf, 0b0101);
    }

    #[test]
    fn the_clock_in_use_cannot_be_stopped() {
        let mut rcc = at_168_mhz();
        rcc.put(0, [(CR, 0)]);
        assert_eq!(rcc.get(CR, 0) & ON_BITS, HSEON | PLLON);
    }

    #[test]
    fn reset_flags_add_up_until_rmvf_clears_them() {
        let mut rcc = Rcc::new(HZ);
        assert_eq!(rcc.get(CSR, 0), POWER_ON_FLAGS);
        reset(&mut rcc, ResetCause::Software);
        assert_eq!(rcc.get(CSR, 0), POWER_ON_FLAGS | SFTRSTF);
        rcc.put(0, [(CSR, RMVF)]);
        assert_eq!(rcc.get(CSR, 0), 0);
        reset(&mut rcc, ResetCause::Watchdog);
        assert_eq!(rcc.get(CSR, 0), IWDGRSTF | PINRSTF);
        reset(&mut rcc, ResetCause::PowerCut);
        assert_eq!(rcc.get(CSR, 0), POWER_ON_FLAGS, "and none of before");
    }

    #[test]
    fn selections_of_clocks_are_kept_where_the_part_has_them() {
        let (mut f405, mut f446) = (Rcc::new(8_000_000), Rcc::new(8_000_000));
        f446.selectable = [0x1ff0_1f1f, 0x3cc0_0000];
        for rcc in [&mut f405, &mut f446] {
            rcc.put(0, [(0x8c, TIMPRE)]);
            rcc.reset(0);
        }
        assert_eq!(f405.write(0x94, 1 << 27, 0), Err(NoRegister));
        f446.put(0, [(0x94, u32::MAX)]);
        assert_eq!(f446.get(0x94, 0), 0x3cc0_0000);
        assert_eq!(f405.notes.iter().count(), 0);
        assert_eq!(f446.notes.iter().collect::<Vec<_>>(), [NO_TIMPRE]);
    }

    #[test]
    fn buses_and_a_pll_input_outside_their_limits_are_noted() {
        let mut rcc = at_168_mhz();
        assert_eq!(rcc.notes.iter().count(), 0);
        rcc.put(0, [(CFGR, 2)]);
        let noted: Vec<_> = rcc.notes.iter().collect();
        assert_eq!(noted, ["PCLK1 is above 42 MHz", "PCLK2 is above 84 MHz"]);
        let mut rcc = Rcc::new(25_000_000);
        rcc.put(0, [(PLLCFGR, PLL), (CR, 0x83 | HSEON | PLLON)]);
        assert_eq!(rcc.notes.iter().count(), 1);
    }

    #[test]
    fn a_sleep_stops_every_clock_and_a_wake_gives_hsi() {
        let mut rcc = at_168_mhz();
        rcc.asleep = true;
        assert_eq!(rcc.clocks().hclk, 0);
        rcc.wake();
        assert_eq!((rcc.clocks().sysclk, rcc.get(CR, 0) & ON_BITS), (HSI_HZ, HSION));
    }

    #[test]
    fn a_crystal_that_never_starts_is_never_ready_and_nothing_switches_to_it() {
        let mut rcc = Rcc::new(HZ);
        rcc.set_crystal(false);
        let mut rcc = on_pll(rcc);
        assert_eq!(rcc.get(CR, 0) & (ON_BITS << 1), HSION << 1);
        assert_eq!((rcc.get(CFGR, 0) & 0xc, rcc.clocks().sysclk), (0, HSI_HZ));
    }

    #[test]
    fn a_crystal_that_stops_gives_an_nmi_and_hsi_with_css_and_no_clock_without() {
        let mut safe = at_168_mhz();
        safe.put(0, [(CR, 0x83 | HSEON | CSSON | PLLON)]);
        safe.set_crystal(false);
        assert_eq!((safe.clocks().sysclk, safe.interrupt(1)), (HSI_HZ, true));
        assert_eq!(safe.get(CR, 0) & ON_BITS, HSION, "HSE and PLL are off");
        safe.put(0, [(CIR, CSSF << CLEAR_AT)]);
        assert!(!safe.interrupt(1));

        let mut bare = at_168_mhz();
        bare.set_crystal(false);
        assert_eq!((bare.clocks().hclk, bare.interrupt(1)), (0, false));
        assert_eq!(bare.notes.iter().count(), 1);
        reset(&mut bare, ResetCause::Watchdog);
        assert_eq!(bare.clocks().sysclk, HSI_HZ);
        bare.put(0, [(CR, 0x83 | HSEON)]);
        assert_eq!(bare.get(CR, 0) & (HSEON << 1), 0, "it outlives a reset");
    }

    #[test]
    fn a_clock_that_gets_ready_raises_its_flag_and_interrupt_if_asked_to() {
        let mut rcc = Rcc::new(HZ);
        let hse = 1 << 3;
        rcc.put(0, [(CIR, hse << 8), (CR, 0x83 | HSEON | PLLON)]);
        assert_eq!(rcc.get(CIR, 0), hse << 8 | hse, "PLL's is off");
        assert!(rcc.interrupt(0));
        rcc.put(0, [(CIR, hse << CLEAR_AT)]);
        assert_eq!((rcc.get(CIR, 0), rcc.interrupt(0)), (0, false));
    }

    #[test]
    fn a_crystal_that_is_off_by_some_ppm_is_within_every_limit_and_seen_in_every_clock() {
        let rcc = on_pll(Rcc::new(8_000_400));
        assert_eq!(rcc.clocks().timers1, 84_004_200, "50 ppm");
        assert_eq!(rcc.notes.iter().count(), 0);
    }

    #[test]
    fn the_backup_domain_keeps_its_setting_over_a_reset_and_needs_dbp() {
        let mut rcc = Rcc::new(HZ);
        rcc.put(0, [(BDCR, 1)]);
        assert_eq!(rcc.get(BDCR, 0), 0);
        rcc.backup_domain_open = true;
        rcc.put(0, [(BDCR, 1)]);
        reset(&mut rcc, ResetCause::Software);
        assert_eq!(rcc.get(BDCR, 0), 0b11, "LSEON and LSERDY");
    }
}
