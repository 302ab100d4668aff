//! A server of this machine that has one LAS or LAZ file many times, side by side: `/COLUMN/ROW.laz` is the file with the offsets of its
//! header moved by so many times its extent. So a cloud of any size takes the disk and the memory of one file.

use std::io::{BufRead, BufReader, Error, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::sync::Arc;

/// Where the header has the steps of x and y, their offsets, and the greatest and least x and y.
const STEPS: [usize; 2] = [131, 139];
const OFFSETS: [usize; 2] = [155, 163];
const BOXES: [[usize; 2]; 2] = [[179, 187], [195, 203]];
/// Where the number of points is: in LAS 1.4, and before.
const COUNT: usize = 247;
const OLD_COUNT: usize = 107;

/// The copies of a file.
pub(crate) struct Copies {
    file: Vec<u8>,
    /// The distance between two copies in x and y: whole units, so that all copies lie on one lattice.
    apart: [f64; 2],
    pub(crate) points: u64,
}

impl Copies {
    /// Reads the file at `path`.
    pub(crate) fn of(path: &Path) -> std::io::Result<Copies> {
        let file = std::fs::read(path)?;
        if file.len() < 375 || !file.starts_with(b"LASF") {
            return Err(Error::other("it is no LAS file"));
        }
        let mut copies = Copies { file, apart: [0.0; 2], points: 0 };
        for axis in 0..2 {
            let [high, low] = BOXES[axis].map(|at| copies.number(at));
            copies.apart[axis] = (high - low).ceil() + 1.0;
            let steps = 1.0 / copies.number(STEPS[axis]);
            if (steps - steps.round()).abs() > 1e-6 {
                return Err(Error::other("its steps do not divide 1, so its copies would not lie on one lattice"));
            }
        }
        let is_new = copies.file[25] >= 4;
        copies.points = match is_new {
            true => u64::from_le_bytes(copies.bytes(COUNT)),
            false => u64::from(u32::from_le_bytes(copies.bytes(OLD_COUNT))),
        };
        Ok(copies)
    }

    fn bytes<const N: usize>(&self, at: usize) -> [u8; N] {
        std::array::from_fn(|byte| self.file[at + byte])
    }

    fn number(&self, at: usize) -> f64 {
        f64::from_le_bytes(self.bytes(at))
    }

    /// Returns the targets of `count` copies that fill a rectangle as square as may be.
    pub(crate) fn targets(&self, count: usize) -> Vec<String> {
        let columns = ((count as f64 * self.apart[1] / self.apart[0]).sqrt().round() as usize).max(1);
        (0..count).map(|copy| format!("/{}/{}.laz", copy % columns, copy / columns)).collect()
    }

    /// Returns the first bytes of a copy: its header.
    fn header(&self, place: [u32; 2]) -> Vec<u8> {
        let mut header = self.file[..375].to_vec();
        for axis in 0..2 {
            let (step, offset) = (self.number(STEPS[axis]), self.number(OFFSETS[axis]));
            let moved = offset + f64::from(place[axis]) * self.apart[axis];
            header[OFFSETS[axis]..][..8].copy_from_slice(&moved.to_le_bytes());
            for at in BOXES[axis] {
                let raw = ((self.number(at) - offset) / step).round();
                header[at..][..8].copy_from_slice(&(raw * step + moved).to_le_bytes());
            }
        }
        header
    }

    /// Serves the copies until the process ends, and returns the address of the server.
    pub(crate) fn serve(self) -> std::io::Result<String> {
        let listener = TcpListener::bind("127.0.0.1:0")?;
        let address = format!("http://{}", listener.local_addr()?);
        let copies = Arc::new(self);
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let copies = copies.clone();
                std::thread::spawn(move || _ = copies.answer(stream));
            }
        });
        Ok(address)
    }

    /// Answers the requests of a connection, until there is none or one is not understood.
    fn answer(&self, mut stream: TcpStream) -> Option<()> {
        stream.set_nodelay(true).ok()?;
        let mut reader = BufReader::new(stream.try_clone().ok()?);
        loop {
            let (place, first, last) = request(&mut reader)?;
            let (size, end) = (self.file.len(), self.file.len().min(last + 1));
            if first >= end {
                write!(
                    stream,
                    "HTTP/1.1 416 Range Not Satisfiable\r\nContent-Range: bytes */{size}\r\nContent-Length: 0\r\n\r\n"
                )
                .ok()?;
                continue;
            }
            let [column, row] = place;
            let head = format!(
                "HTTP/1.1 206 Partial Content\r\nContent-Length: {}\r\nContent-Range: bytes {first}-{}/{size}\r\nETag: \"{column}-{row}\"\r\n\r\n",
                end - first,
                end - 1
            );
            stream.write_all(head.as_bytes()).ok()?;
            let header = self.header(place);
            let moved = header.get(first..end.min(header.len())).unwrap_or_default();
            stream.write_all(moved).and_then(|()| stream.write_all(&self.file[first + moved.len()..end])).ok()?;
        }
    }
}

/// Reads a request: the copy, and the first and the last byte that are asked for.
fn request(reader: &mut impl BufRead) -> Option<([u32; 2], usize, usize)> {
    let mut line = String::new();
    reader.read_line(&mut line).ok()?;
    let (column, row) = line.split(' ').nth(1)?.strip_prefix('/')?.strip_suffix(".laz")?.split_once('/')?;
    let place = [column.parse().ok()?, row.parse().ok()?];
    let mut range = None;
    loop {
        let mut line = String::new();
        reader.read_line(&mut line).ok()?;
        let Some((name, value)) = line.trim().split_once(':') else { break };
        if name.eq_ignore_ascii_case("range") {
            let (first, last) = value.trim().strip_prefix("bytes=")?.split_once('-')?;
            range = Some((first.parse().ok()?, last.parse().ok()?));
        }
    }
    let (first, last) = range?;
    Some((place, first, last))
}
