//! Thousands of random valid settings, each with a random stimulus. After each the bead is told to look for
//! no strikes, and answers in time.

use bead_testing::{any_settings, block};
use bead_wire::{Outcome, Request};
use proptest::prelude::Rng;
use proptest::test_runner::{RngAlgorithm, TestRng};

use crate::bead::{TestBead, status};

/// Signals at the sensors.
struct Stimulus {
    /// Most that the noise adds, in codes.
    noise: u64,
    /// Scans from strike to strike; none for noise alone.
    every: Option<u64>,
    /// Height of a strike in codes, and its length.
    height: u64,
    length: u64,
}

impl Stimulus {
    fn draw(random: &mut dyn FnMut() -> u64) -> Self {
        Self {
            noise: [0, 1, 3, 40, 4000][random() as usize % 5],
            every: (!random().is_multiple_of(4)).then(|| 130 + random() % 2000),
            height: random() % 5000,
            length: 1 + random() % 400,
        }
    }

    fn codes(&self, at: u64, bits: u64) -> [u16; 4] {
        let strike = match self.every {
            Some(every) if at % every < self.length => {
                // A triangle.
                let rise = (at % every).min(self.length - at % every);
                2 * self.height * rise / self.length
            }
            _ => 0,
        };
        let code = |zero: u64, signal: u64, shift: u32| {
            (zero + signal + (bits >> shift & 0xFFFF) % (self.noise + 1)).min(4095) as u16
        };
        [
            code(128, strike, 0),
            code(128, strike / 16, 16),
            code(2048, strike / 2, 32),
            code(2048, strike / 32, 48),
        ]
    }
}

#[test]
fn after_any_valid_settings_and_any_strikes_a_bead_is_disarmed_and_given_others_at_once() {
    let mut random = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
    let (mut slowest, mut passed_over, mut strikes) = (0, 0, 0);
    for _ in 0..2000 {
        let settings = any_settings(&mut || random.next_u64());
        let stimulus = Stimulus::draw(&mut || random.next_u64());
        let mut noise = TestRng::from_seed(RngAlgorithm::ChaCha, &[random.next_u64() as u8; 32]);
        let mut bead = TestBead::probed(block(&settings));
        bead.running.signal = Box::new(move |index| stimulus.codes(index, noise.next_u64()));
        bead.run(0.08 + 0.12 * (random.next_u64() % 100) as f64 / 100.0);
        // Each reply comes within 0.3 s.
        use Request::{Arm, Disarm, EraseSettings};
        for request in [Disarm, EraseSettings, Arm, Disarm] {
            let asked = bead.running.index;
            assert_eq!(bead.outcome(&request), Outcome::Done, "{settings:?}");
            slowest = slowest.max(bead.running.index - asked);
        }
        // The longest window and its lag.
        bead.run(0.018);
        let (status, _, _, guard) = status(&mut bead);
        assert!(!status.armed, "{settings:?}");
        (passed_over, strikes) = (passed_over + guard.strikes_passed_over, strikes + status.strikes);
    }
    println!(
        "slowest reply {} ms; {strikes} strikes, {passed_over} passed over",
        slowest / 100
    );
    assert!(strikes > 1000 && passed_over > 100, "{strikes} {passed_over}");
}
