//! Broken files from the test data of other projects.

use std::path::Path;

use super::{Case, Read, Refused, case};

pub(super) fn cases(folder: &Path) -> Vec<Case> {
    let all = "max_malformed_fraction = 1.0";
    [
        ("1.2-no-points.las", "", Refused(3, "claims 1065 records, but all are missing")),
        ("1.2-no-points.las", all, Refused(3, "of 1065 read, 1065 are malformed")),
        ("1.2-with-color-clipped.las", "", Refused(3, "claims 1065 records, but 1 is missing")),
        ("1.2-with-color-clipped.las", all, Read(1065, 1, "1 are missing")),
        ("badheader.txt", "", Refused(3, "names 2 columns x")),
        ("badheader.txt", all, Refused(3, "name the columns with `columns`")),
        ("git-lfs-pointer.laz", "", Refused(3, "git lfs pull")),
        ("truncated-mid-chunk.laz", "", Refused(3, "max_malformed_fraction")),
        ("truncated-mid-chunk.laz", all, Read(73_403, 29_031, "29031 points are lost")),
        ("garbage_nVariableLength.las", "", Refused(3, "garbage_nVariableLength.las")),
        ("garbage_nVariableLength.las", all, Read(719, 1, "variable length records")),
        ("bad_vlr_count.las", "", Read(10, 0, "3 variable length records, but only 2")),
        ("simple-laszip-compressor-version-1.2r0.laz", "", Read(1065, 0, "")),
    ]
    .into_iter()
    .map(|(name, settings, gives)| {
        let bytes = std::fs::read(folder.join(name)).unwrap();
        let extension = [".las", ".laz", ".txt"].into_iter().find(|extension| name.ends_with(extension)).unwrap();
        // The sentence must name the file, which has another name here.
        case(name, extension, bytes, renamed(gives)).with(settings)
    })
    .collect()
}

fn renamed(gives: super::Gives) -> super::Gives {
    match gives {
        Refused(code, "garbage_nVariableLength.las") => Refused(code, "cloud.las"),
        gives => gives,
    }
}
