//! Runs many scripts of faults, drawn by chance: `campaign N [--seed S]`. `cargo xtask campaign` calls it.

use std::path::Path;
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::thread;

use bead_fuzz::campaign::{CampaignBench, Script, check, shrunk};

const USAGE: &str =
    "usage: campaign N [--seed S]: runs N scripts of faults, drawn by the numbers from S (1) on";

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let given = match words[..] {
        [count] => count.parse().ok().zip(Some(1)),
        [count, "--seed", seed] => count.parse().ok().zip(seed.parse().ok()),
        _ => None,
    };
    let Some((count, seed)) = given else {
        eprintln!("{USAGE}");
        return ExitCode::from(2);
    };
    match run(count, seed) {
        Ok(0) => ExitCode::SUCCESS,
        Ok(failed) => {
            eprintln!("error: {failed} of {count} scripts failed");
            ExitCode::FAILURE
        }
        Err(why) => {
            eprintln!("error: {why}");
            ExitCode::from(3)
        }
    }
}

/// Runs the scripts, two at a time on two cores, and returns the number that failed.
fn run(count: u64, seed: u64) -> Result<usize, String> {
    let bench = CampaignBench::new()?;
    let (next, failed, measured) = (AtomicU64::new(0), AtomicUsize::new(0), AtomicUsize::new(0));
    let faults = AtomicUsize::new(0);
    let writing = Mutex::new(());
    let work = || {
        loop {
            let number = next.fetch_add(1, Ordering::Relaxed);
            if number >= count {
                return;
            }
            let number = seed.wrapping_add(number);
            let script = Script::draw(number, false);
            faults.fetch_add(script.faults.len(), Ordering::Relaxed);
            match check(&bench, &script) {
                Ok(strikes) => {
                    measured.fetch_add(strikes, Ordering::Relaxed);
                }
                Err(why) => {
                    failed.fetch_add(1, Ordering::Relaxed);
                    let smallest = shrunk(&script, |script| check(&bench, script).is_err());
                    let why_smallest = check(&bench, &smallest).err().unwrap_or_default();
                    let path = Path::new("target/campaign").join(format!("{number}.toml"));
                    let _writing = writing.lock();
                    println!(
                        "script {number}: {why}\n    the smallest, {}: {why_smallest}",
                        path.display()
                    );
                    let written = std::fs::create_dir_all("target/campaign")
                        .and_then(|()| std::fs::write(&path, smallest.text()));
                    if let Err(error) = written {
                        println!("    cannot write it ({error}):\n{}", smallest.text());
                    }
                }
            }
        }
    };
    thread::scope(|scope| {
        for _ in 0..thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(work);
        }
    });
    println!(
        "{count} scripts with {} faults, {} strikes measured",
        faults.into_inner(),
        measured.into_inner()
    );
    Ok(failed.into_inner())
}
