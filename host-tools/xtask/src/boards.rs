//! Images for boards other than the first one of `firmware/boards.txt`.

use std::path::{Path, PathBuf};

use crate::board_table::{TABLE, names, read, rows};
use crate::packages::{IMAGE, PROGRAMS};
use crate::setup::TARGET;
use crate::step::{CommandLine, Steps, Stop};
use crate::{demo, files, image, paths};

/// Builds what `cargo xtask build` is asked for: all programs and the image of the first board; the image of
/// a board that is named; or those of all boards.
///
/// # Errors
/// No such board, one that cannot work, or something does not build.
pub(crate) fn build(steps: &Steps, words: &[&String]) -> Result<(), Stop> {
    match words {
        [] => demo::build(steps, PROGRAMS),
        [all] if *all == "boards" => {
            build_images(steps)?;
            image::build(steps)
        }
        [board] => {
            let table = read(steps)?;
            build_image(steps, works(&table, board)?)
        }
        _ => Err(Stop::failed(
            "give one board, or `boards` for all: `build weact-f405`",
        )),
    }
}

/// Builds the images of all boards but the first into target/boards.
pub(crate) fn build_images(steps: &Steps) -> Result<(), Stop> {
    names(steps)?
        .iter()
        .skip(1)
        .try_for_each(|board| build_image(steps, board))
}

/// Path of the image for a board other than the first.
pub(crate) fn path(steps: &Steps, board: &str) -> PathBuf {
    steps.root.join(steps.built("boards")).join(board)
}

/// The command that builds the image for a board.
pub(crate) fn line(board: &str) -> CommandLine {
    CommandLine::new("cargo build")
        .words(IMAGE)
        .env("BEAD_BOARD", board)
}

fn build_image(steps: &Steps, board: &str) -> Result<(), Stop> {
    paths::leave_out(steps, paths::cargo_home().as_deref())?;
    // Not in the directory of the first board's image, since `bead` carries the image that it finds there.
    let apart = steps.target.join("boards/build");
    let_it_have_the_libraries(steps, &apart)?;
    let build = line(board).words("--target-dir").arg(&apart);
    steps.run(&format!("the flash image for {board}"), &build)?;
    let to = path(steps, board);
    files::copy(&apart.join(TARGET).join("firmware/bead-firmware"), &to)?;
    image::sign(&to, board)?;
    steps.announce(&format!("the image for {board} is {}", to.display()));
    Ok(())
}

/// Copies the libraries of the first board's image into a directory that has none: they are the same for all
/// boards, and take two minutes to compile.
fn let_it_have_the_libraries(steps: &Steps, apart: &Path) -> Result<(), Stop> {
    let ours = steps.root.join(&steps.target);
    let apart = steps.root.join(apart);
    // Libraries of the part, and the programs that their compilation runs.
    for of in [format!("{TARGET}/firmware"), "firmware".to_owned()] {
        let (from, to) = (ours.join(&of), apart.join(&of));
        if !from.is_dir() || to.exists() {
            continue;
        }
        let folder = to.parent().unwrap_or(&apart);
        files::make(folder)?;
        // With their times, by which cargo knows that they are fresh.
        let copy = CommandLine::new("cp -Rp").arg(&from).arg(folder);
        steps.run("its libraries, copied from those of the first board", &copy)?;
    }
    Ok(())
}

/// The board of this name, if the image can run there.
///
/// # Errors
/// There is none, or the image cannot run there; the message says why.
fn works<'a>(table: &str, name: &'a str) -> Result<&'a str, Stop> {
    match rows(table).find(|row| row[0] == name).as_deref() {
        Some([_, "no", why, ..]) => Err(Stop::failed(format!("{name} cannot be a bead: {why}"))),
        Some(_) => Ok(name),
        None => {
            let names: Vec<_> = rows(table)
                .filter(|row| row[1] != "no")
                .map(|row| row[0])
                .collect();
            Err(Stop::failed(format!(
                "`{name}` is not a board of {TABLE}; give one of {}, or `boards` for all",
                names.join(", ")
            )))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_board_is_refused_with_the_names_of_those_that_work() {
        let table = include_str!("../../../firmware/boards.txt");
        let refused = works(table, "f405").unwrap_err().message;
        assert!(refused.contains("stm32f405rg, weact-f405, "), "{refused}");
        assert_eq!(works(table, "weact-f405").unwrap(), "weact-f405");
    }
}
