//! A sink that keeps the results of a meter.

use bead_model::{Chunk, Meter, Origin, Scan, Settings, Shape, Sink, Strike};

/// All results of a meter, in order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Collector {
    /// Trigger index and origin of each window that was opened.
    pub opened: Vec<(u64, Origin)>,
    /// Pieces of windows.
    pub chunks: Vec<Chunk>,
    /// Results of strikes.
    pub reports: Vec<Strike>,
    /// Shapes of the strikes.
    pub shapes: Vec<Shape>,
}

impl Collector {
    /// Runs a new meter on these scans, the first of which has the index `first`.
    pub fn measure(settings: &Settings, first: u64, scans: &[Scan]) -> Self {
        let (mut meter, mut collector) = (Meter::new(), Self::default());
        meter.process(settings, first, scans.iter().copied(), &mut collector);
        collector
    }

    /// Number of scans in all windows.
    pub fn samples(&self) -> usize {
        self.chunks.iter().map(|chunk| chunk.scans.len()).sum()
    }

    /// Scans of all windows.
    pub fn scans(&self) -> Vec<Scan> {
        self.chunks
            .iter()
            .flat_map(|chunk| chunk.scans.iter().copied())
            .collect()
    }
}

impl Sink for Collector {
    fn opened(&mut self, trigger_index: u64, origin: Origin) {
        self.opened.push((trigger_index, origin));
    }

    fn chunk(&mut self, chunk: &Chunk) {
        self.chunks.push(chunk.clone());
    }

    fn report(&mut self, strike: &Strike, shape: &Shape) {
        self.reports.push(*strike);
        self.shapes.push(*shape);
    }
}
