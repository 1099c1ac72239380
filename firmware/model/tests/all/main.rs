//! Tests of the model in one program, so that the simulator beside them is linked once. Under Miri, which
//! checks the model alone, those that simulate chains would take hours.
#![allow(clippy::unwrap_used, reason = "in a test, an unwrap is an assertion")]

#[cfg(not(miri))]
mod accuracy;
mod around;
mod bits;
mod loudness;
mod meter;
#[cfg(not(miri))]
mod noise;
#[cfg(not(miri))]
mod sensed;
mod settings;
#[cfg(not(miri))]
mod shape;
#[cfg(not(miri))]
mod spheres;
#[cfg(not(miri))]
mod trains;
#[cfg(not(miri))]
mod waveform;
#[cfg(not(miri))]
mod waves;

use bead_model::{Scan, Settings, Window, WindowRecord};
use bead_testing::paper_settings as paper;

/// Window of the first strike, whose first scan has the index `first`, and the record of its samples.
fn replayed(settings: &Settings, first: u64, scans: &[Scan]) -> (Window, Box<WindowRecord>) {
    let (mut window, mut record) = (Window::open(0, first), Box::<WindowRecord>::default());
    record.clear();
    window.process(settings, scans, &mut record);
    (window, record)
}

/// Force code above the zero, `at` samples after the beginning of a pulse of 50 samples.
fn pulse(at: usize, height: f64) -> u16 {
    let phase = std::f64::consts::PI * at.min(50) as f64 / 50.0;
    (height * phase.sin().powi(3)) as u16
}
