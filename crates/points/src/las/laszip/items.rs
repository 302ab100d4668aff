//! Which records these decoders know.

use laz::{LazItem, LazItemType};

/// The records that these decoders know.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum KnownItems {
    /// Point formats 0 to 5, version 2.
    Pointwise(PointwiseItems),
    /// Point formats 6 to 8, version 3.
    Layered(LayeredItems),
}

/// What follows the fields of point format 0 in a record, in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PointwiseItems {
    pub(super) time: bool,
    pub(super) rgb: bool,
    pub(super) wave_packet: bool,
    pub(super) extra_bytes: usize,
}

/// What follows the fields of point format 6 in a record, in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LayeredItems {
    pub(super) rgb: bool,
    pub(super) infrared: bool,
    pub(super) extra_bytes: usize,
}

/// The fields of layered records that are wanted besides place, returns, class and flags.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct WantedLayers {
    pub(crate) intensity: bool,
    pub(crate) rgb: bool,
}

impl KnownItems {
    /// Returns what `items` are; `None` if the `laz` crate has to decode them. Their sizes must be those of their types.
    pub(crate) fn of(items: &[LazItem]) -> Option<KnownItems> {
        let (first, rest) = items.split_first()?;
        let version = first.version();
        // Wave packets of versions 1 and 2 are the same, and LASzip writes version 1 beside version 2 of the rest.
        let is_other = |item: &LazItem| item.version() != version && item.item_type() != LazItemType::WavePacket13;
        if rest.iter().any(is_other) {
            return None;
        }
        match (first.item_type(), version) {
            (LazItemType::Point10, 2) => PointwiseItems::of(rest).map(KnownItems::Pointwise),
            (LazItemType::Point14, 3) => LayeredItems::of(rest).map(KnownItems::Layered),
            _ => None,
        }
    }
}

/// Returns whether the `laz` crate would have to decode GPS times that can end the program. Its decoder of version 2 calls itself for each
/// leap from sequence to sequence, until the stack is full if the data are made to harm. Version 1 knows no sequences.
pub(crate) fn can_fill_the_stack(items: &[LazItem]) -> bool {
    let leaps = |item: &LazItem| item.item_type() == LazItemType::GpsTime && item.version() == 2;
    KnownItems::of(items).is_none() && items.iter().any(leaps)
}

impl PointwiseItems {
    fn of(items: &[LazItem]) -> Option<PointwiseItems> {
        let mut items = items.iter().map(LazItem::item_type).peekable();
        let time = items.next_if_eq(&LazItemType::GpsTime).is_some();
        let rgb = items.next_if_eq(&LazItemType::RGB12).is_some();
        let wave_packet = items.next_if_eq(&LazItemType::WavePacket13).is_some();
        let extra_bytes = match items.next() {
            None => 0,
            Some(LazItemType::Byte(count)) => count as usize,
            Some(_) => return None,
        };
        items.next().is_none().then_some(PointwiseItems { time, rgb, wave_packet, extra_bytes })
    }
}

impl LayeredItems {
    fn of(items: &[LazItem]) -> Option<LayeredItems> {
        let mut items = items.iter().map(LazItem::item_type).peekable();
        let infrared = items.next_if_eq(&LazItemType::RGBNIR14).is_some();
        let rgb = infrared || items.next_if_eq(&LazItemType::RGB14).is_some();
        let extra_bytes = match items.next() {
            None => 0,
            Some(LazItemType::Byte14(count)) => count as usize,
            Some(_) => return None,
        };
        items.next().is_none().then_some(LayeredItems { rgb, infrared, extra_bytes })
    }
}
