//! Requests of a host: the bead's decoder, what it writes again, and the lock that a key closes.

use bead_wire::{
    Cause, Key, Lock, MAX_REQUEST, Moment, ReceivedRequest, Request, RequestDecoder, VERSION, encode_request,
};

use crate::line::{covered, mended, runs};

const UID: [u8; 12] = *b"this bead id";
const NOW: Moment = Moment { boot: 3, index: 1000 };

/// Gives the bytes to a bead, as they are and with right checksums.
///
/// # Panics
/// A verdict is not that of the protocol's page, a request does not come back as it was written, or a locked
/// bead carries out an unsigned request.
pub fn check(bytes: &[u8]) {
    read(bytes);
    read(&mended(bytes));
}

/// Judges a run of bytes by docs/protocol.md, without its body: address, number, version.
fn verdict(run: &[u8]) -> Result<(u8, u16, u8), Cause> {
    let covered = covered(run, MAX_REQUEST, 5)?;
    let (&[version, _, low, high, address], _) = covered.split_first_chunk().ok_or(Cause::TooShort)?;
    Ok((address, u16::from_le_bytes([low, high]), version))
}

fn read(bytes: &[u8]) {
    let key = Key::new(*b"a key of 16 byte");
    let (mut open, mut locked) = (Lock::new(UID, None, 0), Lock::new(UID, key, 0));
    let mut decoder = RequestDecoder::new();
    let mut heard = bytes.iter().filter_map(|byte| decoder.push(*byte));
    for run in runs(bytes) {
        let heard = heard.next().expect("a run is heard");
        match (&heard, verdict(run)) {
            (Err(cause), Err(said)) => assert_eq!(*cause, said),
            (Ok(heard), Ok((address, number, version))) => {
                assert_eq!((heard.address, heard.number), (address, number));
                assert!(version == VERSION || heard.request == Err(Cause::Version(version)));
            }
            (heard, said) => panic!("{heard:?}, {said:?}"),
        }
        let Ok(ReceivedRequest {
            address,
            number,
            request: Ok(request),
        }) = heard
        else {
            continue;
        };
        written_again(address, number, &request);
        let is_signed = matches!(request, Request::Signed { .. });
        assert_eq!(
            open.admit(address, number, request.clone(), NOW).is_ok(),
            !is_signed
        );
        let admitted = locked.admit(address, number, request.clone(), NOW);
        // No input has a right code, since nobody made one with the key.
        assert_eq!(
            admitted.is_ok(),
            !is_signed && !request.changes_state(),
            "{request:?}"
        );
    }
    assert!(heard.next().is_none());
    assert_eq!(decoder.counters().bytes, bytes.len() as u64);
}

fn written_again(address: u8, number: u16, request: &Request) {
    let mut buffer = [0; MAX_REQUEST];
    let bytes = encode_request(address, number, request, &mut buffer).expect("a request fits");
    let mut decoder = RequestDecoder::new();
    let heard: Vec<_> = bytes.iter().filter_map(|byte| decoder.push(*byte)).collect();
    let same = ReceivedRequest {
        address,
        number,
        request: Ok(request.clone()),
    };
    assert_eq!(heard, [Ok(same)]);
}
