//! Files of other machines, by https://, http:// and s3://. `file/` reads them as it reads files of this machine.
//!
//! A file is read in ranges of its bytes, and never copied to this machine. [`name`] says what a file is called, and `network` asks for its
//! bytes.
//!
//! A file is told from others of its name by its size and its ETag, or its time if it has no tag. Every request says which is meant,
//! and every answer is compared with it: bytes of two versions never meet in a mesh.

pub(crate) mod files;
pub(crate) mod name;
#[cfg(feature = "remote")]
mod network;
#[cfg(not(feature = "remote"))]
mod no_network;
pub(crate) mod places;
pub(crate) mod traffic;

#[cfg(feature = "remote")]
pub(crate) use network::{
    HeldFile, RemoteStream, WholeFile, WholeRequest, files_at, forget_whole_files, identity, set_space, to_hold,
};
#[cfg(not(feature = "remote"))]
pub(crate) use no_network::{
    HeldFile, RemoteStream, WholeFile, WholeRequest, files_at, forget_whole_files, identity, set_space, to_hold,
};
