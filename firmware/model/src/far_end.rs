//! The end of the reduced chain: beads that go on, though the model stops.
//!
//! # Design
//!
//! A free end loses its last bead to the first wave, and the second wave of a train meets a chain that is not
//! there. So the last follower is pushed back by the force of its own front contact, as it was when the wave
//! passed there. A solitary wave takes `1.10444 √M κ^(-1/3) F^(-1/6)` from contact to contact, with F the
//! peak of its force (measured in an elastic chain; the same from 1.3 to 21 N to 1e-6), and a viscous contact
//! makes it faster by its relaxation time. F is the greatest force of the last two spans, of two delays each:
//! the peak of the wave that is passing, and not that of one long gone.

use fixed::types::{I2F30, I16F16};

use crate::company::FOLLOWERS;
use crate::quantity::high_rounded;

/// Samples that the line holds: the longest delay, and one sample more.
const LINE: usize = 128;
/// Fraction bits of the delay.
const FRACTION: u32 = 16;
/// Longest delay: one that the line still holds with the sample before it.
const LONGEST: f32 = (LINE - 2) as f32;

/// A wave on a static load of F0 is about as fast as one of the force F + 6.13 F0 without it: a weak one
/// takes `√(2/3) √M κ^(-1/3) F0^(-1/6)` from contact to contact, as long waves on springs of the stiffness
/// `1.5 κ^(2/3) F0^(1/3)` do, and (1.10444/√(2/3))^6 = 6.13.
const LOAD: f32 = 6.13;

/// `bits(x^(-1/6)) ≈ ROOT - bits(x)/6` within 3 %, since the bits of an [`f32`] are nearly a logarithm. Found
/// by search, for the least error after one step of Newton's.
const ROOT: u32 = 0x4A0E_0255;

/// Continuation of a wave behind the last follower.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Onward {
    /// Delay of a force of one bit, samples.
    unit: f32,
    /// Samples that the viscosity of a contact takes off a delay, with [`FRACTION`] fraction bits.
    sooner: u32,
    /// Force added to every peak for a static load: a wave on the load is about as fast as one higher by
    /// this force without it.
    load: i32,
}

impl Onward {
    /// Takes the `delay` of a force of one bit, in samples; 3τ/2 of the last contact, in samples; and a
    /// static `load`.
    pub(crate) fn new(delay: I16F16, relaxation: I2F30, load: i32) -> Self {
        Self {
            unit: delay.to_num(),
            // 2/3 of it, with the fraction bits of a delay.
            sooner: (relaxation.to_bits().unsigned_abs() / 3) >> (I2F30::FRAC_NBITS - FRACTION - 1),
            load: (LOAD * load as f32) as i32,
        }
    }
}

/// State of the end: the forces of the last contact, and the delay that follows from them. Forces are
/// accelerations of a bead, in twelfths of a µm/sample² ([`reduced_chain`](crate::reduced_chain)).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FarEnd {
    line: [i32; LINE],
    /// Samples so far; a window has fewer than 2^16.
    samples: u32,
    /// Greatest force of the span before, and of this one so far.
    peaks: [i32; 2],
    /// The sample with which this span began, and samples after which it ends.
    began: u32,
    span: u32,
    /// The delay, in samples, and the place in the line that it led to last; both with [`FRACTION`] fraction
    /// bits.
    delay: u32,
    place: u32,
    /// Peak of the first wave, and when it came.
    first: i32,
    first_came: u32,
    /// The sample by which an echo from behind can be back at the host: as many delays later as there are
    /// contacts between.
    echo: u32,
}

impl Default for FarEnd {
    fn default() -> Self {
        Self {
            line: [0; LINE],
            samples: 0,
            peaks: [0; 2],
            began: 0,
            span: 0,
            delay: 0,
            place: 0,
            first: 0,
            first_came: 0,
            echo: u32::MAX,
        }
    }
}

impl FarEnd {
    /// Takes the force of the last contact at this sample, and returns the one behind the last bead.
    #[inline(always)]
    pub(crate) fn push(&mut self, force: i32, onward: &Onward) -> i32 {
        let now = self.samples;
        self.samples = now + 1;
        self.line[now as usize % LINE] = force;
        if force > self.peaks[1] || now - self.began >= self.span {
            self.follow(now, force, onward);
        }
        // The place never moves back: no wave is felt twice, though a weaker one behind it takes longer.
        self.place = (now << FRACTION).saturating_sub(self.delay).max(self.place);
        let [before, after] = [0, 1].map(|next| self.line[((self.place >> FRACTION) + next) as usize % LINE]);
        let part = self.place % (1 << FRACTION);
        // 2^(1 - 32) and the 31 bits of the part cancel, and twice the difference has room.
        before + high_rounded(2 * (after - before), (part << (31 - FRACTION)) as i32)
    }

    /// True if echoes from behind the last bead, of which the model knows nothing, may be at the host.
    pub(crate) fn echoes(&self) -> bool {
        self.samples > self.echo
    }

    /// A new peak, or the end of a span. Never inlined: the loop needs its registers.
    #[inline(never)]
    fn follow(&mut self, now: u32, force: i32, onward: &Onward) {
        let [before, newest] = self.peaks;
        self.peaks = if now - self.began >= self.span {
            self.began = now;
            [newest, force.max(0)]
        } else {
            [before, force]
        };
        let [before, newest] = self.peaks;
        let peak = before.max(newest).saturating_add(onward.load);
        let delay = f32::min(onward.unit * sixth_root(peak), LONGEST);
        let delay = (delay * (1 << FRACTION) as f32) as u32;
        self.span = delay >> (FRACTION - 1);
        self.delay = delay.saturating_sub(onward.sooner);
        // If a wave is twice as high, what came before it was noise.
        if force > self.first && now - self.first_came <= self.span || force / 2 > self.first {
            (self.first, self.first_came) = (force, now);
            self.echo = now + ((FOLLOWERS as u32 * self.delay) >> FRACTION);
        }
    }
}

/// `force^(-1/6)`, within 0.4 %; large for a force of 0.
#[inline(always)]
fn sixth_root(force: i32) -> f32 {
    let force = force as f32;
    let root = f32::from_bits(ROOT - force.to_bits() / 6);
    let cube = root * root * root;
    // A step of Newton's for root^-6 = force.
    root * (7.0 - force * cube * cube) * (1.0 / 6.0)
}
