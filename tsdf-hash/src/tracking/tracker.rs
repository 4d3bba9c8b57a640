//! The tracker: one frame against the map.

use nalgebra::{Isometry3, Matrix6};

use crate::blocks::voxel_block::MAX_WEIGHT;
use crate::dense_map::DenseMap;
use crate::error::Error;
use crate::images::{ColourView, DepthView, Intrinsics, check_pose};
use crate::ray_cast::settings::RayCastSettings;
use crate::ray_cast::view::View;
use crate::trace::{event, span};
use crate::tracking::directions::LEAST_SHARE;
use crate::tracking::image_level::{ImageLevel, reduced};
use crate::tracking::likeness::intensity_correlation;
use crate::tracking::model_points::{Model, model_points};
use crate::tracking::observability::{Observation, Observed};
use crate::tracking::outcome::{PosePrior, TrackingOutcome, TrackingStatus};
use crate::tracking::pose::{moved, step};
use crate::tracking::registration::Registration;
use crate::tracking::residuals::{Comparison, Evaluation};
use crate::tracking::settings::TrackingSettings;

/// Chi-squared of six degrees of freedom, 99 %.
const CHI_SQUARED: f64 = 16.81;
const LEVELS: usize = 3;
/// The information of all directions that the noise of the normals feigns, as a share of its variance and of the information of the best
/// known direction (ours, from runs with known poses).
const FEIGNED: f64 = 0.2;
/// What a tile of the map is off, beyond what its noise makes: voxels, and deviations of the noise model next to the camera (ours, from
/// runs with known poses).
const MAP_ERROR: [f64; 2] = [0.015, 0.15];
/// The finest level takes a point of the model for every so many pixels along each side.
const FINE_STRIDE: usize = 2;
/// Least coverage of a frame that is believed to be found.
const LEAST_COVERAGE: f64 = 0.5;
/// Least correlation of its intensities with those of the map, where both have colour (ours).
pub(crate) const LEAST_LIKENESS: f64 = 0.75;
/// The same of a place that features have recognised, and how much less of the frame must agree (ours).
const CONFIRMING_LIKENESS: f64 = 0.65;
const LESS_AGREEMENT: f64 = 0.05;
/// Searches from a pose that may be off by half a metre: largest distances of partners, one search after the other, as multiples of the
/// setting, and the least agreement after each of them: what is below leads nowhere (ours).
pub(crate) const FROM_AFAR: [(f64, f64); 10] = [
    (4.0, 0.0),
    (2.0, 0.3),
    (1.0, 0.4),
    (1.0, 0.5),
    (0.5, 0.6),
    (0.5, 0.6),
    (0.5, 0.6),
    (0.5, 0.6),
    (0.5, 0.6),
    (0.5, 0.6),
];
/// From one that is right to a few centimetres: without the distant partners.
pub(crate) const FROM_NEAR: &[(f64, f64)] = FROM_AFAR.split_at(2).1;
/// Partners are looked for within so many standard deviations of the prior (ours).
const SPREAD: f64 = 3.0;
/// A search that moves by less, radians and metres, is not repeated.
const SETTLED: f64 = 1e-4;
/// Directions with less than this share of the information of the best known one wait for a finer level (ours): what the
/// coarse ones know of them are the rims of things, which are a pixel off.
const LEAST_SHARES: [f64; LEVELS] = [LEAST_SHARE, 1e-3, 2e-3];

/// Tracks frames against a map.
///
/// ```
/// # use nalgebra::{Isometry3, Vector3};
/// # use tsdf_hash::tracking::{PosePrior, Tracker, TrackingSettings};
/// # use tsdf_hash::{DepthData, DepthView, Error, Intrinsics, Map, Settings};
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
    models: [Model; LEVELS],
    /// Settles from afar against what may have been seen from elsewhere: whoever does will try again, and needs no search for what outlines say.
    settles: bool,
    /// Everything that is tracked against may have been seen from elsewhere.
    revisits: bool,
}

impl Tracker {
    /// A tracker.
    ///
    /// # Errors
    /// [`Error::InvalidSetting`].
    pub fn new(settings: TrackingSettings) -> Result<Self, Error> {
        settings.check()?;
        Ok(Self { settings, levels: Default::default(), models: Default::default(), settles: false, revisits: false })
    }

    /// One that looks for a lost camera.
    pub(crate) fn of_revisits(settings: TrackingSettings) -> Result<Self, Error> {
        Ok(Self { revisits: true, ..Self::new(settings)? })
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

    /// Tracks from a pose that may be off by more than a frame's motion, by the given searches: with distant partners first, then again from where that led,
    /// because the first model was seen from elsewhere. `None` unless the result is sure: tracked, agreeing by
    /// [`TrackingSettings::relocalise_agreement`], of half of the frame at least, alike in colour, fixed in all directions.
    pub(crate) fn settle(
        &mut self,
        map: &mut dyn DenseMap,
        depth: &DepthView,
        colour: Option<&ColourView>,
        start: &Isometry3<f64>,
        reaches: &[(f64, f64)],
    ) -> Result<Option<TrackingOutcome>, Error> {
        Ok(self.converge(map, depth, colour, start, reaches)?.filter(|outcome| self.is_sure(outcome)))
    }

    /// Where that leads, sure or not.
    pub(crate) fn converge(
        &mut self,
        map: &mut dyn DenseMap,
        depth: &DepthView,
        colour: Option<&ColourView>,
        start: &Isometry3<f64>,
        reaches: &[(f64, f64)],
    ) -> Result<Option<TrackingOutcome>, Error> {
        let (near, least) = (self.settings.max_distance, self.settings.min_agreement);
        self.reload_view(map, depth, start)?;
        let mut pose = *start;
        let mut last = None;
        for &(reach, progress) in reaches {
            self.settings.max_distance = reach * near;
            // From afar little agrees at first.
            self.settings.min_agreement = if reach > 1.0 { 0.0 } else { least };
            let prior = PosePrior { world_from_camera: pose, covariance: None };
            self.settles = true;
            let outcome = self.track(map, depth, colour, &prior);
            self.settles = false;
            (self.settings.max_distance, self.settings.min_agreement) = (near, least);
            let outcome = outcome?;
            if !outcome.is_on_the_map() || outcome.agreement < progress {
                return Ok(None);
            }
            let moved = step(&pose, &outcome.world_from_camera).amax();
            pose = outcome.world_from_camera;
            last = Some(outcome);
            if reach < 1.0 && moved < SETTLED {
                break;
            }
        }
        Ok(last)
    }

    /// Whether an outcome is believed where nothing was known before.
    pub(crate) fn is_sure(&self, outcome: &TrackingOutcome) -> bool {
        is_found(outcome) && self.convinces(outcome)
    }

    /// Whether it is where features have said so before: of what is seen from another side less agrees, and light has changed.
    pub(crate) fn confirms(&self, outcome: &TrackingOutcome) -> bool {
        is_found(outcome)
            && outcome.agreement >= self.settings.relocalise_agreement - LESS_AGREEMENT
            && outcome.likeness.is_some_and(|likeness| likeness >= CONFIRMING_LIKENESS)
    }

    /// Whether map and frame agree, in depth and in intensity, as they do at the right pose.
    pub(crate) fn convinces(&self, outcome: &TrackingOutcome) -> bool {
        outcome.agreement >= self.settings.relocalise_agreement
            && outcome.likeness.is_none_or(|likeness| likeness >= LEAST_LIKENESS)
    }

    /// Whether an outcome says that the camera is elsewhere: enough of the map was in view, and it is another one.
    pub(crate) fn contradicts(&self, outcome: &TrackingOutcome) -> bool {
        let unlike = outcome.likeness.is_some_and(|likeness| likeness < LEAST_LIKENESS);
        outcome.overlap >= self.settings.min_overlap
            && outcome.coverage >= LEAST_COVERAGE
            && (outcome.agreement < self.settings.relocalise_agreement || unlike)
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
        let (camera, [width, height], cast) = self.camera(map, depth, colour);
        map.ray_cast(&camera, width, height, world_from_camera, &cast)
    }

    /// Brings what is evicted of the map and would be seen from a pose back into active memory: of a place that no frame has touched for
    /// long there is nothing to track against.
    ///
    /// # Errors
    /// As [`DenseMap::reload_view`].
    pub(crate) fn reload_view(
        &self,
        map: &mut dyn DenseMap,
        depth: &DepthView,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<usize, Error> {
        let (camera, [width, height], cast) = self.camera(map, depth, false);
        map.reload_view(&camera, width, height, world_from_camera, &cast)
    }

    /// How the map is looked at.
    fn camera(&self, map: &dyn DenseMap, depth: &DepthView, colour: bool) -> (Intrinsics, [usize; 2], RayCastSettings) {
        let factor = self.settings.reduction(depth.width);
        let &crate::Settings { min_depth, max_depth, .. } = map.settings();
        let cast = RayCastSettings { min_depth, max_depth, colour, threads: self.settings.threads };
        (reduced(&depth.intrinsics, factor), [depth.width, depth.height].map(|side| (side / factor).max(1)), cast)
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
        span!("track");
        depth.check()?;
        if let Some(colour) = colour {
            colour.check()?;
        }
        check_pose(&prior.world_from_camera)?;
        self.read(view, voxel_size, depth, colour);
        let settings = &self.settings;
        let mut search = Registration::new(prior.world_from_camera);
        let mut last = None;
        let spread = prior.covariance.map_or(0.0, |covariance| SPREAD * spread(&covariance, view));
        let widest = spread.clamp(settings.max_distance, settings.max_distance * FROM_AFAR[0].0);
        for level in (0..LEVELS).rev() {
            // Where little is known of the pose, partners are far apart at first.
            let reach = if level == 0 { settings.max_distance } else { widest };
            let comparison = self.comparison(view, voxel_size, level, reach);
            let most = settings.iterations[LEVELS - 1 - level];
            last = Some((search.refine(&comparison, most, LEAST_SHARES[level]), comparison));
        }
        let Some((last, comparison)) = last else { return Ok(lost(prior, TrackingStatus::NoOverlap)) };
        // The levels hold means of pixels: their noise is that much smaller.
        let reduction = settings.reduction(depth.width) as f64;
        let outcome = self.outcome(&mut search, last, &comparison, view, reduction, prior);
        if !outcome.is_tracked() {
            event!(debug, status = ?outcome.status, agreement = outcome.agreement, "not tracked from this prior");
        }
        Ok(outcome)
    }

    fn comparison<'a>(&'a self, view: &View, voxel_size: f64, level: usize, reach: f64) -> Comparison<'a> {
        Comparison {
            level: &self.levels[level],
            model: &self.models[level],
            origin: view.world_from_camera.translation.vector,
            noise: self.settings.noise,
            max_distance: reach as f32,
            tolerance: (0.5 * voxel_size) as f32,
            rim_width: self.rim_width(voxel_size),
            photometric: self.settings.photometric && !self.levels[level].intensity.is_empty(),
            threads: self.settings.threads,
        }
    }

    fn read(&mut self, view: &View, voxel_size: f64, depth: &DepthView, colour: Option<&ColourView>) {
        let (range, rim_width) = ([1e-3, 1e3], self.rim_width(voxel_size));
        let [fine, middle, coarse] = &mut self.levels;
        fine.read(depth, colour, self.settings.reduction(depth.width), range);
        fine.halve(middle);
        middle.halve(coarse);
        // The finest level takes every other point: neighbours say nearly the same.
        for (model, (stride, radius)) in self.models.iter_mut().zip([(FINE_STRIDE, 0), (2, 1), (4, 2)]) {
            model_points(view, rim_width, stride, radius, model);
        }
    }

    /// What was seen long ago was seen from elsewhere; from frame to frame, rims tell one step of stairs from the next.
    fn rim_width(&self, voxel_size: f64) -> f64 {
        if self.settles || self.revisits { voxel_size } else { 0.0 }
    }

    fn outcome(
        &self,
        search: &mut Registration,
        last: Evaluation,
        comparison: &Comparison,
        view: &View,
        reduction: f64,
        prior: &PosePrior,
    ) -> TrackingOutcome {
        let share = |part: u32, whole: u32| f64::from(part) / f64::from(whole.max(1));
        let points = self.models[0].points.len() as u32;
        let (overlap, agreement) = (share(last.compared(), points), share(last.agreeing, last.in_view));
        // The model has one point for so many pixels.
        let cell = (FINE_STRIDE * FINE_STRIDE) as f64;
        let measured = comparison.level.omega.iter().filter(|omega| **omega > 0.0).count();
        let coverage = (cell * f64::from(last.in_view) / measured.max(1) as f64).min(1.0);
        let scatter = scatter(view, comparison, reduction * f64::from(search.scales.depth));
        let partners = last.partners > 0;
        // The search looks at distances alone: where there is colour, intensities know better. Without steps a pose is to be judged, not moved.
        let fixed = self.settings.iterations == [0; 3];
        let searches = prior.covariance.is_none() && !comparison.photometric && !self.settles && !fixed;
        let found = Observation { comparison, view, scatter, searches }.observe(search, last).filter(|_| partners);
        let Some(Observed { last, directions, unknown }) = found else {
            return TrackingOutcome { overlap, coverage, agreement, ..lost(prior, TrackingStatus::NoOverlap) };
        };
        let (overlap, agreement) = (share(last.compared(), points), share(last.agreeing, last.in_view));
        // Along what the frame does not fix, back to the prior, if it is more than a guess.
        if prior.covariance.is_some() {
            let wandered = directions.part(&step(&search.pose, &prior.world_from_camera), |k| unknown[k]);
            search.pose = moved(&search.pose, &wandered);
        }
        let prior_covariance = prior.covariance.unwrap_or_else(Matrix6::identity);
        let onto = Matrix6::from_columns(&std::array::from_fn::<_, 6, _>(|c| {
            directions.part(&Matrix6::identity().column(c).into_owned(), |k| unknown[k])
        }));
        let shared = last.excess() + map_variance(comparison);
        let own = directions.honest_covariance(|k| !unknown[k], FEIGNED * scatter * directions.information.max());
        let left = directions.part(&search.remainder, |k| !unknown[k]);
        let covariance = own
            + own * last.equations.shared * own * shared
            + left * left.transpose()
            + onto * prior_covariance * onto.transpose();
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
        } else if unknown.contains(&true) && prior.covariance.is_none() {
            TrackingStatus::Degenerate
        } else {
            TrackingStatus::Tracked
        };
        let pose = if matches!(status, TrackingStatus::Tracked | TrackingStatus::Degenerate) {
            search.pose
        } else {
            prior.world_from_camera
        };
        TrackingOutcome {
            status,
            world_from_camera: pose,
            covariance,
            degenerate: (0..6).filter(|&k| unknown[k]).map(|k| directions.axes.column(k).into_owned()).collect(),
            overlap,
            coverage,
            agreement,
            depth_scale: f64::from(search.scales.depth),
            intensity_scale: if last.intensity.total > 0 { f64::from(search.scales.intensity) } else { 0.0 },
            likeness: intensity_correlation(comparison, &search.pose),
            iterations: search.iterations,
        }
    }
}

/// Standard deviation of where a prior puts the surface in view, metres: along the worst direction.
fn spread(covariance: &Matrix6<f64>, view: &View) -> f64 {
    let seen = view.depth.iter().filter(|z| **z > 0.0);
    let (sum, count) = seen.fold((0.0, 0.0_f64), |(sum, count), z| (sum + f64::from(*z), count + 1.0));
    let depth = sum / count.max(1.0);
    let largest = |first: usize| covariance.fixed_view::<3, 3>(first, first).symmetric_eigenvalues().max().max(0.0);
    (largest(3) + depth * depth * largest(0)).sqrt()
}

/// Variance of what a tile of the map is off, square metres.
fn map_variance(comparison: &Comparison) -> f64 {
    (MAP_ERROR[0] * comparison.voxel_size()).powi(2) + (MAP_ERROR[1] * comparison.noise.base).powi(2)
}

/// Variance of the model's normals by the noise that was fused, radians squared, `scale` times that of the noise model: the weight of a voxel says how much noise is left.
fn scatter(view: &View, comparison: &Comparison, scale: f64) -> f64 {
    let weights = view.weights.iter().filter(|w| **w > 0);
    let (sum, count) = weights.fold((0.0, 0.0), |(sum, count), w| (sum + 1.0 / f64::from(*w), count + 1.0_f64));
    let step = comparison.noise.base * scale / comparison.voxel_size();
    f64::from(MAX_WEIGHT) * step * step * sum / count.max(1.0)
}

fn lost(prior: &PosePrior, status: TrackingStatus) -> TrackingOutcome {
    TrackingOutcome {
        status,
        world_from_camera: prior.world_from_camera,
        covariance: prior.covariance.unwrap_or_else(Matrix6::identity),
        degenerate: Vec::new(),
        overlap: 0.0,
        coverage: 0.0,
        agreement: 0.0,
        depth_scale: 0.0,
        intensity_scale: 0.0,
        likeness: None,
        iterations: 0,
    }
}

/// Whether a frame is tracked, half of it, and fixed in all directions.
fn is_found(outcome: &TrackingOutcome) -> bool {
    outcome.is_tracked() && outcome.coverage >= LEAST_COVERAGE && outcome.degenerate.is_empty()
}
