//! The body of an answer: it is read piece by piece, as fast as the client takes it.

use std::io::Read;
use std::pin::Pin;
use std::task::{Context, Poll};

use hyper::body::{Body, Bytes, Frame, SizeHint};

/// The size of a piece in bytes.
const PIECE: u64 = 256 << 10;

/// Bytes that are still to be sent.
pub(super) struct Pieces {
    content: Box<dyn Read + Send>,
    /// The number of bytes that are left, if it is known.
    left: Option<u64>,
    is_over: bool,
}

impl Pieces {
    /// Returns the body of the first `length` bytes of `content`, or of all if it is not known how many there are.
    pub(super) fn new(content: impl Read + Send + 'static, length: Option<u64>) -> Pieces {
        Pieces { content: Box::new(content), left: length, is_over: length == Some(0) }
    }

    /// Reads the next piece. Reading blocks, but only one of the server's threads, and files are on this machine.
    fn next(&mut self) -> std::io::Result<Option<Bytes>> {
        let mut piece = Vec::new();
        let most = self.left.map_or(PIECE, |left| left.min(PIECE));
        let count = self.content.by_ref().take(most).read_to_end(&mut piece)? as u64;
        if let Some(left) = &mut self.left {
            if count == 0 && *left > 0 {
                return Err(std::io::Error::other("the file has become shorter"));
            }
            *left -= count;
        }
        self.is_over = self.left == Some(0) || count == 0;
        Ok((count > 0).then(|| piece.into()))
    }
}

impl Body for Pieces {
    type Data = Bytes;
    type Error = std::io::Error;

    fn poll_frame(mut self: Pin<&mut Self>, _: &mut Context) -> Poll<Option<std::io::Result<Frame<Bytes>>>> {
        if self.is_over {
            return Poll::Ready(None);
        }
        Poll::Ready(self.next().map(|piece| piece.map(Frame::data)).transpose())
    }

    fn is_end_stream(&self) -> bool {
        self.is_over
    }

    fn size_hint(&self) -> SizeHint {
        self.left.map_or_else(SizeHint::default, SizeHint::with_exact)
    }
}
