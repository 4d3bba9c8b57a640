//! The wall under the paint: what it reflects, place by place.

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

use paint_sim::Substrate;
use paint_sim::colour::{BANDS, Spectrum, decode_srgb, decode_srgb8, spectrum_of_linear_srgb};
use serde::{Deserialize, Serialize};
use uv_param::texture::Texture;

use crate::colour_picture::ColourPicture;
use crate::design::{DesignError, corner_uv};
use crate::mesh_io::{MeshMaterials, TriangleMesh};
use crate::surface::PaintSurface;

/// Steps of a colour component from one reflectance of a textured wall to the next.
const STEPS: f64 = 63.0;

/// What the wall is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Wall {
    /// Warm stone, as in nature.
    #[default]
    Sandstone,
    /// White render.
    White,
    /// Grey concrete.
    Concrete,
    /// Something painted dark.
    Dark,
    /// One colour, sRGB.
    Colour([u8; 3]),
    /// As the mesh is coloured: its materials, or its vertices.
    Mesh,
}

impl Wall {
    /// Its reflectance where it is the same everywhere.
    pub fn substrate(self) -> Result<Substrate, paint_sim::Error> {
        match self {
            Self::Sandstone | Self::Mesh => Ok(Substrate::sandstone()),
            Self::White => Substrate::grey(0.85),
            Self::Concrete => Substrate::grey(0.36),
            Self::Dark => Substrate::grey(0.06),
            Self::Colour(rgb) => Substrate::new(spectrum_of_linear_srgb(rgb.map(decode_srgb8))),
        }
    }
}

impl FromStr for Wall {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let colour = || {
            let digits = text.strip_prefix('#').filter(|digits| digits.len() == 6)?;
            let component = |k: usize| u8::from_str_radix(digits.get(2 * k..2 * k + 2)?, 16).ok();
            Some(Self::Colour([component(0)?, component(1)?, component(2)?]))
        };
        match text {
            "sandstone" => Ok(Self::Sandstone),
            "white" => Ok(Self::White),
            "concrete" => Ok(Self::Concrete),
            "dark" => Ok(Self::Dark),
            "mesh" => Ok(Self::Mesh),
            _ => colour().ok_or_else(|| {
                format!(
                    "\"{text}\": give sandstone, white, concrete, dark, a colour as #rrggbb, or mesh (its own colours)"
                )
            }),
        }
    }
}

impl fmt::Display for Wall {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Sandstone => f.write_str("sandstone"),
            Self::White => f.write_str("white"),
            Self::Concrete => f.write_str("concrete"),
            Self::Dark => f.write_str("dark"),
            Self::Mesh => f.write_str("mesh"),
            Self::Colour([r, g, b]) => write!(f, "#{r:02x}{g:02x}{b:02x}"),
        }
    }
}

impl TryFrom<String> for Wall {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<Wall> for String {
    fn from(wall: Wall) -> Self {
        wall.to_string()
    }
}

/// Reflectances of a wall, and which of them each of some places has.
#[derive(Debug, Clone)]
pub struct WallSpectra {
    /// The first is the mean of all places.
    pub spectra: Vec<Spectrum>,
    /// One for each place.
    pub of_place: Vec<u32>,
}

impl WallSpectra {
    /// Of a wall at the pixels of a surface.
    ///
    /// # Errors
    /// A mesh without colours that shall have them.
    pub fn new(wall: Wall, surface: &PaintSurface, mesh: &TriangleMesh, pixels: &[usize]) -> Result<Self, DesignError> {
        if wall != Wall::Mesh {
            let spectra = vec![*wall.substrate().map_err(DesignError::Wall)?.reflectance()];
            return Ok(Self { spectra, of_place: vec![0; pixels.len()] });
        }
        let colours = mesh_colours(surface, mesh)?;
        let mut spectra = vec![[0.0; BANDS]];
        let mut known: BTreeMap<[u8; 3], u32> = BTreeMap::new();
        let mut of_place = Vec::with_capacity(pixels.len());
        let mut mean = [0.0; BANDS];
        for &pixel in pixels {
            // Steps that look alike: those of the stored values, which are linear to the eye.
            let key = colours[pixel].map(|c| (paint_sim::colour::encode_srgb(c.clamp(0.0, 1.0)) * STEPS).round() as u8);
            let number = *known.entry(key).or_insert_with(|| {
                let linear = key.map(|c| decode_srgb8((f64::from(c) * 255.0 / STEPS).round() as u8));
                spectra.push(spectrum_of_linear_srgb(linear));
                spectra.len() as u32 - 1
            });
            of_place.push(number);
            mean.iter_mut().zip(&spectra[number as usize]).for_each(|(mean, r)| *mean += r / pixels.len() as f64);
        }
        spectra[0] = mean;
        Ok(Self { spectra, of_place })
    }

    /// Reflectance at a place.
    pub fn at(&self, place: usize) -> &Spectrum {
        &self.spectra[self.of_place[place] as usize]
    }
}

/// Whether a mesh has colours of its own.
pub fn has_colours(mesh: &TriangleMesh) -> bool {
    mesh.colours.is_some() || mesh.uv.is_some() && mesh.materials.as_ref().is_some_and(MeshMaterials::textured)
}

/// Linear sRGB of the mesh's own colours on every pixel of the page.
fn mesh_colours(surface: &PaintSurface, mesh: &TriangleMesh) -> Result<Vec<[f64; 3]>, DesignError> {
    let texels = match (&mesh.materials, &mesh.colours) {
        (Some(materials), _) if materials.textured() && mesh.uv.is_some() => {
            let pictures = ColourPicture::of_materials(materials)?;
            let texel = |face: u32, uv| {
                let [r, g, b, _] = pictures[materials.faces[face as usize] as usize].repeated(uv);
                [r, g, b]
            };
            Texture::from_image(&surface.texels, surface.disk(), &corner_uv(mesh)?, texel)?.texels
        }
        (_, Some(colours)) => {
            let linear: Vec<[f32; 3]> = colours.iter().map(|c| c.map(|c| decode_srgb(f64::from(c)) as f32)).collect();
            Texture::from_vertices(&surface.texels, surface.disk(), &linear)?.texels
        }
        _ => return Err(DesignError::Missing("colours for the wall (--wall mesh)")),
    };
    Ok(texels.into_iter().map(|c| c.map(f64::from)).collect())
}
