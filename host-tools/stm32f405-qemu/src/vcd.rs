//! Levels of pins over time as a value change dump (IEEE 1364-2005, section 18) for waveform viewers.

use std::io;

use vcd::{TimescaleUnit, Value, Writer};

use crate::outcome::Outcome;

impl Outcome {
    /// Returns the levels of the output pins over time as a value change dump with steps of 1 ns, for a
    /// viewer such as GTKWave or PulseView. Every pin starts low. The dump has no pins unless the run
    /// recorded them ([`Run::record_pins`](crate::Run::record_pins)).
    pub fn vcd(&self) -> String {
        let mut text = Vec::new();
        self.write_vcd(&mut text)
            .expect("a vector takes any number of bytes");
        String::from_utf8(text).expect("names of pins are ASCII")
    }

    fn write_vcd(&self, text: &mut Vec<u8>) -> io::Result<()> {
        let mut writer = Writer::new(text);
        writer.timescale(1, TimescaleUnit::NS)?;
        writer.add_module("stm32f405")?;
        let mut changes = Vec::new();
        let mut wires = Vec::new();
        for pin in &self.pins {
            let wire = writer.add_wire(1, &pin.name)?;
            wires.push(wire);
            changes.extend(pin.changes.iter().map(|&(at_ns, high)| (at_ns, wire, high)));
        }
        writer.upscope()?;
        writer.enddefinitions()?;
        writer.timestamp(0)?;
        for wire in wires {
            writer.change_scalar(wire, Value::V0)?;
        }
        changes.sort_by_key(|&(at_ns, ..)| at_ns);
        let mut written_ns = 0;
        for (at_ns, wire, high) in changes {
            if at_ns != written_ns {
                writer.timestamp(at_ns)?;
                written_ns = at_ns;
            }
            writer.change_scalar(wire, high)?;
        }
        writer.timestamp(self.virtual_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outcome::Pin;

    #[test]
    fn changes_of_all_pins_stand_in_one_order_of_time() {
        let mut outcome = Outcome::default();
        for (name, changes) in [
            ("PA1", [(0, true), (50, false)]),
            ("PC13", [(20, true), (50, false)]),
        ] {
            let (name, changes) = (name.into(), changes.to_vec());
            outcome.pins.push(Pin {
                name,
                edges: 2,
                changes,
            });
        }
        outcome.virtual_ns = 90;
        assert_eq!(
            outcome.vcd(),
            "$timescale 1 ns $end\n$scope module stm32f405 $end\n$var wire 1 ! PA1 $end\n$var wire 1 \" PC13 $end\n\
             $upscope $end\n$enddefinitions $end\n#0\n0!\n0\"\n1!\n#20\n1\"\n#50\n0!\n0\"\n#90\n"
        );
    }
}
