//! Update of a bead's image over the line.
//!
//! # Design
//! A bead that measures judges the manifest and resets; a bead that waits for an image makes room, takes it
//! piece by piece, compares it and resets. Its loader swaps the images, the new one checks itself, and one
//! more reset ends the update. So the host polls until the bead reports that its image is settled, or that
//! the previous one came back.
//!
//! Every request may be repeated, and so may the whole update: after any interruption, run it again.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use bead_update::file::UpdateFile;
use bead_wire::{Board, Identity, MAX_PIECE, Manifest, Message, Outcome, Piece, Request, UpdateStage};

use crate::conversation::{Answer, Conversation, LineError, Signer};

/// Time-out of a bead that makes room, which takes four seconds at most, or checks an image, which takes
/// less.
const WORKS: Duration = Duration::from_secs(10);
/// Time-out of a swap and trial: the bead is silent for ten seconds, some 25 at most, then on trial for two.
const SWAPS: Duration = Duration::from_secs(60);
/// Number of pieces in flight. The bead buffers 1 KiB.
const WINDOW: usize = 2;
/// Number of times that a piece is sent before the bead counts as silent.
const ATTEMPTS: u32 = 5;

/// The image that runs on a bead.
#[derive(Clone, Debug)]
pub struct BeadImage {
    /// Version and commit.
    pub identity: Identity,
    /// The board; `None` for an image that does not report it.
    pub board: Option<Board>,
    /// Stage of its update.
    pub stage: UpdateStage,
}

impl Conversation {
    /// Requests the running image.
    ///
    /// # Errors
    /// The port goes away, or no whole answer comes.
    pub fn image(&mut self) -> Result<BeadImage, LineError> {
        let answer = self.request_done(&Request::Identity)?;
        let identity = answer.last("identity frame", |frame| match &frame.message {
            Message::Identity(identity) => Some(identity.clone()),
            _ => None,
        })?;
        Ok(BeadImage {
            identity,
            board: find(&answer, |message| match message {
                Message::Board(board) => Some(board.clone()),
                _ => None,
            }),
            stage: find(&answer, |message| match message {
                Message::Update(update) => Some(update.stage),
                _ => None,
            })
            .unwrap_or(UpdateStage::Settled),
        })
    }

    /// Sends an image to the bead, and waits until it has settled. `older` lets the bead go back to an older
    /// one. `progress` takes the part of the bytes that have arrived. Returns the image before and the image
    /// now.
    ///
    /// # Errors
    /// The bead refuses the image, the line fails, or the new image did not pass its trial.
    pub fn update(
        &mut self,
        file: &UpdateFile,
        older: bool,
        mut progress: impl FnMut(f64),
    ) -> Result<[BeadImage; 2], LineError> {
        let before = self.image()?;
        self.begin_update(file, older)?;
        self.send_pieces(&file.image, &mut progress)?;
        let finished = self.with_patience(WORKS, |bead| bead.request(&Request::FinishUpdate));
        match finished {
            Ok(answer) if answer.reply.outcome == Outcome::Done => {}
            // The reply to the first copy was lost, and the bead has begun to swap.
            Ok(answer) if self.image()?.stage == UpdateStage::Receiving => return Err(answer.refusal()),
            Ok(_) | Err(LineError::Failed(_)) => {}
            Err(error) => return Err(error),
        }
        let after = self.settled()?;
        Ok([before, after])
    }

    /// Makes the bead wait for this image, with room for it.
    fn begin_update(&mut self, file: &UpdateFile, older: bool) -> Result<(), LineError> {
        let manifest = Manifest::try_from(&file.manifest[..]);
        let manifest = manifest.map_err(|error| LineError::Failed(error.to_string()))?;
        let request = Request::BeginUpdate { manifest, older };
        // The first request resets a bead that measures; so does a second one if the first reply was lost.
        for _ in 0..3 {
            let waits = self.image()?.stage == UpdateStage::Receiving;
            let answer = self.with_patience(WORKS, |bead| bead.request(&request))?;
            match answer.reply.outcome {
                Outcome::Done if waits => return Ok(()),
                Outcome::Done => drop(self.await_boot()?),
                Outcome::Kind => {
                    let why = "the firmware of this bead takes no image over its line; flash it once with \
                               --probe or --rom";
                    return Err(LineError::Refused(why.to_owned()));
                }
                _ => return Err(answer.refusal()),
            }
        }
        let why = "the bead resets but then does not wait for an image; is its supply good?";
        Err(LineError::Failed(why.to_owned()))
    }

    /// Sends the image in pieces, some at a time, each until the bead has it.
    fn send_pieces(&mut self, image: &[u8], progress: &mut impl FnMut(f64)) -> Result<(), LineError> {
        let mut waiting = image.chunks(MAX_PIECE).enumerate();
        let all = waiting.len();
        let mut sent: VecDeque<SentPiece> = VecDeque::new();
        let mut signer = self.piece_signer()?;
        let mut arrived = 0;
        while arrived < all {
            while sent.len() < WINDOW
                && let Some((place, bytes)) = waiting.next()
            {
                let bytes = Piece::try_from(bytes);
                let mut piece = SentPiece {
                    request: Request::UpdateData {
                        offset: (place * MAX_PIECE) as u32,
                        bytes: bytes.map_err(|error| LineError::Failed(error.to_string()))?,
                    },
                    number: self.next_number(),
                    attempts: 0,
                    at: Instant::now(),
                };
                self.send_piece(&mut piece, signer.as_mut())?;
                sent.push_back(piece);
            }
            let patience = self.patience();
            let overdue = sent.front().map_or(patience, |first| {
                let left = patience.saturating_sub(first.at.elapsed());
                left.max(Duration::from_millis(1))
            });
            let reply = self.listen(overdue, |frame| match frame.message {
                Message::Reply(reply) if sent.iter().any(|piece| piece.number == reply.request) => {
                    Some(reply)
                }
                _ => None,
            })?;
            let of_first = sent.front().map_or(0, |first| first.number);
            let number = reply.as_ref().map_or(of_first, |reply| reply.request);
            let place = sent.iter().position(|piece| piece.number == number);
            let Some(mut piece) = place.and_then(|place| sent.remove(place)) else {
                continue;
            };
            match reply {
                Some(reply) if reply.outcome == Outcome::Done => {
                    arrived += 1;
                    progress(arrived as f64 / all as f64);
                    continue;
                }
                // A piece that overtook another, or was late on a slow line.
                Some(reply) if matches!(reply.outcome, Outcome::Replayed | Outcome::Late) => {
                    signer = self.piece_signer()?;
                }
                Some(reply) => return Err(self.refused(&reply)),
                None => {}
            }
            // The bead does one request at a time: if the oldest has no reply, it or its reply is lost. The
            // request is sent again under the same number, so that a late reply counts.
            if piece.attempts == ATTEMPTS {
                return Err(self.broken_off(arrived, all));
            }
            self.send_piece(&mut piece, signer.as_mut())?;
            sent.push_back(piece);
        }
        Ok(())
    }

    fn broken_off(&self, arrived: usize, all: usize) -> LineError {
        let percent = 100 * arrived / all;
        LineError::Failed(format!(
            "the bead fell silent after {percent} % of the image; the previous image still runs: check the \
             line, and run the same command again"
        ))
    }

    /// Waits until the running image is settled or was replaced by the previous one.
    fn settled(&mut self) -> Result<BeadImage, LineError> {
        let deadline = Instant::now() + SWAPS;
        self.forget_identity();
        loop {
            let found = self.image();
            match found {
                Ok(image) if image.stage == UpdateStage::Settled => return Ok(image),
                Ok(image) if image.stage == UpdateStage::CameBack => return Err(self.came_back(&image)?),
                Ok(_) => {}
                Err(error) if Instant::now() > deadline => {
                    let LineError::Failed(why) = error else {
                        return Err(error);
                    };
                    return Err(LineError::Failed(format!(
                        "the whole image arrived, but the bead has not come back within {} s: {why}; switch it \
                         off and on: it continues where it stopped",
                        SWAPS.as_secs()
                    )));
                }
                // The bead is swapping images.
                Err(LineError::Failed(_)) => {}
                Err(error) => return Err(error),
            }
            if Instant::now() > deadline {
                let why = "the new image does not end its trial; switch the bead off and on to return to the \
                           previous image, and check its supply";
                return Err(LineError::Failed(why.to_owned()));
            }
            self.listen(Duration::from_millis(300), |_| None::<()>)?;
        }
    }

    /// The error for an image that did not pass its trial: the last fault comes every second, if there is
    /// one.
    fn came_back(&mut self, image: &BeadImage) -> Result<LineError, LineError> {
        // The trial was the boot before this one.
        let trial = image.identity.boot.wrapping_sub(1);
        let last = self.listen(Duration::from_millis(1500), |frame| match frame.message {
            Message::LastFault(last) if last.boot == trial => Some(last),
            _ => None,
        })?;
        let why = match last {
            Some(last) => format!("{}: {}", last.cause, last.detail),
            None => "it was reset, or lost its power, before its self-test".to_owned(),
        };
        Ok(LineError::Refused(format!(
            "the new image did not pass its trial, and {} ({}) runs as before; {why}",
            image.identity.firmware, image.identity.git
        )))
    }

    /// Sends a piece, signed if there is a key.
    fn send_piece(&mut self, piece: &mut SentPiece, signer: Option<&mut Signer>) -> Result<(), LineError> {
        self.send(piece.number, &piece.request, signer)?;
        piece.attempts += 1;
        piece.at = Instant::now();
        Ok(())
    }

    /// A signer of many requests, one after the other; `None` without a key.
    fn piece_signer(&mut self) -> Result<Option<Signer>, LineError> {
        /// Validity of a signed piece.
        const HOLDS: Duration = Duration::from_secs(600);
        let Some(key) = self.key() else { return Ok(None) };
        self.forget_identity();
        self.signer(&key, HOLDS).map(Some)
    }
}

/// A piece on its way.
struct SentPiece {
    request: Request,
    number: u16,
    attempts: u32,
    /// Time of the last attempt.
    at: Instant,
}

fn find<T>(answer: &Answer, wanted: impl Fn(&Message) -> Option<T>) -> Option<T> {
    answer
        .frames
        .iter()
        .rev()
        .find_map(|frame| wanted(&frame.message))
}
