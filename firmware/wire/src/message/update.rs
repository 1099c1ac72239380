use crate::body::body;
use crate::names::names;

names! {
    /// The stage of an update that the running image is in. The list may grow at its end.
    pub enum UpdateStage {
        /// Nothing: a probe brought it, or it was confirmed.
        0 "settled" Settled,
        /// The bead waits for another image, and takes no samples.
        1 "receiving" Receiving,
        /// The image came by an update and is on trial. If it passes its self-test, the bead resets once
        /// more and keeps it; else the bead resets and goes back to the image before.
        2 "on_trial" OnTrial,
        /// The image before: the one on trial was not confirmed. If that one ended in a fault, the last
        /// fault has it; without one the bead was reset, or lost its power, before the self-test.
        3 "came_back" CameBack,
    }
}

body! {
    /// The stage of an update. It comes after each board frame, unless the image is settled.
    pub struct Update: Copy {
        /// The stage.
        pub stage: UpdateStage,
    }
}
