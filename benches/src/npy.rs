//! Arrays for the peers that are written in Python.

use std::error::Error;
use std::path::Path;

/// One array of doubles in `NumPy`'s format 1.0.
///
/// # Errors
/// A file that cannot be written.
pub fn save(folder: &Path, name: &str, values: impl Iterator<Item = f64>) -> Result<(), Box<dyn Error>> {
    let values: Vec<f64> = values.collect();
    let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({},), }}", values.len());
    // Magic, version and length take ten bytes; the data begin at a multiple of 64.
    let length = (10 + header.len() + 1).next_multiple_of(64) - 10;
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((length as u16).to_le_bytes());
    bytes.extend(format!("{header:<width$}\n", width = length - 1).bytes());
    bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    let path = folder.join(format!("{name}.npy"));
    std::fs::write(&path, bytes).map_err(|e| format!("{}: {e}", path.display()).into())
}
