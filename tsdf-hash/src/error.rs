//! What can be wrong with an input.

/// An error of a caller's own code.
pub type BoxedError = Box<dyn std::error::Error + Send + Sync>;

/// Everything this crate can refuse. Nothing of the map has changed when an error is returned.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A field of [`Settings`](crate::Settings) is out of its range.
    #[error("settings: {name} = {value} is refused: it must be {requirement}")]
    InvalidSetting {
        /// The field.
        name: &'static str,
        /// What it held.
        value: f64,
        /// What it must hold.
        requirement: &'static str,
    },
    /// An image has no pixels, or more than 16384 in one direction.
    #[error("the {image} image is {width} x {height} pixels: both sides must lie in 1..=16384")]
    InvalidSize {
        /// `"depth"` or `"colour"`.
        image: &'static str,
        /// Its width in pixels.
        width: usize,
        /// Its height in pixels.
        height: usize,
    },
    /// A pixel slice does not fit its width and height.
    #[error("the {image} image holds {found} values where its width and height ask for {expected}")]
    WrongLength {
        /// `"depth"` or `"colour"`.
        image: &'static str,
        /// Values asked for by width and height.
        expected: usize,
        /// Values in the slice.
        found: usize,
    },
    /// Intrinsics that are not finite, or a focal length of zero.
    #[error("the {image} intrinsics have {name} = {value}: focal lengths must be finite and not zero, centres finite")]
    InvalidIntrinsics {
        /// `"depth"` or `"colour"`.
        image: &'static str,
        /// The field.
        name: &'static str,
        /// What it held.
        value: f64,
    },
    /// A depth scale that is not finite and positive.
    #[error("depth scale = {scale} units per metre: give a finite, positive one (1000 for millimetres)")]
    InvalidScale {
        /// The scale as given.
        scale: f64,
    },
    /// A pose with a non-finite entry or a quaternion that is not of unit length.
    #[error("world_from_camera is not a rigid motion: {what}")]
    InvalidPose {
        /// What is wrong with it.
        what: &'static str,
    },
    /// No pixel of the image can be fused.
    #[error(
        "nothing to fuse: {valid} pixels lie inside min_depth..max_depth and none of them on a smooth 3x3 patch; \
         check the depth scale, the range, or skip the frame"
    )]
    NoDepth {
        /// Pixels with a depth inside the range.
        valid: usize,
    },
    /// A surface point so far from the origin that its block cannot be named.
    #[error("the frame reaches blocks beyond ±2^20 of the origin: check world_from_camera, or shift the world")]
    OutOfRange,
    /// The frame needs more memory than `max_bytes` allows.
    #[error("the frame does not fit: the map holds {used} of {max_bytes} bytes; raise max_bytes or enlarge voxel_size")]
    OutOfBudget {
        /// Bytes the map holds, [`Map::bytes`](crate::Map::bytes).
        used: usize,
        /// The cap, [`Settings::max_bytes`](crate::Settings::max_bytes).
        max_bytes: usize,
    },
    /// Neither active memory nor the memory for evicted blocks has room for the frame.
    #[error(
        "evicted blocks fill {host_bytes} bytes in RAM and {disk_bytes} on disk: raise memory.host_bytes or \
         memory.disk_bytes, or enlarge voxel_size"
    )]
    StorageFull {
        /// Bytes of evicted blocks in RAM.
        host_bytes: usize,
        /// Bytes of the swap file.
        disk_bytes: u64,
    },
    /// A time that is not finite or not later than that of the frame before.
    #[error("the frame was taken at {time} s, the last one at {last} s: times must be finite and increase")]
    InvalidTime {
        /// Its time, seconds.
        time: f64,
        /// The time of the last frame that was fused, or sample, seconds.
        last: f64,
    },
    /// A sample of a sensor that is not finite.
    #[error("the {what} at {stamp} s is not finite: leave the sample out")]
    InvalidSample {
        /// What it measures.
        what: &'static str,
        /// Seconds.
        stamp: f64,
    },
    /// A frame could not be read a second time.
    #[error("frame {frame} cannot be read again: {source}")]
    FrameSource {
        /// Its number.
        frame: usize,
        /// What the source says.
        source: BoxedError,
    },
    /// What is stored with a map makes no sense.
    #[error("the map's metadata \"{key}\" makes no sense: {why}")]
    InvalidMetadata {
        /// Which of them.
        key: &'static str,
        /// What was expected, and found.
        why: String,
    },
    /// A cap on the swap file without such a file, or the other way round.
    #[error("memory.disk_bytes = {disk_bytes}: a map with a swap file is made by with_swap, one without by new")]
    SwapFileMismatch {
        /// [`MemoryLimits::disk_bytes`](crate::storage::MemoryLimits::disk_bytes).
        disk_bytes: u64,
    },
    /// An evicted or stored block is not what was put there.
    #[error("{what} is corrupt: block {block:?} cannot be read")]
    CorruptBlock {
        /// Where it was read from.
        what: &'static str,
        /// Block coordinates.
        block: [i32; 3],
    },
    /// A file that is no map of this crate.
    #[error("the file is no map: {what} (byte {offset})")]
    NotAMapFile {
        /// Why.
        what: &'static str,
        /// Where it shows, bytes from the start.
        offset: u64,
    },
    /// A map's file of another version of the format.
    #[error(
        "the map's file is of version {found} (byte 8), this crate reads version {known}: save it again with the release \
         that wrote it, as a mesh, or scan anew"
    )]
    UnsupportedVersion {
        /// Its version.
        found: u32,
        /// The one that can be read.
        known: u32,
    },
    /// A map's file that is too short.
    #[error("the map's file ends at byte {found} instead of {expected}: it was not copied as a whole")]
    Truncated {
        /// Its length as it should be, bytes.
        expected: u64,
        /// Its length.
        found: u64,
    },
    /// A map's file that is not as it was written.
    #[error("the map's file is corrupt: {what} at byte {offset}")]
    CorruptFile {
        /// The part that is corrupt.
        what: &'static str,
        /// Where it begins, or where reading it failed, bytes from the start.
        offset: u64,
    },
    /// A map cannot be continued with settings that would make its sums mean something else.
    #[error(
        "the map was made with another voxel size, truncation, carving, depth range or noise: only memory and threads may change"
    )]
    IncompatibleSettings,
    /// Reading or writing a file failed.
    #[error("{what}: {source}")]
    Io {
        /// What was done.
        what: &'static str,
        /// Why.
        source: std::io::Error,
    },
    /// A voxel has taken all the observations its counters can hold without losing exactness.
    #[error("block {block:?} is saturated (weight 65535 or 1040 coloured frames): fuse fewer frames of this place")]
    Saturated {
        /// Block coordinates (one of those that are full).
        block: [i32; 3],
    },
    /// The frame to take out was never put in, or not with this pose, colour or these settings.
    #[error("block {block:?} does not contain this frame: de-integrate with exactly what was integrated")]
    NotIntegrated {
        /// Block coordinates (one of those that do not contain it).
        block: [i32; 3],
    },
    /// A factor of a pose graph makes no sense.
    #[cfg(feature = "pose-graph")]
    #[error("{factor} factor {index} of the pose graph: {what}")]
    InvalidFactor {
        /// `"between"` or `"prior"`.
        factor: &'static str,
        /// Which of them.
        index: usize,
        /// What is wrong with it.
        what: &'static str,
    },
    /// Nothing fixes a pose of a graph.
    #[cfg(feature = "pose-graph")]
    #[error("pose {pose} of the graph is not constrained: {why}")]
    UnconstrainedPose {
        /// Its index.
        pose: usize,
        /// Why.
        why: &'static str,
    },
    /// The factors of a pose graph leave a direction open.
    #[cfg(feature = "pose-graph")]
    #[error("the pose graph has no unique minimum: some information is singular; add factors or a prior")]
    SingularGraph,
    /// A pose graph does not fit into memory.
    #[cfg(feature = "pose-graph")]
    #[error("a graph of {poses} free poses is too large to be factorised")]
    GraphTooLarge {
        /// Poses that are not fixed.
        poses: usize,
    },
    /// A line of g2o's text makes no sense.
    #[cfg(feature = "pose-graph")]
    #[error("g2o text, line {line}: {why}")]
    MalformedG2o {
        /// Counted from 1.
        line: usize,
        /// What was expected, and found.
        why: String,
    },
    /// No GPU can be used; [`Map`](crate::Map) works without one.
    #[error("no GPU: {reason}")]
    NoAdapter {
        /// What was found instead.
        reason: String,
    },
    /// The GPU refused something or is lost.
    #[cfg(feature = "gpu")]
    #[error("the GPU failed: {what}")]
    Device {
        /// What its driver said.
        what: String,
    },
    /// Writing a mesh failed.
    #[error("writing the mesh: {0}")]
    Write(#[from] std::io::Error),
}
