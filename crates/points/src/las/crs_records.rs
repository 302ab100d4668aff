//! The records of a LAS file that describe its coordinate reference system.

use crate::file::random_access::RandomAccessFile;
use crate::las::vlr::Vlr;
use crs::from_records::{from_records, is_readable};
use crs::geokeys::{DIRECTORY, DOUBLES, GeoKeys, TEXTS};
use crs::system::Crs;
use sys::{Result, Warnings};

/// The user of the records that LAS itself defines.
const PROJECTION: &str = "LASF_Projection";

/// User and id of the records that hold well-known text: the record of LAS 1.4, and the earlier one of libLAS.
const TEXT_RECORDS: [(&str, u16); 2] = [(PROJECTION, 2112), ("liblas", 2112)];

/// Returns the system that the records of `file` describe.
pub(crate) fn read(file: &RandomAccessFile, vlrs: &[Vlr], warnings: &mut Warnings) -> Result<Crs> {
    let keys = GeoKeys {
        directory: record(file, vlrs, DIRECTORY)?,
        doubles: record(file, vlrs, DOUBLES)?,
        texts: record(file, vlrs, TEXTS)?,
    };
    from_records(texts(vlrs).map(|vlr| vlr.read(file)), &keys, warnings)
}

/// Returns whether the system comes from a record of well-known text, which counts more than GeoTIFF keys.
pub(crate) fn has_readable_text(file: &RandomAccessFile, vlrs: &[Vlr]) -> Result<bool> {
    texts(vlrs).map(|vlr| vlr.read(file)).try_fold(false, |found, bytes| Ok(found || is_readable(&bytes?)))
}

fn texts(vlrs: &[Vlr]) -> impl Iterator<Item = &Vlr> {
    TEXT_RECORDS.iter().flat_map(|(user, id)| vlrs.iter().filter(|vlr| vlr.is(user, *id)))
}

fn record(file: &RandomAccessFile, vlrs: &[Vlr], id: u16) -> Result<Vec<u8>> {
    vlrs.iter().find(|vlr| vlr.is(PROJECTION, id)).map_or(Ok(Vec::new()), |vlr| vlr.read(file))
}
