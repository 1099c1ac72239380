//! Requests that only the owner of a key can make.
//!
//! # Design
//! A signed request carries another one, with a counter, the boot and the last sample index for which it
//! holds, and a code of 128 bits over all of it and over the device id of the bead. The code is
//! SipHash-2-4-128 (Aumasson and Bernstein, "SipHash: a fast short-input PRF", 2012), a keyed function that
//! was made to authenticate short messages, in some 100 instructions for eight bytes and without tables.
//!
//! | kept out | by |
//! |---|---|
//! | a request of somebody without the key, or one that was changed | the code |
//! | one that was made for another bead with the same key | the device id |
//! | one that was done before | the counter, which only grows, also over a power cut |
//! | one that somebody held back | the boot and the sample index |
//!
//! `docs/security.md` says what this is worth.

use core::fmt;
use core::hash::Hasher;

use siphasher::sip128::{Hasher128, SipHasher24};

use crate::message::reply::Outcome;
use crate::request::Request;
use crate::text::Inner;

/// Bytes of a key.
pub const KEY: usize = 16;
/// Bytes of a device id.
const UID: usize = 12;
/// Greatest step of the counter. Without this limit, somebody who forges frames of the bead could make an
/// honest host spend all counters with one request.
pub const AHEAD: u64 = 1 << 16;

/// A secret that a bead and its owner share.
#[derive(Clone, PartialEq, Eq)]
pub struct Key([u8; KEY]);

/// Omits the bytes: they belong in no log.
impl fmt::Debug for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Key")
    }
}

impl Key {
    /// The key with these bytes. Zeros are no key.
    pub fn new(bytes: [u8; KEY]) -> Option<Self> {
        (bytes != [0; KEY]).then_some(Self(bytes))
    }

    /// Its bytes.
    pub const fn bytes(&self) -> &[u8; KEY] {
        &self.0
    }

    fn code(&self, parts: &[&[u8]]) -> [u8; KEY] {
        let mut hasher = SipHasher24::new_with_key(&self.0);
        parts.iter().for_each(|part| hasher.write(part));
        hasher.finish128().as_bytes()
    }

    /// Code of a request with this address and number for the bead `uid`; it carries a request of this kind.
    fn sign(
        &self,
        uid: &[u8; UID],
        address: u8,
        number: u16,
        ticket: Ticket,
        kind: u8,
        body: &[u8],
    ) -> [u8; KEY] {
        let Ticket { counter, boot, until } = ticket;
        self.code(&[
            uid,
            &[address],
            &number.to_le_bytes(),
            &counter.to_le_bytes(),
            &boot.to_le_bytes(),
            &until.to_le_bytes(),
            &[kind],
            body,
        ])
    }

    /// Masks a new key with this one, or unmasks it: a listener without this key does not learn the new one.
    /// Each counter has a different mask. Fewer bytes are hashed for it than for any request.
    fn masked(&self, uid: &[u8; UID], counter: u64, new: [u8; KEY]) -> [u8; KEY] {
        let mask = self.code(&[uid, &counter.to_le_bytes()]);
        core::array::from_fn(|n| new[n] ^ mask[n])
    }
}

/// Limits within which a signed request holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ticket {
    /// Higher than that of every request before, and by [`AHEAD`] at most.
    pub counter: u64,
    /// The boot of the bead.
    pub boot: u32,
    /// The last sample index at which it holds.
    pub until: u64,
}

impl Request {
    /// Returns `true` if the request changes the state of the bead. A bead with a key accepts such a request
    /// only if it is signed.
    pub const fn changes_state(&self) -> bool {
        !matches!(
            self,
            Self::Identity
                | Self::Status
                | Self::ReadSettings
                | Self::SelfTest
                | Self::Raw { .. }
                | Self::ListKept
                | Self::Fetch { .. }
                | Self::Image
        )
    }

    /// The request, signed for the bead with this device id. Address and number are those under which it is
    /// sent.
    pub fn signed(&self, key: &Key, uid: &[u8; UID], address: u8, number: u16, ticket: Ticket) -> Self {
        // There is room for any body.
        let encoded = |request: &Self| Inner::filled_by(|room| request.encode(room).unwrap_or(0));
        let body = match self {
            Self::SetKey { key: new } => encoded(&Self::SetKey {
                key: key.masked(uid, ticket.counter, *new),
            }),
            other => encoded(other),
        };
        let kind = self.number();
        let Ticket { counter, boot, until } = ticket;
        Self::Signed {
            counter,
            boot,
            until,
            kind,
            code: key.sign(uid, address, number, ticket, kind, body.bytes()),
            body,
        }
    }
}

/// The moment at which a request is judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Moment {
    /// The boot of the bead.
    pub boot: u32,
    /// The newest sample index.
    pub index: u64,
}

/// The lock of a bead: it admits requests.
#[derive(Clone, Debug)]
pub struct Lock {
    uid: [u8; UID],
    key: Option<Key>,
    counter: u64,
}

impl Lock {
    /// The lock of the bead with this device id. `counter` is not below that of any request that was let
    /// through before.
    pub const fn new(uid: [u8; UID], key: Option<Key>, counter: u64) -> Self {
        Self { uid, key, counter }
    }

    /// The key, if there is one.
    pub const fn key(&self) -> Option<&Key> {
        self.key.as_ref()
    }

    /// Counter of the last signed request that was let through.
    pub const fn counter(&self) -> u64 {
        self.counter
    }

    /// Replaces the key, or removes it.
    pub fn set(&mut self, key: Option<Key>) {
        self.key = key;
    }

    /// Judges a request. Returns the one that is to be done.
    ///
    /// # Errors
    /// The reason for refusing it.
    pub fn admit(
        &mut self,
        address: u8,
        number: u16,
        request: Request,
        now: Moment,
    ) -> Result<Request, Outcome> {
        let Request::Signed {
            counter,
            boot,
            until,
            kind,
            body,
            code,
        } = request
        else {
            return match self.key {
                Some(_) if request.changes_state() => Err(Outcome::Unsigned),
                _ => Ok(request),
            };
        };
        let key = self.key.as_ref().ok_or(Outcome::NoKey)?;
        let ticket = Ticket { counter, boot, until };
        let expected = key.sign(&self.uid, address, number, ticket, kind, body.bytes());
        if !same(&expected, &code) {
            return Err(Outcome::Forged);
        }
        if counter <= self.counter || counter - self.counter > AHEAD {
            return Err(Outcome::Replayed);
        }
        if boot != now.boot || now.index > until {
            return Err(Outcome::Late);
        }
        let request = match Request::decode(kind, body.bytes()) {
            Ok(Request::Signed { .. }) | Err(_) => return Err(Outcome::Body),
            Ok(Request::SetKey { key: new }) => Request::SetKey {
                key: key.masked(&self.uid, counter, new),
            },
            Ok(other) => other,
        };
        self.counter = counter;
        Ok(request)
    }
}

/// Compares two codes in constant time, so that the time does not reveal where they differ.
fn same(a: &[u8; KEY], b: &[u8; KEY]) -> bool {
    a.iter().zip(b).fold(0, |differs, (a, b)| differs | (a ^ b)) == 0
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test may panic")]

    use super::*;
    use crate::request::ANY;
    use crate::text::{Block, MAX_BLOCK};

    const BEAD: [u8; UID] = *b"this bead id";
    const NOW: Moment = Moment { boot: 3, index: 1000 };
    const TICKET: Ticket = Ticket {
        counter: 8,
        boot: 3,
        until: 1500,
    };

    fn key(byte: u8) -> Key {
        Key::new([byte; KEY]).unwrap()
    }

    fn lock() -> Lock {
        Lock::new(BEAD, Some(key(1)), 7)
    }

    fn signed(request: &Request) -> Request {
        request.signed(&key(1), &BEAD, ANY, 5, TICKET)
    }

    fn admitted(lock: &mut Lock, request: &Request) -> Result<Request, Outcome> {
        lock.admit(ANY, 5, request.clone(), NOW)
    }

    #[test]
    fn the_code_is_that_of_the_reference() {
        // vectors_sip128 of the authors' implementation: key 00 to 0f, message of no byte, of 00, of 00 to
        // 0e.
        let key = Key::new(core::array::from_fn(|n| n as u8)).unwrap();
        let code = |parts: &[&[u8]]| u128::from_be_bytes(key.code(parts));
        assert_eq!(code(&[]), 0xa381_7f04_ba25_a8e6_6df6_7214_c755_0293);
        assert_eq!(code(&[&[0]]), 0xda87_c1d8_6b99_af44_3476_5911_9b22_fc45);
        let message: [u8; 15] = core::array::from_fn(|n| n as u8);
        let whole = code(&[&message]);
        assert_eq!(whole, 0x5493_e999_33b0_a811_7e08_ec0f_97cf_c3d9);
        assert_eq!(code(&[&message[..4], &[], &message[4..]]), whole, "in parts");
    }

    #[test]
    fn a_bead_with_a_key_does_what_is_signed_and_what_changes_nothing() {
        for (request, changes) in [
            (Request::Arm, true),
            (Request::Disarm, true),
            (Request::Reboot, true),
            (Request::EraseSettings, true),
            (Request::Identity, false),
            (Request::Status, false),
            (Request::Raw { duration_ms: 9 }, false),
        ] {
            let open = &mut Lock::new(BEAD, None, 0);
            let done = Ok(request.clone());
            let unsigned = if changes {
                Err(Outcome::Unsigned)
            } else {
                done.clone()
            };
            assert_eq!(admitted(&mut lock(), &request), unsigned);
            assert_eq!(admitted(open, &request), done);
            // A request that changes nothing may be signed too: a host finds out whether its key is the
            // bead's.
            assert_eq!(admitted(&mut lock(), &signed(&request)), done);
            assert_eq!(admitted(open, &signed(&request)), Err(Outcome::NoKey));
        }
    }

    #[test]
    fn whatever_is_changed_in_a_signed_request_it_is_forged() {
        let longest = Request::WriteSettings {
            block: Block::try_from(&[7; MAX_BLOCK][..]).unwrap(),
        };
        let sent = signed(&longest);
        assert_eq!(admitted(&mut lock(), &sent), Ok(longest.clone()));
        let forged = |request: &Request, address, number| {
            let admitted = lock().admit(address, number, request.clone(), NOW);
            assert_eq!(admitted, Err(Outcome::Forged), "{request:?}");
        };
        forged(&sent, 0, 5);
        forged(&sent, ANY, 6);
        forged(&longest.signed(&key(2), &BEAD, ANY, 5, TICKET), ANY, 5);
        forged(&longest.signed(&key(1), b"other beadid", ANY, 5, TICKET), ANY, 5);
        let mut bytes = [0; 512];
        let length = sent.encode(&mut bytes).unwrap();
        for bit in (0..8 * length).step_by(if cfg!(miri) { 97 } else { 1 }) {
            let mut changed = bytes;
            changed[bit / 8] ^= 1 << (bit % 8);
            if let Ok(changed) = Request::decode(sent.number(), &changed[..length]) {
                forged(&changed, ANY, 5);
            }
            if bit / 8 >= length - KEY {
                // Two differences in the code do not cancel each other.
                let other = length - KEY + (bit / 8 + 5) % KEY;
                changed[other] ^= 1 << (bit % 8);
                forged(
                    &Request::decode(sent.number(), &changed[..length]).unwrap(),
                    ANY,
                    5,
                );
            }
        }
    }

    #[test]
    fn a_request_is_done_once_in_its_boot_and_in_its_time() {
        let mut lock = lock();
        for (counter, boot, until, admits, counted) in [
            (8, 3, 1500, Ok(Request::Arm), 8),
            (8, 3, 1500, Err(Outcome::Replayed), 8),
            (7, 3, 1500, Err(Outcome::Replayed), 8),
            (9, 2, 1500, Err(Outcome::Late), 8),
            (9, 3, 999, Err(Outcome::Late), 8),
            (8 + AHEAD + 1, 3, 1500, Err(Outcome::Replayed), 8),
            (8 + AHEAD, 3, 1000, Ok(Request::Arm), 8 + AHEAD),
        ] {
            let ticket = Ticket { counter, boot, until };
            let arm = Request::Arm.signed(&key(1), &BEAD, ANY, 5, ticket);
            assert_eq!(admitted(&mut lock, &arm), admits, "{ticket:?}");
            assert_eq!(lock.counter(), counted);
        }
    }

    #[test]
    fn a_new_key_travels_masked_under_the_old_one() {
        let request = Request::SetKey { key: [0x5A; KEY] };
        let masked = |counter| {
            let sent = request.signed(&key(1), &BEAD, ANY, 5, Ticket { counter, ..TICKET });
            assert_eq!(admitted(&mut lock(), &sent), Ok(request.clone()));
            let Request::Signed { body, .. } = sent else {
                panic!("it is signed");
            };
            body
        };
        assert_ne!(masked(8).bytes(), [0x5A; KEY]);
        assert_ne!(masked(8), masked(9), "another mask");
        assert_eq!(Key::new([0; KEY]), None);
    }

    #[test]
    fn a_signed_request_within_a_signed_one_is_none() {
        let outer = signed(&signed(&Request::Arm));
        assert_eq!(admitted(&mut lock(), &outer), Err(Outcome::Body));
    }

    #[test]
    fn a_lock_takes_another_key_and_tells_it_to_no_log() {
        let mut lock = lock();
        lock.set(Some(key(2)));
        assert_eq!(lock.key(), Some(&key(2)));
        assert_eq!(admitted(&mut lock, &signed(&Request::Arm)), Err(Outcome::Forged));
        let by_the_new = Request::Arm.signed(&key(2), &BEAD, ANY, 5, TICKET);
        assert_eq!(admitted(&mut lock, &by_the_new), Ok(Request::Arm));
        lock.set(None);
        assert_eq!(admitted(&mut lock, &Request::Arm), Ok(Request::Arm));
        assert_eq!(std::format!("{:?}", key(2)), "Key");
    }
}
