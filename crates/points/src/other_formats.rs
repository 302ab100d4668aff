//! Files that are neither LAS nor a table of numbers, named as what they are.

use std::path::Path;

use sys::{Error, Result};

/// What a file begins with, and what to say about it.
type Signature = (&'static [u8], &'static str);

/// Packed files: what is in them has to be unpacked first.
const PACKED: [Signature; 8] = [
    (&[0x1f, 0x8b], "is compressed with gzip; unpack it first, for example with `gzip -dk FILE`"),
    (b"PK\x03\x04", "is a ZIP archive (or a spreadsheet); unpack it first, or save the table as CSV"),
    (b"BZh", "is compressed with bzip2; unpack it first, for example with `bzip2 -dk FILE`"),
    (&[0xfd, b'7', b'z', b'X', b'Z', 0], "is compressed with xz; unpack it first, for example with `xz -dk FILE`"),
    (&[0x28, 0xb5, 0x2f, 0xfd], "is compressed with zstd; unpack it first, for example with `zstd -dk FILE`"),
    (&[b'7', b'z', 0xbc, 0xaf], "is a 7-Zip archive; unpack it first, for example with `7z x FILE`"),
    (b"Rar!", "is a RAR archive; unpack it first"),
    (
        b"version https://git-lfs.github.com/spec",
        "is a Git LFS pointer, not the point cloud itself; fetch that with `git lfs pull`",
    ),
];

/// Other formats, told by their first bytes without case, after blanks.
const NAMED: [Signature; 13] = [
    (b"ply\n", "is PLY; convert it to LAZ first, for example with `pdal translate FILE cloud.laz`"),
    (b"ply\r", "is PLY; convert it to LAZ first, for example with `pdal translate FILE cloud.laz`"),
    (b"# .pcd", "is PCD; convert it to LAZ first, for example with `pdal translate FILE cloud.laz`"),
    (b"astm-e57", "is E57; convert it to LAZ first, for example with `pdal translate FILE cloud.laz`"),
    (b"<!doctype html", "is a web page (HTML), perhaps the error message of a download; download the file again"),
    (b"<html", "is a web page (HTML), perhaps the error message of a download; download the file again"),
    (b"<", "is XML (such as LandXML, GML or KML); export the points as LAS, LAZ or a table of x, y, z"),
    (b"{", "is JSON; export the points as LAS, LAZ or a table of x, y, z"),
    (b"[", "is JSON; export the points as LAS, LAZ or a table of x, y, z"),
    (
        b"ncols ",
        "is an ESRI ASCII grid; make points of it first, for example with `gdal_translate -of XYZ FILE cloud.xyz`",
    ),
    (b"%pdf", "is a PDF document; export the points as LAS, LAZ or a table of x, y, z"),
    (
        b"sqlite format 3",
        "is an SQLite database (such as GeoPackage); export the points as LAS, LAZ or a table of x, y, z",
    ),
    (b"version .7", "is PCD; convert it to LAZ first, for example with `pdal translate FILE cloud.laz`"),
];

/// Other binary formats.
const BINARY: [Signature; 5] = [
    (b"II*\0", "is a TIFF image; make points of it first, for example with `gdal_translate -of XYZ FILE cloud.xyz`"),
    (b"MM\0*", "is a TIFF image; make points of it first, for example with `gdal_translate -of XYZ FILE cloud.xyz`"),
    (b"\x89HDF", "is HDF5; export the points as LAS, LAZ or a table of x, y, z"),
    (&[0, 0, 0x27, 0x0a], "is a shapefile; export the points as LAS, LAZ or a table of x, y, z"),
    (b"\x89PNG", "is a PNG image, not a point cloud"),
];

/// Fails if the first bytes of a file show that it is neither LAS nor a table of numbers, and says what it is.
pub(crate) fn refuse_other_formats(path: &Path, start: &[u8]) -> Result<()> {
    let refuse = |what: &str| {
        let what = what.replace("FILE", &path.display().to_string());
        Err(Error::input(path, what))
    };
    if start.is_empty() {
        return refuse("is empty");
    }
    let signature =
        |list: &[Signature], start: &[u8]| list.iter().find(|(bytes, _)| start.starts_with(bytes)).map(|s| s.1);
    if let Some(what) = signature(&PACKED, start) {
        return refuse(what);
    }
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    if extension == "las" || extension == "laz" {
        return refuse("does not begin with the letters LASF, so it is not LAS or LAZ; copy or download it again");
    }
    if start.starts_with(&[0xff, 0xfe]) || start.starts_with(&[0xfe, 0xff]) {
        return refuse("is text in UTF-16; save it as UTF-8");
    }
    let text = start.strip_prefix(&[0xef, 0xbb, 0xbf]).unwrap_or(start);
    if let Some(what) = signature(&NAMED, &text.trim_ascii_start().to_ascii_lowercase()) {
        return refuse(what);
    }
    if let Some(what) = signature(&BINARY, start) {
        return refuse(what);
    }
    if start.contains(&0) {
        return refuse("is neither LAS nor LAZ nor UTF-8 text; convert it to one of those first");
    }
    if is_ptx(text) {
        return refuse("is PTX, scans with a position each; convert it to LAZ first, for example with CloudCompare");
    }
    Ok(())
}

/// Returns whether the text begins as PTX does, after blank lines and comments: the numbers of columns and rows of a scan in a line each,
/// then the position of the scanner.
fn is_ptx(text: &[u8]) -> bool {
    let lines = text.split(|byte| *byte == b'\n').map(<[u8]>::trim_ascii);
    let is_skipped = |line: &&[u8]| line.is_empty() || line.starts_with(b"#") || line.starts_with(b"//");
    let first: Vec<&[u8]> = lines.skip_while(is_skipped).take(4).collect();
    let parts = |line: &&[u8]| {
        let is_between = |byte: &u8| byte.is_ascii_whitespace() || matches!(byte, b',' | b';');
        line.split(is_between).filter(|part| !part.is_empty()).count()
    };
    let is_count = |line: &&[u8]| line.iter().all(u8::is_ascii_digit);
    first.iter().map(parts).eq([1, 1, 3, 3]) && first.iter().take(2).all(is_count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_formats_are_named() {
        for (start, words) in [
            (&b"ply\nformat ascii 1.0\n"[..], "is PLY"),
            (b"# .PCD v0.7 - Point Cloud Data\nVERSION 0.7\n", "is PCD"),
            (b"  {\"points\": []}", "is JSON"),
            (b"[[1,2,3]]", "is JSON"),
            (b"\xef\xbb\xbf<!DOCTYPE html>", "HTML"),
            (b"<?xml version=\"1.0\"?>", "is XML"),
            (b"\x1f\x8b\x08\x00", "gzip -dk a.csv"),
            (b"PK\x03\x04", "ZIP"),
            (b"ASTM-E57\0", "is E57"),
            (b"II*\0abc", "TIFF"),
            (b"ncols 4\nnrows 5\n", "ESRI"),
            (b"100\n200\n0 0 0\n1 0 0\n0 1 0\n", "is PTX"),
            (b"\n# scan\n100\r\n200\r\n0,0,0\r\n1,0,0\r\n", "is PTX"),
        ] {
            let error = refuse_other_formats(Path::new("a.csv"), start).err().map(|error| error.to_string());
            assert!(error.as_ref().is_some_and(|error| error.contains(words)), "{words}: {error:?}");
        }
        for start in [&b"1,2,3\n"[..], b"\"x\",\"y\"\n", b"100\n1 2 3\n4 5 6\n", b"# ply\n1 2 3\n", b"3\n4\n1 2 3\n"] {
            assert!(refuse_other_formats(Path::new("a.csv"), start).is_ok());
        }
    }
}
