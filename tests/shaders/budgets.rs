//! What each program may need.

use crate::statistics::Statistics;

/// The version of Mesa that gave the budgets. Another one compiles otherwise.
pub(crate) const MESA: &str = "Mesa 22.3.6";

/// What a program needed when its budget was made. It may need 10 % more.
pub(crate) struct Budget {
    /// The file and the function.
    pub(crate) program: &'static str,
    instructions: u64,
    vgprs: u64,
    inverse_throughput: u64,
}

const fn budget(program: &'static str, instructions: u64, vgprs: u64, inverse_throughput: u64) -> Budget {
    Budget { program, instructions, vgprs, inverse_throughput }
}

/// In the order of the programs' names: instructions, VGPRs, inverse throughput.
#[rustfmt::skip]
pub(crate) const BUDGETS: &[Budget] = &[
    budget("atlas/g1_write_sites claim_east", 147, 16, 280),
    budget("atlas/g1_write_sites claim_west", 165, 16, 288),
    budget("atlas/g1_write_sites settle", 362, 16, 378),
    budget("atlas/g1_write_sites write", 97, 16, 212),
    budget("atlas/g2_voronoi_exact all_pixels", 262, 24, 355),
    budget("atlas/g2_voronoi_exact carry", 105, 8, 353),
    budget("atlas/g2_voronoi_exact columns", 90, 8, 135),
    budget("atlas/g2_voronoi_exact some", 348, 24, 830),
    budget("atlas/g2_voronoi_jfa flood", 655, 16, 233),
    budget("atlas/g2_voronoi_jfa seed", 709, 16, 242),
    budget("atlas/g3_islands find_all", 839, 16, 1805),
    budget("atlas/g3_islands find_left", 711, 16, 1072),
    budget("atlas/g3_islands find_near", 1127, 16, 1890),
    budget("atlas/g3_islands recolour", 115, 16, 305),
    budget("atlas/g4_vertices find", 1439, 64, 4332),
    budget("atlas/g5_count spread", 243, 16, 354),
    budget("atlas/g5_count sum", 104, 8, 182),
    budget("atlas/g6_triangles make", 601, 32, 2968),
    budget("atlas/give_back give_bits", 120, 8, 239),
    budget("atlas/give_back give_records", 100, 16, 124),
    budget("atlas/give_back give_starts", 80, 8, 109),
    budget("c4_flip claim", 1397, 56, 2129),
    budget("c4_flip commit", 119, 8, 187),
    budget("c4_flip relink", 326, 16, 398),
    budget("copy copy", 21, 8, 42),
    budget("decide decide", 1026, 64, 990),
];

/// What must be 0 under every version of Mesa.
pub(crate) const NEVER: [&str; 3] = ["Spilled SGPRs", "Spilled VGPRs", "Scratch size"];

/// A program's statistics, to be compared with its budget.
pub(crate) struct Verdict<'a> {
    /// `None` if the budgets are for another version of Mesa.
    pub(crate) budget: Option<&'a Budget>,
    pub(crate) statistics: &'a Statistics,
}

impl Verdict<'_> {
    /// Returns what is above the budget.
    pub(crate) fn complaints(&self) -> impl Iterator<Item = String> {
        let never = NEVER.map(|name| (name, 0));
        let budgeted = self.budget.map(|budget| {
            [
                ("Instructions", budget.instructions),
                ("VGPRs", budget.vgprs),
                ("Inverse Throughput", budget.inverse_throughput),
            ]
        });
        never
            .into_iter()
            .chain(budgeted.into_iter().flatten())
            .filter_map(|(name, before)| self.complaint(name, before))
    }

    fn complaint(&self, name: &str, before: u64) -> Option<String> {
        let most = before + before / 10;
        match self.statistics.get(name) {
            // Another version of Mesa may have other names.
            None => self.budget.map(|_| format!("the driver does not tell {name}")),
            Some(now) if now > most => Some(format!("{name} rose from {before} to {now}; at most {most} are allowed")),
            Some(_) => None,
        }
    }
}

#[test]
fn what_rises_is_named() {
    let tells = |numbers: [u64; 6], budget: Option<&Budget>| -> Vec<String> {
        let names = ["Spilled SGPRs", "Spilled VGPRs", "Scratch size", "Instructions", "VGPRs", "Inverse Throughput"];
        let statistics = names.into_iter().zip(numbers).collect();
        Verdict { budget, statistics: &statistics }.complaints().collect()
    };
    let small = budget("small", 100, 24, 50);
    assert_eq!(tells([0, 0, 0, 110, 26, 55], Some(&small)), [""; 0]);
    assert_eq!(
        tells([0, 0, 0, 111, 24, 56], Some(&small)),
        [
            "Instructions rose from 100 to 111; at most 110 are allowed",
            "Inverse Throughput rose from 50 to 56; at most 55 are allowed"
        ]
    );
    assert_eq!(tells([0, 0, 0, 1, 32, 1], Some(&small)), ["VGPRs rose from 24 to 32; at most 26 are allowed"]);
    // Under another version of Mesa.
    assert_eq!(tells([0, 0, 0, 999, 999, 999], None), [""; 0]);
    assert_eq!(
        tells([0, 2, 512, 1, 1, 1], None),
        [
            "Spilled VGPRs rose from 0 to 2; at most 0 are allowed",
            "Scratch size rose from 0 to 512; at most 0 are allowed"
        ]
    );
    let untold = |budget| Verdict { budget, statistics: &Statistics::default() }.complaints().count();
    assert_eq!([untold(None), untold(Some(&small))], [0, 6]);
}
