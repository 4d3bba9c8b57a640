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
