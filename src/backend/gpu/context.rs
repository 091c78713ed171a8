//! Adapters and devices: the list, the choice with its reason, and their errors.

use super::kernels::{Kernels, WIDTH};
use crate::backend::{BackendError, GpuOptions, Precision};
use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, mpsc};
use std::thread::JoinHandle;

/// A GPU could not be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GpuError {
    /// No adapter fits.
    #[error("{0}")]
    NoAdapter(String),
    /// The requested adapter lacks a feature that kernels need.
    #[error("the adapter \"{adapter}\" cannot be used: {reason}")]
    Unsuitable {
        /// Its name.
        adapter: String,
        /// The missing feature.
        reason: String,
    },
    /// The driver refused.
    #[error("the adapter \"{adapter}\" gave no device: {reason}")]
    NoDevice {
        /// Its name.
        adapter: String,
        /// The driver's message.
        reason: String,
    },
    /// It failed at once.
    #[error(transparent)]
    Backend(#[from] BackendError),
}

/// One adapter, with the limits and features that matter here.
#[derive(Clone, Debug)]
pub struct AdapterSummary {
    /// Its name.
    pub name: String,
    /// Its driver with its version.
    pub driver: String,
    /// vulkan, metal, dx12, gl.
    pub api: String,
    /// Its address on the PCI bus, which tells equal cards apart; empty if unknown.
    pub bus: String,
    /// Discrete, integrated, virtual or software.
    pub kind: &'static str,
    /// Whether it computes on the CPU.
    pub is_software: bool,
    /// Whether kernels may compute in f64.
    pub f64: bool,
    /// Whether it has subgroup operations.
    pub subgroups: bool,
    /// Whether it has timestamps.
    pub timestamps: bool,
    /// Bytes of one storage binding.
    pub max_binding: u64,
    /// Bytes of one buffer.
    pub max_buffer: u64,
    /// Bytes of its own (or shared) memory, if the driver reports them.
    pub memory: Option<u64>,
    /// The reason why it cannot be used, if any.
    pub unsuitable: Option<String>,
}

impl fmt::Display for AdapterSummary {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{} ({}, {})", self.name, self.kind, self.api)
    }
}

/// Invocations that keep a GPU busy: half of what the largest ones hold. With fewer, their memory waits.
const BUSY: usize = 1 << 17;
/// Storage buffers that a kernel binds at most.
const STORAGE_BUFFERS: u32 = 8;

/// The best adapter first, in the order in which they would be taken.
///
/// The variables `WGPU_BACKEND` and `WGPU_POWER_PREF` are respected.
pub fn adapters() -> Vec<AdapterSummary> {
    let all = sorted_adapters(wgpu::Backends::all());
    all.into_iter().map(|(_, s)| s).collect()
}

/// The adapters of some interfaces that the environment permits.
fn sorted_adapters(interfaces: wgpu::Backends) -> Vec<(wgpu::Adapter, AdapterSummary)> {
    let mut description = wgpu::InstanceDescriptor::new_without_display_handle_from_env();
    description.backends &= interfaces;
    let instance = wgpu::Instance::new(description);
    let low_power = wgpu::PowerPreference::from_env() == Some(wgpu::PowerPreference::LowPower);
    let mut found: Vec<_> = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()))
        .into_iter()
        .map(|adapter| {
            let summary = summary(&adapter);
            (adapter, summary)
        })
        .collect();
    found.sort_by_key(|(adapter, summary)| {
        use wgpu::DeviceType::{Cpu, DiscreteGpu, IntegratedGpu, Other, VirtualGpu};
        let kind = match adapter.get_info().device_type {
            DiscreteGpu if low_power => 1,
            DiscreteGpu => 0,
            IntegratedGpu if low_power => 0,
            IntegratedGpu => 1,
            VirtualGpu => 2,
            Other => 3,
            Cpu => 4,
        };
        let gl = adapter.get_info().backend == wgpu::Backend::Gl;
        (summary.unsuitable.is_some(), kind, !summary.f64, gl)
    });
    found
}

fn summary(adapter: &wgpu::Adapter) -> AdapterSummary {
    let (info, limits, features) = (adapter.get_info(), adapter.limits(), adapter.features());
    let compute = adapter
        .get_downlevel_capabilities()
        .flags
        .contains(wgpu::DownlevelFlags::COMPUTE_SHADERS);
    let unsuitable = if !compute {
        Some("it has no compute shaders".to_owned())
    } else if limits.max_storage_buffers_per_shader_stage < STORAGE_BUFFERS {
        Some(format!(
            "a kernel can use only {} storage buffers, {STORAGE_BUFFERS} are needed",
            limits.max_storage_buffers_per_shader_stage
        ))
    } else if limits.max_compute_invocations_per_workgroup < WIDTH
        || limits.max_compute_workgroup_size_x < WIDTH
    {
        Some(format!(
            "its workgroups have fewer than {} invocations",
            WIDTH
        ))
    } else {
        None
    };
    AdapterSummary {
        kind: match info.device_type {
            wgpu::DeviceType::DiscreteGpu => "discrete GPU",
            wgpu::DeviceType::IntegratedGpu => "integrated GPU",
            wgpu::DeviceType::VirtualGpu => "virtual GPU",
            wgpu::DeviceType::Cpu => "software",
            wgpu::DeviceType::Other => "unknown kind",
        },
        is_software: info.device_type == wgpu::DeviceType::Cpu,
        api: info.backend.to_string(),
        bus: info.device_pci_bus_id,
        driver: format!("{} {}", info.driver, info.driver_info)
            .trim()
            .to_owned(),
        name: info.name,
        f64: features.contains(wgpu::Features::SHADER_F64),
        subgroups: features.contains(wgpu::Features::SUBGROUP),
        timestamps: features.contains(wgpu::Features::TIMESTAMP_QUERY),
        max_binding: limits.max_storage_buffer_binding_size,
        max_buffer: limits.max_buffer_size,
        memory: memory(adapter),
        unsuitable,
    }
}

/// The largest device-local heap, which wgpu itself does not report.
#[cfg(not(any(target_vendor = "apple", target_family = "wasm")))]
fn memory(adapter: &wgpu::Adapter) -> Option<u64> {
    const DEVICE_LOCAL: u32 = 1;
    // SAFETY: the handles are only used to ask for properties, while the guard keeps them alive.
    unsafe {
        let adapter = adapter.as_hal::<wgpu::hal::api::Vulkan>()?;
        let properties = adapter
            .shared_instance()
            .raw_instance()
            .get_physical_device_memory_properties(adapter.raw_physical_device());
        properties.memory_heaps[..properties.memory_heap_count as usize]
            .iter()
            .filter(|heap| heap.flags.as_raw() & DEVICE_LOCAL != 0)
            .map(|heap| heap.size)
            .max()
    }
}

#[cfg(any(target_vendor = "apple", target_family = "wasm"))]
fn memory(_adapter: &wgpu::Adapter) -> Option<u64> {
    None
}

/// An error of the device that has not been reported yet.
type Fault = Arc<Mutex<Option<BackendError>>>;

/// A device with its compiled kernels; shared by all that computes on it.
pub struct Context {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    pub(super) kernels: Kernels,
    fault: Fault,
    allocated: Mutex<u64>,
    /// Submissions left until the device is lost on purpose.
    left: Mutex<Option<usize>>,
    max_binding: u64,
    least_invocations: Option<usize>,
    /// The adapter taken.
    pub adapter: AdapterSummary,
    /// The reason for this choice.
    pub reason: String,
    /// The precision of the kernels.
    pub precision: Precision,
}

type Opened = Result<Arc<Context>, GpuError>;

/// A device that opens in another thread, while the host has other work.
#[derive(Clone, Debug)]
pub struct Ahead(Arc<Opening>);

#[derive(Debug)]
struct Opening(Mutex<Option<JoinHandle<Opened>>>);

impl Drop for Opening {
    /// A process must not end while a driver starts.
    fn drop(&mut self) {
        if let Some(thread) = lock(&self.0).take() {
            let _ = thread.join();
        }
    }
}

impl Ahead {
    /// Begins to open what [`Context::new`] opens with these options.
    pub fn new(options: GpuOptions) -> Self {
        let thread = std::thread::spawn(move || Context::open(&options));
        Self(Arc::new(Opening(Mutex::new(Some(thread)))))
    }

    /// The device, once.
    fn take(&self) -> Option<Opened> {
        let thread = lock(&self.0.0).take()?;
        // A thread that has panicked opened nothing.
        thread.join().ok()
    }
}

impl Context {
    /// Opens a device on the adapter that the options ask for, or takes the one that they have opened ahead.
    pub fn new(options: &GpuOptions) -> Result<Arc<Self>, GpuError> {
        let ahead = options.ahead.as_ref().and_then(Ahead::take);
        ahead.unwrap_or_else(|| Self::open(options))
    }

    fn open(options: &GpuOptions) -> Opened {
        let (adapter, mut summary, reason) = choose(options)?;
        summary.memory = [summary.memory, options.max_memory]
            .into_iter()
            .flatten()
            .min();
        let name = summary.to_string();
        let precision = match options.precision {
            Some(Precision::F64) if !summary.f64 => {
                return Err(GpuError::Unsuitable {
                    adapter: name,
                    reason: "it does not support f64 in kernels (the feature SHADER_F64)"
                        .to_owned(),
                });
            }
            Some(precision) => precision,
            None if summary.f64 => Precision::F64,
            None => Precision::F32,
        };
        let mut wanted = wgpu::Features::SHADER_F64;
        wanted.set(wgpu::Features::TIMESTAMP_QUERY, options.timestamps);
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("signorini"),
            required_features: adapter.features() & wanted,
            required_limits: adapter.limits(),
            memory_hints: wgpu::MemoryHints::Performance,
            ..Default::default()
        }))
        .map_err(|error| GpuError::NoDevice {
            adapter: name.clone(),
            reason: error.to_string(),
        })?;

        let fault = Fault::default();
        let (on_lost, lost_name) = (Arc::clone(&fault), name.clone());
        device.set_device_lost_callback(move |_, message| {
            let lost = BackendError::Lost {
                adapter: lost_name.clone(),
                reason: message,
            };
            // The loss explains every other error reported.
            *lock(&on_lost) = Some(lost);
        });
        let (on_error, error_name) = (Arc::clone(&fault), name.clone());
        device.on_uncaptured_error(Arc::new(move |error| {
            let adapter = error_name.clone();
            let error = match error {
                wgpu::Error::OutOfMemory { .. } => BackendError::OutOfMemory { adapter },
                other => BackendError::Fault {
                    adapter,
                    reason: other.to_string(),
                },
            };
            lock(&on_error).get_or_insert(error);
        }));

        let limits = device.limits();
        let kernels = Kernels::new(&device, precision, options.checked);
        let context = Self {
            max_binding: options
                .max_binding
                .unwrap_or(u64::MAX)
                .min(limits.max_storage_buffer_binding_size)
                .min(limits.max_buffer_size),
            least_invocations: options.least_invocations,
            device,
            queue,
            kernels,
            fault,
            allocated: Mutex::new(0),
            left: Mutex::new(None),
            adapter: summary,
            reason,
            precision,
        };
        context.check()?;
        Ok(Arc::new(context))
    }

    /// The error since the last call, if any.
    pub(super) fn check(&self) -> Result<(), BackendError> {
        match &*lock(&self.fault) {
            // A fault stays: nothing computed after it can be trusted.
            Some(error) => Err(error.clone()),
            None => Ok(()),
        }
    }

    /// Waits for all work submitted so far.
    pub(super) fn wait(&self) -> Result<wgpu::PollStatus, wgpu::PollError> {
        self.device.poll(wgpu::PollType::wait_indefinitely())
    }

    /// Waits for all work submitted so far, and passes the first bytes of a buffer that the host can map to `take`.
    pub(super) fn mapped(
        &self,
        buffer: &Buffer,
        bytes: u64,
        take: impl FnOnce(&[u8]),
    ) -> Result<(), BackendError> {
        let slice = buffer.buffer.slice(0..bytes);
        let (sender, receiver) = mpsc::channel();
        slice.map_async(wgpu::MapMode::Read, move |result| {
            // The receiver is gone only if the wait below has failed.
            let _ = sender.send(result);
        });
        let polled = self.wait();
        self.check()?;
        let fault = |reason: String| BackendError::Fault {
            adapter: self.adapter.to_string(),
            reason,
        };
        polled.map_err(|error| fault(error.to_string()))?;
        match receiver.try_recv() {
            Ok(Ok(())) => {}
            Ok(Err(error)) => return Err(fault(error.to_string())),
            Err(_) => return Err(fault("a buffer was not mapped".to_owned())),
        }
        let view = slice
            .get_mapped_range()
            .map_err(|error| fault(error.to_string()))?;
        take(&view);
        drop(view);
        buffer.buffer.unmap();
        Ok(())
    }

    /// Bytes of one storage binding.
    pub(super) fn max_binding(&self) -> u64 {
        self.max_binding
    }

    /// Workgroups of a dispatch at most: enough to fill the device, few enough that every workgroup can add
    /// up the partial sums of all.
    pub(super) fn max_groups(&self) -> u32 {
        if self.adapter.is_software { 32 } else { 1024 }
    }

    /// Invocations that share each of `count` block rows of a matrix whose longest has so many blocks: a power of two.
    pub(super) fn lanes(&self, count: usize, longest: usize) -> u32 {
        let busy = match self.least_invocations {
            Some(least) => least,
            None if self.adapter.is_software => 0,
            None => BUSY,
        };
        let most = (busy / count.max(1)).min(longest / 2).min(WIDTH as usize);
        1 << most.max(1).ilog2()
    }

    /// Refuses data that exceed the adapter's memory beside existing allocations.
    pub fn check_memory(&self, what: &'static str, bytes: u64) -> Result<(), BackendError> {
        let needed = *lock(&self.allocated) + bytes;
        match self.adapter.memory {
            Some(offered) if needed > offered => Err(BackendError::TooLarge {
                what,
                adapter: self.adapter.to_string(),
                needed_mib: needed >> 20,
                offered_mib: offered >> 20,
            }),
            _ => Ok(()),
        }
    }

    /// A zeroed buffer.
    pub(super) fn buffer(
        &self,
        label: &'static str,
        bytes: u64,
        usage: wgpu::BufferUsages,
    ) -> Result<Buffer, BackendError> {
        self.check()?;
        // A binding must not be empty, and copies go by four bytes.
        let size = bytes.max(16).next_multiple_of(16);
        if size > self.device.limits().max_buffer_size {
            return Err(BackendError::TooLarge {
                what: label,
                adapter: self.adapter.to_string(),
                needed_mib: size >> 20,
                offered_mib: self.device.limits().max_buffer_size >> 20,
            });
        }
        // Parameters are a few bytes, and a dispatch without room for them could not report it.
        if !usage.contains(wgpu::BufferUsages::UNIFORM) {
            self.check_memory(label, size)?;
        }
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size,
            usage,
            mapped_at_creation: false,
        });
        self.check()?;
        *lock(&self.allocated) += size;
        Ok(Buffer { buffer, size })
    }

    /// Gives the bytes of dropped buffers back to the account.
    pub(super) fn released(&self, bytes: u64) {
        let mut allocated = lock(&self.allocated);
        *allocated = allocated.saturating_sub(bytes);
    }

    /// Loses the device on purpose, as a driver fault would, for tests of the recovery.
    pub fn lose_device(&self) {
        self.device.destroy();
    }

    /// Like [`Context::lose_device`], after this many more submissions.
    pub fn lose_device_after(&self, submissions: usize) {
        *lock(&self.left) = Some(submissions);
    }

    /// Called before each submission.
    pub(super) fn submitting(&self) {
        let mut left = lock(&self.left);
        match &mut *left {
            Some(0) => {
                *left = None;
                self.lose_device();
            }
            Some(left) => *left -= 1,
            None => {}
        }
    }
}

/// A buffer with its true size.
pub(super) struct Buffer {
    pub buffer: wgpu::Buffer,
    pub size: u64,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // The guarded value is always valid when it is visible, so a panic elsewhere does not matter.
    mutex
        .lock()
        .unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// The adapter to take, and why.
fn choose(options: &GpuOptions) -> Result<(wgpu::Adapter, AdapterSummary, String), GpuError> {
    let variable = std::env::var("WGPU_ADAPTER_NAME").ok();
    let by_variable = options.adapter.is_none() && variable.is_some();
    let wanted = options.adapter.clone().or(variable);
    // GL shows the devices of the other interfaces once more, with less to offer. Asking for it takes time and may
    // write to standard error, so it is asked only where nothing else is there, or to look for a name.
    let mut all = match wanted {
        Some(_) => Vec::new(),
        None => sorted_adapters(!wgpu::Backends::GL),
    };
    if all.iter().all(|(_, s)| s.unsuitable.is_some()) {
        all = sorted_adapters(wgpu::Backends::all());
    }
    let list = || {
        all.iter()
            .enumerate()
            .map(|(i, (_, s))| match s.bus.as_str() {
                "" => format!("\n  {i}: {s}"),
                bus => format!("\n  {i}: {s} at {bus}"),
            })
            .collect::<String>()
    };
    if all.is_empty() {
        return Err(GpuError::NoAdapter(
            "no GPU adapter found: install a Vulkan driver (for a software one: mesa-vulkan-drivers and \
             libvulkan1 on Debian)"
                .to_owned(),
        ));
    }
    let named = |wanted: &String| {
        if let Some(number) = wanted.parse::<usize>().ok().filter(|&i| i < all.len()) {
            return vec![number];
        }
        let wanted = wanted.to_lowercase();
        let is_named = |&i: &usize| {
            let AdapterSummary { name, bus, .. } = &all[i].1;
            name.to_lowercase().contains(&wanted) || bus.to_lowercase() == wanted
        };
        (0..all.len()).filter(is_named).collect()
    };
    let candidates = match &wanted {
        Some(wanted) => named(wanted),
        None => (0..all.len()).collect(),
    };
    let Some(&best) = candidates.first() else {
        return Err(GpuError::NoAdapter(format!(
            "no adapter has \"{}\" in its name or as its PCI address{}; there are:{}",
            wanted.unwrap_or_default(),
            if by_variable {
                " (requested by the variable WGPU_ADAPTER_NAME)"
            } else {
                ""
            },
            list()
        )));
    };
    // A device may appear once more under another interface.
    let merits = |i: usize| {
        let s = &all[i].1;
        (s.kind, &s.api, s.f64, s.unsuitable.is_some())
    };
    let equals: Vec<usize> = (candidates.into_iter())
        .filter(|&i| merits(i) == merits(best))
        .collect();
    let position = equals[options.turn % equals.len()];
    let count = all.len();
    let (adapter, summary) = all
        .into_iter()
        .nth(position)
        .expect("the position was looked up in this list");
    if let Some(reason) = summary.unsuitable.clone() {
        return Err(GpuError::Unsuitable {
            adapter: summary.to_string(),
            reason,
        });
    }
    if options.hardware_only && summary.is_software {
        return Err(GpuError::NoAdapter(
            "the only adapter is a software one, which is used when a GPU is requested".to_owned(),
        ));
    }
    let reason = match (&wanted, by_variable, count) {
        (Some(_), false, _) => "requested by name or number".to_owned(),
        (Some(_), true, _) => "requested by the variable WGPU_ADAPTER_NAME".to_owned(),
        (None, _, 1) => "the only adapter".to_owned(),
        (None, _, _) => {
            format!("first of {count}: a real GPU before a software one, f64 before f32")
        }
    };
    Ok((adapter, summary, reason))
}
