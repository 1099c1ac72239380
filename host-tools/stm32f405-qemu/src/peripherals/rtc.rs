//! The real-time clock (RM0090 section 26): calendar, two alarms, wake-up timer, backup registers.
//!
//! # Design
//!
//! The calendar is a function of time, as a timer's counter is: a moment, and the edges of the RTC's clock
//! since then. It is in the backup domain: it goes on in STOP, in STANDBY and across resets, and a power cut
//! or BDCR.BDRST ends it. It is loaded when initialisation mode ends; silicon takes four clocks more.
//!
//! The flags that firmware waits for (INITF, RSF, WUTWF, ALRAWF, ALRBWF) are set two clocks of the RTC after
//! their cause, so writes of firmware that does not wait are lost here too. Time stamps, tamper detection,
//! the reference clock, calibration, shifts and the output are left out and noted.

mod calendar;

use super::clock::{self, ClockTree};
use super::peripheral::{NoRegister, Notes, Peripheral};
use super::register::{field, index};
use calendar::Moment;

const BYPSHAD: u32 = 1 << 5;
const FMT: u32 = 1 << 6;
const ALRAE: u32 = 1 << 8;
const WUTE: u32 = 1 << 10;
const ALRAIE: u32 = 1 << 12;
const WUTIE: u32 = 1 << 14;
const ADD1H: u32 = 1 << 16;
const SUB1H: u32 = 1 << 17;
/// Bits of CR that keep what is written.
const CR_BITS: u32 = 0x00fc_ffff;

const ALRAWF: u32 = 1 << 0;
const WUTWF: u32 = 1 << 2;
const INITS: u32 = 1 << 4;
const RSF: u32 = 1 << 5;
const INITF: u32 = 1 << 6;
const INIT: u32 = 1 << 7;
const ALRAF: u32 = 1 << 8;
const WUTF: u32 = 1 << 10;
/// Flags of events.
const FLAGS: u32 = 0x3f00;

const KEYS: [u32; 2] = [0xca, 0x53];
const HOUR: u64 = 3600;

/// Register bits that request unmodelled features.
const UNMODELLED: [(u32, u32, &str); 5] = [
    (
        0x08,
        0x00e8_8898,
        "CR: time stamps, the reference clock, coarse calibration and the output are not modelled",
    ),
    (0x18, 0x9f, "CALIBR: coarse calibration is not modelled"),
    (0x2c, u32::MAX, "SHIFTR: shifts are not modelled"),
    (0x3c, 0xe1ff, "CALR: smooth calibration is not modelled"),
    (0x40, 0x7ff9f, "TAFCR: tamper detection is not modelled"),
];
const NO_DATE: &str = "TR, DR: there is no such date or time: the calendar was not set";
const LOCKED: &str = "a register was written with PWR_CR.DBP clear or without the keys in WPR: ignored";
const NOT_INITIALISING: &str = "TR, DR or PRER was written outside of initialisation mode: ignored";
const RUNNING: &str = "WUTR or an alarm was written while it is on: ignored";

#[derive(Debug, Clone, Default)]
pub(crate) struct Rtc {
    /// RTCCLK: a frequency and what it is divided by. 0 Hz if it has none.
    clock: (u32, u32),
    /// Calendar and sub-second counter at `since_ns`; the ticks of RTCCLK count from there.
    moment: Moment,
    sub_second: u64,
    since_ns: u64,
    /// TR and DR in initialisation mode.
    written: (u32, u32),
    /// Initialisation mode is entered at this time.
    init_at: Option<u64>,
    cr: u32,
    /// FLAGS, and INITS.
    isr: u32,
    prer: u32,
    wutr: u32,
    alarms: [u32; 2],
    alarm_fractions: [u32; 2],
    /// Times from which the two alarms and the wake-up timer may be written, ns.
    writable_at: [u64; 3],
    synchronised_at: u64,
    /// Times of the next flags of the two alarms and the wake-up timer, ns.
    next: [Option<u64>; 3],
    /// When the wake-up timer was started, and how often it has set its flag since.
    wakes_since: u64,
    wakes: u64,
    /// TR and DR as a read of SSR or TR has latched them.
    shadow: Option<(u32, u32)>,
    /// Keys that were written to WPR.
    keys: usize,
    calr: u32,
    tafcr: u32,
    calibr: u32,
    backup: [u32; 20],
    /// PWR_CR.DBP.
    pub(crate) backup_domain_open: bool,
    pub(crate) notes: Notes,
}

/// Calendar and sub-second counter at a time.
struct Reading {
    moment: Moment,
    /// Ticks of ck_apre within the second.
    ticks: u64,
}

impl Rtc {
    pub(crate) fn new() -> Self {
        Self {
            clock: (0, 1),
            moment: Moment::RESET,
            written: Moment::RESET.registers(false),
            prer: 0x7f_00ff,
            wutr: 0xffff,
            synchronised_at: u64::MAX,
            ..Self::default()
        }
    }

    /// Time of the given edge of RTCCLK after `from`, ns.
    fn clocks_after(&self, from: u64, clocks: u64) -> u64 {
        let (hz, divider) = self.clock;
        from.saturating_add(clock::edge(clocks.saturating_mul(divider.into()), hz))
    }

    fn asynchronous(&self) -> u64 {
        u64::from(field(self.prer, 16, 7)) + 1
    }

    fn synchronous(&self) -> u64 {
        u64::from(field(self.prer, 0, 15)) + 1
    }

    /// Ticks of ck_apre since `since_ns`.
    fn ticks(&self, now: u64) -> u64 {
        let (hz, divider) = self.clock;
        clock::ticks(now.saturating_sub(self.since_ns), hz) / u64::from(divider) / self.asynchronous()
    }

    fn time_of_tick(&self, tick: u64) -> u64 {
        self.clocks_after(self.since_ns, tick.saturating_mul(self.asynchronous()))
    }

    fn reading(&self, now: u64) -> Reading {
        let ticks = self.sub_second + if self.stands() { 0 } else { self.ticks(now) };
        Reading {
            moment: self.moment.plus(ticks / self.synchronous()),
            ticks: ticks % self.synchronous(),
        }
    }

    /// Returns `true` if the calendar is stopped, in initialisation mode.
    fn stands(&self) -> bool {
        self.init_at.is_some()
    }

    fn initialises(&self, now: u64) -> bool {
        self.init_at.is_some_and(|at| at <= now)
    }

    fn twelve_hours(&self) -> bool {
        self.cr & FMT != 0
    }

    fn registers(&self, now: u64) -> (u32, u32) {
        if self.initialises(now) {
            return self.written;
        }
        self.reading(now).moment.registers(self.twelve_hours())
    }

    /// Moves the origin to `now`.
    fn go_on(&mut self, now: u64) {
        let Reading { moment, ticks } = self.reading(now);
        (self.moment, self.sub_second, self.since_ns) = (moment, ticks, now);
    }

    /// The time of a tick, given in seconds and ticks from the beginning of the current second.
    fn time_of(&self, now: u64, seconds: u64, ticks: u64) -> u64 {
        let passed = self.sub_second + self.ticks(now);
        let second = passed / self.synchronous() + seconds;
        self.time_of_tick((second * self.synchronous() + ticks).saturating_sub(self.sub_second))
    }

    /// When an alarm's flag will be set next (sections 26.3.4, 26.6.7, 26.6.19).
    fn next_alarm(&self, alarm: usize, now: u64) -> Option<u64> {
        if self.cr & ALRAE << alarm == 0 || self.stands() || self.clock.0 == 0 {
            return None;
        }
        let Reading { moment, ticks } = self.reading(now);
        let fraction = self.alarm_fractions[alarm];
        let masked = field(fraction, 24, 4);
        let seconds = || moment.seconds_to_alarm(self.alarms[alarm], self.twelve_hours());
        if masked == 0 {
            return Some(self.time_of(now, seconds()?, 0));
        }
        // SS counts down from PREDIV_S. Its lower bits are compared.
        let every = 1u64 << masked;
        let wanted = u64::from(field(fraction, 0, 15));
        let first = (self.synchronous() - 1).wrapping_sub(wanted) % every;
        let fits_now = moment.fits(self.alarms[alarm], self.twelve_hours());
        let later = if ticks < first {
            first
        } else {
            first + ((ticks - first) / every + 1) * every
        };
        if fits_now && later < self.synchronous() {
            return Some(self.time_of(now, 0, later));
        }
        // A second has no such tick if PREDIV_S is below it.
        let seconds = seconds().filter(|_| first < self.synchronous())?;
        Some(self.time_of(now, seconds, first))
    }

    /// Time of the wake-up timer's next flag, if it starts now or has just set its flag (section 26.3.5).
    fn next_wake_up(&self, now: u64) -> Option<u64> {
        if self.cr & WUTE == 0 || self.clock.0 == 0 {
            return None;
        }
        let counts = u64::from(self.wutr) + 1;
        Some(match field(self.cr, 0, 3) {
            0b100 | 0b101 => self.time_of(now, counts, 0),
            0b110 | 0b111 => self.time_of(now, counts + 0x1_0000, 0),
            n => self.clocks_after(self.wakes_since, ((self.wakes + 1) * counts) << (4 - n)),
        })
    }

    fn look_ahead(&mut self, now: u64) {
        self.next[0] = self.next_alarm(0, now);
        self.next[1] = self.next_alarm(1, now);
    }

    /// Fills in what has happened up to `now`.
    pub(crate) fn advance(&mut self, now: u64) {
        while let Some((at, n)) = self.soonest().filter(|(at, _)| *at <= now) {
            self.isr |= ALRAF << n;
            self.next[n] = match n {
                2 => {
                    self.wakes += 1;
                    self.next_wake_up(at)
                }
                alarm => self.next_alarm(alarm, at),
            };
        }
    }

    fn soonest(&self) -> Option<(u64, usize)> {
        let next = self.next.iter().enumerate();
        next.filter_map(|(n, at)| Some(((*at)?, n))).min()
    }

    /// When the next flag is set, if one of the interrupts is on.
    pub(crate) fn next_flag(&self) -> Option<u64> {
        let asks = self.cr & (ALRAIE | (ALRAIE << 1) | WUTIE) != 0;
        asks.then(|| self.soonest()).flatten().map(|(at, _)| at)
    }

    /// The level on EXTI line 17: an alarm, with its interrupt on.
    pub(crate) fn alarm_line(&self) -> bool {
        self.isr & self.cr >> 4 & (ALRAF | ALRAF << 1) != 0
    }

    /// The level on EXTI line 22: the wake-up timer, with its interrupt on.
    pub(crate) fn wake_up_line(&self) -> bool {
        self.isr & WUTF != 0 && self.cr & WUTIE != 0
    }

    /// Resets the backup domain. Levels from other peripherals stay.
    pub(crate) fn reset_backup_domain(&mut self, now: u64) {
        let old = std::mem::replace(self, Self::new());
        (self.clock, self.notes) = (old.clock, old.notes);
        (self.backup_domain_open, self.since_ns) = (old.backup_domain_open, now);
        self.synchronised_at = self.clocks_after(now, 2);
    }

    fn status(&self, now: u64) -> u32 {
        let off = [self.cr & ALRAE, self.cr & ALRAE << 1, self.cr & WUTE].map(|on| on == 0);
        let writable = (0..3).fold(0, |bits, n| {
            bits | u32::from(off[n] && self.writable_at[n] <= now) << n
        });
        let mut status = self.isr | writable;
        if self.synchronised_at <= now && self.cr & BYPSHAD == 0 {
            status |= RSF;
        }
        match self.init_at {
            Some(at) if at <= now => status | INIT | INITF,
            Some(_) => status | INIT,
            None => status,
        }
    }

    fn write_isr(&mut self, value: u32, now: u64) {
        if value & RSF == 0 && self.synchronised_at <= now {
            self.synchronised_at = self.clocks_after(now, 2);
        }
        match (value & INIT != 0, self.init_at) {
            (true, None) => {
                self.go_on(now);
                self.written = self.moment.registers(self.twelve_hours());
                self.init_at = Some(self.clocks_after(now, 2));
            }
            (false, Some(at)) => {
                self.init_at = None;
                self.since_ns = now;
                if at <= now {
                    self.load(now);
                }
            }
            _ => return,
        }
        self.look_ahead(now);
    }

    /// Starts the calendar at what was written to TR and DR.
    fn load(&mut self, now: u64) {
        let (tr, dr) = self.written;
        self.sub_second = 0;
        match Moment::from_registers(tr, dr, self.twelve_hours()) {
            Some(moment) => self.moment = moment,
            None => self.notes.note(NO_DATE),
        }
        // INITS: the year is not 0.
        let set = field(self.written.1, 16, 8) != 0;
        self.isr = self.isr & !INITS | if set { INITS } else { 0 };
        self.synchronised_at = self.clocks_after(now, 2);
    }

    fn write_cr(&mut self, value: u32, now: u64) {
        let (before, kept) = (self.cr, value & CR_BITS & !(ADD1H | SUB1H));
        // FMT can be changed in initialisation mode only.
        let of_fmt = if self.initialises(now) { kept } else { before };
        self.cr = kept & !FMT | of_fmt & FMT;
        for (n, on) in [ALRAE, ALRAE << 1, WUTE].into_iter().enumerate() {
            if before & on != 0 && self.cr & on == 0 {
                self.writable_at[n] = self.clocks_after(now, 2);
                self.next[n] = None;
            }
        }
        if value & (ADD1H | SUB1H) != 0 {
            self.moment = if value & ADD1H != 0 {
                self.moment.plus(HOUR)
            } else {
                self.moment.hour_before()
            };
        }
        self.look_ahead(now);
        if before & WUTE == 0 && self.cr & WUTE != 0 {
            self.start_wake_up(now);
        }
    }

    fn start_wake_up(&mut self, now: u64) {
        (self.wakes_since, self.wakes) = (now, 0);
        self.next[2] = self.next_wake_up(now);
    }

    /// Writes a register that the keys protect.
    fn write_protected(&mut self, offset: u32, value: u32, now: u64) -> Result<(), NoRegister> {
        match offset {
            0x00 | 0x04 | 0x10 if !self.initialises(now) => self.notes.note(NOT_INITIALISING),
            0x00 => self.written.0 = value & 0x7f_7f7f,
            0x04 => self.written.1 = value & 0xff_ff3f,
            0x08 => self.write_cr(value, now),
            0x10 => self.prer = value & 0x7f_7fff,
            0x14 if self.status(now) & WUTWF != 0 => self.wutr = value & 0xffff,
            0x18 => self.calibr = value & 0x9f,
            0x1c | 0x20 if self.status(now) & ALRAWF << index(offset, 0x1c) != 0 => {
                self.alarms[index(offset, 0x1c)] = value;
            }
            0x44 | 0x48 if self.status(now) & ALRAWF << index(offset, 0x44) != 0 => {
                self.alarm_fractions[index(offset, 0x44)] = value & 0x0f00_7fff;
            }
            0x14 | 0x1c | 0x20 | 0x44 | 0x48 => self.notes.note(RUNNING),
            0x2c => {}
            0x3c => self.calr = value & 0xe1ff,
            // Read-only: SSR and the time stamp.
            0x28 | 0x30 | 0x34 | 0x38 => {}
            _ => return Err(NoRegister),
        }
        Ok(())
    }

    /// Reads TR, DR or SSR through the shadow registers (section 26.3.6): a read of SSR or TR freezes TR and
    /// DR until DR is read.
    fn read_calendar(&mut self, offset: u32, now: u64) -> u32 {
        let counted = self.synchronous() - 1 - self.reading(now).ticks;
        let (tr, dr) = if self.cr & BYPSHAD == 0 {
            self.shadow.take().unwrap_or_else(|| self.registers(now))
        } else {
            self.registers(now)
        };
        if offset != 0x04 {
            self.shadow = Some((tr, dr));
        }
        match offset {
            0x00 => tr,
            0x04 => dr,
            _ => counted as u32,
        }
    }
}

impl Peripheral for Rtc {
    fn read(&mut self, offset: u32, now: u64) -> Result<u32, NoRegister> {
        self.advance(now);
        Ok(match offset {
            0x00 | 0x04 | 0x28 => self.read_calendar(offset, now),
            0x08 => self.cr,
            0x0c => self.status(now),
            0x10 => self.prer,
            0x14 => self.wutr,
            0x18 => self.calibr,
            0x1c | 0x20 => self.alarms[index(offset, 0x1c)],
            // WPR and SHIFTR are write-only; no time stamp was taken.
            0x24 | 0x2c | 0x30 | 0x34 | 0x38 => 0,
            0x3c => self.calr,
            0x40 => self.tafcr,
            0x44 | 0x48 => self.alarm_fractions[index(offset, 0x44)],
            0x50..=0x9c => self.backup[index(offset, 0x50)],
            _ => return Err(NoRegister),
        })
    }

    fn holds_until(&self, offset: u32, now: u64) -> Option<u64> {
        let later = |at: u64| (at > now).then_some(at);
        match offset {
            0x00 | 0x04 | 0x28 if self.cr & BYPSHAD == 0 => None,
            0x00 | 0x04 | 0x28 if self.stands() => None,
            0x00 | 0x04 | 0x28 => Some(self.time_of_tick(self.ticks(now) + 1)),
            0x0c => {
                let waited = [self.synchronised_at, self.init_at.unwrap_or(0)];
                let waited = waited.into_iter().chain(self.writable_at).filter_map(later);
                let flags = self.soonest().map(|(at, _)| at.max(now));
                Some(waited.chain(flags).min().unwrap_or(u64::MAX))
            }
            _ => Some(u64::MAX),
        }
    }

    fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), NoRegister> {
        self.advance(now);
        if !self.backup_domain_open {
            self.notes.note(LOCKED);
            return self.read(offset, now).map(drop);
        }
        self.notes.note_bits(&UNMODELLED, offset, value);
        match offset {
            0x0c => {
                // rc_w0, and not protected by the keys (section 26.3.3).
                self.isr &= value | !FLAGS;
                if self.keys == KEYS.len() {
                    self.write_isr(value, now);
                }
            }
            0x24 => {
                let next = KEYS.get(self.keys).is_some_and(|key| *key == value & 0xff);
                self.keys = if next { self.keys + 1 } else { 0 };
            }
            0x40 => self.tafcr = value & 0x7_ff9f,
            0x50..=0x9c => self.backup[index(offset, 0x50)] = value,
            _ if self.keys < KEYS.len() => {
                self.notes.note(LOCKED);
                self.read(offset, now)?;
            }
            _ => self.write_protected(offset, value, now)?,
        }
        Ok(())
    }

    /// A system reset: the backup domain goes on (section 26.3.7).
    fn reset(&mut self, _now: u64) {
        self.shadow = None;
    }

    fn set_clocks(&mut self, clocks: &ClockTree, now: u64) {
        if clocks.rtc != self.clock {
            self.advance(now);
            if self.clock.0 != 0 {
                self.go_on(now);
            }
            (self.clock, self.since_ns) = (clocks.rtc, now);
            self.synchronised_at = self.clocks_after(now, 2);
            self.look_ahead(now);
            self.start_wake_up(now);
        }
    }

    fn next_interrupt(&self) -> Option<u64> {
        self.next_flag()
    }
}

#[cfg(test)]
mod tests {
    use super::super::peripheral::Access;
    use super::*;

    const TR: u32 = 0x00;
    const DR: u32 = 0x04;
    const CR: u32 = 0x08;
    const ISR: u32 = 0x0c;
    const PRER: u32 = 0x10;
    const WUTR: u32 = 0x14;
    const ALRMAR: u32 = 0x1c;
    const WPR: u32 = 0x24;
    const SSR: u32 = 0x28;
    const ALRMASSR: u32 = 0x44;
    const BKP0R: u32 = 0x50;
    const S: u64 = 1_000_000_000;
    /// Monday, 2 March 2026, 11:59:58.
    const DATE: u32 = 0x26_0000 | 1 << 13 | 0x0302;
    const TIME: u32 = 0x11_5958;

    /// With a crystal of 32 768 Hz, unlocked, from 0 s on.
    fn unlocked() -> Rtc {
        let mut rtc = Rtc {
            backup_domain_open: true,
            ..Rtc::new()
        };
        let clocks = ClockTree {
            rtc: (32_768, 1),
            ..ClockTree::HSI
        };
        rtc.set_clocks(&clocks, 0);
        rtc.put(0, KEYS.map(|key| (WPR, key)));
        rtc
    }

    /// Set to [`DATE`] and [`TIME`] at 1 s, by 128 and 256.
    fn set() -> Rtc {
        let mut rtc = unlocked();
        rtc.put(S / 2, [(ISR, INIT)]);
        rtc.put(
            S,
            [(PRER, 0xff), (PRER, 0x7f_00ff), (TR, TIME), (DR, DATE), (ISR, 0)],
        );
        rtc
    }

    #[test]
    fn the_calendar_counts_seconds_and_fractions_from_where_it_was_set() {
        let mut rtc = set();
        assert_eq!((rtc.get(TR, 2 * S - 1), rtc.get(DR, 2 * S - 1)), (TIME, DATE));
        // 128 of 256 ticks have passed: SSR counts down from 255.
        assert_eq!(rtc.get(SSR, S + S / 2), 127);
        rtc.get(DR, S + S / 2);
        assert_eq!((rtc.get(TR, 3 * S), rtc.get(DR, 3 * S)), (0x12_0000, DATE));
        let at = (1 + 86_402) * S;
        assert_eq!(
            (rtc.get(TR, at), rtc.get(DR, at)),
            (0x12_0000, 0x26_0000 | 2 << 13 | 0x0303)
        );
        assert_eq!(rtc.get(ISR, at) & (INITS | INITF), INITS);
    }

    #[test]
    fn a_read_of_the_time_holds_the_date_until_it_is_read() {
        let mut rtc = unlocked();
        rtc.put(0, [(ISR, INIT)]);
        rtc.put(S, [(TR, 0x23_5959), (DR, DATE), (ISR, 0)]);
        assert_eq!(rtc.get(TR, S), 0x23_5959);
        assert_eq!(rtc.get(DR, 3 * S), DATE, "of the same day as the time");
        assert_eq!(rtc.get(DR, 3 * S), 0x26_0000 | 2 << 13 | 0x0303);
    }

    #[test]
    fn flags_that_firmware_waits_for_come_two_clocks_later() {
        let mut rtc = set();
        // 2 / 32 768 Hz.
        let two = 61_036;
        rtc.put(5 * S, [(ISR, INIT)]);
        let flags = [5 * S + two - 1, 5 * S + two].map(|now| rtc.get(ISR, now) & INITF);
        assert_eq!(flags, [0, INITF]);
        rtc.put(6 * S, [(ISR, 0)]);
        let flags = [6 * S + two - 1, 6 * S + two].map(|now| rtc.get(ISR, now) & RSF);
        assert_eq!(flags, [0, RSF]);
        rtc.put(7 * S, [(ISR, INIT), (TR, 0x01_0000)]);
        assert_eq!(rtc.notes.iter().collect::<Vec<_>>(), [NOT_INITIALISING]);
    }

    #[test]
    fn without_dbp_or_keys_nothing_is_written_and_backup_registers_need_dbp_only() {
        let mut rtc = set();
        rtc.put(2 * S, [(WPR, 0xff), (WUTR, 5), (BKP0R, 7)]);
        assert_eq!((rtc.get(WUTR, 2 * S), rtc.get(BKP0R, 2 * S)), (0xffff, 7));
        rtc.put(2 * S, [(WPR, 0xca), (WPR, 0x53), (WUTR, 5)]);
        assert_eq!(rtc.get(WUTR, 2 * S), 5);
        rtc.backup_domain_open = false;
        rtc.put(2 * S, [(WUTR, 6), (BKP0R, 8)]);
        assert_eq!((rtc.get(WUTR, 2 * S), rtc.get(BKP0R, 2 * S)), (5, 7));
        assert_eq!(rtc.write(0xa0, 0, 0), Err(NoRegister));
    }

    #[test]
    fn the_wake_up_timer_comes_every_period_without_drift_and_by_seconds() {
        let mut rtc = set();
        // RTCCLK / 16 by 2049: 2049 / 2048 s.
        rtc.put(2 * S, [(WUTR, 2048), (CR, WUTE | WUTIE)]);
        let mut times = Vec::new();
        for _ in 0..3 {
            let at = rtc.next_interrupt().unwrap();
            rtc.advance(at);
            assert!(rtc.wake_up_line());
            rtc.put(at, [(ISR, !(WUTF | INIT))]);
            times.push(at - 2 * S);
        }
        assert_eq!(times, [1, 2, 3].map(|n| (n * 2049 * S).div_ceil(2048)));
        rtc.put(6 * S, [(WUTR, 1)]);
        assert_eq!(rtc.notes.iter().collect::<Vec<_>>(), [RUNNING]);
        rtc.put(6 * S, [(CR, 0)]);
        rtc.put(7 * S, [(WUTR, 2)]);
        // Three seconds of the calendar, which began at a whole one.
        rtc.put(7 * S + S / 4, [(CR, WUTE | WUTIE | 0b100)]);
        assert_eq!(rtc.next_interrupt(), Some(10 * S));
    }

    #[test]
    fn an_alarm_comes_at_its_second_or_its_fraction_of_it() {
        let mut rtc = set();
        let day = 1 << 31;
        // At 12:00:00, 2 s after it was set.
        rtc.put(S, [(ALRMAR, day | 0x12_0000), (CR, ALRAE | ALRAIE)]);
        assert_eq!(rtc.next_interrupt(), Some(3 * S));
        rtc.advance(3 * S);
        assert!(rtc.alarm_line() && !rtc.wake_up_line());
        assert_eq!(rtc.next_interrupt(), Some((3 + 86_400) * S));
        rtc.put(4 * S, [(CR, 0)]);
        // Every second, when the lower four bits of SS are 3: 255 - 12 is the first of them.
        let every = day | 1 << 23 | 1 << 15 | 1 << 7;
        rtc.put(5 * S, [(ALRMAR, every), (ALRMASSR, 4 << 24 | 3)]);
        rtc.put(5 * S, [(ISR, !(ALRAF | INIT)), (CR, ALRAE | ALRAIE)]);
        let tick = |n: u64| 5 * S + (n * S).div_ceil(256);
        for n in [12, 28, 44] {
            assert_eq!(rtc.next_interrupt(), Some(tick(n)));
            rtc.advance(tick(n));
            assert_eq!(rtc.get(SSR, tick(n)) & 0xf, 3);
        }
    }

    #[test]
    fn the_calendar_outlives_a_reset_and_not_that_of_the_backup_domain() {
        let mut rtc = set();
        rtc.reset(2 * S);
        assert_eq!(rtc.get(TR, 3 * S), 0x12_0000);
        rtc.reset_backup_domain(4 * S);
        assert_eq!((rtc.get(TR, 4 * S), rtc.get(DR, 4 * S)), (0, 0x2101));
        rtc.put(5 * S, [(WPR, 0xca)]);
        let clocks = ClockTree::HSI;
        rtc.set_clocks(&clocks, 6 * S);
        assert_eq!(rtc.get(TR, 90 * S), 0x02, "its clock has stopped");
    }
}
