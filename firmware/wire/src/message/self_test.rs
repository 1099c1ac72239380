use crate::body::body;
use crate::names::names;

names! {
    /// A check of the self-test. The list may grow at its end.
    pub enum Check {
        /// The supply was between 2.93 and 3.6 V at its last measurement, and is not low now; `value` is the
        /// supply at that measurement, in mV; 0 if there was none.
        0 "supply" Supply,
        /// The code of the force changes and is off the rails; `value` has the force's bits of `standing` in
        /// the health frame.
        1 "force" Force,
        /// The code of the acceleration changes and is off the rails; `value` has the acceleration's bits of
        /// `standing` in the health frame.
        2 "acceleration" Acceleration,
        /// Blocks of samples come; `value` is the number of blocks within 20 ms.
        3 "acquisition" Acquisition,
        /// The settings block in force passes every check again; `value` is its length in bytes.
        4 "settings" Settings,
        /// At least 4 KiB of the stack were never used; `value` is the number of bytes that were never used.
        5 "stack" Stack,
        /// For a known window the estimators give, bit for bit, the results that they gave on the computer
        /// that built the firmware; `value` is the number of results that differ.
        6 "estimators" Estimators,
        /// The settings store in flash can be read; `value` is the length of the block in it, in bytes; 0 if
        /// it is empty.
        7 "store" Store,
    }
}

body! {
    /// The result of one check of a self-test. Each check gives one frame.
    pub struct SelfTest: Copy {
        /// The check.
        pub check: Check,
        /// True if the check passed.
        pub passed: bool,
        /// Value that the check found; the list has its meaning and unit.
        pub value: u32,
    }
}
