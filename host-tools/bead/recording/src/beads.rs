//! Strikes of recordings, gathered bead by bead.

use bead_tables::printable::{count, first_of};

use crate::json::hex;
use crate::strikes::{LeftOut, RecordedStrike};

/// Greatest number of strikes that a line names.
const NAMED: usize = 4;

/// A bead in recordings, with what is gathered of its strikes.
#[derive(Debug)]
pub struct GatheredBead<T> {
    /// Address of the bead.
    pub address: u8,
    uid: Option<[u8; 12]>,
    /// Strikes so far, wanted or not.
    pub seen: usize,
    /// Strikes that were left out.
    pub left_out: Vec<LeftOut>,
    /// Values gathered from its strikes.
    pub gathered: T,
}

impl<T: Default> GatheredBead<T> {
    /// Counts a strike at its bead, which is added if it is new. Returns the place of the bead, and the
    /// number of the strike among those of the bead.
    pub fn count(beads: &mut Vec<Self>, strike: &RecordedStrike) -> (usize, usize) {
        let address = strike.address;
        // A strike may come before the identity of its bead.
        let same = |bead: &Self| {
            let uids = bead.uid.zip(strike.uid);
            bead.address == address && uids.is_none_or(|(one, other)| one == other)
        };
        let place = beads.iter().position(same).unwrap_or_else(|| {
            beads.push(Self {
                address,
                uid: None,
                seen: 0,
                left_out: Vec::new(),
                gathered: T::default(),
            });
            beads.len() - 1
        });
        let bead = &mut beads[place];
        bead.uid = bead.uid.or(strike.uid);
        let number = bead.seen;
        bead.seen += 1;
        (place, number)
    }
}

impl<T> GatheredBead<T> {
    /// Device id, hexadecimal.
    pub fn uid(&self) -> Option<String> {
        self.uid.map(|uid| hex(&uid))
    }
}

impl LeftOut {
    /// A line about the strikes of a bead that were left out; `None` if none was.
    pub fn line(address: u8, left_out: &[Self]) -> Option<String> {
        let named = left_out.iter();
        let named = named.map(|out| format!("{}, strike {}: {}", out.recording, out.strike, out.why));
        (!left_out.is_empty()).then(|| {
            format!(
                "bead {address}: {} left out: {}",
                count(left_out.len() as u64, "strike"),
                first_of(named, NAMED)
            )
        })
    }
}
