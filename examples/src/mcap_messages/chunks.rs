//! Compressed chunks of MCAP files: Zstandard and LZ4.

use std::io::{Cursor, Read as _};

use lz4_flex::frame::FrameDecoder as Lz4Frame;
use mcap::sans_io::decompressor::{DecompressResult, Decompressor};
use mcap::{McapError, McapResult};
use ruzstd::decoding::FrameDecoder as ZstdFrame;

/// No block of Zstandard is longer, with the headers before it.
const ZSTD_BLOCK: usize = 128 * 1024 + 3 + 18;
/// Bytes of an LZ4 frame before its first block: magic number, two of flags, checksum; with the content's size and a dictionary's id.
const LZ4_HEADER: [usize; 3] = [7, 8, 4];

/// Chunks compressed with Zstandard.
pub(super) struct Zstd {
    frame: ZstdFrame,
    begun: bool,
}

impl Zstd {
    pub(super) fn new() -> Self {
        Self { frame: ZstdFrame::new(), begun: false }
    }
}

impl Decompressor for Zstd {
    fn next_read_size(&self) -> usize {
        ZSTD_BLOCK
    }

    fn decompress(&mut self, src: &[u8], dst: &mut [u8]) -> McapResult<DecompressResult> {
        if self.begun && self.frame.is_finished() && self.frame.can_collect() == 0 {
            *self = Self::new();
        }
        let decoded = self.frame.decode_from_to(src, dst);
        let (consumed, wrote) = decoded.map_err(|error| McapError::DecompressionError(error.to_string()))?;
        self.begun = true;
        Ok(DecompressResult { consumed, wrote })
    }

    fn reset(&mut self) -> McapResult<()> {
        *self = Self::new();
        Ok(())
    }

    fn name(&self) -> &'static str {
        "zstd"
    }
}

/// Chunks compressed with LZ4 frames. A frame is collected first: its decoder cannot go on where its input ends in between.
pub(super) enum Lz4 {
    Collecting(Vec<u8>),
    Reading(Box<Lz4Frame<Cursor<Vec<u8>>>>),
}

impl Lz4 {
    pub(super) fn new() -> Self {
        Self::Collecting(Vec::new())
    }
}

impl Decompressor for Lz4 {
    fn next_read_size(&self) -> usize {
        0
    }

    fn decompress(&mut self, src: &[u8], dst: &mut [u8]) -> McapResult<DecompressResult> {
        let mut consumed = 0;
        loop {
            if let Self::Collecting(frame) = self {
                let before = frame.len();
                frame.extend_from_slice(&src[consumed..]);
                let Some(end) = frame_end(frame) else { return Ok(DecompressResult { consumed: src.len(), wrote: 0 }) };
                frame.truncate(end);
                consumed += end.saturating_sub(before);
                *self = Self::Reading(Box::new(Lz4Frame::new(Cursor::new(std::mem::take(frame)))));
            }
            let Self::Reading(frame) = self else { return Ok(DecompressResult { consumed, wrote: 0 }) };
            let wrote = frame.read(dst).map_err(|error| McapError::DecompressionError(error.to_string()))?;
            if wrote > 0 || dst.is_empty() {
                return Ok(DecompressResult { consumed, wrote });
            }
            // The frame has ended; another one may follow.
            *self = Self::new();
        }
    }

    fn reset(&mut self) -> McapResult<()> {
        *self = Self::new();
        Ok(())
    }

    fn name(&self) -> &'static str {
        "lz4"
    }
}

/// Length of the LZ4 frame that begins here; `None` if it goes on. What is no frame is for the decoder to refuse.
fn frame_end(bytes: &[u8]) -> Option<usize> {
    let flags = *bytes.get(4)?;
    let [block_checksum, has_size, content_checksum, has_dictionary] =
        [4, 3, 2, 0].map(|bit| usize::from(flags >> bit & 1));
    let mut at = LZ4_HEADER[0] + has_size * LZ4_HEADER[1] + has_dictionary * LZ4_HEADER[2];
    loop {
        let size = u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?);
        at += 4;
        if size == 0 {
            let end = at + 4 * content_checksum;
            return (bytes.len() >= end).then_some(end);
        }
        // The highest bit marks a block that is not compressed.
        at += (size & 0x7fff_ffff) as usize + 4 * block_checksum;
        if at > bytes.len() {
            return None;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use super::*;

    /// All of a compressed text, in pieces of input and output of given lengths; as the reader does it, all input that is left is
    /// offered again.
    fn decompressed(decoder: &mut dyn Decompressor, compressed: &[u8], size: usize, pieces: [usize; 2]) -> Vec<u8> {
        let (mut from, mut offered, mut out) = (0, 0, vec![0; size]);
        let mut to = 0;
        while to < size {
            offered = (offered + pieces[0].max(decoder.next_read_size())).min(compressed.len());
            let end = (to + pieces[1]).min(size);
            let result = decoder.decompress(&compressed[from..offered], &mut out[to..end]).unwrap();
            from += result.consumed;
            to += result.wrote;
            assert!(result.wrote > 0 || result.consumed > 0 || offered < compressed.len(), "stuck at {to}");
        }
        decoder.reset().unwrap();
        out
    }

    #[test]
    fn chunks_are_decompressed_in_pieces_of_any_length() {
        let text: Vec<u8> = (0..300_000_u32).map(|k| (k.wrapping_mul(k) >> 11) as u8 & 0x1f).collect();
        let half = text.len() / 2;
        let lz4 = |part: &[u8]| {
            let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
            encoder.write_all(part).unwrap();
            encoder.finish().unwrap()
        };
        let zstd = |part: &[u8]| ruzstd::encoding::compress_to_vec(part, ruzstd::encoding::CompressionLevel::Fastest);
        // One frame, and two after one another.
        let parts = [&text[..half], &text[half..]];
        for (by_lz4, by_zstd) in [(lz4(&text), zstd(&text)), (parts.map(lz4).concat(), parts.map(zstd).concat())] {
            for pieces in [[1000, 70_000], [70_000, 1000], [1 << 20, 1 << 20]] {
                assert_eq!(decompressed(&mut Lz4::new(), &by_lz4, text.len(), pieces), text, "lz4 {pieces:?}");
                assert_eq!(decompressed(&mut Zstd::new(), &by_zstd, text.len(), pieces), text, "zstd {pieces:?}");
            }
        }
        // Cut off: no text comes of it, and no panic.
        let cut = lz4(&text);
        let result = Lz4::new().decompress(&cut[..cut.len() - 5], &mut [0; 10]).unwrap();
        assert_eq!((result.consumed, result.wrote), (cut.len() - 5, 0));
    }
}
