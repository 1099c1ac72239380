//! The example of docs/library.md.

use bead_wire::Decoder;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let file = std::env::args().nth(1).ok_or("give a file of received bytes")?;
    let mut decoder = Decoder::new();
    decoder.feed(&std::fs::read(file)?, |result| match result {
        Ok(frame) => println!("{} {:?}", frame.header.sample_index, frame.message),
        Err(reject) => println!("{} bytes rejected: {reject}", reject.bytes),
    });
    println!("{} frames lost", decoder.counters().lost);
    Ok(())
}
