//! How the peripherals are wired to each other and to the pins.

/// DMA2's request mapping (table 43) for what is modelled: pairs of stream and channel.
pub(super) const ADC1_REQUEST: [(usize, u32); 2] = [(0, 0), (4, 0)];
pub(super) const USART1_TX_REQUEST: [(usize, u32); 1] = [(7, 4)];
pub(super) const USART1_RX_REQUEST: [(usize, u32); 2] = [(2, 4), (5, 4)];
pub(super) const DMA2: usize = 1;

/// ADC1's channel of the internal reference voltage (section 13.10).
pub(super) const REFERENCE: u32 = 17;

/// The timer (TIM2 is 0) and its channel (0 is the first) that a pin is connected to by an alternate
/// function. From DocID022152 table 9, for the packages that have ports A to D.
pub(super) fn timer_input(port: usize, pin: usize, function: u32) -> Option<(usize, usize)> {
    const A: usize = 0;
    const B: usize = 1;
    const C: usize = 2;
    const D: usize = 3;
    Some(match (function, port, pin) {
        (1, A, 0 | 5 | 15) => (0, 0),
        (1, A, 1) | (1, B, 3) => (0, 1),
        (1, A, 2) | (1, B, 10) => (0, 2),
        (1, A, 3) | (1, B, 11) => (0, 3),
        (2, A, 6) | (2, B, 4) | (2, C, 6) => (1, 0),
        (2, A, 7) | (2, B, 5) | (2, C, 7) => (1, 1),
        (2, B, 0) | (2, C, 8) => (1, 2),
        (2, B, 1) | (2, C, 9) => (1, 3),
        (2, B, 6..=9) => (2, pin - 6),
        (2, D, 12..=15) => (2, pin - 12),
        (2, A, 0..=3) => (3, pin),
        _ => return None,
    })
}
