//! Files of other machines, by https://, http:// and s3://. `file/` reads them as it reads files of this machine.
//!
//! A file is read in ranges of its bytes, and never copied to this machine. [`name`] says what a file is called. `client` makes single
//! requests, `transfer` as many as a range takes, with the `patience` to ask again, and `window` lets them run while others work.
//! `read_plan` knows what will be read, so that few requests bring it ahead of time. Whoever reads a file has it `held`.
//!
//! A file is told from others of its name by its size and its ETag, or its time if it has no tag. Every request says which is meant,
//! and every answer is compared with it: bytes of two versions never meet in a mesh.

#[cfg(not(feature = "remote"))]
mod absent;
#[cfg(feature = "remote")]
mod client;
#[cfg(feature = "remote")]
mod failure;
#[cfg(feature = "remote")]
mod file;
pub(crate) mod files;
#[cfg(feature = "remote")]
mod held;
#[cfg(feature = "remote")]
mod listing;
pub(crate) mod name;
#[cfg(feature = "remote")]
mod patience;
#[cfg(feature = "remote")]
mod present;
#[cfg(feature = "remote")]
mod read_plan;
#[cfg(feature = "remote")]
mod s3;
#[cfg(feature = "remote")]
mod signature;
pub(crate) mod traffic;
#[cfg(feature = "remote")]
mod transfer;
#[cfg(feature = "remote")]
mod window;

#[cfg(not(feature = "remote"))]
pub(crate) use absent::{HeldFile, RemoteStream, files_at, identity, set_space, to_hold};
#[cfg(feature = "remote")]
pub(crate) use {
    held::{HeldFile, RemoteStream, to_hold},
    listing::files_at,
    present::identity,
    read_plan::set_space,
};
