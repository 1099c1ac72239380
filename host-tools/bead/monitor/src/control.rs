//! Notes and requests from a page to a recording that runs.

use std::sync::mpsc::Sender;

use bead_line::conversation::encoded;
use bead_line::recorder::RecorderOrder;
use bead_recording::file::Note;
use bead_wire::{Key, Request, Ticket};

use crate::model::Monitor;

/// Scans for which a signed request holds: 10 s at 100 kHz.
const HOLDS: u64 = 1_000_000;

/// Parses a note as a person types it; the error says what is accepted.
type NoteParser = Box<dyn Fn(&str) -> Result<Note, String> + Send>;

/// The way from a page to the recorder.
pub struct Control {
    orders: Sender<RecorderOrder>,
    key: Option<Key>,
    note: NoteParser,
}

impl Control {
    /// Sends orders to a recorder. With a key, requests that change a bead's state are signed.
    pub fn new(orders: Sender<RecorderOrder>, key: Option<Key>, note: NoteParser) -> Self {
        Self { orders, key, note }
    }

    /// Writes a note, KEY=VALUE, into the recording.
    ///
    /// # Errors
    /// The text is no note, or the recording has ended.
    pub fn note(&self, text: &str) -> Result<String, String> {
        let note = (self.note)(text)?;
        let line = format!("noted: {}={}", note.key, note.value);
        self.send(RecorderOrder::Note(note)).map(|()| line)
    }

    /// Asks a bead to arm or disarm its detector. Its reply becomes a message of the monitor.
    ///
    /// # Errors
    /// The bead is unknown, or not known well enough to sign the request, or the recording has ended.
    pub fn arm(&self, monitor: &mut Monitor, bead: u8, armed: bool) -> Result<(), String> {
        let known = monitor.bead(bead);
        let known = known.ok_or_else(|| format!("nothing came from bead {bead} yet"))?;
        let signed = match (&self.key, &known.identity, &known.guard) {
            (None, ..) => None,
            (Some(key), Some(identity), Some(guard)) => {
                let ticket = Ticket {
                    counter: guard.counter.saturating_add(1),
                    boot: identity.boot,
                    until: known.sample_index.saturating_add(HOLDS),
                };
                Some((key, identity.uid, ticket))
            }
            _ => {
                return Err(format!(
                    "bead {bead} has not sent its identity and guard frames yet; try again in a second"
                ));
            }
        };
        let (mut request, deed) = if armed {
            (Request::Arm, "arm")
        } else {
            (Request::Disarm, "disarm")
        };
        let number = monitor.ask(bead, deed);
        if let Some((key, uid, ticket)) = signed {
            request = request.signed(key, &uid, bead, number, ticket);
        }
        let bytes = encoded(bead, number, &request);
        self.send(RecorderOrder::Send { bead, bytes })
    }

    fn send(&self, order: RecorderOrder) -> Result<(), String> {
        let ended = |_| "the recording has ended".to_owned();
        self.orders.send(order).map_err(ended)
    }
}
