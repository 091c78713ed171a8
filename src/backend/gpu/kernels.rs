//! The kernels: their sources, how they are put together, what they bind.

use super::Precision;

/// How a kernel uses a binding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Access {
    Uniform,
    Read,
    ReadWrite,
}

/// Every kernel; the name of its entry point is that of its file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Kernel {
    Multiply,
    Rows,
    CgStart,
    CgBegin,
    CgStep1,
    CgStep2,
}

/// Name, source, text that the source needs before it, and bindings.
struct Source {
    kernel: Kernel,
    name: &'static str,
    text: &'static str,
    shared: &'static [&'static str],
    bindings: &'static [Access],
}

const COMMON: &str = include_str!("../../../shaders/shared/common.wgsl");
const REDUCE: &str = include_str!("../../../shaders/shared/reduce.wgsl");
const PRECONDITION: &str = include_str!("../../../shaders/shared/precondition.wgsl");
const BLOCK_F32: &str = include_str!("../../../shaders/shared/block_f32.wgsl");
const BLOCK_F64: &str = include_str!("../../../shaders/shared/block_f64.wgsl");

use Access::{Read, ReadWrite, Uniform};

const SOURCES: [Source; 6] = [
    Source {
        kernel: Kernel::Multiply,
        name: "multiply",
        text: include_str!("../../../shaders/multiply.wgsl"),
        shared: &[REDUCE],
        bindings: &[
            Uniform, Read, Read, Read, Read, Read, Read, ReadWrite, ReadWrite,
        ],
    },
    Source {
        kernel: Kernel::Rows,
        name: "rows",
        text: include_str!("../../../shaders/rows.wgsl"),
        shared: &[],
        bindings: &[Uniform, Read, Read, Read, Read, Read, ReadWrite],
    },
    Source {
        kernel: Kernel::CgStart,
        name: "cg_start",
        text: include_str!("../../../shaders/cg_start.wgsl"),
        shared: &[REDUCE, PRECONDITION],
        bindings: &[Uniform, Read, Read, ReadWrite, ReadWrite, ReadWrite],
    },
    Source {
        kernel: Kernel::CgBegin,
        name: "cg_begin",
        text: include_str!("../../../shaders/cg_begin.wgsl"),
        shared: &[REDUCE],
        bindings: &[Uniform, Read, ReadWrite, ReadWrite],
    },
    Source {
        kernel: Kernel::CgStep1,
        name: "cg_step_1",
        text: include_str!("../../../shaders/cg_step_1.wgsl"),
        shared: &[REDUCE, PRECONDITION],
        bindings: &[
            Uniform, Read, ReadWrite, ReadWrite, Read, Read, Read, ReadWrite, ReadWrite,
        ],
    },
    Source {
        kernel: Kernel::CgStep2,
        name: "cg_step_2",
        text: include_str!("../../../shaders/cg_step_2.wgsl"),
        shared: &[REDUCE, PRECONDITION],
        bindings: &[Uniform, Read, ReadWrite, ReadWrite, Read, Read, ReadWrite],
    },
];

/// The whole text of a kernel in one precision.
fn assemble(source: &Source, precision: Precision) -> String {
    let (types, block) = match precision {
        Precision::F64 => ("alias real = f64;\nalias real2 = vec2<f64>;\n", BLOCK_F64),
        Precision::F32 => ("alias real = f32;\nalias real2 = vec2<f32>;\n", BLOCK_F32),
    };
    let mut text = [types, COMMON, &source.shared.concat(), source.text].join("\n");
    if source.kernel == Kernel::Multiply {
        text.push_str(block);
    }
    text
}

/// Pipelines of all kernels in one precision.
pub(super) struct Kernels(Vec<(wgpu::BindGroupLayout, wgpu::ComputePipeline)>);

impl Kernels {
    pub fn new(device: &wgpu::Device, precision: Precision, checked: bool) -> Self {
        Self(
            SOURCES
                .iter()
                .map(|source| pipeline(device, source, precision, checked))
                .collect(),
        )
    }

    pub fn pipeline(&self, kernel: Kernel) -> &wgpu::ComputePipeline {
        &self.0[kernel as usize].1
    }

    pub fn layout(&self, kernel: Kernel) -> &wgpu::BindGroupLayout {
        &self.0[kernel as usize].0
    }
}

fn pipeline(
    device: &wgpu::Device,
    source: &Source,
    precision: Precision,
    checked: bool,
) -> (wgpu::BindGroupLayout, wgpu::ComputePipeline) {
    let entries: Vec<_> = source
        .bindings
        .iter()
        .enumerate()
        .map(|(binding, access)| wgpu::BindGroupLayoutEntry {
            binding: binding as u32,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: match access {
                    Uniform => wgpu::BufferBindingType::Uniform,
                    Read => wgpu::BufferBindingType::Storage { read_only: true },
                    ReadWrite => wgpu::BufferBindingType::Storage { read_only: false },
                },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        })
        .collect();
    let bindings = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some(source.name),
        entries: &entries,
    });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(source.name),
        bind_group_layouts: &[Some(&bindings)],
        immediate_size: 0,
    });
    let description = wgpu::ShaderModuleDescriptor {
        label: Some(source.name),
        source: wgpu::ShaderSource::Wgsl(assemble(source, precision).into()),
    };
    let module = if checked {
        device.create_shader_module(description)
    } else {
        // SAFETY: the indices come from matrices that the host has checked, every loop ends after a number
        // of steps that the host has set, and the tests run the same kernels with all checks on.
        unsafe {
            device.create_shader_module_trusted(description, wgpu::ShaderRuntimeChecks::unchecked())
        }
    };
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(source.name),
        layout: Some(&layout),
        module: &module,
        entry_point: Some(source.name),
        compilation_options: wgpu::PipelineCompilationOptions {
            // Every kernel writes its workgroup memory before it reads it.
            zero_initialize_workgroup_memory: false,
            ..Default::default()
        },
        cache: None,
    });
    (bindings, pipeline)
}

#[cfg(test)]
mod tests {
    use super::*;
    use wgpu::naga;

    #[test]
    fn every_kernel_is_valid_in_every_precision() {
        for (index, source) in SOURCES.iter().enumerate() {
            assert_eq!(
                source.kernel as usize, index,
                "the table is in the order of the enum"
            );
            for precision in [Precision::F64, Precision::F32] {
                let text = assemble(source, precision);
                let module = naga::front::wgsl::parse_str(&text).unwrap_or_else(|error| {
                    panic!(
                        "{} in {precision}: {}",
                        source.name,
                        error.emit_to_string(&text)
                    )
                });
                // f32 must not need the feature that an f32-only adapter lacks.
                let capabilities = match precision {
                    Precision::F64 => naga::valid::Capabilities::FLOAT64,
                    Precision::F32 => naga::valid::Capabilities::empty(),
                };
                naga::valid::Validator::new(naga::valid::ValidationFlags::all(), capabilities)
                    .validate(&module)
                    .unwrap_or_else(|error| {
                        panic!(
                            "{} in {precision}: {}",
                            source.name,
                            error.emit_to_string(&text)
                        )
                    });
                let bound = module
                    .global_variables
                    .iter()
                    .filter(|(_, variable)| variable.binding.is_some())
                    .count();
                assert_eq!(bound, source.bindings.len(), "bindings of {}", source.name);
            }
        }
    }
}
