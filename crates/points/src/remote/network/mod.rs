//! Requests to other machines, with the feature `remote`.
//!
//! `client` makes single requests, `transfer` as many as a range takes, with the `timeouts` to ask again, and `window` lets them run while
//! others work. `read_plan` knows what will be read, so that few requests bring it ahead of time. Whoever reads a file has it `held`, but a
//! small one comes `whole`.

mod client;
mod failure;
mod file;
mod held;
mod listing;
mod read_plan;
mod s3;
mod signature;
mod timeouts;
mod transfer;
mod whole;
mod window;

pub(crate) use file::identity;
pub(crate) use held::{HeldFile, RemoteStream, to_hold};
pub(crate) use listing::files_at;
pub(crate) use read_plan::set_space;
pub(crate) use whole::{WholeFile, WholeRequest, forget_whole_files};
