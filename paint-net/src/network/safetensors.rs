//! Named tensors of `f32` in the safetensors format, whole or with matrices rounded to bytes.
//!
//! Files are read and checked by the crate `safetensors`. The header is written here: the crate writes notes in an order that
//! differs from run to run, and one training must give the same bytes twice.

use std::fmt::Write as _;

use ::safetensors::{Dtype, SafeTensorError, SafeTensors};
use serde_json::Value;

use crate::error::Error;

/// A named tensor: extents and values.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Tensor {
    pub(crate) name: String,
    pub(crate) shape: Vec<usize>,
    pub(crate) values: Vec<f32>,
}

/// Notes of a file: names and texts, in no order.
pub(crate) type Notes = Vec<(String, String)>;

/// How numbers are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Storage {
    /// As they are, `F32`.
    Whole,
    /// Matrices as `I8`, each column a multiple of its largest magnitude over 127, which is stored beside it; all else as it is.
    Bytes,
}

/// Ending of the name of the tensor that holds the unit of each column of a matrix of bytes.
const UNITS: &str = ".unit";
/// Largest byte in use: the same both ways.
const LARGEST: f32 = 127.0;

/// A tensor as it is stored.
struct Stored<'a> {
    name: String,
    kind: &'static str,
    shape: &'a [usize],
    bytes: Vec<u8>,
}

/// The bytes of a file with these tensors and notes, in this order.
pub(crate) fn write(tensors: &[Tensor], notes: &[(&str, String)], storage: Storage) -> Vec<u8> {
    let quoted = |text: &str| Value::from(text).to_string();
    let notes: Vec<String> = notes.iter().map(|(name, note)| format!("{}:{}", quoted(name), quoted(note))).collect();
    let mut header = format!("{{\"__metadata__\":{{{}}}", notes.join(","));
    let stored: Vec<Stored> = tensors.iter().flat_map(|tensor| stored(tensor, storage)).collect();
    let mut at = 0;
    for Stored { name, kind, shape, bytes } in &stored {
        let end = at + bytes.len();
        let shape: Vec<String> = shape.iter().map(ToString::to_string).collect();
        let (name, shape) = (quoted(name), shape.join(","));
        // Writing into a string cannot fail.
        let _ = write!(header, ",{name}:{{\"dtype\":\"{kind}\",\"shape\":[{shape}],\"data_offsets\":[{at},{end}]}}");
        at = end;
    }
    header.push('}');
    // Numbers start at a multiple of eight.
    while header.len() % 8 != 0 {
        header.push(' ');
    }
    let mut bytes = (header.len() as u64).to_le_bytes().to_vec();
    bytes.extend_from_slice(header.as_bytes());
    bytes.extend(stored.into_iter().flat_map(|tensor| tensor.bytes));
    bytes
}

/// A tensor as one of the file, or as bytes and their units.
fn stored(tensor: &Tensor, storage: Storage) -> Vec<Stored<'_>> {
    let name = tensor.name.clone();
    let whole = |values: &[f32]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    match *tensor.shape.as_slice() {
        [_, columns] if storage == Storage::Bytes && columns > 0 => {
            let mut units = vec![0.0_f32; columns];
            for row in tensor.values.chunks_exact(columns) {
                for (unit, value) in units.iter_mut().zip(row) {
                    *unit = unit.max(value.abs() / LARGEST);
                }
            }
            let byte = |(value, unit): (&f32, &f32)| if *unit > 0.0 { (value / unit).round() as i8 } else { 0 };
            let bytes = tensor.values.chunks_exact(columns).flat_map(|row| row.iter().zip(&units).map(byte));
            let bytes = bytes.flat_map(i8::to_le_bytes).collect();
            // The units first: a file's numbers lie at multiples of their size.
            vec![
                Stored { name: name.clone() + UNITS, kind: "F32", shape: &tensor.shape[1..], bytes: whole(&units) },
                Stored { name, kind: "I8", shape: &tensor.shape, bytes },
            ]
        }
        _ => vec![Stored { name, kind: "F32", shape: &tensor.shape, bytes: whole(&tensor.values) }],
    }
}

/// Tensors and notes of a file, the tensors in the order of their values.
pub(crate) fn read(bytes: &[u8]) -> Result<(Vec<Tensor>, Notes), Error> {
    let bad = |error: SafeTensorError| Error::Weights(format!("not safetensors, or cut off ({error})"));
    let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(bad)?;
    let file = SafeTensors::deserialize(bytes).map_err(bad)?;
    let is_bytes = |name: &str| file.tensor(name).is_ok_and(|view| view.dtype() == Dtype::I8);
    let is_own = |name: &String| !name.strip_suffix(UNITS).is_some_and(is_bytes);
    let numbers = |name: &str| -> Result<Vec<f32>, Error> {
        let view = file.tensor(name).map_err(bad)?;
        if view.dtype() != Dtype::F32 {
            return Err(Error::Weights(format!("tensor {name} is not F32")));
        }
        Ok(view.data().as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect())
    };
    let tensor = |name: String| {
        let view = file.tensor(&name).map_err(bad)?;
        let values = if view.dtype() == Dtype::I8 {
            let units = numbers(&(name.clone() + UNITS))?;
            if view.shape().last() != Some(&units.len()) {
                return Err(Error::Weights(format!("tensor {name} has not one unit for each column")));
            }
            let bytes = view.data().iter().map(|&byte| f32::from(byte.cast_signed()));
            bytes.zip(units.iter().cycle()).map(|(byte, unit)| byte * unit).collect()
        } else {
            numbers(&name)?
        };
        Ok(Tensor { shape: view.shape().to_vec(), values, name })
    };
    let tensors = metadata.offset_keys().into_iter().filter(is_own).map(tensor).collect::<Result<_, _>>()?;
    let notes = metadata.metadata().iter().flatten().map(|(name, note)| (name.clone(), note.clone())).collect();
    Ok((tensors, notes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tensors_and_notes_come_back() {
        let tensors = [
            Tensor { name: "a \"b\"".into(), shape: vec![2, 1], values: vec![1.5, -0.0] },
            Tensor { name: "c".into(), shape: vec![], values: vec![f32::MIN_POSITIVE] },
        ];
        let bytes = write(&tensors, &[("seed", "7\\".into())], Storage::Whole);
        let (read_tensors, notes) = read(&bytes).unwrap();
        assert_eq!(read_tensors, tensors);
        assert_eq!(notes, [("seed".to_string(), "7\\".to_string())]);
        for cut in 0..bytes.len() {
            assert!(matches!(read(&bytes[..cut]), Err(Error::Weights(_))), "cut at {cut}");
        }
    }

    /// Columns of very different sizes, one of zeros: each number is within half of its column's unit, the largest are kept.
    #[test]
    fn bytes_round_each_column_by_its_own_unit() {
        let (rows, largest) = (50, [3.0_f32, 1e-4, 0.0]);
        let value = |k: usize, l: f32| l * (k as f32 / (rows - 1) as f32 * 2.0 - 1.0);
        let values: Vec<f32> = (0..rows).flat_map(|k| largest.map(|l| value(k, l))).collect();
        let matrix = Tensor { name: "m".into(), shape: vec![rows, 3], values };
        let row = Tensor { name: "b".into(), shape: vec![2], values: vec![0.1, -0.7] };
        let bytes = write(&[matrix.clone(), row.clone()], &[], Storage::Bytes);
        assert!(bytes.len() < 8 + 300 + 3 * rows + 4 * (3 + 2));
        let (tensors, _) = read(&bytes).unwrap();
        assert_eq!((tensors.len(), &tensors[0].shape, &tensors[1]), (2, &matrix.shape, &row));
        for (k, (found, wanted)) in tensors[0].values.iter().zip(&matrix.values).enumerate() {
            let unit = largest[k % 3] / 127.0;
            assert!((found - wanted).abs() <= 0.5001 * unit, "{k}: {found} {wanted}");
        }
        assert!(tensors[0].values.iter().zip(&matrix.values).any(|(found, wanted)| found != wanted));
        for cut in 0..bytes.len() {
            assert!(matches!(read(&bytes[..cut]), Err(Error::Weights(_))), "cut at {cut}");
        }
    }

    /// Bytes without units, or with units of another number of columns.
    #[test]
    fn bytes_without_their_units_are_refused() {
        let file = |header: &str, numbers: usize| {
            let header = format!("{header:80}");
            [&80_u64.to_le_bytes()[..], header.as_bytes(), &vec![0; numbers]].concat()
        };
        let alone = r#"{"x":{"dtype":"I8","shape":[2,4],"data_offsets":[0,8]}}"#;
        assert!(matches!(read(&file(alone, 8)), Err(Error::Weights(why)) if why.contains("x.unit")));
        let fewer = Tensor { name: "x".into(), shape: vec![1, 2], values: vec![1.0, 2.0] };
        let text = write(&[fewer], &[], Storage::Bytes);
        let at = text.windows(5).position(|w| w == b"[1,2]").unwrap();
        let mut turned = text.clone();
        turned[at..at + 5].copy_from_slice(b"[2,1]");
        assert!(read(&text).is_ok());
        assert!(matches!(read(&turned), Err(Error::Weights(why)) if why.contains("one unit for each column")));
    }

    #[test]
    fn reads_a_file_of_the_reference_implementation() {
        // By hand after the format's own example: header of 0x40 bytes, one tensor of 1 and 2.
        let header = r#"{"x":{"dtype":"F32","shape":[2],"data_offsets":[0,8]}}          "#;
        let mut bytes = vec![0x40, 0, 0, 0, 0, 0, 0, 0];
        bytes.extend_from_slice(header.as_bytes());
        bytes.extend_from_slice(&[0, 0, 0x80, 0x3f, 0, 0, 0, 0x40]);
        assert_eq!(header.len(), 0x40);
        let (tensors, _) = read(&bytes).unwrap();
        assert_eq!(tensors, [Tensor { name: "x".into(), shape: vec![2], values: vec![1.0, 2.0] }]);
    }

    #[test]
    fn the_shipped_weights_are_written_byte_for_byte() {
        let shipped = include_bytes!("../../weights/painter.safetensors");
        let (tensors, mut notes) = read(shipped).unwrap();
        notes.sort();
        let notes: Vec<(&str, String)> = notes.iter().map(|(name, note)| (name.as_str(), note.clone())).collect();
        assert!(write(&tensors, &notes, Storage::Whole) == shipped);
    }

    #[test]
    fn foreign_bytes_are_named() {
        for bytes in [
            &b""[..],
            b"\x89PNG\r\n\x1a\n0000000000000",
            b"\x02\0\0\0\0\0\0\0[]",
            b"\x08\0\0\0\0\0\0\0{{{{{{{{",
            b"\x24\0\0\0\0\0\0\0{\"a\":{\"dtype\":\"F16\",\"shape\":[1],\"d\":[0]}",
        ] {
            assert!(matches!(read(bytes), Err(Error::Weights(_))));
        }
    }
}
