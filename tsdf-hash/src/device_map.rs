//! A map on the processor or on a GPU, by one constructor.

use std::collections::BTreeMap;
use std::path::Path;

use crate::dense_map::DenseMap;
use crate::error::Error;
#[cfg(feature = "gpu")]
use crate::gpu::gpu_map::GpuMap;
#[cfg(feature = "gpu")]
use crate::gpu::options::GpuOptions;
use crate::map::Map;
use crate::mesh::triangle_mesh::Mesh;
use crate::report::MemoryUsage;

/// Which device keeps a map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Device {
    /// The processor.
    #[default]
    Cpu,
    /// A GPU where there is one and the crate has its feature `gpu`, else the processor.
    Auto,
    /// A GPU, a software one such as Mesa's included, or none.
    Gpu,
}

/// A map on one of the devices. Both are the same map, to the bit.
pub enum DeviceMap {
    /// On the processor.
    Cpu(Box<Map>),
    /// On a GPU.
    #[cfg(feature = "gpu")]
    Gpu(Box<GpuMap>),
}

impl DeviceMap {
    /// The map on a device; and why it is on the processor, if a GPU was to be taken where there is one.
    ///
    /// # Errors
    /// With [`Device::Gpu`], those of `GpuMap::from_map`; without the feature `gpu`, [`Error::NoAdapter`].
    pub fn open(map: Map, device: Device) -> Result<(Self, Option<Error>), Error> {
        match device {
            Device::Cpu => Ok((Self::Cpu(Box::new(map)), None)),
            Device::Auto | Device::Gpu => Self::on_gpu(map, device == Device::Gpu),
        }
    }

    /// The map on the GPU that the options choose, or on the processor where that does not work; then with the reason.
    #[cfg(feature = "gpu")]
    pub fn on_adapter(map: Map, options: &GpuOptions) -> (Self, Option<Error>) {
        match GpuMap::from_map(map, options) {
            Ok(on_gpu) => (Self::Gpu(Box::new(on_gpu)), None),
            Err(refused) => {
                let (map, why) = *refused;
                (Self::Cpu(Box::new(map)), Some(why))
            }
        }
    }

    #[cfg(feature = "gpu")]
    fn on_gpu(map: Map, demanded: bool) -> Result<(Self, Option<Error>), Error> {
        match Self::on_adapter(map, &GpuOptions { software: demanded, ..GpuOptions::default() }) {
            (Self::Cpu(_), Some(why)) if demanded => Err(why),
            opened => Ok(opened),
        }
    }

    #[cfg(not(feature = "gpu"))]
    fn on_gpu(map: Map, demanded: bool) -> Result<(Self, Option<Error>), Error> {
        let missing = || Error::NoAdapter { reason: "the crate was built without its feature `gpu`".into() };
        if demanded { Err(missing()) } else { Ok((Self::Cpu(Box::new(map)), None)) }
    }

    /// The map, whatever keeps it.
    pub fn dense(&self) -> &dyn DenseMap {
        match self {
            Self::Cpu(map) => map.as_ref(),
            #[cfg(feature = "gpu")]
            Self::Gpu(map) => map.as_ref(),
        }
    }

    /// The map, to be changed.
    pub fn dense_mut(&mut self) -> &mut dyn DenseMap {
        match self {
            Self::Cpu(map) => map.as_mut(),
            #[cfg(feature = "gpu")]
            Self::Gpu(map) => map.as_mut(),
        }
    }

    /// The map, if the processor keeps it.
    #[cfg_attr(not(feature = "gpu"), allow(clippy::unnecessary_wraps, reason = "a map on a GPU must be fetched"))]
    pub fn cpu(&self) -> Option<&Map> {
        match self {
            Self::Cpu(map) => Some(map),
            #[cfg(feature = "gpu")]
            Self::Gpu(_) => None,
        }
    }

    /// Where the blocks are, and the bytes they take.
    pub fn memory(&self) -> MemoryUsage {
        match self {
            Self::Cpu(map) => map.memory(),
            #[cfg(feature = "gpu")]
            Self::Gpu(map) => map.memory(),
        }
    }

    /// Name, interface and driver of the GPU, or `cpu`.
    pub fn device(&self) -> &str {
        match self {
            Self::Cpu(_) => "cpu",
            #[cfg(feature = "gpu")]
            Self::Gpu(map) => map.adapter(),
        }
    }

    /// Writes the whole map to a file, as [`Map::save`].
    ///
    /// # Errors
    /// As [`Map::save`], and [`Error::Device`](crate::Error).
    pub fn save(&self, path: &Path, mesh: Option<&Mesh>, metadata: &BTreeMap<String, Vec<u8>>) -> Result<(), Error> {
        match self {
            Self::Cpu(map) => map.save(path, mesh, metadata),
            #[cfg(feature = "gpu")]
            Self::Gpu(map) => map.save(path, mesh, metadata),
        }
    }

    /// The map on the processor; one of a GPU as `GpuMap::into_map` says.
    ///
    /// # Errors
    /// [`Error::Device`](crate::Error), and those of evicted blocks.
    #[cfg_attr(not(feature = "gpu"), allow(clippy::unnecessary_wraps, reason = "a map on a GPU must be fetched"))]
    pub fn into_map(self) -> Result<Map, Error> {
        match self {
            Self::Cpu(map) => Ok(*map),
            #[cfg(feature = "gpu")]
            Self::Gpu(map) => map.into_map(),
        }
    }
}
