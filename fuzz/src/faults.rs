//! Scripts of faults in TOML, provoked in a run that is not begun.

use bead_bench::faults::{parse, provoke};
use bead_compare::front_end::AnalogFrontEnd;
use stm32f405_qemu::Run;

use crate::text;

/// Reads the bytes as a script.
///
/// # Panics
/// A fault that was accepted cannot be provoked, or has no time.
pub fn check(bytes: &[u8]) {
    let Some(faults) = text::read(bytes, |text| parse(text, "a.toml")) else {
        return;
    };
    let mut run = Run::new("no-image");
    run.stimulus = vec![[1, 2, 3, 4]; 1000];
    for fault in &faults {
        assert!(fault.reported_within() >= 0.0 && fault.reported_within().is_finite());
    }
    provoke(&faults, &AnalogFrontEnd::default(), &mut run);
    assert_eq!(run.stimulus.len(), 1000);
}
