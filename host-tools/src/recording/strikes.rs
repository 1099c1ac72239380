//! The strikes of a recording: each with its samples, what the bead said of it, and the settings it ran with.

use bead_model::Scan;
use bead_model::settings::Settings;
use bead_wire::{Arrival, Shape, Strike};

use crate::recording::frames::{Frame, Message, Waveform};

/// Energy bits as they stood after a run of samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Chunk {
    /// Samples of the window up to and with the last of this chunk.
    pub end: usize,
    /// Estimate A, in [`bead_wire::ENERGY_UNIT_J`].
    pub absorbed_measured: i64,
    /// Estimate B, in [`bead_wire::ENERGY_UNIT_J`].
    pub absorbed_predicted: i64,
}

/// The codes of one scan: force, then acceleration, at either gain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Codes {
    /// At the high gain.
    pub sensitive: [u16; 2],
    /// At the low gain, where they had a part in the estimates.
    pub wide: Option<[u16; 2]>,
}

impl Codes {
    /// As the bead had them; codes that had no part in the estimates are made up.
    pub fn scan(&self) -> Scan {
        let ([force, acceleration], [force_wide, acceleration_wide]) =
            (self.sensitive, self.wide.unwrap_or_default());
        Scan::new([force, force_wide, acceleration, acceleration_wide])
    }
}

/// One strike as it was received.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedStrike {
    /// What the bead said of it.
    pub said: Strike,
    /// What it said of its shape, if that was received.
    pub shape: Option<Shape>,
    /// The window's codes, as far as received without a gap from its start.
    pub scans: Vec<Codes>,
    /// The chunks that they came in.
    pub chunks: Vec<Chunk>,
    /// The settings in force, if any were received.
    pub settings: Option<Settings>,
}

impl RecordedStrike {
    /// Samples of the window that were not received, or came after a gap.
    pub fn missing(&self) -> usize {
        usize::from(self.said.samples).saturating_sub(self.scans.len())
    }

    /// Appends the codes of a waveform frame; `wide` are those of the two scans before it and of its own, or none.
    pub fn extend(&mut self, sensitive: &[[u16; 2]], wide: &[[u16; 2]]) {
        let (before, own) = wide.split_at(wide.len().saturating_sub(sensitive.len()));
        for (scan, wide) in self.scans.iter_mut().rev().zip(before.iter().rev()) {
            scan.wide = Some(*wide);
        }
        let wide = own.iter().copied().map(Some).chain(std::iter::repeat(None));
        let codes = sensitive.iter().zip(wide);
        self.scans
            .extend(codes.map(|(&sensitive, wide)| Codes { sensitive, wide }));
    }
}

/// Frames of the bead between two resets.
#[derive(Default)]
struct Boot {
    /// Each with the number of the frame that told it: settings may be changed between two strikes.
    settings: Vec<(u32, Settings)>,
    waveforms: Vec<Waveform>,
    /// Each with the number of its frame.
    strikes: Vec<(u32, Strike)>,
    shapes: Vec<Shape>,
}

/// Puts the frames of a recording together, strike by strike, over resets and with late frames in their place.
///
/// `settings` are those that the bead is known to have been given, for a boot whose settings frames are all lost.
pub fn assemble(frames: &[Frame], settings: Option<&Settings>) -> Vec<RecordedStrike> {
    let mut boots = vec![Boot::default()];
    for frame in frames {
        match frame.arrival {
            Arrival::Restart { .. } => boots.push(Boot::default()),
            Arrival::Duplicate => continue,
            _ => {}
        }
        let Some(boot) = boots.last_mut() else { continue };
        match &frame.message {
            Message::Settings(block) => {
                let settings = Settings::decode(block).ok();
                boot.settings
                    .extend(settings.map(|settings| (frame.header.sequence, settings)));
            }
            Message::Waveform(waveform) => boot.waveforms.push(waveform.clone()),
            Message::Strike(strike) => boot.strikes.push((frame.header.sequence, *strike)),
            Message::Shape(shape) => boot.shapes.push(*shape),
            _ => {}
        }
    }
    boots
        .into_iter()
        .flat_map(|boot| boot.assemble(settings))
        .collect()
}

impl Boot {
    fn assemble(mut self, known: Option<&Settings>) -> Vec<RecordedStrike> {
        self.waveforms.sort_by_key(|waveform| waveform.first_index);
        self.strikes.sort_by_key(|(_, strike)| strike.strike);
        self.settings.sort_by_key(|(told, _)| *told);
        let strike = |(sequence, said): (u32, Strike)| {
            let mut recorded = RecordedStrike {
                said,
                shape: self
                    .shapes
                    .iter()
                    .find(|shape| shape.strike == said.strike)
                    .copied(),
                scans: Vec::new(),
                chunks: Vec::new(),
                settings: self.settings_before(sequence).or(known.copied()),
            };
            for waveform in self
                .waveforms
                .iter()
                .filter(|waveform| waveform.strike == said.strike)
            {
                if waveform.first_index != said.first_index + recorded.scans.len() as u64 {
                    break;
                }
                recorded.extend(&waveform.codes, &waveform.wide);
                recorded.chunks.push(Chunk {
                    end: recorded.scans.len(),
                    absorbed_measured: waveform.absorbed_measured,
                    absorbed_predicted: waveform.absorbed_predicted,
                });
            }
            recorded
        };
        self.strikes.iter().copied().map(strike).collect()
    }

    /// The settings told last before a frame. If those frames are all lost, the first told after it: they rarely change.
    fn settings_before(&self, sequence: u32) -> Option<Settings> {
        let before = self.settings.iter().rev().find(|(told, _)| *told < sequence);
        before.or(self.settings.first()).map(|(_, settings)| *settings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::frames::decode;
    use bead_model::design::{Bead, Capture, FrontEnd, derive};
    use bead_model::settings::BLOCK_MAX;
    use bead_wire::{Header, MAX_FRAME, encode};

    #[test]
    fn a_strike_has_the_settings_told_last_before_it() {
        let mut settings = derive(&Bead::paper(), &FrontEnd::reference(), &Capture::default()).unwrap();
        let mut blocks = Vec::new();
        for threshold in [50, 60] {
            settings.window.threshold = threshold;
            let mut block = [0; BLOCK_MAX];
            let length = settings.encode(&mut block).unwrap();
            blocks.push(block[..length].to_vec());
        }
        let strike = |strike| {
            bead_wire::Message::Strike(Strike {
                strike,
                first_index: 0,
                trigger_index: 0,
                samples: 1,
                peak_force: 0,
                peak_index: 0,
                acceleration_max: 0,
                acceleration_min: 0,
                absorbed_measured: 0,
                absorbed_predicted: 0,
                incident_energy: 0,
                absorbed_fraction: 0,
                noise_energy: 0,
                force_noise: 0,
                flags: 0,
            })
        };
        let told = |block| bead_wire::Message::Settings(bead_wire::Settings { block });
        let messages = [
            strike(0),
            told(&blocks[0]),
            strike(1),
            told(&blocks[1]),
            strike(2),
        ];
        let stream: Vec<u8> = (0..)
            .zip(&messages)
            .flat_map(|(sequence, message)| {
                let header = Header {
                    boot: 0,
                    sequence,
                    sample_index: 0,
                };
                encode(&header, message, &mut [0; MAX_FRAME]).unwrap().to_vec()
            })
            .collect();
        let strikes = assemble(&decode(&stream).0, None);
        let thresholds: Vec<_> = strikes
            .iter()
            .map(|strike| strike.settings.unwrap().window.threshold)
            .collect();
        assert_eq!(thresholds, [50, 50, 60]);
    }
}
