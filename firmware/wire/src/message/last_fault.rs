use crate::body::body;
use crate::message::fault::{Detail, FaultCause};

body! {
    /// The last fault that ended a boot. It comes with each identity frame, if there was one since power-up:
    /// a host that was not there when it was told learns of it too.
    pub struct LastFault {
        /// Number of boots since power-up that ended in a fault. What a host did not hear of is the
        /// difference between two such numbers.
        pub faults: u32,
        /// Cause of the fault.
        pub cause: FaultCause,
        /// The boot in which it went wrong.
        pub boot: u32,
        /// Program counter when it went wrong; 0 where it has no meaning.
        pub pc: u32,
        /// One line for people. A longer line is cut between two characters.
        pub detail: Detail,
    }
}
