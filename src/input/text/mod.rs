//! Points as text, one a line: found out once over the whole file, then decoded block by block.

pub(crate) mod columns;
pub(crate) mod granularity;
pub(crate) mod lines;
pub(crate) mod number;
pub(crate) mod options;
pub(crate) mod table;
