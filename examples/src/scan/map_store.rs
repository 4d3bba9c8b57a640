//! Where the map of a run is kept.

use tsdf_hash::{DenseMap, Map, Settings};
#[cfg(feature = "gpu")]
use tsdf_hash::{GpuMap, GpuOptions};

use super::error::ScanError;

/// Which device keeps the map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Device {
    /// The GPU where there is one, with a line that says so if there is none.
    Auto,
    /// The processor.
    Cpu,
    /// A GPU, Mesa's software one included, or no run.
    Gpu,
}

/// A map on one of the devices.
pub(super) enum MapStore {
    Cpu(Box<Map>),
    #[cfg(feature = "gpu")]
    Gpu(Box<GpuMap>),
}

impl MapStore {
    pub(super) fn open(map: Map, device: Device) -> Result<Self, ScanError> {
        match device {
            Device::Cpu => Ok(Self::Cpu(Box::new(map))),
            Device::Auto | Device::Gpu => Self::on_gpu(map, device == Device::Gpu),
        }
    }

    #[cfg(feature = "gpu")]
    fn on_gpu(map: Map, demanded: bool) -> Result<Self, ScanError> {
        let options = GpuOptions { software: demanded, ..GpuOptions::default() };
        match GpuMap::from_map(&map, &options) {
            Ok(on_gpu) => Ok(Self::Gpu(Box::new(on_gpu))),
            Err(error @ (tsdf_hash::Error::NoAdapter { .. } | tsdf_hash::Error::Device { .. })) if !demanded => {
                eprintln!("mapping on the processor: {error}");
                Ok(Self::Cpu(Box::new(map)))
            }
            Err(error) => Err(error.into()),
        }
    }

    #[cfg(not(feature = "gpu"))]
    fn on_gpu(map: Map, demanded: bool) -> Result<Self, ScanError> {
        if demanded { Err(ScanError::NoGpu) } else { Ok(Self::Cpu(Box::new(map))) }
    }

    pub(super) fn dense(&mut self) -> &mut dyn DenseMap {
        match self {
            Self::Cpu(map) => map.as_mut(),
            #[cfg(feature = "gpu")]
            Self::Gpu(map) => map.as_mut(),
        }
    }

    /// The map, if the processor keeps it.
    #[cfg_attr(not(feature = "gpu"), allow(clippy::unnecessary_wraps, reason = "a map on a GPU must be fetched"))]
    pub(super) fn map(&self) -> Option<&Map> {
        match self {
            Self::Cpu(map) => Some(map),
            #[cfg(feature = "gpu")]
            Self::Gpu(_) => None,
        }
    }

    pub(super) fn settings(&self) -> &Settings {
        match self {
            Self::Cpu(map) => map.settings(),
            #[cfg(feature = "gpu")]
            Self::Gpu(map) => map.settings(),
        }
    }

    pub(super) fn device(&self) -> String {
        match self {
            Self::Cpu(_) => "cpu".into(),
            #[cfg(feature = "gpu")]
            Self::Gpu(map) => map.adapter().into(),
        }
    }

    /// The map in the processor's memory.
    #[cfg_attr(not(feature = "gpu"), allow(clippy::unnecessary_wraps, reason = "a map on a GPU must be fetched"))]
    pub(super) fn into_map(self) -> Result<Map, ScanError> {
        match self {
            Self::Cpu(map) => Ok(*map),
            #[cfg(feature = "gpu")]
            Self::Gpu(map) => Ok(map.to_map(usize::MAX)?),
        }
    }
}
