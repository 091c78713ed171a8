//! The kernels: their texts, the composition of these, and their pipelines.
//!
//! Each text exists once; a head that depends on the shape of the blocks and on the precision precedes it: the types,
//! the loads of a block, and the flags.

use super::layout::SLICE;
use crate::backend::{BackendError, Precision};
use std::collections::HashMap;
use std::fmt::{self, Write as _};
use std::sync::{Mutex, PoisonError};

/// Invocations of a workgroup.
pub(super) const WIDTH: u32 = 128;

/// Flags of the kernels.
pub(super) mod flag {
    pub const ADD: u32 = 1;
    pub const NEGATE: u32 = 2;
    pub const BASE: u32 = 4;
    pub const DOT: u32 = 8;
    pub const WRITES_STATE: u32 = 16;
    pub const CONTINUES: u32 = 32;
    pub const FIRST: u32 = 64;
    /// The same numbers as in the kernels.
    pub const ALL: [(&str, u32); 7] = [
        ("ADD", ADD),
        ("NEGATE", NEGATE),
        ("BASE", BASE),
        ("DOT", DOT),
        ("WRITES_STATE", WRITES_STATE),
        ("CONTINUES", CONTINUES),
        ("FIRST", FIRST),
    ];
}

const SMOOTHER: &str = include_str!("../../../shaders/shared/smoother.wgsl");

/// The number type of a stored matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Scalar {
    /// The real numbers of the precision: K.
    Real,
    /// f32: the hierarchy.
    Single,
}

/// Rows and columns of the blocks of a matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Shape {
    rows: usize,
    columns: usize,
}

impl Shape {
    /// The shapes of the plane and of space: finest level, between it and the coarser ones, coarser ones.
    const ALL: [[usize; 2]; 7] = [[2, 2], [2, 3], [3, 2], [3, 3], [3, 6], [6, 3], [6, 6]];

    /// The shape of blocks of this many rows and columns, if there are kernels for it.
    pub fn of(block: [usize; 2]) -> Result<Self, BackendError> {
        let [rows, columns] = block;
        if Self::ALL.contains(&block) {
            Ok(Self { rows, columns })
        } else {
            Err(BackendError::NoKernel { rows, columns })
        }
    }

    /// Entries of a block that are loaded at once, if possible: 16 bytes.
    pub fn group(self, scalar: Scalar, precision: Precision) -> usize {
        match (self.rows * self.columns, scalar, precision) {
            (4, Scalar::Real, Precision::F64) => 2,
            (4, ..) => 4,
            _ => 1,
        }
    }
}

/// Every kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Kernel {
    Start,
    Begin,
    Step,
    Check,
    Dot,
    Direction,
    Rows,
    Add,
    Dense,
    Multiply(Scalar, Shape, Lanes),
    Smooth(Shape, Lanes),
    Diagonal(Shape),
    Patches(Shape, Lanes),
}

/// The invocations of a block row of a matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Lanes {
    One,
    Several,
}

impl Lanes {
    /// This many.
    pub fn of(lanes: u32) -> Self {
        if lanes > 1 { Self::Several } else { Self::One }
    }

    fn text(self) -> &'static str {
        match self {
            Self::One => include_str!("../../../shaders/shared/narrow.wgsl"),
            Self::Several => include_str!("../../../shaders/shared/wide.wgsl"),
        }
    }
}

impl fmt::Display for Kernel {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(self.name())?;
        let (real, Shape { rows, columns }, lanes) = match self {
            Self::Multiply(scalar, shape, lanes) => (*scalar == Scalar::Real, shape, *lanes),
            Self::Smooth(shape, lanes) | Self::Patches(shape, lanes) => (false, shape, *lanes),
            Self::Diagonal(shape) => (false, shape, Lanes::One),
            _ => return Ok(()),
        };
        let what = if real { " K" } else { "" };
        let shared = if lanes == Lanes::One { "" } else { " shared" };
        write!(f, "{what} {rows}×{columns}{shared}")
    }
}

impl Kernel {
    /// Its name, that of its file.
    fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Begin => "begin",
            Self::Step => "step",
            Self::Check => "check",
            Self::Dot => "dot",
            Self::Direction => "direction",
            Self::Rows => "rows",
            Self::Add => "add",
            Self::Dense => "dense",
            Self::Multiply(..) => "multiply",
            Self::Smooth(..) => "smooth",
            Self::Diagonal(_) => "diagonal",
            Self::Patches(..) => "patches",
        }
    }

    /// Its own text.
    fn text(self) -> &'static str {
        match self {
            Self::Start => include_str!("../../../shaders/start.wgsl"),
            Self::Begin => include_str!("../../../shaders/begin.wgsl"),
            Self::Step => include_str!("../../../shaders/step.wgsl"),
            Self::Check => include_str!("../../../shaders/check.wgsl"),
            Self::Dot => include_str!("../../../shaders/dot.wgsl"),
            Self::Direction => include_str!("../../../shaders/direction.wgsl"),
            Self::Add => include_str!("../../../shaders/add.wgsl"),
            Self::Rows => include_str!("../../../shaders/rows.wgsl"),
            Self::Dense => include_str!("../../../shaders/dense.wgsl"),
            Self::Multiply(..) => include_str!("../../../shaders/multiply.wgsl"),
            Self::Smooth(..) => include_str!("../../../shaders/smooth.wgsl"),
            Self::Diagonal(_) => include_str!("../../../shaders/diagonal.wgsl"),
            Self::Patches(..) => include_str!("../../../shaders/patches.wgsl"),
        }
    }

    /// Its declarations for the shape of the blocks.
    fn generated(self, precision: Precision) -> String {
        match self {
            Self::Multiply(scalar, shape, lanes) => {
                types(shape, scalar)
                    + &product(shape, shape.group(scalar, precision))
                    + lanes.text()
                    + &load("b", shape.rows)
                    + &load("y", shape.rows)
                    + &store("y", shape.rows)
            }
            Self::Smooth(shape, lanes) => {
                types(shape, Scalar::Single)
                    + &product(shape, shape.group(Scalar::Single, precision))
                    + lanes.text()
                    + &diagonal(shape.rows)
                    + &["b", "x", "d"].map(|name| load(name, shape.rows)).concat()
                    + &["d", "x_next"].map(|name| store(name, shape.rows)).concat()
                    + SMOOTHER
            }
            Self::Diagonal(shape) => {
                types(shape, Scalar::Single)
                    + &diagonal(shape.rows)
                    + &["b", "x", "d", "x_next"]
                        .map(|name| load(name, shape.rows))
                        .concat()
                    + &["d", "x_next"].map(|name| store(name, shape.rows)).concat()
                    + SMOOTHER
            }
            Self::Patches(shape, lanes) => {
                types(shape, Scalar::Single)
                    + &product(shape, shape.group(Scalar::Single, precision))
                    + lanes.text()
                    + &["d", "y"].map(|name| load(name, shape.rows)).concat()
                    + &["d", "y"].map(|name| store(name, shape.rows)).concat()
            }
            _ => String::new(),
        }
    }

    /// Whether it adds up over workgroups.
    fn reduces(self) -> bool {
        !matches!(
            self,
            Self::Rows
                | Self::Add
                | Self::Dense
                | Self::Smooth(..)
                | Self::Diagonal(_)
                | Self::Patches(..)
        )
    }

    /// The whole text in one precision.
    fn assemble(self, precision: Precision) -> String {
        let mut text = match precision {
            Precision::F64 => "alias real = f64;\nalias real2 = vec2<f64>;\n".to_owned(),
            Precision::F32 => "alias real = f32;\nalias real2 = vec2<f32>;\n".to_owned(),
        };
        for (name, value) in flag::ALL.into_iter().chain([("WIDTH", WIDTH)]) {
            put(&mut text, format_args!("const {name}: u32 = {value}u;\n"));
        }
        text += include_str!("../../../shaders/shared/params.wgsl");
        text += include_str!("../../../shaders/shared/common.wgsl");
        text += &self.generated(precision);
        if self.reduces() {
            text += include_str!("../../../shaders/shared/reduce.wgsl");
        }
        text + self.text()
    }
}

fn put(text: &mut String, what: std::fmt::Arguments) {
    text.write_fmt(what)
        .expect("writing to a string cannot fail");
}

/// The element of an array of vectors in blocks of `size`: pairs are loaded at once.
fn element(size: usize) -> &'static str {
    if size == 2 { "vec2<scalar>" } else { "scalar" }
}

/// The types of matrices and vectors in blocks.
fn types(shape: Shape, scalar: Scalar) -> String {
    let Shape { rows, columns } = shape;
    let scalar = match scalar {
        Scalar::Real => "real",
        Scalar::Single => "f32",
    };
    format!(
        "alias scalar = {scalar};\nconst ROWS: u32 = {rows}u;\nalias Out = array<scalar, {rows}>;\n\
         /// Elements of vectors like M x and like x.\nalias Row = {};\nalias In = {};\n",
        element(rows),
        element(columns)
    )
}

/// The sum over every `stride`th block from `first` on of a block row of M x, for M in slices of 32 block rows, column by column
/// inside a slice; `group` entries of a block are adjacent.
fn product(shape: Shape, group: usize) -> String {
    let Shape { rows, columns } = shape;
    let groups = rows * columns / group;
    let stored = match group {
        1 => "scalar".to_owned(),
        _ => format!("vec{group}<scalar>"),
    };
    let part = |e: usize, size: usize| match size {
        1 => String::new(),
        _ => format!(".{}", ["x", "y", "z", "w"][e % size]),
    };
    let mut text = format!(
        "alias Stored = {stored};\nfn row_times_x(row: u32, first: u32, stride: u32) -> Out {{\n"
    );
    put(
        &mut text,
        format_args!(
            "    let lane = row % {SLICE}u;\n    let end = structure[row / {SLICE}u + 1u];\n"
        ),
    );
    for a in 0..rows {
        put(&mut text, format_args!("    var y{a} = scalar(0.0);\n"));
    }
    put(
        &mut text,
        format_args!(
            "    for (var slot = structure[row / {SLICE}u] + {SLICE}u * first; slot < end; slot += {SLICE}u * stride) {{\n        \
             let column = structure[params.columns + slot + lane];\n        let at = {groups}u * slot + lane;\n"
        ),
    );
    for b in 0..columns {
        let place = match columns {
            2 => "column".to_owned(),
            _ => format!("{columns}u * column + {b}u"),
        };
        let component = if columns == 2 {
            part(b, 2)
        } else {
            String::new()
        };
        put(
            &mut text,
            format_args!("        let x{b} = x[{place}]{component};\n"),
        );
    }
    for g in 0..groups {
        let next = g * SLICE;
        put(
            &mut text,
            format_args!("        let v{g} = values[at + {next}u];\n"),
        );
    }
    for a in 0..rows {
        let terms: Vec<String> = (0..columns)
            .map(|b| {
                let e = a * columns + b;
                format!("v{}{} * x{b}", e / group, part(e, group))
            })
            .collect();
        put(
            &mut text,
            format_args!("        y{a} += {};\n", terms.join(" + ")),
        );
    }
    let all: Vec<String> = (0..rows).map(|a| format!("y{a}")).collect();
    put(
        &mut text,
        format_args!("    }}\n    return Out({});\n}}\n", all.join(", ")),
    );
    text
}

/// Block i of D⁻¹ times r.
fn diagonal(size: usize) -> String {
    let sums: Vec<String> = (0..size)
        .map(|a| {
            let terms: Vec<String> = (0..size)
                .map(|b| format!("inverse_diagonal[at + {}u] * r[{b}]", a * size + b))
                .collect();
            terms.join(" + ")
        })
        .collect();
    format!(
        "fn diagonal_times(i: u32, r: Out) -> Out {{\n    let at = {}u * i;\n    return Out({});\n}}\n",
        size * size,
        sums.join(", ")
    )
}

/// Block i of a vector.
fn load(name: &str, size: usize) -> String {
    let entries = match size {
        2 => "v.x, v.y".to_owned(),
        _ => (0..size)
            .map(|c| format!("{name}[{size}u * i + {c}u]"))
            .collect::<Vec<_>>()
            .join(", "),
    };
    let first = if size == 2 {
        format!("    let v = {name}[i];\n")
    } else {
        String::new()
    };
    format!("fn load_{name}(i: u32) -> Out {{\n{first}    return Out({entries});\n}}\n")
}

/// Writes block i of a vector.
fn store(name: &str, size: usize) -> String {
    let body = match size {
        2 => format!("    {name}[i] = Row(v[0], v[1]);\n"),
        _ => (0..size)
            .map(|c| format!("    {name}[{size}u * i + {c}u] = v[{c}];\n"))
            .collect(),
    };
    format!("fn store_{name}(i: u32, v: Out) {{\n{body}}}\n")
}

/// The pipelines in one precision: those for every run from the start, the others on first use.
pub(super) struct Kernels {
    device: wgpu::Device,
    precision: Precision,
    checked: bool,
    made: Mutex<HashMap<Kernel, wgpu::ComputePipeline>>,
}

impl Kernels {
    pub fn new(device: &wgpu::Device, precision: Precision, checked: bool) -> Self {
        let kernels = Self {
            device: device.clone(),
            precision,
            checked,
            made: Mutex::default(),
        };
        use Kernel::{Begin, Check, Direction, Dot, Rows, Start, Step};
        for kernel in [Start, Begin, Step, Check, Dot, Direction, Rows] {
            kernels.pipeline(kernel);
        }
        kernels
    }

    /// The pipeline of a kernel; it knows the layout of its bindings from the text.
    pub fn pipeline(&self, kernel: Kernel) -> wgpu::ComputePipeline {
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        made.entry(kernel)
            .or_insert_with(|| pipeline(&self.device, kernel, self.precision, self.checked))
            .clone()
    }
}

fn pipeline(
    device: &wgpu::Device,
    kernel: Kernel,
    precision: Precision,
    checked: bool,
) -> wgpu::ComputePipeline {
    let description = wgpu::ShaderModuleDescriptor {
        label: Some(kernel.name()),
        source: wgpu::ShaderSource::Wgsl(kernel.assemble(precision).into()),
    };
    let module = if checked {
        device.create_shader_module(description)
    } else {
        // SAFETY: the indices come from matrices whose constructors check them, vectors are compared with them before a
        // dispatch, the host sets the number of steps of every loop, and the tests run the same kernels with all checks
        // on.
        unsafe {
            device.create_shader_module_trusted(description, wgpu::ShaderRuntimeChecks::unchecked())
        }
    };
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(kernel.name()),
        layout: None,
        module: &module,
        entry_point: Some("main"),
        compilation_options: wgpu::PipelineCompilationOptions {
            // Every kernel writes its workgroup memory before it reads it.
            zero_initialize_workgroup_memory: false,
            ..Default::default()
        },
        cache: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::gpu::{Params, STATE_REALS, STATE_WORDS};
    use wgpu::naga;

    fn all() -> Vec<Kernel> {
        use Kernel::*;
        let shapes = Shape::ALL.map(|block| Shape::of(block).expect("one of them"));
        let mut all = vec![Start, Begin, Step, Check, Dot, Direction, Rows, Add, Dense];
        for shape in shapes {
            for lanes in [Lanes::One, Lanes::Several] {
                all.extend([
                    Multiply(Scalar::Real, shape, lanes),
                    Multiply(Scalar::Single, shape, lanes),
                ]);
                if shape.rows == shape.columns {
                    all.extend([Smooth(shape, lanes), Patches(shape, lanes)]);
                }
            }
            if shape.rows == shape.columns {
                all.push(Diagonal(shape));
            }
        }
        all
    }

    fn parsed(kernel: Kernel, precision: Precision) -> (naga::Module, String) {
        let text = kernel.assemble(precision);
        let what = format!("{kernel:?} in {precision}");
        let module = naga::front::wgsl::parse_str(&text)
            .unwrap_or_else(|error| panic!("{what}: {}", error.emit_to_string(&text)));
        (module, text)
    }

    #[test]
    fn every_kernel_is_valid_in_every_precision() {
        for kernel in all() {
            for precision in [Precision::F64, Precision::F32] {
                let (module, text) = parsed(kernel, precision);
                // f32 must not need the feature that an f32-only adapter lacks.
                let capabilities = match precision {
                    Precision::F64 => naga::valid::Capabilities::FLOAT64,
                    Precision::F32 => naga::valid::Capabilities::empty(),
                };
                naga::valid::Validator::new(naga::valid::ValidationFlags::all(), capabilities)
                    .validate(&module)
                    .unwrap_or_else(|error| {
                        panic!("{kernel:?} in {precision}: {}", error.emit_to_string(&text))
                    });
            }
        }
    }

    /// Writes every module in f32 to a folder, for `tests/webgpu.sh`.
    #[test]
    #[ignore = "writes files for tests/webgpu.sh"]
    fn write_modules() {
        let folder = std::env::var("SIGNORINI_WGSL").expect("a folder for the modules");
        for kernel in all() {
            let name = kernel.to_string().replace(' ', "_").replace('×', "x");
            let path = format!("{folder}/{name}.wgsl");
            std::fs::write(path, kernel.assemble(Precision::F32)).expect("the folder is there");
        }
    }

    /// A buffer bound twice in a dispatch is only read, and no kernel uses more buffers than an adapter must have.
    #[test]
    fn bindings_agree_with_the_host() {
        for kernel in all() {
            let (module, _) = parsed(kernel, Precision::F64);
            let mut storage: Vec<(u32, String, bool)> = Vec::new();
            for (_, variable) in module.global_variables.iter() {
                let Some(naga::ResourceBinding { group, binding }) = variable.binding else {
                    continue;
                };
                assert_eq!(group, 0, "{kernel:?}");
                let name = variable.name.clone().expect("it has one");
                match variable.space {
                    naga::AddressSpace::Uniform => assert_eq!((binding, &*name), (0, "params")),
                    naga::AddressSpace::Storage { access } => {
                        let writes = access.contains(naga::StorageAccess::STORE);
                        storage.push((binding, name, writes));
                    }
                    space => panic!("{kernel:?}: {name} in {space:?}"),
                }
            }
            storage.sort();
            assert!(storage.len() <= 8, "{kernel:?}");
            assert!(storage.iter().map(|s| s.0).eq(1..=storage.len() as u32));
            let written: Vec<&str> = (storage.iter())
                .filter(|s| s.2)
                .map(|s| s.1.as_str())
                .collect();
            let expected: &[&str] = match kernel {
                Kernel::Start => &["x", "rounded", "partials"],
                Kernel::Begin => &["partials", "state", "next"],
                Kernel::Step => &["next", "partials", "x", "r", "rounded"],
                Kernel::Check => &["partials", "next"],
                Kernel::Dot => &["partials"],
                Kernel::Direction => &["next", "partials", "p"],
                Kernel::Rows | Kernel::Add => &["y"],
                Kernel::Dense => &["x"],
                Kernel::Multiply(..) => &["y", "partials"],
                Kernel::Smooth(..) | Kernel::Diagonal(_) => &["d", "x_next"],
                Kernel::Patches(..) => &["d", "y"],
            };
            assert_eq!(written, expected, "{kernel:?}");
        }
    }

    /// Structures defined both in Rust and in WGSL agree, member by member.
    #[test]
    fn structures_are_laid_out_as_the_host_has_them() {
        let members = |precision, name: &str| -> Vec<(String, u32)> {
            let (module, _) = parsed(Kernel::Begin, precision);
            let (_, found) = (module.types.iter())
                .find(|(_, t)| t.name.as_deref() == Some(name))
                .unwrap_or_else(|| panic!("no {name}"));
            let naga::TypeInner::Struct { members, .. } = &found.inner else {
                panic!("{name} is no structure")
            };
            (members.iter())
                .map(|m| (m.name.clone().expect("it has one"), m.offset))
                .collect()
        };
        let params = members(Precision::F64, "Params");
        let here = [
            ("count", std::mem::offset_of!(Params, count)),
            ("first", std::mem::offset_of!(Params, first)),
            ("first_partial", std::mem::offset_of!(Params, first_partial)),
            ("first_read", std::mem::offset_of!(Params, first_read)),
            ("n_read", std::mem::offset_of!(Params, n_read)),
            ("columns", std::mem::offset_of!(Params, columns)),
            ("flags", std::mem::offset_of!(Params, flags)),
            ("lanes", std::mem::offset_of!(Params, lanes)),
            ("c1", std::mem::offset_of!(Params, steps)),
            ("c2", std::mem::offset_of!(Params, steps) + 4),
        ];
        assert_eq!(params, here.map(|(name, at)| (name.to_owned(), at as u32)));
        for (precision, bytes) in [(Precision::F64, 8), (Precision::F32, 4)] {
            let at = |i: usize, size: usize, start: usize| (start + i * size) as u32;
            let reals = STATE_REALS.iter().enumerate();
            let words = STATE_WORDS.iter().enumerate();
            let here: Vec<(String, u32)> = reals
                .map(|(i, name)| ((*name).to_owned(), at(i, bytes, 0)))
                .chain(
                    words
                        .map(|(i, name)| ((*name).to_owned(), at(i, 4, bytes * STATE_REALS.len()))),
                )
                .collect();
            assert_eq!(members(precision, "State"), here);
            let goals = [
                "residual_part",
                "residual",
                "remaining",
                "remaining_part",
                "to_come",
            ];
            let here = goals.iter().enumerate();
            let here: Vec<_> = here
                .map(|(i, n)| ((*n).to_owned(), at(i, bytes, 0)))
                .collect();
            assert_eq!(members(precision, "Goals"), here);
        }
    }

    #[test]
    fn other_shapes_are_refused() {
        assert!(Shape::of([6, 6]).is_ok());
        for block in [[1, 1], [2, 6], [4, 4], [6, 2]] {
            assert!(matches!(
                Shape::of(block),
                Err(BackendError::NoKernel { .. })
            ));
        }
    }
}
