//! Pictures in the format of the MNIST data set (`idx3-ubyte`), packed with gzip or not.

use std::io::Read as _;
use std::path::Path;

use flate2::read::MultiGzDecoder;
use paint_net::Image;

use crate::paint_image::error::PaintImageError;

/// Bytes before the pixels: magic number, pictures, rows, columns, big-endian.
const HEADER: usize = 16;
/// Largest contents of a packed file that are read.
const MOST_BYTES: u64 = 1 << 30;
/// Unsigned bytes in three dimensions.
const MAGIC: usize = 0x0803;

/// The pictures of the one file of images in a folder, or of the file itself, as ink in `[0, 1]`: what is bright in the file
/// is painted (Paper IV, section 4: white paint on black).
pub(super) fn read(path: &Path, side: usize) -> Result<Vec<Image>, PaintImageError> {
    let file = if path.is_dir() { only_file(path)? } else { path.to_path_buf() };
    let wrong = |why: String| PaintImageError::File { path: file.display().to_string(), why };
    let bytes = std::fs::read(&file).map_err(|e| wrong(format!("cannot be read ({e})")))?;
    let bytes = if bytes.starts_with(&[0x1f, 0x8b]) {
        let mut unpacked = Vec::new();
        // No more than a data set of a million pictures: a small file can unpack to any size.
        let mut decoder = MultiGzDecoder::new(&bytes[..]).take(MOST_BYTES);
        decoder
            .read_to_end(&mut unpacked)
            .map_err(|e| wrong(format!("is not a whole gzip file ({e}): fetch it again")))?;
        unpacked
    } else {
        bytes
    };
    pictures(&bytes, side).map_err(wrong)
}

fn pictures(bytes: &[u8], side: usize) -> Result<Vec<Image>, String> {
    let words = bytes.get(..HEADER).ok_or("is shorter than the header of an idx file")?.as_chunks::<4>().0;
    let [magic, count, rows, columns] = [0, 1, 2, 3].map(|k| u32::from_be_bytes(words[k]) as usize);
    if magic != MAGIC {
        return Err(format!("begins with {magic:#06x}, not {MAGIC:#06x}: give a file of images (idx3-ubyte)"));
    }
    if (rows, columns) != (side, side) {
        return Err(format!("holds pictures of {columns} x {rows} pixels, the network paints {side} x {side}"));
    }
    let pixels = &bytes[HEADER..];
    if count.checked_mul(side * side) != Some(pixels.len()) {
        return Err(format!("tells of {count} pictures but holds {} bytes of them: cut off?", pixels.len()));
    }
    let ink = |picture: &[u8]| picture.iter().map(|&v| f64::from(v) / 255.0).collect();
    pixels.chunks_exact(side * side).map(|p| Image::new(side, side, ink(p)).map_err(|e| e.to_string())).collect()
}

fn only_file(folder: &Path) -> Result<std::path::PathBuf, PaintImageError> {
    let wrong = |why: String| PaintImageError::File { path: folder.display().to_string(), why };
    let entries = std::fs::read_dir(folder).map_err(|e| wrong(format!("cannot be listed ({e})")))?;
    let is_images = |p: &std::path::PathBuf| p.file_name().is_some_and(|n| n.to_string_lossy().contains("idx3-ubyte"));
    let mut files: Vec<_> = entries.flatten().map(|e| e.path()).filter(is_images).collect();
    files.sort();
    match files.as_slice() {
        [one] => Ok(one.clone()),
        [] => Err(wrong("holds no file of images (*idx3-ubyte*, packed with gzip or not)".into())),
        _ => Err(wrong(format!("holds {} files of images: name one of them", files.len()))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `printf '\0\0\10\3\0\0\0\1\0\0\0\2\0\0\0\2\0\63\146\377' | gzip -n9`, by the outside program: one picture.
    const PACKED: &[u8] = &[
        31, 139, 8, 0, 0, 0, 0, 0, 2, 3, 99, 96, 224, 96, 102, 96, 96, 96, 4, 98, 38, 48, 54, 78, 251, 15, 0, 3, 180,
        54, 250, 20, 0, 0, 0,
    ];

    #[test]
    fn a_packed_file_is_read_and_a_damaged_one_named() {
        let file = std::env::temp_dir().join(format!("paintcopter-{}-idx3-ubyte.gz", std::process::id()));
        let read_bytes = |bytes: &[u8]| {
            std::fs::write(&file, bytes).unwrap();
            let read = read(&file, 2);
            std::fs::remove_file(&file).unwrap();
            read
        };
        let pictures = read_bytes(PACKED).unwrap();
        assert!(pictures.len() == 1 && pictures[0].data() == [0.0, 0.2, 0.4, 1.0]);
        for cut in 2..PACKED.len() {
            let error = read_bytes(&PACKED[..cut]).unwrap_err().to_string();
            assert!(error.contains("gzip") && error.contains("idx3-ubyte.gz"), "cut at {cut}: {error}");
        }
        for bit in 16..8 * PACKED.len() {
            let mut bytes = PACKED.to_vec();
            bytes[bit / 8] ^= 1 << (bit % 8);
            // Time, system and flags say nothing about the contents; nothing else may change them unseen.
            if let Ok(read) = read_bytes(&bytes) {
                assert!(read.len() == 1 && read[0].data() == pictures[0].data(), "bit {bit}");
            }
        }
    }

    #[test]
    fn pictures_come_back_and_broken_files_are_named() {
        let mut bytes = [0, 0, 8, 3, 0, 0, 0, 2, 0, 0, 0, 2, 0, 0, 0, 2].to_vec();
        bytes.extend([0, 51, 102, 255, 1, 2, 3, 4]);
        let read = pictures(&bytes, 2).unwrap();
        assert!(read.len() == 2 && read[0].data() == [0.0, 0.2, 0.4, 1.0]);
        for (broken, word) in [
            (&bytes[..15], "shorter"),
            (&bytes[..23], "cut off"),
            (&[&[0, 0, 8, 1], &bytes[4..]].concat()[..], "idx3-ubyte"),
            (&[&bytes[..4], &[255; 4], &bytes[8..]].concat()[..], "cut off"),
        ] {
            assert!(pictures(broken, 2).unwrap_err().contains(word), "{word}");
        }
        assert!(pictures(&bytes, 28).unwrap_err().contains("28 x 28"));
    }
}
