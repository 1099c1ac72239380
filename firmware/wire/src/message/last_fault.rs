use crate::body::body;
use crate::message::fault::{Detail, FaultCause};

body! {
    /// The last fault that ended a boot. If there was one since power-up, it follows each identity frame, so
    /// that a host that connects later learns of it too.
    pub struct LastFault {
        /// Number of boots since power-up that ended in a fault. A host has missed one if the difference
        /// between two such numbers is above 1.
        pub faults: u32,
        /// Cause of the fault.
        pub cause: FaultCause,
        /// The boot that it ended.
        pub boot: u32,
        /// Program counter when it went wrong; 0 where it has no meaning.
        pub pc: u32,
        /// One line for people. A longer line is cut between two characters.
        pub detail: Detail,
    }
}
