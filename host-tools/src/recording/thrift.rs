//! What is in a struct of Apache Thrift's compact protocol, before a library reads it.
//!
//! # Design
//! The Parquet library believes a field to have the type that it should have, and passes over what it does
//! not know. It takes no byte for an entry of a list of booleans, nor of a map of them. So a few bytes can
//! name 2^31 entries and keep a core busy for seconds, and a file has room for many such lists. A struct is
//! gone through here before: the fields that the library knows have their types, and nothing holds a list of
//! booleans or a map. All else takes a byte at least for each entry.

use std::collections::BTreeMap;
use std::io::{self, ErrorKind, Read};

/// Structs and lists that lie within each other, at most; as many as the library allows.
const DEPTH: u8 = 64;

/// What a value is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Kind {
    Boolean,
    Byte,
    /// Of 16, 32 or 64 bits, which are written alike; an enumeration too.
    Whole,
    Double,
    /// Or text.
    Bytes,
    /// Of values of one kind.
    List(&'static Kind),
    Struct(Fields),
}

/// The fields of a struct that a reader knows, by their numbers.
pub(super) type Fields = &'static [(i64, Kind)];

/// Types of values, in four bits.
mod bits {
    pub(super) const STOP: u8 = 0;
    pub(super) const TRUE: u8 = 1;
    pub(super) const FALSE: u8 = 2;
    pub(super) const BYTE: u8 = 3;
    pub(super) const I16: u8 = 4;
    pub(super) const I64: u8 = 6;
    pub(super) const DOUBLE: u8 = 7;
    pub(super) const BYTES: u8 = 8;
    pub(super) const LIST: u8 = 9;
    pub(super) const SET: u8 = 10;
    pub(super) const STRUCT: u8 = 12;
}

impl Kind {
    fn is_written_as(self, kind: u8) -> bool {
        match self {
            Self::Boolean => matches!(kind, bits::TRUE | bits::FALSE),
            Self::Byte => kind == bits::BYTE,
            Self::Whole => matches!(kind, bits::I16..=bits::I64),
            Self::Double => kind == bits::DOUBLE,
            Self::Bytes => kind == bits::BYTES,
            Self::List(_) => kind == bits::LIST,
            Self::Struct(_) => kind == bits::STRUCT,
        }
    }
}

/// The whole numbers of a struct and of the structs in it, and the lengths of its texts. Each has the field
/// that it is in, after the fields and the places in lists around that.
pub(super) type Numbers = BTreeMap<Vec<i64>, i64>;

/// The field of a list of structs, and fields of the structs.
pub(super) type ListFields = (i64, &'static [i64]);

/// The numbers in the fields of a struct that are known, after all of it was read. Of lists, it tells some
/// fields of the structs in one list, by the list's field and theirs: as few as are needed, since a file may
/// have millions of structs.
///
/// # Errors
/// It does not end, a field has another type or is there twice, or it holds what nothing of Parquet's holds.
pub(super) fn whole_numbers(
    bytes: impl Read,
    fields: Fields,
    list: Option<ListFields>,
) -> io::Result<Numbers> {
    let mut walk = Walk {
        bytes,
        list,
        path: Vec::new(),
        numbers: Numbers::new(),
    };
    walk.fields(fields, DEPTH, true)?;
    Ok(walk.numbers)
}

fn odd<T>(what: &str) -> io::Result<T> {
    Err(io::Error::new(ErrorKind::InvalidData, what))
}

struct Walk<R> {
    bytes: R,
    list: Option<ListFields>,
    path: Vec<i64>,
    numbers: Numbers,
}

impl<R: Read> Walk<R> {
    fn byte(&mut self) -> io::Result<u8> {
        let mut byte = [0];
        self.bytes.read_exact(&mut byte)?;
        Ok(byte[0])
    }

    /// A number of seven bits a byte, the least first.
    fn varint(&mut self) -> io::Result<u64> {
        let mut number = 0;
        for place in 0..10 {
            let byte = self.byte()?;
            number |= u64::from(byte & 0x7F) << (7 * place);
            if byte & 0x80 == 0 {
                return Ok(number);
            }
        }
        odd("it holds a number of more than 64 bits")
    }

    /// The same with the sign in its lowest bit.
    fn zigzag(&mut self) -> io::Result<i64> {
        let number = self.varint()?;
        Ok((number >> 1) as i64 ^ -((number & 1) as i64))
    }

    fn pass(&mut self, bytes: u64) -> io::Result<()> {
        match io::copy(&mut self.bytes.by_ref().take(bytes), &mut io::sink())? == bytes {
            true => Ok(()),
            false => Err(ErrorKind::UnexpectedEof.into()),
        }
    }

    /// Goes through a struct to its end.
    fn fields(&mut self, known: Fields, depth: u8, told: bool) -> io::Result<()> {
        let (mut field, mut seen) = (0_i64, Vec::new());
        loop {
            let head = self.byte()?;
            let (step, bits) = (head >> 4, head & 0xF);
            if bits == bits::STOP {
                return Ok(());
            }
            field = match step {
                0 => self.zigzag()?,
                _ => field.saturating_add(step.into()),
            };
            let kind = known.iter().find(|(known, _)| *known == field);
            if kind.is_some() {
                if seen.contains(&field) {
                    return odd("a field is there twice");
                }
                seen.push(field);
            }
            self.path.push(field);
            self.value(bits, kind.map(|(_, kind)| *kind), depth, told)?;
            self.path.pop();
        }
    }

    /// Whether this is no field in a list, or one that is asked for.
    fn is_told(&self) -> bool {
        match (self.list, &self.path[..]) {
            (Some((list, wanted)), [first, _, rest @ ..]) if list == *first => {
                matches!(rest, [field] if wanted.contains(field))
            }
            _ => true,
        }
    }

    /// Goes through a value, and keeps it if it is a whole number that is to be told, or a text's length. Its
    /// kind is known or may be any.
    fn value(&mut self, bits: u8, kind: Option<Kind>, depth: u8, told: bool) -> io::Result<()> {
        let Some(depth) = depth.checked_sub(1) else {
            return odd("too many structs lie within each other");
        };
        if kind.is_some_and(|kind| !kind.is_written_as(bits)) {
            return odd("a field has another type than it should have");
        }
        let keeps = told && kind.is_some() && self.is_told();
        match bits {
            // A field that is one has no byte beside its head.
            bits::TRUE | bits::FALSE => {}
            bits::BYTE => drop(self.byte()?),
            bits::I16..=bits::I64 => {
                let number = self.zigzag()?;
                if keeps {
                    self.numbers.insert(self.path.clone(), number);
                }
            }
            bits::DOUBLE => self.pass(8)?,
            bits::BYTES => {
                let length = self.varint()?;
                self.pass(length)?;
                if keeps {
                    let length = i64::try_from(length).unwrap_or(i64::MAX);
                    self.numbers.insert(self.path.clone(), length);
                }
            }
            bits::LIST | bits::SET => {
                let head = self.byte()?;
                let (size, bits) = (head >> 4, head & 0xF);
                let size = if size == 15 { self.varint()? } else { size.into() };
                if size > 0 && matches!(bits, bits::TRUE | bits::FALSE) {
                    return odd("it holds a list of booleans");
                }
                let of = match kind {
                    Some(Kind::List(of)) => Some(*of),
                    _ => None,
                };
                let told = told && self.list.is_some_and(|(list, _)| self.path == [list]);
                for place in 0..size {
                    self.path.push(place as i64);
                    self.value(bits, of, depth, told)?;
                    self.path.pop();
                }
            }
            bits::STRUCT => {
                let fields = match kind {
                    Some(Kind::Struct(fields)) => fields,
                    _ => &[],
                };
                self.fields(fields, depth, told)?;
            }
            _ => return odd("it holds a map, or what has no name"),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_are_told_by_their_fields() {
        const FIELDS: Fields = &[
            (1, Kind::Whole),
            (2, Kind::Whole),
            (3, Kind::Struct(&[(1, Kind::Whole)])),
            (20, Kind::Whole),
        ];
        // Fields 1, 2, 3 (a struct with a field 1), 20 in the long form; a boolean, a double and a text
        // between.
        let bytes = [
            &[0x15, 3, 0x16, 0xAC, 2, 0x1C, 0x15, 9, 0][..],
            &[0x11, 0x17, 0, 0, 0, 0, 0, 0, 0, 0, 0x18, 2, b'a', b'b'],
            &[0x05, 40, 0x80, 1, 0x19, 0x25, 1, 2, 0],
        ]
        .concat();
        let numbers = whole_numbers(&*bytes, FIELDS, None).unwrap();
        let wanted = [(vec![1], -2), (vec![2], 150), (vec![3, 1], -5), (vec![20], 64)];
        assert_eq!(Vec::from_iter(numbers), wanted);
        // Those that nobody knows would take memory.
        assert_eq!(whole_numbers(&*bytes, &[], None).unwrap(), Numbers::new());
        for cut in 0..bytes.len() {
            let error = whole_numbers(&bytes[..cut], &[], None).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::UnexpectedEof, "{cut}");
        }
    }

    #[test]
    fn what_costs_without_end_is_refused() {
        let says = |bytes: &[u8]| whole_numbers(bytes, &[], None).unwrap_err().to_string();
        for kind in [0xF1, 0xF2] {
            let list = [0x19, kind, 0xFF, 0xFF, 0xFF, 0xFF, 0x07, 0];
            assert_eq!(says(&list), "it holds a list of booleans");
        }
        // An empty one costs nothing.
        assert!(whole_numbers(&[0x19, 0x01, 0][..], &[], None).unwrap().is_empty());
        assert_eq!(says(&[0x1B, 1, 0x11]), "it holds a map, or what has no name");
        assert_eq!(says(&[0x1C; 100]), "too many structs lie within each other");
        assert_eq!(says(&[0x19; 100]), "too many structs lie within each other");
        assert_eq!(
            says(&[[0x15].as_slice(), &[0x80; 11]].concat()),
            "it holds a number of more than 64 bits"
        );
        let list = [0x19, 0xF5, 0xFF, 0xFF, 0xFF, 0xFF, 0x07, 0];
        assert_eq!(
            whole_numbers(&list[..], &[], None).unwrap_err().kind(),
            ErrorKind::UnexpectedEof
        );
    }

    #[test]
    fn a_field_that_is_known_has_its_type() {
        const FIELDS: Fields = &[
            (1, Kind::Whole),
            (2, Kind::List(&Kind::Struct(&[(1, Kind::Bytes)]))),
            (3, Kind::Boolean),
        ];
        let sound = [0x15, 2, 0x19, 0x1C, 0x18, 1, b'a', 0, 0x12, 0];
        assert_eq!(whole_numbers(&sound[..], FIELDS, None).unwrap()[&vec![1]], 1);
        for (place, other) in [(0, 0x13), (3, 0x18), (4, 0x15), (8, 0x15)] {
            let mut wrong = sound;
            wrong[place] = other;
            let error = whole_numbers(&wrong[..], FIELDS, None).unwrap_err();
            assert_eq!(
                error.to_string(),
                "a field has another type than it should have",
                "{place}"
            );
        }
    }

    #[test]
    fn numbers_in_one_list_are_told_by_their_places_in_it() {
        // Field 1 is a list of two structs with fields 4 and 5, the second of which has a third one and a
        // text of three bytes; field 2 one of two numbers.
        const STRUCT: Kind = Kind::Struct(&[
            (4, Kind::Whole),
            (5, Kind::Whole),
            (6, Kind::Whole),
            (7, Kind::Bytes),
        ]);
        const FIELDS: Fields = &[
            (1, Kind::List(&STRUCT)),
            (2, Kind::List(&Kind::Whole)),
            (3, STRUCT),
        ];
        let first = [
            0x19, 0x2C, 0x45, 2, 0x15, 6, 0, 0x45, 0, 0x15, 8, 0x15, 14, 0x18, 3, b'a', b'b', b'c', 0,
        ];
        let others = [0x19, 0x25, 10, 12, 0x1C, 0x55, 4, 0, 0];
        let bytes = [&first[..], &others].concat();
        let told = |list| Vec::from_iter(whole_numbers(&bytes[..], FIELDS, list).unwrap());
        let outside = [(vec![3, 5], 2)];
        let of_one = [(vec![1, 0, 5], 3), (vec![1, 1, 5], 4), outside[0].clone()];
        assert_eq!(told(Some((1, &[5]))), of_one);
        let of_two = [(vec![1, 1, 6], 7), (vec![1, 1, 7], 3), outside[0].clone()];
        assert_eq!(told(Some((1, &[6, 7]))), of_two);
        assert_eq!(told(Some((2, &[5]))), outside);
        assert_eq!(told(None), outside);
    }

    #[test]
    fn a_field_that_is_known_is_there_once() {
        let twice = [0x15, 2, 0x05, 2, 4, 0];
        assert!(whole_numbers(&twice[..], &[], None).is_ok());
        let error = whole_numbers(&twice[..], &[(1, Kind::Whole)], None).unwrap_err();
        assert_eq!(error.to_string(), "a field is there twice");
    }
}
