//! A made-up strike, in codes: the self-test computes one, and a bead on the bench plays one to itself.
//!
//! It needs no tables, and is the same on bead and host.

/// Scans of the strike that a bead plays: then the ringing has died away to a code.
pub const PLAYED: usize = 250;
/// Codes of force and acceleration before and after a strike that is played. Outputs reach codes from 249 to
/// 3846 (0.2 V from either rail: DocID022152, DAC characteristics).
pub const REST: [u16; 2] = [1024, 2048];

/// Half the width of the force's pulse, in samples.
const HALF: i32 = 20;

/// The force above its rest at a sample after the pulse began: a parabola of 1500 codes, 40 samples wide.
pub const fn pulse(at: i32) -> u16 {
    let off = at - HALF;
    let force = 1500 * (HALF * HALF - off * off) / (HALF * HALF);
    if force > 0 { force as u16 } else { 0 }
}

/// A damped oscillator: y'' = f - y' / 16 - y / 128, in codes and samples.
#[derive(Clone, Copy, Debug, Default)]
pub struct MadeUpIntruder {
    now: i32,
    before: i32,
}

impl MadeUpIntruder {
    /// The acceleration at the next sample, whose force is this much above its rest.
    pub fn step(&mut self, force: u16) -> i16 {
        let next = 2 * self.now - self.before + 2 * i32::from(force)
            - (self.now - self.before) / 16
            - self.now / 128;
        self.before = core::mem::replace(&mut self.now, next);
        (next / 256).clamp(-900, 900) as i16
    }
}

/// The codes of force and acceleration that a bead plays to itself, one pair for each scan.
pub fn played() -> impl Iterator<Item = [u16; 2]> {
    let mut intruder = MadeUpIntruder::default();
    (0..PLAYED as i32).map(move |at| {
        let force = pulse(at);
        [
            REST[0] + force,
            REST[1].saturating_add_signed(intruder.step(force)),
        ]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_played_begins_and_ends_at_rest_and_within_reach_of_the_outputs() {
        let codes: Vec<_> = played().collect();
        assert_eq!((codes[0], codes[PLAYED - 1]), (REST, REST));
        assert!(codes.iter().flatten().all(|code| (249..=3846).contains(code)));
        let peak = codes.iter().map(|pair| pair[0]).max();
        assert_eq!(peak, Some(REST[0] + 1500));
        // The pulse rises at once, so that noise moves no trigger.
        assert_eq!(codes[1][0] - codes[0][0], 146);
    }
}
