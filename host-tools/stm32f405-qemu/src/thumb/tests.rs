//! Loops made at random, executed turn by turn and with turns that are counted at once.

use super::{Bus, HandBack, Interpreter, Loaded, Registers, Stored};
use crate::ramp::Ramp;

/// Addresses of counters: one goes up over 32 bits, one down over 24, one up over 16.
const COUNTERS: u32 = 0x4000_0000;
const RATES: [u64; 3] = [168_000_000, 21_000_000, 84_000_000 / 7];
const NS_PER_S: u64 = 1_000_000_000;
/// Ends a program: the interpreter does not know it.
const BREAKPOINT: u16 = 0xbe00;

/// Code at 0, and counters that began at some values.
struct Machine {
    code: Vec<u16>,
    began: [u64; 3],
    tells_ramps: bool,
}

impl Bus for Machine {
    fn fetch(&mut self, address: u32) -> Option<u16> {
        self.code.get(address as usize / 2).copied()
    }

    fn load(&mut self, address: u32, _bytes: u32, now: u64) -> Option<Loaded> {
        const SIZES: [u64; 3] = [1 << 32, 1 << 24, 1 << 16];
        let n = (address.checked_sub(COUNTERS)? / 4) as usize;
        let (hz, size) = (*RATES.get(n)?, SIZES[n]);
        let ticks = self.began[n] + now * hz / NS_PER_S;
        let falls = n == 1;
        let up = ticks % size;
        let overflow = (ticks / size + 1) * size - self.began[n];
        let ramp = Ramp {
            hz: hz as u32,
            falls,
            until_ns: (overflow * NS_PER_S).div_ceil(hz),
        };
        Some(Loaded {
            value: if falls { size - 1 - up } else { up } as u32,
            holds_until: now,
            ramp: Some(ramp).filter(|_| self.tells_ramps),
        })
    }

    fn is_memory(&self, _address: u32) -> bool {
        false
    }

    fn accepts(&self, _address: u32, _bytes: u32, _now: u64) -> bool {
        false
    }

    fn store(&mut self, _address: u32, _bytes: u32, _value: u32, _now: u64) -> Stored {
        Stored::QUIETLY
    }

    fn keep(&mut self) {}

    fn is_as_kept(&self) -> bool {
        true
    }
}

struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 >> 16
    }

    fn below(&mut self, limit: u16) -> u16 {
        (self.next() % u64::from(limit)) as u16
    }

    /// R0 to R2 have the addresses, R3 to R5 are written, R6 and R7 stay.
    fn written(&mut self) -> u16 {
        3 + self.below(3)
    }

    fn value(&mut self) -> u16 {
        3 + self.below(5)
    }

    /// A loop that begins with the read of a counter and may end at some conditions.
    fn program(&mut self) -> Vec<u16> {
        match self.below(8) {
            0 => self.overflow_of_bits(),
            1 => self.carry_of_comparison(),
            _ => self.any(),
        }
    }

    /// Ends when the lowest bits of a counter, plus a number, have passed R6.
    fn overflow_of_bits(&mut self) -> Vec<u16> {
        vec![
            0x6800 | self.below(3) << 3 | 3,
            0x4000 | 7 << 3 | 3,
            0x3000 | 3 << 8 | self.below(256),
            0x4280 | 6 << 3 | 3,
            0xd000 | self.below(14) << 8,
            0xe7f9,
            BREAKPOINT,
        ]
    }

    /// Ends on the carry of a comparison, which is copied to a register.
    fn carry_of_comparison(&mut self) -> Vec<u16> {
        vec![
            0x6800 | self.below(3) << 3 | 3,
            0x4280 | 6 << 3 | 3,
            0x2000 | 4 << 8,
            0x4140 | 4 << 3 | 4,
            0x2800 | 4 << 8 | 1,
            0xd000 | self.below(2) << 8,
            0xe7f8,
            BREAKPOINT,
        ]
    }

    fn any(&mut self) -> Vec<u16> {
        let length = 3 + self.below(7);
        let mut code = vec![0x6800 | self.below(3) << 3 | 3];
        for at in 1..length {
            let (to, a, b) = (self.written(), self.value(), self.value());
            code.push(match self.below(18) {
                0 => 0x6800 | self.below(3) << 3 | to,
                1 | 2 => 0x1a00 | b << 6 | a << 3 | to,
                3 => 0x1800 | b << 6 | a << 3 | to,
                4 => 0x4000 | b << 3 | to,
                5 => 0x4380 | b << 3 | to,
                6 => self.below(9) << 6 | a << 3 | to,
                7 => 0x4600 | a << 3 | to,
                8 => 0xb280 | a << 3 | to,
                9 => 0x4240 | a << 3 | to,
                10 => 0x43c0 | a << 3 | to,
                11 => 0x3000 | to << 8 | self.below(64),
                12 => 0x4140 | a << 3 | to,
                13 => 0x4180 | a << 3 | to,
                14 => 0x4000 | 7 << 3 | to,
                15 => 0x4280 | 7 << 3 | a,
                16 => 0xbf08 | self.below(14) << 4,
                _ => 0xd000 | self.below(14) << 8 | (length - at + 2),
            });
        }
        code.extend([
            0x4280 | 6 << 3 | self.written(),
            // To the end, or to the head.
            0xd000 | self.below(14) << 8,
            0xe000 | 0x7ff & (0u16.wrapping_sub(length + 4)),
            BREAKPOINT,
            BREAKPOINT,
        ]);
        code
    }
}

#[test]
fn counted_turns_leave_the_registers_and_times_of_executed_ones() {
    let mut random = Random(7);
    let (mut executed, mut stepped) = (0, 0);
    for round in 0..3000 {
        let code = random.program();
        let began = [
            random.next() >> 16,
            random.next() & 0xff_ffff,
            random.next() & 0xffff,
        ];
        let mut registers = Registers::default();
        for n in 0..8 {
            registers.r[n] = match n {
                0..3 => COUNTERS + 4 * n as u32,
                _ => random.next() as u32 >> random.below(32),
            };
        }
        if round % 2 == 0 {
            registers.r[7] = u32::MAX >> random.below(31);
        }
        // Near the value of a counter or of its lowest bits, so that the loop ends now and then.
        registers.r[6] = match round % 4 {
            0 => random.next() as u32 & registers.r[7],
            _ => (began[0] as u32).wrapping_add(random.below(50_000).into()),
        };
        let until = 100_000 + random.next() % 200_000;
        let [slow, quick] = [false, true].map(|tells_ramps| {
            let mut machine = Machine {
                code: code.clone(),
                began,
                tells_ramps,
            };
            let mut interpreter = Interpreter::new(registers, 0, 8, None, &mut machine);
            let steps = interpreter.run(until, 1 << 20);
            let counts: Vec<_> = interpreter.executed().collect();
            let state = (
                interpreter.registers(),
                interpreter.now(),
                interpreter.instructions,
            );
            (steps, state, counts)
        });
        assert_eq!(slow.1, quick.1, "round {round}: {code:04x?} from {registers:x?}");
        assert_eq!(slow.2, quick.2, "round {round}: {code:04x?} from {registers:x?}");
        executed += slow.0;
        stepped += quick.0;
    }
    assert!(stepped < executed * 3 / 4, "{stepped} of {executed} one by one");
}

/// A handler at 0 that exchanges two words, and whose interrupt stays up.
struct Storm {
    words: [u32; 2],
    kept: Option<[u32; 2]>,
    keeps: bool,
}

impl Storm {
    const WORDS: u32 = 0x2000_0000;
    /// LDR R0, \[R1\]; LDR R2, \[R1, #4\]; STR R0, \[R1, #4\]; STR R2, \[R1\]; BX LR.
    const HANDLER: [u16; 5] = [0x6808, 0x684a, 0x6048, 0x600a, 0x4770];
    const LINK: u32 = 0xffff_fff9;

    fn new(keeps: bool) -> Self {
        Self {
            words: [7, 9],
            kept: None,
            keeps,
        }
    }

    /// At the entry to the handler of line 37.
    fn registers() -> Registers {
        let mut registers = Registers {
            xpsr: 16 + 37,
            ..Registers::default()
        };
        (registers.r[1], registers.r[14]) = (Self::WORDS, Self::LINK);
        registers
    }
}

impl Bus for Storm {
    fn fetch(&mut self, address: u32) -> Option<u16> {
        Self::HANDLER.get(address as usize / 2).copied()
    }

    fn load(&mut self, address: u32, _bytes: u32, _now: u64) -> Option<Loaded> {
        Some(Loaded {
            value: self.words[(address - Self::WORDS) as usize / 4],
            holds_until: u64::MAX,
            ramp: None,
        })
    }

    fn is_memory(&self, _address: u32) -> bool {
        true
    }

    fn accepts(&self, _address: u32, _bytes: u32, _now: u64) -> bool {
        true
    }

    fn store(&mut self, address: u32, _bytes: u32, value: u32, _now: u64) -> Stored {
        self.words[(address - Self::WORDS) as usize / 4] = value;
        Stored::QUIETLY
    }

    fn keep(&mut self) {
        self.kept = Some(self.words).filter(|_| self.keeps);
    }

    fn is_as_kept(&self) -> bool {
        self.kept == Some(self.words)
    }

    fn enters_again(&self, exception: u32) -> Option<u32> {
        (exception == 16 + 37).then_some(0)
    }
}

#[test]
fn a_handler_that_is_entered_again_is_followed_from_its_entry_and_its_turns_are_counted() {
    for until in [1_000, 100_001, 100_047] {
        let [slow, quick] = [false, true].map(|keeps| {
            let mut storm = Storm::new(keeps);
            let mut interpreter = Interpreter::new(Storm::registers(), 0, 8, Some(Storm::LINK), &mut storm);
            let steps = interpreter.run(until, 1 << 20);
            assert!(!interpreter.endless, "an interrupt stays up");
            let counts: Vec<_> = interpreter.executed().collect();
            let state = (
                interpreter.registers(),
                interpreter.now(),
                interpreter.instructions,
            );
            (steps, (state, counts, storm.words))
        });
        assert_eq!(slow.1, quick.1);
        assert_eq!(slow.0, until.div_ceil(8));
        assert!(quick.0 < 100, "{} one by one", quick.0);
    }
}

#[test]
fn a_handler_of_which_the_entry_is_not_known_is_left_to_the_processor() {
    for entered_with in [None, Some(0xffff_fff1)] {
        let mut storm = Storm::new(true);
        let mut interpreter = Interpreter::new(Storm::registers(), 0, 8, entered_with, &mut storm);
        interpreter.run(1_000, 1 << 20);
        assert_eq!(interpreter.instructions, 4);
        assert_eq!(interpreter.hands_back, Some(HandBack::Return));
        assert_eq!(interpreter.registers().r[15], 8);
    }
}
