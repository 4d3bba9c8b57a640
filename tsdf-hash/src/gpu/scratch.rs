//! Buffers of a frame or a view, which grow when they must.

use wgpu::{Buffer, BufferUsages};

use crate::error::Error;
use crate::gpu::device::Device;

/// Workgroups along one side of a dispatch.
const MOST_GROUPS: usize = 65535;

/// A buffer that exists once it was asked for.
pub(super) struct Scratch {
    label: &'static str,
    usage: BufferUsages,
    buffer: Option<Buffer>,
}

impl Scratch {
    pub(super) fn new(label: &'static str, usage: BufferUsages) -> Self {
        Self { label, usage, buffer: None }
    }

    /// The buffer, with `bytes` at least; a larger one, whose contents are nothing, takes its place where it must.
    pub(super) fn of(&mut self, device: &Device, bytes: usize) -> Result<&Buffer, Error> {
        let fitting = self.buffer.take().filter(|buffer| buffer.size() >= bytes as u64);
        let buffer = fitting.map_or_else(
            || {
                // Room for a little more, within what the device can bind.
                let roomy = bytes.next_power_of_two().clamp(256, device.binding_bytes.max(256));
                device.buffer(self.label, roomy.max(bytes), self.usage)
            },
            Ok,
        )?;
        Ok(self.buffer.insert(buffer))
    }
}

/// Workgroups in two dimensions for this many pieces of work; some may be left over.
pub(super) fn spread(pieces: usize) -> [u32; 2] {
    let across = pieces.clamp(1, MOST_GROUPS);
    [across as u32, pieces.div_ceil(across) as u32]
}
