//! The way of a place from one coordinate reference system into another: from a map to longitude and latitude, and from there to
//! another map. The same bits come out on every machine.

pub(crate) mod between;
#[cfg(test)]
mod bit_tests;
pub(crate) mod datum_rule;
mod ellipsoid;
mod equal_area;
mod gauss_sphere;
mod krovak;
mod lambert_conic;
mod map_projection;
mod mercator;
mod meridian_arc;
mod oblique_mercator;
#[cfg(test)]
mod refusal_tests;
mod stereographic;
#[cfg(test)]
mod tests;
pub(crate) mod to_globe;
mod transverse_mercator;
pub(crate) mod utm;
