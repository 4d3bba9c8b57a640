//! The picture of a design, in a file of its own until the mission is written.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use image::{ImageFormat, ImageReader};

use super::design_error::DesignError;
use crate::picture_file::{open_in_srgb, read_upright};

/// Most pixels of a picture: it is held in memory several times.
const MOST_PIXELS: u64 = 100_000_000;
/// Longest name that is kept of a file.
const LONGEST_NAME: usize = 40;

/// A picture that can be used.
#[derive(Debug)]
pub(super) struct StoredPicture {
    /// Its file.
    pub(super) path: PathBuf,
    /// Name of the file: letters, digits, `-` and `_`, with the ending of its format.
    pub(super) name: String,
    /// Width over height.
    pub(super) aspect: f64,
}

/// A folder that goes with its owner.
#[derive(Debug)]
pub(super) struct PictureStore {
    folder: PathBuf,
    stored: u64,
}

impl PictureStore {
    /// Makes the folder.
    ///
    /// # Errors
    /// What the system says.
    pub(super) fn new() -> Result<Self, DesignError> {
        static NUMBER: std::sync::atomic::AtomicU64 = std::sync::atomic::AtomicU64::new(0);
        let number = NUMBER.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        let folder = std::env::temp_dir().join(format!("paintcopter-design-{}-{number}", std::process::id()));
        std::fs::create_dir_all(&folder).map_err(DesignError::unwritable(&folder))?;
        Ok(Self { folder, stored: 0 })
    }

    /// Checks a PNG or JPEG and keeps it.
    ///
    /// # Errors
    /// Bytes that are neither, that are too large, or that no mission could read.
    pub(super) fn store(&mut self, name: &str, bytes: &[u8]) -> Result<StoredPicture, DesignError> {
        let wrong = |why: String| DesignError::Picture { name: shown(name), why };
        let ending = match image::guess_format(bytes) {
            Ok(ImageFormat::Png) => "png",
            Ok(ImageFormat::Jpeg) => "jpg",
            _ => return Err(wrong("is no PNG and no JPEG: save it as one of these".into())),
        };
        let size = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(image::ImageError::from);
        let (width, height) =
            size.and_then(ImageReader::into_dimensions).map_err(|error| wrong(format!("cannot be read ({error})")))?;
        if u64::from(width) * u64::from(height) > MOST_PIXELS {
            return Err(wrong(format!("has {width} x {height} pixels: make it smaller than 100 million")));
        }
        let picture = read_upright(bytes).map_err(|error| wrong(format!("cannot be read ({error})")))?;
        if picture.width() < 2 || picture.height() < 2 {
            return Err(wrong(format!("is only {width} x {height} pixels")));
        }
        let aspect = f64::from(picture.width()) / f64::from(picture.height());
        self.stored += 1;
        let path = self.folder.join(format!("{}.{ending}", self.stored));
        std::fs::write(&path, bytes).map_err(DesignError::unwritable(&path))?;
        // What the mission would refuse later is refused now.
        open_in_srgb(&path).map_err(|error| wrong(error.to_string()))?;
        Ok(StoredPicture { path, name: format!("{}.{ending}", plain_stem(name)), aspect })
    }
}

impl Drop for PictureStore {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

/// What is said of a name.
fn shown(name: &str) -> String {
    name.chars().filter(|c| !c.is_control()).take(2 * LONGEST_NAME).collect()
}

/// The stem of a name as every file system takes it.
fn plain_stem(name: &str) -> String {
    let stem = Path::new(name).file_stem().map(|stem| stem.to_string_lossy()).unwrap_or_default();
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
    let stem: String = stem.chars().take(LONGEST_NAME).map(plain).collect();
    if stem.is_empty() { "picture".into() } else { stem }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn png(width: u32, height: u32) -> Vec<u8> {
        let mut bytes = Vec::new();
        let picture = image::RgbImage::from_pixel(width, height, image::Rgb([200, 40, 30]));
        picture.write_to(&mut Cursor::new(&mut bytes), ImageFormat::Png).unwrap();
        bytes
    }

    #[test]
    fn a_picture_is_checked_and_kept_under_a_plain_name() {
        let mut store = PictureStore::new().unwrap();
        let kept = store.store("../../so \"schoen\"\n.png", &png(30, 20)).unwrap();
        assert_eq!((kept.name.as_str(), kept.aspect), ("so__schoen__.png", 1.5));
        assert!(kept.path.starts_with(std::env::temp_dir()) && std::fs::read(&kept.path).unwrap() == png(30, 20));
        let mut jpeg = Vec::new();
        image::RgbImage::new(8, 4).write_to(&mut Cursor::new(&mut jpeg), ImageFormat::Jpeg).unwrap();
        assert_eq!(store.store("", &jpeg).unwrap().name, "picture.jpg");
        let folder = store.folder.clone();
        drop(store);
        assert!(!folder.exists());
    }

    #[test]
    fn what_is_no_picture_is_refused_in_a_line() {
        let mut store = PictureStore::new().unwrap();
        let whole = png(30, 20);
        for (bytes, why) in [
            (&b"GIF89a"[..], "no PNG and no JPEG"),
            (&[], "no PNG and no JPEG"),
            (&whole[..whole.len() / 2], "cannot be read"),
            (&png(1, 9)[..], "only 1 x 9 pixels"),
        ] {
            let line = store.store("a\nb.png", bytes).unwrap_err().to_string();
            assert!(line.starts_with("ab.png: ") && line.contains(why) && !line.contains('\n'), "{line}");
        }
        // A head that claims more pixels than fit, and has none of them.
        let mut large = png(2, 2);
        large[16..24].copy_from_slice(&[0, 0, 0x75, 0x30, 0, 0, 0x75, 0x30]);
        let line = store.store("large.png", &large).unwrap_err().to_string();
        assert!(line.contains("30000 x 30000") || line.contains("cannot be read"), "{line}");
    }
}
