//! Where a design lies on a surface: metres from the upper left corner of a plane, for every texel.

use nalgebra::{Point3, UnitVector3};

use crate::projection::{Projection, Viewpoint};
use crate::surface::PaintSurface;

/// Metres from the upper left corner of a plane for every texel that has a place on it, and the plane's width and height. A surface in one piece is its own
/// plane; one with seams, where its charts would tear, is seen through from the front; with a viewpoint it is what is seen from there.
pub(crate) fn design_places(surface: &PaintSurface, viewpoint: Option<Viewpoint>) -> (Vec<Option<[f64; 2]>>, [f64; 2]) {
    match viewpoint {
        None if surface.disk().seam_length() > 0.0 => places_in_space(surface),
        None => chart_places(surface),
        Some(viewpoint) => projected_places(surface, viewpoint),
    }
}

/// Where every vertex of a surface lies on the plane of a design without a viewpoint: metres to the right of and above its middle, and the width and
/// height of the plane.
#[cfg(feature = "vr")]
pub(crate) fn vertex_places(surface: &PaintSurface) -> (Vec<[f64; 2]>, [f64; 2]) {
    let (places, extent) = design_places(surface, None);
    let middle = extent.map(|side| 0.5 * side);
    if surface.disk().seam_length() <= 0.0 {
        return (surface.chart.uv().iter().map(|[u, v]| [u - middle[0], v - middle[1]]).collect(), extent);
    }
    let projection = Projection::new(Viewpoint::Front, surface);
    let project = |point: &Point3<f64>| projection.project(point).unwrap_or([0.0; 2]);
    // The plane begins where its leftmost and its highest texel lie.
    let known = places.iter().enumerate().find_map(|(k, place)| {
        let on_surface = surface.texels.at(k % surface.width(), k / surface.width())?;
        Some((project(&surface.chart.point(on_surface)), (*place)?))
    });
    let [left, top] = known.map_or([0.0; 2], |([right, up], [x, y])| [right - x, up + y]);
    let place = |p: &[f64; 3]| {
        let [right, up] = project(&Point3::from(*p));
        [right - left - middle[0], up - top + middle[1]]
    };
    (surface.disk().positions().iter().map(place).collect(), extent)
}

/// Metres from the upper left corner of the chart of every texel's middle, and the chart's width and height.
fn chart_places(surface: &PaintSurface) -> (Vec<Option<[f64; 2]>>, [f64; 2]) {
    let (width, texel) = (surface.width(), surface.texels.texel_m);
    let place = |k: usize| Some([k % width, k / width].map(|c| (c as f64 + 0.5) * texel));
    let extent = [width, surface.height()].map(|side| side as f64 * texel);
    ((0..width * surface.height()).map(place).collect(), extent)
}

/// The same of what is seen from a viewpoint, for every texel that is seen.
fn projected_places(surface: &PaintSurface, viewpoint: Viewpoint) -> (Vec<Option<[f64; 2]>>, [f64; 2]) {
    let projection = Projection::new(viewpoint, surface);
    places_in_plane(surface, |point, normal| {
        let at = projection.project(point)?;
        projection.sees(surface, point, normal).then_some(at)
    })
}

/// The same of what a viewer in front would see if everything were transparent: a place for every texel, the same on both sides of a seam.
fn places_in_space(surface: &PaintSurface) -> (Vec<Option<[f64; 2]>>, [f64; 2]) {
    let projection = Projection::new(Viewpoint::Front, surface);
    places_in_plane(surface, |point, _| projection.project(point))
}

/// Where every texel lies on a plane, from right and up on it; from the upper left corner of all of them, and their width and height.
fn places_in_plane(
    surface: &PaintSurface,
    place: impl Fn(&Point3<f64>, &UnitVector3<f64>) -> Option<[f64; 2]>,
) -> (Vec<Option<[f64; 2]>>, [f64; 2]) {
    let width = surface.width();
    let of_texel = |k: usize| {
        let on_surface = surface.texels.at(k % width, k / width)?;
        place(&surface.chart.point(on_surface), &surface.chart.face_normal(on_surface.face))
    };
    let mut places: Vec<Option<[f64; 2]>> = (0..width * surface.height()).map(of_texel).collect();
    let (mut low, mut high) = ([f64::MAX; 2], [f64::MIN; 2]);
    for at in places.iter().flatten() {
        for c in 0..2 {
            (low[c], high[c]) = (low[c].min(at[c]), high[c].max(at[c]));
        }
    }
    for at in places.iter_mut().flatten() {
        *at = [at[0] - low[0], high[1] - at[1]];
    }
    (places, [0, 1].map(|c| (high[c] - low[c]).max(f64::MIN_POSITIVE)))
}

#[cfg(all(test, feature = "vr"))]
mod tests {
    use super::*;
    use crate::mesh_io::TriangleMesh;

    /// On the face of every texel the places of its corners come to the place of the texel: on a wall in one piece, and on a box with seams.
    #[test]
    fn vertices_lie_where_texels_do() {
        let corner = |k: u32| {
            [
                f32::from(u8::from(k & 1 != 0)),
                f32::from(u8::from(k & 2 != 0)) * 0.8,
                1.0 + f32::from(u8::from(k & 4 != 0)) * 0.6,
            ]
        };
        let quad = |[a, b, c, d]: [u32; 4]| [[a, b, c], [a, c, d]];
        let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [1, 3, 7, 5], [3, 2, 6, 7], [2, 0, 4, 6]];
        let positions: Vec<[f32; 3]> = (0..8).map(corner).collect();
        for sides in [&sides[..], &sides[5..]] {
            let faces = sides.iter().flat_map(|side| quad(*side)).collect();
            let mesh = TriangleMesh { positions: positions.clone(), faces, ..TriangleMesh::default() };
            let surface = PaintSurface::new(&mesh, 0.05, &|_| ()).unwrap();
            let (places, extent) = design_places(&surface, None);
            let (of_vertices, same) = vertex_places(&surface);
            assert_eq!(extent, same);
            assert_eq!(surface.disk().seam_length() > 0.0, sides.len() > 1);
            let mut seen = 0;
            for (k, place) in places.iter().enumerate() {
                let at = surface.texels.at(k % surface.width(), k / surface.width());
                let (Some(at), Some([x, y])) = (at, place) else { continue };
                // A texel at the rim shows the surface beside its middle.
                if surface.chart.locate(surface.texels.uv_of_texel(k % surface.width(), k / surface.width())).is_none()
                {
                    continue;
                }
                let corners = surface.disk().faces()[at.face as usize];
                let of = |c: usize| -> f64 {
                    corners.iter().zip(at.barycentric).map(|(&v, share)| share * of_vertices[v as usize][c]).sum()
                };
                let (right, up) = (x - 0.5 * extent[0], 0.5 * extent[1] - y);
                assert!(
                    (of(0) - right).abs() < 1e-6 && (of(1) - up).abs() < 1e-6,
                    "{k}: {} {right}, {} {up}",
                    of(0),
                    of(1)
                );
                seen += 1;
            }
            assert!(seen > 100, "{seen}");
        }
    }
}
