//! A file of limits.

mod check;
mod limit;
mod text;

use hertz_chain::{InputError, TomlFile};

use crate::file::text::FileText;

pub use limit::{Limit, Limits};

impl Limits {
    /// Reads a file of limits; `name` is what messages call it.
    ///
    /// # Errors
    /// One line with file, line, key, what is wrong, and what would do.
    pub fn parse(text: &str, name: &str) -> Result<Self, InputError> {
        let file = TomlFile::parse(text, name)?;
        let read: FileText = file.read()?;
        read.checked().map_err(|error| file.locate(error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quantity::Quantity;
    use crate::template::TEMPLATE;

    #[test]
    fn the_template_is_read_and_has_every_quantity() {
        let limits = Limits::parse(TEMPLATE, "limits.toml").unwrap();
        let mask = limits
            .limits
            .iter()
            .find_map(|limit| limit.mask.as_ref())
            .unwrap();
        assert_eq!(mask.range(), (500.0, 5000.0));
        // The limits in its remarks are read, too.
        let all: String = TEMPLATE
            .lines()
            .map(|line| format!("{}\n", line.strip_prefix("#:").unwrap_or(line)))
            .collect();
        let all = Limits::parse(&all, "limits.toml").unwrap();
        for name in Quantity::names().split(", ") {
            let has = |limit: &Limit| limit.quantity.name().split(' ').next() == Some(name);
            assert!(all.limits.iter().any(has), "{name}");
        }
    }

    /// Keys of a limit, with `; ` between them, and the refusal of each file with such a limit.
    const REFUSALS: &str = r#"
quantity = "peak_forse"; max = 1.0 | 2: limit[1].quantity: `peak_forse` is not a quantity; give one of
quantity = "ratio" | limit[1]
quantity = "ratio"; maximum = 1.0 | 3: limit[1].maximum: unknown key
quantity = "ratio"; max = nan | 3: limit[1].max: it is not a finite number
quantity = "ratio"; min = 2.0; max = 1.0 | 3: limit[1].min: min 2 is above max 1
quantity = "srs"; max = 1.0 | limit[1].mask: a limit on srs needs a mask
quantity = "srs"; mask = [{ max = 3.0 }, { frequency = 9.0, max = 1.0 }] | the key `frequency` is missing
quantity = "srs"; mask = [{ frequency = 9.0, max = 1.0 }] | limit[1].mask: it has fewer than two points
quantity = "srs"; mask = [{ frequency = 9, max = 1 }, { frequency = 9, max = 1 }] | limit[1].mask[2].frequency: 9 Hz is not above 0 and above the point before
quantity = "srs"; mask = [{ frequency = 9, max = 1 }, { frequency = 10, min = 1 }] | limit[1].mask[2].frequency: this point has other limits than the point before
quantity = "srs"; mask = [{ frequency = 9.0 }, { frequency = 10.0, min = 1.0 }] | limit[1].mask[1]
quantity = "srs"; quality = 0.5; mask = [{ frequency = 9, max = 1 }, { frequency = 10, max = 1 }] | limit[1].quality: 0.5 is not a quality
quantity = "ratio"; max = 1.0; quality = 10.0 | limit[1].quality: only a limit on srs has this key
quantity = "ratio"; max = 1.0; of = "ratio" | limit[1].of: only a limit on drift has this key
quantity = "drift"; max = 1.0; of = "srs" | limit[1].of: `srs` is not a value of a strike
quantity = "ratio"; max = 1.0; beads = [300] | limit[1].beads"#;

    #[test]
    fn a_refusal_names_line_and_key_in_one_line() {
        let refusals = REFUSALS.trim_start().lines().map(|line| {
            let (limit, refusal) = line.split_once(" | ").unwrap();
            (format!("[[limit]]\n{}", limit.replace("; ", "\n")), refusal)
        });
        let none = (String::new(), "1: the file has no limit; add a [[limit]]");
        let rule = "rule = \"guarded\"\n[[limit]]\nquantity = \"ratio\"\nmax = 1.0";
        for (text, expected) in refusals.chain([none, (rule.to_owned(), "1: rule")]) {
            let refused = Limits::parse(&text, "l.toml").unwrap_err().to_string();
            assert!(refused.contains(expected), "{refused}\n{expected}");
            assert_eq!(refused.lines().count(), 1, "{refused}");
            assert!(
                refused.starts_with("l.toml:") && refused.contains("; "),
                "{refused}"
            );
        }
    }
}
