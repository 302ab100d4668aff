//! `[input] unit` must not contradict the coordinate reference system: coordinates would be taken as lengths that the system does not have,
//! and the terrain would be placed far from where it is.

use crate::input::options::InputOptions;
use crate::input::{Crs, CrsChoice, FileFormat, Source, same_length};
use crate::{Error, Result};

/// Checks that the unit of x and y that the user names is that of the system of every source.
///
/// # Errors
/// [`Error::Config`] names the first system in another unit.
pub(super) fn refuse_other_unit(sources: &[Source], options: &InputOptions) -> Result<()> {
    let of_file = |source: &Source| format!("{} is in", source.path.display());
    let is_named = |source: &&Source| source.own_crs().is_named();
    match &options.crs {
        CrsChoice::None => Ok(()),
        CrsChoice::Given { crs, .. } => refuse(crs, || "[input] crs is".into(), options),
        CrsChoice::First => {
            sources.iter().find(is_named).map_or(Ok(()), |source| refuse(source.own_crs(), || of_file(source), options))
        }
        CrsChoice::Auto => sources.iter().try_for_each(|source| match &options.missing_crs {
            // Columns that name a unit know it better.
            Some(missing) if !is_named(&source) && source.own_crs().metres_per_unit().is_none() => {
                refuse(&missing.crs, || "[input] missing_crs is".into(), options)
            }
            _ if is_named(&source) && source.format != FileFormat::Text => {
                refuse(source.own_crs(), || of_file(source), options)
            }
            _ => Ok(()),
        }),
    }
}

/// Fails if `crs` has another unit of length than the one that the user names.
fn refuse(crs: &Crs, subject: impl Fn() -> String, options: &InputOptions) -> Result<()> {
    let unit = options.unit.unit();
    let is_other =
        crs.metres_per_unit().zip(unit.metres_per_unit()).is_some_and(|(own, chosen)| !same_length(own, chosen));
    if !is_other {
        return Ok(());
    }
    let metres = unit.metres_per_unit().unwrap_or(1.0);
    Err(Error::Config(format!(
        "{} {}, whose unit is the {}, but [input] unit says {}: leave unit out if the CRS is right. If the unit of the \
         coordinates is the {}, name a CRS in that unit with [input] crs: an EPSG code, or the well-known text of this one with UNIT[\"{}\",{metres}] as its last unit",
        subject(),
        crs.label(),
        crs.horizontal.name(),
        unit.name(),
        unit.name(),
        unit.name(),
    )))
}
