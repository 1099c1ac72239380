//! The energy that a wave brings to a bead, by its own force.

use bead_recording::strikes::RecordedStrike;

use crate::given::physics;
use crate::signal::StrikeSignals;
use crate::strike::force_railed;

/// The greatest work that the force of a strike does on the host of the reduced chain, J: the energy that
/// came, before echoes carry part of it back. `None` if samples or settings are missing, the force left the
/// range of its sensor, or the chain is under a load, which the reduced chain lacks.
pub fn incident_work(strike: &RecordedStrike) -> Option<f64> {
    let signals = StrikeSignals::of(strike).filter(|_| !force_railed(strike))?;
    let (bead, around) = physics(signals.settings);
    if around.followers.is_some_and(|followers| followers.load > 0.0) {
        return None;
    }
    let works = signals
        .predicted(&bead, &around)
        .into_iter()
        .map(|[_, work]| work);
    Some(works.fold(0.0, f64::max)).filter(|work| *work > 0.0)
}
