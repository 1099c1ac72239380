//! What the host reads from the image's ELF: whether it is for this processor, its functions, and where its
//! log is.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use object::{Object, ObjectSymbol};

use super::error::RunError;
use crate::exchange::FunctionRange;

/// An image with its bytes, and its functions by demangled name.
pub(super) struct Image {
    path: PathBuf,
    pub(super) bytes: Vec<u8>,
    /// Demangled name, first address, bytes.
    functions: Vec<(String, u32, u32)>,
    pub(super) rtt: Option<u32>,
}

impl Image {
    /// # Errors
    /// [`RunError::ImageMissing`] and [`RunError::NotArmElf`].
    pub(super) fn read(path: &Path) -> Result<Self, RunError> {
        let bytes = std::fs::read(path).map_err(|source| RunError::ImageMissing(path.into(), source))?;
        let not_arm = |reason: String| RunError::NotArmElf(path.into(), reason);
        let elf = object::File::parse(&*bytes).map_err(|e| not_arm(e.to_string()))?;
        if elf.format() != object::BinaryFormat::Elf || elf.architecture() != object::Architecture::Arm {
            return Err(not_arm(format!(
                "{:?} for {:?}",
                elf.format(),
                elf.architecture()
            )));
        }

        let mut functions = Vec::new();
        let mut rtt = None;
        for symbol in elf.symbols() {
            let Ok(name) = symbol.name() else { continue };
            match symbol.kind() {
                object::SymbolKind::Text if symbol.size() > 0 => functions.push((
                    // The alternate form leaves the hash out.
                    format!("{:#}", rustc_demangle::demangle(name)),
                    // Bit 0 of a function's address says Thumb.
                    symbol.address() as u32 & !1,
                    symbol.size() as u32,
                )),
                _ if name == "_SEGGER_RTT" => rtt = Some(symbol.address() as u32),
                _ => {}
            }
        }
        Ok(Self {
            path: path.into(),
            functions,
            rtt,
            bytes,
        })
    }

    /// The functions whose demangled path contains the pattern of an entry, each with the label of that
    /// entry. The labels come in the order in which they are first named.
    ///
    /// # Errors
    /// [`RunError::NoSymbols`] where functions are asked for and the image names none.
    pub(super) fn find(
        &self,
        wanted: &[(String, String)],
    ) -> Result<(Vec<String>, Vec<FunctionRange>), RunError> {
        if !wanted.is_empty() && self.functions.is_empty() {
            return Err(RunError::NoSymbols(self.path.clone()));
        }
        let mut labels: Vec<String> = Vec::new();
        // A set, since two patterns of a label may find the same function, or a function may have two names
        // (folded code).
        let mut ranges = BTreeSet::new();
        for (label, pattern) in wanted {
            let index = labels.iter().position(|l| l == label).unwrap_or_else(|| {
                labels.push(label.clone());
                labels.len() - 1
            });
            for (name, start, bytes) in &self.functions {
                if name.contains(pattern) {
                    ranges.insert((index, *start, start + bytes));
                }
            }
        }
        let ranges = ranges
            .into_iter()
            .map(|(label, start, end)| FunctionRange { label, start, end })
            .collect();
        Ok((labels, ranges))
    }
}
