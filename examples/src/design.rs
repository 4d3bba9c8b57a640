//! The wanted picture, as ink in `[0, 1]`: 0 is bare wall, 1 the darkest the paint can be.

use std::path::{Path, PathBuf};

use paint_net::Image;
use paint_net::procedural::{fbm, value_noise};
use uv_param::texture::{Texture, luminance};

use crate::design_places::design_places;
use crate::mesh_io::{MaterialError, MeshMaterials, TriangleMesh};
use crate::picture_file::open_upright;
use crate::picture_placement::PicturePlacement;
use crate::projection::Viewpoint;
use crate::surface::PaintSurface;

/// Largest ink asked for by the built-in designs: full black would need endless paint.
pub(crate) const DARKEST: f64 = 0.85;

/// Name of the design that is the mesh's own materials.
pub(crate) const MATERIALS: &str = "materials";
/// Name of the built-in picture in colour.
pub(crate) const MURAL: &str = "mural";

/// What to paint.
#[derive(Debug, Clone)]
pub enum Design {
    /// Base coat, striations and soft gradients, as the strata of a rock (built-in, seeded).
    Strata {
        /// Which one.
        seed: u64,
    },
    /// The same ink everywhere.
    Even {
        /// How much.
        ink: f64,
    },
    /// Eleven vertical stripes of rising darkness.
    Stripes,
    /// From bare wall on the left to dark on the right, with a ripple.
    Gradient,
    /// A picture where [`PicturePlacement`] puts it; dark means paint.
    Picture(Picture),
    /// A picture on the mesh's own texture coordinates; dark means paint.
    Texture(Picture),
    /// A picture for every material of the mesh, on its own texture coordinates; dark means paint.
    Materials(Vec<Picture>),
    /// The colours of the mesh's vertices; dark means paint.
    VertexColours,
}

/// A grey picture in memory.
#[derive(Debug, Clone)]
pub struct Picture {
    grey: image::ImageBuffer<image::Luma<f32>, Vec<f32>>,
}

/// What is wrong with a design.
#[derive(Debug, thiserror::Error)]
pub enum DesignError {
    /// Neither a built-in name nor a readable picture.
    #[error(
        "design \"{name}\": {why}; give mural, strata, stripes, gradient, colours, materials or a PNG, JPEG or SVG file"
    )]
    Unusable {
        /// What was given.
        name: String,
        /// Why it cannot be used.
        why: String,
    },
    /// The mesh lacks what the design lies on.
    #[error("the mesh has no {0}: use --design instead")]
    Missing(&'static str),
    /// Told to lie where it cannot.
    #[error("{0}")]
    NotMovable(&'static str),
    /// A picture of the mesh's materials cannot be read.
    #[error(transparent)]
    Material(#[from] MaterialError),
    /// The mesh's texture cannot be read.
    #[error("texture of the mesh: {0}")]
    Texture(#[from] uv_param::Error),
    /// The wall has no such reflectance.
    #[error("wall: {0}")]
    Wall(#[source] paint_sim::Error),
    /// The picture plane has no pixels.
    #[error("picture plane: {0}")]
    Plane(#[from] paint_net::Error),
}

impl Design {
    /// Whether a name is that of a design that needs no file.
    pub fn is_built_in(name: &str) -> bool {
        ["strata", "stripes", "gradient", "colours", MATERIALS, MURAL].contains(&name)
    }

    /// From the command line: a built-in name or a file.
    pub fn from_name(name: &str, seed: u64) -> Result<Self, DesignError> {
        match name {
            "strata" => Ok(Self::Strata { seed }),
            "stripes" => Ok(Self::Stripes),
            "gradient" => Ok(Self::Gradient),
            "colours" => Ok(Self::VertexColours),
            MURAL => Err(DesignError::NotMovable("the mural is in colour: give its paints with --palette")),
            file => Picture::open(Path::new(file)).map(Self::Picture),
        }
    }

    /// The base colours that the mesh's own file names.
    pub fn from_materials(materials: &MeshMaterials) -> Result<Self, DesignError> {
        let pictures = materials.materials.iter().map(|m| Picture::from_rgba(&m.picture()?.into()));
        Ok(Self::Materials(pictures.collect::<Result<_, DesignError>>()?))
    }

    /// Ink wanted on every texel of a surface made from `mesh`. Designs that do not lie on the mesh itself are laid over the box of a surface
    /// in one piece, or with a viewpoint over what is seen from there; a picture lies in that box as `placement` says. On a surface with
    /// seams, where its charts would tear, they fill space: what a viewer in front sees goes through to the back.
    pub fn on_surface(
        &self,
        surface: &PaintSurface,
        mesh: &TriangleMesh,
        placement: &PicturePlacement,
        viewpoint: Option<Viewpoint>,
    ) -> Result<Image, DesignError> {
        self.check_movable(placement, viewpoint)?;
        let (width, height) = (surface.width(), surface.height());
        let texture = match self {
            Self::Texture(picture) => {
                Texture::from_image(&surface.texels, surface.disk(), &corner_uv(mesh)?, |_, uv| [picture.repeated(uv)])?
            }
            Self::Materials(pictures) => {
                let materials = mesh.materials.as_ref().ok_or(DesignError::Missing("materials"))?;
                let grey = |face: u32, uv| [pictures[materials.faces[face as usize] as usize].repeated(uv)];
                Texture::from_image(&surface.texels, surface.disk(), &corner_uv(mesh)?, grey)?
            }
            Self::VertexColours => {
                let colours = mesh.colours.as_ref().ok_or(DesignError::Missing("vertex colours"))?;
                let grey: Vec<[f32; 1]> = colours.iter().map(|&c| [luminance(c)]).collect();
                Texture::from_vertices(&surface.texels, surface.disk(), &grey)?
            }
            _ => {
                let (places, extent) = design_places(surface, viewpoint);
                let ink = |place: &Option<[f64; 2]>| place.map_or(0.0, |at| self.ink(at, extent, placement));
                return Ok(Image::new(width, height, places.iter().map(ink).collect())?);
            }
        };
        let ink = texture.texels.iter().map(|t| DARKEST * (1.0 - f64::from(t[0])).clamp(0.0, 1.0)).collect();
        Ok(Image::new(width, height, ink)?)
    }

    /// Refuses a placement or a viewpoint that this design would leave unused.
    pub fn check_movable(&self, placement: &PicturePlacement, viewpoint: Option<Viewpoint>) -> Result<(), DesignError> {
        let lies_on_mesh = matches!(self, Self::Texture(_) | Self::Materials(_) | Self::VertexColours);
        if lies_on_mesh && viewpoint.is_some() {
            return Err(DesignError::NotMovable(
                "--project throws a design onto the surface, but textures and colours of the mesh lie on it already: leave it out",
            ));
        }
        if !matches!(self, Self::Picture(_)) && *placement != PicturePlacement::default() {
            return Err(DesignError::NotMovable(
                "--place, --size, --rotate and --offset move a picture, but the design is none: give --design a PNG, JPEG or SVG file",
            ));
        }
        Ok(())
    }

    /// Ink wanted at `(x, y)` metres from the top-left corner of a surface of the given width and height; none for designs
    /// that lie on the mesh itself.
    fn ink(&self, [x, y]: [f64; 2], extent: [f64; 2], placement: &PicturePlacement) -> f64 {
        let (u, v) = (x / extent[0], y / extent[1]);
        match self {
            Self::Even { ink } => *ink,
            Self::Strata { seed } => strata(*seed, x, y, u, v),
            Self::Stripes => {
                let stripe = (u * 11.0).floor().clamp(0.0, 10.0);
                if stripe % 2.0 == 0.0 { DARKEST * (0.25 + 0.75 * stripe / 10.0) } else { 0.05 }
            }
            Self::Gradient => {
                let ripple = 0.06 * (std::f64::consts::TAU * v * 3.0).sin() * (std::f64::consts::PI * u).sin();
                (DARKEST * u + ripple).clamp(0.0, DARKEST)
            }
            Self::Picture(picture) => placement
                .locate([x, y], extent, picture.aspect())
                .map_or(0.0, |[u, v]| DARKEST * f64::from(1.0 - picture.sample(u, v))),
            Self::Texture(_) | Self::Materials(_) | Self::VertexColours => 0.0,
        }
    }
}

/// Texture coordinates of the corners of every face.
pub(crate) fn corner_uv(mesh: &TriangleMesh) -> Result<Vec<[[f32; 2]; 3]>, DesignError> {
    let uv = mesh.uv.as_ref().ok_or(DesignError::Missing("texture coordinates"))?;
    Ok(uv.faces.iter().map(|face| face.map(|i| uv.coordinates[i as usize])).collect())
}

/// Strata: a base coat that breathes, bands that dip and pinch, and a dark foot that fades upwards.
fn strata(seed: u64, x: f64, y: f64, u: f64, v: f64) -> f64 {
    let base = 0.06 + 0.22 * fbm(seed ^ 0xBA5E, x / 1.1, y / 1.1, 3);
    // Bands follow a dipping coordinate that folds gently along the wall.
    let fold = 0.16 * (value_noise(seed ^ 0xF01D, x / 0.9, y / 1.6) - 0.5) + 0.05 * (x / 0.7).sin();
    let depth = y + 0.12 * x + fold;
    let band = |period: f64, salt: u64| {
        let phase = depth / period + value_noise(seed ^ salt, x / 1.3, 0.5);
        // Zero at whole phases, where the strength below changes from one band to the next.
        let wave = 0.5 - 0.5 * (std::f64::consts::TAU * phase).cos();
        wave * wave * value_noise(seed ^ salt ^ 0xC0DE, x / 0.8, phase.floor())
    };
    let striations = 0.85 * band(0.46, 0x11) + 0.45 * band(0.19, 0x22);
    let foot = 0.22 * smoothstep((v - 0.55) / 0.45) * (0.6 + 0.4 * u);
    (base + striations + foot).clamp(0.0, DARKEST)
}

fn smoothstep(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

impl Picture {
    /// Reads a PNG, JPEG or SVG; colours become grey by their Rec. 709 weights, transparency shows white.
    pub fn open(path: &Path) -> Result<Self, DesignError> {
        let name = PathBuf::from(path).display().to_string();
        let unusable = |why: String| DesignError::Unusable { name: name.clone(), why };
        let picture = open_upright(path).map_err(|e| unusable(format!("cannot be read as a picture ({e})")))?;
        Self::from_rgba(&picture).map_err(|error| match error {
            DesignError::Unusable { why, .. } => unusable(why),
            other => other,
        })
    }

    /// The same from a picture in memory.
    fn from_rgba(picture: &image::DynamicImage) -> Result<Self, DesignError> {
        if picture.width() < 2 || picture.height() < 2 {
            let why = format!("is only {} x {} pixels", picture.width(), picture.height());
            return Err(DesignError::Unusable { name: "texture of the mesh".into(), why });
        }
        let rgba = picture.to_rgba32f();
        let grey = image::ImageBuffer::from_fn(rgba.width(), rgba.height(), |x, y| {
            let [r, g, b, a] = rgba.get_pixel(x, y).0;
            image::Luma([1.0 - a * (1.0 - (0.2126 * r + 0.7152 * g + 0.0722 * b))])
        });
        Ok(Self { grey })
    }

    /// Width over height.
    pub fn aspect(&self) -> f64 {
        f64::from(self.grey.width()) / f64::from(self.grey.height())
    }

    /// The same where the picture repeats and v runs up: its top row is v = 1.
    fn repeated(&self, [u, v]: [f64; 2]) -> f32 {
        self.sample(u.rem_euclid(1.0), 1.0 - v.rem_euclid(1.0))
    }

    /// Bilinear grey value at `(u, v)` in `[0, 1]`, v down; clamped to the border.
    pub fn sample(&self, u: f64, v: f64) -> f32 {
        let (w, h) = (self.grey.width(), self.grey.height());
        let x = (u * f64::from(w) - 0.5).clamp(0.0, f64::from(w - 1));
        let y = (v * f64::from(h) - 0.5).clamp(0.0, f64::from(h - 1));
        let (x0, y0) = ((x as u32).min(w - 2), (y as u32).min(h - 2));
        let (fx, fy) = ((x - f64::from(x0)) as f32, (y - f64::from(y0)) as f32);
        let at = |dx: u32, dy: u32| self.grey.get_pixel(x0 + dx, y0 + dy).0[0];
        let row = |dy: u32| at(0, dy) * (1.0 - fx) + at(1, dy) * fx;
        row(0) * (1.0 - fy) + row(1) * fy
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture_placement::PlacementMode;

    #[test]
    fn ink_stays_between_bare_and_darkest() {
        for design in [Design::Strata { seed: 3 }, Design::Stripes, Design::Gradient] {
            for k in 0..2000 {
                let (x, y) = (f64::from(k % 50) * 0.1, f64::from(k / 50) * 0.05);
                let ink = design.ink([x, y], [5.0, 2.0], &PicturePlacement::default());
                assert!((0.0..=DARKEST).contains(&ink), "{design:?} at {x}, {y}: {ink}");
            }
        }
    }

    #[test]
    fn a_picture_is_dark_where_it_is_dark() {
        let grey = image::ImageBuffer::from_fn(4, 2, |x, _| image::Luma([x as f32 / 3.0]));
        let design = Design::Picture(Picture { grey });
        let stretched = PicturePlacement { mode: PlacementMode::Stretch, ..PicturePlacement::default() };
        assert!((design.ink([0.0, 0.5], [1.0, 1.0], &stretched) - DARKEST).abs() < 1e-6);
        assert!(design.ink([1.0, 0.5], [1.0, 1.0], &stretched).abs() < 1e-6);
        assert!((design.ink([0.5, 0.5], [1.0, 1.0], &stretched) - 0.5 * DARKEST).abs() < 1e-6);
    }

    #[test]
    fn an_unknown_name_says_what_is_allowed() {
        let message = Design::from_name("zebra", 1).unwrap_err().to_string();
        assert!(message.contains("zebra") && message.contains("stripes"), "{message}");
    }
}
