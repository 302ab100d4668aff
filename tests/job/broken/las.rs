//! Uncompressed LAS: every header field wrong in turn, in every version; variable length records; truncated files.

use super::{Case, Gives, Read, Refused, case};
use crate::las_file::LasFile;

/// The number of records of a file.
const COUNT: u64 = 200;

/// Returns a sound file of version 1.`minor`.
fn sound(minor: u8) -> LasFile {
    LasFile::new(minor, [0, 1, 2, 4, 7][minor as usize], 0, COUNT as usize)
}

fn patched(bytes: &[u8], at: usize, value: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    bytes[at..at + value.len()].copy_from_slice(value);
    bytes
}

fn double(value: f64) -> Vec<u8> {
    value.to_le_bytes().to_vec()
}

/// Returns name, position, wrong value and its result, for the fields that all versions have.
fn common_fields() -> Vec<(&'static str, usize, Vec<u8>, Gives)> {
    let nothing_wrong = || Read(COUNT, 0, "");
    vec![
        ("signature", 0, b"LASX".to_vec(), Refused(3, "does not begin with the letters LASF")),
        ("source id", 4, vec![0xff; 2], nothing_wrong()),
        ("global encoding", 6, vec![0xff; 2], nothing_wrong()),
        ("project id", 8, vec![0xff; 16], nothing_wrong()),
        ("major version", 24, vec![2], Refused(3, "LAS version 2.")),
        ("minor version", 25, vec![9], Refused(3, "LAS version 1.9")),
        ("system and software", 26, vec![0xff; 64], nothing_wrong()),
        ("day and year", 90, vec![0xff; 4], nothing_wrong()),
        ("header size 0", 94, vec![0; 2], Refused(3, "claims a header of 0 bytes")),
        ("header size beyond", 94, vec![0xff; 2], Refused(3, "the header ends at 65535")),
        ("points at 0", 96, vec![0; 4], Refused(3, "points begin at byte 0")),
        ("points beyond", 96, vec![0xff; 4], Refused(3, "points begin at byte 4294967295")),
        ("points a byte late", 96, vec![], Refused(3, "1 is missing")),
        ("number of VLRs", 100, vec![0xff; 4], Read(COUNT, 0, "4294967295 variable length records, but only 0")),
        ("point format", 104, vec![11], Refused(3, "format 11")),
        ("point format 63", 104, vec![63], Refused(3, "format 63")),
        ("compression bit", 104, vec![], Refused(3, "no LASzip record")),
        ("record length 0", 105, vec![0; 2], Refused(3, "claims point records of 0 bytes")),
        ("record length", 105, vec![0xff; 2], Refused(3, "all are missing")),
        ("points by return", 111, vec![0xff; 20], nothing_wrong()),
        ("scale 0", 131, double(0.0), Refused(3, "scale of x")),
        ("scale negative", 139, double(-0.01), Refused(3, "scale of y")),
        ("scale NaN", 147, double(f64::NAN), Refused(3, "scale of z")),
        ("scale infinite", 131, double(f64::INFINITY), Refused(3, "scale of x")),
        ("scale tiny", 139, double(1e-300), Refused(3, "scale of y")),
        ("scale huge", 147, double(1e300), Refused(3, "scale of z")),
        ("scale denormal", 131, double(5e-324), Refused(3, "scale of x")),
        ("scale of 1e-18", 131, double(1e-18), Refused(3, "offset of x")),
        ("scale of 1e12", 139, double(1e12), Refused(3, "make no triangle in steps of 1")),
        ("offset NaN", 155, double(f64::NAN), Refused(3, "offset of x")),
        ("offset infinite", 163, double(f64::NEG_INFINITY), Refused(3, "offset of y")),
        ("offset huge", 171, double(1e300), Refused(3, "offset of z")),
        ("offset of 1e20", 155, double(1e20), Refused(3, "offset of x")),
        ("bounds NaN", 179, double(f64::NAN), Refused(3, "bounds")),
        ("bounds infinite", 219, double(f64::INFINITY), Refused(3, "bounds")),
        ("bounds absurd", 179, double(1e300), nothing_wrong()),
        ("bounds inside out", 187, double(1e9), nothing_wrong()),
    ]
}

/// Returns the same for the fields that not all versions have.
fn later_fields(minor: u8) -> Vec<(&'static str, usize, Vec<u8>, Gives)> {
    let mut fields = Vec::new();
    if minor >= 3 {
        fields.push(("waveforms", 227, vec![0xff; 8], Read(COUNT, 0, "")));
    }
    if minor >= 4 {
        fields.extend([
            ("EVLRs beyond", 235, vec![0xff; 12], Read(COUNT, 0, "4294967295 extended variable length records")),
            ("EVLRs in the points", 235, [&400u64.to_le_bytes()[..], &[1, 0, 0, 0]].concat(), Refused(3, "missing: ")),
            ("64-bit count", 247, vec![0xff; 8], Refused(3, "18446744073709551615 points")),
            ("64-bit count of 2^40", 247, (1u64 << 40).to_le_bytes().to_vec(), Refused(2, "2^40")),
            (
                "64-bit count too large",
                247,
                201u64.to_le_bytes().to_vec(),
                Refused(3, "claims 201 records, but 1 is missing"),
            ),
            ("64-bit count too small", 247, 150u64.to_le_bytes().to_vec(), Read(150, 0, "")),
            ("two counts", 107, vec![0xff; 4], Read(COUNT, 0, "two point counts")),
            ("no count", 247, vec![0; 8], Refused(3, "no point is left")),
            ("points by return", 255, vec![0xff; 120], Read(COUNT, 0, "")),
        ]);
    } else {
        fields.extend([
            ("count", 107, vec![0xff; 4], Refused(3, "claims 4294967295 records")),
            ("count too large", 107, 201u32.to_le_bytes().to_vec(), Refused(3, "claims 201 records, but 1 is missing")),
            ("count too small", 107, 150u32.to_le_bytes().to_vec(), Read(150, 0, "")),
            ("no count", 107, vec![0; 4], Refused(3, "no point is left")),
        ]);
    }
    fields
}

/// Returns a case for every wrong field in every version.
pub(super) fn header_fields() -> Vec<Case> {
    let mut cases = Vec::new();
    for minor in 0..=4 {
        let file = sound(minor);
        let bytes = file.las();
        for (name, at, value, gives) in common_fields().into_iter().chain(later_fields(minor)) {
            let value = match name {
                "points a byte late" => {
                    (u32::from_le_bytes(bytes[96..100].try_into().unwrap()) + 1).to_le_bytes().into()
                }
                "compression bit" => vec![file.format | 0x80],
                _ => value,
            };
            cases.push(case(format!("1.{minor}, {name}"), ".las", patched(&bytes, at, &value), gives));
        }
    }
    cases
}

/// Returns `bytes` with one more variable length record before the points. It says that it has `length` bytes.
fn with_record(bytes: &[u8], user: &str, id: u16, length: u16, data: &[u8]) -> Vec<u8> {
    let size = u16::from_le_bytes(bytes[94..96].try_into().unwrap()) as usize;
    let mut record = vec![0; 54];
    record[2..2 + user.len()].copy_from_slice(user.as_bytes());
    record[18..20].copy_from_slice(&id.to_le_bytes());
    record[20..22].copy_from_slice(&length.to_le_bytes());
    record.extend(data);
    let header = patched(&bytes[..size], 96, &((size + record.len()) as u32).to_le_bytes());
    [&patched(&header, 100, &[1, 0, 0, 0])[..], &record, &bytes[size..]].concat()
}

/// Returns cases of wrong records between header and points, wrong points, and files that end too early.
pub(super) fn records_and_cuts() -> Vec<Case> {
    let plain = sound(2).las();
    let text = |data: &[u8]| with_record(&plain, "LASF_Projection", 2112, data.len() as u16, data);
    let keys = |data: &[u8]| with_record(&plain, "LASF_Projection", 34735, data.len() as u16, data);
    let deep = "A[".repeat(30_000);
    let unit = |factor: &str| format!("PROJCS[\"a\",UNIT[\"m\",{factor}]]").into_bytes();
    let unreadable = || Read(COUNT, 0, "not well-known text");
    let steps_of_1e27 = || {
        let text = unit("1e-20");
        let bytes = with_record(&sound(4).las(), "LASF_Projection", 2112, text.len() as u16, &text);
        (0..3).fold(bytes, |bytes, axis| patched(&bytes, 131 + 8 * axis, &double(1e27)))
    };
    let mut cases = vec![
        case(
            "VLR longer than the file",
            ".las",
            with_record(&plain, "a", 1, u16::MAX, b""),
            Read(COUNT, 0, "only 0 fit"),
        ),
        case(
            "VLR of all bytes",
            ".las",
            with_record(&plain, "\u{ff}\u{ff}", 0xffff, 4, &[0xff; 4]),
            Read(COUNT, 0, ""),
        ),
        case("WKT without end", ".las", text(deep.as_bytes()), unreadable()),
        case("WKT of zero bytes", ".las", text(&[0; 100]), Read(COUNT, 0, "")),
        case("WKT of noise", ".las", text(&[0xfe; 1000]), unreadable()),
        case("WKT with half a quote", ".las", text(b"PROJCS[\"a"), unreadable()),
        case("WKT with an absurd unit", ".las", text(&unit("1e300")), Refused(2, "set [input] unit")),
        case("WKT with a tiny unit", ".las", text(&unit("1e-300")), Refused(2, "set [input] unit")),
        case("steps of 1e27 in a unit of 1e-20", ".las", steps_of_1e27(), Refused(2, "more digits")),
        case("WKT with a unit that is no number", ".las", text(&unit("nan")), Read(COUNT, 0, "")),
        case("GeoTIFF that counts too far", ".las", keys(&[0xff; 64]), Read(COUNT, 0, "")),
        case("GeoTIFF of three bytes", ".las", keys(&[1, 0, 1]), Read(COUNT, 0, "")),
        case("nothing after the letters", ".las", b"LASF".to_vec(), Refused(3, "too short for a LAS header")),
        case("a header cut", ".las", plain[..226].to_vec(), Refused(3, "226 bytes of at least 227")),
        case("a header of 1.4 cut", ".las", sound(4).las()[..374].to_vec(), Refused(3, "LAS 1.4 has 375")),
        case("a header alone", ".las", plain[..227].to_vec(), Refused(3, "200 records, but all are missing")),
        case("a byte more", ".las", [&plain[..], &[0]].concat(), Read(COUNT, 0, "")),
        case("zeros", ".las", vec![0; 10_000], Refused(3, "LASF")),
        case("noise", ".las", (0..10_000u32).map(|i| ((i * i) >> 3) as u8).collect(), Refused(3, "LASF")),
    ];
    let length = sound(2).length() as usize;
    for eighth in 1..8 {
        let cut = 227 + (plain.len() - 227) * eighth / 8 - 1;
        let missing = COUNT - ((cut - 227) / length) as u64;
        let name = format!("cut after {eighth} of 8");
        cases.push(case(&name, ".las", plain[..cut].to_vec(), Refused(3, "missing: ")));
        cases.push(
            case(&name, ".las", plain[..cut].to_vec(), Read(COUNT, missing, "missing"))
                .with("max_malformed_fraction = 1.0"),
        );
    }
    for (name, at, value) in [("x", 0, i32::MIN), ("y", 4, i32::MAX), ("z", 8, i32::MIN)] {
        let point = patched(&plain, 227 + 50 * length + at, &value.to_le_bytes());
        // For its sake the lattice would be too coarse for all others.
        cases.push(case(format!("a wild {name}"), ".las", point, Refused(3, "point 50: ")));
    }
    cases
}
