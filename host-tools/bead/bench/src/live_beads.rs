//! Emulated beads of one chain, each behind a socket, for programs that listen to live beads.
//!
//! # Design
//! Each bead is an image in its own QEMU, whose time follows this computer's. All feel one strike, again
//! and again. Their crystals are exact and they start together: codes repeat after a number of scans, so
//! with different crystals the strikes would drift apart. Edges at their sync inputs come every
//! `SYNC_EVERY` for an hour. The beads share a pace: when a busy computer delays one, all wait for it.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use hertz_chain::Scenario;
use tempfile::TempDir;

use crate::bridge::{self, Bridge, Door, Pace};
use crate::emulation::{Emulation, Placed};
use crate::error::BenchError;
use crate::several::{self, Crystals};
use bead_compare::front_end::AnalogFrontEnd;
use bead_compare::sensed::{Timing, simulate_with_ring_down};
use bead_line::port::Address;
use bead_model::design::Uncertainty;

/// Interval of the edges at the sync inputs, and the time until which they come, s.
const SYNC_EVERY: f64 = 0.1;
const SYNC_FOR: f64 = 3600.0;
/// Quiet time before the strike, s, in which the image starts and arms its detector.
const LEAD_IN: f64 = 0.05;

/// Beads that wait at their addresses.
pub struct LiveBeads {
    beads: Vec<(Emulation, Door, Address)>,
    pace: f64,
    /// Folder of the sockets, with a unique name. Dropping it removes it.
    _sockets: TempDir,
}

impl LiveBeads {
    /// Puts beads at these places of a chain, each behind a socket in a folder for temporary files. Their
    /// settings state these uncertainties, if any. `seed` is the seed of the noise; `None` without noise.
    ///
    /// # Errors
    /// A bead has no intruder, no settings fit it, or its socket cannot be made.
    pub fn open(
        scenario: &Scenario,
        front_end: &AnalogFrontEnd,
        beads: &[usize],
        uncertainty: Option<Uncertainty>,
        seed: Option<u64>,
        image: &Path,
    ) -> Result<Self, BenchError> {
        let solution = simulate_with_ring_down(scenario)?;
        let timing = Timing::once(LEAD_IN);
        let placed = several::placed(
            beads,
            &Crystals::Each(vec![0.0]),
            0.0,
            seed.unwrap_or(0),
            seed.is_some(),
        )?;
        let sockets = tempfile::Builder::new().prefix("bead-").tempdir();
        let sockets =
            sockets.map_err(|error| BenchError::unfit("cannot make a folder for sockets", error))?;
        let open = placed.into_iter().map(|placed| {
            let placed = Placed {
                uncertainty,
                ..placed
            };
            let mut emulation = Emulation::place(scenario, &solution, placed, front_end, timing, image)?;
            emulation.sync_until((1..).map(|number| f64::from(number) * SYNC_EVERY), SYNC_FOR);
            let address = Address::Unix(sockets.path().join(format!("{}.sock", placed.address)));
            Ok((emulation, Door::open(&address)?, address))
        });
        Ok(Self {
            beads: open.collect::<Result<_, BenchError>>()?,
            pace: 1.0,
            _sockets: sockets,
        })
    }

    /// Sets the pace: seconds of the beads per second of this computer.
    #[must_use]
    pub fn with_pace(self, pace: f64) -> Self {
        Self { pace, ..self }
    }

    /// The addresses of the beads, in the order of their places.
    pub fn addresses(&self) -> impl Iterator<Item = &Address> {
        self.beads.iter().map(|(_, _, address)| address)
    }

    /// Runs the beads until `stop`. A bead that fails does not stop the others; `note` takes a line about
    /// it.
    pub fn serve(&self, stop: &AtomicBool, note: &(dyn Fn(String) + Sync)) {
        // With a shared pace, even on a busy computer the wave reaches the beads as it does in the chain.
        let pace = &Pace::new(self.pace);
        thread::scope(|scope| {
            for (emulation, door, _) in &self.beads {
                scope.spawn(move || {
                    let serve =
                        || bridge::serve(&mut Bridge::new(emulation, Some(pace.clone()))?, door, stop);
                    if let Err(error) = serve()
                        && !stop.load(Ordering::Relaxed)
                    {
                        note(format!("emulated bead {}: {error}", emulation.truth.bead));
                    }
                });
            }
        });
    }
}
