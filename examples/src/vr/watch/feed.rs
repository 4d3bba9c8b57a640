//! What a source says, wherever it comes from.

/// A message with the schema that it is encoded by.
pub(super) struct FeedMessage {
    pub(super) topic: String,
    pub(super) schema: String,
    pub(super) data: Vec<u8>,
}

/// Something that was heard.
pub(super) enum Heard {
    Message(FeedMessage),
    /// A sentence of the source itself.
    Said(String),
    /// Nothing comes any more, and why.
    Over(String),
}

/// A source of messages.
pub(super) trait Feed {
    /// What is to be shown by now and was not taken yet; a recording goes on only while it is `playing`.
    fn take(&mut self, playing: bool) -> Option<Heard>;

    /// What the page calls it.
    fn name(&self) -> String;

    /// Seconds since the beginning of a recording; `None` of a run.
    fn elapsed(&self) -> Option<f64>;
}

/// Whether messages with a schema are shown.
pub(super) fn is_shown(schema: &str) -> bool {
    SHOWN.contains(&schema)
}

pub(super) const SCENE: &str = "foxglove.SceneUpdate";
pub(super) const TRANSFORM: &str = "foxglove.FrameTransform";
pub(super) const TRANSFORMS: &str = "foxglove.FrameTransforms";
pub(super) const IMAGE: &str = "foxglove.CompressedImage";
pub(super) const LOG: &str = "foxglove.Log";
const SHOWN: [&str; 5] = [SCENE, TRANSFORM, TRANSFORMS, IMAGE, LOG];
