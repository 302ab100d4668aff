//! Extra bytes, version 2.

use std::io::Read;

use crate::las::laszip::decode_error::DecodeError;
use crate::las::laszip::models::ExtraByteModel;
use crate::las::laszip::range_decoder::RangeDecoder;

/// The number of bytes for which the window of the decoder suffices.
const RUN: usize = 64;

/// The latest bytes, and the models of how they change.
pub(super) struct ExtraBytesDecoder {
    last: Vec<u8>,
    models: Vec<ExtraByteModel>,
}

impl ExtraBytesDecoder {
    /// Starts behind the bytes `first`.
    pub(super) fn new(first: &[u8]) -> ExtraBytesDecoder {
        ExtraBytesDecoder { last: first.to_vec(), models: vec![ExtraByteModel::new(256); first.len()] }
    }

    /// Decodes the next bytes into `out`, which has room for as many.
    pub(super) fn next<R: Read>(&mut self, data: &mut RangeDecoder<R>, out: &mut [u8]) -> Result<(), DecodeError> {
        for (last, models) in self.last.chunks_mut(RUN).zip(self.models.chunks_mut(RUN)) {
            data.refill()?;
            for (last, model) in last.iter_mut().zip(models) {
                *last = last.wrapping_add(data.symbol(model) as u8);
            }
        }
        out.copy_from_slice(&self.last);
        Ok(())
    }
}
