//! Versions of the protocol.

/// Version that this crate sends: the first byte of every frame and request. `docs/protocol.md` says what a
/// version stands for. The next one is 4, because 2 and 3 were used up before the first release.
pub const VERSION: u8 = 1;

/// Returns `true` for a version that was used before the first release. Its frames are refused.
pub(crate) const fn is_unreleased(version: u8) -> bool {
    matches!(version, 2 | 3)
}

/// Names the program that reads frames of a version that this one refuses.
pub const fn reader(version: u8) -> &'static str {
    if is_unreleased(version) {
        "`bead` of commit 710832c"
    } else {
        "the program that belongs to it"
    }
}
