//! All keyframes of a scan.

use std::sync::Arc;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::error::Error;
use crate::file::byte_reader::ByteReader;
use crate::images::{ColourData, ColourView, DepthData, DepthView, check_pose};
use crate::keyframes::compressed_frame::CompressedFrame;
use crate::keyframes::keyframe::Keyframe;
use crate::keyframes::small_image::{Likeness, SmallImage};
use crate::map::Map;
use crate::place_recognition::alignment::align;
use crate::place_recognition::descriptor::Descriptor;
use crate::place_recognition::features::{Feature, features};
use crate::place_recognition::inverse_index::{InverseIndex, words};
use crate::place_recognition::vocabulary::Vocabulary;
use crate::settings::Settings;
use crate::tracking::image_level::ImageLevel;

/// Pixels of the small image along a row.
const WIDTH: usize = 40;
/// Pixels of the stored frame along a row.
const FRAME_WIDTH: usize = 320;
/// A keyframe is added this far from all others, metres and radians (ours): tracking starts well from half of it.
const SPACING: [f64; 2] = [0.2, 0.2];
/// Bytes of frames that are kept where nothing else is said.
const BUDGET: usize = 64 << 20;
const MAGIC: &[u8; 8] = b"KEYFRAM3";
/// Before there were features.
const OLD_MAGIC: &[u8; 8] = b"KEYFRAM2";

/// Keyframes of a scan with the poses that they were taken from: binary features in an inverse index and small images, to find a lost camera
/// or a loop by, and compressed depth and grey, to see a place again as it was.
///
/// Frames that exceed the budget make room, every other one of the older half first; their features and small images stay.
#[derive(Clone, Debug)]
pub struct KeyframeIndex {
    keyframes: Vec<Keyframe>,
    vocabulary: Arc<Vocabulary>,
    words: InverseIndex,
    max_bytes: usize,
    bytes: usize,
    thinned: usize,
}

impl Default for KeyframeIndex {
    fn default() -> Self {
        Self::with_budget(BUDGET)
    }
}

/// A keyframe of which a frame shows features.
#[derive(Clone, Copy, Debug)]
pub struct RecognisedPlace {
    /// Which keyframe.
    pub keyframe: usize,
    /// Where the frame was taken, as the features say, to a centimetre or two.
    pub world_from_camera: Isometry3<f64>,
    /// Features that agree about it.
    pub agreeing: usize,
}

/// A keyframe that looks like a frame.
#[derive(Clone, Copy, Debug)]
pub struct KeyframeMatch {
    /// Which keyframe.
    pub keyframe: usize,
    /// Where the frame was taken, if from the keyframe's place: its orientation follows from the shift between the images.
    pub world_from_camera: Isometry3<f64>,
    /// Correlation of the small images, `-1..=1`.
    pub correlation: f64,
}

impl KeyframeIndex {
    /// Without keyframes, for 64 MiB of them.
    pub fn new() -> Self {
        Self::default()
    }

    /// Without keyframes; all together take at most about `max_bytes`.
    pub fn with_budget(max_bytes: usize) -> Self {
        let (vocabulary, words) = (Vocabulary::shipped(), InverseIndex::default());
        Self { keyframes: Vec::new(), vocabulary, words, max_bytes, bytes: 0, thinned: 0 }
    }

    /// The same keyframes, found again by the words of another vocabulary. It is not written with them.
    #[must_use]
    pub fn with_vocabulary(mut self, vocabulary: Vocabulary) -> Self {
        self.vocabulary = Arc::new(vocabulary);
        self.words = InverseIndex::default();
        for keyframe in &self.keyframes {
            self.words.push(&words(&self.vocabulary, &keyframe.features));
        }
        self
    }

    /// Words for pictures such as these: clusters of the descriptors of all keyframes.
    pub fn train_vocabulary(&self, seed: u64) -> Vocabulary {
        let features = self.keyframes.iter().flat_map(|keyframe| &keyframe.features);
        Vocabulary::train(&features.map(|feature| feature.descriptor).collect::<Vec<Descriptor>>(), seed)
    }

    /// Number of keyframes.
    pub fn len(&self) -> usize {
        self.keyframes.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.keyframes.is_empty()
    }

    /// Bytes in memory, about.
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    /// Keyframes whose frames had to make room.
    pub fn without_depth(&self) -> usize {
        self.thinned
    }

    /// Where a keyframe was taken from, `world_from_camera`.
    pub fn pose(&self, keyframe: usize) -> Option<&Isometry3<f64>> {
        self.keyframes.get(keyframe).map(|keyframe| &keyframe.world_from_camera)
    }

    /// Moves the keyframes, for instance to where a pose graph has them; poses that are missing or too many are not heeded.
    ///
    /// # Errors
    /// [`Error::InvalidPose`]; the poses are then as they were.
    pub fn set_poses(&mut self, world_from_camera: &[Isometry3<f64>]) -> Result<(), Error> {
        world_from_camera.iter().try_for_each(check_pose)?;
        self.keyframes.iter_mut().zip(world_from_camera).for_each(|(k, pose)| k.world_from_camera = *pose);
        Ok(())
    }

    /// Keeps a frame if no keyframe was taken from near its pose (20 cm and 11 degrees). Returns whether it is kept.
    ///
    /// # Errors
    /// Views or pose that make no sense.
    pub fn add(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<bool, Error> {
        check_pose(world_from_camera)?;
        let taken = self.keyframes.iter().any(|keyframe| is_near(&keyframe.world_from_camera, world_from_camera));
        if !taken {
            self.push(depth, colour, world_from_camera)?;
        }
        Ok(!taken)
    }

    /// Keeps a frame, and returns its number.
    ///
    /// # Errors
    /// Views or pose that make no sense.
    pub fn push(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        world_from_camera: &Isometry3<f64>,
    ) -> Result<usize, Error> {
        check_pose(world_from_camera)?;
        let image = small_image(depth, colour)?;
        let level = reduced_to(FRAME_WIDTH, depth, colour);
        let frame = Some(CompressedFrame::new(&level));
        self.take(Keyframe { world_from_camera: *world_from_camera, image, frame, features: features(&level) });
        self.make_room();
        Ok(self.keyframes.len() - 1)
    }

    fn take(&mut self, keyframe: Keyframe) {
        self.bytes += keyframe.bytes();
        self.thinned += usize::from(keyframe.frame.is_none());
        self.words.push(&words(&self.vocabulary, &keyframe.features));
        self.keyframes.push(keyframe);
    }

    /// The keyframes that show what a frame shows, those with the most agreeing features first: of the `count` with the most words in common those
    /// that at least twelve features place the frame beside. From any distance and direction from which corners look alike. Only
    /// those that `wanted` says are looked at; nothing is recognised without colour.
    ///
    /// # Errors
    /// Views that make no sense.
    pub fn recognise(
        &self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        count: usize,
        wanted: impl Fn(usize) -> bool,
    ) -> Result<Vec<RecognisedPlace>, Error> {
        Ok(self.recognise_features(&features_of(depth, colour)?, count, wanted))
    }

    /// The same by the features of the frame.
    pub(crate) fn recognise_features(
        &self,
        seen: &[Feature],
        count: usize,
        wanted: impl Fn(usize) -> bool,
    ) -> Vec<RecognisedPlace> {
        let alike = self.words.query(&words(&self.vocabulary, seen), count, wanted);
        let mut places: Vec<RecognisedPlace> = alike
            .into_iter()
            .filter_map(|keyframe| {
                let there = &self.keyframes[keyframe];
                let found = align(seen, &there.features)?;
                let world_from_camera = there.world_from_camera * found.keyframe_from_frame;
                Some(RecognisedPlace { keyframe, world_from_camera, agreeing: found.agreeing })
            })
            .collect();
        places.sort_by_key(|place| (std::cmp::Reverse(place.agreeing), place.keyframe));
        places
    }

    /// The keyframes most like a frame, the likest first: at most `count`. Only those that `wanted` says are looked at.
    ///
    /// # Errors
    /// Views that make no sense.
    pub fn candidates(
        &self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        count: usize,
        wanted: impl Fn(usize) -> bool,
    ) -> Result<Vec<KeyframeMatch>, Error> {
        let image = small_image(depth, colour)?;
        let alike = self.keyframes.iter().enumerate().filter(|(k, _)| wanted(*k));
        let mut ranked: Vec<(Likeness, usize)> = alike.map(|(k, other)| (image.likeness(&other.image), k)).collect();
        ranked.sort_by(|a, b| b.0.correlation.total_cmp(&a.0.correlation).then(a.1.cmp(&b.1)));
        let found = ranked.into_iter().take(count).map(|(likeness, keyframe)| {
            let [x, y] = [0, 1].map(|k| f64::from(likeness.shift[k] / image.focal[k]));
            let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), x.atan())
                * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -y.atan());
            let turn = Isometry3::from_parts(Translation3::identity(), turn);
            let world_from_camera = self.keyframes[keyframe].world_from_camera * turn;
            KeyframeMatch { keyframe, world_from_camera, correlation: f64::from(likeness.correlation) }
        });
        Ok(found.collect())
    }

    /// The surface as some keyframes saw it: a map of their stored depth and grey, of those that still have it, at the poses that
    /// all keyframes have in `world_from_camera`.
    ///
    /// # Errors
    /// As [`Map::new`] and [`Map::integrate`]. A keyframe of which nothing can be fused, or that has no pose, is left out.
    pub fn map_of(
        &self,
        keyframes: std::ops::Range<usize>,
        world_from_camera: &[Isometry3<f64>],
        settings: Settings,
    ) -> Result<Map, Error> {
        let mut map = Map::new(settings)?;
        for (keyframe, pose) in self.keyframes.iter().zip(world_from_camera).take(keyframes.end).skip(keyframes.start) {
            let Some(frame) = &keyframe.frame else { continue };
            let (Some(metres), Some(rgb)) = (frame.metres(), frame.rgb()) else { continue };
            let &CompressedFrame { width, height, intrinsics, .. } = frame;
            let view = DepthView { width, height, data: DepthData::F32 { data: &metres }, intrinsics };
            let colour = ColourView { width, height, data: ColourData::Rgb8(&rgb), intrinsics };
            match map.integrate(&view, (!rgb.is_empty()).then_some(&colour), pose) {
                Ok(_) | Err(Error::NoDepth { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(map)
    }

    /// Whether a keyframe still has what it saw.
    #[cfg(feature = "pose-graph")]
    pub(crate) fn has_frame(&self, keyframe: usize) -> bool {
        self.keyframes[keyframe].frame.is_some()
    }

    /// What the keyframes saw, with slopes; `None` of those without depth.
    #[cfg(feature = "pose-graph")]
    pub(crate) fn levels(&self) -> Vec<Option<ImageLevel>> {
        let level = |keyframe: &Keyframe| {
            let mut level = keyframe.frame.as_ref()?.level()?;
            level.differentiate();
            Some(level)
        };
        self.keyframes.iter().map(level).collect()
    }

    /// All keyframes as bytes, for instance for the metadata of [`Map::save`].
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = MAGIC.to_vec();
        out.extend_from_slice(&(self.keyframes.len() as u64).to_le_bytes());
        self.keyframes.iter().for_each(|keyframe| keyframe.write(&mut out));
        out
    }

    /// Reads what [`to_bytes`](Self::to_bytes) wrote.
    ///
    /// # Errors
    /// [`Error::CorruptFile`], with the byte.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Error> {
        let mut input = ByteReader::new(bytes, 0, "the keyframes");
        let magic: [u8; 8] = input.array()?;
        if magic != *MAGIC && magic != *OLD_MAGIC {
            return Err(input.bad());
        }
        let mut index = Self::default();
        for _ in 0..input.u64()? {
            index.take(Keyframe::read(&mut input, magic == *MAGIC)?);
        }
        input.end()?;
        index.make_room();
        Ok(index)
    }

    fn make_room(&mut self) {
        while self.bytes > self.max_bytes {
            // Of the older half every other one, then of those that are left.
            let with: Vec<usize> = (0..self.keyframes.len()).filter(|k| self.keyframes[*k].frame.is_some()).collect();
            let older = &with[..with.len().div_ceil(2)];
            if older.is_empty() {
                return;
            }
            for &k in older.iter().skip(usize::from(older.len() > 1)).step_by(2) {
                let keyframe = &mut self.keyframes[k];
                self.bytes -= keyframe.frame.take().map_or(0, |frame| frame.bytes());
                self.thinned += 1;
            }
        }
    }
}

fn check(depth: &DepthView, colour: Option<&ColourView>) -> Result<(), Error> {
    depth.check()?;
    colour.map_or(Ok(()), ColourView::check)
}

/// The features of a frame as keyframes keep them; none without colour.
pub(crate) fn features_of(depth: &DepthView, colour: Option<&ColourView>) -> Result<Vec<Feature>, Error> {
    check(depth, colour)?;
    Ok(features(&reduced_to(FRAME_WIDTH, depth, colour)))
}

fn small_image(depth: &DepthView, colour: Option<&ColourView>) -> Result<SmallImage, Error> {
    check(depth, colour)?;
    Ok(SmallImage::new(&reduced_to(WIDTH, depth, colour)))
}

/// The frame with at most so many columns.
fn reduced_to(columns: usize, depth: &DepthView, colour: Option<&ColourView>) -> ImageLevel {
    let mut level = ImageLevel::default();
    level.read(depth, colour, depth.width.div_ceil(columns).min(depth.height), [1e-3, 1e3]);
    level
}

/// Whether a keyframe at one pose makes another one needless.
pub(crate) fn is_near(a: &Isometry3<f64>, b: &Isometry3<f64>) -> bool {
    let apart = a.inverse() * b;
    apart.translation.vector.norm() < SPACING[0] && apart.rotation.angle() < SPACING[1]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::images::{DepthData, Intrinsics};

    /// Every other one of the older half, but the first: it shows where the scan began.
    #[test]
    fn frames_of_the_older_half_make_room() {
        let data: Vec<f32> = (0..64 * 48).map(|k| 1.0 + 0.01 * (k % 64) as f32).collect();
        let depth = DepthView {
            width: 64,
            height: 48,
            data: DepthData::F32 { data: &data },
            intrinsics: Intrinsics { fx: 60.0, fy: 60.0, cx: 31.5, cy: 23.5 },
        };
        let with = |max_bytes: usize| {
            let mut index = KeyframeIndex::with_budget(max_bytes);
            for k in 0..8 {
                index.push(&depth, None, &Isometry3::translation(0.3 * f64::from(k), 0.0, 0.0)).unwrap();
            }
            index
        };
        let all = with(usize::MAX);
        assert_eq!(all.without_depth(), 0);
        let thinned = with(all.bytes() - 1);
        let kept: Vec<usize> = (0..8).filter(|k| thinned.keyframes[*k].frame.is_some()).collect();
        assert_eq!((kept, thinned.without_depth()), (vec![0, 2, 4, 5, 6, 7], 2));
        assert!(thinned.bytes() < all.bytes());
    }
}
