//! The kernels: their sources, how they are put together, what they bind.

use super::Precision;
use std::collections::HashMap;

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
    MgLoad,
    MgBegin,
    MgStep1,
    MgCheck,
    MgDot,
    MgStep2,
    DenseApply,
    ChebyshevFirst(Shape),
    ChebyshevStep(Shape),
    LevelMultiply(Shape),
}

/// Rows and columns of the blocks of a matrix of the multigrid hierarchy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Shape {
    S2x2,
    S2x3,
    S3x2,
    S3x3,
}

impl Shape {
    /// The shape of blocks of so many rows and columns.
    pub fn of(block: [usize; 2]) -> Self {
        match block {
            [2, 2] => Self::S2x2,
            [2, 3] => Self::S2x3,
            [3, 2] => Self::S3x2,
            _ => Self::S3x3,
        }
    }

    fn sizes(self) -> [usize; 2] {
        match self {
            Self::S2x2 => [2, 2],
            Self::S2x3 => [2, 3],
            Self::S3x2 => [3, 2],
            Self::S3x3 => [3, 3],
        }
    }
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
const PARAMS: &str = include_str!("../../../shaders/shared/params.wgsl");
const LEVEL: &str = include_str!("../../../shaders/shared/level.wgsl");
const PRODUCT: &str = include_str!("../../../shaders/shared/product.wgsl");
const PRECONDITION: &str = include_str!("../../../shaders/shared/precondition.wgsl");
const BLOCK_F32: &str = include_str!("../../../shaders/shared/block_f32.wgsl");
const BLOCK_F64: &str = include_str!("../../../shaders/shared/block_f64.wgsl");

use Access::{Read, ReadWrite, Uniform};

/// All kernels. Each names its bindings in order, the uniform first.
fn sources() -> Vec<Source> {
    let mut sources = vec![
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
        Source {
            kernel: Kernel::MgLoad,
            name: "mg_load",
            text: include_str!("../../../shaders/mg_load.wgsl"),
            shared: &[REDUCE],
            bindings: &[Uniform, Read, ReadWrite, ReadWrite, ReadWrite],
        },
        Source {
            kernel: Kernel::MgBegin,
            name: "mg_begin",
            text: include_str!("../../../shaders/mg_begin.wgsl"),
            shared: &[REDUCE],
            bindings: &[Uniform, Read, ReadWrite, ReadWrite, ReadWrite],
        },
        Source {
            kernel: Kernel::MgStep1,
            name: "mg_step_1",
            text: include_str!("../../../shaders/mg_step_1.wgsl"),
            shared: &[REDUCE],
            bindings: &[
                Uniform, Read, ReadWrite, ReadWrite, Read, Read, ReadWrite, ReadWrite, ReadWrite,
            ],
        },
        Source {
            kernel: Kernel::MgCheck,
            name: "mg_check",
            text: include_str!("../../../shaders/mg_check.wgsl"),
            shared: &[REDUCE],
            bindings: &[Uniform, Read, ReadWrite, ReadWrite],
        },
        Source {
            kernel: Kernel::MgDot,
            name: "mg_dot",
            text: include_str!("../../../shaders/mg_dot.wgsl"),
            shared: &[REDUCE],
            bindings: &[Uniform, Read, Read, Read, ReadWrite],
        },
        Source {
            kernel: Kernel::MgStep2,
            name: "mg_step_2",
            text: include_str!("../../../shaders/mg_step_2.wgsl"),
            shared: &[REDUCE],
            bindings: &[Uniform, Read, ReadWrite, ReadWrite, Read, ReadWrite],
        },
        Source {
            kernel: Kernel::DenseApply,
            name: "dense_apply",
            text: include_str!("../../../shaders/dense_apply.wgsl"),
            shared: &[],
            bindings: &[Uniform, Read, Read, Read, ReadWrite],
        },
    ];
    for shape in [Shape::S2x2, Shape::S3x3] {
        sources.push(Source {
            kernel: Kernel::ChebyshevFirst(shape),
            name: "chebyshev_first",
            text: include_str!("../../../shaders/chebyshev_first.wgsl"),
            shared: &[],
            bindings: &[Uniform, Read, Read, Read, ReadWrite, ReadWrite],
        });
        sources.push(Source {
            kernel: Kernel::ChebyshevStep(shape),
            name: "chebyshev_step",
            text: include_str!("../../../shaders/chebyshev_step.wgsl"),
            shared: &[PRODUCT],
            bindings: &[
                Uniform, Read, Read, Read, Read, Read, Read, ReadWrite, ReadWrite,
            ],
        });
    }
    for shape in [Shape::S2x2, Shape::S2x3, Shape::S3x2, Shape::S3x3] {
        sources.push(Source {
            kernel: Kernel::LevelMultiply(shape),
            name: "level_multiply",
            text: include_str!("../../../shaders/level_multiply.wgsl"),
            shared: &[PRODUCT],
            bindings: &[Uniform, Read, Read, Read, Read, Read, ReadWrite],
        });
    }
    sources
}

/// What the kernels of the levels need to know of the shape of the blocks.
fn shape_text(shape: Shape) -> String {
    let [rows, columns] = shape.sizes();
    let component = ["x", "y", "z"];
    let products: Vec<String> = (0..rows)
        .map(|i| {
            (0..columns)
                .map(|j| {
                    format!(
                        "values[at + {}u] * x.{}",
                        32 * (i * columns + j),
                        component[j]
                    )
                })
                .collect::<Vec<_>>()
                .join(" + ")
        })
        .collect();
    let entries: Vec<String> = (0..columns)
        .map(|j| format!("x[{columns}u * column + {j}u]"))
        .collect();
    format!(
        "const ROWS: u32 = {rows}u;\nconst COLUMNS: u32 = {columns}u;\n\
         alias Out = vec{rows}<f32>;\nalias In = vec{columns}<f32>;\n\
         fn block_times(at: u32, x: In) -> Out {{ return Out({}); }}\n\
         fn load_column(column: u32) -> In {{ return In({}); }}\n",
        products.join(", "),
        entries.join(", ")
    )
}

/// The whole text of a kernel in one precision.
fn assemble(source: &Source, precision: Precision) -> String {
    let (types, block) = match precision {
        Precision::F64 => ("alias real = f64;\nalias real2 = vec2<f64>;\n", BLOCK_F64),
        Precision::F32 => ("alias real = f32;\nalias real2 = vec2<f32>;\n", BLOCK_F32),
    };
    let shared = source.shared.concat();
    let special = match source.kernel {
        Kernel::Multiply => block.to_owned(),
        Kernel::ChebyshevFirst(shape) => {
            let [rows, _] = shape.sizes();
            format!("const ROWS: u32 = {rows}u;\n{LEVEL}")
        }
        Kernel::ChebyshevStep(shape) | Kernel::LevelMultiply(shape) => shape_text(shape) + LEVEL,
        Kernel::DenseApply => String::new(),
        _ => PARAMS.to_owned(),
    };
    let params = if source.kernel == Kernel::Multiply {
        PARAMS
    } else {
        ""
    };
    [types, COMMON, params, &special, &shared, source.text].join("\n")
}

/// Pipelines of all kernels in one precision.
pub(super) struct Kernels(HashMap<Kernel, (wgpu::BindGroupLayout, wgpu::ComputePipeline)>);

impl Kernels {
    pub fn new(device: &wgpu::Device, precision: Precision, checked: bool) -> Self {
        let pipelines = sources()
            .into_iter()
            .map(|source| (source.kernel, pipeline(device, &source, precision, checked)));
        Self(pipelines.collect())
    }

    pub fn pipeline(&self, kernel: Kernel) -> &wgpu::ComputePipeline {
        &self.0[&kernel].1
    }

    pub fn layout(&self, kernel: Kernel) -> &wgpu::BindGroupLayout {
        &self.0[&kernel].0
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
        for source in &sources() {
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
