//! Numbers out of a glTF's buffers, every place checked before it is read.

use gltf::Accessor;
use gltf::accessor::{DataType, Dimensions};

/// The elements of an accessor: equally long runs of bytes.
pub(super) struct Elements<'a> {
    bytes: &'a [u8],
    count: usize,
    stride: usize,
    data_type: DataType,
    /// Numbers an element.
    pub(super) width: usize,
    is_normalized: bool,
}

impl<'a> Elements<'a> {
    /// The elements of an accessor of at most `most` elements.
    pub(super) fn new(accessor: &Accessor<'_>, buffers: &'a [Vec<u8>], most: usize) -> Result<Self, String> {
        let place = format!("/accessors/{}", accessor.index());
        let count = accessor.count();
        if count > most {
            return Err(format!("{place}/count: {count}, at most {most} are allowed"));
        }
        if accessor.sparse().is_some() {
            return Err(format!("{place}/sparse: sparse accessors are not read"));
        }
        let view = accessor.view().ok_or_else(|| format!("{place}: the key `bufferView` is missing"))?;
        let width = match accessor.dimensions() {
            Dimensions::Scalar => 1,
            Dimensions::Vec2 => 2,
            Dimensions::Vec3 => 3,
            Dimensions::Vec4 => 4,
            other => return Err(format!("{place}/type: {other:?} is not read")),
        };
        let size = width * accessor.data_type().size();
        let stride = view.stride().unwrap_or(size);
        let beyond = || format!("{place}: reaches beyond its buffer");
        let buffer = buffers.get(view.buffer().index()).ok_or_else(beyond)?;
        let view_end = view.offset().checked_add(view.length()).ok_or_else(beyond)?;
        let in_view = buffer.get(view.offset()..view_end).ok_or_else(beyond)?;
        let bytes = in_view.get(accessor.offset()..).ok_or_else(beyond)?;
        let needed = count.saturating_sub(1).checked_mul(stride).and_then(|start| start.checked_add(size));
        if stride < size || (count > 0 && needed.is_none_or(|needed| needed > bytes.len())) {
            return Err(beyond());
        }
        let (data_type, is_normalized) = (accessor.data_type(), accessor.normalized());
        Ok(Self { bytes, count, stride, data_type, width, is_normalized })
    }

    pub(super) const fn len(&self) -> usize {
        self.count
    }

    pub(super) fn is_float(&self) -> bool {
        self.data_type == DataType::F32
    }

    /// One number; normalised integers as what they stand for, 0 to 1 or -1 to 1. 0 beyond the elements.
    pub(super) fn number(&self, element: usize, at: usize) -> f64 {
        let size = self.data_type.size();
        let start = element * self.stride + at * size;
        let bytes = self.bytes.get(start..start + size).unwrap_or(&[]);
        let scaled =
            |value: f64, most: f64| if self.is_normalized { (value / most).max(-1.0) } else { value };
        match (self.data_type, bytes) {
            (DataType::I8, [a]) => scaled(f64::from(a.cast_signed()), 127.0),
            (DataType::U8, [a]) => scaled(f64::from(*a), 255.0),
            (DataType::I16, [a, b]) => scaled(f64::from(i16::from_le_bytes([*a, *b])), 32_767.0),
            (DataType::U16, [a, b]) => scaled(f64::from(u16::from_le_bytes([*a, *b])), 65_535.0),
            (DataType::U32, [a, b, c, d]) => f64::from(u32::from_le_bytes([*a, *b, *c, *d])),
            (DataType::F32, [a, b, c, d]) => f64::from(f32::from_le_bytes([*a, *b, *c, *d])),
            _ => 0.0,
        }
    }
}
