//! Checks that this computer derives the image's built-in settings and the known answer of its self-test.

use std::string::String;
use std::vec::Vec;
use std::{env, format, fs};

use bead_model::design::{Bead, Capture, FrontEnd, derive};
use bead_model::settings::BLOCK_MAX;
use bead_model::{Settings, WindowRecord};

use crate::known_answer;

const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/src/built_in.rs");

#[test]
fn the_built_in_settings_and_the_known_answer_are_those_of_this_computer() {
    let settings = derive(&Bead::paper(), &FrontEnd::reference(), &Capture::default()).unwrap();
    let mut block = [0; BLOCK_MAX];
    let length = settings.encode(&mut block).unwrap();
    let settings = Settings::decode(&block).unwrap();
    let rows = block[..length].chunks(16).map(|row| {
        let row: Vec<_> = row.iter().map(|byte| format!("{byte:#04x}")).collect();
        format!("    {},\n", row.join(", "))
    });
    let results = known_answer::results(&settings, &mut WindowRecord::new());
    let derived = format!(
        "//! Settings of a bead that has none of its own, and what its estimators must find with them.\n\
         //!\n\
         //! `PAGES=overwrite cargo test --release -p bead-app built_in` writes this file.\n\
         \n\
         use crate::known_answer::RESULTS;\n\
         \n\
         /// The paper's bead behind the reference front end, as a settings block.\n\
         #[rustfmt::skip]\n\
         pub(crate) static SETTINGS: [u8; {length}] = [\n{}];\n\
         \n\
         /// The results of `known_answer::results` with these settings.\n\
         #[rustfmt::skip]\n\
         pub(crate) const EXPECTED: [i64; RESULTS] = {results:?};\n",
        rows.collect::<String>()
    );
    let file = fs::read_to_string(FILE).unwrap_or_default();
    if env::var_os("PAGES").is_some_and(|value| value == "overwrite") {
        fs::write(FILE, derived).unwrap();
        return;
    }
    assert!(
        file == derived,
        "firmware/app/src/built_in.rs is stale: \
         `PAGES=overwrite cargo test --release -p bead-app built_in` writes it"
    );
}
