//! The tables of a scenario file that describe the bench: `[front_end]`, `[clock]` and `[[analog_wire]]`.
//!
//! ```toml
//! [front_end]
//! sensors = "strong"      # or "weak", the default
//! force_span = 48.0       # N
//!
//! [clock]
//! ppm = [20.0, -35.0]     # crystal of each bead
//! sync_period = 0.1       # s
//!
//! [[analog_wire]]         # in place of a sensor
//! from = "PA4"
//! to = "PA0"
//! divider = 16.0
//! ```
//!
//! The chain simulator does not know these tables, and a command that emulates nothing ignores them.

use hertz_chain::{InputError, Scenario, TomlFile};
use serde::Deserialize;

use crate::several::Crystals;
use bead_compare::front_end::AnalogFrontEnd;
use bead_recording::clock::CRYSTAL_PPM;
use stm32f405_qemu::AnalogWire;

/// Least time between two edges at the sync input, s. The bead reports edges that are more than 10 ms apart
/// (`firmware/src/sync.rs`); the rest is for its own delay.
const SYNC_LEAST: f64 = 0.02;
/// Greatest time from the first bead's start to the last one's, s.
const START_SPREAD_MOST: f64 = 60.0;
/// Allowed paces of a bead that listens.
const PACES: std::ops::RangeInclusive<f64> = 1e-3..=1e3;
const SHIFT_MOST: u8 = 10;
const DIVIDERS: std::ops::RangeInclusive<f64> = 1.0..=1e3;
/// Noise of an input at the end of a wire, codes rms: only the converter's.
const INPUT_NOISE: f64 = 0.4;

/// The tables of the bench. Each may be missing.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BenchTables {
    /// The front end of every bead.
    pub front_end: FrontEndTable,
    /// The beads' crystals, starts and sync edges.
    pub clock: ClockTable,
    /// Wires from the part's outputs to its inputs, in place of sensors.
    pub analog_wire: Vec<AnalogWireTable>,
}

impl BenchTables {
    /// Reads the tables out of the text of a scenario file; `file` is its name in messages.
    ///
    /// # Errors
    /// [`InputError`] with file, line, key, what is wrong and what would do.
    pub fn from_toml(text: &str, file: &str) -> Result<Self, InputError> {
        let text = Self::text_in(text, file)?;
        let file = TomlFile::parse(&text, file)?;
        let tables: Self = file.read()?;
        let checked = tables.front_end.front_end().and_then(|_| tables.clock.check());
        let checked = checked.and_then(|()| tables.wires());
        checked.map_err(|error| file.locate(error))?;
        Ok(tables)
    }

    /// The text of these tables only, with each line at its number in the scenario file.
    ///
    /// # Errors
    /// The file is not TOML.
    pub fn text_in(text: &str, file: &str) -> Result<String, InputError> {
        Ok(TomlFile::parse(text, file)?.split(&Scenario::OTHER_TABLES).1)
    }

    /// The wires, none if the bead has sensors.
    ///
    /// # Errors
    /// [`InputError`] without file and line: a wire is impossible.
    pub fn wires(&self) -> Result<Vec<AnalogWire>, InputError> {
        let wires = (1..).zip(&self.analog_wire);
        wires.map(|(number, table)| table.wire(number)).collect()
    }
}

/// `[[analog_wire]]`: a wire from an output of the digital-to-analog converter to an input.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AnalogWireTable {
    /// `PA4` or `PA5`.
    pub from: String,
    /// `PA0` to `PA3`: force and acceleration at the high gain and at the low gain.
    pub to: String,
    /// Factor by which resistors in the wire divide the voltage; 1 without resistors.
    #[serde(default = "AnalogWireTable::undivided")]
    pub divider: f64,
}

impl AnalogWireTable {
    fn undivided() -> f64 {
        1.0
    }

    /// The wire. `number` is the table's number in its file, counted from 1.
    fn wire(&self, number: usize) -> Result<AnalogWire, InputError> {
        let table = format!("analog_wire[{number}]");
        let ends = [
            ("from", &self.from, ["PA4", "PA5"].as_slice()),
            ("to", &self.to, &["PA0", "PA1", "PA2", "PA3"]),
        ];
        for (key, pin, known) in ends {
            if !known.contains(&pin.as_str()) {
                let what = format!("an analog wire cannot be at {pin:?}");
                let advice = format!("give one of {}", known.join(", "));
                return Err(InputError::at(format!("{table}.{key}"), what, advice));
            }
        }
        let advice = "give a number from 1 to 1000, such as 16";
        ensure(
            DIVIDERS.contains(&self.divider),
            &table,
            "divider",
            self.divider,
            advice,
        )?;
        let mut wire = AnalogWire::new(&self.from, &self.to);
        wire.gain = 1.0 / self.divider;
        wire.noise = INPUT_NOISE;
        Ok(wire)
    }
}

/// Pairs of sensors that fit the front end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Sensors {
    /// For weak strikes: 16 N and ±250 m/s² at the high gain, 256 N and ±4000 m/s² at the low one.
    #[default]
    Weak,
    /// For strong strikes: a sixth as sensitive, six times the noise; 1536 N and ±24 km/s² at the low gain.
    Strong,
}

impl Sensors {
    /// The front end behind these sensors.
    pub fn front_end(self) -> AnalogFrontEnd {
        match self {
            Self::Weak => AnalogFrontEnd::default(),
            Self::Strong => AnalogFrontEnd::default().behind_weaker_sensors(6.0),
        }
    }
}

/// `[front_end]`: differences from the reference front end.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FrontEndTable {
    /// The pair of sensors.
    pub sensors: Sensors,
    /// Noise of the force at the high gain, N rms.
    pub force_noise: Option<f64>,
    /// Noise of the acceleration at the high gain, m/s² rms.
    pub acceleration_noise: Option<f64>,
    /// Force that the 4096 codes span at the high gain, N; a thirty-second of it is below zero.
    pub force_span: Option<f64>,
    /// Acceleration that the 4096 codes span at the high gain, m/s²; half of it is below zero.
    pub acceleration_span: Option<f64>,
    /// Force that the 4096 codes span at the low gain, N.
    pub wide_force_span: Option<f64>,
    /// Acceleration that the 4096 codes span at the low gain, m/s².
    pub wide_acceleration_span: Option<f64>,
    /// Pole of the anti-alias filters, Hz; 0 for none.
    pub pole: Option<f64>,
    /// False for sensors, conditioner and converter without noise.
    pub noise: Option<bool>,
}

impl FrontEndTable {
    /// True unless the table switches noise off.
    pub fn has_noise(&self) -> bool {
        self.noise != Some(false)
    }

    /// The front end that the table describes.
    ///
    /// # Errors
    /// [`InputError`] without file and line: a value is impossible.
    pub fn front_end(&self) -> Result<AnalogFrontEnd, InputError> {
        let mut front_end = self.sensors.front_end();
        let AnalogFrontEnd { force, acceleration } = &mut front_end;
        let spans = [
            (&mut force.sensitive, "force_span", "N, such as 16.0"),
            (&mut force.wide, "wide_force_span", "N, such as 256.0"),
            (
                &mut acceleration.sensitive,
                "acceleration_span",
                "m/s², such as 500.0",
            ),
            (
                &mut acceleration.wide,
                "wide_acceleration_span",
                "m/s², such as 8000.0",
            ),
        ];
        let forces = [self.force_span, self.wide_force_span];
        let accelerations = [self.acceleration_span, self.wide_acceleration_span];
        for ((channel, key, unit), span) in spans.into_iter().zip(forces.into_iter().chain(accelerations)) {
            let Some(span) = span else { continue };
            let holds = span.is_finite() && span > 0.0;
            ensure(
                holds,
                "front_end",
                key,
                span,
                format!("give more than 0, in {unit}"),
            )?;
            *channel = channel.with_span(span);
        }
        let noises = [
            (force, "force_noise", self.force_noise, "N rms, such as 0.005"),
            (
                acceleration,
                "acceleration_noise",
                self.acceleration_noise,
                "m/s² rms, such as 0.05",
            ),
        ];
        for (sensor, key, rms, unit) in noises {
            let Some(rms) = rms else { continue };
            let holds = rms.is_finite() && rms >= 0.0;
            ensure(holds, "front_end", key, rms, format!("give 0 or more, in {unit}"))?;
            sensor.sensitive.noise_rms = rms;
            // The sensor's own noise is in both channels.
            sensor.wide.noise_rms = sensor.wide.noise_rms.max(rms);
        }
        if let Some(hz) = self.pole {
            let holds = hz.is_finite() && hz >= 0.0;
            ensure(
                holds,
                "front_end",
                "pole",
                hz,
                "give Hz, such as 40e3, or 0 for none",
            )?;
            for channel in front_end.channels_mut() {
                channel.pole_hz = (hz > 0.0).then_some(hz);
            }
        }
        if !self.has_noise() {
            for channel in front_end.channels_mut() {
                channel.noise_rms = 0.0;
            }
        }
        Ok(front_end)
    }
}

/// `[clock]`: crystals, starts and sync edges.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ClockTable {
    /// Deviation of each crystal, ppm, negative for a slow one. A single value holds for every bead.
    pub ppm: Vec<f64>,
    /// Greatest deviation, ppm, of crystals drawn by the seed.
    pub spread: Option<f64>,
    /// Time within which each bead starts, s, drawn by the seed.
    pub start_spread: f64,
    /// Time between edges at the sync input (PA15), which all beads share, s.
    pub sync_period: Option<f64>,
    /// Seconds of the bead per second of this computer, for a bead that listens. Without it the bead's time
    /// passes as fast as it can while a program is connected.
    pub pace: Option<f64>,
    /// Least time of an instruction: 2^`shift` ns.
    pub shift: Option<u8>,
}

impl ClockTable {
    /// The crystals.
    pub fn crystals(&self) -> Crystals {
        match (self.spread, &self.ppm[..]) {
            (Some(spread), _) => Crystals::Spread(spread),
            (None, []) => Crystals::Each(vec![0.0]),
            (None, ppm) => Crystals::Each(ppm.to_vec()),
        }
    }

    fn check(&self) -> Result<(), InputError> {
        let each = self.ppm.iter().map(|ppm| ("ppm", ppm));
        for (key, ppm) in each.chain(self.spread.iter().map(|ppm| ("spread", ppm))) {
            let advice = format!("give a deviation of less than {CRYSTAL_PPM} ppm");
            ensure(ppm.abs() < CRYSTAL_PPM, "clock", key, *ppm, advice)?;
        }
        if self.spread.is_some() && !self.ppm.is_empty() {
            let advice = "leave one of them out";
            return Err(InputError::at(
                "clock.spread",
                "is given together with ppm",
                advice,
            ));
        }
        let holds = (0.0..=START_SPREAD_MOST).contains(&self.start_spread);
        let advice = format!("give seconds, at most {START_SPREAD_MOST}");
        ensure(holds, "clock", "start_spread", self.start_spread, advice)?;
        if let Some(period) = self.sync_period {
            let holds = period.is_finite() && period >= SYNC_LEAST;
            let advice = format!("give seconds, at least {SYNC_LEAST}");
            ensure(holds, "clock", "sync_period", period, advice)?;
        }
        if let Some(pace) = self.pace {
            let advice = "give a number from 0.001 to 1000; 1 is real time".to_owned();
            ensure(PACES.contains(&pace), "clock", "pace", pace, advice)?;
        }
        if let Some(shift) = self.shift {
            let advice = format!("give 0 to {SHIFT_MOST}; an instruction takes 2^shift ns or more");
            ensure(shift <= SHIFT_MOST, "clock", "shift", shift.into(), advice)?;
        }
        Ok(())
    }
}

fn ensure(
    holds: bool,
    table: &str,
    key: &str,
    value: f64,
    advice: impl Into<String>,
) -> Result<(), InputError> {
    let what = format!("{value} is out of range");
    let refused = || InputError::at(format!("{table}.{key}"), what, advice);
    holds.then_some(()).ok_or_else(refused)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(tables: &str) -> Result<BenchTables, String> {
        let text = Scenario::paper().to_toml() + "\n" + tables;
        assert_eq!(Scenario::from_toml(&text, "s.toml"), Ok(Scenario::paper()));
        BenchTables::from_toml(&text, "s.toml").map_err(|error| error.to_string())
    }

    #[test]
    fn tables_of_the_bench_stand_beside_those_of_the_chain() {
        assert_eq!(read("").unwrap(), BenchTables::default());
        let read = read(
            "[front_end]\nsensors = \"strong\"\npole = 0\n# why\n[clock]\nppm = [4.0]\nstart_spread = 0.01\n",
        );
        let tables = read.unwrap();
        assert_eq!(tables.clock.crystals(), Crystals::Each(vec![4.0]));
        assert_eq!(tables.clock.start_spread, 0.01);
        let front_end = tables.front_end.front_end().unwrap();
        assert!(front_end.force.wide.pole_hz.is_none());
        assert!(front_end.force.wide.range().1 > 1400.0);
        assert!(front_end.force.wide.noise_rms > 0.0);
    }

    #[test]
    fn a_bench_has_wires_and_no_noise_if_its_tables_say_so() {
        let tables =
            read("[front_end]\nnoise = false\n[[analog_wire]]\nfrom = 'PA4'\nto = 'PA1'\ndivider = 16");
        let tables = tables.unwrap();
        assert_eq!(tables.wires().unwrap()[0].gain, 1.0 / 16.0);
        let mut front_end = tables.front_end.front_end().unwrap();
        let mut channels = front_end.channels_mut().into_iter();
        assert!(channels.all(|channel| channel.noise_rms == 0.0));
    }

    #[test]
    fn a_value_that_no_bench_has_is_refused_with_line_and_key() {
        let lines = Scenario::paper().to_toml().lines().count();
        const REFUSED: &str = "\
[front_end] force_span = 0.0 | 0 is out of range; give more than 0, in N, such as 16.0
[front_end] wide_acceleration_span = 0.0 | 0 is out of range; give more than 0, in m/s², such as 8000.0
[front_end] pole = inf | inf is out of range
[front_end] force_noise = -1.0 | -1 is out of range
[front_end] sensors = 'loud' | `loud` is not known; known are `weak` or `strong`
[front_end] spam = 1.0 | unknown key
[clock] ppm = [5000.0] | give a deviation of less than 1000 ppm
[clock] sync_period = 0.0 | give seconds, at least 0.02
[clock] shift = 11 | 11 is out of range; give 0 to 10
[clock] start_spread = 61.0 | at most 60";
        for line in REFUSED.lines() {
            let (table, why) = line.split_once(" | ").unwrap();
            let key = table.replace(['[', ']'], "").replacen(' ', ".", 1);
            let place = format!("s.toml:{}: {}: ", lines + 3, key.split(' ').next().unwrap());
            let refused = read(&table.replacen(' ', "\n", 1)).unwrap_err();
            assert!(refused.starts_with(&place) && refused.contains(why), "{refused}");
        }
        const WIRES: &str = "\
from = 'PA0', to = 'PA0' | from: an analog wire cannot be at \"PA0\"; give one of PA4, PA5
from = 'PA4', to = 'PA4' | to: an analog wire cannot be at \"PA4\"; give one of PA0, PA1
from = 'PA4', to = 'PA0', divider = 0 | divider: 0 is out of range; give a number from 1";
        // Each of the three is about the key in its own line.
        for (key, line) in WIRES.lines().enumerate() {
            let (wire, why) = line.split_once(" | ").unwrap();
            let refused = read(&format!("[[analog_wire]]\n{}", wire.replace(", ", "\n"))).unwrap_err();
            let place = format!("s.toml:{}: analog_wire[1].", lines + 3 + key);
            assert!(refused.starts_with(&format!("{place}{why}")), "{refused}");
        }
        let both = read("[clock]\nppm = [1.0]\nspread = 100.0").unwrap_err();
        assert!(
            both.contains("clock.spread: is given together with ppm"),
            "{both}"
        );
    }
}
