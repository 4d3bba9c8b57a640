//! The tracker: one frame against the map.

use nalgebra::{Isometry3, Matrix6};

use crate::blocks::voxel_block::MAX_WEIGHT;
use crate::dense_map::DenseMap;
use crate::error::Error;
use crate::images::{ColourView, DepthView, check_pose};
use crate::ray_cast::settings::RayCastSettings;
use crate::ray_cast::view::View;
use crate::tracking::directions::{Directions, LEAST_SHARE};
use crate::tracking::image_level::{ImageLevel, reduced};
use crate::tracking::keyframes::KeyframeIndex;
use crate::tracking::model_points::{ModelPoint, model_points};
use crate::tracking::outcome::{PosePrior, TrackingOutcome, TrackingStatus};
use crate::tracking::pose::{moved, step};
use crate::tracking::registration::Registration;
use crate::tracking::residuals::{Comparison, Evaluation};
use crate::tracking::settings::TrackingSettings;

/// Chi-squared of six degrees of freedom, 99 %.
const CHI_SQUARED: f64 = 16.81;
const LEVELS: usize = 3;
/// Keyframes that a lost camera is tracked from (ours).
const CANDIDATES: usize = 5;
/// Directions with less than this share of the information of the best known one wait for a finer level (ours): what the
/// coarse ones know of them are the rims of things, which are a pixel off.
const LEAST_SHARES: [f64; LEVELS] = [LEAST_SHARE, 1e-3, 2e-3];

/// Tracks frames against a map.
///
/// ```
/// # use nalgebra::{Isometry3, Vector3};
/// # use tsdf_hash::{DepthData, DepthView, Error, Intrinsics, Map, PosePrior, Settings, Tracker, TrackingSettings};
/// # fn follow(map: &mut Map, depth: &DepthView, guess: Isometry3<f64>) -> Result<(), Error> {
/// let mut tracker = Tracker::new(TrackingSettings::default())?;
/// let prior = PosePrior { world_from_camera: guess, covariance: None };
/// let outcome = tracker.track(map, depth, None, &prior)?;
/// if outcome.is_tracked() {
///     map.integrate(depth, None, &outcome.world_from_camera)?;
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Tracker {
    settings: TrackingSettings,
    /// Fine to coarse.
    levels: [ImageLevel; LEVELS],
    points: [Vec<ModelPoint>; LEVELS],
}

impl Tracker {
    /// A tracker.
    ///
    /// # Errors
    /// [`Error::InvalidSetting`].
    pub fn new(settings: TrackingSettings) -> Result<Self, Error> {
        settings.check()?;
        Ok(Self { settings, levels: Default::default(), points: Default::default() })
    }

    /// The settings given to [`new`](Self::new).
    pub fn settings(&self) -> &TrackingSettings {
        &self.settings
    }

    /// Where the camera was when it took a frame, from the map as it is seen from the prior.
    ///
    /// # Errors
    /// Views, intrinsics or pose that make no sense. That the camera is lost is no error: see [`TrackingStatus`].
    pub fn track(
        &mut self,
        map: &mut dyn DenseMap,
        depth: &DepthView,
        colour: Option<&ColourView>,
        prior: &PosePrior,
    ) -> Result<TrackingOutcome, Error> {
        let view = self.model(map, depth, colour.is_some(), &prior.world_from_camera)?;
        self.track_view(&view, map.settings().voxel_size, depth, colour, prior)
    }

    /// Finds a lost camera: the frame is tracked from the poses of the keyframes that look most like it, and the pose that agrees best with
    /// the map is taken, if it agrees by [`TrackingSettings::relocalise_agreement`] and is fixed in all directions.
    ///
    /// # Errors
    /// As [`track`](Self::track).
    pub fn relocalise(
        &mut self,
        map: &mut dyn DenseMap,
        depth: &DepthView,
        colour: Option<&ColourView>,
        keyframes: &mut KeyframeIndex,
    ) -> Result<Option<TrackingOutcome>, Error> {
        let mut best: Option<TrackingOutcome> = None;
        for pose in keyframes.candidates(depth, colour, CANDIDATES)? {
            let mut outcome =
                self.track(map, depth, colour, &PosePrior { world_from_camera: pose, covariance: None })?;
            if outcome.is_tracked() {
                // Once more from there: the first model was seen from the keyframe.
                let prior = PosePrior { world_from_camera: outcome.world_from_camera, covariance: None };
                outcome = self.track(map, depth, colour, &prior)?;
            }
            let sure = outcome.is_tracked()
                && outcome.agreement >= self.settings.relocalise_agreement
                && outcome.degenerate.is_empty();
            if sure && best.as_ref().is_none_or(|best| outcome.agreement > best.agreement) {
                best = Some(outcome);
            }
        }
        Ok(best)
    }

    /// The map as the tracker wants it, seen from a pose.
    ///
    /// # Errors
    /// As [`DenseMap::ray_cast`].
    pub fn model(
        &self,
        map: &mut dyn DenseMap,
        depth: &DepthView,
        colour: bool,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<View, Error> {
        let factor = self.settings.reduction(depth.width);
        let &crate::Settings { min_depth, max_depth, .. } = map.settings();
        let cast = RayCastSettings { min_depth, max_depth, colour, threads: self.settings.threads };
        let camera = reduced(&depth.intrinsics, factor);
        map.ray_cast(&camera, (depth.width / factor).max(1), (depth.height / factor).max(1), world_from_camera, &cast)
    }

    /// [`track`](Self::track) against a view of the map from near the prior, of voxels of `voxel_size` metres: that of
    /// [`model`](Self::model), or one that was warped.
    ///
    /// # Errors
    /// Views, intrinsics or pose that make no sense.
    pub fn track_view(
        &mut self,
        view: &View,
        voxel_size: f64,
        depth: &DepthView,
        colour: Option<&ColourView>,
        prior: &PosePrior,
    ) -> Result<TrackingOutcome, Error> {
        depth.check()?;
        if let Some(colour) = colour {
            colour.check()?;
        }
        check_pose(&prior.world_from_camera)?;
        self.read(view, depth, colour);
        let settings = &self.settings;
        let mut search = Registration::new(prior.world_from_camera);
        let mut last = None;
        for level in (0..LEVELS).rev() {
            let comparison = self.comparison(view, voxel_size, level);
            let most = settings.iterations[LEVELS - 1 - level];
            last = Some((search.refine(&comparison, most, LEAST_SHARES[level]), comparison));
        }
        let Some((last, comparison)) = last else { return Ok(lost(prior, TrackingStatus::NoOverlap)) };
        // The levels hold means of pixels: their noise is that much smaller.
        let reduction = settings.reduction(depth.width) as f64;
        Ok(self.outcome(&mut search, &last, &comparison, view, reduction, prior))
    }

    fn comparison<'a>(&'a self, view: &View, voxel_size: f64, level: usize) -> Comparison<'a> {
        Comparison {
            level: &self.levels[level],
            points: &self.points[level],
            origin: view.world_from_camera.translation.vector,
            noise: self.settings.noise,
            max_distance: self.settings.max_distance as f32,
            tolerance: (0.5 * voxel_size) as f32,
            photometric: self.settings.photometric && !self.levels[level].intensity.is_empty(),
            threads: self.settings.threads,
        }
    }

    fn read(&mut self, view: &View, depth: &DepthView, colour: Option<&ColourView>) {
        let range = [1e-3, 1e3];
        let [fine, middle, coarse] = &mut self.levels;
        fine.read(depth, colour, self.settings.reduction(depth.width), range);
        fine.halve(middle);
        middle.halve(coarse);
        // The finest level takes every other point: neighbours say nearly the same.
        for (points, (stride, radius)) in self.points.iter_mut().zip([(2, 0), (2, 1), (4, 2)]) {
            model_points(view, stride, radius, points);
        }
    }

    fn outcome(
        &self,
        search: &mut Registration,
        last: &Evaluation,
        comparison: &Comparison,
        view: &View,
        reduction: f64,
        prior: &PosePrior,
    ) -> TrackingOutcome {
        let share = |part: u32, whole: u32| f64::from(part) / f64::from(whole.max(1));
        let points = self.points[0].len() as u32;
        let (overlap, agreement) = (share(last.in_view, points), share(last.agreeing, last.in_view));
        let found = Directions::new(&last.equations.h, last.mean_depth());
        let (Some(directions), true) = (found, last.partners > 0) else {
            return TrackingOutcome { overlap, agreement, ..lost(prior, TrackingStatus::NoOverlap) };
        };
        let scatter = scatter(view, comparison, reduction * f64::from(search.scales.depth));
        let mut all = Vec::new();
        let (scales, brightness) = (search.scales, search.brightness);
        let mut dense = |pose: &Isometry3<f64>| {
            if all.is_empty() {
                model_points(view, 1, 0, &mut all);
            }
            Comparison { points: &all, ..*comparison }.evaluate(pose, scales, brightness)
        };
        let unknown = directions.degenerate(&mut dense, &search.pose, scatter);
        // Along what the frame does not fix, back to the prior, if it is more than a guess.
        if prior.covariance.is_some() {
            let wandered = directions.part(&step(&search.pose, &prior.world_from_camera), |k| unknown[k]);
            search.pose = moved(&search.pose, &wandered);
        }
        let prior_covariance = prior.covariance.unwrap_or_else(Matrix6::identity);
        let onto = Matrix6::from_columns(&std::array::from_fn::<_, 6, _>(|c| {
            directions.part(&Matrix6::identity().column(c).into_owned(), |k| unknown[k])
        }));
        let covariance = directions.inverse(|k| !unknown[k], 0.0) + onto * prior_covariance * onto.transpose();
        let off = step(&prior.world_from_camera, &search.pose);
        let far = prior
            .covariance
            .is_some_and(|prior| (covariance + prior).cholesky().is_none_or(|c| off.dot(&c.solve(&off)) > CHI_SQUARED));
        let status = if overlap < self.settings.min_overlap {
            TrackingStatus::NoOverlap
        } else if agreement < self.settings.min_agreement {
            TrackingStatus::Disagreement
        } else if far {
            TrackingStatus::Rejected
        } else {
            TrackingStatus::Tracked
        };
        let pose = if status == TrackingStatus::Tracked { search.pose } else { prior.world_from_camera };
        TrackingOutcome {
            status,
            world_from_camera: pose,
            covariance,
            degenerate: (0..6).filter(|&k| unknown[k]).map(|k| directions.axes.column(k).into_owned()).collect(),
            overlap,
            agreement,
            depth_scale: f64::from(search.scales.depth),
            intensity_scale: if last.intensity.total > 0 { f64::from(search.scales.intensity) } else { 0.0 },
            iterations: search.iterations,
        }
    }
}

/// Variance of the model's normals by the noise that was fused, radians squared, `scale` times that of the noise model: the weight of a voxel says how much noise is left.
fn scatter(view: &View, comparison: &Comparison, scale: f64) -> f64 {
    let weights = view.weights.iter().filter(|w| **w > 0);
    let (sum, count) = weights.fold((0.0, 0.0), |(sum, count), w| (sum + 1.0 / f64::from(*w), count + 1.0_f64));
    let step = comparison.noise.base * scale / (2.0 * f64::from(comparison.tolerance));
    f64::from(MAX_WEIGHT) * step * step * sum / count.max(1.0)
}

fn lost(prior: &PosePrior, status: TrackingStatus) -> TrackingOutcome {
    TrackingOutcome {
        status,
        world_from_camera: prior.world_from_camera,
        covariance: prior.covariance.unwrap_or_else(Matrix6::identity),
        degenerate: Vec::new(),
        overlap: 0.0,
        agreement: 0.0,
        depth_scale: 0.0,
        intensity_scale: 0.0,
        iterations: 0,
    }
}
