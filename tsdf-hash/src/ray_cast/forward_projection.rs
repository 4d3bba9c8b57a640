//! A view seen from another pose, without the map: forward projection of its hits.

use nalgebra::{Isometry3, Point3, Vector3};

use crate::error::Error;
use crate::images::{Intrinsics, check_pose, check_sides};
use crate::ray_cast::pixel::Pixel;
use crate::ray_cast::splat::{Raster, Surfel, Target, focal};
use crate::ray_cast::view::View;

/// What of a hit is left of its score in pixels beside its own: only the order matters here.
const NEIGHBOUR_SHARE: f32 = 0.9;
/// Hits so many pixels' widths behind one another are of one surface.
const SAME_SURFACE: f64 = 4.0;
/// Hits that were seen steeply become no wider than this many pixels, so that rims do not smear.
const MOST_STRETCH: f64 = 2.0;
/// Nearer or farther is not drawn, metres.
const DEPTHS: [f64; 2] = [1e-3, 1e3];

impl View {
    /// The view as a camera at another pose would see it, from this view alone: what to show or track against in the
    /// frames between two ray casts ("onboard+", thesis Paper I, section 6.2; the forward projection `F` of its Eq.
    /// (5.6)).
    ///
    /// Every hit is a surfel of its tangent plane, as wide as its pixel was (`s = z / f`, up to twice that where it is now
    /// seen less steeply), and covers the pixels whose centres lie within `f' s / 2z'` of its projection, at least a half; the depth of each is that of the plane there, so
    /// the rounding to pixels leaves no error on planes. The nearest surface wins, on it the hit nearest to the centre of
    /// the pixel, then the first. Gaps of one pixel are closed. Normals, colours and weights are carried along; what
    /// faces away from the new camera is left out, and what this view did not see stays empty.
    ///
    /// # Errors
    /// [`Error::InvalidSize`], [`Error::InvalidIntrinsics`], [`Error::InvalidPose`], of this view too, and
    /// [`Error::WrongLength`] if its lists do not fit its size.
    pub fn warped(
        &self,
        intrinsics: &Intrinsics,
        (width, height): (usize, usize),
        world_from_camera: &Isometry3<f64>,
    ) -> Result<Self, Error> {
        check_sides("view", width, height)?;
        intrinsics.check("view")?;
        check_pose(world_from_camera)?;
        let target = Target::new(intrinsics, (width, height), world_from_camera, DEPTHS);
        let mut raster = Raster::default();
        splat_view(self, &target, |_| 1.0, &mut raster)?;
        let relative = (1.0 + SAME_SURFACE / focal(intrinsics)) as f32;
        raster.draw((width, height), NEIGHBOUR_SHARE, |nearest| nearest / relative);
        let mut view = Self::new();
        view.resize(intrinsics, (width, height), world_from_camera);
        for (at, shown) in raster.pixels().enumerate() {
            let pixel = shown.map_or(Pixel::NONE, |(shown, source)| self.pixel(source, 1.0 / shown.inverse));
            view.put(at, &pixel);
        }
        Ok(view)
    }
}

/// Every hit as a splat in another camera, its source the number of its pixel.
pub(crate) fn splat_view(
    view: &View,
    target: &Target,
    score: impl Fn(usize) -> f32,
    raster: &mut Raster,
) -> Result<(), Error> {
    let Some(k) = view.intrinsics else { return Ok(()) };
    k.check("view")?;
    check_pose(&view.world_from_camera)?;
    let expected = view.width.saturating_mul(view.height);
    for found in [view.depth.len(), view.normals.len(), view.colours.len(), view.weights.len()] {
        if found != expected {
            return Err(Error::WrongLength { image: "view", expected, found });
        }
    }
    let rotation = view.world_from_camera.rotation.to_rotation_matrix().into_inner();
    let camera = Point3::from(view.world_from_camera.translation.vector);
    let (pixel, width) = (1.0 / focal(&k), view.width.max(1));
    let rows = view.depth.chunks(width).zip(view.normals.chunks(width)).enumerate();
    for (v, (depths, normals)) in rows {
        for (u, (&depth, normal)) in depths.iter().zip(normals).enumerate().filter(|(_, (depth, _))| **depth > 0.0) {
            let z = f64::from(depth);
            let ray = rotation * Vector3::new((u as f64 - k.cx) / k.fx, (v as f64 - k.cy) / k.fy, 1.0);
            let normal = Vector3::from(normal.map(f64::from));
            // Along its slope a pixel covers more of the surface, and that shows when it is seen less steeply.
            let cosine = -normal.dot(&ray) / ray.norm();
            let surfel = Surfel { point: camera + ray * z, normal, size: z * pixel, cosine, stretch: MOST_STRETCH };
            let at = v * width + u;
            if let Some(splat) = target.splat(&surfel, score(at), at as u32) {
                raster.push(splat);
            }
        }
    }
    Ok(())
}
