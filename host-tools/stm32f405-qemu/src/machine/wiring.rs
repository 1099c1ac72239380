//! Wiring of the peripherals to each other and to the pins.
//!
//! Pins and DMA requests are read from `connections.txt`. `tests/all/tables.rs` makes it from ST's own
//! database (by way of the crate `stm32-metapac`) and checks it against that. Triggers are in no such
//! database, and are listed here.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::LazyLock;

use crate::chip::{Chip, NewRequest, new_functions, new_requests};

const TABLE: &str = include_str!("connections.txt");

/// A pin: port (A is 0) and number.
pub(crate) type PinIndex = (usize, usize);

/// Pins of a signal, each with its alternate function.
type SignalPins = &'static [(PinIndex, u32)];

/// Number of a timer's model: TIM1 is 0.
pub(super) type TimNumber = usize;

/// The USARTs in the order of their models.
pub(crate) const USARTS: [&str; 6] = ["USART1", "USART2", "USART3", "UART4", "UART5", "USART6"];
/// The I2C and SPI controllers in the order of their models.
pub(crate) const I2CS: [&str; 3] = ["I2C1", "I2C2", "I2C3"];
pub(crate) const SPIS: [&str; 3] = ["SPI1", "SPI2", "SPI3"];
/// The converters in the order of their models.
pub(super) const ADCS: [&str; 3] = ["ADC1", "ADC2", "ADC3"];

/// The DAC's requests in the order of its channels, and the pins of its outputs (section 14.2).
const DAC_REQUESTS: [&str; 2] = ["DAC1_CH1", "DAC1_CH2"];
pub(super) const OUTPUTS: [PinIndex; 2] = [(0, 4), (0, 5)];

/// Requests of a timer by the number of their flags in SR.
pub(super) const TIMER_REQUESTS: [&str; 7] = ["UP", "CH1", "CH2", "CH3", "CH4", "-", "TRIG"];

/// ADC1's channel of the internal reference voltage and of a part of the battery voltage (sections 13.10,
/// 13.11).
pub(super) const REFERENCE: u32 = 17;
pub(super) const BATTERY: u32 = 18;

/// The timers whose TRGO are ITR0 to ITR3 of a timer: tables 75, 93 and 98, TIM1 and TIM8 in section 17.4.3.
/// TIM9 and TIM12 have OC outputs as ITR2 and ITR3, which are not modelled.
const MASTERS: [(TimNumber, [Option<TimNumber>; 4]); 8] = [
    (tim(1), [Some(tim(5)), Some(tim(2)), Some(tim(3)), Some(tim(4))]),
    (tim(2), [Some(tim(1)), Some(tim(8)), Some(tim(3)), Some(tim(4))]),
    (tim(3), [Some(tim(1)), Some(tim(2)), Some(tim(5)), Some(tim(4))]),
    (tim(4), [Some(tim(1)), Some(tim(2)), Some(tim(3)), Some(tim(8))]),
    (tim(5), [Some(tim(2)), Some(tim(3)), Some(tim(4)), Some(tim(8))]),
    (tim(8), [Some(tim(1)), Some(tim(2)), Some(tim(4)), Some(tim(5))]),
    (tim(9), [Some(tim(2)), Some(tim(3)), None, None]),
    (tim(12), [Some(tim(4)), Some(tim(5)), None, None]),
];

const fn tim(number: usize) -> TimNumber {
    number - 1
}

/// The timer whose TRGO is the internal trigger `itr` of a timer.
pub(super) fn master(of: TimNumber, itr: u32) -> Option<TimNumber> {
    let (_, masters) = MASTERS.iter().find(|(slave, _)| *slave == of)?;
    *masters.get(itr as usize)?
}

/// The timer whose TRGO is a trigger of the DAC (DAC_CR.TSEL, section 14.5.1).
pub(super) fn output_trigger(tsel: u32) -> Option<TimNumber> {
    [6, 8, 7, 5, 2, 4].get(tsel as usize).map(|number| tim(*number))
}

/// The timer whose TRGO starts regular scans (ADC_CR2.EXTSEL, section 13.13.3).
pub(super) fn converter_trigger(extsel: u32) -> Option<TimNumber> {
    match extsel {
        0b0110 => Some(tim(2)),
        0b1000 => Some(tim(3)),
        0b1110 => Some(tim(8)),
        _ => None,
    }
}

/// Pins and DMA requests from ST's database.
#[derive(Default)]
pub(super) struct Connections {
    /// The timer and its channel (0 is the first) behind a pin and its alternate function.
    pub(super) timer_inputs: BTreeMap<(PinIndex, u32), (TimNumber, usize)>,
    /// The pins of a timer's outputs.
    pub(super) timer_pins: BTreeMap<TimNumber, Vec<TimerPin>>,
    /// Pins of a peripheral's signal, each with its alternate function.
    pins: BTreeMap<(&'static str, &'static str), Vec<(PinIndex, u32)>>,
    /// The pin of a converter's channel.
    analog: BTreeMap<(usize, u32), PinIndex>,
    /// Name of the request by controller, stream and channel.
    pub(super) requests: BTreeMap<(usize, usize, u32), &'static str>,
    /// The names of the interrupt lines.
    lines_by_number: BTreeMap<usize, &'static str>,
    /// Server of a request, by the request's name.
    servers: BTreeMap<&'static str, Server>,
}

/// A pin that can be an output of a timer.
#[derive(Debug, Clone, Copy)]
pub(super) struct TimerPin {
    pub(super) pin: PinIndex,
    pub(super) function: u32,
    /// 0 is the first.
    pub(super) channel: usize,
    /// True for the complementary output (CHxN).
    pub(super) complementary: bool,
}

/// A DMA stream and channel that can serve a request.
#[derive(Debug, Clone, Default)]
pub(super) struct Server {
    /// The controller (DMA1 is 0). All streams of a request belong to it.
    pub(super) dma: usize,
    /// The streams, each with the channel that it has to listen to (tables 42, 43).
    pub(super) streams: Vec<(usize, u32)>,
}

/// Servers of a controller that sends and receives.
pub(super) struct BusServers {
    pub(super) transmitter: Server,
    pub(super) receiver: Server,
}

/// Servers of the models' requests, in the models' order.
pub(super) struct Servers {
    pub(super) adc: [Server; 3],
    pub(super) dac: [Server; 2],
    pub(super) usart: [BusServers; 6],
    pub(super) i2c: [BusServers; 3],
    /// For each timer, by the number of the flag in SR: update, channels 1 to 4, none, trigger.
    pub(super) timers: [[Server; TIMER_REQUESTS.len()]; 14],
    pub(super) spi: [BusServers; 3],
}

pub(super) static SERVERS: LazyLock<Servers> = LazyLock::new(|| {
    let of = |name: &str| CONNECTIONS.servers.get(name).cloned().unwrap_or_default();
    let both = |bus: &str| BusServers {
        transmitter: of(&format!("{bus}_TX")),
        receiver: of(&format!("{bus}_RX")),
    };
    Servers {
        adc: ADCS.map(of),
        dac: DAC_REQUESTS.map(of),
        usart: USARTS.map(both),
        i2c: I2CS.map(both),
        timers: std::array::from_fn(|n| TIMER_REQUESTS.map(|request| of(&format!("TIM{}_{request}", n + 1)))),
        spi: SPIS.map(both),
    }
});

pub(super) static CONNECTIONS: LazyLock<Connections> = LazyLock::new(|| {
    let mut found = Connections::default();
    for line in TABLE.lines() {
        let words: Vec<&str> = line.split(' ').collect();
        match words[..] {
            ["pin", name, function, peripheral, signal] => {
                let Some(pin) = pin(name) else { continue };
                found.connect(pin, function, peripheral, signal);
            }
            ["line", number, name] => {
                let number = number.parse().expect("the table has numbers there");
                found.lines_by_number.insert(number, name);
            }
            ["request", dma, stream, channel, name] => {
                let number = |text: &str| text.parse::<usize>().expect("the table has numbers there");
                let (dma, stream, channel) = (number(dma) - 1, number(stream), number(channel) as u32);
                // Two requests may share a place: only one of them can be in use.
                found.requests.entry((dma, stream, channel)).or_insert(name);
                found.serve(name, dma, (stream, channel));
            }
            _ => {}
        }
    }
    let mut served = BTreeSet::new();
    for new in new_requests() {
        if served.insert((new.dma, new.stream, new.channel)) {
            found.serve(new.name, new.dma, (new.stream, new.channel));
        }
    }
    // Most of these functions exist on several parts.
    let mut taken = BTreeSet::new();
    for new in new_functions() {
        if let Some(pin) = pin(new.pin)
            && taken.insert((new.pin, new.function, new.peripheral, new.signal))
        {
            found.connect(pin, new.function, new.peripheral, new.signal);
        }
    }
    found
});

/// The alternate functions that other parts have and this one lacks: a bit for each, by pin.
pub(super) fn foreign_functions(part: Chip) -> impl Iterator<Item = (PinIndex, u16)> {
    let foreign = new_functions()
        .iter()
        .filter(move |new| !part.has_function(new.pin, new.function));
    foreign.filter_map(|new| Some((pin(new.pin)?, 1 << new.function.parse::<u32>().ok()?)))
}

/// The places of requests that other parts have and this one lacks: controller, stream, and a bit for the
/// channel.
pub(super) fn foreign_requests(part: Chip) -> impl Iterator<Item = (usize, usize, u8)> {
    let foreign = new_requests().iter().filter(move |new| !part.has_request(new));
    foreign.map(|new| (new.dma, new.stream, 1 << new.channel))
}

/// Returns the name of the request that a stream of a part gets from a channel.
pub(super) fn request(part: Chip, dma: usize, stream: usize, channel: u32) -> Option<&'static str> {
    let is_there = |new: &&NewRequest| (new.dma, new.stream, new.channel) == (dma, stream, channel);
    let mut own = new_requests().iter().filter(|new| part.has_request(new));
    let new = own.find(is_there).map(|new| new.name);
    new.or_else(|| CONNECTIONS.requests.get(&(dma, stream, channel)).copied())
}

impl Connections {
    fn serve(&mut self, request: &'static str, dma: usize, place: (usize, u32)) {
        let server = self.servers.entry(request).or_default();
        server.dma = dma;
        server.streams.push(place);
    }

    fn connect(&mut self, pin: PinIndex, function: &str, peripheral: &'static str, signal: &'static str) {
        let position = |names: &[&str]| names.iter().position(|name| *name == peripheral);
        if let (Some(adc), Some(Ok(channel))) = (position(&ADCS), signal.strip_prefix("IN").map(str::parse)) {
            self.analog.insert((adc, channel), pin);
        }
        let Ok(function) = function.parse() else { return };
        let pins = self.pins.entry((peripheral, signal)).or_default();
        pins.push((pin, function));
        let complementary = signal.ends_with('N');
        if let (Some(Ok(number)), Some(Ok(channel))) = (
            peripheral.strip_prefix("TIM").map(str::parse),
            signal
                .strip_prefix("CH")
                .map(|channel| channel.trim_end_matches('N').parse::<usize>()),
        ) {
            let (number, channel) = (tim(number), channel - 1);
            if !complementary {
                self.timer_inputs.insert((pin, function), (number, channel));
            }
            let pins = self.timer_pins.entry(number).or_default();
            pins.push(TimerPin {
                pin,
                function,
                channel,
                complementary,
            });
        }
    }
}

/// The pins that can be a peripheral's signal, each with its alternate function.
pub(super) fn pins(peripheral: &'static str, signal: &'static str) -> &'static [(PinIndex, u32)] {
    let found = CONNECTIONS.pins.get(&(peripheral, signal));
    found.map_or(&[], Vec::as_slice)
}

/// The pins of each USART's transmitter and receiver, which are looked up for every frame.
static USART_PINS: LazyLock<[[SignalPins; 2]; 6]> =
    LazyLock::new(|| USARTS.map(|usart| ["TX", "RX"].map(|signal| pins(usart, signal))));

/// The pins that can be the transmitter of a USART, each with its alternate function.
pub(super) fn transmitters(usart: usize) -> &'static [(PinIndex, u32)] {
    USART_PINS[usart][0]
}

/// The pins that can be the receiver of a USART, each with its alternate function.
pub(super) fn receivers(usart: usize) -> &'static [(PinIndex, u32)] {
    USART_PINS[usart][1]
}

/// The pin of a converter's channel.
pub(crate) fn analog_pin(adc: usize, channel: u32) -> Option<PinIndex> {
    CONNECTIONS.analog.get(&(adc, channel)).copied()
}

/// The name of an interrupt line, for example `TIM1_UP_TIM10`.
pub(crate) fn interrupt_name(line: usize) -> Option<&'static str> {
    CONNECTIONS.lines_by_number.get(&line).copied()
}

/// Returns `true` if a model makes this request.
pub(super) fn is_modelled(request: &str) -> bool {
    let of_port = request.strip_suffix("_TX").or(request.strip_suffix("_RX"));
    let of_timer = request
        .split_once('_')
        .filter(|(timer, _)| timer.starts_with("TIM"));
    of_timer.is_some_and(|(_, request)| TIMER_REQUESTS.contains(&request))
        || ADCS.contains(&request)
        || DAC_REQUESTS.contains(&request)
        || of_port.is_some_and(|port| USARTS.contains(&port) || I2CS.contains(&port) || SPIS.contains(&port))
}

/// `PA15`: port and number.
pub(crate) fn pin(name: &str) -> Option<PinIndex> {
    let mut letters = name.strip_prefix('P')?.chars();
    let port = "ABCDEFGHI".find(letters.next()?)?;
    let number = letters.as_str().parse().ok().filter(|number| *number < 16)?;
    Some((port, number))
}

/// The name of a pin.
pub(super) fn pin_name((port, number): PinIndex) -> String {
    format!("P{}{number}", char::from(b'A' + port as u8))
}

/// The pin of a name. Panics if there is no such pin: the host checks names before.
pub(super) fn known_pin(name: &str) -> PinIndex {
    pin(name).unwrap_or_else(|| panic!("there is no pin {name:?}"))
}
