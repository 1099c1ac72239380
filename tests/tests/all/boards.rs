//! Each board of `firmware/boards.txt`, with its own image, crystal and wiring.

use std::fs;

use bead_tests::{RunFrames, execute, image, paper, workspace};
use bead_wire::Board;

#[test]
fn each_board_measures_the_strike_alike_and_says_its_name() {
    let table = fs::read_to_string(workspace().join("firmware/boards.txt")).expect("the table is committed");
    let rows = table
        .lines()
        .filter(|line| line.contains('|') && !line.starts_with('#'));
    let mut measured = Vec::new();
    for (n, row) in rows.enumerate() {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        let (name, Ok(mhz)) = (cells[0], cells[1].parse::<u32>()) else {
            continue;
        };
        let (light, _) = cells[5].split_once(' ').expect("a pin and a level");
        let mut machine = paper(1, 0.1, Some(1)).machine();
        // The first board's image is the one that all other tests run.
        let first = image();
        let target = first.ancestors().nth(3).expect("it lies in the target directory");
        machine.elf = if n == 0 {
            first.clone()
        } else {
            target.join("boards").join(name)
        };
        assert!(
            machine.elf.exists(),
            "{} is not built: `cargo xtask build boards` builds it",
            machine.elf.display()
        );
        machine.hse_hz = mhz * 1_000_000;
        let outcome = execute(&machine);
        assert_eq!(outcome.unmodelled, [""; 0], "{name}");
        let flashes = outcome.pins.iter().find(|pin| pin.name == light);
        assert!(
            flashes.is_some_and(|pin| pin.edges >= 2),
            "{name}: {:?}",
            outcome.pins
        );
        let received = RunFrames::new(outcome.uart);
        assert_eq!(received.causes(), [], "{name}");
        let told: &Board = received.all().next().expect("a frame of the board");
        let expected = (name, mhz, 0x413, 0);
        let told = (
            told.name.as_str(),
            u32::from(told.crystal_mhz),
            told.part,
            told.read_protection,
        );
        assert_eq!(told, expected);
        let [strike] = &received.strikes()[..] else {
            panic!("{name}: one strike")
        };
        measured.push((strike.said, strike.scans.clone()));
    }
    assert_eq!(measured.len(), 4);
    assert!(measured.iter().all(|strike| *strike == measured[0]));
}
