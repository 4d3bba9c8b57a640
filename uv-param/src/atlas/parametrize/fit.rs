//! Whether some faces can be one chart: they are really laid out, and the layout is measured.

use nalgebra::{Matrix3, Vector3};

use crate::atlas::parametrize::simple_boundary::boundary_is_simple;
use crate::disk::Disk;
use crate::laplacian::Laplacian;
use crate::parametrizer::arap::{iterate_arap, iterate_bounded};
use crate::parametrizer::{Parametrizer, StoppingCriterion};
use crate::triangle::{Frame, flips};

/// Share of the faces, and of the area, that may be stretched beyond the bound, up to the worst.
pub(in crate::atlas) const SHARE_BEYOND: f64 = 0.01;
/// Local/global iterations after which a hopeless layout is given up.
const FIRST_ITERATIONS: usize = 4;
/// The rest of them.
const MORE_ITERATIONS: usize = 16;
/// Iterations that may save a layout that is nearly good enough, and the share of the bound's stretch that they bring faces to.
const BOUNDED_ITERATIONS: usize = 12;
const BOUNDED_SHARE: f64 = 0.95;
/// Share of faces beyond the bound above which neither will help.
const HOPELESS: f64 = 0.25;
/// The same after the local/global iterations.
const NEARLY: f64 = 0.15;
/// So many iterations that leave more than this share of the faces beyond the bound, and most of what there was, are the last.
const JUDGED_EVERY: usize = 2;
const SLOW_BEYOND: f64 = 0.02;
/// Most, in this sense.
const SLOW_GAIN: f64 = 0.8;
/// Power of the penalty on faces beyond the bound.
pub(in crate::atlas) const POWER: i32 = 5;
/// Relative gain below which iterations stop.
const TOLERANCE: f64 = 1e-3;

/// How far a chart may be from isometric.
#[derive(Debug, Clone, Copy)]
pub(in crate::atlas) struct Bounds {
    /// Largest `max(s1, 1 / s2)` of all but [`SHARE_BEYOND`] of the faces and of the area.
    pub(in crate::atlas) stretch: f64,
    /// Largest of any face.
    pub(in crate::atlas) worst: f64,
}

/// What a layout does to its faces.
pub(in crate::atlas) struct Distortion {
    /// Share of faces, or of the area if that is more, beyond the bound.
    pub(in crate::atlas) beyond: f64,
    /// Largest stretch; infinite where a face is flipped.
    pub(in crate::atlas) worst: f64,
}

impl Distortion {
    pub(in crate::atlas) fn measure(disk: &Disk, frames: &[Frame], uv: &[[f64; 2]], bounds: Bounds) -> Self {
        Self::of(frames, &stretches(disk, frames, uv), bounds)
    }

    /// From the largest stretch of every face.
    pub(in crate::atlas) fn of(frames: &[Frame], stretches: &[f64], bounds: Bounds) -> Self {
        let (mut count, mut beyond_area, mut area, mut worst) = (0, 0.0, 0.0, 1.0_f64);
        for (frame, &stretch) in frames.iter().zip(stretches) {
            worst = worst.max(stretch);
            area += frame.area;
            if stretch > bounds.stretch {
                count += 1;
                beyond_area += frame.area;
            }
        }
        Self { beyond: (f64::from(count) / frames.len() as f64).max(beyond_area / area), worst }
    }

    pub(in crate::atlas) fn within(&self, bounds: Bounds) -> bool {
        self.beyond <= SHARE_BEYOND && self.worst <= bounds.worst
    }
}

/// Largest stretch of every face; infinite for flipped ones.
pub(in crate::atlas) fn stretches(disk: &Disk, frames: &[Frame], uv: &[[f64; 2]]) -> Vec<f64> {
    let faces = disk.faces.iter().zip(frames);
    faces.map(|(face, frame)| frame.jacobian(face.map(|v| uv[v as usize])).largest_stretch()).collect()
}

/// A layout of `disk` within the bounds, without flips, whose boundary does not cross itself; `None` if none was found.
/// It begins at `start` (one point per vertex), which need not be good.
pub(in crate::atlas) fn fit(
    disk: &Disk,
    start: Vec<[f64; 2]>,
    bounds: Bounds,
    parametrizer: Option<&dyn Parametrizer>,
) -> Option<Vec<[f64; 2]>> {
    if disk.faces.len() == 1 {
        return Some(projection(disk));
    }
    let frames = disk.frames();
    let mut silent = |_| ();
    let good = |uv: &[[f64; 2]], distortion: &Distortion| {
        distortion.within(bounds) && flips(uv, &disk.faces) == 0 && boundary_is_simple(disk, uv)
    };
    if let Some(parametrizer) = parametrizer {
        let uv = parametrizer.parametrize(disk, &mut silent).ok()?.uv;
        return (uv.len() == disk.positions.len() && good(&uv, &Distortion::measure(disk, &frames, &uv, bounds)))
            .then_some(uv);
    }
    let mut uv = start;
    let mut laplacian = Laplacian::new(disk).ok()?;
    laplacian.factorize_cotangent(disk, &frames, disk.loops[0][0]).ok()?;
    let mut distortion = Distortion { beyond: 1.0, worst: f64::INFINITY };
    for (iterations, limit) in [(FIRST_ITERATIONS, HOPELESS), (MORE_ITERATIONS, NEARLY)] {
        let stopping = StoppingCriterion { iterations, tolerance: TOLERANCE };
        iterate_arap(disk, &frames, &mut laplacian, &mut uv, &stopping, &mut silent);
        distortion = Distortion::measure(disk, &frames, &uv, bounds);
        if distortion.beyond > limit {
            return None;
        }
    }
    if !distortion.within(bounds) {
        let (mut asked, mut last) = (0, distortion.beyond);
        let mut done = |stretches: &[f64]| {
            let found = Distortion::of(&frames, stretches, bounds);
            asked += 1;
            if asked % JUDGED_EVERY != 0 {
                return found.within(bounds);
            }
            let hopeless = found.beyond > SLOW_BEYOND && found.beyond > SLOW_GAIN * last;
            last = found.beyond;
            hopeless || found.within(bounds)
        };
        let stretch = 1.0 + BOUNDED_SHARE * (bounds.stretch - 1.0);
        iterate_bounded(disk, &frames, &mut laplacian, &mut uv, stretch, BOUNDED_ITERATIONS, &mut done);
        distortion = Distortion::measure(disk, &frames, &uv, bounds);
    }
    good(&uv, &distortion).then_some(uv)
}

/// The shadow of a piece of surface on the plane that its normals are nearest to: a start for pieces that are nearly flat.
pub(in crate::atlas) fn projection(disk: &Disk) -> Vec<[f64; 2]> {
    let normal: Vector3<f64> = (0..disk.faces.len()).map(|f| disk.face_cross(f)).sum();
    let normal = normal.try_normalize(f64::MIN_POSITIVE).unwrap_or_else(Vector3::z);
    let aside = Matrix3::identity().column(normal.iamin()).into_owned();
    let x = aside.cross(&normal).normalize();
    let y = normal.cross(&x);
    disk.positions.iter().map(|&p| Vector3::from(p)).map(|p| [p.dot(&x), p.dot(&y)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parametrizer::tutte::tutte_layout;
    use crate::surface::{FaceLookup, Surface};

    /// A square as seen from the centre of the unit sphere, up to 31 degrees aside.
    fn patch() -> Disk {
        let n = 16_u32;
        let (mut positions, mut faces) = (Vec::new(), Vec::new());
        for (j, i) in (0..=n).flat_map(|j| (0..=n).map(move |i| (j, i))) {
            let [x, y] = [i, j].map(|k| 0.6 * (2.0 * f64::from(k) / f64::from(n) - 1.0));
            positions.push((Vector3::new(x, y, 1.0).normalize()).into());
            if i < n && j < n {
                let v = j * (n + 1) + i;
                faces.extend([[v, v + 1, v + n + 2], [v, v + n + 2, v + n + 1]]);
            }
        }
        let (surface, _) = Surface::new(&positions, &faces, true).unwrap();
        let all: Vec<u32> = (0..faces.len() as u32).collect();
        surface.disk(&all, |_| false, &mut FaceLookup::new(&surface)).unwrap()
    }

    /// ARAP minimises the sum of squares: it leaves the corners of the patch beyond a bound that can be kept.
    #[test]
    fn what_arap_leaves_beyond_the_bound_is_brought_within() {
        let disk = patch();
        let frames = disk.frames();
        let (mut laplacian, start) = tutte_layout(&disk, &mut |_| ()).unwrap();
        let mut arap = start.clone();
        laplacian.factorize_cotangent(&disk, &frames, disk.loops[0][0]).unwrap();
        let stopping = StoppingCriterion { iterations: 200, tolerance: 0.0 };
        iterate_arap(&disk, &frames, &mut laplacian, &mut arap, &stopping, &mut |_| ());
        let bounds = Bounds { stretch: 1.056, worst: 1.5 };
        let by_arap = Distortion::measure(&disk, &frames, &arap, bounds);
        assert!(by_arap.beyond > 1.5 * SHARE_BEYOND, "{}", by_arap.beyond);
        let uv = fit(&disk, start.clone(), bounds, None).unwrap();
        assert!(Distortion::measure(&disk, &frames, &uv, bounds).within(bounds));
        // Its curvature allows no less: a layout of all of it within this is none.
        assert!(fit(&disk, start, Bounds { stretch: 1.01, worst: 1.5 }, None).is_none());
    }

    /// One face in a hundred may be stretched beyond the bound, none of them beyond the worst.
    #[test]
    fn few_faces_may_go_beyond_the_bound_and_none_beyond_the_worst() {
        let frames = patch().frames();
        let bounds = Bounds { stretch: 1.1, worst: 1.5 };
        let within = |count: usize, stretch: f64| {
            let mut stretches = vec![1.05; frames.len()];
            // From all over the patch, so that their share of the area is about that of the faces.
            stretches.iter_mut().step_by(97).take(count).for_each(|s| *s = stretch);
            Distortion::of(&frames, &stretches, bounds).within(bounds)
        };
        assert_eq!(frames.len(), 512);
        assert_eq!([within(0, 1.4), within(4, 1.4), within(6, 1.4)], [true, true, false]);
        assert_eq!([within(1, 1.5), within(1, 1.51), within(1, f64::INFINITY)], [true, false, false]);
    }
}
