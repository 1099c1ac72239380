//! The USARTs' frames on their way: out of the part, in, and over wires.

use super::chip::Chip;
use super::wiring::{self, PinIndex, USARTS};
use crate::given::UartInput;

const NO_TRANSMITTER: &str =
    "CR1.TE: it sends, but no pin is set as its transmitter: nothing leaves the part";

impl Chip {
    /// Takes bytes for the receivers of USARTs. Panics if a port does not exist.
    pub(super) fn feed(&mut self, inputs: &[UartInput]) {
        for input in inputs {
            let usart = USARTS.iter().position(|name| *name == input.port);
            let usart = usart.unwrap_or_else(|| panic!("there is no USART {:?}", input.port));
            self.units.usart[usart].feed(input.at_ns, &input.bytes);
        }
    }

    /// The first of these pins that is set to the alternate function given with it.
    pub(super) fn connected(&self, pins: &[(PinIndex, u32)]) -> Option<PinIndex> {
        let is_set =
            |(pin, function): &&(PinIndex, u32)| self.units.gpio[pin.0].alternate(pin.1) == Some(*function);
        pins.iter().find(is_set).map(|(pin, _)| *pin)
    }

    /// Ends a transmitter's frame, and passes it over wires to receivers. Returns its data if it left the
    /// part by a pin.
    pub(super) fn sent(&mut self, usart: usize, at: u64) -> Option<u16> {
        let frame = self.units.usart[usart].sent()?;
        let Some(pin) = self.connected(wiring::transmitters(usart)) else {
            self.units.usart[usart].notes.note(NO_TRANSMITTER);
            return None;
        };
        let others: Vec<PinIndex> = self.wires.from(pin).collect();
        for to in 0..USARTS.len() {
            let at_wire = self
                .connected(wiring::receivers(to))
                .is_some_and(|pin| others.contains(&pin));
            if at_wire {
                self.units.usart[to].arrive(frame, at);
            }
        }
        Some(frame.data)
    }

    /// A byte from outside has come to a receiver, or its line is idle.
    pub(super) fn received(&mut self, usart: usize, at: u64) {
        let pin = self.connected(wiring::receivers(usart));
        // Another frame may be on its way over a wire.
        let busy = pin.is_some_and(|pin| {
            let mut senders = (0..USARTS.len()).filter(|from| self.units.usart[*from].next_sent().is_some());
            senders.any(|from| {
                let from = self.connected(wiring::transmitters(from));
                from.is_some_and(|from| self.wires.from(from).any(|to| to == pin))
            })
        });
        self.units.usart[usart].receive(at, pin.is_some(), busy);
    }
}
