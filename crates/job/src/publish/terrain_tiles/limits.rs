//! Which terrains terrain tiles do not take.

use quantized_mesh::Scheme;
use sys::Error;

/// Returns the error about a terrain that comes too near to a pole, up to a latitude in degrees.
pub(super) fn beyond_latitudes(scheme: Scheme, highest: f64) -> Error {
    let limit = scheme.most_latitude();
    match scheme {
        Scheme::Geographic => refused(&format!(
            "the terrain reaches {highest:.2} degrees north or south, and the columns of tiles meet at the poles; {limit} degrees is the limit"
        )),
        Scheme::WebMercator => Error::Config(format!(
            "[output.terrain] cannot be written: the terrain reaches {highest:.2} degrees north or south, and web mercator ends at {limit} \
             degrees; fix: scheme = \"geographic\", smaller [input] bounds, or leave [output.terrain] out"
        )),
    }
}

/// The widest terrain in degrees of longitude.
pub(super) const MOST_LONGITUDES: f64 = 90.0;

/// Returns the error about a terrain that spans too many degrees of longitude: so many, if that is known.
pub(super) fn beyond_longitudes(widest: Option<f64>) -> Error {
    let widest = widest.map_or(format!("more than {MOST_LONGITUDES}"), |widest| format!("about {widest:.0}"));
    refused(&format!("the terrain spans {widest} degrees of longitude; {MOST_LONGITUDES} degrees is the limit"))
}

/// Returns the error about a terrain that terrain tiles cannot have.
pub(super) fn refused(why: &str) -> Error {
    Error::Config(format!(
        "[output.terrain] cannot be written: {why}; fix: smaller [input] bounds, or leave [output.terrain] out"
    ))
}
