//! Wires between pins of the part.
//!
//! # Design
//!
//! A wire carries the level that an output drives to the pin at its other end, and the frames of a
//! transmitter to the receiver there. Frames go as a whole, at the time at which they end: the bits of a
//! frame are not seen as levels.

use super::wiring::{self, OUTPUTS, PinIndex};
use crate::given::AnalogWire;

#[derive(Debug, Clone, Default)]
pub(super) struct Wires(Vec<[PinIndex; 2]>);

impl Wires {
    pub(super) fn new(wires: Vec<[PinIndex; 2]>) -> Self {
        Self(wires)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Each wire twice: from a pin to the pin at its other end.
    pub(super) fn ends(&self) -> impl Iterator<Item = (PinIndex, PinIndex)> + '_ {
        self.0.iter().flat_map(|[a, b]| [(*a, *b), (*b, *a)])
    }

    /// The pins at the other ends of the wires at a pin.
    pub(super) fn from(&self, pin: PinIndex) -> impl Iterator<Item = PinIndex> + '_ {
        self.ends()
            .filter(move |(from, _)| *from == pin)
            .map(|(_, to)| to)
    }
}

/// A wire from an output of the DAC to an analog input.
#[derive(Debug, Clone)]
pub(super) struct AnalogLoop {
    wire: AnalogWire,
    /// The DAC's channel at one end.
    pub(super) output: usize,
    /// The input's pin at the other.
    pub(super) to: PinIndex,
    /// The level at its capacitor, and the time of that level, ns.
    behind: Option<(f64, u64)>,
}

impl AnalogLoop {
    /// Panics if a wire does not begin at an output of the DAC: the host checks it before.
    pub(super) fn new(wire: &AnalogWire) -> Self {
        let from = wiring::known_pin(&wire.from);
        let output = OUTPUTS.iter().position(|pin| *pin == from);
        Self {
            wire: wire.clone(),
            output: output.unwrap_or_else(|| panic!("{} is no output of the DAC", wire.from)),
            to: wiring::known_pin(&wire.to),
            behind: None,
        }
    }

    /// The code at the input. `level` returns the level of an output at a time, `None` if the output is off.
    pub(super) fn code(&mut self, level: impl Fn(usize, u64) -> Option<u32>, at: u64) -> Option<u16> {
        let of_middle = |level: u32| f64::from(level) / 2048.0 - 1.0;
        let Some(own) = level(self.output, at.saturating_sub(self.wire.delay_ns)) else {
            self.behind = None;
            return None;
        };
        let other = level(1 - self.output, at).map_or(0.0, of_middle);
        let AnalogWire {
            gain,
            offset,
            bend,
            cross_talk,
            noise,
            ..
        } = self.wire;
        let through = self.behind(own.into(), at) * gain + offset + bend * of_middle(own).powi(2);
        let code = through + cross_talk * other + noise * scatter(at, self.to.1 as u64);
        Some(code.round().clamp(0.0, 4095.0) as u16)
    }

    /// The level behind the capacitor, by the implicit Euler method, which is the same on every computer.
    fn behind(&mut self, level: f64, at: u64) -> f64 {
        let lag = self.wire.lag_ns as f64;
        let (before, since) = self.behind.unwrap_or((level, at));
        let passed = at.saturating_sub(since) as f64;
        let now = if lag > 0.0 {
            before + (level - before) * passed / (lag + passed)
        } else {
            level
        };
        self.behind = Some((now, at));
        now
    }
}

/// A number of mean 0 and standard deviation 1 that depends only on the time and the pin: the sum of twelve
/// uniform numbers.
fn scatter(at: u64, pin: u64) -> f64 {
    let part = |n: u64| {
        // The finaliser of SplitMix64 (Steele, Lea and Flood, 2014).
        let mut bits = (at * 16 + pin)
            .wrapping_mul(12)
            .wrapping_add(n)
            .wrapping_mul(0x9e37_79b9_7f4a_7c15);
        bits = (bits ^ bits >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ bits >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((bits ^ bits >> 31) >> 11) as f64 / (1u64 << 53) as f64
    };
    (0..12).map(part).sum::<f64>() - 6.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Codes at many times of an input that is wired to PA4, after a change to the wire.
    fn codes(levels: [Option<u32>; 2], change: impl FnOnce(&mut AnalogWire)) -> Vec<Option<u16>> {
        let mut wire = AnalogWire::new("PA4", "PA0");
        change(&mut wire);
        let mut wire = AnalogLoop::new(&wire);
        (0..4000)
            .map(|n| wire.code(|output, _| levels[output], 10_000 * n))
            .collect()
    }

    #[test]
    fn a_wire_carries_its_own_output_as_its_resistors_and_faults_change_it() {
        let both = [Some(3072), Some(1024)];
        assert_eq!(codes(both, |_| {})[7], Some(3072));
        assert_eq!(codes([None, Some(1)], |_| {})[7], None, "its output is off");
        assert_eq!(
            codes(both, |wire| (wire.gain, wire.offset) = (0.0625, 3.0))[7],
            Some(195)
        );
        assert_eq!(codes(both, |wire| wire.bend = 8.0)[7], Some(3074));
        assert_eq!(codes(both, |wire| wire.cross_talk = 10.0)[7], Some(3067));
        assert_eq!(codes([Some(4095); 2], |wire| wire.offset = 9.0)[7], Some(4095));
    }

    #[test]
    fn a_wire_may_be_late_and_a_capacitor_slow() {
        // A step at 100 us.
        let step = |output, at| Some(if output == 0 && at >= 100_000 { 2000 } else { 1000 });
        let codes = |change: fn(&mut AnalogWire)| {
            let mut wire = AnalogWire::new("PA4", "PA0");
            change(&mut wire);
            let mut wire = AnalogLoop::new(&wire);
            [95_000, 105_000, 115_000, 125_000].map(|at| wire.code(step, at).unwrap())
        };
        assert_eq!(codes(|_| {}), [1000, 2000, 2000, 2000]);
        assert_eq!(codes(|wire| wire.delay_ns = 10_000), [1000, 1000, 2000, 2000]);
        assert_eq!(codes(|wire| wire.lag_ns = 10_000), [1000, 1500, 1750, 1875]);
    }

    #[test]
    fn noise_has_the_deviation_that_is_asked_for_and_is_the_same_every_time() {
        let noisy = || codes([Some(2000), None], |wire| wire.noise = 20.0);
        let found = noisy();
        let off: Vec<f64> = found
            .iter()
            .map(|code| f64::from(code.unwrap()) - 2000.0)
            .collect();
        let mean = off.iter().sum::<f64>() / 4000.0;
        let square = off.iter().map(|off| off * off).sum::<f64>() / 4000.0;
        // Standard errors are 0.3 and 0.22.
        assert!(
            mean.abs() < 1.0 && (square.sqrt() - 20.0).abs() < 0.7,
            "{mean} {square}"
        );
        assert_eq!(found, noisy());
    }
}
