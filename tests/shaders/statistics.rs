//! What the driver says about a compiled program.

use std::collections::BTreeMap;

/// The driver's numbers, by its names for them in lower case. Versions of Mesa differ in the case.
#[derive(Default)]
pub(crate) struct Statistics(BTreeMap<String, u64>);

/// The driver's names of what the table shows, with the table's.
const COLUMNS: [(&str, &str); 10] = [
    ("Instructions", "instructions"),
    ("VGPRs", "VGPRs"),
    ("SGPRs", "SGPRs"),
    ("Spilled VGPRs", "spilled VGPRs"),
    ("Spilled SGPRs", "spilled SGPRs"),
    ("Scratch size", "scratch"),
    ("Subgroups per SIMD", "subgroups"),
    ("Inverse Throughput", "1/throughput"),
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
            let number = self.get(name).map_or("?".into(), |number| number.to_string());
            row + &format!(" {number:>13}")
        })
    }

    /// Returns a number, or `None` if the driver does not tell it.
    pub(crate) fn get(&self, name: &str) -> Option<u64> {
        self.0.get(&name.to_lowercase()).copied()
    }
}

impl<'a> FromIterator<(&'a str, u64)> for Statistics {
    fn from_iter<I: IntoIterator<Item = (&'a str, u64)>>(numbers: I) -> Statistics {
        Statistics(numbers.into_iter().map(|(name, number)| (name.to_lowercase(), number)).collect())
    }
}
