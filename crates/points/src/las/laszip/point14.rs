//! The fields of point format 6, version 3. Each channel of the scanner has a context of its own: the latest point, and models.

use crate::las::laszip::integer::IntegerDecoder;
use crate::las::laszip::layers::{Layer, PointLayers};
use crate::las::laszip::median::RunningMedian;
use crate::las::laszip::models::{ByteModel, LazyModel, SmallModel};
use crate::las::laszip::returns::{context_of_16, height_context};
use sys::bytes::{int32, uint16};

/// The number of bytes of the fields.
pub(super) const SIZE: usize = 30;

/// The number of bytes of the fields that are decoded, the first ones of a record.
pub(super) const DECODED: usize = 17;

/// The latest fields of a channel.
#[derive(Clone, Copy)]
struct Point {
    xyz: [i32; 3],
    intensity: u16,
    returns: u8,
    flags: u8,
    class: u8,
    /// Whether its time is another than that of the point before.
    has_new_time: bool,
}

/// How a point differs from the one before.
struct Change {
    /// The number of the return, and of how many.
    number: u8,
    of: u8,
    has_new_time: bool,
}

/// The latest point of a channel, and the models of the next.
struct Channel {
    last: Point,
    /// What changes, by the return of the latest point.
    changes: Vec<ByteModel>,
    channel_steps: SmallModel,
    /// The returns of pulses and the number of the return, by what they were before.
    returns: Vec<SmallModel>,
    numbers: Vec<SmallModel>,
    /// How much greater the number of the return is at the same time.
    number_steps: SmallModel,
    x_steps: IntegerDecoder,
    y_steps: IntegerDecoder,
    heights: IntegerDecoder,
    intensities: IntegerDecoder,
    classes: Vec<LazyModel>,
    flags: Vec<LazyModel>,
    /// The latest steps in x and y, by the context of the return and whether the time is new.
    medians: [[RunningMedian; 2]; 12],
    last_heights: [i32; 8],
    last_intensities: [u16; 8],
}

pub(super) struct Point14Decoder {
    channels: [Option<Box<Channel>>; 4],
    current: usize,
}

impl Point14Decoder {
    /// Starts behind the first record.
    pub(super) fn new(first: &[u8; SIZE]) -> Point14Decoder {
        let last = Point {
            xyz: [0, 4, 8].map(|at| int32(first, at)),
            intensity: uint16(first, 12),
            returns: first[14],
            flags: first[15],
            class: first[16],
            has_new_time: false,
        };
        let mut channels = [const { None }; 4];
        let current = last.channel();
        channels[current] = Some(Box::new(Channel::new(last)));
        Point14Decoder { channels, current }
    }

    /// Returns the channel of the latest point.
    pub(super) fn channel(&self) -> usize {
        self.current & 3
    }

    /// Decodes the next fields into `out`. Returns whether the channel is another than before.
    #[inline(always)]
    pub(super) fn next(&mut self, layers: &mut PointLayers, out: &mut [u8; DECODED]) -> bool {
        let Some(mut channel) = self.channels[self.current & 3].as_mut() else {
            return false;
        };
        let changes = layers.place.symbol(&mut channel.changes[channel.last.context()]);
        let is_other_channel = changes & 64 != 0;
        if is_other_channel {
            let last = channel.last;
            self.current = (self.current + layers.place.symbol(&mut channel.channel_steps) as usize + 1) & 3;
            channel = self.channels[self.current].get_or_insert_with(|| Box::new(Channel::new(last)));
            channel.last.flags = channel.last.flags & !0x30 | (self.current as u8) << 4;
        }
        channel.next(layers, changes);
        channel.last.write(out);
        is_other_channel
    }
}

impl Point {
    fn channel(&self) -> usize {
        (self.flags >> 4 & 3) as usize
    }

    /// Returns the context of what changes, 0 to 7: whether the return was the first, the last, and had a new time.
    #[inline(always)]
    fn context(&self) -> usize {
        let (number, of) = (self.returns & 15, self.returns >> 4);
        (number == 1) as usize | ((number >= of) as usize) << 1 | (self.has_new_time as usize) << 2
    }

    #[inline(always)]
    fn write(&self, out: &mut [u8; DECODED]) {
        let [x, y, z] = self.xyz.map(|coordinate| coordinate as u32 as u64);
        let rest = (self.intensity as u64) << 32 | (self.returns as u64) << 48 | (self.flags as u64) << 56;
        out[..8].copy_from_slice(&(x | y << 32).to_le_bytes());
        out[8..16].copy_from_slice(&(z | rest).to_le_bytes());
        out[16] = self.class;
    }
}

impl Channel {
    /// Returns the context of a channel without points; `last` is of another.
    fn new(last: Point) -> Channel {
        Channel {
            last: Point { has_new_time: false, ..last },
            changes: vec![ByteModel::new(128); 8],
            channel_steps: SmallModel::new(3),
            returns: vec![SmallModel::new(16); 16],
            numbers: vec![SmallModel::new(16); 16],
            number_steps: SmallModel::new(13),
            x_steps: IntegerDecoder::new(32, 2),
            y_steps: IntegerDecoder::new(32, 22),
            heights: IntegerDecoder::new(32, 20),
            intensities: IntegerDecoder::new(16, 4),
            classes: vec![LazyModel::new(); 64],
            flags: vec![LazyModel::new(); 64],
            medians: Default::default(),
            last_heights: [last.xyz[2]; 8],
            last_intensities: [last.intensity; 8],
        }
    }

    #[inline(always)]
    fn next(&mut self, layers: &mut PointLayers, changes: u32) {
        let change = self.returns(&mut layers.place, changes);
        self.place(layers, &change);
        let is_single = change.number == 1 && change.number >= change.of;
        if let Some(layer) = &mut layers.class {
            let context = (self.last.class & 31) << 1 | is_single as u8;
            self.last.class = layer.symbol(self.classes[context as usize].of(256)) as u8;
        }
        if let Some(layer) = &mut layers.flags {
            let context = self.last.flags >> 2 & 0x30 | self.last.flags & 15;
            let flags = layer.symbol(self.flags[context as usize].of(64)) as u8;
            self.last.flags = (flags & 0x30) << 2 | self.last.flags & 0x30 | flags & 15;
        }
        if let Some(layer) = &mut layers.intensity {
            let context = ((change.number == 1) as usize) << 1 | (change.number >= change.of) as usize;
            let last = &mut self.last_intensities[context << 1 | change.has_new_time as usize];
            *last = self.intensities.next(layer, *last as i32, context) as u16;
            self.last.intensity = *last;
        }
        self.last.has_new_time = change.has_new_time;
    }

    #[inline(always)]
    fn returns(&mut self, place: &mut Layer, changes: u32) -> Change {
        let (last_number, last_of) = (self.last.returns & 15, self.last.returns >> 4);
        let has_new_time = changes & 16 != 0;
        let of = match changes & 4 {
            0 => last_of,
            _ => place.symbol(&mut self.returns[last_of as usize]) as u8,
        };
        let number = match changes & 3 {
            0 => last_number,
            1 => (last_number + 1) & 15,
            2 => (last_number + 15) & 15,
            _ if has_new_time => place.symbol(&mut self.numbers[last_number as usize]) as u8,
            _ => (last_number + place.symbol(&mut self.number_steps) as u8 + 2) & 15,
        };
        self.last.returns = of << 4 | number;
        Change { number, of, has_new_time }
    }

    #[inline(always)]
    fn place(&mut self, layers: &mut PointLayers, change: &Change) {
        let single = (change.of == 1) as usize;
        let [x, y, z] = &mut self.last.xyz;
        let context = context_of_16(change.number, change.of);
        let [x_median, y_median] = &mut self.medians[context << 1 | change.has_new_time as usize];
        let step = self.x_steps.next(&mut layers.place, x_median.get(), single);
        *x = x.wrapping_add(step);
        x_median.add(step);
        let length = self.x_steps.length();
        let step = self.y_steps.next(&mut layers.place, y_median.get(), single + (length & !1).min(20) as usize);
        *y = y.wrapping_add(step);
        y_median.add(step);
        if let Some(layer) = &mut layers.height {
            let length = (length + self.y_steps.length()) / 2;
            let last = &mut self.last_heights[height_context(change.number, change.of)];
            *last = self.heights.next(layer, *last, single + (length & !1).min(18) as usize);
            *z = *last;
        }
    }
}
