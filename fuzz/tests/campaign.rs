//! The image under faults drawn at random, and under the scripts that once found something.

use std::fs;
use std::path::Path;

use bead_fuzz::campaign::{CampaignBench, Script, check, shrunk};

/// The scripts that the tests draw. Unlike those of `cargo xtask campaign`, they have nothing that takes
/// seconds.
const DRAWN: std::ops::Range<u64> = 0..20;

#[test]
fn whatever_fails_is_told_once_counted_and_survived() {
    let bench = CampaignBench::new().unwrap_or_else(|why| panic!("{why}"));
    let mut measured = 0;
    for number in DRAWN {
        let script = Script::draw(number, true);
        measured += check(&bench, &script).unwrap_or_else(|why| panic!("{why}, of\n{}", script.text()));
    }
    assert!(measured > 100, "{measured} strikes of {DRAWN:?}");
}

#[test]
fn what_a_script_once_found_is_not_there_any_more() {
    let bench = CampaignBench::new().unwrap_or_else(|why| panic!("{why}"));
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts");
    let mut scripts = 0;
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.display().to_string();
        let script = Script::read(&fs::read_to_string(&path).unwrap(), &name).unwrap();
        check(&bench, &script).unwrap_or_else(|why| panic!("{name}: {why}"));
        scripts += 1;
    }
    assert!(scripts > 0);
}

#[test]
fn a_script_is_read_as_it_is_written() {
    for number in 0..500 {
        for short in [false, true] {
            let script = Script::draw(number, short);
            assert_eq!(Script::read(&script.text(), "script").unwrap(), script);
        }
    }
}

#[test]
fn a_script_that_fails_is_made_smaller_as_long_as_it_fails() {
    let script = (0..).map(|number| Script::draw(number, false));
    let script = script
        .into_iter()
        .find(|script| script.faults.len() == 6)
        .unwrap();
    let [.., fifth, _] = &script.faults[..] else {
        panic!()
    };
    let kind = fifth.kind;
    let smallest = shrunk(&script, |script| {
        script.faults.iter().any(|fault| fault.kind == kind)
    });
    assert_eq!(smallest.faults.len(), 1);
    assert_eq!(smallest.faults[0].kind, kind);
    assert!(smallest.strikes <= script.strikes);
}
