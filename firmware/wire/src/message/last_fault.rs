use crate::body::body;
use crate::message::fault::{Detail, FaultCause};

body! {
    /// The last fault that ended a boot. It comes with each identity frame, if there was one since power-up:
    /// a host that was not there when it was told learns of it too.
    pub struct LastFault {
        /// Number of boots since power-up that ended in a fault. What a host did not hear of is the
        /// difference between two such numbers.
        pub faults: u32,
        /// What went wrong.
        pub cause: FaultCause,
        /// The boot in which it went wrong.
        pub boot: u32,
        /// Program counter when it went wrong; 0 where it has no meaning.
        pub pc: u32,
        /// One line for people. A longer line is cut between two characters.
        pub detail: Detail,
    }
}

#[cfg(test)]
pub(crate) fn example() -> LastFault {
    LastFault {
        faults: 300,
        cause: FaultCause::Panic,
        boot: 1,
        pc: 0x0800_1234,
        detail: "no samples arrive (watchdog.rs:54)".into(),
    }
}

#[cfg(test)]
pub(crate) const GOLDEN: &str = "000a031602040302010c0b01020a01010407ac022d01b4a48040226e6f2073616d706c65732061727269766520287761746368646f672e72733a3534293bbde0bf00";
