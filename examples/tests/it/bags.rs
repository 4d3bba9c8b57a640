//! MCAP files of our own making: messages of ROS 2 by the rules of their encoding, and chunks compressed by other writers.

use std::path::Path;

use vio_ekf::Stamp;

/// An MCAP file with the same messages in compressed chunks.
pub(crate) fn recompress(from: &Path, to: &Path, compression: &str) {
    let bytes = std::fs::read(from).unwrap();
    let mut plain = mcap::WriteOptions::new().compression(None).create(std::io::Cursor::new(Vec::new())).unwrap();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        plain.write(&message.unwrap()).unwrap();
    }
    plain.finish().unwrap();
    let plain = plain.into_inner().into_inner();
    // Its chunks one by one: opcode 6, a header of 8+8+8+4 bytes, the compression's name, the length of what follows.
    let (mut at, mut out) = (8, plain[..8].to_vec());
    while at + 9 <= plain.len() - 8 {
        let length = u64::from_le_bytes(plain[at + 1..at + 9].try_into().unwrap()) as usize;
        let (record, next) = (&plain[at + 9..at + 9 + length], at + 9 + length);
        match plain[at] {
            6 => {
                let content = &record[28 + 4 + 8..];
                let packed = match compression {
                    "lz4" => {
                        let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
                        std::io::Write::write_all(&mut encoder, content).unwrap();
                        encoder.finish().unwrap()
                    }
                    _ => ruzstd::encoding::compress_to_vec(content, ruzstd::encoding::CompressionLevel::Fastest),
                };
                let mut chunk = record[..28].to_vec();
                chunk.extend((compression.len() as u32).to_le_bytes());
                chunk.extend(compression.as_bytes());
                chunk.extend((packed.len() as u64).to_le_bytes());
                chunk.extend(packed);
                out.push(6);
                out.extend((chunk.len() as u64).to_le_bytes());
                out.extend(chunk);
            }
            // The end of the data, and nothing after it: the indices would point elsewhere.
            15 => {
                out.extend([15, 4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
                out.extend([2, 20, 0, 0, 0, 0, 0, 0, 0]);
                out.extend([0; 20]);
                break;
            }
            7 => {}
            _ => out.extend(&plain[at..next]),
        }
        at = next;
    }
    out.extend(&plain[..8]);
    std::fs::write(to, out).unwrap();
}

/// `std_msgs/Header` as the encoding's rules have it, little endian, after its four bytes; `put` then aligns what follows.
pub(crate) fn ros_header(stamp: Stamp, frame: &str) -> Vec<u8> {
    let mut bytes = vec![0, 1, 0, 0];
    bytes.extend(((stamp.nanos() / 1_000_000_000) as i32).to_le_bytes());
    bytes.extend(((stamp.nanos() % 1_000_000_000) as u32).to_le_bytes());
    put_blob(&mut bytes, &[frame.as_bytes(), &[0]].concat());
    bytes
}

pub(crate) fn put<const N: usize>(bytes: &mut Vec<u8>, number: [u8; N]) {
    bytes.resize(4 + (bytes.len() - 4).next_multiple_of(N), 0);
    bytes.extend(number);
}

pub(crate) fn put_blob(bytes: &mut Vec<u8>, blob: &[u8]) {
    put(bytes, (blob.len() as u32).to_le_bytes());
    bytes.extend(blob);
}
