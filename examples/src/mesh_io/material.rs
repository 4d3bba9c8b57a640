//! The colours that a mesh file names for its faces.

use std::path::{Path, PathBuf};

use image::{DynamicImage, RgbaImage};
use uv_param::texture::linear_from_srgb;

use crate::picture_file::{PictureFileError, open_upright, read_upright};
use crate::srgb::srgb_byte;

/// Materials and which face has which.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MeshMaterials {
    /// The materials.
    pub materials: Vec<MeshMaterial>,
    /// Index into `materials` for every face.
    pub faces: Vec<u32>,
}

impl MeshMaterials {
    /// Whether any face has a picture.
    pub fn textured(&self) -> bool {
        self.faces.iter().any(|&m| self.materials[m as usize].texture.is_some())
    }
}

/// A base colour: a factor and a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshMaterial {
    /// Linear RGB in `[0, 1]`; multiplies the picture.
    pub colour: [f32; 3],
    /// Picture on the texture coordinates.
    pub texture: Option<TextureSource>,
    /// Whether the picture's transparency means nothing; white shows through otherwise.
    pub opaque: bool,
}

impl Default for MeshMaterial {
    fn default() -> Self {
        Self { colour: [1.0; 3], texture: None, opaque: false }
    }
}

/// Where a picture is.
#[derive(Debug, Clone, PartialEq)]
pub enum TextureSource {
    /// A file beside the mesh.
    File(PathBuf),
    /// Inside the mesh file, as the bytes of a PNG or JPEG.
    Bytes(Vec<u8>),
}

/// A picture that the mesh file names cannot be read.
#[derive(Debug, thiserror::Error)]
#[error("{place}: {source}; give a PNG or JPEG with --texture, or what to paint with --design")]
pub struct MaterialError {
    place: String,
    source: PictureFileError,
}

impl MeshMaterial {
    /// The picture with the factor in it; one colour where there is no picture.
    ///
    /// # Errors
    /// [`MaterialError`] where the picture cannot be read.
    pub fn picture(&self) -> Result<RgbaImage, MaterialError> {
        let mut picture = match &self.texture {
            None => RgbaImage::from_pixel(2, 2, image::Rgba([255; 4])),
            Some(source) => source.open()?.to_rgba8(),
        };
        // Palettes of one pixel are usual; sampling needs two.
        if picture.width() < 2 || picture.height() < 2 {
            let (width, height) = (picture.width().max(2), picture.height().max(2));
            picture = image::imageops::resize(&picture, width, height, image::imageops::FilterType::Nearest);
        }
        let factors = self.colour.map(|c| c.clamp(0.0, 1.0));
        let scaled = factors.map(|factor| {
            let byte =
                |c: u8| if factor < 1.0 { srgb_byte(factor * linear_from_srgb(f32::from(c) / 255.0)) } else { c };
            (0..=255).map(byte).collect::<Vec<u8>>()
        });
        for pixel in picture.pixels_mut() {
            for (value, table) in pixel.0.iter_mut().zip(&scaled) {
                *value = table[usize::from(*value)];
            }
            if self.opaque {
                pixel.0[3] = 255;
            }
        }
        Ok(picture)
    }
}

impl TextureSource {
    fn open(&self) -> Result<DynamicImage, MaterialError> {
        let (place, picture) = match self {
            Self::File(path) => (path.display().to_string(), open_upright(Path::new(path))),
            Self::Bytes(bytes) => ("texture in the mesh file".into(), read_upright(bytes)),
        };
        picture.map_err(|source| MaterialError { place, source })
    }
}
