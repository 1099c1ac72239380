//! Replays the recorded samples through the bead's own fixed-point code: every result must match bit for bit.

use bead_model::layout::{BASELINE, LEAD};
use bead_model::{Meter, Origin, Scan, Settings, Sink, Window, WindowRecord};
use bead_wire::{Energy, FieldKind, Fields, Shape, Strike, StrikeFlags, Value};

use bead_recording::strikes::{RecordedStrike, ScanCodes, WindowChunk};
use serde::Serialize;

/// The result of a replay.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ReplayWord {
    /// Everything that the bead sent came out bit for bit.
    #[default]
    Identical,
    /// Samples or settings were not received, and what could be replayed came out bit for bit.
    Incomplete,
    /// Something came out otherwise.
    Differs,
}

impl ReplayWord {
    /// The word.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Identical => "identical",
            Self::Incomplete => "incomplete",
            Self::Differs => "differs",
        }
    }
}

/// The replay of one strike.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Replay {
    /// The result on this computer; none where samples or settings are missing.
    pub said: Option<Strike>,
    /// Estimates after every sample, A and B.
    pub energies: Vec<(Energy, Energy)>,
    /// The first difference of device and replay; none if they agree in every bit that was replayed.
    pub first_difference: Option<String>,
    /// Reason why the strike was not replayed to its end, if there is one.
    pub incomplete: Option<String>,
}

impl Replay {
    /// True if replay reproduces everything that the bead sent, bit for bit.
    pub fn identical(&self) -> bool {
        self.first_difference.is_none() && self.incomplete.is_none()
    }

    /// The result in one word.
    pub fn word(&self) -> ReplayWord {
        match (&self.first_difference, &self.incomplete) {
            (Some(_), _) => ReplayWord::Differs,
            (None, Some(_)) => ReplayWord::Incomplete,
            (None, None) => ReplayWord::Identical,
        }
    }

    /// One line about what is wrong, `None` if device and replay are identical.
    pub fn failure(&self) -> Option<String> {
        let differs = self.first_difference.as_ref();
        let differs = differs.map(|what| format!("replay differs: {what}"));
        let incomplete = || Some(format!("replay is incomplete: {}", self.incomplete.as_ref()?));
        differs.or_else(incomplete)
    }

    fn incomplete(why: String) -> Self {
        Self {
            incomplete: Some(why),
            ..Self::default()
        }
    }
}

/// Greatest sample index. A bead reaches it in three million years at 100 kHz.
const INDEX_MOST: u64 = i64::MAX as u64;

/// Replays one strike twice: its window alone, and as a stream through the strike detector, which must fire
/// at the same sample.
pub fn replay(strike: &RecordedStrike) -> Replay {
    let number = strike.said.strike;
    let Some(settings) = &strike.settings else {
        return Replay::incomplete(match strike.unreleased_settings {
            Some(version) => format!(
                "strike {number}: its settings block has version {version}, of a build before the first release; use that \
                 build to replay it"
            ),
            None => {
                format!("strike {number}: no settings were received, so there is nothing to replay it with")
            }
        });
    };
    // The bead's code counts on from these.
    let indices = [strike.said.first_index, strike.said.trigger_index];
    if let Some(index) = indices.into_iter().find(|index| *index > INDEX_MOST) {
        return Replay {
            first_difference: Some(format!(
                "strike {number}: no bead reaches its sample index {index}, so its frames are not what a \
                 bead sent; record it again"
            )),
            ..Replay::default()
        };
    }

    let mut window = Window::open(number, strike.said.first_index);
    let mut record = WindowRecord::new();
    record.clear();
    let mut energies = Vec::with_capacity(strike.scans.len());
    for codes in &strike.scans {
        window.process(settings, &[codes.scan()], &mut record);
        let measured = window.absorbed_measured(settings);
        energies.push((measured, window.absorbed_predicted(settings)));
    }
    if strike.missing() > 0 {
        return cut(strike, energies);
    }
    let (said, shape) = in_conditions(strike, settings, window.report(settings, &record));
    let first_difference = is_of_an_older_image(strike, &said, &shape)
        .or_else(|| differs_in_chunks(strike, &energies))
        .or_else(|| differs_in_results(strike, &said, &shape))
        .map(|what| format!("strike {number}: {what}"))
        .or_else(|| differs_as_stream(strike, settings));
    Replay {
        said: Some(said),
        energies,
        first_difference,
        incomplete: None,
    }
}

/// The replay of a strike with a gap; `energies` are those before it.
fn cut(strike: &RecordedStrike, energies: Vec<(Energy, Energy)>) -> Replay {
    let (number, missing, before) = (strike.said.strike, strike.missing(), energies.len());
    let differs = differs_in_chunks(strike, &energies);
    let agree = match (before, &differs) {
        (0, _) => "nothing comes before it".to_owned(),
        (_, None) => format!("the {before} before it agree"),
        (_, Some(_)) => format!("the {before} before it differ"),
    };
    Replay {
        said: None,
        energies,
        first_difference: differs.map(|what| format!("strike {number}: {what}")),
        incomplete: Some(format!(
            "strike {number}: {missing} of its {} samples were not received, the first at sample index {}; {agree}",
            strike.said.samples,
            strike.said.first_index + before as u64
        )),
    }
}

fn differs_in_chunks(strike: &RecordedStrike, energies: &[(Energy, Energy)]) -> Option<String> {
    // The first sample after which a hundredth is absorbed. Before it, the energies have few bits that could
    // differ.
    let last = energies.last().map_or((0, 0), |(a, b)| (a.bits(), b.bits()));
    let is_more = |(a, b): &(Energy, Energy)| a.bits() > last.0 / 100 && b.bits() > last.1 / 100;
    let start = energies.iter().position(is_more);
    let mut before = 0;
    strike.chunks.iter().find_map(|chunk| {
        let agreed = std::mem::replace(&mut before, chunk.end);
        let (measured, predicted) = *energies.get(chunk.end - 1)?;
        let index = strike.said.first_index + chunk.end as u64 - 1;
        let both = [
            ("absorbed_measured", chunk.absorbed_measured, measured),
            ("absorbed_predicted", chunk.absorbed_predicted, predicted),
        ];
        let (what, device, replay) = both.into_iter().find(|(_, device, replay)| device != replay)?;
        let pair = [device, replay].map(|energy| FieldNumber {
            bits: i128::from(energy.bits()),
            si: Some((energy.joules(), "J")),
        });
        let is_early = start.is_none_or(|start| agreed <= start);
        let why = if is_early { FROM_THE_START } else { FROM_SOMEWHERE };
        Some(format!("{what} at sample index {index}: {}; {why}", apart(pair)))
    })
}

/// The usual cause of a difference, by its place.
const FROM_THE_START: &str = "a difference from the start of the window usually means that the bead ran with other settings than \
     the recording carries, or with an image of another version";
const FROM_SOMEWHERE: &str = "a difference after samples that agree usually means that a code of the window was damaged on its \
     way, or that the bead's memory was";
const IN_THE_REPORT: &str = "a difference after chunks whose energies all agree usually means that the bead ran an image of \
     another version";

/// Bits of a group of fields that is not there.
const ABSENT: i128 = i128::MIN;

/// A number of a frame, by device or by replay.
#[derive(Debug, Clone, Copy, PartialEq)]
struct FieldNumber {
    /// As it travels.
    bits: i128,
    /// In SI units, where it is a quantity.
    si: Option<(f64, &'static str)>,
}

/// A line that names the fields which an older image computed as this program does, if one sent the strike.
/// The shape from such an image lacks the energy left in the intruder.
fn is_of_an_older_image(strike: &RecordedStrike, said: &Strike, shape: &Shape) -> Option<String> {
    let device = strike
        .shape
        .filter(|device| device.left.is_none() && shape.left.is_some())?;
    let rate = strike.rate();
    let same = |device: &dyn Fields, replay: &dyn Fields| {
        let pairs = numbers(device, rate).into_iter().zip(numbers(replay, rate));
        let same =
            pairs.filter(|((_, device), (_, replay))| device.bits == replay.bits && device.bits != ABSENT);
        same.map(|((field, _), _)| field).collect::<Vec<_>>()
    };
    let place = ["strike", "first_index", "trigger_index", "samples"];
    let mut holds = [same(&strike.said, said), same(&device, shape)].concat();
    holds.retain(|field| !place.contains(&field.as_str()));
    Some(format!(
        "made by an image whose estimates this program no longer computes: its energies lack what the intruder still held at \
         the end of the window. Its codes, settings and times are valid, and these results have the same bits: {}",
        holds.join(", ")
    ))
}

/// The difference of device and replay: both values, and the highest bit that differs.
fn apart([device, replay]: [FieldNumber; 2]) -> String {
    let shown = |who: &str, number: FieldNumber| match number.si {
        _ if number.bits == ABSENT => format!("{who} has none"),
        Some((value, unit)) => format!("{who} {value:.9e} {unit} ({:#x})", number.bits),
        None => format!("{who} {} ({:#x})", number.bits, number.bits),
    };
    let shown = [shown("device", device), shown("replay", replay)].join(", ");
    if [device.bits, replay.bits].contains(&ABSENT) {
        return shown;
    }
    let highest = 127 - (device.bits ^ replay.bits).leading_zeros();
    let steps = device.bits.abs_diff(replay.bits);
    format!(
        "{shown}; the highest bit that differs is bit {highest}, and they differ by {steps} of the last bit"
    )
}

/// The first field of a body in which device and replay differ.
fn differs(what: &str, device: &dyn Fields, replay: &dyn Fields, rate: Option<u32>) -> Option<String> {
    let mut pairs = numbers(device, rate).into_iter().zip(numbers(replay, rate));
    let ((field, device), (_, replay)) =
        pairs.find(|((_, device), (_, replay))| device.bits != replay.bits)?;
    let apart = apart([device, replay]);
    Some(format!("{field} of the {what} frame: {apart}; {IN_THE_REPORT}"))
}

/// Every field of a body, by name, at `rate` scans a second. A missing group differs from every present one.
fn numbers(body: &dyn Fields, rate: Option<u32>) -> Vec<(String, FieldNumber)> {
    let mut all = Vec::new();
    body.each(&mut |field, value| {
        let bits = match value {
            Value::Integer(bits) => bits,
            Value::Group(None) => ABSENT,
            Value::Group(Some(group)) => {
                let named = |(inner, number)| (format!("{}.{inner}", field.name), number);
                all.extend(numbers(group, rate).into_iter().map(named));
                return;
            }
            // The results of a strike have none of these.
            Value::Text(_) | Value::Bytes(_) => return,
        };
        let si = match field.kind {
            FieldKind::Quantity(unit) => {
                let bits = i64::try_from(bits).ok();
                bits.and_then(|bits| unit.si(bits, rate))
                    .map(|value| (value, unit.symbol))
            }
            _ => None,
        };
        all.push((field.name.into(), FieldNumber { bits, si }));
    });
    all
}

/// The results of replay in the conditions that the bead measured, which the samples do not show. If the
/// shape was not received, they are unknown, and the flag that follows from them is taken from the bead.
fn in_conditions(
    strike: &RecordedStrike,
    settings: &Settings,
    (mut said, mut shape): (Strike, Shape),
) -> (Strike, Shape) {
    let is_off = match strike.shape {
        Some(device) => {
            shape.conditions = device.conditions;
            settings.supply_is_off(device.conditions.as_ref())
        }
        None => strike.said.flags.has(StrikeFlags::SUPPLY_OFF),
    };
    if is_off {
        said.flags = said.flags.with(StrikeFlags::SUPPLY_OFF);
    }
    (said, shape)
}

fn differs_in_results(strike: &RecordedStrike, said: &Strike, shape: &Shape) -> Option<String> {
    let rate = strike.rate();
    // Some flags depend on the bead's state before the window.
    let device = Strike {
        flags: strike.said.flags.without(StrikeFlags::OF_THE_BEAD),
        ..strike.said
    };
    differs("strike", &device, said, rate).or_else(|| differs("shape", &strike.shape?, shape, rate))
}

/// Results of a meter for the first window that it completes. A wave that cuts this window has its own.
#[derive(Default)]
struct MeterOutput {
    chunks: Vec<WindowChunk>,
    report: Option<(Strike, Shape)>,
}

impl Sink for MeterOutput {
    fn chunk(&mut self, chunk: &bead_model::Chunk) {
        if self.report.is_some() {
            return;
        }
        let end = self.chunks.last().map_or(0, |chunk| chunk.end) + chunk.scans.len();
        self.chunks.push(WindowChunk {
            end,
            absorbed_measured: chunk.absorbed_measured,
            absorbed_predicted: chunk.absorbed_predicted,
        });
    }

    fn report(&mut self, strike: &Strike, shape: &Shape) {
        self.report.get_or_insert((*strike, *shape));
    }
}

/// Scans that replace those before the window. The window begins where the detector's history began, and the
/// recording lacks the quiet before that, which armed the detector.
///
/// The quiet start of the window is repeated in its place. After an earlier strike the window may start on a
/// slope, which would jump when repeated and so not arm the detector. Then the scan with the highest force is
/// held instead, from which nothing rises.
fn quiet_before<'a>(strike: &'a RecordedStrike, settings: &Settings) -> Option<&'a [ScanCodes]> {
    let quiet = strike.scans.get(..usize::from(BASELINE))?;
    // The detector compares these with scans before the window.
    let length = usize::from(settings.window.lookback).max(quiet.len());
    let start = &strike.scans[..length.min(strike.scans.len())];
    let force = |codes: &&ScanCodes| codes.sensitive[0];
    let [lowest, highest] = [start.iter().min_by_key(force)?, start.iter().max_by_key(force)?];
    let is_quiet = force(&highest) - force(&lowest) < settings.window.threshold;
    Some(if is_quiet {
        quiet
    } else {
        std::slice::from_ref(highest)
    })
}

/// Cuts the window of a strike after its last scan, as did a wave that the window lacks: the force is held
/// until it rises at the trigger of that wave.
fn cut_as_the_wave_did(
    meter: &mut Meter,
    mut settings: Settings,
    strike: &RecordedStrike,
    output: &mut MeterOutput,
) {
    let Some(last) = strike.scans.last() else { return };
    let held = last.scan();
    let [_, wide, acceleration, wide_acceleration] = held.codes();
    let rise = Scan::new([u16::MAX, wide, acceleration, wide_acceleration]);
    let window = settings.window;
    settings.window.threshold = u16::MAX;
    let mut index = strike.said.first_index + u64::from(strike.said.samples);
    for _ in 1..LEAD {
        meter.process(&settings, index, [held], output);
        index += 1;
    }
    settings.window = window;
    meter.pass_over(false);
    meter.process(&settings, index, [rise], output);
}

fn differs_as_stream(strike: &RecordedStrike, settings: &Settings) -> Option<String> {
    let (number, trigger) = (strike.said.strike, strike.said.trigger_index);
    let quiet = quiet_before(strike, settings)?;
    // Right after its start, the bead had fewer scans before the window, too.
    let before = (u64::from(settings.window.history) + 1).min(strike.said.first_index);
    let (mut meter, mut settings) = (Meter::new(), *settings);
    let window = settings.window;
    if strike.said.flags.has(StrikeFlags::FROM_OUTSIDE) {
        meter.keep_around(trigger, trigger, Origin::Line);
        // The force did not open this window, and must not do so here. Where it rises earlier, the detector
        // was not armed yet: it was armed when the window was requested, which may be later than its trigger.
        settings.window.threshold = u16::MAX;
    }
    let mut output = MeterOutput::default();
    let first = strike.said.first_index - before;
    let stream = quiet.iter().cycle().take(before as usize).chain(&strike.scans);
    for (offset, codes) in (0..).zip(stream) {
        let (fired, index) = (meter.strikes(), first + offset);
        meter.process(&settings, index, [codes.scan()], &mut output);
        if index == trigger {
            // Another wave cuts the window only where it did on the bead.
            settings.window = window;
            meter.pass_over(true);
        }
        if meter.strikes() > fired && index != trigger {
            return Some(format!(
                "strike {number}: the replay's detector fires at sample index {index}, and the device's at {trigger}"
            ));
        }
    }
    if strike.said.flags.has(StrikeFlags::WINDOW_CUT) {
        cut_as_the_wave_did(&mut meter, settings, strike, &mut output);
    }
    let report = output
        .report
        .map(|report| in_conditions(strike, &settings, report));
    let Some((mut said, mut shape)) = report else {
        return Some(format!(
            "strike {number}: the replay's detector does not fire on these samples, and the device's fired at {trigger}"
        ));
    };
    (said.strike, shape.strike) = (number, number);
    let is_cut_otherwise = output.chunks != strike.chunks;
    let what = differs_in_results(strike, &said, &shape)
        .or_else(|| is_cut_otherwise.then(|| "the chunks are cut differently".to_owned()))?;
    Some(format!("strike {number}, as a stream: {what}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{recorded_after, recorded_strike};
    use bead_model::design::Supply;
    use bead_recording::strikes::ScansAfterGap;
    use bead_wire::{Body, Conditions, Force, Fraction, Samples, Temperature, Voltage, Waveform};

    #[test]
    fn a_strike_right_after_the_start_replays_to_the_same_bits() {
        // With fewer scans before it no strike is found, and none is lost silently: the detector was not
        // armed.
        let earliest = (0..300).find_map(|quiet| recorded_after(f64::from(quiet) * 1e-5));
        let earliest = earliest.expect("3 ms are enough");
        let reach = u64::from(earliest.settings.unwrap().window.history);
        assert!(earliest.said.first_index < reach, "{}", earliest.said.first_index);
        assert_eq!(replay(&earliest).first_difference, None);
        for more in 1..10 {
            let later = recorded_after(3e-3 + f64::from(more) * 2e-4).unwrap();
            assert_eq!(replay(&later).first_difference, None);
        }
    }

    /// The report of a bead on these scans, if it saw `past` before them and was asked for them at this
    /// sample index.
    fn reported(strike: RecordedStrike, past: &[ScanCodes], asked: Option<u64>) -> RecordedStrike {
        let settings = strike.settings.unwrap();
        let (mut meter, mut output) = (Meter::new(), MeterOutput::default());
        if let Some(at) = asked {
            meter.keep_around(strike.said.trigger_index, at, Origin::Line);
        }
        let first = strike.said.first_index - past.len() as u64;
        for (index, codes) in (first..).zip(past.iter().chain(&strike.scans)) {
            meter.process(&settings, index, [codes.scan()], &mut output);
        }
        let (mut said, shape) = output.report.unwrap();
        assert_eq!(said.trigger_index, strike.said.trigger_index);
        if asked.is_some() {
            said.flags = said.flags.with(StrikeFlags::TRIGGERED_BY_LINE);
        }
        RecordedStrike {
            said,
            shape: Some(shape),
            chunks: output.chunks,
            ..strike
        }
    }

    #[test]
    fn a_window_that_was_asked_for_may_have_a_rise_before_the_detector_was_armed() {
        let mut strike = recorded_strike();
        let rest = strike.scans[0];
        strike.scans.fill(rest);
        // The meter saw few scans before, and is armed one history after the rise.
        for codes in &mut strike.scans[55..] {
            codes.sensitive[0] += 100;
        }
        let asked = strike.said.first_index + 400;
        let good = reported(strike, &[rest; 10], Some(asked));
        assert_eq!(replay(&good).first_difference, None);
        // The force alone would not have opened it there.
        let mut strike = good.clone();
        strike.said.flags = StrikeFlags::NONE;
        assert!(!replay(&strike).identical());
    }

    #[test]
    fn a_strike_on_the_slope_of_an_earlier_one_replays_to_the_same_bits_and_its_trigger_is_held() {
        // One of the slopes is longer than the baseline.
        for end in [20, 64, 100] {
            // The force falls from an earlier strike, by a code at each scan until this one of the window.
            let mut strike = recorded_strike();
            let mut past = vec![strike.scans[0]; 320];
            let falls = (0..320 + end).rev();
            for (left, codes) in falls.zip(past.iter_mut().chain(&mut strike.scans)) {
                codes.sensitive[0] += left;
            }
            let good = reported(strike, &past, None);
            assert_eq!(replay(&good).first_difference, None, "{end}");
            let settings = good.settings.unwrap();
            let mut strike = good.clone();
            strike.said.trigger_index += 1;
            assert!(!replay(&strike).identical(), "{end}");
            // A detector that fires elsewhere, or never, shows also where all else agrees.
            for threshold in [settings.window.threshold / 2, 2000] {
                let mut settings = settings;
                settings.window.threshold = threshold;
                let what = differs_as_stream(&good, &settings).unwrap();
                assert!(what.contains("the device's"), "{end}, {threshold}: {what}");
            }
        }
    }

    #[test]
    fn a_window_that_another_wave_cut_replays_to_the_same_bits() {
        let mut strike = recorded_strike();
        let (history, past) = (160, vec![strike.scans[0]; 320]);
        // The strike again, up to its peak, 301 samples later.
        let again = strike.scans[history - LEAD as usize..history + 60].to_vec();
        strike.scans.truncate(429);
        strike.scans.extend(again);
        let mut cut = reported(strike, &past, None);
        let samples = usize::from(cut.said.samples);
        assert!((429..432).contains(&samples), "{samples}");
        assert!(cut.said.flags.has(StrikeFlags::WINDOW_CUT));
        cut.scans.truncate(samples);
        assert_eq!(replay(&cut).first_difference, None);
        cut.said.flags = cut.said.flags.without(StrikeFlags::WINDOW_CUT);
        assert!(!replay(&cut).identical());
    }

    fn changed(change: impl Fn(&mut RecordedStrike)) -> String {
        let mut strike = recorded_strike();
        change(&mut strike);
        let replay = replay(&strike);
        replay.first_difference.or(replay.incomplete).unwrap()
    }

    #[test]
    fn one_bit_of_any_chunk_is_found_with_its_sample_index() {
        let good = recorded_strike();
        for (number, chunk) in good.chunks.iter().enumerate() {
            let flipped = Energy::from_bits(chunk.absorbed_predicted.bits() ^ 1);
            let what = changed(|strike| strike.chunks[number].absorbed_predicted = flipped);
            let index = good.said.first_index + chunk.end as u64 - 1;
            let place = format!("absorbed_predicted at sample index {index}:");
            assert!(what.contains(&place), "{what}");
        }
    }

    #[test]
    fn a_field_of_a_group_is_found_by_name_and_so_is_a_missing_group() {
        let what = changed(|strike| {
            let gains = strike.shape.as_mut().unwrap().force_gains.as_mut().unwrap();
            gains.uncertainty = Fraction::from_bits(gains.uncertainty.bits() ^ 1);
        });
        assert!(
            what.contains("force_gains.uncertainty of the shape frame: device"),
            "{what}"
        );
        let what = changed(|strike| strike.shape.as_mut().unwrap().force_gains = None);
        assert!(
            what.contains("force_gains of the shape frame: device has none, replay "),
            "{what}"
        );
    }

    #[test]
    fn the_flag_of_the_supply_follows_from_the_conditions_that_the_bead_measured() {
        let differs = |calibrated: Option<f64>, measured: Option<f64>, is_flagged: bool| {
            let mut strike = recorded_strike();
            let supply = calibrated.map(|voltage| Supply { voltage });
            let settings = strike.settings.unwrap().with(|bead| bead.supply = supply);
            strike.settings = Some(settings.unwrap());
            strike.shape.as_mut().unwrap().conditions = measured.map(|volts| Conditions {
                supply: Voltage::from_bits((volts * 4096.0) as u16),
                die_temperature: Temperature::from_bits(25 << 8),
            });
            if is_flagged {
                strike.said.flags = strike.said.flags.with(StrikeFlags::SUPPLY_OFF);
            }
            replay(&strike).first_difference
        };
        for (calibrated, measured, flagged) in [
            (None, None, false),
            (None, Some(2.9), false),
            (Some(3.3), None, true),
            (Some(3.3), Some(3.291), false),
            (Some(3.3), Some(3.289), true),
            (Some(3.3), Some(3.309), false),
            (Some(3.3), Some(3.311), true),
        ] {
            assert_eq!(differs(calibrated, measured, flagged), None, "{measured:?}");
            let what = differs(calibrated, measured, !flagged).unwrap();
            assert!(what.contains("flags of the strike frame"), "{what}");
        }
    }

    #[test]
    fn a_difference_is_told_in_si_units_and_bits_with_what_it_usually_means() {
        let device = recorded_strike().said.peak_force.bits() ^ 0x10;
        let what = changed(|strike| strike.said.peak_force = Force::from_bits(device));
        let parts = [
            "strike 0: peak_force of the strike frame: device 6.",
            &format!("N ({device:#x}), replay 6."),
            "the highest bit that differs is bit 4, and they differ by 16 of the last bit",
            "an image of another version",
        ];
        for part in parts {
            assert!(what.contains(part), "{part}: {what}");
        }
        // Another damper shows from the start, a code that was damaged from there on.
        let what = changed(|strike| {
            let settings = strike.settings.as_mut().unwrap();
            settings.observer.energy += fixed::types::I2F30::from_bits(1 << 12);
        });
        let other = "other settings than the recording carries";
        assert!(what.contains(other), "{what}");
        let what = changed(|strike| strike.scans[400].sensitive[1] ^= 0x40);
        assert!(what.contains("a code of the window was damaged"), "{what}");
        // One bit of a code does, too.
        changed(|strike| strike.scans[300].sensitive[1] ^= 1);
        // The shape has a quantity that needs the sample rate.
        let what = changed(|strike| {
            let shape = strike.shape.as_mut().unwrap();
            shape.width = Samples::from_bits(shape.width.bits() + 1);
        });
        assert!(what.contains("width of the shape frame: device"), "{what}");
    }

    #[test]
    fn an_index_that_no_bead_reaches_is_refused() {
        let changes: [fn(&mut Strike, u64); 2] = [
            |said, index| said.first_index = index,
            |said, index| said.trigger_index = index,
        ];
        for change in changes {
            for before_end in [0, i64::MAX as u64] {
                let index = u64::MAX - before_end;
                let refused = format!("no bead reaches its sample index {index}");
                // The place of missing samples is not given either.
                for scans in [632, 672] {
                    let what = changed(|strike| {
                        change(&mut strike.said, index);
                        strike.scans.truncate(scans);
                    });
                    assert!(what.contains(&refused), "{what}");
                }
            }
            let what = changed(|strike| change(&mut strike.said, INDEX_MOST));
            assert!(!what.contains("no bead reaches"), "{what}");
        }
    }

    #[test]
    fn a_waveform_frame_without_samples_changes_nothing() {
        let mut strike = recorded_strike();
        strike.scans.clear();
        strike.chunks.clear();
        strike.push(&Waveform::draw(&mut || 0));
        assert_eq!((strike.scans.len(), strike.chunks.len()), (0, 0));
        // A window of no samples at all is replayed, too.
        strike.said.samples = 0;
        assert!(!replay(&strike).identical());
    }

    #[test]
    fn missing_samples_and_settings_make_a_replay_incomplete_and_what_is_there_may_still_differ() {
        let cut = |from: usize, change: fn(&mut RecordedStrike)| {
            let mut strike = recorded_strike();
            let after = strike.scans.split_off(from + 40);
            strike.scans.truncate(from);
            strike.chunks.retain(|chunk| chunk.end <= from);
            let from = from + 40;
            strike.after_gaps = vec![ScansAfterGap { from, scans: after }];
            change(&mut strike);
            replay(&strike)
        };
        let whole = |_: &mut RecordedStrike| {};
        use ReplayWord::{Differs, Incomplete};
        let damaged = |strike: &mut RecordedStrike| strike.scans[300].sensitive[1] ^= 0x40;
        for (replay, word, part) in [
            (cut(632, whole), Incomplete, "40 of its 672 samples were"),
            (cut(400, whole), Incomplete, "the 400 before it agree"),
            (cut(0, whole), Incomplete, "nothing comes before it"),
            (
                cut(400, |strike| strike.settings = None),
                Incomplete,
                "no settings",
            ),
            (cut(400, damaged), Differs, "absorbed_m"),
        ] {
            let what = replay.failure().unwrap();
            assert!(what.contains(part) && !replay.identical(), "{what}");
            assert_eq!(replay.word(), word);
        }
    }
}
