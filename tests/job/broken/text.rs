//! Texts that are not tables, or barely.

use super::{Case, Content, Gives, Read, Refused, case};

const ROWS: &str = "0,0,1\n10,0,2\n10,10,3\n0,10,4\n5,5,5\n";

fn rows_and(more: &str) -> Vec<u8> {
    format!("{ROWS}{more}").into_bytes()
}

fn utf16(text: &str, mark: [u8; 2]) -> Vec<u8> {
    let bytes = |unit: u16| if mark == [0xff, 0xfe] { unit.to_le_bytes() } else { unit.to_be_bytes() };
    mark.into_iter().chain(text.encode_utf16().flat_map(bytes)).collect()
}

fn long(name: &str, bytes: &[u8], times: usize, gives: Gives) -> Case {
    Case { content: Content::Repeated(bytes.to_vec(), times), ..case(name, ".csv", Vec::new(), gives) }
}

pub(super) fn cases() -> Vec<Case> {
    let megabyte = vec![b'7'; 1 << 20];
    let mut cases = vec![
        long("100 MB without a line end", &megabyte, 100, Refused(3, "")),
        long("100 MB of commas", &vec![b','; 1 << 20], 100, Refused(3, "")),
        long("100 MB of line ends", &vec![b'\n'; 1 << 20], 100, Refused(3, "no line with numbers")),
        long("100 MB of quotes", &vec![b'"'; 1 << 20], 100, Refused(3, "")),
        long("100 MB of zero bytes", &vec![0; 1 << 20], 100, Refused(3, "neither LAS nor LAZ nor UTF-8 text")),
        long("a million columns", b"1,", 1_000_000, Refused(3, "")),
    ];
    for (name, bytes, gives) in [
        ("nothing", Vec::new(), Refused(3, "is empty")),
        ("one line end", b"\n".to_vec(), Refused(3, "no line with numbers")),
        ("a mark alone", vec![0xef, 0xbb, 0xbf], Refused(3, "no line with numbers")),
        ("comments alone", b"# a\n// b\n".to_vec(), Refused(3, "no line with numbers")),
        ("a header alone", b"x,y,z\n".to_vec(), Refused(3, "no point is left")),
        ("a header twice", [b"x,y,z\n", ROWS.as_bytes(), b"x,y,z\n"].concat(), Refused(3, "line 7: column 1 (x)")),
        ("a header without z", b"x,y,height\n1,2,3\n".to_vec(), Refused(3, "three different places")),
        ("a header without y", b"x,why,z\n1,2,3\n".to_vec(), Refused(3, "names no column y")),
        ("words", b"once upon a time\nthere was\n".to_vec(), Refused(3, "names no column x")),
        (
            "names below a title",
            b"; Site: Kingsford Rd\n; Easting, Northing, Bottom\n1,2,3\n2,3,4\n".to_vec(),
            Refused(3, "the line of names, \"; Easting, Northing, Bottom\", names no column z"),
        ),
        ("one number a line", b"1\n2\n3\n4\n".to_vec(), Refused(3, "")),
        ("two numbers a line", b"1,2\n3,4\n5,6\n".to_vec(), Refused(3, "")),
        ("decimal commas", b"1,5;2,5;3,5\n1,6;2,5;3,5\n2,5;9,5;1\n".to_vec(), Read(3, 0, "")),
        ("commas between thousands", b"1,500;2,500;3\n1,600;2,500;3\n".to_vec(), Refused(3, "between thousands")),
        ("UTF-16, little end first", utf16(ROWS, [0xff, 0xfe]), Refused(3, "UTF-16")),
        ("UTF-16, big end first", utf16(ROWS, [0xfe, 0xff]), Refused(3, "UTF-16")),
        ("UTF-16 without a mark", utf16(ROWS, [0xff, 0xfe])[2..].to_vec(), Refused(3, "neither LAS nor LAZ nor UTF-8")),
        ("a page", b"<!DOCTYPE html>\n<html><body>404</body></html>\n".to_vec(), Refused(3, "web page")),
        ("JSON", b"{\"points\": [[1, 2, 3], [4, 5, 6]]}\n".to_vec(), Refused(3, "is JSON")),
        ("a line cut", rows_and("7,8"), Refused(3, "line 6: column 3 (z) is missing")),
        (
            "the number of points of a second scan",
            rows_and("5\n1,2,3\n"),
            Refused(3, "number of points of another scan"),
        ),
        (
            "a number of points with commas",
            b"1,500\n1 2 3\n4 5 6\n7 8 1\n".to_vec(),
            Refused(3, "is not a point count"),
        ),
        ("PTX after a blank line", b"\n10\n20\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n".to_vec(), Refused(3, "is PTX")),
        ("not a number", rows_and("nan,1,2\n"), Refused(3, "line 6: column 1 (x) is \"nan\"")),
        ("fewer points than the first line promises", [b"7\n", ROWS.as_bytes()].concat(), Refused(3, "2 are missing")),
        (
            "fewer points than the first line promises, and names",
            [b"7\nx y z\n", ROWS.as_bytes()].concat(),
            Refused(3, "2 are missing"),
        ),
        ("more points than the first line promises", [b"4\n", ROWS.as_bytes()].concat(), Read(5, 0, "gives 4 points")),
        ("a height of twenty digits", rows_and("1,1,12345678901234567890\n"), Refused(3, "column 3 (z)")),
        (
            "a comment that names other columns",
            b"# time, lat, lon, level\n1.5,2,3.5,4\n2.5,3,3.5,4\n3.5,2,7.5,4\n".to_vec(),
            Refused(3, "names no column z"),
        ),
        (
            "a second header, in another order",
            [b"# E N H\n", ROWS.as_bytes(), b"# N E H\n", ROWS.as_bytes()].concat(),
            Refused(3, "line 7: the comment \"# N E H\" names other columns than line 1 (\"# E N H\"): split the file"),
        ),
        (
            "a second header, in other units",
            [b"x[m],y[m],z[m]\n", ROWS.as_bytes(), b"# x[m] y[m] z[ft]\n", ROWS.as_bytes()].concat(),
            Refused(3, "line 7: the comment \"# x[m] y[m] z[ft]\" gives the columns different units than line 1"),
        ),
        (
            "a second header that is no comment",
            [b"E,N,H\n", ROWS.as_bytes(), b"N,E,H\n", ROWS.as_bytes()].concat(),
            Refused(3, "line 7: the line \"N,E,H\" names other columns than line 1"),
        ),
        (
            "a second header with names that are not known",
            [b"x,y,z\n", ROWS.as_bytes(), b"# time, lat, lon\n", ROWS.as_bytes()].concat(),
            Refused(3, "line 7: the comment \"# time, lat, lon\" names no column z"),
        ),
        (
            "the names of the columns at the end",
            rows_and("# columns: northing easting elevation\n"),
            Refused(
                3,
                "line 6: the comment \"# columns: northing easting elevation\" names other columns than x, y and z",
            ),
        ),
        (
            "fewer points than a comment promises",
            rows_and("# 7 points exported\n"),
            Read(5, 0, "gives 7 points, but the file has only 5"),
        ),
        (
            "a number of points beyond all numbers",
            [b"184467440737095516160\n", ROWS.as_bytes()].concat(),
            Refused(3, "too large for a number of points"),
        ),
        ("infinite", rows_and("1,-inf,2\n"), Refused(3, "line 6: column 2 (y) is \"-inf\"")),
        ("hexadecimal", rows_and("0x10,1,2\n"), Refused(3, "column 1 (x) is \"0x10\"")),
        ("beyond all numbers", rows_and("1e300,1,2\n"), Refused(3, "column 1 (x) is \"1e300\", which is too large")),
        ("twenty digits", rows_and("12345678901234567890,1,2\n"), Refused(3, "column 1 (x)")),
        ("a huge exponent", rows_and("1,1,1e99999999999999999999\n"), Refused(3, "column 3 (z)")),
        ("a zero byte in a row", rows_and("1,\0,3\n"), Refused(3, "")),
        (
            "bytes that are no UTF-8",
            [&rows_and("")[..], &[0xc3, 0x28, b',', 0xff, b'\n']].concat(),
            Refused(3, "line 6"),
        ),
        ("tabs among commas", rows_and("7\t8\t9\n"), Refused(3, "line 6")),
        ("half a quote", rows_and("\"7,8,9\n"), Refused(3, "line 6")),
        ("line ends of old", b"0,0,1\r10,0,2\r10,10,3\r0,10,4\r".to_vec(), Refused(3, "carriage return")),
        ("an empty column", rows_and("1,,3\n"), Refused(3, "line 6: column 2 (y)")),
        ("colours that are none", b"x,y,z,r,g,b\n1,2,3,-1,0,0\n1,3,3,-1,0,0\n2,2,3,-1,0,0\n".to_vec(), Read(3, 0, "")),
        ("a class too high", b"x,y,z,class\n1,2,3,256\n1,3,3,0\n2,2,3,0\n".to_vec(), Read(3, 0, "")),
        ("a number too small to matter", rows_and("1e-400,1,2\n"), Read(6, 0, "")),
        ("a thousand digits", rows_and(&format!("1.{},1,2\n", "0".repeat(1000))), Read(6, 0, "")),
        ("blank lines and comments", rows_and("\n\n# end\n   \n"), Read(5, 0, "")),
        ("minus nothing", rows_and("-0,-0.0,+0\n"), Read(6, 0, "")),
        ("columns too many", rows_and("7,8,9,10,11\n"), Read(6, 0, "")),
    ] {
        cases.push(case(name, ".csv", bytes, gives));
    }
    let bad_share = "max_malformed_fraction = 0.5";
    cases.push(
        case("bad lines allowed", ".csv", rows_and("a,b,c\n1,2\nnan,nan,nan\n"), Read(8, 3, "line 6")).with(bad_share),
    );
    cases.push(
        case("a long line allowed", ".csv", rows_and(&"1".repeat(200_000)), Read(6, 1, "65536 bytes")).with(bad_share),
    );
    cases
}
