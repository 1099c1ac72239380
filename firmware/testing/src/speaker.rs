//! A bead that speaks: messages in, frames out.

use std::mem;

use bead_model::{Chunk, Meter, Scan, Sink};
use bead_wire::{
    Header, Identity, MAX_FRAME, Message, Outcome, ReceivedRequest, Reply, RequestDecoder, ResetCauses,
    Shape, Strike, Waveform, encode,
};

use crate::settings::block_of;

/// A bead's end of a line. Its frames are numbered one after another.
///
/// As the sink of a [`Meter`] it sends what the image sends of a strike: waveforms, the strike and its shape.
#[derive(Clone, Debug, Default)]
pub struct Speaker {
    /// Address in its frames.
    pub address: u8,
    /// Number of its boot; frames carry the low byte.
    pub boot: u32,
    /// Number of its next frame.
    pub sequence: u32,
    /// Frames that were said, with their delimiters.
    pub bytes: Vec<u8>,
    /// Decoder of the requests to this bead and to others.
    pub decoder: RequestDecoder,
}

impl Speaker {
    /// A bead with this address in its first boot.
    pub fn at(address: u8) -> Self {
        Self {
            address,
            ..Self::default()
        }
    }

    /// The next frame, made at this sample index. It is not added to `bytes`.
    pub fn frame(&mut self, sample_index: u64, message: &Message) -> Vec<u8> {
        let header = Header {
            address: self.address,
            boot: self.boot as u8,
            sequence: self.sequence,
            sample_index,
        };
        self.sequence = self.sequence.wrapping_add(1);
        let mut buffer = [0; MAX_FRAME];
        let frame = encode(&header, message, &mut buffer);
        frame.expect("MAX_FRAME bytes suffice for any message").to_vec()
    }

    /// Adds a frame to `bytes`.
    pub fn say(&mut self, sample_index: u64, message: impl Into<Message>) {
        let frame = self.frame(sample_index, &message.into());
        self.bytes.extend(frame);
    }

    /// Takes bytes from the line, passes each request in them to `answer`, and returns the frames said.
    pub fn answer(&mut self, bytes: &[u8], mut answer: impl FnMut(&mut Self, &ReceivedRequest)) -> Vec<u8> {
        for byte in bytes {
            if let Some(Ok(request)) = self.decoder.push(*byte) {
                answer(self, &request);
            }
        }
        mem::take(&mut self.bytes)
    }

    /// Says a reply without detail to the request with this number.
    pub fn reply(&mut self, request: u16, outcome: Outcome) {
        let detail = "".into();
        self.say(
            0,
            Reply {
                request,
                outcome,
                detail,
            },
        );
    }

    /// The identity of this bead: 100 000 scans a second, a UID of which every byte is the address.
    pub fn identity(&self) -> Identity {
        Identity {
            firmware: "0.1.0".into(),
            git: "test".into(),
            uid: [self.address; 12],
            boot: self.boot,
            reset_cause: ResetCauses::from_bits(0),
            sample_rate_hz: 100_000,
            channels: 4,
        }
    }

    /// Says its identity and its settings, as after a reset, then measures these scans, the first of which
    /// has the index 1. Returns the number of strikes.
    pub fn measure(
        &mut self,
        settings: &bead_model::Settings,
        codes: impl IntoIterator<Item = [u16; 4]>,
    ) -> u32 {
        self.say(0, self.identity());
        self.say(0, block_of(settings));
        let mut meter = Meter::new();
        let scans: Vec<Scan> = codes.into_iter().map(Scan::new).collect();
        meter.process(settings, 1, scans, self);
        meter.strikes()
    }
}

impl Sink for Speaker {
    fn chunk(&mut self, chunk: &Chunk) {
        self.say(chunk.first_index, Waveform::from(chunk));
    }

    fn report(&mut self, strike: &Strike, shape: &Shape) {
        self.say(strike.trigger_index, *strike);
        self.say(strike.trigger_index, *shape);
    }
}
