//! Dates and times of the RTC: BCD registers against seconds since 2000-01-01.

use super::super::register::{bit, field};

pub(super) const DAY: u64 = 86_400;
/// Days of the 100 years that the calendar has; every fourth is a leap year (section 26.3.6).
const DAYS: u64 = 100 * 365 + 25;
const PM: u32 = 1 << 22;

/// A date and time of day, in seconds since 2000-01-01 00:00:00, and the day of the week, 1 to 7, which
/// firmware sets separately.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Moment {
    pub(super) seconds: u64,
    pub(super) weekday: u32,
}

/// Year (0 to 99), month and day (from 1).
fn date(days: u64) -> (u32, u32, u32) {
    let (mut left, mut year) = (days % DAYS, 0);
    while left >= days_of_year(year) {
        left -= days_of_year(year);
        year += 1;
    }
    let mut month = 1;
    while left >= days_of_month(year, month) {
        left -= days_of_month(year, month);
        month += 1;
    }
    (year, month, left as u32 + 1)
}

fn days_of_year(year: u32) -> u64 {
    if year.is_multiple_of(4) { 366 } else { 365 }
}

fn days_of_month(year: u32, month: u32) -> u64 {
    match month {
        2 if year.is_multiple_of(4) => 29,
        2 => 28,
        4 | 6 | 9 | 11 => 30,
        _ => 31,
    }
}

fn bcd(number: u32) -> u32 {
    ((number / 10) << 4) | (number % 10)
}

fn number(bcd: u32) -> u32 {
    (bcd >> 4) * 10 + (bcd & 0xf)
}

/// The hour in TR or in the register of an alarm.
fn hour_of(register: u32, twelve_hours: bool) -> u32 {
    let hour = number(field(register, 16, 6));
    if twelve_hours {
        hour % 12 + 12 * u32::from(register & PM != 0)
    } else {
        hour
    }
}

impl Moment {
    /// Contents of TR and DR after a reset: Monday, 1 January 2000, 00:00:00.
    pub(super) const RESET: Self = Self {
        seconds: 0,
        weekday: 1,
    };

    /// The moment that TR and DR give. `None` if there is no such date or time.
    pub(super) fn from_registers(tr: u32, dr: u32, twelve_hours: bool) -> Option<Self> {
        let hour = hour_of(tr, twelve_hours);
        let [minute, second] = [(8, 7), (0, 7)].map(|(low, width)| number(field(tr, low, width)));
        let dates = [(16, 8), (8, 5), (0, 6)];
        let [year, month, day] = dates.map(|(low, width)| number(field(dr, low, width)));
        let exists = hour < 24
            && minute < 60
            && second < 60
            && year < 100
            && (1..=12).contains(&month)
            && day > 0
            && u64::from(day) <= days_of_month(year, month);
        let days = (0..year).map(days_of_year).sum::<u64>()
            + (1..month).map(|month| days_of_month(year, month)).sum::<u64>()
            + u64::from(day.max(1) - 1);
        exists.then(|| Self {
            seconds: days * DAY + u64::from(hour * 3600 + minute * 60 + second),
            weekday: field(dr, 13, 3).max(1),
        })
    }

    /// TR and DR.
    pub(super) fn registers(&self, twelve_hours: bool) -> (u32, u32) {
        let of_day = (self.seconds % DAY) as u32;
        let hour = of_day / 3600;
        let hours = match (twelve_hours, hour % 12) {
            (false, _) => bcd(hour) << 16,
            (true, 0) => (bcd(12) << 16) | (u32::from(hour == 12) * PM),
            (true, of_half) => (bcd(of_half) << 16) | (u32::from(hour > 12) * PM),
        };
        let (year, month, day) = date(self.seconds / DAY);
        let tr = hours | bcd(of_day / 60 % 60) << 8 | bcd(of_day % 60);
        let dr = bcd(year) << 16 | self.weekday << 13 | bcd(month) << 8 | bcd(day);
        (tr, dr)
    }

    /// The moment `seconds` seconds later.
    pub(super) fn plus(&self, seconds: u64) -> Self {
        let later = self.seconds + seconds;
        let days = later / DAY - self.seconds / DAY;
        self.on(later % (DAYS * DAY), days)
    }

    /// The moment an hour before.
    pub(super) fn hour_before(&self) -> Self {
        let hour = 3600;
        match self.seconds.checked_sub(hour) {
            // A day back is six weekdays forward.
            Some(before) => self.on(before, (self.seconds / DAY - before / DAY) * 6),
            None => self.on(self.seconds + DAYS * DAY - hour, 6),
        }
    }

    fn on(&self, seconds: u64, weekdays: u64) -> Self {
        let weekday = (u64::from(self.weekday) - 1 + weekdays) % 7 + 1;
        Self {
            seconds,
            weekday: weekday as u32,
        }
    }

    /// Returns `true` if an alarm's register fits this second.
    pub(super) fn fits(&self, alarm: u32, twelve_hours: bool) -> bool {
        let of_day = self.seconds % DAY;
        day_fits(self, alarm) && next_in_day(of_day, alarm, twelve_hours) == Some(of_day)
    }

    /// Seconds to the next second at which an alarm's register fits, 1 at least. `None` if none does.
    pub(super) fn seconds_to_alarm(&self, alarm: u32, twelve_hours: bool) -> Option<u64> {
        let of_day = self.seconds % DAY;
        // Any day of a month comes within 62 days.
        (0..=62).find_map(|day| {
            let midnight = (day * DAY).checked_sub(of_day);
            let that_day = self.plus(day * DAY);
            if !day_fits(&that_day, alarm) {
                return None;
            }
            let from = if day == 0 { of_day + 1 } else { 0 };
            let second = next_in_day(from, alarm, twelve_hours)?;
            Some(midnight.map_or_else(|| second - of_day, |midnight| midnight + second))
        })
    }
}

/// MSK4, WDSEL, DT and DU.
fn day_fits(moment: &Moment, alarm: u32) -> bool {
    if bit(alarm, 31) {
        return true;
    }
    if bit(alarm, 30) {
        return moment.weekday == field(alarm, 24, 4);
    }
    bcd(date(moment.seconds / DAY).2) == field(alarm, 24, 6)
}

/// The first second of a day, not before `from`, that fits the unmasked ones of hour, minute and second.
fn next_in_day(from: u64, alarm: u32, twelve_hours: bool) -> Option<u64> {
    let hour = (!bit(alarm, 23)).then(|| hour_of(alarm, twelve_hours));
    let wanted = |at, mask| (!bit(alarm, mask)).then(|| number(field(alarm, at, 7)));
    let (minute, second) = (wanted(8, 15), wanted(0, 7));
    let range = |wanted: Option<u32>, end: u32| match wanted {
        Some(wanted) if wanted >= end => 0..0,
        Some(wanted) => wanted..wanted + 1,
        None => 0..end,
    };
    for hour in range(hour, 24).filter(|hour| u64::from(hour + 1) * 3600 > from) {
        for minute in range(minute, 60) {
            let start = u64::from(hour * 3600 + minute * 60);
            if start + 60 <= from {
                continue;
            }
            let mut seconds = range(second, 60).map(|second| start + u64::from(second));
            if let Some(found) = seconds.find(|second| *second >= from) {
                return Some(found);
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Thursday, 29 February 2024, 23:59:58.
    const LEAP: (u32, u32) = (0x23_5958, 0x24_0000 | 4 << 13 | 0x0229);

    #[test]
    fn a_date_goes_through_registers_and_back_and_over_the_ends_of_months_and_years() {
        let moment = Moment::from_registers(LEAP.0, LEAP.1, false).unwrap();
        assert_eq!(moment.registers(false), LEAP);
        // 1709251198 is 2024-02-29T23:59:58Z, 946684800 is 2000-01-01T00:00:00Z (date -u).
        assert_eq!(moment.seconds, 1_709_251_198 - 946_684_800);
        let next = moment.plus(2).registers(false);
        assert_eq!(next, (0, 0x24_0000 | 5 << 13 | 0x0301));
        let last = Moment::from_registers(0x23_5959, 0x99_0000 | 4 << 13 | 0x1231, false).unwrap();
        assert_eq!(
            last.plus(1).registers(false),
            (0, 5 << 13 | 0x0101),
            "2099 to 2000"
        );
        assert_eq!(
            last.plus(1).hour_before(),
            last.plus(1).plus(7 * DAYS * DAY - 3600)
        );
        for (tr, dr) in [
            (0x24_0000, LEAP.1),
            (0, 0x23_0000 | 0x0229),
            (0, 0x1301),
            (0, 0x0100),
        ] {
            assert_eq!(Moment::from_registers(tr, dr, false), None, "{tr:x} {dr:x}");
        }
    }

    #[test]
    fn twelve_hours_have_noon_and_midnight_as_12() {
        let registers = [0, 1, 12, 13].map(|hour| {
            let moment = Moment::RESET.plus(hour * 3600);
            let (tr, dr) = moment.registers(true);
            assert_eq!(Moment::from_registers(tr, dr, true), Some(moment));
            tr
        });
        assert_eq!(registers, [0x12_0000, 0x01_0000, 0x52_0000, 0x41_0000]);
    }

    #[test]
    fn an_alarm_waits_for_the_parts_that_are_not_masked() {
        let at = |alarm| {
            let now = Moment::from_registers(LEAP.0, LEAP.1, false).unwrap();
            now.seconds_to_alarm(alarm, false)
        };
        let (day, hour, minute, second) = (1 << 31, 1 << 23, 1 << 15, 1 << 7);
        assert_eq!(at(day | hour | minute | second), Some(1), "every second");
        assert_eq!(at(day | hour | minute | 0x58), Some(60));
        assert_eq!(at(day | hour | 0x0003), Some(2 + 3));
        assert_eq!(at(day | 0x23_5959), Some(1));
        assert_eq!(at(day | 0x23_5958), Some(DAY), "not at once");
        assert_eq!(at(0x3000_0000), Some(2 + 29 * DAY), "30 March");
        assert_eq!(at(1 << 30 | 2 << 24), Some(2 + 4 * DAY), "Tuesday, 5 March");
        assert_eq!(at(day | 0x24_0000), None);
    }
}
