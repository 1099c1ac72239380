//! A made-up window, and the results of the estimators for it.
//!
//! The results on the bead must be the same, bit for bit, as on any other computer: a test on the host
//! compiles this file too, and compares the results with those in `built_in.rs`.

use bead_model::made_up::{MadeUpIntruder, pulse};
use bead_model::{Scan, Settings, Window, WindowRecord};

/// Number of results of a window.
pub(crate) const RESULTS: usize = 8;

/// The results of the estimators for the window with these settings. The contents of `record` do not matter.
/// It takes the bead about 1.5 ms.
pub(crate) fn results(settings: &Settings, record: &mut WindowRecord) -> [i64; RESULTS] {
    let mut window = Window::open(0, 0);
    record.clear();
    let mut scans = [Scan::ZERO; bead_model::layout::PIECE];
    let mut intruder = MadeUpIntruder::default();
    let mut first = 0;
    while first < settings.window.length {
        let count = scans.len().min(usize::from(settings.window.length - first));
        for (scan, at) in scans[..count].iter_mut().zip(first..) {
            let force = REST + noise(at) + pulse(i32::from(at) - i32::from(settings.window.history));
            let acceleration = REST.saturating_add_signed(intruder.step(force - REST)) + noise(!at);
            // The wide channels have a sixteenth of the gain.
            let wide = |code: u16| REST + (code - REST / 2) / 16;
            *scan = Scan::new([force, wide(force), acceleration, wide(acceleration)]);
        }
        window.process(settings, &scans[..count], record);
        first += count as u16;
    }
    let (report, _) = window.report(settings, record);
    [
        report.peak_force.bits().into(),
        report.peak_index as i64,
        report.acceleration_max.bits().into(),
        report.acceleration_min.bits().into(),
        report.absorbed_measured.bits(),
        report.absorbed_predicted.bits(),
        report.incident_energy.bits(),
        report.flags.bits().into(),
    ]
}

/// Code of a channel at rest.
const REST: u16 = 1024;

/// 0 or 1, in an irregular order.
fn noise(at: u16) -> u16 {
    at.wrapping_mul(40503) >> 15
}
