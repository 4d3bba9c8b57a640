//! What the page of a design and the program say to each other: text is JSON. Binary messages are a head in JSON and bytes after it: from the page the length
//! of the head (u32, little-endian), the head, and a picture file; to the page a kind, three zeros, and the same, padded to a multiple of four.

use serde::{Deserialize, Serialize};

use super::design_error::DesignError;

/// Version of everything here; the page reloads itself where it differs.
pub(super) const PROTOCOL: u32 = 1;
/// Kinds of binary messages to the page.
pub(super) const SURFACE: u8 = 1;
pub(super) const ESTIMATE: u8 = 2;
pub(super) const PICTURE: u8 = 3;

/// From the page: a change, numbered in rising order.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PageMessage {
    pub(super) number: u64,
    pub(super) change: Change,
}

/// The head of a dropped picture.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PictureHead {
    pub(super) number: u64,
    /// Name of its file.
    pub(super) name: String,
}

/// What the person does.
#[derive(Debug, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum Change {
    /// Where the picture lies: its middle right of and above that of the surface, width, metres; turn counter-clockwise, rad.
    Place { offset: [f64; 2], size: f64, rotate: f64 },
    /// `cmyk`, `six`, `spot:N`, or `one:NAME`.
    Palette { name: String },
    /// `sandstone`, `#rrggbb` and so on; nothing for what is usual.
    Wall { name: Option<String> },
    /// The part to paint, on the surface of this number.
    Region { surface: u64, part: Part },
    /// Paint all of it.
    WholeSurface,
    /// A part more that stays clean.
    KeepClean { surface: u64, part: Part },
    /// The latest of them is painted after all.
    UndoClean,
    /// Write the mission.
    Write,
    /// It was the last.
    End,
}

/// A part of the surface about a point of it; world frame, metres.
#[derive(Debug, Clone, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum Part {
    /// As far as no crease.
    Pick { point: [f64; 3] },
    /// What lies within a radius and faces the same side.
    Disc { point: [f64; 3], normal: [f64; 3], radius: f64 },
}

/// To the page.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub(super) enum Reply {
    /// The first message.
    Hello { protocol: u32, key: String, name: String, folder: String, palettes: Vec<String>, walls: Vec<String> },
    /// The design as it is now.
    State(DesignState),
    /// Something was wrong with what the page said, or cannot be painted.
    Error { text: String },
    /// The mission is written.
    Written { mission: String },
    /// The program ends.
    Ended { folder: String },
}

/// The design as it is now.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct DesignState {
    /// The latest change.
    pub(super) number: u64,
    pub(super) picture: Option<PictureState>,
    pub(super) palette: String,
    pub(super) wall: Option<String>,
    pub(super) region: Option<String>,
    pub(super) keep_clean: Vec<String>,
}

/// The picture on the surface.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct PictureState {
    pub(super) name: String,
    /// Width over height.
    pub(super) aspect: f64,
    /// As in [`Change::Place`].
    pub(super) offset: [f64; 2],
    pub(super) size: f64,
    pub(super) rotate: f64,
}

/// A picture file of the page: its head, and its bytes.
pub(super) fn read_picture(message: &[u8]) -> Result<(PictureHead, &[u8]), DesignError> {
    let cut = || DesignError::Malformed("a picture without a head".into());
    let (length, rest) = message.split_first_chunk::<4>().ok_or_else(cut)?;
    let length = usize::try_from(u32::from_le_bytes(*length)).map_err(|_| cut())?;
    let (head, bytes) = rest.split_at_checked(length).ok_or_else(cut)?;
    let head = serde_json::from_slice(head).map_err(|error| DesignError::Malformed(error.to_string()))?;
    Ok((head, bytes))
}

/// A binary message to the page: a kind, a head, and what follows it.
pub(super) fn with_head(kind: u8, head: &impl Serialize, body: &[u8]) -> Vec<u8> {
    // These types have no maps with keys that are no text, the only thing that JSON cannot say.
    let mut head = serde_json::to_vec(head).unwrap_or_default();
    head.resize(head.len().next_multiple_of(4), b' ');
    let mut bytes = vec![kind, 0, 0, 0];
    bytes.extend_from_slice(&(head.len() as u32).to_le_bytes());
    bytes.extend_from_slice(&head);
    bytes.extend_from_slice(body);
    bytes
}
