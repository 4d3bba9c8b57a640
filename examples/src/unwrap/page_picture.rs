//! Pictures of pages: a checkerboard in the colours of the stretch, or the mesh's own texture carried over.

use uv_param::atlas::{PageTexels, TexelKind};
use uv_param::texture::linear_from_srgb;
use uv_param::{Atlas, SurfacePoint};

use crate::mesh_io::MeshUv;
use crate::srgb::srgb_byte;

/// Texels along a square of the checkerboard.
const SQUARE: usize = 8;
/// Colours of the stretch: none, the bound, the worst that is allowed.
const COLOURS: [[f64; 3]; 3] = [[232.0, 238.0, 242.0], [244.0, 178.0, 92.0], [196.0, 40.0, 40.0]];
/// How much darker every other square is.
const DARKER: f64 = 0.72;
/// Beside the charts.
const PAPER: [u8; 3] = [255; 3];

/// The checkerboard of a page in the colours of the stretch; the gutter takes what lies beyond the seam.
pub(super) fn checkerboard(atlas: &Atlas, texels: &PageTexels, bounds: [f64; 2]) -> image::RgbImage {
    let stretch: Vec<Vec<f64>> = atlas
        .charts()
        .iter()
        .map(|chart| {
            (0..chart.disk().faces().len())
                .map(|f| {
                    let [s1, s2] = chart.stretch(f as u32);
                    s1.max(1.0 / s2.abs())
                })
                .collect()
        })
        .collect();
    image::RgbImage::from_fn(texels.width as u32, texels.height as u32, |x, y| {
        let k = y as usize * texels.width + x as usize;
        let Some(point) = texels.points[k].filter(|_| texels.kinds[k] != TexelKind::Empty) else {
            return image::Rgb(PAPER);
        };
        // The squares are those of the page that the point itself lies on, so that gutters continue the neighbour.
        let (_, [u, v]) = atlas.uv_of(point);
        let square = |c: f64| (c / atlas.texel_m() / SQUARE as f64) as usize;
        let dark = (square(u) + square(v)) % 2 == 1;
        let (chart, face) = atlas.chart_of_face(point.face as usize);
        image::Rgb(shade(stretch[chart][face], bounds, dark))
    })
}

fn shade(stretch: f64, [bound, worst]: [f64; 2], dark: bool) -> [u8; 3] {
    let (from, to, t) = if stretch <= bound {
        (COLOURS[0], COLOURS[1], (stretch - 1.0) / (bound - 1.0))
    } else {
        (COLOURS[1], COLOURS[2], ((stretch - bound) / (worst - bound).max(1e-9)).min(1.0))
    };
    let light = if dark { DARKER } else { 1.0 };
    [0, 1, 2].map(|c| (light * (from[c] + t * (to[c] - from[c]))) as u8)
}

/// Pictures that a mesh carries on coordinates of its own.
pub(super) struct CarriedPictures {
    pub(super) pictures: Vec<image::RgbImage>,
    /// Picture of every face of the mesh.
    pub(super) faces: Vec<u32>,
}

/// The pictures that the mesh carries, on a page of the atlas.
pub(super) fn carried_over(
    atlas: &Atlas,
    texels: &PageTexels,
    uv: &MeshUv,
    carried: &CarriedPictures,
) -> image::RgbImage {
    let linear: Vec<f32> = (0..=255_u8).map(|c| linear_from_srgb(f32::from(c) / 255.0)).collect();
    let sample = |point: SurfacePoint| {
        let face = point.face as usize;
        let input = atlas.surface().face_source()[face] as usize;
        let corners = uv.faces[input];
        let mut at = [0.0; 2];
        for (k, weight) in point.barycentric.iter().enumerate() {
            let corner = uv.coordinates[corners[atlas.surface().source_corner(face, k)] as usize];
            at = [at[0] + weight * f64::from(corner[0]), at[1] + weight * f64::from(corner[1])];
        }
        bilinear(&carried.pictures[carried.faces[input] as usize], at, &linear)
    };
    let colours = texels.fill(None, |point| Some(sample(point)));
    image::RgbImage::from_fn(texels.width as u32, texels.height as u32, |x, y| {
        let colour = colours[y as usize * texels.width + x as usize];
        image::Rgb(colour.map_or(PAPER, |linear| linear.map(srgb_byte)))
    })
}

/// Linear colour of a picture that repeats; v = 1 is its top row.
fn bilinear(picture: &image::RgbImage, [u, v]: [f64; 2], linear: &[f32]) -> [f32; 3] {
    let (width, height) = (f64::from(picture.width()), f64::from(picture.height()));
    let (x, y) = (u.rem_euclid(1.0) * width - 0.5, (1.0 - v).rem_euclid(1.0) * height - 0.5);
    let (left, top) = (x.floor(), y.floor());
    let (tx, ty) = ((x - left) as f32, (y - top) as f32);
    let pixel = |dx: f64, dy: f64| {
        let (px, py) = ((left + dx).rem_euclid(width) as u32, (top + dy).rem_euclid(height) as u32);
        picture.get_pixel(px.min(picture.width() - 1), py.min(picture.height() - 1)).0.map(|c| linear[usize::from(c)])
    };
    let [a, b, c, d] = [pixel(0.0, 0.0), pixel(1.0, 0.0), pixel(0.0, 1.0), pixel(1.0, 1.0)];
    [0, 1, 2].map(|k| (1.0 - ty) * ((1.0 - tx) * a[k] + tx * b[k]) + ty * ((1.0 - tx) * c[k] + tx * d[k]))
}

#[cfg(test)]
mod tests {
    use super::{COLOURS, DARKER, shade};

    #[test]
    fn stretch_is_shown_between_three_colours() {
        let bytes = |colour: [f64; 3], light: f64| colour.map(|c| (light * c) as u8);
        let bounds = [1.1, 1.5];
        assert_eq!(shade(1.0, bounds, false), bytes(COLOURS[0], 1.0));
        assert_eq!(shade(1.1, bounds, true), bytes(COLOURS[1], DARKER));
        assert_eq!([1.5, 9.0].map(|stretch| shade(stretch, bounds, false)), [bytes(COLOURS[2], 1.0); 2]);
        let between = shade(1.3, bounds, false);
        let middle = [0, 1, 2].map(|c| 0.5 * (COLOURS[1][c] + COLOURS[2][c]));
        assert!((0..3).all(|c| (f64::from(between[c]) - middle[c]).abs() <= 1.0), "{between:?} {middle:?}");
    }
}
