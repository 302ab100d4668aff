//! Breaklines in the plan: the files of lines are read, brought to the lattice and cut. What they are cut from is kept in the plan, so that
//! every task and every later run cuts the same, and needs none of the files.

pub(crate) mod line_files;
mod on_lattice;
mod other_unit;
mod planned;
mod sentences;
mod spacing;
mod suspect_heights;
mod terrain;

pub(crate) use planned::CloudOfPlan;
pub use planned::PlannedBreaklines;
