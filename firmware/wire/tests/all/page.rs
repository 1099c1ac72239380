//! The tables, the limits and the example of `docs/protocol.md` are made from this crate.
//!
//! `PAGES=overwrite cargo test -p bead-wire page` writes them anew.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::fs;

use crate::common::{block, held, hex};
use bead_wire::{
    FieldDoc, FieldKind, Header, Kind, MAX_FRAME, MAX_REQUEST, Message, Named, Request, Settings, Unit,
    VERSION, encode,
};

const PAGE: &str = "../../docs/protocol.md";
const BEGIN: &str = "<!-- generated: ";
const END: &str = "<!-- end -->\n";

/// The text of a doc comment: links become the names that they show, and a paragraph is one line.
fn plain(doc: &str) -> String {
    let paragraphs = doc.trim().split("\n\n").map(|paragraph| {
        let words: Vec<_> = paragraph.split_whitespace().collect();
        let mut text = words.join(" ");
        while let Some(start) = text.find("[`") {
            let close = start + text[start..].find(']').unwrap();
            let target = &text[close + 1..];
            let end = match target.strip_prefix('(') {
                Some(link) => close + 1 + 1 + link.find(')').unwrap() + 1,
                None => close + 1,
            };
            text = format!("{}{}{}", &text[..start], &text[start + 1..close], &text[end..]);
        }
        text
    });
    paragraphs.collect::<Vec<_>>().join("\n\n")
}

/// Paragraphs in lines of at most 110 columns.
fn wrapped(text: &str) -> String {
    let paragraph = |paragraph: &str| {
        let (mut lines, mut line) = (String::new(), String::new());
        for word in paragraph.split(' ') {
            if !line.is_empty() && line.chars().count() + 1 + word.chars().count() > 110 {
                lines += &(std::mem::take(&mut line) + "\n");
            }
            line += if line.is_empty() { "" } else { " " };
            line += word;
        }
        lines + &line + "\n\n"
    };
    text.split("\n\n").map(paragraph).collect()
}

fn table(head: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
    let mut text = line(head.iter().map(|&cell| cell.into()).collect());
    text += &format!("{}|\n", "|---".repeat(head.len()));
    for row in rows {
        text += &line(row.iter().map(|cell| cell.replace('|', "\\|")).collect());
    }
    text + "\n"
}

fn list(head: &str, list: &[Named]) -> String {
    let row = |(number, name, about): &Named| vec![number.to_string(), format!("`{name}`"), plain(about)];
    table(&[head, "name", "meaning"], list.iter().map(row))
}

/// Size of one bit of a quantity.
fn bit(unit: &Unit) -> String {
    let prefix = if unit.scale == 1.0 { "" } else { "n" };
    assert_eq!(unit.scale, if prefix == "n" { 1e-9 } else { 1.0 });
    let symbol = if unit.symbol == "1" { "" } else { unit.symbol };
    let mut text = format!("2^-{} {prefix}{symbol}", unit.fraction_bits);
    if unit.per_sample {
        text += ", over the sample rate in Hz";
    }
    text.trim_end().to_owned()
}

fn form(field: &FieldDoc) -> String {
    match field.kind {
        FieldKind::Quantity(unit) => format!("{}, {}", field.form, bit(unit)),
        _ => field.form.to_owned(),
    }
}

/// The table of fields, and the tables of their lists and groups, each once.
fn fields(fields: &'static [FieldDoc]) -> String {
    let row = |field: &FieldDoc| {
        let name = format!("`{}`", field.name);
        vec![name, form(field), field.longest.to_string(), plain(field.about)]
    };
    let mut text = table(&["field", "form", "longest", "meaning"], fields.iter().map(row));
    let mut shown: Vec<FieldKind> = Vec::new();
    for field in fields {
        let details = match field.kind {
            FieldKind::Name(names) => list("number", names),
            FieldKind::Set(names) => list("bit", names),
            FieldKind::Group(inner) => self::fields(inner),
            _ => continue,
        };
        if shown.contains(&field.kind) {
            continue;
        }
        shown.push(field.kind);
        let same = fields.iter().filter(|other| other.kind == field.kind);
        let names: Vec<_> = same.map(|field| format!("`{}`", field.name)).collect();
        text += &format!("{}:\n\n{details}", names.join(" and "));
    }
    text
}

/// `self_test` is `Self-test`.
fn title(kind: Kind) -> String {
    let name = kind.name().replace('_', "-");
    let (first, rest) = name.split_at(1);
    first.to_uppercase() + rest
}

fn kinds() -> String {
    let row = |&kind: &Kind| {
        let about = plain(kind.about());
        let paragraph = about.split("\n\n").next().unwrap();
        let sentence = paragraph.split_inclusive(". ").next().unwrap().trim();
        let link = format!(
            "[`{0}`](#{1}-{2})",
            kind.name(),
            kind as u8,
            title(kind).to_lowercase()
        );
        vec![
            (kind as u8).to_string(),
            link,
            kind.longest().to_string(),
            sentence.into(),
        ]
    };
    table(
        &["kind", "name", "longest body", "what it says"],
        Kind::ALL.iter().map(row),
    )
}

fn bodies() -> String {
    let body = |&kind: &Kind| {
        let about = wrapped(&plain(kind.about()));
        format!(
            "### {} {}\n\n{about}{}",
            kind as u8,
            title(kind),
            fields(kind.fields())
        )
    };
    Kind::ALL.iter().map(body).collect()
}

fn requests() -> String {
    let field = |field: &FieldDoc| {
        let about = plain(field.about);
        format!(
            "`{}`: {}. {}",
            field.name,
            form(field),
            about.trim_end_matches('.')
        )
    };
    let row = |&(number, name, about, fields): &(u8, &str, &str, &[FieldDoc])| {
        let body: Vec<_> = fields.iter().map(field).collect();
        vec![
            number.to_string(),
            name.into(),
            body.join("; ") + if body.is_empty() { "" } else { "." },
            plain(about),
        ]
    };
    table(
        &["kind", "name", "body", "the bead is asked to"],
        Request::LIST.iter().map(row),
    )
}

fn limits() -> String {
    wrapped(&format!(
        "This is version {VERSION}. With both delimiters, a frame has at most {MAX_FRAME} bytes and a request at \
         most {MAX_REQUEST}."
    ))
}

fn example() -> String {
    let header = Header {
        address: 7,
        boot: 2,
        sequence: 0x0102_0304,
        sample_index: 0x0A_0000_0B0C,
    };
    let message = Message::from(Settings {
        block: block(b"BEAD\x01\x00\xff"),
    });
    let mut buffer = [0; MAX_FRAME];
    let sent = encode(&header, &message, &mut buffer).unwrap();
    let mut payload = vec![0; MAX_FRAME];
    let length = cobs::decode(&sent[1..], &mut payload).unwrap();
    let payload = &payload[..length];
    let crc = u32::from_le_bytes(payload[length - 4..].try_into().unwrap());
    let meanings = [
        (0..1, format!("version {VERSION}")),
        (
            1..2,
            format!("kind {}: {}", message.kind() as u8, message.kind().name()),
        ),
        (2..3, format!("boot {}", header.boot)),
        (3..7, format!("sequence {:#010x}", header.sequence)),
        (7..15, format!("sample index {:#012x}", header.sample_index)),
        (15..16, format!("address {}", header.address)),
        (16..17, "seven bytes follow".into()),
        (17..24, "the block".into()),
        (24..28, format!("CRC-32 {crc:#010x}")),
    ];
    assert_eq!(length, 28);
    let row = |(bytes, meaning): (std::ops::Range<usize>, String)| {
        vec![format!("`{}`", hex(&payload[bytes], " ")), meaning]
    };
    format!("    {}\n\n", hex(sent, " ")) + &table(&["before COBS", "meaning"], meanings.map(row))
}

#[test]
fn the_page_of_the_protocol_says_what_the_crate_does() {
    let page = fs::read_to_string(format!("{}/{PAGE}", env!("CARGO_MANIFEST_DIR"))).unwrap();
    let parts = [
        ("limits", limits()),
        ("kinds", kinds()),
        ("bodies", bodies()),
        ("requests", requests()),
        ("example", example()),
    ];
    let mut sections = page.split(BEGIN);
    let mut today = sections.next().unwrap().to_owned();
    let mut found = Vec::new();
    for section in sections {
        let (name, rest) = section.split_once(" -->\n").unwrap();
        let (_, rest) = rest.split_once(END).unwrap();
        let (_, text) = parts.iter().find(|(part, _)| *part == name).unwrap();
        today += &format!("{BEGIN}{name} -->\n\n{text}{END}{rest}");
        found.push(name);
    }
    assert_eq!(found, parts.each_ref().map(|(name, _)| *name));
    held(PAGE, &today, "PAGES");
}
