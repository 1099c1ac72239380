//! Levels of pins over time, as a value change dump (IEEE 1364-2005, section 18): what logic analysers and
//! waveform viewers read.

use std::fmt::Write;

use crate::outcome::{Outcome, Pin};

impl Outcome {
    /// The levels of the output pins over time, as a value change dump with steps of 1 ns, for a viewer such
    /// as GTKWave or PulseView. Every pin is low at first. It has nothing in it unless the run was told to
    /// record them ([`Run::record_pins`](crate::Run::record_pins)).
    pub fn vcd(&self) -> String {
        let mut text = String::from("$timescale 1 ns $end\n$scope module stm32f405 $end\n");
        let mut say = |line: std::fmt::Arguments<'_>| text.write_fmt(line).expect("a string takes any text");
        for (number, pin) in self.pins.iter().enumerate() {
            say(format_args!("$var wire 1 {} {} $end\n", code(number), pin.name));
        }
        say(format_args!("$upscope $end\n$enddefinitions $end\n#0\n"));
        for number in 0..self.pins.len() {
            say(format_args!("0{}\n", code(number)));
        }
        let mut told_ns = 0;
        for (at_ns, number, high) in in_order(&self.pins) {
            if at_ns != told_ns {
                say(format_args!("#{at_ns}\n"));
                told_ns = at_ns;
            }
            say(format_args!("{}{}\n", u8::from(high), code(number)));
        }
        say(format_args!("#{}\n", self.virtual_ns));
        text
    }
}

/// All changes in the order of their times: time, number of the pin, new level.
fn in_order(pins: &[Pin]) -> Vec<(u64, usize, bool)> {
    let of_pin = |(number, pin): (usize, &Pin)| {
        let changes = pin
            .changes
            .iter()
            .map(move |(at_ns, high)| (*at_ns, number, *high));
        changes.collect::<Vec<_>>()
    };
    let mut changes: Vec<_> = pins.iter().enumerate().flat_map(of_pin).collect();
    changes.sort_by_key(|(at_ns, _, _)| *at_ns);
    changes
}

/// The short name of a signal: a printable character, or two.
fn code(number: usize) -> String {
    /// From `!` on.
    const CHARACTERS: usize = 94;
    let character = |n: usize| char::from(b'!' + (n % CHARACTERS) as u8);
    match number / CHARACTERS {
        0 => character(number).into(),
        more => [character(more - 1), character(number)].iter().collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_of_all_pins_stand_in_one_order_of_time() {
        let pin = |name: &str, changes: &[(u64, bool)]| Pin {
            name: name.into(),
            edges: changes.len() as u64,
            changes: changes.to_vec(),
        };
        let outcome = Outcome {
            pins: vec![
                pin("PA1", &[(0, true), (50, false)]),
                pin("PC13", &[(20, true), (50, false)]),
            ],
            virtual_ns: 90,
            ..Outcome::default()
        };
        assert_eq!(
            outcome.vcd(),
            "$timescale 1 ns $end\n$scope module stm32f405 $end\n$var wire 1 ! PA1 $end\n$var wire 1 \" PC13 $end\n\
             $upscope $end\n$enddefinitions $end\n#0\n0!\n0\"\n1!\n#20\n1\"\n#50\n0!\n0\"\n#90\n"
        );
        let codes: std::collections::BTreeSet<_> = (0..144).map(code).collect();
        assert_eq!(codes.len(), 144, "each pin of the part has its own");
    }
}
