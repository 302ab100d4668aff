//! The way of a place from one coordinate reference system into another: from a map to longitude and latitude, and from there to
//! another map. The same bits come out on every machine.

pub mod between;
#[cfg(test)]
mod bit_tests;
pub mod datum_rule;
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
pub mod to_globe;
mod transverse_mercator;
pub mod utm;
