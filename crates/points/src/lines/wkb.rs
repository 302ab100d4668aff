//! Well-known binary, in the ISO form that GeoPackages have, and in the form of PostGIS, which some programs write there.
//!
//! It is a few numbers in one of two byte orders. A reader of our own checks every count against the bytes that are left, so no file
//! can make it ask for more memory than the file has.

use crate::lines::feature::RawGeometry;

/// Bits of the type in the form of PostGIS.
const HAS_Z: u32 = 0x8000_0000;
const HAS_M: u32 = 0x4000_0000;
const HAS_SRID: u32 = 0x2000_0000;

/// Collections in collections are rare, and no file has them deeper.
const DEEPEST: usize = 16;

/// The bytes of a geometry, from where it goes on.
struct WkbReader<'a> {
    rest: &'a [u8],
}

/// Returns the geometry that `bytes` hold.
///
/// # Errors
/// A sentence without its subject, if they hold none.
pub(super) fn read(bytes: &[u8]) -> Result<RawGeometry, String> {
    WkbReader { rest: bytes }.geometry(0)
}

/// What the type of a geometry says.
#[derive(Clone, Copy)]
struct Header {
    is_little: bool,
    /// The type without dimensions: 1 for a point, 2 for a line, 3 for a polygon, 4 to 7 for several.
    kind: u32,
    /// Numbers of a vertex.
    numbers: usize,
    has_z: bool,
}

impl<'a> WkbReader<'a> {
    fn geometry(&mut self, depth: usize) -> Result<RawGeometry, String> {
        if depth > DEEPEST {
            return Err("has collections in collections that are too deep".into());
        }
        let header = self.header()?;
        match header.kind {
            1 => self.line_of(header, 1).map(|_| RawGeometry::Other("a point")),
            2 => Ok(RawGeometry::Lines(vec![self.line(header)?])),
            3 => Ok(RawGeometry::Areas(vec![self.rings(header)?])),
            4..=7 | 11 | 12 => {
                // Every member has a byte order and a type.
                let count = self.count(header, 5)?;
                let members = (0..count).map(|_| self.geometry(depth + 1)).collect::<Result<Vec<_>, _>>()?;
                Ok(RawGeometry::Several(members))
            }
            8..=10 | 13 | 14 => {
                Err("has curves: make lines of them, for example with `ogr2ogr -nlt CONVERT_TO_LINEAR`".into())
            }
            15..=17 => Ok(RawGeometry::Other("a surface")),
            kind => Err(format!("has a geometry of the type {kind}, which is not known")),
        }
    }

    fn header(&mut self) -> Result<Header, String> {
        let is_little = match self.take(1)? {
            [0] => false,
            [1] => true,
            _ => return Err("has a geometry that is damaged: it has no byte order".into()),
        };
        let word = self.word(is_little)?;
        if word & HAS_SRID != 0 {
            self.take(4)?;
        }
        let plain = word & !(HAS_Z | HAS_M | HAS_SRID);
        let (kind, dimensions) = (plain % 1000, plain / 1000);
        if dimensions > 3 {
            return Err(format!("has a geometry of the type {plain}, which is not known"));
        }
        let has_z = word & HAS_Z != 0 || dimensions & 1 != 0;
        let has_m = word & HAS_M != 0 || dimensions & 2 != 0;
        Ok(Header { is_little, kind, numbers: 2 + usize::from(has_z) + usize::from(has_m), has_z })
    }

    fn rings(&mut self, header: Header) -> Result<Vec<Vec<[f64; 3]>>, String> {
        let count = self.count(header, 4)?;
        (0..count).map(|_| self.line(header)).collect()
    }

    fn line(&mut self, header: Header) -> Result<Vec<[f64; 3]>, String> {
        let count = self.count(header, 8 * header.numbers)?;
        self.line_of(header, count)
    }

    fn line_of(&mut self, header: Header, count: usize) -> Result<Vec<[f64; 3]>, String> {
        let bytes = self.take(count * 8 * header.numbers)?;
        let number = |bytes: &[u8]| {
            let mut eight = [0; 8];
            eight.copy_from_slice(bytes);
            if header.is_little { f64::from_le_bytes(eight) } else { f64::from_be_bytes(eight) }
        };
        let vertex = |bytes: &[u8]| {
            let z = if header.has_z { number(&bytes[16..24]) } else { f64::NAN };
            [number(&bytes[..8]), number(&bytes[8..16]), z]
        };
        Ok(bytes.chunks_exact(8 * header.numbers).map(vertex).collect())
    }

    /// Returns the count that comes next, of things that take `least` bytes each.
    fn count(&mut self, header: Header, least: usize) -> Result<usize, String> {
        let count = self.word(header.is_little)? as usize;
        if count > self.rest.len() / least { Err(cut_off()) } else { Ok(count) }
    }

    fn word(&mut self, is_little: bool) -> Result<u32, String> {
        let mut four = [0; 4];
        four.copy_from_slice(self.take(4)?);
        Ok(if is_little { u32::from_le_bytes(four) } else { u32::from_be_bytes(four) })
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        let (taken, rest) = self.rest.split_at_checked(count).ok_or_else(cut_off)?;
        self.rest = rest;
        Ok(taken)
    }
}

fn cut_off() -> String {
    "has a geometry that is cut off".into()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn geometry(kind: u32, rest: &[u8]) -> Vec<u8> {
        [&[1], kind.to_le_bytes().as_slice(), rest].concat()
    }

    fn vertices(all: &[&[f64]]) -> Vec<u8> {
        let numbers = all.iter().flat_map(|vertex| vertex.iter()).flat_map(|number| number.to_le_bytes());
        (all.len() as u32).to_le_bytes().into_iter().chain(numbers).collect()
    }

    #[test]
    fn lines_of_all_dimensions_are_read() {
        let all: [(u32, &[&[f64]], f64); 5] = [
            (2, &[&[1.0, 2.0], &[3.0, 4.0]], f64::NAN),
            (1002, &[&[1.0, 2.0, 5.0], &[3.0, 4.0, 5.0]], 5.0),
            (2002, &[&[1.0, 2.0, 9.0], &[3.0, 4.0, 9.0]], f64::NAN),
            (3002, &[&[1.0, 2.0, 5.0, 9.0], &[3.0, 4.0, 5.0, 9.0]], 5.0),
            (HAS_Z | 2, &[&[1.0, 2.0, 5.0], &[3.0, 4.0, 5.0]], 5.0),
        ];
        for (kind, line, z) in all {
            let RawGeometry::Lines(lines) = read(&geometry(kind, &vertices(line))).unwrap() else { panic!("{kind}") };
            assert_eq!(lines[0][1][..2], [3.0, 4.0]);
            assert_eq!(lines[0][1][2].to_bits(), z.to_bits(), "{kind}");
        }
        let mut big = vec![0, 0, 0, 3, 234, 0, 0, 0, 1];
        [1.0f64, 2.0, 3.0].iter().for_each(|number| big.extend(number.to_be_bytes()));
        assert_eq!(read(&big), Ok(RawGeometry::Lines(vec![vec![[1.0, 2.0, 3.0]]])));
    }

    #[test]
    fn areas_and_several_are_read() {
        let ring = vertices(&[&[0.0, 0.0, 1.0], &[1.0, 0.0, 1.0], &[0.0, 1.0, 1.0], &[0.0, 0.0, 1.0]]);
        let polygon = geometry(1003, &[2u32.to_le_bytes().as_slice(), &ring, &ring].concat());
        let RawGeometry::Areas(areas) = read(&polygon).unwrap() else { panic!() };
        assert_eq!((areas.len(), areas[0].len(), areas[0][1].len()), (1, 2, 4));
        let two = geometry(1006, &[2u32.to_le_bytes().as_slice(), &polygon, &polygon].concat());
        let RawGeometry::Several(members) = read(&two).unwrap() else { panic!() };
        assert_eq!(members.len(), 2);
    }

    #[test]
    fn no_bytes_make_it_panic_or_ask_for_memory() {
        let huge = geometry(1002, &u32::MAX.to_le_bytes());
        assert_eq!(read(&huge), Err(cut_off()));
        let line = geometry(1002, &vertices(&[&[1.0, 2.0, 5.0], &[3.0, 4.0, 5.0]]));
        for length in 0..line.len() {
            assert!(read(&line[..length]).is_err(), "{length}");
        }
        assert!(read(&[7]).unwrap_err().contains("byte order"));
        assert!(read(&geometry(9, &[])).unwrap_err().contains("curves"));
        assert!(read(&geometry(77, &[])).unwrap_err().contains("77"));
        let deep: Vec<u8> = (0..40).flat_map(|_| geometry(7, &1u32.to_le_bytes())).collect();
        assert!(read(&deep).unwrap_err().contains("deep"));
        assert_eq!(read(&geometry(1001, &[0; 24])), Ok(RawGeometry::Other("a point")));
    }
}
