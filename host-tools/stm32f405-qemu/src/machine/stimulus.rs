//! The analog inputs: codes over time.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use super::wiring::{self, PinIndex};
use crate::given::{AnalogInput, Run, Since};
use crate::outcome::Sampling;

/// Codes at the pins of channels 0 to 3. A new row begins every period, counted from the first externally
/// triggered scan or from power-up.
#[derive(Debug, Clone)]
pub struct StimulusPlayer {
    rows: VecDeque<[u16; 4]>,
    /// Number of the first row in `rows`. Earlier rows have passed.
    passed: usize,
    period_ns: u64,
    since: Since,
    /// Actual and nominal frequency of the crystal, Hz. The actual one times the periods.
    hz: u64,
    nominal_hz: u64,
    sampling: Option<Sampling>,
    /// The row that the scan of each converter reads.
    row: [[u16; 4]; 3],
    pins: BTreeMap<PinIndex, AnalogInput>,
    /// Channels that were converted and have no input, each with its converter.
    unmapped: BTreeSet<(usize, u32)>,
}

impl StimulusPlayer {
    /// The analog inputs of a run, timed by a crystal of `hse_hz`: a row lasts one period by that clock. An
    /// input at PA0 to PA3 takes the place of that pin's codes. Without rows, all codes are 0.
    pub(super) fn new(run: &Run, hse_hz: u32) -> Self {
        let by_pin = |input: &AnalogInput| (wiring::known_pin(&input.pin), input.clone());
        Self {
            row: [run.stimulus.first().copied().unwrap_or_default(); 3],
            rows: run.stimulus.clone().into(),
            passed: 0,
            period_ns: run.sample_period_ns,
            since: run.stimulus_since,
            hz: hse_hz.into(),
            nominal_hz: run.hse_hz.into(),
            sampling: None,
            pins: run.analog_inputs.iter().map(by_pin).collect(),
            unmapped: BTreeSet::new(),
        }
    }

    /// A scan of a converter starts: `external` by a trigger, else by software. All its conversions read one
    /// row.
    pub(super) fn begin_scan(&mut self, adc: usize, now: u64, external: bool) {
        if external {
            let (first_ns, scans) = self
                .sampling
                .map_or((now, 0), |so_far| (so_far.first_ns, so_far.scans));
            let scans = scans + 1;
            self.sampling = Some(Sampling { first_ns, scans });
        }
        let Some(began) = self.began() else { return };
        let row = self.row_at(began, now).saturating_sub(self.passed);
        let row = self.rows.get(row).or(self.rows.back());
        self.row[adc] = row.copied().unwrap_or_default();
    }

    /// Number of the row that applies at `now`, counted from the first row of all.
    fn row_at(&self, began: u64, now: u64) -> usize {
        // Times are whole ns, so a scan may seem to come up to 1 ns before its row. A change of the clock may
        // move the end of a conversion under way into the past.
        let passed = u128::from(now.saturating_sub(began)) + 1;
        let own_ns = passed * u128::from(self.hz) / u128::from(self.nominal_hz);
        usize::try_from(own_ns / u128::from(self.period_ns)).unwrap_or(usize::MAX)
    }

    /// Appends rows, and forgets rows that have passed.
    pub fn append(&mut self, rows: impl IntoIterator<Item = [u16; 4]>, now: u64) {
        let was_empty = self.rows.is_empty() && self.passed == 0;
        self.rows.extend(rows);
        if was_empty {
            self.row = [self.rows.front().copied().unwrap_or_default(); 3];
        }
        if let Some(began) = self.began() {
            // The last row stays.
            let old = self.row_at(began, now).saturating_sub(self.passed);
            let old = old.min(self.rows.len().saturating_sub(1));
            self.rows.drain(..old);
            self.passed += old;
        }
    }

    /// Number of rows in memory.
    pub fn held(&self) -> usize {
        self.rows.len()
    }

    /// Returns the code that a converter reads at a channel if the conversion ends now.
    pub(super) fn code(&mut self, adc: usize, channel: u32, now: u64) -> u16 {
        let first_scan = self.sampling.map(|sampling| sampling.first_ns);
        match self.input(adc, channel) {
            Some(input) => input.code(now, first_scan),
            // Channels 0 to 3 of all three converters are PA0 to PA3.
            None if channel < 4 => self.row[adc][channel as usize],
            None => {
                self.unmapped.insert((adc, channel));
                0
            }
        }
    }

    fn input(&self, adc: usize, channel: u32) -> Option<&AnalogInput> {
        // The common case, once for every sample.
        if self.pins.is_empty() {
            return None;
        }
        self.pins.get(&wiring::analog_pin(adc, channel)?)
    }

    /// The externally triggered scans so far.
    pub fn sampling(&self) -> Option<Sampling> {
        self.sampling
    }

    /// When row 0 began.
    fn began(&self) -> Option<u64> {
        self.since
            .plus(0, self.sampling.map(|sampling| sampling.first_ns))
    }

    /// Returns `true` if there is more than one row, and none has been played.
    pub(super) fn never_began(&self) -> bool {
        self.passed + self.rows.len() > 1 && self.began().is_none()
    }

    /// When the last row ends.
    pub fn ends_at(&self) -> Option<u64> {
        let own_ns = (self.passed + self.rows.len()) as u128 * u128::from(self.period_ns);
        let length = own_ns * u128::from(self.nominal_hz) / u128::from(self.hz);
        let length = u64::try_from(length).unwrap_or(u64::MAX);
        Some(self.began()?.saturating_add(length))
    }

    pub(super) fn unmapped(&self) -> impl Iterator<Item = (usize, u32)> + '_ {
        self.unmapped.iter().copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn player(rows: Vec<[u16; 4]>, since: Since) -> StimulusPlayer {
        let mut run = Run::new("");
        (run.stimulus, run.stimulus_since) = (rows, since);
        StimulusPlayer::new(&run, 8_000_000)
    }

    fn three_rows() -> StimulusPlayer {
        let rows = vec![[10, 11, 12, 13], [20, 21, 22, 23], [30, 31, 32, 33]];
        player(rows, Since::FirstScan)
    }

    #[test]
    fn rows_follow_time_from_the_first_triggered_scan_and_the_last_stays() {
        let mut stimulus = three_rows();
        let codes = [777, 10_777, 20_777, 30_777].map(|now| {
            stimulus.begin_scan(0, now, true);
            stimulus.code(0, 0, 0)
        });
        assert_eq!(codes, [10, 20, 30, 30]);
        let sampling = stimulus.sampling().unwrap();
        assert_eq!((sampling.first_ns, sampling.scans), (777, 4));
        assert_eq!(stimulus.ends_at(), Some(30_777));
    }

    #[test]
    fn rows_that_follow_are_read_at_their_time_and_those_that_have_passed_are_forgotten() {
        let mut stimulus = player(Vec::new(), Since::FirstScan);
        stimulus.append((0..10).map(|n| [n, 0, 0, 0]), 0);
        for scan in 0..100_000u64 {
            let now = 777 + 10_000 * scan;
            stimulus.begin_scan(0, now, true);
            assert_eq!(u64::from(stimulus.code(0, 0, now)), scan % 4096);
            if scan % 10 == 5 {
                let next = stimulus.passed + stimulus.rows.len();
                stimulus.append((next..next + 10).map(|n| [(n % 4096) as u16, 0, 0, 0]), now);
                assert_eq!(stimulus.ends_at(), Some(777 + 10_000 * (next as u64 + 10)));
            }
            assert!(stimulus.held() <= 20, "{}", stimulus.held());
        }
    }

    #[test]
    fn a_scan_that_was_never_made_skips_its_row_and_one_from_before_the_first_reads_row_0() {
        let mut stimulus = three_rows();
        stimulus.begin_scan(0, 0, true);
        stimulus.begin_scan(0, 20_000, true);
        let codes = [0, 1, 2, 3].map(|channel| stimulus.code(0, channel, 0));
        assert_eq!(codes, [30, 31, 32, 33]);
        let mut stimulus = three_rows();
        stimulus.begin_scan(0, 50_000, true);
        stimulus.begin_scan(1, 20_000, false);
        assert_eq!(stimulus.code(1, 0, 0), 10);
    }

    #[test]
    fn rows_from_power_up_on_are_played_for_software_scans_too() {
        let rows = (0..4).map(|n| [n, 0, 0, 0]).collect();
        let mut stimulus = player(rows, Since::PowerUp);
        let read = [0, 15_000, 25_000].map(|at| {
            stimulus.begin_scan(0, at, false);
            stimulus.code(0, 0, 0)
        });
        assert_eq!((read, stimulus.ends_at()), ([0, 1, 2], Some(40_000)));
    }
}
