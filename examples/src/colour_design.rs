//! The wanted picture in colour.

use paint_sim::colour::decode_srgb;
use uv_param::texture::Texture;

use crate::colour_picture::ColourPicture;
use crate::design::{DesignError, corner_uv};
use crate::design_places::design_places;
use crate::mesh_io::TriangleMesh;
use crate::mural::Mural;
use crate::picture_placement::PicturePlacement;
use crate::projection::Viewpoint;
use crate::surface::PaintSurface;

/// What to paint in colour.
#[derive(Debug, Clone)]
pub enum ColourDesign {
    /// A landscape (built-in, seeded).
    Mural(Mural),
    /// A picture where [`PicturePlacement`] puts it.
    Picture(ColourPicture),
    /// A picture on the mesh's own texture coordinates.
    Texture(ColourPicture),
    /// A picture for every material of the mesh, on its own texture coordinates.
    Materials(Vec<ColourPicture>),
    /// The colours of the mesh's vertices.
    VertexColours,
}

impl ColourDesign {
    /// Linear sRGB and opacity on every pixel of a surface made from `mesh`, the colours multiplied by the opacity; laid as a
    /// [`Design`](crate::design::Design) is.
    pub fn on_surface(
        &self,
        surface: &PaintSurface,
        mesh: &TriangleMesh,
        placement: &PicturePlacement,
        viewpoint: Option<Viewpoint>,
    ) -> Result<Vec<[f32; 4]>, DesignError> {
        let texels = match self {
            Self::Texture(picture) => {
                Texture::from_image(&surface.texels, surface.disk(), &corner_uv(mesh)?, |_, uv| picture.repeated(uv))?
            }
            Self::Materials(pictures) => {
                let materials = mesh.materials.as_ref().ok_or(DesignError::Missing("materials"))?;
                let colour = |face: u32, uv| pictures[materials.faces[face as usize] as usize].repeated(uv);
                Texture::from_image(&surface.texels, surface.disk(), &corner_uv(mesh)?, colour)?
            }
            Self::VertexColours => {
                let colours = mesh.colours.as_ref().ok_or(DesignError::Missing("vertex colours"))?;
                let linear = |c: &[f32; 3]| {
                    let [r, g, b] = c.map(|c| decode_srgb(f64::from(c)) as f32);
                    [r, g, b, 1.0]
                };
                let colours: Vec<[f32; 4]> = colours.iter().map(linear).collect();
                Texture::from_vertices(&surface.texels, surface.disk(), &colours)?
            }
            Self::Picture(picture) => {
                let (places, extent) = design_places(surface, viewpoint);
                let across = placement.size_in(extent, picture.aspect())[0];
                let pixels = picture.width() as f64 * surface.texels.texel_m / across;
                let colour = |at: [f64; 2]| {
                    placement.locate(at, extent, picture.aspect()).map_or([0.0; 4], |at| picture.sample(at, pixels))
                };
                return Ok(places.into_iter().map(|place| place.map_or([0.0; 4], colour)).collect());
            }
            Self::Mural(mural) => {
                let (places, extent) = design_places(surface, viewpoint);
                let colour = |at: [f64; 2]| {
                    let [r, g, b] = mural.colour(at, extent).map(|c| c as f32);
                    [r, g, b, 1.0]
                };
                return Ok(places.into_iter().map(|place| place.map_or([0.0; 4], colour)).collect());
            }
        };
        Ok(texels.texels)
    }
}
