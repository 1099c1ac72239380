//! `bead fetch`: lists the strikes that a bead keeps, or writes them to a recording.

use bead_wire::{Kept, MAX_FRAME, Request, encode};

use crate::cli::commands::prelude::*;
use crate::cli::line_options::LineOptions;
use bead_line::conversation::LineError;
use bead_recording::file::{About, RecordingWriter};
use bead_recording::frames::Frame;

const AFTER_HELP: &str = "\
A bead keeps its last strikes, even through a reset: at least twelve of 672 scans, or eight of the longest \
windows. A power cut clears them. Without --out they are listed. With --out they are sent again and written \
to a recording, bit for bit as they were measured, which `bead replay`, `bead compare` and `bead export` read \
like any other. A fetch changes nothing on the bead and needs no key; new strikes are sent first.

`bead record` itself fetches strikes that were lost on the way.

Exit status 1 if the bead does not keep what was asked for, 3 if it does not answer.

Examples:
  bead fetch --port /dev/ttyUSB0
  bead fetch --port /dev/ttyUSB0 --out kept.mcap
  bead fetch --port /dev/ttyUSB0 --boot 3 17 18 --out two.mcap";

#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// Numbers of the strikes [default: all that are kept].
    strikes: Vec<u32>,
    /// Only strikes of this boot.
    #[arg(long, value_name = "N")]
    boot: Option<u32>,
    /// The recording to write; without it the strikes are listed.
    #[arg(long, value_name = "F.mcap")]
    out: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    #[command(flatten)]
    line: LineOptions,
    /// Format of the list.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// The strikes that a bead keeps, as JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct KeptStrikes<'a> {
    /// Bodies of `kept` frames.
    #[schemars(with = "Vec<serde_json::Map<String, serde_json::Value>>")]
    strikes: &'a [Kept],
}

/// The result of fetching, as JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct FetchReport<'a> {
    fetched: usize,
    out: &'a str,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let format = arguments.format;
    let target = arguments
        .overwrite
        .optional(arguments.out.as_deref(), FileKind::Recording, &[])?;
    let mut bead = arguments.line.open()?;
    // The identity contains the sample rate. It comes first, so that lost frames of the list are noticed.
    let mut frames: Vec<Frame> = bead.request_done(&Request::Identity)?.frames;
    let (numbers, boot) = (&arguments.strikes, arguments.boot);
    let mut kept = bead.kept()?;
    kept.retain(|kept| boot.is_none_or(|boot| boot == kept.boot));
    kept.retain(|kept| numbers.is_empty() || numbers.contains(&kept.strike));
    let is_missing = |number: &&u32| kept.iter().all(|kept| kept.strike != **number);
    if let Some(number) = numbers.iter().find(is_missing) {
        bail!(
            Verdict,
            "the bead does not keep strike {number}: `bead fetch` without numbers lists those that it keeps"
        );
    }
    let Some(target) = target else {
        return output::print(format, &KeptStrikes { strikes: &kept }, || {
            let numbers = |kept: &Kept| [kept.boot, kept.strike, kept.parts.into(), kept.bytes];
            let rows = kept
                .iter()
                .map(|kept| numbers(kept).map(|number| number.to_string()));
            output::table("boot | strike | frames | bytes", rows)
        });
    };
    if kept.is_empty() {
        bail!(Verdict, "the bead keeps no strike: nothing is written");
    }
    let (mut fetched, mut failed) = (0, None);
    for kept in &kept {
        match bead.fetch(kept) {
            Ok(strike) => {
                frames.extend(strike);
                fetched += 1;
            }
            // Only this strike was refused: the others may still be there.
            Err(why @ LineError::Refused(_)) => failed = failed.or(Some(why)),
            Err(why) => {
                failed = Some(why);
                break;
            }
        }
    }
    // Fetched strikes are written, even if others failed.
    if let Some(why) = failed.take_if(|_| fetched == 0) {
        return Err(why.into());
    }
    let about = About {
        source: arguments.line.port().to_string(),
        ..About::default()
    };
    let mut writer = RecordingWriter::create(&target, &about)?;
    for frame in &frames {
        let mut buffer = [0; MAX_FRAME];
        let bytes = encode(&frame.header, &frame.message, &mut buffer);
        let bytes = bytes.expect("MAX_FRAME bytes always suffice");
        writer.write(bytes, frame.received_ns, |_| {})?;
    }
    let out = &writer.finish()?.path.display().to_string();
    output::print(format, &FetchReport { fetched, out }, || {
        format!("{out}: {fetched} strikes fetched")
    })?;
    failed.map_or(Ok(()), |why| Err(why.into()))
}
