//! One compute program on one adapter.

use std::future::Future;
use std::pin::pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, Waker};

use wgpu::BufferUsages;

use super::options::GpuOptions;
use crate::error::Error;

/// Storage buffers of a program: its inputs and its result.
const STORAGE: u32 = 5;
/// Work groups of one dispatch, as every adapter offers.
pub(super) const MOST_GROUPS: usize = 65_535;

/// An adapter with the program on it.
pub(super) struct Device {
    handle: wgpu::Device,
    queue: wgpu::Queue,
    pipeline: wgpu::ComputePipeline,
    /// Name, backend and driver.
    pub(super) name: String,
    /// The largest buffer that the program may see, bytes.
    most_bytes: u64,
    /// The first fault that no call has reported yet.
    fault: Arc<Mutex<Option<String>>>,
}

impl Device {
    pub(super) fn open(options: &GpuOptions, source: &str, entry: &str) -> Result<Self, Error> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
            // Neither the environment nor the build changes what runs.
            flags: wgpu::InstanceFlags::empty(),
            ..wgpu::InstanceDescriptor::new_without_display_handle()
        });
        let adapter = choose(ready(instance.enumerate_adapters(wgpu::Backends::PRIMARY)), options)?;
        let (info, offered) = (adapter.get_info(), adapter.limits());
        let name = format!("{} ({:?}, {})", info.name, info.backend, info.driver_info);
        let required_limits = wgpu::Limits {
            max_storage_buffers_per_shader_stage: STORAGE,
            max_storage_buffer_binding_size: offered.max_storage_buffer_binding_size,
            max_buffer_size: offered.max_buffer_size,
            ..wgpu::Limits::downlevel_defaults()
        };
        let most_bytes = offered.max_storage_buffer_binding_size.min(offered.max_buffer_size);
        let descriptor = wgpu::DeviceDescriptor { required_limits, ..wgpu::DeviceDescriptor::default() };
        let (handle, queue) = ready(adapter.request_device(&descriptor))
            .map_err(|error| Error::Gpu { what: format!("{name} cannot be opened: {error}") })?;
        let fault: Arc<Mutex<Option<String>>> = Arc::default();
        let seen = Arc::clone(&fault);
        handle.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            seen.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error.to_string());
        }));
        let module = handle.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(entry),
            source: wgpu::ShaderSource::Wgsl(source.into()),
        });
        let pipeline = handle.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(entry),
            layout: None,
            module: &module,
            entry_point: Some(entry),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        let device = Self { handle, queue, pipeline, name, most_bytes, fault };
        device.check().map(|()| device)
    }

    fn check(&self) -> Result<(), Error> {
        match self.fault.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(what) => Err(Error::Gpu { what }),
            None => Ok(()),
        }
    }

    /// The most work groups whose results, `words` for each, fit into one buffer; at least one.
    pub(super) fn most_groups(&self, words: usize) -> usize {
        ((self.most_bytes / (4 * words.max(1) as u64)) as usize).max(1)
    }

    /// Runs the program on a uniform and its inputs in `groups` work groups, and returns its `words` words of result.
    pub(super) fn run(
        &self,
        uniform: &[u8],
        inputs: &[&Vec<u8>],
        groups: usize,
        words: usize,
    ) -> Result<Vec<u32>, Error> {
        let input = BufferUsages::STORAGE | BufferUsages::COPY_DST;
        let mut buffers = vec![self.filled(uniform, BufferUsages::UNIFORM | BufferUsages::COPY_DST)?];
        for bytes in inputs {
            buffers.push(self.filled(bytes, input)?);
        }
        let size = 4 * words as u64;
        buffers.push(self.buffer(size, BufferUsages::STORAGE | BufferUsages::COPY_SRC)?);
        let staging = self.buffer(size, BufferUsages::MAP_READ | BufferUsages::COPY_DST)?;
        let entries: Vec<_> = (0..)
            .zip(&buffers)
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let layout = self.pipeline.get_bind_group_layout(0);
        let descriptor = wgpu::BindGroupDescriptor { label: None, layout: &layout, entries: &entries };
        let bound = self.handle.create_bind_group(&descriptor);
        let mut commands = self.handle.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = commands.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &bound, &[]);
            pass.dispatch_workgroups(groups as u32, 1, 1);
        }
        commands.copy_buffer_to_buffer(&buffers[buffers.len() - 1], 0, &staging, 0, size);
        self.queue.submit([commands.finish()]);
        let failed = |what: String| Error::Gpu { what };
        let slice = staging.slice(..);
        // Whether mapping failed is seen by the view below.
        slice.map_async(wgpu::MapMode::Read, |_| {});
        self.handle.poll(wgpu::PollType::wait_indefinitely()).map_err(|error| failed(error.to_string()))?;
        self.check()?;
        let view = slice.get_mapped_range().map_err(|error| failed(error.to_string()))?;
        Ok(view.as_chunks::<4>().0.iter().map(|bytes| u32::from_ne_bytes(*bytes)).collect())
    }

    fn buffer(&self, size: u64, usage: BufferUsages) -> Result<wgpu::Buffer, Error> {
        if size > self.most_bytes {
            let what = format!("a buffer takes {size} bytes and {} offers {} at once", self.name, self.most_bytes);
            return Err(Error::Gpu { what });
        }
        let descriptor = wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false };
        let buffer = self.handle.create_buffer(&descriptor);
        self.check().map(|()| buffer)
    }

    fn filled(&self, bytes: &[u8], usage: BufferUsages) -> Result<wgpu::Buffer, Error> {
        let buffer = self.buffer(bytes.len() as u64, usage)?;
        self.queue.write_buffer(&buffer, 0, bytes);
        Ok(buffer)
    }
}

pub(super) fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_ne_bytes()).collect()
}

pub(super) fn words(values: &[u32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_ne_bytes()).collect()
}

/// The first adapter that fits, discrete ones before integrated ones.
fn choose(adapters: Vec<wgpu::Adapter>, options: &GpuOptions) -> Result<wgpu::Adapter, Error> {
    let mut names = Vec::new();
    let mut fitting: Vec<_> = Vec::new();
    for adapter in adapters {
        let info = adapter.get_info();
        let rank = match info.device_type {
            wgpu::DeviceType::DiscreteGpu => 0,
            wgpu::DeviceType::IntegratedGpu => 1,
            wgpu::DeviceType::VirtualGpu | wgpu::DeviceType::Other => 2,
            wgpu::DeviceType::Cpu => 3,
        };
        if info.name.contains(&options.adapter) && (options.software || rank < 3) {
            fitting.push((rank, adapter));
        }
        names.push(info.name);
    }
    fitting.sort_by_key(|(rank, _)| *rank);
    fitting.into_iter().next().map(|(_, adapter)| adapter).ok_or_else(|| {
        let what = match names.as_slice() {
            [] => "no Vulkan, Metal or Direct3D 12 driver was found".into(),
            names => format!("none of the adapters found is wanted: {}", names.join(", ")),
        };
        Error::Gpu { what }
    })
}

/// The value of a future that needs no one to wake it: outside of browsers those of wgpu are ready at once.
fn ready<T>(future: impl Future<Output = T>) -> T {
    let mut future = pin!(future);
    let mut context = Context::from_waker(Waker::noop());
    loop {
        match future.as_mut().poll(&mut context) {
            Poll::Ready(value) => return value,
            Poll::Pending => std::thread::yield_now(),
        }
    }
}
