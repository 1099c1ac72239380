//! A simulated bead: sensors with true gains of their own, around the bit-exact code; and random numbers.

use bead_compare::front_end::{AnalogFrontEnd, SAMPLE_RATE_HZ, SensorStimulus};
use bead_model::settings::{BLOCK_MAX, Settings};
use bead_model::{Chunk, Meter, Scan, Sink};
use bead_recording::file::{About, Part, RecordingError, RecordingWriter};
use bead_recording::frames::decode;
use bead_recording::strikes::{RecordedStrike, assemble};
use bead_tables::whole::Target;
use bead_wire::{
    Block, Conditions, Header, Identity, MAX_FRAME, Message, ResetCauses, Shape, Strike, Temperature,
    Voltage, Waveform, encode,
};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::quantity::Stated;

/// Supply of a simulated bead, V.
const SUPPLY: f64 = 3.3;
/// Relative standard deviation of a simulated bead's gains about those of its settings.
pub const GAIN_SPREAD: f64 = 0.02;
/// Time of the first sample, ns since 1970. It is fixed so that recordings are reproducible.
const BEGAN_NS: u64 = 1_000_000_000;

/// A random number generator for a seed and a purpose.
pub fn chance(seed: u64, purpose: u64) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(purpose);
    random
}

/// A standard normal deviate.
pub fn deviate(random: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(random)
}

/// A true value of a quantity that is known as `stated`.
pub(super) fn truth(stated: Stated, random: &mut ChaCha8Rng) -> f64 {
    stated.value + stated.u * deviate(random)
}

/// A bead whose true gains may differ from its settings.
#[derive(Debug, Clone, Copy)]
pub struct SimulatedBead {
    /// Its settings.
    pub settings: Settings,
    /// Its front end.
    pub front_end: AnalogFrontEnd,
    /// True gains over those of the settings: force, acceleration.
    pub gains: [f64; 2],
}

impl SimulatedBead {
    /// A bead with these settings and randomly drawn true gains.
    pub fn drawn(settings: &Settings, random: &mut ChaCha8Rng) -> Self {
        Self::with_gains(settings, [(); 2].map(|()| 1.0 + GAIN_SPREAD * deviate(random)))
    }

    /// A bead with these settings, whose true gains are those of the settings times `gains`: force,
    /// acceleration.
    pub fn with_gains(settings: &Settings, gains: [f64; 2]) -> Self {
        let description = settings.description();
        let mut front_end = AnalogFrontEnd::default();
        front_end.force = front_end.force.with_scale(&description.force, gains[0]);
        front_end.acceleration = front_end
            .acceleration
            .with_scale(&description.acceleration, gains[1]);
        Self {
            settings: *settings,
            front_end,
            gains,
        }
    }

    /// Records what the bead sends during `seconds` of a stimulus.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn record(
        &self,
        target: &Target,
        stimulus: &impl SensorStimulus,
        seconds: f64,
        seed: u64,
    ) -> Result<(), RecordingError> {
        let (block, voice) = self.measure(stimulus, seconds, seed);
        let about = About {
            source: "simulated bead".to_owned(),
            sample_rate_hz: SAMPLE_RATE_HZ,
            ..About::default()
        };
        let writer = RecordingWriter::create(target, &about)?;
        writer.fill(|writer| {
            writer.attach(Part::Settings, &block)?;
            voice
                .frames
                .iter()
                .try_for_each(|(index, frame)| writer.write(frame, Some(BEGAN_NS + index * 10_000), |_| {}))
        })?;
        Ok(())
    }

    /// The strikes that the bead sends during `seconds` of a stimulus, without a file.
    pub fn strikes(&self, stimulus: &impl SensorStimulus, seconds: f64, seed: u64) -> Vec<RecordedStrike> {
        let (_, voice) = self.measure(stimulus, seconds, seed);
        let bytes: Vec<u8> = voice.frames.into_iter().flat_map(|(_, frame)| frame).collect();
        assemble(decode(&bytes).0, None)
    }

    /// The settings block, and the frames of a run.
    fn measure(&self, stimulus: &impl SensorStimulus, seconds: f64, seed: u64) -> (Vec<u8>, Voice) {
        let scans = (seconds * f64::from(SAMPLE_RATE_HZ)).ceil() as usize;
        let codes = self.front_end.digitise(stimulus, scans, Some(seed)).scans;
        let mut voice = Voice::new(self.settings.description().address);
        let mut block = [0; BLOCK_MAX];
        // Valid settings encode to a block, and a block fits a frame.
        let length = self.settings.encode(&mut block).unwrap_or(0);
        voice.say(0, voice.identity());
        if let Ok(block) = Block::try_from(&block[..length]) {
            voice.say(0, bead_wire::Settings { block });
        }
        let scans: Vec<Scan> = codes.into_iter().map(Scan::new).collect();
        Meter::new().process(&self.settings, 1, scans, &mut voice);
        (block[..length].to_vec(), voice)
    }
}

/// Frames of a bead, numbered one after another.
struct Voice {
    address: u8,
    sequence: u32,
    /// Each frame with the sample index at which it is made.
    frames: Vec<(u64, Vec<u8>)>,
}

impl Voice {
    fn new(address: u8) -> Self {
        Self {
            address,
            sequence: 0,
            frames: Vec::new(),
        }
    }

    fn say(&mut self, sample_index: u64, message: impl Into<Message>) {
        let header = Header {
            address: self.address,
            boot: 0,
            sequence: self.sequence,
            sample_index,
        };
        self.sequence = self.sequence.wrapping_add(1);
        let mut buffer = [0; MAX_FRAME];
        // MAX_FRAME bytes suffice for any message.
        if let Ok(frame) = encode(&header, &message.into(), &mut buffer) {
            self.frames.push((sample_index, frame.to_vec()));
        }
    }

    fn identity(&self) -> Identity {
        Identity {
            firmware: env!("CARGO_PKG_VERSION").into(),
            git: "simulated".into(),
            uid: [self.address; 12],
            boot: 0,
            reset_cause: ResetCauses::from_bits(0),
            sample_rate_hz: SAMPLE_RATE_HZ,
            channels: 4,
        }
    }
}

impl Sink for Voice {
    fn chunk(&mut self, chunk: &Chunk) {
        let end = chunk.first_index + chunk.scans.len() as u64;
        self.say(end, Waveform::from(chunk));
    }

    fn report(&mut self, strike: &Strike, shape: &Shape) {
        let end = strike.first_index + u64::from(strike.samples);
        let supply = (SUPPLY / Voltage::UNIT.resolution()).round();
        let conditions = Conditions {
            supply: Voltage::from_bits(supply as _),
            die_temperature: Temperature::default(),
        };
        self.say(end, *strike);
        self.say(
            end,
            Shape {
                conditions: Some(conditions),
                ..*shape
            },
        );
    }
}
