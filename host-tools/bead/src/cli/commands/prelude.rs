//! Names that most commands use.

pub(super) use bead_console::prelude::*;
pub(super) use bead_recording::file::Recording;
pub(super) use bead_recording::strikes::RecordedStrike;
