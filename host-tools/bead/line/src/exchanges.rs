//! Exchanges of several requests: a self-test, a stream of scans, kept strikes.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use bead_wire::{Check, Kept, Link, Message, Outcome, Raw, Request, SelfTest};

use crate::conversation::{Conversation, LineError};
use bead_recording::assembly::{Assembly, Event};
use bead_recording::frames::Frame;

/// Greatest number of requests for a self-test while parts of the answer are lost.
const TESTS: u32 = 5;
/// Greatest number of raw frames kept: 10 s at four times the sample rate, less than 20 MB.
const PIECES: usize = 1 << 17;
/// Greatest number of requests for the short list of kept strikes while frames are lost.
const LISTS: u32 = 20;
/// Greatest number of requests for a strike whose frames are lost, or while other strikes occupy the line.
const ATTEMPTS: u32 = 5;

/// A stream of all scans.
#[derive(Debug)]
pub struct RawStream {
    /// The scans that came.
    pub pieces: Vec<Raw>,
    /// Number of scans that the bead sent.
    pub sent: u64,
    /// Number of scans that did not fit the line.
    pub dropped: u64,
}

impl Conversation {
    /// Runs the bead's self-test. A lost check may be the one that failed, so the whole test is requested
    /// again.
    ///
    /// # Errors
    /// The bead refuses or does not answer, or a check is lost each time.
    pub fn self_test(&mut self) -> Result<Vec<SelfTest>, LineError> {
        for _ in 0..TESTS {
            let answer = self.request_done(&Request::SelfTest)?;
            // A late answer to a first copy of the request repeats each check; the last one counts.
            let checks = answer.frames.iter().filter_map(|frame| match frame.message {
                Message::SelfTest(test) => Some((test.check.number(), test)),
                _ => None,
            });
            let checks: BTreeMap<u8, SelfTest> = checks.collect();
            if !answer.lost && Check::LIST.iter().all(|(number, ..)| checks.contains_key(number)) {
                return Ok(checks.into_values().collect());
            }
        }
        Err(LineError::Failed(format!(
            "the bead tested itself {TESTS} times, and each time a part of its results was lost on the way; \
             ask again"
        )))
    }

    /// Streams every scan of the bead for `duration`.
    ///
    /// # Errors
    /// The bead refuses, does not answer, or does not say that the stream ended.
    pub fn raw(&mut self, duration: Duration) -> Result<RawStream, LineError> {
        // The identity gives the sample rate, the status the counts since the reset.
        self.request_done(&Request::Identity)?;
        let link = |frame: &Frame| match frame.message {
            Message::Link(link) => Some(link),
            _ => None,
        };
        let before = self.request_done(&Request::Status)?.last("link frame", link)?;
        let duration_ms = u32::try_from(duration.as_millis().max(1)).unwrap_or(u32::MAX);
        let answer = self.request_done(&Request::Raw { duration_ms })?;
        let mut pieces = Vec::new();
        let mut take = |frame: Frame| match frame.message {
            Message::Raw(raw) => {
                // Further scans count as lost.
                if pieces.len() < PIECES {
                    pieces.push(raw);
                }
                None
            }
            // A link frame comes every second, and one at the end of the stream, when all its scans are
            // counted.
            Message::Link(link) => {
                let (sent, dropped) = counted_since(&before, &link);
                let counted = sent.saturating_add(dropped);
                let rate = u64::from(frame.sample_rate_hz.unwrap_or(0));
                let scans = u64::from(duration_ms).saturating_mul(rate) / 1000;
                (counted > 0 && counted >= scans).then_some((sent, dropped))
            }
            _ => None,
        };
        let mut counted = answer.frames.into_iter().find_map(&mut take);
        if counted.is_none() {
            counted = self.listen(duration + Duration::from_secs(3), take)?;
        }
        let Some((sent, dropped)) = counted else {
            let why = "the bead began its raw stream but did not report its end; ask again";
            return Err(LineError::Failed(why.to_owned()));
        };
        Ok(RawStream {
            pieces,
            sent,
            dropped,
        })
    }

    /// Lists the strikes that the bead keeps, the oldest first.
    ///
    /// # Errors
    /// The bead refuses, its firmware keeps no strikes, it does not answer, or a part is lost each time.
    pub fn kept(&mut self) -> Result<Vec<Kept>, LineError> {
        for _ in 0..LISTS {
            let answer = self.request(&Request::ListKept)?;
            match answer.reply.outcome {
                Outcome::Done if answer.lost => continue,
                Outcome::Done => {}
                Outcome::Kind => {
                    let why = "the firmware of this bead keeps no strikes: flash a newer one";
                    return Err(LineError::Refused(why.to_owned()));
                }
                _ => return Err(answer.refusal()),
            }
            // A late answer to a first copy of the request repeats the list.
            let mut named = BTreeSet::new();
            let kept = answer.frames.iter().filter_map(|frame| match frame.message {
                Message::Kept(kept) if named.insert((kept.boot, kept.strike)) => Some(kept),
                _ => None,
            });
            return Ok(kept.collect());
        }
        Err(LineError::Failed(format!(
            "the list of the strikes that the bead keeps did not arrive whole in {LISTS} attempts: is the line \
             noisy?"
        )))
    }

    /// Fetches a kept strike. Returns its frames, each at least once.
    ///
    /// # Errors
    /// The bead refuses, no longer keeps the strike, or does not answer, or a part is lost each time.
    pub fn fetch(&mut self, kept: &Kept) -> Result<Vec<Frame>, LineError> {
        let (boot, strike) = (kept.boot, kept.strike);
        let mut assembly = Assembly::default();
        let mut frames = Vec::new();
        for _ in 0..ATTEMPTS {
            let answer = self.request(&Request::Fetch { boot, strike })?;
            match answer.reply.outcome {
                Outcome::Done | Outcome::Busy => {}
                Outcome::NotKept => {
                    let why = format!(
                        "strike {strike} of boot {boot} has meanwhile been replaced by newer ones: list again"
                    );
                    return Err(LineError::Refused(why));
                }
                _ => return Err(answer.refusal()),
            }
            for frame in answer.frames {
                // Frames of an earlier request may still arrive.
                let is_its = matches!(&frame.message, Message::Fetched(fetched)
                    if (fetched.boot, fetched.strike) == (boot, strike));
                if !is_its {
                    continue;
                }
                let events = assembly.push(&frame);
                frames.push(frame);
                if events.iter().any(|event| matches!(event, Event::Strike(_))) {
                    return Ok(frames);
                }
            }
        }
        Err(LineError::Failed(format!(
            "strike {strike} of boot {boot} did not arrive whole in {ATTEMPTS} attempts: is the line noisy?"
        )))
    }
}

/// The scans of a raw stream that were sent and dropped from one count to a later one. A bead that restarts
/// in between counts from zero again.
fn counted_since(before: &Link, after: &Link) -> (u64, u64) {
    let since = |now: u64, then: u64| now.checked_sub(then).unwrap_or(now);
    let sent = since(after.raw_sent, before.raw_sent);
    (sent, since(after.raw_dropped, before.raw_dropped))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bead_that_starts_anew_in_a_stream_counts_from_zero() {
        let counts = |raw_sent, raw_dropped| Link {
            raw_sent,
            raw_dropped,
            ..Link::default()
        };
        assert_eq!(counted_since(&counts(100, 7), &counts(150, 9)), (50, 2));
        assert_eq!(counted_since(&counts(100, 7), &counts(30, 0)), (30, 0));
    }
}
