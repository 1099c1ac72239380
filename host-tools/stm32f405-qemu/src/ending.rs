//! The end of a run, with the exceptions and panics on the way.

use std::fmt;

use serde::{Deserialize, Serialize};

/// The end of a run.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum RunEnd {
    /// The stimulus and its tail ended, or the time limit of an image that does not sample.
    #[default]
    Over,
    /// The image executed BKPT outside a panic, as test firmware does at its end.
    Breakpoint(CodeAddress),
    /// The image ended itself by semihosting, with this status.
    Exited(i32),
    /// The image panicked, and nothing resets it.
    Panicked,
    /// The processor does not leave the handler of a fault, and nothing resets it.
    Faulted,
    /// The processor locked up: a fault in the handler of a fault, or no valid reset vector. The program
    /// counter there, if QEMU printed it.
    LockedUp(Option<CodeAddress>),
    /// The image is in an endless loop here, and no interrupt can come.
    Hung(CodeAddress),
    /// The image does nothing but read this register, which no model knows.
    Stuck(String),
    /// The host stopped the run at its time limit.
    Stopped,
    /// QEMU ended by itself, by a signal or by the debugger: its exit status, and its message.
    QemuEnded(String),
}

/// An address in the image's code.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CodeAddress {
    /// The address.
    pub address: u32,
    /// The function around it, if the image has symbols.
    pub function: Option<String>,
}

impl fmt::Display for CodeAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:#010x}", self.address)?;
        let function = self.function.as_ref();
        function.map_or(Ok(()), |function| write!(f, " ({function})"))
    }
}

impl From<u32> for CodeAddress {
    fn from(address: u32) -> Self {
        let function = None;
        Self { address, function }
    }
}

/// An exception of a fault that the processor took: HardFault, MemManage, BusFault or UsageFault.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Exception {
    /// Virtual time, in ns.
    pub at_ns: u64,
    /// Its number, 3 to 6 (ARMv7-M ARM, B1.5.2).
    pub number: u8,
    /// Program counter in the frame on the stack. `None` if there is no frame: the stack itself failed, or it
    /// is the process stack, which the emulator does not read.
    pub pc: Option<CodeAddress>,
    /// The link register in that frame.
    pub lr: Option<CodeAddress>,
    /// CFSR: the cause (B3.2.15).
    pub cfsr: u32,
    /// HFSR.
    pub hfsr: u32,
    /// The data address of the fault, if CFSR marks it as valid.
    pub address: Option<u32>,
    /// Name of the register at that address, if it is in the peripheral region.
    pub register: Option<String>,
    /// The number of the BKPT that the processor executed, without a debugger.
    pub breakpoint: Option<u8>,
}

/// Bits of CFSR and their meaning.
const CAUSES: [(u32, &str); 16] = [
    (0, "the MPU forbids execution there"),
    (1, "the MPU forbids the access"),
    (3, "the MPU forbids the stack at a return"),
    (4, "the MPU forbids the stack at an entry"),
    (8, "no memory to execute from"),
    (9, "no memory at the data's address"),
    (10, "no memory at some data's address"),
    (11, "no memory for the stack at a return"),
    (12, "no memory for the stack at an entry"),
    (16, "an undefined instruction"),
    (17, "a jump to an address without its Thumb bit"),
    (18, "an invalid return from an exception"),
    (19, "the FPU is off"),
    (24, "an unaligned access"),
    (25, "a division by zero"),
    (5, "the MPU forbids the stack of the FPU"),
];

impl Exception {
    fn causes(&self) -> String {
        let set = CAUSES.iter().filter(|(n, _)| self.cfsr >> n & 1 == 1);
        let said: Vec<_> = set.map(|(_, what)| *what).collect();
        match self.breakpoint {
            Some(0xab) => "a semihosting call, which --semihosting (Run::semihosting) allows".into(),
            Some(number) => format!("BKPT {number:#04x} without a debugger"),
            // HFSR.VECTTBL.
            None if self.hfsr >> 1 & 1 == 1 => "no memory for the vector".into(),
            None if said.is_empty() => "no cause in CFSR".into(),
            None => said.join(", "),
        }
    }
}

impl fmt::Display for Exception {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const NAMES: [&str; 4] = ["HardFault", "MemManage", "BusFault", "UsageFault"];
        let name = NAMES[usize::from(self.number.saturating_sub(3)).min(3)];
        let (seconds, causes) = (self.at_ns as f64 * 1e-9, self.causes());
        write!(f, "{name} at {seconds:.6} s: {causes}")?;
        if let Some(address) = self.address {
            write!(f, ", {address:#010x}")?;
        }
        if let Some(register) = &self.register {
            write!(f, " ({register})")?;
        }
        for (name, place) in [("PC", &self.pc), ("LR", &self.lr)] {
            if let Some(place) = place {
                write!(f, "; {name} {place}")?;
            }
        }
        write!(f, "; CFSR {:#010x}, HFSR {:#010x}", self.cfsr, self.hfsr)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exception_says_its_cause_in_words_and_where_it_came() {
        let (address, function) = (0x0800_01a2, Some("main".into()));
        let mut fault = Exception {
            at_ns: 1_200_000,
            number: 3,
            pc: Some(CodeAddress { address, function }),
            lr: None,
            cfsr: 0x8200,
            hfsr: 0x4000_0000,
            address: Some(0xb000_0000),
            register: None,
            breakpoint: None,
        };
        assert_eq!(
            fault.to_string(),
            "HardFault at 0.001200 s: no memory at the data's address, 0xb0000000; PC 0x080001a2 (main); \
             CFSR 0x00008200, HFSR 0x40000000"
        );
        fault.breakpoint = Some(0xab);
        assert!(fault.to_string().contains("Run::semihosting"));
    }
}
