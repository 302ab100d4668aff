//! Points as text, one per line. A first pass over the whole file finds out how it is laid out and what it holds; then its chunks
//! are decoded independently.

pub(crate) mod columns;
pub(crate) mod delimiter;
pub(crate) mod granularity;
pub(crate) mod lines;
pub(crate) mod number;
pub(crate) mod options;
pub(crate) mod row;
pub(crate) mod survey;
pub(crate) mod table;
