//! Compute programs, all of them on one device.
//!
//! Drivers have hung when several threads called them at once, so equal options share one device, and one call is made at a time.

use std::future::Future;
use std::pin::pin;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, Weak};
use std::task::{Context, Poll, Waker};

use wgpu::{Buffer, BufferUsages};

use super::options::GpuOptions;
use crate::error::Error;

/// Storage buffers of a program: its inputs and its result.
const STORAGE: u32 = 5;
/// Work groups of one dispatch, as every adapter offers.
pub(crate) const MOST_GROUPS: usize = 65_535;

/// Devices that some program runs on.
static OPEN: Mutex<Vec<(GpuOptions, Weak<Device>)>> = Mutex::new(Vec::new());

/// A lock whose holder panicked protects nothing that could be half done.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// An open adapter.
struct Device {
    handle: wgpu::Device,
    queue: wgpu::Queue,
    /// Name, backend and driver.
    name: String,
    /// The largest buffer that a program may see, bytes.
    most_bytes: u64,
    /// Held during every call.
    turn: Mutex<()>,
    /// The first fault that no call has reported yet.
    fault: Arc<Mutex<Option<String>>>,
    /// Why the device is gone.
    lost: Arc<OnceLock<String>>,
}

impl Device {
    /// The device that these options have opened before, or a new one.
    fn shared(options: &GpuOptions) -> Result<Arc<Self>, Error> {
        let mut open = locked(&OPEN);
        open.retain(|(_, device)| device.upgrade().is_some_and(|device| device.lost.get().is_none()));
        if let Some(device) = open.iter().find(|(of, _)| of == options).and_then(|(_, device)| device.upgrade()) {
            return Ok(device);
        }
        let device = Arc::new(Self::open(options)?);
        open.push((options.clone(), Arc::downgrade(&device)));
        Ok(device)
    }

    fn open(options: &GpuOptions) -> Result<Self, Error> {
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
        let most_bytes =
            offered.max_storage_buffer_binding_size.min(offered.max_buffer_size).min(options.max_buffer_bytes);
        let descriptor = wgpu::DeviceDescriptor { required_limits, ..wgpu::DeviceDescriptor::default() };
        let (handle, queue) = ready(adapter.request_device(&descriptor))
            .map_err(|error| Error::Gpu { what: format!("{name} cannot be opened: {error}") })?;
        let fault: Arc<Mutex<Option<String>>> = Arc::default();
        let seen = Arc::clone(&fault);
        handle.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            locked(&seen).get_or_insert(error.to_string());
        }));
        let lost: Arc<OnceLock<String>> = Arc::default();
        let seen = Arc::clone(&lost);
        handle.set_device_lost_callback(move |reason, what| {
            // The first reason stays.
            seen.get_or_init(|| format!("it is lost ({reason:?}): {what}"));
        });
        Ok(Self { handle, queue, name, most_bytes, turn: Mutex::default(), fault, lost })
    }

    /// The fault that came up since the last call, if any; once the device is lost, always that.
    fn check(&self) -> Result<(), Error> {
        match self.lost.get().cloned().or_else(|| locked(&self.fault).take()) {
            Some(what) => Err(Error::Gpu { what }),
            None => Ok(()),
        }
    }

    fn buffer(&self, size: u64, usage: BufferUsages) -> Result<Buffer, Error> {
        if size > self.most_bytes {
            let what = format!("a buffer takes {size} bytes and {} offers {} at once", self.name, self.most_bytes);
            return Err(Error::Gpu { what });
        }
        let descriptor = wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false };
        let buffer = self.handle.create_buffer(&descriptor);
        self.check().map(|()| buffer)
    }

    fn filled(&self, bytes: &[u8], usage: BufferUsages) -> Result<Buffer, Error> {
        let buffer = self.buffer(bytes.len() as u64, usage | BufferUsages::COPY_DST)?;
        self.queue.write_buffer(&buffer, 0, bytes);
        Ok(buffer)
    }

    /// Runs what was recorded, waits for it, and returns the words of `staging`.
    fn finish(&self, commands: wgpu::CommandEncoder, staging: &Buffer) -> Result<Vec<u32>, Error> {
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
}

/// What a program reads.
pub(crate) enum Input<'a> {
    /// Handed over for one run.
    Sent(&'a [u8]),
    /// On the device already.
    Kept(&'a Buffer),
}

/// A compute program: a uniform, then storage buffers, of which the last takes the result.
pub(crate) struct Program {
    device: Arc<Device>,
    pipeline: wgpu::ComputePipeline,
}

impl Program {
    /// Compiles the entry point of a WGSL source.
    ///
    /// # Errors
    /// [`Error::Gpu`]: there is no adapter, or it refuses.
    pub(crate) fn new(options: &GpuOptions, source: &str, entry: &str) -> Result<Self, Error> {
        let device = Device::shared(options)?;
        let turn = locked(&device.turn);
        let module = device.handle.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(entry),
            source: wgpu::ShaderSource::Wgsl(source.into()),
        });
        let pipeline = device.handle.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(entry),
            layout: None,
            module: &module,
            entry_point: Some(entry),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        device.check()?;
        drop(turn);
        Ok(Self { device, pipeline })
    }

    /// Name, backend and driver of the adapter.
    pub(crate) fn adapter(&self) -> &str {
        &self.device.name
    }

    /// The most words of one buffer.
    pub(crate) fn most_words(&self) -> usize {
        (self.device.most_bytes / 4) as usize
    }

    /// The most work groups of one run, each with so many words in the largest of its buffers; at least one.
    pub(crate) fn most_groups(&self, words: usize) -> usize {
        (self.most_words() / words.max(1)).clamp(1, MOST_GROUPS)
    }

    /// Puts an input on the device for all programs of the same options.
    ///
    /// # Errors
    /// [`Error::Gpu`]: the device failed, or cannot hold it.
    pub(crate) fn keep(&self, bytes: &[u8]) -> Result<Buffer, Error> {
        let _turn = locked(&self.device.turn);
        self.device.filled(bytes, BufferUsages::STORAGE)
    }

    /// Runs the program in `groups` work groups, and returns its `words` words of result.
    ///
    /// # Errors
    /// [`Error::Gpu`]: the device failed, or cannot hold a buffer.
    pub(crate) fn run(&self, uniform: &[u8], inputs: &[Input], groups: usize, words: usize) -> Result<Vec<u32>, Error> {
        let device = &*self.device;
        let _turn = locked(&device.turn);
        let mut buffers = vec![device.filled(uniform, BufferUsages::UNIFORM)?];
        for input in inputs {
            buffers.push(match input {
                Input::Sent(bytes) => device.filled(bytes, BufferUsages::STORAGE)?,
                Input::Kept(buffer) => (*buffer).clone(),
            });
        }
        let size = 4 * words as u64;
        let result = device.buffer(size, BufferUsages::STORAGE | BufferUsages::COPY_SRC)?;
        let staging = device.buffer(size, BufferUsages::MAP_READ | BufferUsages::COPY_DST)?;
        let entries: Vec<_> = (0..)
            .zip(buffers.iter().chain([&result]))
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let layout = self.pipeline.get_bind_group_layout(0);
        let descriptor = wgpu::BindGroupDescriptor { label: None, layout: &layout, entries: &entries };
        let bound = device.handle.create_bind_group(&descriptor);
        let mut commands = device.handle.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = commands.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &bound, &[]);
            pass.dispatch_workgroups(groups as u32, 1, 1);
        }
        commands.copy_buffer_to_buffer(&result, 0, &staging, 0, size);
        device.finish(commands, &staging)
    }
}

pub(crate) fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_ne_bytes()).collect()
}

pub(crate) fn words(values: &[u32]) -> Vec<u8> {
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
