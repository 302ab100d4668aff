//! What the driver says about a compiled program.

use std::collections::BTreeMap;

/// The driver's numbers, by its names for them.
#[derive(Default)]
pub(crate) struct Statistics(pub(crate) BTreeMap<String, u64>);

/// The driver's names of what the table shows, with the table's.
const COLUMNS: [(&str, &str); 9] = [
    ("Instructions", "instructions"),
    ("VGPRs", "VGPRs"),
    ("SGPRs", "SGPRs"),
    ("Spilled VGPRs", "spilled"),
    ("Scratch size", "scratch"),
    ("Subgroups per SIMD", "subgroups"),
    ("Inverse Throughput", "throughput^-1"),
    ("LDS size", "LDS"),
    ("Code size", "code"),
];

impl Statistics {
    /// The head of the table.
    pub(crate) fn header() -> String {
        COLUMNS.iter().fold(format!("{:<36}", "program"), |row, (_, title)| row + &format!(" {title:>13}"))
    }

    /// Returns the row of the table for a program.
    pub(crate) fn row(&self, program: &str) -> String {
        COLUMNS.iter().fold(format!("{program:<36}"), |row, (name, _)| {
            let number = self.0.get(*name).map_or("?".into(), u64::to_string);
            row + &format!(" {number:>13}")
        })
    }

    /// Returns a number, or `None` if the driver does not tell it.
    pub(crate) fn get(&self, name: &str) -> Option<u64> {
        self.0.get(name).copied()
    }
}
