//! The bytes of a glTF: the binary part, files beside it, data URIs.

use std::path::{Path, PathBuf};

use ::gltf::{Document, buffer, image};

use super::super::fault::Fault;
use super::super::material::TextureSource;

/// All buffers, each at least as long as the document says.
pub(super) fn read(document: &Document, blob: Option<&[u8]>, folder: &Path) -> Result<Vec<Vec<u8>>, Fault> {
    let mut buffers = Vec::new();
    for buffer in document.buffers() {
        let place = format!("buffer {}", buffer.index());
        let fault = |what: String| Fault { place: place.clone(), what };
        let bytes = match buffer.source() {
            buffer::Source::Bin => blob
                .map(<[u8]>::to_vec)
                .ok_or_else(|| fault("is not in the file: export it again as one .glb".into()))?,
            buffer::Source::Uri(uri) => match resolve(uri, folder).map_err(&fault)? {
                Uri::Bytes(bytes) => bytes,
                Uri::File(path) => std::fs::read(&path).map_err(|error| {
                    let path = path.display();
                    fault(format!("{path} cannot be read ({error}): put it beside the mesh, or export one .glb"))
                })?,
            },
        };
        if bytes.len() < buffer.length() {
            return Err(fault(format!(
                "has {} bytes where the document says {}: the file is cut off, export or copy it again",
                bytes.len(),
                buffer.length()
            )));
        }
        buffers.push(bytes);
    }
    Ok(buffers)
}

/// Where a picture of the document is.
pub(super) fn picture(picture: &image::Image, buffers: &[Vec<u8>], folder: &Path) -> Result<TextureSource, Fault> {
    let fault = |what: String| Fault { place: format!("image {}", picture.index()), what };
    match picture.source() {
        image::Source::View { view, .. } => {
            let bytes = view_bytes(&view, buffers).ok_or_else(|| fault("lies beyond the end of its buffer".into()))?;
            Ok(TextureSource::Bytes(bytes.to_vec()))
        }
        image::Source::Uri { uri, .. } => Ok(match resolve(uri, folder).map_err(fault)? {
            Uri::Bytes(bytes) => TextureSource::Bytes(bytes),
            Uri::File(path) => TextureSource::File(path),
        }),
    }
}

/// The bytes of a view; `None` where it ends beyond its buffer.
pub(super) fn view_bytes<'a>(view: &buffer::View, buffers: &'a [Vec<u8>]) -> Option<&'a [u8]> {
    let end = view.offset().checked_add(view.length())?;
    buffers.get(view.buffer().index())?.get(view.offset()..end)
}

enum Uri {
    Bytes(Vec<u8>),
    File(PathBuf),
}

fn resolve(uri: &str, folder: &Path) -> Result<Uri, String> {
    if let Some(data) = uri.strip_prefix("data:") {
        let (_, text) = data.split_once(";base64,").ok_or("is a data URI that is not base64")?;
        return base64(text).map(Uri::Bytes).ok_or_else(|| "is not valid base64".into());
    }
    if uri.contains("://") {
        return Err(format!("is at {uri}: nothing is downloaded, export it into the file"));
    }
    Ok(Uri::File(folder.join(percent_decoded(uri))))
}

/// RFC 4648, with or without padding. A crate for these lines would be one more dependency of the workspace.
fn base64(text: &str) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    let (mut bits, mut count) = (0_u32, 0);
    for c in text.trim_end_matches('=').bytes() {
        let value = match c {
            b'A'..=b'Z' => c - b'A',
            b'a'..=b'z' => c - b'a' + 26,
            b'0'..=b'9' => c - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return None,
        };
        bits = bits << 6 | u32::from(value);
        count += 6;
        if count >= 8 {
            count -= 8;
            bytes.push((bits >> count) as u8);
        }
    }
    Some(bytes)
}

/// RFC 3986; what is no escape stays as it is.
fn percent_decoded(uri: &str) -> String {
    let bytes = uri.as_bytes();
    let (mut decoded, mut k) = (Vec::new(), 0);
    while k < bytes.len() {
        let escape = bytes.get(k + 1..k + 3).filter(|_| bytes[k] == b'%');
        let byte = escape.and_then(|hex| u8::from_str_radix(std::str::from_utf8(hex).ok()?, 16).ok());
        decoded.push(byte.unwrap_or(bytes[k]));
        k += if byte.is_some() { 3 } else { 1 };
    }
    String::from_utf8_lossy(&decoded).into_owned()
}
