//! Ctrl-C, `kill` and a terminal that goes away: one rule for every command.
//!
//! # Design
//! A command that is interrupted ends at once, and its results are whole or gone: files that were being
//! written are removed, so are the temporary files of a run, and a QEMU sees that its host is gone and ends.
//! The exit status is 128 and the signal's number.
//!
//! A command that records calls [`orderly`]. The first signal then asks it to complete its recording; after
//! [`PATIENCE`], or at the second signal, it ends all the same, and its file stays readable under its
//! temporary name.
//!
//! A command that can resume its work, such as a sweep, calls [`resumable`].
//!
//! A signal that is ignored when the program starts stays ignored: under `nohup` a recording outlives its
//! terminal.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::Duration;
use std::{fs, io, process, thread};

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

use bead_recording::note::note;
use bead_tables::whole::remove_unfinished;

/// Time in which a command that was asked to end must end.
pub const PATIENCE: Duration = Duration::from_secs(5);

/// Flag of a command that ends in order.
static STOP: OnceLock<Arc<AtomicBool>> = OnceLock::new();
/// Remains of a command that ends at once, or a way to go on with it.
static LEFT: OnceLock<String> = OnceLock::new();

/// Starts listening for signals. Call it once, before all else.
///
/// # Errors
/// The system refuses.
pub fn watch() -> io::Result<()> {
    let wanted = [SIGINT, SIGTERM, SIGHUP]
        .into_iter()
        .filter(|signal| !is_ignored(*signal));
    let mut signals = Signals::new(wanted)?;
    thread::Builder::new().name("signals".to_owned()).spawn(move || {
        let mut asked = false;
        for signal in signals.forever() {
            match STOP.get().filter(|_| !asked) {
                Some(stop) => {
                    asked = true;
                    stop.store(true, Ordering::Relaxed);
                    thread::spawn(move || {
                        thread::sleep(PATIENCE);
                        end(signal);
                    });
                }
                None => end(signal),
            }
        }
    })?;
    Ok(())
}

/// A flag that the first signal sets. The command must then end in order, and has [`PATIENCE`] for that;
/// `left` says what remains of its work if it takes longer.
pub fn orderly(left: String) -> Arc<AtomicBool> {
    resumable(left);
    Arc::clone(STOP.get_or_init(Arc::default))
}

/// A command that ends at once may leave finished parts of its work; `how` says how to go on with them.
pub fn resumable(how: String) {
    // Each command sets it once.
    let _ = LEFT.set(how);
}

/// Ends the program. Nothing half-done stays under a name that was asked for.
fn end(signal: i32) -> ! {
    bead_monitor::terminal::restore();
    remove_unfinished();
    stm32f405_qemu::remove_temporary_files();
    match LEFT.get() {
        Some(left) => note(format_args!("interrupted; {left}")),
        None => note(format_args!(
            "interrupted; nothing is left behind, so run the command again"
        )),
    }
    process::exit(128 + signal)
}

/// True if the signal was ignored when the program started; false if that is not known.
fn is_ignored(signal: i32) -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}
