//! A strike as it was received: the bead's result, the samples, and the settings in force.

use bead_model::Scan;
use bead_model::settings::Settings;
use bead_wire::{Energy, Shape, Strike, Waveform};

/// Energies after a run of samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WindowChunk {
    /// Number of samples of the window up to the end of this chunk.
    pub end: usize,
    /// Estimate A.
    pub absorbed_measured: Energy,
    /// Estimate B.
    pub absorbed_predicted: Energy,
}

/// ADC codes of one scan: force, then acceleration, at either gain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ScanCodes {
    /// At the high gain.
    pub sensitive: [u16; 2],
    /// At the low gain, where they had a part in the estimates.
    pub wide: Option<[u16; 2]>,
}

impl ScanCodes {
    /// The codes as the bead had them. Codes that had no part in the estimates are 0.
    pub fn scan(&self) -> Scan {
        let ([force, acceleration], [force_wide, acceleration_wide]) =
            (self.sensitive, self.wide.unwrap_or_default());
        Scan::new([force, force_wide, acceleration, acceleration_wide])
    }
}

/// Codes of a window after a gap, up to the next one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ScansAfterGap {
    /// Sample of the window at the first code.
    pub from: usize,
    /// The codes.
    pub scans: Vec<ScanCodes>,
}

/// A strike as it was received.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedStrike {
    /// Address of the bead that was struck.
    pub address: u8,
    /// Low byte of the boot number of the bead.
    pub boot: u8,
    /// Number of the boot among those that were received of this bead, from 0: after a power cycle the low
    /// byte is the same again. `None` for a fetched strike, whose frames only have the byte.
    pub nth_boot: Option<usize>,
    /// Unique device id of the bead, `None` before its identity came.
    pub uid: Option<[u8; 12]>,
    /// Scans a second, Hz, by the last identity of the bead before the strike.
    pub sample_rate_hz: Option<u32>,
    /// Receive time of the strike frame, ns since 1970. `None` if it is unknown, and for a fetched strike.
    pub received_ns: Option<u64>,
    /// The bead's result.
    pub said: Strike,
    /// The bead's measures of its shape, if they were received.
    pub shape: Option<Shape>,
    /// Codes of the window from its start up to the first gap.
    pub scans: Vec<ScanCodes>,
    /// Codes of the window after that gap, ascending. No estimate can be computed from them.
    pub after_gaps: Vec<ScansAfterGap>,
    /// The chunks that the codes before the first gap came in.
    pub chunks: Vec<WindowChunk>,
    /// The settings in force, if any were received.
    pub settings: Option<Settings>,
    /// Version of a settings block of the bead that a program from before the first release wrote.
    pub unreleased_settings: Option<u16>,
}

impl RecordedStrike {
    /// A strike before its samples were received.
    pub fn new(address: u8, said: Strike) -> Self {
        Self {
            address,
            boot: 0,
            nth_boot: None,
            uid: None,
            sample_rate_hz: None,
            received_ns: None,
            said,
            shape: None,
            scans: Vec::new(),
            after_gaps: Vec::new(),
            chunks: Vec::new(),
            settings: None,
            unreleased_settings: None,
        }
    }

    /// Scans a second, Hz: from the bead's identity, or else from the settings.
    pub fn rate(&self) -> Option<u32> {
        let of_settings = self.settings.map(|settings| settings.sample_rate_hz);
        self.sample_rate_hz.or(of_settings).filter(|rate| *rate > 0)
    }

    /// Number of samples of the window that were received.
    pub fn received(&self) -> usize {
        let after = self.after_gaps.iter().map(|after| after.scans.len());
        self.scans.len() + after.sum::<usize>()
    }

    /// Number of samples of the window that were not received.
    pub fn missing(&self) -> usize {
        usize::from(self.said.samples).saturating_sub(self.received())
    }

    /// True if every sample of the window and the shape were received.
    pub fn is_whole(&self) -> bool {
        self.missing() == 0 && self.shape.is_some()
    }

    /// The samples of the window up to the last that was received; `None` in a gap.
    pub fn samples(&self) -> impl Iterator<Item = Option<&ScanCodes>> {
        let mut end = self.scans.len();
        let after = self.after_gaps.iter().flat_map(move |after| {
            let gap = after.from - end;
            end = after.from + after.scans.len();
            std::iter::repeat_n(None, gap).chain(after.scans.iter().map(Some))
        });
        self.scans.iter().map(Some).chain(after)
    }

    /// Takes the samples of a waveform frame at their place. The frames must come in the order of their first
    /// samples. One whose samples are here already, or are beyond the window, is ignored.
    pub(crate) fn place(&mut self, waveform: &Waveform) {
        let end = match self.after_gaps.last() {
            Some(after) => after.from + after.scans.len(),
            None => self.scans.len(),
        };
        let from = waveform.first_index.checked_sub(self.said.first_index);
        let Some(from) = from.and_then(|from| usize::try_from(from).ok()) else {
            return;
        };
        if from == end && self.after_gaps.is_empty() {
            return self.push(waveform);
        }
        let is_within = from.saturating_add(waveform.codes.len()) <= usize::from(self.said.samples);
        if waveform.codes.is_empty() || !is_within {
            return;
        }
        match self.after_gaps.last_mut() {
            Some(after) if from == end => push_scans(&mut after.scans, waveform),
            _ if from > end => {
                let mut scans = Vec::new();
                push_scans(&mut scans, waveform);
                self.after_gaps.push(ScansAfterGap { from, scans });
            }
            _ => {}
        }
    }

    /// Appends the samples of a waveform frame. A frame without samples, which no bead sends, is ignored.
    pub fn push(&mut self, waveform: &Waveform) {
        if waveform.codes.is_empty() {
            return;
        }
        push_scans(&mut self.scans, waveform);
        self.chunks.push(WindowChunk {
            end: self.scans.len(),
            absorbed_measured: waveform.absorbed_measured,
            absorbed_predicted: waveform.absorbed_predicted,
        });
    }
}

/// Appends the scans of a waveform frame to those before it.
fn push_scans(scans: &mut Vec<ScanCodes>, waveform: &Waveform) {
    let sensitive = waveform.codes.iter();
    let mut wide = waveform.wide.iter();
    // The codes at the low gain begin with the two scans before those of the frame, or are not there.
    let before = wide.len().saturating_sub(sensitive.len());
    let before: Vec<_> = wide.by_ref().take(before).collect();
    for (scan, wide) in scans.iter_mut().rev().zip(before.into_iter().rev()) {
        scan.wide = Some(wide);
    }
    let wide = wide.map(Some).chain(std::iter::repeat(None));
    let codes = sensitive.zip(wide);
    scans.extend(codes.map(|(sensitive, wide)| ScanCodes { sensitive, wide }));
}
