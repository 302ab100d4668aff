//! A picture that is being read.

use std::io::{Read, Seek};
use tiff::decoder::Decoder;

/// The bytes of a picture, wherever they are.
pub trait PictureBytes: Read + Seek + Send {}

impl<T: Read + Seek + Send> PictureBytes for T {}

/// A picture whose tags are known.
pub(crate) type Image = Decoder<Box<dyn PictureBytes>>;
