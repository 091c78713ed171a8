//! `signorini adapters`.

use signorini::backend::gpu;

pub fn run() -> Result<u8, String> {
    let adapters = gpu::adapters();
    if adapters.is_empty() {
        super::print(
            "no adapter: everything runs on the CPU.\n\
             A GPU needs its Vulkan, Metal or DX12 driver; a software adapter for trying things out comes\n\
             with the packages mesa-vulkan-drivers and libvulkan1 (Debian, Ubuntu).\n",
        )?;
        return Ok(0);
    }
    for (number, adapter) in adapters.iter().enumerate() {
        let yes_no = |yes| if yes { "yes" } else { "no" };
        let memory = match adapter.memory {
            Some(bytes) => format!("{} MiB", bytes >> 20),
            None => "not told".to_owned(),
        };
        let place = match adapter.bus.as_str() {
            "" => String::new(),
            bus => format!(" at {bus}"),
        };
        let used = match &adapter.unsuitable {
            Some(reason) => format!("cannot be used: {reason}"),
            None if adapter.f64 => "f64 kernels".to_owned(),
            None => "f32 kernels inside f64 refinement".to_owned(),
        };
        super::print(&format!(
            "{number}: {adapter}{place}\n   {used}\n   driver {}\n   f64 {}, subgroups {}, timestamps {}\n   \
             memory {memory}, one binding {} MiB, one buffer {} MiB\n",
            adapter.driver,
            yes_no(adapter.f64),
            yes_no(adapter.subgroups),
            yes_no(adapter.timestamps),
            adapter.max_binding >> 20,
            adapter.max_buffer >> 20,
        ))?;
    }
    Ok(0)
}
