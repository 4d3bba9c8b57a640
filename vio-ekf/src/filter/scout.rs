use nalgebra::{Matrix2, UnitQuaternion, Vector2, Vector3};

use super::detect::{Demands, Detector};
use super::history::History;
use super::interval::Interval;
use super::moving::{Motion, MovingSettings, Sighting, solve};
use super::patch::Patch;
use super::pyramid::Pyramid;
use crate::{Camera, Imu, ImuNoise, Stamp};

/// Points that are followed.
const POINTS: usize = 25;
/// Fewer than this are not worth a trial.
const ENOUGH: usize = 10;
/// Share of the window that must have passed before the first trial.
const EARLIEST: f64 = 0.45;
/// Places to either side, and their spacing in pixels, at which a point is looked for.
const SEARCH: (i32, f64) = (4, 2.0);
/// Iterations of the alignment.
const ITERATIONS: usize = 10;

/// Follows points by their looks alone, the turn between images taken from the gyroscope, until [`solve`] can tell the motion.
#[derive(Debug, Clone)]
pub(crate) struct Scout {
    settings: MovingSettings,
    history: Option<History>,
    /// From the first image of the window to each.
    intervals: Vec<Interval>,
    followed: Vec<Followed>,
    last: Option<Imu>,
}

#[derive(Debug, Clone)]
struct Followed {
    patch: Patch,
    pixel: Vector2<f64>,
    /// Motion between the last two images that the turn does not explain, pixels.
    flow: Vector2<f64>,
    /// How the turns since the window began have deformed the patch.
    warp: Matrix2<f64>,
    sightings: Vec<Sighting>,
}

impl Scout {
    pub(crate) fn new(settings: MovingSettings) -> Self {
        Self { settings, history: None, intervals: Vec::new(), followed: Vec::new(), last: None }
    }

    /// The samples of the window.
    pub(crate) fn history(&self) -> Option<&History> {
        self.history.as_ref()
    }

    pub(crate) fn imu(&mut self, sample: &Imu) {
        self.last = Some(*sample);
        if let Some(history) = &mut self.history {
            if history.is_full() {
                self.history = None;
            } else {
                history.push(*sample);
            }
        }
    }

    /// Takes an image; its time and the motion there once both are known.
    pub(crate) fn image(
        &mut self,
        stamp: Stamp,
        pyramid: &Pyramid,
        (detector, demands): (&mut Detector, &Demands),
        camera: &Camera,
        (gravity, samples): (f64, usize),
    ) -> Option<Motion> {
        let Some(history) = self.history.as_ref().filter(|history| stamp > history.anchor()) else {
            self.begin(stamp, pyramid, detector, demands, camera, samples);
            return None;
        };
        let interval = history.integrate(stamp, &[Vector3::zeros(); 2], &ImuNoise::ZERO);
        let before = self.intervals.last()?.rotation;
        let attitude = camera.body_from_camera.rotation;
        let turn = attitude.inverse() * interval.rotation.inverse() * before * attitude;
        self.intervals.push(interval);
        let image = self.intervals.len() - 1;
        self.followed.retain_mut(|followed| followed.follow(image, &turn, pyramid, camera).is_some());

        let elapsed = self.intervals[image].duration;
        if self.followed.len() < ENOUGH {
            self.begin(stamp, pyramid, detector, demands, camera, samples);
            return None;
        }
        if elapsed < EARLIEST * self.settings.window_s {
            return None;
        }
        let points: Vec<Vec<Sighting>> = self.followed.iter().map(|f| f.sightings.clone()).collect();
        let place = (camera.body_from_camera.translation.vector, attitude);
        let motion = solve(&self.intervals, &points, &place, camera.fx.min(camera.fy), gravity, &self.settings);
        if motion.is_none() && elapsed > self.settings.window_s {
            self.begin(stamp, pyramid, detector, demands, camera, samples);
        }
        motion
    }

    /// Begins a new window.
    fn begin(
        &mut self,
        stamp: Stamp,
        pyramid: &Pyramid,
        detector: &mut Detector,
        demands: &Demands,
        camera: &Camera,
        samples: usize,
    ) {
        self.followed.clear();
        self.intervals.clear();
        self.intervals.push(Interval::default());
        // The sample before the image, as far as it is known.
        let sample = self.history.take().map(|history| history.before(stamp)).or(self.last);
        self.history = sample.map(|sample| History::new(sample, stamp, samples));
        if let (Some(history), Some(last)) = (&mut self.history, self.last)
            && last.stamp > history.latest().stamp
        {
            history.push(last);
        }
        detector.detect(pyramid, &std::iter::empty(), demands);
        while self.followed.len() < POINTS {
            let Some((pixel, patch)) = detector.pick(pyramid, demands) else { break };
            let Some(direction) = camera.bearing(&pixel) else { continue };
            let sightings = vec![(0, direction.into_inner())];
            self.followed.push(Followed { patch, pixel, flow: Vector2::zeros(), warp: Matrix2::identity(), sightings });
        }
    }
}

impl Followed {
    /// Finds the point in the next image, or gives it up.
    fn follow(&mut self, image: usize, turn: &UnitQuaternion<f64>, pyramid: &Pyramid, camera: &Camera) -> Option<()> {
        let turned = camera.project(&(turn * self.sightings.last()?.1))?;
        let middle = turned + self.flow;
        let moved = |x: f64, y: f64| {
            let bearing = camera.bearing(&(self.pixel + Vector2::new(x, y)))?;
            camera.project(&(turn * bearing.into_inner()))
        };
        self.warp = Matrix2::from_columns(&[moved(1.0, 0.0)? - turned, moved(0.0, 1.0)? - turned]) * self.warp;
        let warp = self.warp;
        let (reach, spacing) = SEARCH;
        let places =
            (-reach..=reach).flat_map(|y| (-reach..=reach).map(move |x| Vector2::new(f64::from(x), f64::from(y))));
        let tried = places.filter_map(|offset| {
            let pixel = middle + offset * spacing;
            Some((self.patch.compare_coarse(pyramid, &pixel, &warp)?.mismatch, pixel))
        });
        let (_, mut pixel) = tried.reduce(|best, other| if other.0 < best.0 { other } else { best })?;
        for _ in 0..ITERATIONS {
            let comparison = self.patch.compare(pyramid, &pixel, &warp)?;
            let step = warp * comparison.information.try_inverse()? * comparison.moment;
            pixel += step;
            if step.norm() < 0.01 {
                if comparison.unexplained > 0.3 * comparison.energy || (pixel - middle).amax() > 12.0 {
                    return None;
                }
                self.flow = pixel - turned;
                self.pixel = pixel;
                self.sightings.push((image, camera.bearing(&pixel)?.into_inner()));
                return Some(());
            }
        }
        None
    }
}
