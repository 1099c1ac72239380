//! From physical quantities to the settings that a bead measures with.
//!
//! ```
//! use bead_model::design::{Bead, Capture, FrontEnd, derive};
//! let settings = derive(&Bead::paper(), &FrontEnd::reference(), &Capture::default())?;
//! assert_eq!(settings.sample_rate_hz, 100_000);
//! # Ok::<(), bead_model::Violation>(())
//! ```

pub use crate::capture::Capture;
pub use crate::day::Day;
pub use crate::description::{Contact, Description, Host, Supply};
pub use crate::front_end::{FrontEnd, SensorEnds, SensorScale};
pub use crate::physics::{
    Bead, Followers, Intruder, LEAST_WIDTH, Neighbours, SOLITARY_WAVE_ENERGY, Surroundings,
};
pub use crate::relative::Relative;
use crate::settings::Settings;
pub use crate::uncertainty::Uncertainty;
use crate::violation::Violation;

/// Derives the settings of a bead that is alone. It has no name yet, and address 0.
///
/// # Errors
/// As [`Settings::new`].
pub fn derive(bead: &Bead, front_end: &FrontEnd, capture: &Capture) -> Result<Settings, Violation> {
    let alone = Surroundings::default();
    Settings::new(&Description::new(bead, &alone, front_end, capture))
}
