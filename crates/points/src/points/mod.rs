//! The way of one record from any source to a point on the lattice: its raw integers, the rules, the filter, the counts.

pub(crate) mod axis;
pub(crate) mod chunk_request;
pub(crate) mod classes;
pub(crate) mod counts;
pub(crate) mod extremes;
pub(crate) mod filter;
pub(crate) mod kept_heights;
pub(crate) mod nodata;
pub(crate) mod nodata_choice;
pub(crate) mod nodata_number;
pub(crate) mod nodata_sink;
pub(crate) mod octree;
pub(crate) mod optional_fields;
pub(crate) mod point;
pub(crate) mod raw_bounds;
pub(crate) mod raw_box;
pub(crate) mod record;
pub(crate) mod record_sink;
pub(crate) mod returns;
pub(crate) mod rules;
pub(crate) mod transformed_sink;
