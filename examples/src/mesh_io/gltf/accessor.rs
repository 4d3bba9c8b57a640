//! Numbers of a glTF accessor, every length checked against the bytes that are there.
//!
//! Read here and not by the reader of `gltf` (1.4.1): that yields nothing where a view is too short, as if the attribute were not
//! there, and panics where an accessor is empty or its sparse values end early.

use ::gltf::accessor::sparse::IndexType;
use ::gltf::accessor::{Accessor, DataType};
use ::gltf::buffer::View;

use super::super::fault::Fault;
use super::buffers::view_bytes;

/// Elements of an accessor without bytes of its own (all zero but for sparse ones); there is no file length to check them against.
const MOST_ZEROS: usize = 1 << 24;

/// All numbers of an accessor, element by element, normalised integers as fractions.
pub(super) fn numbers(accessor: &Accessor, buffers: &[Vec<u8>], dimensions: &[usize]) -> Result<Vec<f64>, Fault> {
    let (count, width) = (accessor.count(), accessor.dimensions().multiplicity());
    let fault = |what: String| Fault { place: format!("accessor {}", accessor.index()), what };
    if !dimensions.contains(&width) {
        return Err(fault(format!("has {width} numbers per element, expected {dimensions:?}")));
    }
    let (kind, normalised) = (accessor.data_type(), accessor.normalized());
    let size = kind.size() * width;
    let read = |bytes: &[u8]| decode(bytes, kind, normalised);
    let elements = |bytes: &[u8], stride: usize, count: usize, into: &mut Vec<f64>| {
        for element in bytes.chunks(stride).take(count) {
            into.extend(element[..size].chunks_exact(kind.size()).map(read));
        }
    };
    let mut values = Vec::new();
    match accessor.view() {
        Some(view) => {
            let stride = view.stride().unwrap_or(size);
            let bytes = stretch(&view, accessor.offset(), [count, stride, size], buffers).map_err(&fault)?;
            elements(bytes, stride, count, &mut values);
        }
        None if count > MOST_ZEROS => return Err(fault(format!("has {count} elements and no bytes for them"))),
        None => values.resize(count * width, 0.0),
    }
    if let Some(sparse) = accessor.sparse() {
        let (indices, changed) = (sparse.indices(), sparse.values());
        let index_size = indices.index_type().size();
        let lengths = [sparse.count(), index_size, index_size];
        let places = stretch(&indices.view(), indices.offset(), lengths, buffers).map_err(&fault)?;
        let bytes =
            stretch(&changed.view(), changed.offset(), [sparse.count(), size, size], buffers).map_err(&fault)?;
        let mut replaced = Vec::new();
        elements(bytes, size, sparse.count(), &mut replaced);
        let kind = match indices.index_type() {
            IndexType::U8 => DataType::U8,
            IndexType::U16 => DataType::U16,
            IndexType::U32 => DataType::U32,
        };
        for (place, value) in places.chunks_exact(index_size).zip(replaced.chunks_exact(width)) {
            let at = decode(place, kind, false) as usize;
            let into = values.get_mut(at * width..(at + 1) * width);
            into.ok_or_else(|| fault(format!("sparse element {at} does not exist ({count} elements)")))?
                .copy_from_slice(value);
        }
    }
    Ok(values)
}

/// The bytes that `count` elements of `size` bytes, `stride` apart, take in a view.
fn stretch<'a>(
    view: &View,
    offset: usize,
    [count, stride, size]: [usize; 3],
    buffers: &'a [Vec<u8>],
) -> Result<&'a [u8], String> {
    let beyond = || "lies beyond the end of its buffer: the file is damaged, export it again".to_owned();
    let bytes = view_bytes(view, buffers).ok_or_else(beyond)?;
    if stride < size || count == 0 {
        return Err(format!("has {count} elements of {size} bytes every {stride} bytes"));
    }
    let length = (count - 1).checked_mul(stride).and_then(|n| n.checked_add(size)).ok_or_else(beyond)?;
    let end = offset.checked_add(length).ok_or_else(beyond)?;
    bytes.get(offset..end).ok_or_else(beyond)
}

/// One little-endian number.
fn decode(bytes: &[u8], kind: DataType, normalised: bool) -> f64 {
    let mut word = [0; 4];
    word[..kind.size()].copy_from_slice(bytes);
    let raw = u32::from_le_bytes(word);
    let (value, largest) = match kind {
        DataType::I8 => (f64::from(raw as u8 as i8), 127.0),
        DataType::U8 => (f64::from(raw), 255.0),
        DataType::I16 => (f64::from(raw as u16 as i16), 32_767.0),
        DataType::U16 => (f64::from(raw), 65_535.0),
        DataType::U32 => (f64::from(raw), f64::from(u32::MAX)),
        DataType::F32 => return f64::from(f32::from_le_bytes(word)),
    };
    if normalised { (value / largest).max(-1.0) } else { value }
}
