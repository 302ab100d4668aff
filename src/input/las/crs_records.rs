//! The records of a LAS file that describe its coordinate reference system.

use crate::Result;
use crate::input::crs::from_records::from_records;
use crate::input::crs::geotiff::GeoKeys;
use crate::input::crs::system::Crs;
use crate::input::file::random_access::RandomAccessFile;
use crate::input::las::vlr::Vlr;

/// The users under which well-known text is stored: LAS 1.4's, and that of libLAS before it.
const TEXT_RECORDS: [(&str, u16); 2] = [("LASF_Projection", 2112), ("liblas", 2112)];

/// The system that the records of `file` describe.
pub(crate) fn read(file: &RandomAccessFile, vlrs: &[Vlr], warnings: &mut Vec<String>) -> Result<Crs> {
    let texts = TEXT_RECORDS.iter().flat_map(|(user, id)| vlrs.iter().filter(|vlr| vlr.is(user, *id)));
    let keys = GeoKeys {
        directory: record(file, vlrs, 34735)?,
        doubles: record(file, vlrs, 34736)?,
        texts: record(file, vlrs, 34737)?,
    };
    from_records(texts.map(|vlr| vlr.read(file)), &keys, warnings)
}

fn record(file: &RandomAccessFile, vlrs: &[Vlr], id: u16) -> Result<Vec<u8>> {
    vlrs.iter().find(|vlr| vlr.is("LASF_Projection", id)).map_or(Ok(Vec::new()), |vlr| vlr.read(file))
}
