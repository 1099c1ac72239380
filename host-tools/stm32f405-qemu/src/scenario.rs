//! A scenario file, in TOML: the inputs of the part from outside.
//!
//! # Design
//!
//! All times count from power-up. A value that the part cannot have is refused with its file, line and column
//! before anything runs. Paths are relative to the file's folder.

mod time;
mod waves;

use std::fmt;
use std::ops::{Range, RangeInclusive};
use std::path::{Path, PathBuf};

use serde::Deserialize;
use toml::Spanned;

use crate::given::{AnalogInput, AnalogWire, Fault, FaultKind, PinInput, Run, Since, UartInput};
use crate::machine::{USARTS, pin};
use crate::outcome::Outcome;
use time::Time;
use waves::{Unit, Wave};

/// Most codes of a waveform, including the time before it.
const MOST_CODES: u64 = 100_000_000;

/// A scenario: inputs of a run.
#[derive(Debug)]
pub struct Scenario {
    file: File,
    analog: Vec<AnalogInput>,
    ends: Vec<WaveEnd>,
    paths: Vec<PathBuf>,
}

/// End of a waveform, unless the file says that its last value stays.
#[derive(Debug)]
struct WaveEnd {
    pin: String,
    ends_ns: u64,
}

/// A mistake in a scenario: its place and description.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ScenarioError(String);

impl fmt::Display for ScenarioError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for ScenarioError {}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    clock: Clock,
    #[serde(default)]
    pin: Vec<Pin>,
    #[serde(default)]
    button: Vec<Button>,
    #[serde(default)]
    uart: Vec<Uart>,
    #[serde(default)]
    waveform: Vec<Waveform>,
    #[serde(default)]
    wire: Vec<Wire>,
    #[serde(default)]
    analog_wire: Vec<Wire>,
    #[serde(default)]
    supply: Vec<Supply>,
    #[serde(default)]
    fault: Vec<FaultEntry>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Clock {
    crystal_hz: Option<Spanned<u32>>,
    crystal_ppm: Option<Spanned<f64>>,
    lsi_hz: Option<Spanned<u32>>,
}

/// A level that goes up, down, up at these times.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Pin {
    pin: Spanned<String>,
    changes: Spanned<Vec<Time>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Button {
    pin: Spanned<String>,
    pressed: Spanned<Vec<Time>>,
    #[serde(rename = "for")]
    lasts: Spanned<Time>,
    /// Level of the pin while the button is pressed.
    #[serde(default)]
    level: Pressed,
}

#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Pressed {
    High,
    #[default]
    Low,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Uart {
    port: Spanned<String>,
    at: Time,
    text: Option<String>,
    bytes: Option<Vec<u8>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Waveform {
    pin: Spanned<String>,
    file: Spanned<PathBuf>,
    column: Option<Spanned<String>>,
    channel: Option<Spanned<u16>>,
    period: Option<Spanned<Time>>,
    #[serde(default)]
    at: Time,
    #[serde(default)]
    unit: Unit,
    /// The code or voltage is `offset` + `gain` times the value.
    #[serde(default = "one")]
    gain: f64,
    #[serde(default)]
    offset: f64,
    /// True if the last value stays, so that the end of the waveform is not reported.
    #[serde(default)]
    stays: bool,
}

fn one() -> f64 {
    1.0
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Wire {
    from: Spanned<String>,
    to: Spanned<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Supply {
    at: Time,
    volts: Spanned<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct FaultEntry {
    at: Time,
    kind: Spanned<String>,
    #[serde(rename = "for")]
    lasts: Option<Time>,
}

/// The text of a file, to give the place of a mistake.
struct Source<'a> {
    path: &'a Path,
    text: &'a str,
}

impl Source<'_> {
    fn error(&self, at: Range<usize>, what: impl fmt::Display) -> ScenarioError {
        let before = &self.text[..at.start.min(self.text.len())];
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().map_or(0, |rest| rest.chars().count()) + 1;
        ScenarioError(format!("{}:{line}:{column}: {what}", self.path.display()))
    }

    fn check_pin(&self, name: &Spanned<String>) -> Result<(), ScenarioError> {
        let unknown = || {
            let what = format!("there is no pin {:?}; pins are PA0 to PI15", name.get_ref());
            self.error(name.span(), what)
        };
        pin(name.get_ref()).map(drop).ok_or_else(unknown)
    }

    fn check_port(&self, port: &Spanned<String>) -> Result<(), ScenarioError> {
        if USARTS.contains(&port.get_ref().as_str()) {
            return Ok(());
        }
        let all = USARTS.join(", ");
        let what = format!("there is no USART {:?}; give one of {all}", port.get_ref());
        Err(self.error(port.span(), what))
    }

    fn check_range<T: PartialOrd>(
        &self,
        value: &Option<Spanned<T>>,
        range: RangeInclusive<T>,
        what: &str,
    ) -> Result<(), ScenarioError> {
        let odd = value.as_ref().filter(|value| !range.contains(value.get_ref()));
        odd.map_or(Ok(()), |odd| Err(self.error(odd.span(), what)))
    }

    fn check_order(&self, times: &Spanned<Vec<Time>>) -> Result<(), ScenarioError> {
        if times.get_ref().windows(2).all(|pair| pair[0].0 < pair[1].0) {
            return Ok(());
        }
        Err(self.error(times.span(), "the times are not in ascending order"))
    }
}

impl Scenario {
    /// Reads a scenario file, and the waveforms that it names.
    ///
    /// # Errors
    /// One line: the place and description of a mistake.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, ScenarioError> {
        let path = path.as_ref();
        let text = std::fs::read_to_string(path)
            .map_err(|error| ScenarioError(format!("cannot read {}: {error}", path.display())))?;
        let source = Source { path, text: &text };
        let file: File = toml::from_str(&text).map_err(|error| {
            // The rest of a message is an excerpt.
            let what = error.message().replace('\n', "; ");
            source.error(error.span().unwrap_or_default(), what)
        })?;
        file.check(&source)?;
        let mut scenario = Self {
            analog: Vec::new(),
            ends: Vec::new(),
            paths: vec![path.to_owned()],
            file,
        };
        scenario.read_waves(&source)?;
        Ok(scenario)
    }

    fn read_waves(&mut self, source: &Source<'_>) -> Result<(), ScenarioError> {
        let folder = source.path.parent().unwrap_or(Path::new(""));
        for entry in &self.file.waveform {
            let name = entry.pin.get_ref();
            let refused = |what: String| source.error(entry.file.span(), what);
            let path = folder.join(entry.file.get_ref());
            let wave = Wave::read(
                &path,
                entry.column.as_ref().map(|column| column.get_ref().as_str()),
                entry.channel.as_ref().map(|channel| *channel.get_ref()),
            )
            .map_err(refused)?;
            self.paths.push(path);
            let given = entry.period.as_ref().map(|period| period.get_ref().0);
            let period_ns = given.or(wave.period_ns).filter(|period| *period > 0);
            let period_ns = period_ns.ok_or_else(|| {
                refused("its values have no times: give a period, for example \"10us\"".into())
            })?;
            let codes = wave
                .codes(entry.unit, entry.gain, entry.offset)
                .map_err(refused)?;
            let before = entry.at.0 / period_ns;
            if before + codes.len() as u64 > MOST_CODES {
                return Err(refused(format!(
                    "the waveform has more than {MOST_CODES} values, with the time before it"
                )));
            }
            let first = codes.first().copied().unwrap_or(0);
            let mut all = vec![first; before as usize];
            all.extend(codes);
            if !entry.stays {
                self.ends.push(WaveEnd {
                    pin: name.clone(),
                    ends_ns: period_ns * all.len() as u64,
                });
            }
            self.analog.push(AnalogInput {
                pin: name.clone(),
                since: Since::PowerUp,
                period_ns,
                codes: all,
            });
        }
        Ok(())
    }

    /// The files read: the scenario's own, and those of its waveforms.
    pub fn paths(&self) -> &[PathBuf] {
        &self.paths
    }

    /// Returns `true` if the scenario specifies the part's crystal.
    pub fn names_crystal(&self) -> bool {
        self.file.clock.crystal_hz.is_some()
    }

    /// Adds these inputs to a run.
    pub fn apply(&self, run: &mut Run) {
        let file = &self.file;
        let clock = &file.clock;
        run.hse_hz = clock.crystal_hz.as_ref().map_or(run.hse_hz, |hz| *hz.get_ref());
        run.hse_ppm = clock
            .crystal_ppm
            .as_ref()
            .map_or(run.hse_ppm, |ppm| *ppm.get_ref());
        run.lsi_hz = clock.lsi_hz.as_ref().map(|hz| *hz.get_ref()).or(run.lsi_hz);
        run.pin_inputs.extend(file.pin.iter().map(Pin::input));
        run.pin_inputs.extend(file.button.iter().map(Button::input));
        run.uart_input.extend(file.uart.iter().map(Uart::input));
        run.analog_inputs.extend(self.analog.iter().cloned());
        let ends = |wire: &Wire| (wire.from.get_ref().clone(), wire.to.get_ref().clone());
        run.wires.extend(file.wire.iter().map(ends));
        let analog = file.analog_wire.iter().map(ends);
        run.analog_wires
            .extend(analog.map(|(from, to)| AnalogWire::new(from, to)));
        let supplies = file.supply.iter().map(|supply| {
            let millivolts = (supply.volts.get_ref() * 1000.0).round() as u32;
            Fault::after_power_up(supply.at.0, FaultKind::Supply { millivolts })
        });
        run.faults.extend(supplies);
        let faults = file
            .fault
            .iter()
            .filter_map(|fault| Some((fault.at.0, fault.kind()?)));
        run.faults
            .extend(faults.map(|(at_ns, kind)| Fault::after_power_up(at_ns, kind)));
    }

    /// Waveforms that ended before the run did: a line for each.
    pub fn ended_early(&self, outcome: &Outcome) -> Vec<String> {
        let early = self.ends.iter().filter(|wave| wave.ends_ns < outcome.virtual_ns);
        let line = |wave: &WaveEnd| {
            format!(
                "the waveform at {} ended at {:.6} s of {:.6}: its last value stayed",
                wave.pin,
                wave.ends_ns as f64 * 1e-9,
                outcome.virtual_ns as f64 * 1e-9
            )
        };
        early.map(line).collect()
    }
}

impl Clock {
    fn check(&self, source: &Source<'_>) -> Result<(), ScenarioError> {
        // DocID022152, HSE and LSI characteristics.
        source.check_range(
            &self.crystal_hz,
            4_000_000..=26_000_000,
            "the crystal must have 4 to 26 MHz",
        )?;
        let what = "the crystal must be off by less than 1000 ppm";
        source.check_range(&self.crystal_ppm, -999.0..=999.0, what)?;
        source.check_range(&self.lsi_hz, 17_000..=47_000, "LSI must have 17 to 47 kHz")
    }
}

impl File {
    fn check(&self, source: &Source<'_>) -> Result<(), ScenarioError> {
        self.clock.check(source)?;
        self.check_events(source)?;
        self.check_wires(source)
    }

    fn check_events(&self, source: &Source<'_>) -> Result<(), ScenarioError> {
        for pin in &self.pin {
            source.check_pin(&pin.pin)?;
            source.check_order(&pin.changes)?;
        }
        for button in &self.button {
            source.check_pin(&button.pin)?;
            source.check_order(&button.pressed)?;
            let lasts = button.lasts.get_ref().0;
            let overlap = |pair: &[Time]| pair[1].0 - pair[0].0 <= lasts;
            if lasts == 0 {
                let what = "the button must be pressed for a time above 0";
                return Err(source.error(button.lasts.span(), what));
            }
            if button.pressed.get_ref().windows(2).any(overlap) {
                let what = "the button is not released before it is pressed again";
                return Err(source.error(button.lasts.span(), what));
            }
        }
        for uart in &self.uart {
            source.check_port(&uart.port)?;
            if uart.text.is_some() == uart.bytes.is_some() {
                let what = "give either text or bytes";
                return Err(source.error(uart.port.span(), what));
            }
        }
        for wave in &self.waveform {
            source.check_pin(&wave.pin)?;
        }
        for supply in &self.supply {
            if !(0.0..=3.6).contains(supply.volts.get_ref()) {
                return Err(source.error(supply.volts.span(), "the supply must be 0 to 3.6 V"));
            }
        }
        for fault in &self.fault {
            if fault.kind().is_none() {
                let what = format!(
                    "there is no fault {:?}; give one of {}, or transmitter_stalled with a time in for",
                    fault.kind.get_ref(),
                    FAULTS.map(|(name, _)| name).join(", ")
                );
                return Err(source.error(fault.kind.span(), what));
            }
        }
        Ok(())
    }

    fn check_wires(&self, source: &Source<'_>) -> Result<(), ScenarioError> {
        for wire in self.wire.iter().chain(&self.analog_wire) {
            source.check_pin(&wire.from)?;
            source.check_pin(&wire.to)?;
        }
        for wire in &self.analog_wire {
            if !["PA4", "PA5"].contains(&wire.from.get_ref().as_str()) {
                let what = "an analog wire must begin at an output of the DAC, PA4 or PA5";
                return Err(source.error(wire.from.span(), what));
            }
        }
        Ok(())
    }
}

impl Pin {
    fn input(&self) -> PinInput {
        let changes_ns: Vec<_> = self.changes.get_ref().iter().map(|time| time.0).collect();
        PinInput::new(self.pin.get_ref(), Since::PowerUp, changes_ns)
    }
}

impl Button {
    fn input(&self) -> PinInput {
        let lasts = self.lasts.get_ref().0;
        let presses = self.pressed.get_ref().iter();
        let presses = presses.flat_map(|at| [at.0, at.0.saturating_add(lasts)]);
        // A pin is low at first.
        let high_at_first = (self.level == Pressed::Low).then_some(0);
        let changes_ns: Vec<_> = high_at_first.into_iter().chain(presses).collect();
        PinInput::new(self.pin.get_ref(), Since::PowerUp, changes_ns)
    }
}

impl Uart {
    fn input(&self) -> UartInput {
        let text = self.text.as_ref().map(|text| text.clone().into_bytes());
        UartInput {
            port: self.port.get_ref().clone(),
            at_ns: self.at.0,
            bytes: text.or_else(|| self.bytes.clone()).unwrap_or_default(),
        }
    }
}

/// The faults that need only a time.
const FAULTS: [(&str, FaultKind); 11] = [
    ("adc_overrun", FaultKind::AdcOverrun),
    ("extra_scan", FaultKind::ExtraScan),
    ("missed_trigger", FaultKind::MissedTrigger),
    ("adc_dma_error", FaultKind::AdcDmaError),
    ("crystal_stops", FaultKind::CrystalStops),
    ("crystal_starts", FaultKind::CrystalStarts),
    ("power_cut", FaultKind::PowerCut),
    ("wild_jump", FaultKind::WildJump),
    ("unhandled_interrupt", FaultKind::UnhandledInterrupt),
    ("hang", FaultKind::Hang),
    ("runaway_stack", FaultKind::RunawayStack),
];

impl FaultEntry {
    fn kind(&self) -> Option<FaultKind> {
        let name = self.kind.get_ref();
        if name == "transmitter_stalled" {
            let for_ns = self.lasts?.0;
            return Some(FaultKind::TransmitterStalled { for_ns });
        }
        let found = FAULTS.iter().find(|(fault, _)| fault == name);
        found.filter(|_| self.lasts.is_none()).map(|(_, kind)| *kind)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A scenario in a folder of its own, with a file of numbers beside it.
    fn read(text: &str) -> Result<Scenario, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.toml");
        std::fs::write(&path, text).unwrap();
        std::fs::write(folder.path().join("ramp.csv"), "t,x\n0,1\n0.001,2\n0.002,3\n").unwrap();
        std::fs::write(folder.path().join("two.csv"), "t,x,y\n0,1,2\n").unwrap();
        std::fs::write(folder.path().join("bad.csv"), "t,x\n0,1\n1,two\n").unwrap();
        let folder = format!("{}/", folder.path().display());
        Scenario::read(&path).map_err(|error| error.to_string().replace(&folder, ""))
    }

    fn applied(text: &str) -> Run {
        let mut run = Run::new("none");
        read(text).unwrap().apply(&mut run);
        run
    }

    #[test]
    fn a_button_is_high_but_while_it_is_pressed_and_levels_alternate() {
        let run = applied(
            "[[button]]\npin = \"PC13\"\npressed = [\"1ms\", 0.5]\nfor = \"20us\"\n\
             [[pin]]\npin = \"PA0\"\nchanges = [\"5ns\", \"1.5us\"]\n",
        );
        assert_eq!(run.pin_inputs[0].changes_ns, [5, 1_500]);
        assert_eq!(
            run.pin_inputs[1].changes_ns,
            [0, 1_000_000, 1_020_000, 500_000_000, 500_020_000]
        );
    }

    #[test]
    fn a_waveform_begins_at_its_time_with_its_own_period_and_unit() {
        let run = applied(
            "[[waveform]]\npin = \"PC0\"\nfile = \"ramp.csv\"\ncolumn = \"x\"\nat = \"2ms\"\ngain = 100\n",
        );
        let input = &run.analog_inputs[0];
        assert_eq!(
            (&input.codes[..], input.period_ns),
            (&[100, 100, 100, 200, 300][..], 1_000_000)
        );
        let volts = applied(
            "[[waveform]]\npin = \"PC0\"\nfile = \"ramp.csv\"\ncolumn = \"x\"\nunit = \"volts\"\nperiod = \"1us\"\n",
        );
        // 1, 2 and 3 of 3.3 V.
        assert_eq!(volts.analog_inputs[0].codes, [1241, 2482, 3723]);
        assert_eq!(volts.analog_inputs[0].period_ns, 1_000);
    }

    #[test]
    fn the_rest_of_a_file_goes_to_its_place() {
        let run = applied(
            "[clock]\ncrystal_ppm = 20.0\nlsi_hz = 30_000\n\
             [[uart]]\nport = \"UART4\"\nat = 1\ntext = \"a\\n\"\n\
             [[wire]]\nfrom = \"PA9\"\nto = \"PA10\"\n\
             [[analog_wire]]\nfrom = \"PA4\"\nto = \"PA0\"\n\
             [[supply]]\nat = \"3s\"\nvolts = 2.8\n\
             [[fault]]\nat = \"4s\"\nkind = \"crystal_stops\"\n",
        );
        assert_eq!((run.hse_ppm, run.lsi_hz), (20.0, Some(30_000)));
        assert_eq!(
            (run.uart_input[0].at_ns, &run.uart_input[0].bytes[..]),
            (1_000_000_000, &b"a\n"[..])
        );
        assert_eq!(run.wires, [("PA9".to_owned(), "PA10".to_owned())]);
        assert_eq!(run.analog_wires[0].from, "PA4");
        let kinds: Vec<_> = run.faults.iter().map(|fault| (fault.at_ns, fault.kind)).collect();
        let supply = FaultKind::Supply { millivolts: 2800 };
        assert_eq!(
            kinds,
            [(3_000_000_000, supply), (4_000_000_000, FaultKind::CrystalStops)]
        );
    }

    #[test]
    fn a_mistake_is_one_line_with_its_place() {
        for (text, said) in [
            (
                "[[pin]]\npin='PX0'\nchanges=[]",
                "2:5: there is no pin \"PX0\"; pins are PA0 to PI15",
            ),
            ("[[pin]]\npin='PA0'\nchange=[]", "3:1: unknown field `change`"),
            (
                "[[pin]]\npin='PA0'\nchanges=['2ms', '1ms']",
                "3:9: the times are not in ascending order",
            ),
            (
                "[[pin]]\npin='PA0'\nchanges=['soon']",
                "3:10: \"soon\" is not a time",
            ),
            (
                "[[uart]]\nport='USART9'\nat=0",
                "2:6: there is no USART \"USART9\"",
            ),
            ("[[uart]]\nport='USART1'\nat=0", "2:6: give either text or bytes"),
            ("[[fault]]\nat=0\nkind='luck'", "3:6: there is no fault \"luck\""),
            ("[[supply]]\nat=0\nvolts=5", "3:7: the supply must be 0 to 3.6 V"),
            ("[[waveform]]\npin='PC0'\nfile='no.csv'", "3:6: cannot read"),
            (
                "[[waveform]]\npin='PC0'\nfile='two.csv'",
                "3:6: the file has the columns t, x, y: give one",
            ),
            (
                "[[waveform]]\npin='PC0'\nfile='ramp.csv'\ncolumn='y'",
                "3:6: the file has no column \"y\", only t, x",
            ),
            (
                "[[waveform]]\npin='PC0'\nfile='bad.csv'\ncolumn='x'",
                "3:6: line 3: \"two\" is not a number",
            ),
            (
                "[[waveform]]\npin='PC0'\nfile='ramp.csv'\ncolumn='x'\ngain=2000",
                "3:6: value 2 gives 6000, which is not a code from 0 to 4095",
            ),
            (
                "[clock]\ncrystal_hz = 27_000_000",
                "2:14: the crystal must have 4",
            ),
            ("[clock]\ncrystal_ppm = 2000", "2:15: the crystal must be off"),
            ("[clock]\nlsi_hz = 50_000", "2:10: LSI must have 17 to 47 kHz"),
            ("pin = 5", "1:7: invalid type"),
        ] {
            let found = read(text).unwrap_err();
            let found = found.strip_prefix("x.toml:").unwrap();
            assert!(found.starts_with(said) && !found.contains('\n'), "{found}");
        }
    }

    #[test]
    fn a_waveform_that_ends_before_the_run_is_said_unless_it_is_to_stay() {
        let wave = "[[waveform]]\npin = \"PC0\"\nfile = \"ramp.csv\"\ncolumn = \"x\"\n";
        let mut outcome = Outcome {
            virtual_ns: 5_000_000,
            ..Outcome::default()
        };
        let said = read(wave).unwrap().ended_early(&outcome);
        assert_eq!(
            said,
            ["the waveform at PC0 ended at 0.003000 s of 0.005000: its last value stayed"]
        );
        let stays = format!("{wave}stays = true\n");
        assert_eq!(read(&stays).unwrap().ended_early(&outcome), [""; 0]);
        outcome.virtual_ns = 3_000_000;
        assert_eq!(read(wave).unwrap().ended_early(&outcome), [""; 0]);
    }
}
