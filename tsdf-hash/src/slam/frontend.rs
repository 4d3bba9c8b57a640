//! Poses from the tracker: each frame against the map, from where the poses before lead; a lost camera is found by keyframes.

use nalgebra::Isometry3;

use crate::dense_map::DenseMap;
use crate::error::Error;
use crate::images::{ColourView, DepthView};
use crate::keyframes::index::KeyframeIndex;
use crate::settings::Settings;
use crate::slam::frontend_state::{FrontendState, Last};
use crate::slam::gyroscope::Gyroscope;
use crate::slam::key_view::KeyView;
use crate::slam::local_map::LocalMap;
use crate::slam::motion_model::{MotionModel, StampedPose};
use crate::slam::outcome::Event;
use crate::slam::settings::{PoseSource, SlamSettings};
use crate::slam::wrong_minimum::{UsualAgreement, is_contradicted, rank};
use crate::tracking::outcome::{PosePrior, TrackingOutcome, TrackingStatus};
use crate::tracking::pose::within;
use crate::tracking::relocaliser::Relocaliser;
use crate::tracking::settings::TrackingSettings;
use crate::tracking::tracker::Tracker;

/// Least share of a frame that a map must account for where it does not grow (ours).
const LEAST_COVERAGE: f64 = 0.4;
/// Least agreement of a frame with a map that stays as it is (ours): of real recordings, frames that were placed within seven
/// centimetres agreed by 83 % or more, those that were off by more by 77 % or less.
const FIXED_MAP_AGREEMENT: f64 = 0.8;
/// Keyframes that a doubtful frame is compared with, by features and by looks.
const HYPOTHESES: usize = 3;
/// They were taken within so much of the last pose: radians, metres (ours).
const NEAR: [f64; 2] = [1.0, 1.0];
/// A camera that moves by more from frame to frame may have turned back: radians, metres (ours).
const FAST: [f64; 2] = [0.05, 0.03];

/// Where a frame was taken.
#[derive(Debug, Default)]
pub struct Located {
    /// The pose; `None` of a lost camera.
    pub world_from_camera: Option<Isometry3<f64>>,
    /// Where the lost frames before it were taken, the latest last: as many as are sure now.
    pub earlier: Vec<Isometry3<f64>>,
    /// What the tracker says; `None` of the first frame, and where the search for a lost camera has found nothing.
    pub tracking: Option<TrackingOutcome>,
    /// Lost, found, relocalised, degenerate.
    pub events: Vec<Event>,
}

/// Tracks a camera, and finds it again when it is lost.
pub struct Frontend {
    tracker: Tracker,
    relocaliser: Relocaliser,
    /// Tracked against instead of the whole map, where loops are looked for.
    local_map: Option<LocalMap>,
    key_view: KeyView,
    motion: MotionModel,
    last: Last,
    usual: UsualAgreement,
    /// Where the camera is at first is looked for, too.
    relocalise_first: bool,
    /// Nothing is fused.
    fixed_map: bool,
    /// No frame has been tracked since a stored pose: what the camera sees may be evicted.
    resumed: bool,
}

impl Frontend {
    /// For a map of these settings, which take the place of [`SlamSettings::map`].
    ///
    /// # Errors
    /// [`Error::InvalidSetting`].
    pub fn new(settings: &SlamSettings, map: &Settings) -> Result<Self, Error> {
        let tracking = TrackingSettings { noise: map.noise, threads: map.threads, ..settings.tracking };
        // What is not fused does not grow the map: a camera that leaves it agrees less and less, and is led astray by what is left.
        let fixed_map = !settings.fuse;
        let min_agreement = if fixed_map { FIXED_MAP_AGREEMENT } else { tracking.min_agreement };
        let odometry = match settings.poses {
            PoseSource::Odometry(error) => Some(error),
            PoseSource::Given | PoseSource::Tracked => None,
        };
        Ok(Self {
            tracker: Tracker::new(TrackingSettings { min_agreement, ..tracking })?,
            relocaliser: Relocaliser::new(tracking)?,
            local_map: settings.closes_loops().then(|| LocalMap::new(map)),
            key_view: KeyView::new(settings.model_every),
            motion: MotionModel::new(odometry, settings.frame_interval),
            last: Last::Tracked,
            usual: UsualAgreement::default(),
            relocalise_first: settings.relocalise_first,
            fixed_map,
            resumed: false,
        })
    }

    /// Goes on from a pose.
    pub fn start(&mut self, pose: Isometry3<f64>) {
        self.motion.start(pose, None);
        self.resumed = true;
    }

    /// Goes on as a run that was interrupted; one that had lost the camera forgets the frames since.
    pub fn restore(&mut self, state: &FrontendState) {
        let motion = &mut self.motion;
        (motion.last, motion.then, motion.before) = (state.pose, state.frame, state.before);
        motion.gyroscope.restore(state.bias, state.learned);
        (self.last, self.usual) = (state.last, UsualAgreement { usual: state.usual });
        self.resumed = true;
    }

    /// What [`restore`](Self::restore) takes.
    pub fn state(&self) -> FrontendState {
        let motion = &self.motion;
        let (bias, learned) = motion.gyroscope.learned();
        FrontendState {
            last: self.last,
            pose: motion.last,
            frame: motion.then,
            before: motion.before,
            usual: self.usual.usual,
            bias,
            learned,
        }
    }

    /// What looks for a lost camera.
    pub fn relocaliser(&mut self) -> &mut Relocaliser {
        &mut self.relocaliser
    }

    /// The gyroscope, to be given samples; between frames the camera is taken to turn as it says.
    pub fn gyroscope(&mut self) -> &mut Gyroscope {
        &mut self.motion.gyroscope
    }

    /// A frame was fused, when the run had so many keyframes.
    ///
    /// # Errors
    /// As [`Map::integrate`](crate::Map::integrate).
    pub fn fused(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        pose: &Isometry3<f64>,
        keyframes: usize,
    ) -> Result<(), Error> {
        self.local_map.as_mut().map_or(Ok(()), |local| local.fuse(depth, colour, pose, keyframes))
    }

    /// The map and all in it have moved.
    pub fn move_by(&mut self, correction: &Isometry3<f64>) {
        if let Some(local) = &mut self.local_map {
            local.move_by(correction);
        }
        self.key_view.forget();
        self.motion.move_by(correction);
    }

    /// How many frames before the present one [`Located::earlier`] can be about.
    pub(crate) fn remembered(&self) -> usize {
        self.relocaliser.frames()
    }

    /// How many places of the map a lost camera may be at.
    pub fn places(&self) -> usize {
        self.relocaliser.places()
    }

    /// The pose of a frame.
    ///
    /// # Errors
    /// Views that make no sense, and those of [`DenseMap::ray_cast`].
    pub fn locate(
        &mut self,
        map: &mut dyn DenseMap,
        keyframes: &KeyframeIndex,
        frame: &StampedPose,
        depth: &DepthView,
        colour: Option<&ColourView>,
    ) -> Result<Located, Error> {
        let mut located = Located::default();
        if self.motion.is_empty() && !self.relocalise_first {
            let first = frame.world_from_camera.unwrap_or_else(Isometry3::identity);
            self.motion.start(first, Some(frame));
            located.world_from_camera = Some(first);
            return Ok(located);
        }
        located.tracking = match self.follow(map, keyframes, frame, depth, colour)? {
            Some(outcome) if outcome.is_on_the_map() || self.is_expected_here(&outcome, frame) => {
                self.relocaliser.reset();
                Some(outcome)
            }
            tracked => match self.relocaliser.add(map, depth, colour, keyframes)? {
                Some(found) => {
                    located.events.push(Event::Relocalised { earlier: found.earlier.len() });
                    self.motion.forget();
                    self.key_view.forget();
                    self.local_map.iter_mut().for_each(LocalMap::forget);
                    located.earlier = found.earlier;
                    Some(found.outcome)
                }
                None => tracked,
            },
        };
        let was_lost = self.last == Last::Lost;
        let followed = located.tracking.as_ref().filter(|outcome| outcome.is_on_the_map());
        self.last = match followed {
            Some(outcome) if is_guess(outcome) => Last::Guessed,
            Some(_) => Last::Tracked,
            None => Last::Lost,
        };
        if let Some(outcome) = followed.filter(|outcome| !outcome.degenerate.is_empty()) {
            located.events.push(Event::Degenerate { directions: outcome.degenerate.len() });
        }
        match (was_lost, self.last == Last::Lost) {
            (false, true) => located.events.push(Event::Lost),
            (true, false) => located.events.push(Event::Found),
            _ => {}
        }
        if let Some(outcome) = followed {
            self.resumed = false;
            if outcome.is_tracked() {
                self.usual.learn(outcome);
                located.world_from_camera = Some(outcome.world_from_camera);
            }
            // After a jump the last two poses are no motion, but what led to the place where it is found is one.
            self.motion.found(outcome, located.earlier.last().copied(), frame, was_lost);
        } else if located.tracking.is_some() {
            self.motion.lost(frame);
        }
        Ok(located)
    }

    /// Tracks a frame from where the poses before lead; where that does not convince, from where keyframes recognise it. `None` before the
    /// first.
    ///
    /// A camera that turns by degrees from frame to frame leaves the basin of the cost: the nearest minimum is then a wrong one, with less
    /// agreement than the right one has.
    fn follow(
        &mut self,
        map: &mut dyn DenseMap,
        keyframes: &KeyframeIndex,
        frame: &StampedPose,
        depth: &DepthView,
        colour: Option<&ColourView>,
    ) -> Result<Option<TrackingOutcome>, Error> {
        // A lost camera has moved, nobody knows where, unless odometry does, and one that skipped frames: what would do from one frame to the
        // next is not enough.
        let is_guess = (self.last != Last::Tracked && !self.motion.is_led(frame)) || self.motion.is_gap(frame);
        let mut priors = self.motion.priors(frame);
        // Without colour, a step of stairs looks like the next one. A fast camera that turns back is led there: of the places that agree, the one
        // that more of the frame is seen at.
        let is_fast = colour.is_none()
            && priors.len() > 1
            && !within(&priors[0].world_from_camera, &priors[1].world_from_camera, FAST);
        if is_fast {
            priors.extend(self.motion.turned_back());
        }
        let mut best: Option<TrackingOutcome> = None;
        if !is_guess && !is_fast {
            let led = priors.first().map(|prior| self.follow_key_view(map.settings().voxel_size, depth, colour, prior));
            if let Some(outcome) = led.transpose()?.flatten() {
                return Ok(Some(outcome));
            }
        }
        for prior in priors {
            let outcome = self.track(map, depth, colour, &prior, is_guess)?;
            if !is_fast && !self.usual.is_doubtful(&outcome, &self.tracker) {
                return Ok(Some(outcome));
            }
            if best.as_ref().is_none_or(|best| rank(&outcome) > rank(best)) {
                best = Some(outcome);
            }
        }
        if let Some(best) = best.take_if(|best| !self.usual.is_doubtful(best, &self.tracker)) {
            return Ok(Some(best));
        }
        let Some(mut best) = best else { return Ok(None) };
        // Odometry knows better than looks, and of a lost camera the relocaliser asks more than one frame. What a frame does not fix, it does
        // not fix elsewhere, either.
        let is_open = self::is_guess(&best) && self.tracker.convinces(&best);
        if self.last != Last::Lost && !is_open && !self.motion.is_led(frame) {
            best = self.recognise(map, keyframes, depth, colour, is_guess, best)?;
        }
        // What has been moved since a stored map was made differs from it, and the agreement that it asks for is higher already.
        if !self.fixed_map && best.is_tracked() && is_contradicted(&best, self.tracker.settings()) {
            best.status = TrackingStatus::Disagreement;
        }
        Ok(Some(best))
    }

    /// Tracks a frame against the last ray cast, as it is seen from where the motion before leads; `None` where a new one is due, or where that
    /// does not convince.
    fn follow_key_view(
        &mut self,
        voxel_size: f64,
        depth: &DepthView,
        colour: Option<&ColourView>,
        prior: &PosePrior,
    ) -> Result<Option<TrackingOutcome>, Error> {
        let older = self.local_map.as_mut().and_then(LocalMap::older);
        let world_from_map = older.map_or_else(Isometry3::identity, |(_, pose)| pose);
        let there = prior.seen_from(&world_from_map.inverse());
        let Some(view) = self.key_view.seen_from(&there.world_from_camera)? else { return Ok(None) };
        let outcome = self.tracker.track_view(&view, voxel_size, depth, colour, &there)?.seen_from(&world_from_map);
        Ok(Some(self.judged(outcome, false)).filter(|outcome| !self.usual.is_doubtful(outcome, &self.tracker)))
    }

    /// Whether odometry leads, and all that a frame shows of a map that stays as it is agrees there, only not enough to fix its pose: neither
    /// would it elsewhere.
    fn is_expected_here(&self, outcome: &TrackingOutcome, frame: &StampedPose) -> bool {
        self.fixed_map
            && self.motion.is_led(frame)
            && !outcome.degenerate.is_empty()
            && outcome.coverage >= LEAST_COVERAGE
            && self.tracker.convinces(outcome)
    }

    /// Tracks a frame from where keyframes near the last pose place it, by their features or by how they look, if that is better than what
    /// was found.
    fn recognise(
        &mut self,
        map: &mut dyn DenseMap,
        keyframes: &KeyframeIndex,
        depth: &DepthView,
        colour: Option<&ColourView>,
        is_guess: bool,
        mut best: TrackingOutcome,
    ) -> Result<TrackingOutcome, Error> {
        let Some(last) = self.motion.last() else { return Ok(best) };
        let near = |k: usize| keyframes.pose(k).is_some_and(|pose| within(&last, pose, NEAR));
        let by_features = keyframes.recognise(depth, colour, HYPOTHESES, near)?;
        let by_looks = keyframes.candidates(depth, colour, HYPOTHESES, near)?;
        let starts = by_features.iter().map(|place| place.world_from_camera);
        for start in starts.chain(by_looks.iter().map(|alike| alike.world_from_camera)) {
            let mut prior = PosePrior { world_from_camera: start, covariance: None };
            // Again from where that led: the first model was seen from elsewhere.
            for _ in 0..2 {
                let outcome = self.track(map, depth, colour, &prior, is_guess)?;
                prior.world_from_camera = outcome.world_from_camera;
                if rank(&outcome) > rank(&best) {
                    best = outcome;
                }
            }
            if !self.usual.is_doubtful(&best, &self.tracker) {
                break;
            }
        }
        Ok(best)
    }

    fn track(
        &mut self,
        map: &mut dyn DenseMap,
        depth: &DepthView,
        colour: Option<&ColourView>,
        prior: &PosePrior,
        is_guess: bool,
    ) -> Result<TrackingOutcome, Error> {
        let local = self.local_map.as_mut().and_then(LocalMap::older);
        let (map, world_from_map) = local.unwrap_or_else(|| (map, Isometry3::identity()));
        let there = prior.seen_from(&world_from_map.inverse());
        // No frame touches what a camera sees that was lost, or whose frames are not fused.
        if is_guess || self.fixed_map || self.resumed {
            self.tracker.reload_view(map, depth, &there.world_from_camera)?;
        }
        let view = self.tracker.model(map, depth, colour.is_some(), &there.world_from_camera)?;
        let outcome = self.tracker.track_view(&view, map.settings().voxel_size, depth, colour, &there)?;
        self.key_view.keep(view);
        Ok(self.judged(outcome.seen_from(&world_from_map), is_guess))
    }

    /// An outcome whose status says what the tracker alone does not know.
    fn judged(&self, mut outcome: TrackingOutcome, is_guess: bool) -> TrackingOutcome {
        // A map that does not grow is left sooner or later: what little of it is in view then leads anywhere.
        if self.fixed_map && (outcome.coverage < LEAST_COVERAGE || !outcome.degenerate.is_empty()) {
            outcome.status = TrackingStatus::NoOverlap;
        }
        // A gyroscope does not say where the camera moves to.
        if outcome.is_tracked() && !self.motion.has_odometry() && outcome.leaves_shift_open() {
            outcome.status = TrackingStatus::Degenerate;
        }
        if is_guess && outcome.agreement < self.tracker.settings().relocalise_agreement {
            outcome.status = TrackingStatus::Disagreement;
        }
        outcome
    }
}

/// Whether a pose goes on by the motion before along some directions, because nothing fixes them.
fn is_guess(outcome: &TrackingOutcome) -> bool {
    outcome.status == TrackingStatus::Degenerate
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::images::{DepthData, Intrinsics};
    use crate::map::Map;
    use crate::slam::motion_model::OdometryError;

    const SIZE: (usize, usize) = (80, 60);
    const INTRINSICS: Intrinsics = Intrinsics { fx: 70.0, fy: 70.0, cx: 39.5, cy: 29.5 };

    fn wall(data: &[f32]) -> DepthView<'_> {
        DepthView { width: SIZE.0, height: SIZE.1, data: DepthData::F32 { data }, intrinsics: INTRINSICS }
    }

    /// Before a flat wall a frame fixes no shift along it, here or anywhere else; a wall where none should be is looked for.
    #[test]
    fn a_frame_that_agrees_where_odometry_leads_is_not_looked_for_elsewhere() {
        let settings = Settings { voxel_size: 0.04, ..Settings::default() };
        let mut map = Map::new(settings).unwrap();
        let [there, nearer] = [1.5_f32, 1.1].map(|z| vec![z; SIZE.0 * SIZE.1]);
        for _ in 0..5 {
            map.integrate(&wall(&there), None, &Isometry3::identity()).unwrap();
        }
        let poses = PoseSource::Odometry(OdometryError::default());
        let slam = SlamSettings { poses, fuse: false, ..SlamSettings::default() };
        let mut frontend = Frontend::new(&slam, &settings).unwrap();
        let keyframes = KeyframeIndex::new();
        let mut seen = Vec::new();
        for (k, depth) in [&there, &there, &there, &nearer].into_iter().enumerate() {
            let led = Isometry3::translation(0.01 * k as f64, 0.0, 0.0);
            let frame = StampedPose { stamp: 0.1 * k as f64, world_from_camera: Some(led) };
            let located = frontend.locate(&mut map, &keyframes, &frame, &wall(depth), None).unwrap();
            let open = located.tracking.is_some_and(|tracking| !tracking.degenerate.is_empty());
            seen.push((open, frontend.remembered()));
        }
        assert_eq!(seen, [(false, 0), (true, 0), (true, 0), (false, 1)]);
    }
}
