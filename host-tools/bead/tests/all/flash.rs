//! `bead flash --probe`, with a program in the place of probe-rs that plays a part behind a probe.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::process::{Command, Output};

use crate::program::{PROGRAM, ROOT, TestFolder, assert_says, done, fields, json, refused, said};
use crate::schema::assert_valid;
use serde_json::json;

/// An ELF file of one loaded segment at 0x0800_0000: vectors, the name of an image for a board, and filling.
pub(crate) fn image(board: &str, length: usize) -> (Vec<u8>, Vec<u8>) {
    image_at(0x0800_0000, board, length)
}

/// An [`image`] at another address.
pub(crate) fn image_at(address: u32, board: &str, length: usize) -> (Vec<u8>, Vec<u8>) {
    let mut flat: Vec<u8> = (0..length as u32)
        .map(|n| (n.wrapping_mul(0x9e37_79b9) >> 24) as u8)
        .collect();
    flat[..4].copy_from_slice(&0x2000_1000_u32.to_le_bytes());
    let name = format!("bead-image:9.8.7 0123456789ab {board};");
    flat[392..392 + name.len()].copy_from_slice(name.as_bytes());
    let mut elf = b"\x7fELF\x01\x01\x01".to_vec();
    elf.resize(16, 0);
    // Executable for Arm; version, entry, offsets of the headers, flags; sizes and counts.
    elf.extend([2, 0, 40, 0]);
    elf.extend([1, address, 52, 0, 0_u32].map(u32::to_le_bytes).concat());
    elf.extend([52, 32, 1, 40, 0, 0_u16].map(u16::to_le_bytes).concat());
    let bytes = length as u32;
    let segment = [1, 84, address, address, bytes, bytes, 0, 4];
    elf.extend(segment.map(u32::to_le_bytes).concat());
    elf.extend(&flat);
    (elf, flat)
}

/// Plays probe-rs with one part, whose state is the files of the folder `part`. As later versions do, it puts
/// an address before the words of flash. A file `fail-COMMAND` is what a command says when it fails.
const PROBE_RS: &str = r#"#!/bin/bash
[ -z "$PROBE_RS_DRY_RUN" ] || exit 9
from=$PWD
cd "${0%/*}/../part" || exit 9
echo "$*" >> log
command=$1; shift
if [ -f "fail-$command" ]; then cat "fail-$command" >&2; exit 1; fi
words=()
while [ $# -gt 0 ]; do
    case $1 in --chip|--probe|--binary-format) shift 2;; --*) shift;; *) words+=("$1"); shift;; esac
done
at=$((words[1]))
case $command in
list) cat list;;
read)
    case $at in
    $((0xe0042000))) cat idcode;;
    $((0x40023c14))) cat optcr;;
    *) od -v -A n -w32 -t x4 -j $((at - 0x08000000)) -N $((4 * words[2])) flash | sed "s/^ /08000000: /";;
    esac;;
write)
    word=${words[2]#0x}
    if [ $at = $((0x40023c08)) ]; then echo -n "$word" >> keys; exit; fi
    # Only behind both keys, and only with OPTSTRT, which falls by itself.
    if [ "$(cat keys)" = 08192a3b4c5d6e7f ] && [ $((0x$word & 2)) = 2 ] && [ ! -f stubborn ]; then
        printf '%08x\n' $((0x$word & ~2)) > optcr
    fi;;
download)
    dd if="$from/${words[0]}.bin" of=flash conv=notrunc status=none
    if [ -f weak ]; then printf x | dd of=flash bs=1 seek=600 conv=notrunc status=none; fi;;
verify)
    image=$from/${words[0]}.bin
    if cmp -s -n "$(stat -c %s "$image")" "$image" flash
    then echo 'Verification successful'; else echo 'Verification failed: contents do not match'; fi;;
reset) ;;
*) echo "error: unrecognized subcommand '$command'" >&2; exit 2;;
esac
"#;

const PROBE: &str =
    "The following debug probes were found:\n[0]: STLink V2-1 -- 0483:374b:0670FF34 (ST-LINK)\n";
const SECOND: &str = "[1]: J-Link -- 1366:0101-0:000801 (J-Link)\n";
/// A new part: brown-out reset off, no protection, option bytes locked.
const NEW: &str = "0fffaaed\n";

/// A folder with a part behind a probe and an image for it.
pub(crate) struct FakeProbe {
    pub(crate) folder: TestFolder,
}

impl FakeProbe {
    pub(crate) fn new() -> Self {
        let folder = TestFolder::new();
        for name in ["bin", "part"] {
            fs::create_dir(folder.join(name)).unwrap();
        }
        folder.write("bin/probe-rs", PROBE_RS);
        fs::set_permissions(folder.join("bin/probe-rs"), fs::Permissions::from_mode(0o755)).unwrap();
        folder.write("part/list", PROBE);
        folder.write("part/idcode", "10076413 \n");
        folder.write("part/optcr", NEW);
        folder.write("part/flash", vec![0xff; 1 << 20]);
        let bench = Self { folder };
        bench.put("image", "weact-f405");
        bench
    }

    fn put(&self, name: &str, board: &str) {
        let (elf, flat) = image(board, 20_000);
        self.folder.write(name, elf);
        self.folder.write(&format!("{name}.bin"), flat);
    }

    fn run(&self, line: &str) -> Output {
        let path = std::env::var("PATH").unwrap();
        let mut command = Command::new(PROGRAM);
        command.current_dir(&*self.folder).args(["flash", "--probe"]);
        command.args(line.split_whitespace());
        command.env("PATH", format!("{}:{path}", self.folder.join("bin").display()));
        // If a user has set this, every command of probe-rs would be a dry run.
        command.env("PROBE_RS_DRY_RUN", "1");
        command.output().unwrap()
    }

    fn log(&self) -> String {
        fs::read_to_string(self.folder.join("part/log")).unwrap_or_default()
    }

    /// Asserts that the command fails in this way, and that nothing of the part was changed.
    fn refused(&self, line: &str, status: i32, part: &str) {
        let state = || ["part/optcr", "part/flash"].map(|name| self.folder.read(name));
        let before = state();
        refused(&self.run(line), status, part);
        assert!(before == state(), "{line}: {part}");
    }
}

#[test]
fn an_image_is_flashed_compared_and_named_before_and_after_and_the_brown_out_level_is_told() {
    let bench = FakeProbe::new();
    let first = bench.run("image --format json");
    assert_says(&said(&first), "the brown-out reset is at level 0");
    let first = json(first);
    assert_valid(&format!("{ROOT}/docs/schemas"), "flash", &first);
    assert!(first["before"].is_null());
    let flat = bench.folder.read("image.bin");
    assert!(bench.folder.read("part/flash").starts_with(&flat));
    let again = json(bench.run("image --format json"));
    let name = json!({ "version": "9.8.7", "git": "0123456789ab", "board": "weact-f405" });
    assert_eq!((&again["before"], &again["after"]), (&name, &name));
    assert_eq!(again["part"], 0x413);
    assert_eq!(again["sectors"], json!([0, 1]));
    let reset = "reset --chip STM32F405RGTx --probe 0483:374b:0670FF34\n";
    assert!(bench.log().ends_with(reset), "{}", bench.log());
    assert_says(&done(bench.run("image")), "9.8.7 (0123456789ab) for weact-f405");
}

#[test]
fn one_of_several_probes_is_named_by_its_serial_number() {
    let bench = FakeProbe::new();
    bench.folder.write("part/list", format!("{PROBE}{SECOND}"));
    let both = "there are several debug probes (0483:374b:0670FF34, 1366:0101-0:000801)";
    bench.refused("image", 2, both);
    let none = "no debug probe has the serial number 7; connected: 0483";
    bench.refused("image --serial 7", 2, none);
    for serial in ["000801", "1366:0101-0:000801"] {
        done(bench.run(&format!("image --serial {serial} --under-reset")));
        let wanted = "reset --chip STM32F405RGTx --probe 1366:0101-0:000801 --connect-under-reset\n";
        assert!(bench.log().ends_with(wanted));
    }
    bench.folder.write("part/list", "No debug probes were found.\n");
    bench.refused("image", 3, "probe-rs finds no debug probe: plug one in");
}

#[test]
fn a_part_that_cannot_be_a_bead_or_cannot_be_flashed_is_left_as_it_is() {
    for row in [
        "idcode | 10076421 | 2 | the part is 0x421 (STM32F446, which has no core-coupled memory), not 0x413",
        "optcr | 0fff55ed | 2 | the part is locked (read protection level 1)",
        "optcr | 0ffdaaed | 2 | sector 1 of the part's flash is write-protected",
        "optcr | ffffffff | 3 | option bytes read as 0xffffffff, which is impossible",
        "idcode | Error | 3 | answered: Error; `probe-rs --version`",
        "fail-read | Error: No connected\x1b core\n\n  caused by: nothing | 3 | No connected\\u001b core caused by",
        "fail-read | Error: x | 3 | --under-reset; a part at read protection level 2 answers no probe",
        "fail-list | error: unrecognized subcommand 'list' | 3 | this probe-rs is too old",
        "fail-read | Access denied (insufficient permissions) | 3 | on Linux it needs udev rules",
        "fail-read | could not claim interface: busy | 3 | another program uses the probe",
    ] {
        let [file, contents, status, part] = fields(row);
        let bench = FakeProbe::new();
        bench.folder.write(&format!("part/{file}"), contents);
        bench.refused("image --brownout", status.parse().unwrap(), part);
    }
    let bench = FakeProbe::new();
    bench.folder.write("part/weak", "");
    refused(&bench.run("image"), 3, "flash and image differ after flashing");
}

#[test]
fn the_brown_out_level_is_set_and_no_other_option_bit() {
    let bench = FakeProbe::new();
    // A watchdog that hardware starts, and protection of a sector outside the image.
    bench.folder.write("part/optcr", "07ffaacd\n");
    let report = json(bench.run("image --brownout --format json"));
    assert_eq!(report["brown_out_level"], 3);
    assert_eq!(bench.folder.text("part/optcr"), "07ffaac0\n");
    // The level is already set: nothing is written to the option bytes.
    let writes = |log: String| log.lines().filter(|line| line.starts_with("write")).count();
    assert_eq!(writes(bench.log()), 4);
    done(bench.run("image --brownout"));
    assert_eq!(writes(bench.log()), 4);
    let bench = FakeProbe::new();
    bench.folder.write("part/stubborn", "");
    bench.refused("image --brownout", 3, "the part did not take brown-out level 3");
}

#[test]
fn the_image_for_another_board_is_replaced_only_by_name() {
    let bench = FakeProbe::new();
    bench.put("other", "olimex-h405");
    done(bench.run("other"));
    let other = "the board has the image 9.8.7 (0123456789ab) for olimex-h405, but this image is for weact";
    bench.refused("image", 2, other);
    let named = "image is the image for weact-f405, not for olimex-h405";
    bench.refused("image --board olimex-h405", 2, named);
    done(bench.run("image --board weact-f405"));
}

#[test]
fn a_dry_run_prints_the_commands_and_runs_none() {
    let bench = FakeProbe::new();
    let printed = done(bench.run("image --dry-run --brownout --serial 0483:374b"));
    assert_eq!(bench.log(), "");
    let is_write = |line: &&str| line.contains(" write ") || line.contains("load ");
    let commands: Vec<_> = printed.lines().filter(is_write).collect();
    let common = "--chip STM32F405RGTx --probe 0483:374b";
    let expected = [
        format!("probe-rs write {common} b32 0x40023c08 0x08192a3b"),
        format!("probe-rs write {common} b32 0x40023c08 0x4c5d6e7f"),
        format!("probe-rs write {common} b32 0x40023c14 0x0fffaae0"),
        format!("probe-rs write {common} b32 0x40023c14 0x0fffaae2"),
        format!("probe-rs download {common} --verify --binary-format elf --disable-progressbars image"),
    ];
    assert_eq!(commands, expected);
}

#[test]
fn without_probe_rs_one_line_says_how_to_get_it_and_the_image_that_is_built_has_a_name() {
    let mut command = Command::new(PROGRAM);
    let output = command.args(["flash", "--probe"]).env("PATH", "").output();
    let advice = "`cargo install probe-rs-tools --locked` installs it";
    refused(&output.unwrap(), 2, advice);
}
