use crate::body::body;
use crate::names::names;

names! {
    /// A check of the self-test. The list may grow at its end.
    pub enum Check {
        /// The supply is between 2.93 and 3.6 V, and was not low since acquisition was started last; `value` is the supply
        /// then, in mV.
        0 "supply" Supply,
        /// The force sensor moves and is off the rails; `value` is its bits of `standing` in the health frame.
        1 "force" Force,
        /// The acceleration sensor moves and is off the rails; `value` is its bits of `standing` in the health frame.
        2 "acceleration" Acceleration,
        /// Blocks of samples come; `value` is how many came within 20 ms.
        3 "acquisition" Acquisition,
        /// The settings block in force passes every check again; `value` is its length in bytes.
        4 "settings" Settings,
        /// 8 KiB of the stack were never used; `value` is how many bytes never were.
        5 "stack" Stack,
        /// The estimators give for a known window, bit for bit, what they gave when the image was built; `value` is how
        /// many of their results differ.
        6 "estimators" Estimators,
        /// The settings store in flash can be read; `value` is the length of the block in it, in bytes, 0 for none.
        7 "store" Store,
    }
}

body! {
    /// The result of one check of a self-test: one for each check.
    pub struct SelfTest: Copy {
        /// What was checked.
        pub check: Check,
        /// Whether the check passed.
        pub passed: bool,
        /// What was found, in the unit of the check.
        pub value: u32,
    }
}

#[cfg(test)]
pub(crate) fn example() -> SelfTest {
    SelfTest {
        check: Check::Stack,
        passed: true,
        value: 80_600,
    }
}

#[cfg(test)]
pub(crate) const GOLDEN: &str = "000a031302040302010c0b01020a01010b070501d8f504fc06d33d00";
