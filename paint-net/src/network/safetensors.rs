//! Named tensors of `f32` in the safetensors format.
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

/// The bytes of a file with these tensors and notes, in this order.
pub(crate) fn write(tensors: &[Tensor], notes: &[(&str, String)]) -> Vec<u8> {
    let quoted = |text: &str| Value::from(text).to_string();
    let notes: Vec<String> = notes.iter().map(|(name, note)| format!("{}:{}", quoted(name), quoted(note))).collect();
    let mut header = format!("{{\"__metadata__\":{{{}}}", notes.join(","));
    let mut at = 0;
    for t in tensors {
        let end = at + 4 * t.values.len();
        let shape: Vec<String> = t.shape.iter().map(ToString::to_string).collect();
        let (name, shape) = (quoted(&t.name), shape.join(","));
        // Writing into a string cannot fail.
        let _ = write!(header, ",{name}:{{\"dtype\":\"F32\",\"shape\":[{shape}],\"data_offsets\":[{at},{end}]}}");
        at = end;
    }
    header.push('}');
    // Numbers start at a multiple of eight.
    while header.len() % 8 != 0 {
        header.push(' ');
    }
    let mut bytes = (header.len() as u64).to_le_bytes().to_vec();
    bytes.extend_from_slice(header.as_bytes());
    bytes.extend(tensors.iter().flat_map(|t| &t.values).flat_map(|v| v.to_le_bytes()));
    bytes
}

/// Tensors and notes of a file, the tensors in the order of their values.
pub(crate) fn read(bytes: &[u8]) -> Result<(Vec<Tensor>, Notes), Error> {
    let bad = |error: SafeTensorError| Error::Weights(format!("not safetensors, or cut off ({error})"));
    let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(bad)?;
    let file = SafeTensors::deserialize(bytes).map_err(bad)?;
    let tensor = |name: String| {
        let view = file.tensor(&name).map_err(bad)?;
        if view.dtype() != Dtype::F32 {
            return Err(Error::Weights(format!("tensor {name} is not F32")));
        }
        let values = view.data().as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
        Ok(Tensor { shape: view.shape().to_vec(), values, name })
    };
    let tensors = metadata.offset_keys().into_iter().map(tensor).collect::<Result<_, _>>()?;
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
        let bytes = write(&tensors, &[("seed", "7\\".into())]);
        let (read_tensors, notes) = read(&bytes).unwrap();
        assert_eq!(read_tensors, tensors);
        assert_eq!(notes, [("seed".to_string(), "7\\".to_string())]);
        for cut in 0..bytes.len() {
            assert!(matches!(read(&bytes[..cut]), Err(Error::Weights(_))), "cut at {cut}");
        }
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
        assert!(write(&tensors, &notes) == shipped);
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
