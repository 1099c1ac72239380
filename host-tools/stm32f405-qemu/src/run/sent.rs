//! Frames that a USART sent.

use crate::outcome::Uart;

/// Reads the records of a USART: see [`sent`](crate::exchange::sent).
pub(super) fn read(port: &str, records: &[u8]) -> Uart {
    let mut uart = Uart {
        port: port.into(),
        ..Uart::default()
    };
    let (records, _) = records.as_chunks::<10>();
    for (number, [time @ .., low, high]) in records.iter().enumerate() {
        uart.ns.push(u64::from_le_bytes(*time));
        uart.bytes.push(*low);
        if *high != 0 {
            uart.ninth.push(number);
        }
    }
    uart
}
