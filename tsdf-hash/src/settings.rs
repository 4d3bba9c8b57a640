//! How fine, how far, how much memory.

use crate::blocks::voxel_block::SIDE;
use crate::error::Error;

/// Axial noise of a depth camera: `σ(z) = base + quadratic (z − nearest)²`, metres.
///
/// It sets the weight of an observation and what counts as a depth edge.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct NoiseModel {
    /// Standard deviation at `nearest`, metres (Nguyen, Izadi, Lovell 2012: 0.0012).
    pub base: f64,
    /// Growth, per metre (same source: 0.0019).
    pub quadratic: f64,
    /// Depth at which the noise is least, metres (same source: 0.4).
    pub nearest: f64,
}

impl NoiseModel {
    /// Standard deviation at a depth, metres.
    pub(crate) fn deviation(&self, depth: f64) -> f64 {
        self.base + self.quadratic * (depth - self.nearest).powi(2)
    }
}

impl Default for NoiseModel {
    fn default() -> Self {
        Self { base: 0.0012, quadratic: 0.0019, nearest: 0.4 }
    }
}

/// Where blocks are evicted to that active memory has no room for, or that have not been updated for long (thesis Paper I,
/// section 4.3).
///
/// RAM and disk have hard caps in bytes. A lost camera has a map of its own for some frames, and the search for loops two: each has caps of
/// the same size, without disk. By default nothing is evicted, and a map that outgrows [`Settings::max_bytes`]
/// refuses frames.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct MemoryLimits {
    /// Cap of the evicted blocks in RAM and of the index of all evicted blocks, of 150 bytes each at most. 0, the default,
    /// means that nothing is evicted; otherwise 65536 at least.
    pub host_bytes: usize,
    /// Cap of the swap file ([`Map::with_swap`](crate::Map::with_swap)); 0, the default: none.
    pub disk_bytes: u64,
    /// `t_old`: blocks that no frame has updated for longer are evicted, seconds (not printed; ours: 2).
    pub max_age: f64,
    /// Most blocks that are evicted by age, and most that are reloaded, per frame (not printed; ours: 1024).
    pub max_transfers: usize,
    /// How long reloaded blocks wait for the caller's decision ([`MergePolicy`](crate::storage::MergePolicy)) before they are merged
    /// without one, seconds (not in the paper, which merges in one place and waits in another; 0, the default: merged at
    /// once).
    pub merge_timeout: f64,
}

impl Default for MemoryLimits {
    fn default() -> Self {
        Self { host_bytes: 0, disk_bytes: 0, max_age: 2.0, max_transfers: 1024, merge_timeout: 0.0 }
    }
}

/// Settings of a [`Map`](crate::Map). They cannot change while it lives: exact de-integration depends on them.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct Settings {
    /// Edge of a voxel, metres (thesis Paper I, section 6: 0.01).
    pub voxel_size: f64,
    /// Truncation distance `μ` in voxels (not printed; the usual 4).
    pub truncation_voxels: f64,
    /// How far in front of a measured surface space counts as free, metres; up to `μ` it does anyhow (ours: 0, no farther).
    /// What has moved away is carved out, at the price of blocks for all that space. A camera's whole view: `max_depth`.
    pub carve: f64,
    /// Nearest depth that is fused, metres (ours: 0.2).
    pub min_depth: f64,
    /// Farthest depth that is fused, metres (ours: 6; the noise of a structured-light camera reaches 6 cm there).
    pub max_depth: f64,
    /// Hard cap on the bytes of active memory: blocks, hash table, and a sixteenth of it, 256 blocks at most, to work with (ours: 512 MiB; thesis Paper I, section 6.1, runs in 300-600 MB).
    pub max_bytes: usize,
    /// Threads used inside one call; 1 spawns none. Results do not depend on it.
    pub threads: usize,
    /// Memory besides the active one.
    pub memory: MemoryLimits,
    /// Noise of the depth camera.
    pub noise: NoiseModel,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            voxel_size: 0.01,
            truncation_voxels: 4.0,
            carve: 0.0,
            min_depth: 0.2,
            max_depth: 6.0,
            max_bytes: 512 << 20,
            threads: 1,
            memory: MemoryLimits::default(),
            noise: NoiseModel::default(),
        }
    }
}

impl Settings {
    /// Truncation distance `μ`, metres.
    pub fn truncation(&self) -> f64 {
        self.truncation_voxels * self.voxel_size
    }

    /// Of a small map beside one of these settings, with caps of the same size: it evicts where that one does, to RAM only, and what comes
    /// back is merged at once.
    pub(crate) fn beside(&self) -> Self {
        let memory = MemoryLimits { disk_bytes: 0, merge_timeout: 0.0, ..self.memory };
        Self { memory, ..*self }
    }

    /// How far in front of a measured depth voxels are touched, metres.
    pub(crate) fn front(&self) -> f64 {
        self.truncation().max(self.carve)
    }

    /// Edge of a block, metres.
    pub(crate) fn block_size(&self) -> f64 {
        self.voxel_size * SIDE as f64
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        let within = |name, value: f64, lo: f64, hi: f64, requirement| {
            // A comparison that a NaN fails.
            if value >= lo && value <= hi { Ok(()) } else { Err(Error::InvalidSetting { name, value, requirement }) }
        };
        within("voxel_size", self.voxel_size, 1e-4, 10.0, "1e-4..=10 metres")?;
        within("truncation_voxels", self.truncation_voxels, 1.0, 64.0, "1..=64 voxels")?;
        within("carve", self.carve, 0.0, 1e3, "0..=1000 metres")?;
        within("min_depth", self.min_depth, 1e-3, 1e3, "0.001..=1000 metres")?;
        within("max_depth", self.max_depth, 1e-3, 1e3, "0.001..=1000 metres")?;
        within("max_depth", self.max_depth - self.min_depth, 1e-6, 1e3, "larger than min_depth")?;
        within("threads", self.threads as f64, 1.0, 1024.0, "1..=1024")?;
        let memory = &self.memory;
        let least = if memory.host_bytes == 0 { 0.0 } else { 65536.0 };
        within("memory.host_bytes", memory.host_bytes as f64, least, f64::MAX, "0, or 65536 and more")?;
        let disk = if memory.host_bytes == 0 { 0.0 } else { f64::MAX };
        within(
            "memory.disk_bytes",
            memory.disk_bytes as f64,
            0.0,
            disk,
            "0 without memory.host_bytes, which holds its index",
        )?;
        within("memory.max_age", memory.max_age, 0.0, f64::MAX, "0 seconds or more")?;
        within("memory.merge_timeout", memory.merge_timeout, 0.0, f64::MAX, "0 seconds or more")?;
        within("noise.base", self.noise.base, 1e-9, 10.0, "1e-9..=10 metres")?;
        within("noise.quadratic", self.noise.quadratic, 0.0, 10.0, "0..=10 per metre")?;
        within("noise.nearest", self.noise.nearest, 0.0, 1e3, "0..=1000 metres")
    }
}
