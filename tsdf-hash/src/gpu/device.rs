//! The adapter, its buffers and its programs; whatever goes wrong there becomes an [`Error`].

use std::future::Future;
use std::pin::pin;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::task::{Context, Poll, Waker};

use wgpu::{Buffer, BufferUsages, ComputePipeline};

use crate::error::Error;
use crate::gpu::options::GpuOptions;

/// Storage buffers of the integration: what the weakest adapters offer.
const LEAST_BINDINGS: u32 = 4;
/// The most that a program of this crate asks for.
const MOST_BINDINGS: u32 = 8;

/// An open device.
pub(crate) struct Device {
    handle: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    /// Name, driver and backend.
    pub(crate) name: String,
    /// The largest buffer that a program may see, bytes.
    pub(crate) binding_bytes: usize,
    /// Storage buffers that a program may see at once.
    pub(crate) bindings: usize,
    /// The first fault that no call has reported yet.
    fault: Arc<Mutex<Option<String>>>,
    /// Why the device, and with it the map, is gone.
    lost: Arc<OnceLock<String>>,
}

impl Device {
    pub(crate) fn open(options: &GpuOptions) -> Result<Self, Error> {
        let descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
            // Neither the environment nor the build changes what runs.
            flags: wgpu::InstanceFlags::empty(),
            ..descriptor
        });
        let adapter = choose(ready(instance.enumerate_adapters(wgpu::Backends::PRIMARY)), options)?;
        let (info, offered) = (adapter.get_info(), adapter.limits());
        let name = format!("{} ({:?}, {})", info.name, info.backend, info.driver_info);
        let bindings = offered.max_storage_buffers_per_shader_stage.clamp(LEAST_BINDINGS, MOST_BINDINGS);
        let required_limits = wgpu::Limits {
            max_storage_buffers_per_shader_stage: bindings,
            max_storage_buffer_binding_size: offered.max_storage_buffer_binding_size,
            max_buffer_size: offered.max_buffer_size,
            ..wgpu::Limits::downlevel_defaults()
        };
        let binding_bytes = offered.max_storage_buffer_binding_size.min(offered.max_buffer_size) as usize;
        let descriptor = wgpu::DeviceDescriptor { required_limits, ..wgpu::DeviceDescriptor::default() };
        let (device, queue) = ready(adapter.request_device(&descriptor))
            .map_err(|error| Error::NoAdapter { reason: format!("{name} cannot be opened: {error}") })?;
        let fault: Arc<Mutex<Option<String>>> = Arc::default();
        let seen = Arc::clone(&fault);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            seen.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error.to_string());
        }));
        let lost: Arc<OnceLock<String>> = Arc::default();
        let seen = Arc::clone(&lost);
        device.set_device_lost_callback(move |reason, what| {
            // The first reason stays.
            seen.get_or_init(|| format!("it is lost ({reason:?}): {what}"));
        });
        let binding_bytes = binding_bytes.min(options.max_buffer_bytes);
        Ok(Self { handle: device, queue, name, binding_bytes, bindings: bindings as usize, fault, lost })
    }

    /// The fault that came up since the last call, if any; once the device is lost, always that.
    pub(crate) fn check(&self) -> Result<(), Error> {
        if let Some(what) = self.lost.get() {
            return Err(Error::Device { what: what.clone() });
        }
        match self.fault.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(what) => Err(Error::Device { what }),
            None => Ok(()),
        }
    }

    pub(crate) fn buffer(&self, label: &str, bytes: usize, usage: BufferUsages) -> Result<Buffer, Error> {
        if usage.contains(BufferUsages::STORAGE) && bytes > self.binding_bytes {
            let what = format!("{label} takes {bytes} bytes and {} offers {} at once", self.name, self.binding_bytes);
            return Err(Error::Device { what });
        }
        let size = bytes as u64;
        let descriptor = wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
        let buffer = self.handle.create_buffer(&descriptor);
        self.check().map(|()| buffer)
    }

    /// A program with bind group 0: a uniform, then storage buffers of which only some are written.
    pub(crate) fn program(&self, entry: &str, source: &str, writable: &[bool]) -> Result<Program, Error> {
        let entries: Vec<_> = (0..=writable.len())
            .map(|k| {
                let ty = match k.checked_sub(1) {
                    None => wgpu::BufferBindingType::Uniform,
                    Some(k) => wgpu::BufferBindingType::Storage { read_only: !writable[k] },
                };
                wgpu::BindGroupLayoutEntry {
                    binding: k as u32,
                    visibility: wgpu::ShaderStages::COMPUTE,
                    ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: k == 0, min_binding_size: None },
                    count: None,
                }
            })
            .collect();
        let label = Some(entry);
        let layout =
            self.handle.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label, entries: &entries });
        let descriptor =
            wgpu::PipelineLayoutDescriptor { label, bind_group_layouts: &[Some(&layout)], immediate_size: 0 };
        let pipeline_layout = self.handle.create_pipeline_layout(&descriptor);
        let source = wgpu::ShaderSource::Wgsl(source.into());
        let module = self.handle.create_shader_module(wgpu::ShaderModuleDescriptor { label, source });
        let pipeline = self.handle.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label,
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: label,
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        self.check().map(|()| Program { pipeline, layout })
    }

    /// Binds a uniform, seen through windows of `window` bytes, and storage buffers to a program.
    pub(crate) fn bind(
        &self,
        program: &Program,
        window: usize,
        uniform: &Buffer,
        storage: &[&Buffer],
    ) -> wgpu::BindGroup {
        let window = wgpu::BufferBinding { buffer: uniform, offset: 0, size: wgpu::BufferSize::new(window as u64) };
        let resources = storage.iter().map(|buffer| buffer.as_entire_binding());
        let entries: Vec<_> = std::iter::once(wgpu::BindingResource::Buffer(window))
            .chain(resources)
            .enumerate()
            .map(|(binding, resource)| wgpu::BindGroupEntry { binding: binding as u32, resource })
            .collect();
        let descriptor = wgpu::BindGroupDescriptor { label: None, layout: &program.layout, entries: &entries };
        self.handle.create_bind_group(&descriptor)
    }

    /// Hands words over; they arrive before the next submission runs.
    pub(crate) fn write(
        &self,
        buffer: &Buffer,
        offset: usize,
        words: impl ExactSizeIterator<Item = u32>,
    ) -> Result<(), Error> {
        let Some(bytes) = wgpu::BufferSize::new(4 * words.len() as u64) else { return Ok(()) };
        let Some(mut view) = self.queue.write_buffer_with(buffer, offset as u64, bytes) else { return self.refused() };
        view.slice(..).into_chunks::<4>().0.write_iter(words.map(u32::to_ne_bytes));
        Ok(())
    }

    /// As [`write`](Self::write), words in groups.
    pub(crate) fn write_groups(
        &self,
        buffer: &Buffer,
        offset: usize,
        groups: impl ExactSizeIterator<Item = [u32; 4]>,
    ) -> Result<(), Error> {
        let Some(bytes) = wgpu::BufferSize::new(16 * groups.len() as u64) else { return Ok(()) };
        let Some(mut view) = self.queue.write_buffer_with(buffer, offset as u64, bytes) else { return self.refused() };
        let bytes_of = |words: [u32; 4]| {
            let [a, b, c, d] = words.map(u32::to_ne_bytes);
            [a, b, c, d]
        };
        view.slice(..).into_chunks::<4>().0.into_chunks::<4>().0.write_iter(groups.map(bytes_of));
        Ok(())
    }

    fn refused(&self) -> Result<(), Error> {
        self.check().and_then(|()| Err(Error::Device { what: "a write was refused".into() }))
    }

    pub(crate) fn commands(&self) -> wgpu::CommandEncoder {
        self.handle.create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }

    /// Runs what was recorded, waits for it, and calls `read` with the first `bytes` of `staging`.
    pub(crate) fn run_and_read<R>(
        &self,
        commands: wgpu::CommandEncoder,
        staging: &Buffer,
        bytes: usize,
        read: impl FnOnce(&[[u8; 4]]) -> R,
    ) -> Result<R, Error> {
        self.queue.submit([commands.finish()]);
        self.wait_and_read(staging, bytes, read).map_err(|error| self.lose(error))
    }

    /// Gives the device up: what ran and what did not is unknown, so nothing on it can be trusted any more.
    pub(crate) fn lose(&self, error: Error) -> Error {
        self.lost.get_or_init(|| format!("the map on it is lost since: {error}"));
        error
    }

    fn wait_and_read<R>(&self, staging: &Buffer, bytes: usize, read: impl FnOnce(&[[u8; 4]]) -> R) -> Result<R, Error> {
        let failed = |what: String| Error::Device { what };
        if bytes == 0 {
            return self.check().map(|()| read(&[]));
        }
        let slice = staging.slice(..bytes as u64);
        // Whether mapping failed is seen by the view below.
        slice.map_async(wgpu::MapMode::Read, |_| {});
        self.handle.poll(wgpu::PollType::wait_indefinitely()).map_err(|error| failed(error.to_string()))?;
        self.check()?;
        let view = slice.get_mapped_range().map_err(|error| failed(error.to_string()))?;
        let result = read(view.as_chunks().0);
        drop(view);
        staging.unmap();
        Ok(result)
    }
}

/// A compute pipeline and what it binds.
pub(crate) struct Program {
    pipeline: ComputePipeline,
    layout: wgpu::BindGroupLayout,
}

impl Program {
    /// Records a run that sees the uniform from `window` on.
    pub(crate) fn dispatch(
        &self,
        commands: &mut wgpu::CommandEncoder,
        group: &wgpu::BindGroup,
        window: usize,
        groups: [u32; 2],
    ) {
        let mut pass = commands.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, group, &[window as u32]);
        pass.dispatch_workgroups(groups[0], groups[1], 1);
    }
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
        let reason = match names.as_slice() {
            [] => "no Vulkan, Metal or Direct3D 12 driver was found".into(),
            names => format!("none of the adapters found is wanted: {}", names.join(", ")),
        };
        Error::NoAdapter { reason }
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
