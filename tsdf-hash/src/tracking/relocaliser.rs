//! Finds a lost camera by a few frames (thesis Paper II, section 6.3).

use nalgebra::{Isometry3, Vector3};

use crate::dense_map::DenseMap;
use crate::error::Error;
use crate::global_registration::{GlobalRegistration, LocalCloud};
use crate::images::{ColourView, DepthView};
use crate::keyframes::index::{KeyframeIndex, RecognisedPlace, features_of};
use crate::map::Map;
use crate::settings::Settings;
use crate::tracking::outcome::{PosePrior, TrackingOutcome};
use crate::tracking::pose::within;
use crate::tracking::settings::TrackingSettings;
use crate::tracking::tracker::{FROM_AFAR, FROM_NEAR, Tracker};

/// Keyframes that a frame is tracked from because it looks like them, where features have not found it; of a frame with plenty of features,
/// which would have (ours).
const CANDIDATES: [usize; 2] = [8, 2];
const PLENTY: usize = 200;
/// Keyframes of the most common words that a frame is compared with, feature by feature (ours).
const RECOGNISED: usize = 8;
/// Features that make a frame enough (ours): frames of other rooms than the mapped one have none of twelve that agree.
const ENOUGH: usize = 20;
/// Another place that looks the same is looked for among keyframes at least so far from the found pose: radians, metres (ours).
const ELSEWHERE: [f64; 2] = [0.7, 1.0];
/// Frames that must agree about a place that features have not shown (ours).
const FRAMES: usize = 3;
/// The reserve map begins anew after so many frames: what it drifts must not matter.
const LONGEST: usize = 60;
/// Places nearer to each other are one: radians, metres.
const SAME: [f64; 2] = [0.04, 0.04];
/// Starts nearer to each other are one: radians, metres.
const ONE_START: [f64; 2] = [0.05, 0.05];
/// Views from different poses of which a cloud is made at most.
const VIEWS: usize = 8;
/// Without colour, a frame counts beside others that it was taken at least so far from: radians, metres (ours).
const ANOTHER: [f64; 2] = [0.02, 0.02];

/// Finds a lost camera in a map.
///
/// In colour one frame is enough where twenty of its features and the surface agree about a place, and no keyframe elsewhere knows one like it.
/// A room that was not mapped and looks the same is taken for the mapped one.
///
/// Otherwise a corner of a room looks like another corner. So the frames since the camera was lost are tracked in a
/// reserve map of their own, which says how they are placed to each other. Where a frame is found in the old map, by the features that it
/// has in common with keyframes or near those that look most like it, the frames after it must be found where the reserve map has them,
/// or the place is dropped. It is believed when three frames agree and no other place is left; without colour these must have been taken from different poses.
///
/// ```
/// # use tsdf_hash::place_recognition::KeyframeIndex;
/// # use tsdf_hash::tracking::{Relocaliser, TrackingSettings};
/// # use tsdf_hash::{DenseMap, DepthView, Error};
/// # fn search(map: &mut dyn DenseMap, keyframes: &KeyframeIndex, lost: &[DepthView]) -> Result<(), Error> {
/// let mut relocaliser = Relocaliser::new(TrackingSettings::default())?;
/// for depth in lost {
///     if let Some(found) = relocaliser.add(map, depth, None, keyframes)? {
///         println!("at {}; before: {:?}", found.outcome.world_from_camera, found.earlier);
///         break;
///     }
/// }
/// # Ok(())
/// # }
/// ```
pub struct Relocaliser {
    tracker: Tracker,
    /// The map's surface, to look for the camera by shape.
    surface: Option<GlobalRegistration>,
    /// The vertical along the axes of the camera.
    up_in_camera: Option<Vector3<f64>>,
    reserve: Option<Reserve>,
    places: Vec<Place>,
}

/// Where a lost camera is.
#[derive(Clone, Debug)]
pub struct Relocalisation {
    /// The frame that settled it.
    pub outcome: TrackingOutcome,
    /// Poses in the old map of the frames before it, the latest last: as many as are sure.
    pub earlier: Vec<Isometry3<f64>>,
}

/// The frames since the camera was lost, placed to each other.
struct Reserve {
    map: Map,
    poses: Vec<Isometry3<f64>>,
    /// What was seen from poses apart from each other, and for how many of them it was looked for by shape.
    cloud: LocalCloud,
    views: Vec<Isometry3<f64>>,
    searched: usize,
}

/// A place where the camera may be.
struct Place {
    world_from_reserve: Isometry3<f64>,
    /// Frames of the reserve that agree.
    agreeing: Vec<usize>,
    /// The latest frame, if it agrees.
    latest: Option<TrackingOutcome>,
    /// Whether features and surface of one frame were enough.
    recognised: bool,
}

impl Relocaliser {
    /// A search without frames.
    ///
    /// # Errors
    /// [`Error::InvalidSetting`].
    pub fn new(settings: TrackingSettings) -> Result<Self, Error> {
        let tracker = Tracker::of_revisits(settings)?;
        Ok(Self { tracker, surface: None, up_in_camera: None, reserve: None, places: Vec::new() })
    }

    /// Looks for the camera by shape, too, where keyframes do not show it: on the surface of the map, as soon as the vertical is known. The
    /// camera must be moved a little meanwhile.
    pub fn set_surface(&mut self, surface: GlobalRegistration) {
        self.surface = Some(surface);
    }

    /// The vertical along the axes of the camera that takes the next frame, from an inertial sensor; of any length.
    pub fn set_vertical(&mut self, up_in_camera: Vector3<f64>) {
        self.up_in_camera = Some(up_in_camera);
    }

    /// Forgets the frames: the camera is no longer lost.
    pub fn reset(&mut self) {
        self.reserve = None;
        self.places.clear();
    }

    /// Number of places where the camera may be, as far as the frames say.
    pub fn places(&self) -> usize {
        self.places.len()
    }

    /// Number of frames that are placed to each other: the latest of those that were taken.
    pub(crate) fn frames(&self) -> usize {
        self.reserve.as_ref().map_or(0, |reserve| reserve.poses.len())
    }

    /// Takes the next frame of a lost camera. When its place is found, the search is reset.
    ///
    /// # Errors
    /// Views that make no sense, and those of [`DenseMap::ray_cast`].
    pub fn add(
        &mut self,
        map: &mut dyn DenseMap,
        depth: &DepthView,
        colour: Option<&ColourView>,
        keyframes: &KeyframeIndex,
    ) -> Result<Option<Relocalisation>, Error> {
        let present = self.follow(map.settings(), depth, colour)?;
        self.test(map, depth, colour, &present)?;
        if self.places.iter().all(|place| place.latest.is_none()) {
            self.search(map, depth, colour, keyframes, &present)?;
        }
        let [place] = &mut self.places[..] else { return Ok(None) };
        let Some(reserve) = &self.reserve else { return Ok(None) };
        let agreeing = if colour.is_some() && place.latest.as_ref().is_some_and(|l| l.likeness.is_some()) {
            place.agreeing.len()
        } else {
            different(place.agreeing.iter().map(|k| &reserve.poses[*k]))
        };
        let is_enough = agreeing >= FRAMES || place.recognised;
        let (true, Some(outcome)) = (is_enough, place.latest.take()) else { return Ok(None) };
        let world_from_reserve = outcome.world_from_camera * present.inverse();
        let before = &reserve.poses[..reserve.poses.len() - 1];
        let earlier = before.iter().map(|pose| world_from_reserve * pose).collect();
        self.reset();
        Ok(Some(Relocalisation { outcome, earlier }))
    }

    /// Places the frame in the reserve map; where it cannot be followed, or the map is old, another one begins.
    fn follow(
        &mut self,
        settings: &Settings,
        depth: &DepthView,
        colour: Option<&ColourView>,
    ) -> Result<Isometry3<f64>, Error> {
        if let Some(reserve) = self.reserve.as_mut().filter(|reserve| reserve.poses.len() < LONGEST)
            && let Some(pose) = reserve.place(&mut self.tracker, depth, colour)?
        {
            return Ok(pose);
        }
        self.places.clear();
        let mut map = Map::new(settings.beside())?;
        let first = Isometry3::identity();
        map.integrate(depth, colour, &first)?;
        let spacing = self.surface.as_ref().map_or(1.0, |surface| surface.settings().spacing);
        let mut cloud = LocalCloud::new(spacing);
        cloud.add(depth, &first, settings.max_depth)?;
        self.reserve = Some(Reserve { map, poses: vec![first], cloud, views: vec![first], searched: 0 });
        Ok(first)
    }

    /// Asks the frame about each place: whether the old map is seen from there.
    fn test(
        &mut self,
        map: &mut dyn DenseMap,
        depth: &DepthView,
        colour: Option<&ColourView>,
        present: &Isometry3<f64>,
    ) -> Result<(), Error> {
        let frame = self.reserve.as_ref().map_or(0, |reserve| reserve.poses.len() - 1);
        let mut left: Vec<Place> = Vec::new();
        for mut place in std::mem::take(&mut self.places) {
            let expected = place.world_from_reserve * present;
            let prior = PosePrior { world_from_camera: expected, covariance: None };
            self.tracker.reload_view(map, depth, &expected)?;
            let outcome = self.tracker.track(map, depth, colour, &prior)?;
            let agrees = self.tracker.is_sure(&outcome) && is_same(&expected, &outcome.world_from_camera);
            place.latest = agrees.then(|| outcome.clone());
            if agrees {
                place.agreeing.push(frame);
                place.world_from_reserve = outcome.world_from_camera * present.inverse();
            } else if self.tracker.contradicts(&outcome) {
                continue;
            }
            if !left.iter().any(|other| is_same(&other.world_from_reserve, &place.world_from_reserve)) {
                left.push(place);
            }
        }
        self.places = left;
        Ok(())
    }

    /// Looks for the frame in the old map: where features say that it is; if they do not, near keyframes that it looks like.
    fn search(
        &mut self,
        map: &mut dyn DenseMap,
        depth: &DepthView,
        colour: Option<&ColourView>,
        keyframes: &KeyframeIndex,
        present: &Isometry3<f64>,
    ) -> Result<(), Error> {
        let seen = features_of(depth, colour)?;
        let likest = keyframes.recognise_features(&seen, RECOGNISED, |_| true);
        self.search_by_features(map, depth, colour, &likest, present)?;
        // No place is enough by itself before others like it have been looked for.
        let enough = self.places.iter().filter(|place| place.recognised).find_map(|place| place.latest.as_ref());
        if let Some(here) = enough.map(|found| found.world_from_camera) {
            let elsewhere = |k: usize| keyframes.pose(k).is_some_and(|pose| !within(pose, &here, ELSEWHERE));
            let others = keyframes.recognise_features(&seen, RECOGNISED, elsewhere);
            self.search_by_features(map, depth, colour, &others, present)?;
        }
        if !self.places.is_empty() {
            return Ok(());
        }
        let candidates = CANDIDATES[usize::from(seen.len() >= PLENTY)];
        for start in keyframes.candidates(depth, colour, candidates, |_| true)? {
            if let Some(found) = self.tracker.settle(map, depth, colour, &start.world_from_camera, &FROM_AFAR)? {
                self.suspect(found, present, false);
            }
        }
        if self.places.is_empty() { self.search_by_shape(map, depth, colour, present) } else { Ok(()) }
    }

    /// Looks for the frame where its features place it.
    fn search_by_features(
        &mut self,
        map: &mut dyn DenseMap,
        depth: &DepthView,
        colour: Option<&ColourView>,
        recognised: &[RecognisedPlace],
        present: &Isometry3<f64>,
    ) -> Result<(), Error> {
        let mut tried: Vec<Isometry3<f64>> = Vec::new();
        for start in recognised {
            let (start, many) = (start.world_from_camera, start.agreeing >= ENOUGH);
            // Neighbouring keyframes say the same.
            if !tried.iter().any(|other| within(other, &start, ONE_START)) {
                if let Some(found) = self.tracker.converge(map, depth, colour, &start, FROM_NEAR)? {
                    let is_enough = many && self.tracker.confirms(&found);
                    if is_enough || self.tracker.is_sure(&found) {
                        self.suspect(found, present, is_enough);
                    }
                }
                tried.push(start);
            }
        }
        Ok(())
    }

    /// Looks for all that was seen on the surface, once for every view from another pose.
    fn search_by_shape(
        &mut self,
        map: &mut dyn DenseMap,
        depth: &DepthView,
        colour: Option<&ColourView>,
        present: &Isometry3<f64>,
    ) -> Result<(), Error> {
        let Self { surface: Some(surface), up_in_camera: Some(up), reserve: Some(reserve), .. } = self else {
            return Ok(());
        };
        if reserve.searched == reserve.views.len() {
            return Ok(());
        }
        reserve.searched = reserve.views.len();
        let found = surface.register(&reserve.cloud, &(present.rotation * *up));
        for place in found {
            let start = place.world_from_local * present;
            if let Some(found) = self.tracker.settle(map, depth, colour, &start, FROM_NEAR)? {
                self.suspect(found, present, false);
            }
        }
        Ok(())
    }

    /// The present frame is seen from here, as well.
    fn suspect(&mut self, found: TrackingOutcome, present: &Isometry3<f64>, recognised: bool) {
        let frame = self.reserve.as_ref().map_or(0, |reserve| reserve.poses.len() - 1);
        let world_from_reserve = found.world_from_camera * present.inverse();
        match self.places.iter_mut().find(|place| is_same(&place.world_from_reserve, &world_from_reserve)) {
            Some(place) if recognised => (place.recognised, place.latest) = (true, Some(found)),
            Some(_) => {}
            None => {
                self.places.push(Place { world_from_reserve, agreeing: vec![frame], latest: Some(found), recognised });
            }
        }
    }
}

impl Reserve {
    /// Follows the camera from where its last two poses lead, and fuses the frame; `None` if it is lost here, too.
    fn place(
        &mut self,
        tracker: &mut Tracker,
        depth: &DepthView,
        colour: Option<&ColourView>,
    ) -> Result<Option<Isometry3<f64>>, Error> {
        let Some(last) = self.poses.last().copied() else { return Ok(None) };
        let before = self.poses.len().checked_sub(2).map_or(last, |k| self.poses[k]);
        for guess in [last * (before.inverse() * last), last] {
            let prior = PosePrior { world_from_camera: guess, covariance: None };
            let outcome = tracker.track(&mut self.map, depth, colour, &prior)?;
            if tracker.is_sure(&outcome) {
                let pose = outcome.world_from_camera;
                self.map.integrate_where_room(depth, colour, &pose, &mut Vec::new())?;
                self.poses.push(pose);
                if self.views.len() < VIEWS && !self.views.iter().any(|other| within(other, &pose, ANOTHER)) {
                    self.cloud.add(depth, &pose, self.map.settings().max_depth)?;
                    self.views.push(pose);
                }
                return Ok(Some(pose));
            }
        }
        Ok(None)
    }
}

fn is_same(a: &Isometry3<f64>, b: &Isometry3<f64>) -> bool {
    within(a, b, SAME)
}

/// How many of some poses are apart from all that were counted before.
fn different<'a>(poses: impl Iterator<Item = &'a Isometry3<f64>>) -> usize {
    let mut counted: Vec<&Isometry3<f64>> = Vec::new();
    for pose in poses {
        if !counted.iter().any(|other| within(other, pose, ANOTHER)) {
            counted.push(pose);
        }
    }
    counted.len()
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix6, UnitQuaternion, Vector3};

    use super::*;
    use crate::tracking::outcome::TrackingStatus;

    /// A place that was suspected before, and that the frame did not confirm by itself, is where features find it.
    #[test]
    fn a_suspected_place_is_recognised_later() {
        let found = TrackingOutcome {
            status: TrackingStatus::Tracked,
            world_from_camera: Isometry3::translation(3.0, -2.0, 1.0),
            covariance: Matrix6::identity(),
            degenerate: Vec::new(),
            overlap: 0.9,
            coverage: 0.9,
            agreement: 0.9,
            depth_scale: 1.0,
            intensity_scale: 0.0,
            likeness: Some(0.9),
            iterations: 1,
        };
        let mut relocaliser = Relocaliser::new(TrackingSettings::default()).unwrap();
        relocaliser.suspect(found.clone(), &Isometry3::identity(), false);
        assert!(!relocaliser.places[0].recognised);
        relocaliser.places[0].latest = None;
        relocaliser.suspect(found, &Isometry3::identity(), true);
        let [place] = &relocaliser.places[..] else { panic!("{} places", relocaliser.places.len()) };
        assert!(place.recognised && place.latest.is_some());
    }

    /// The next shelf is 10 cm on: another place. What two tracked frames differ by is the same one, wherever it is and looks.
    #[test]
    fn places_a_hand_apart_are_two() {
        let there = Isometry3::new(Vector3::new(3.0, -2.0, 1.0), Vector3::new(0.4, -1.9, 0.7));
        let moved = |shift: f64, turn: f64| {
            let rotation = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), turn);
            there * Isometry3::from_parts(Vector3::new(0.0, 0.0, shift).into(), rotation)
        };
        for (shift, turn, same) in
            [(0.0, 0.0, true), (0.03, 0.0, true), (0.0, 0.03, true), (0.1, 0.0, false), (0.0, 0.1, false)]
        {
            assert_eq!(is_same(&there, &moved(shift, turn)), same, "{shift} m, {turn} rad");
            assert_eq!(is_same(&moved(shift, turn), &there), same, "{shift} m, {turn} rad");
        }
    }
}
