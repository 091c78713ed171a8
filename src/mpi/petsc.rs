//! The parts of PETSc in use, with owners that release them: the only place where its C interface is called.
//!
//! `build.rs` writes the interface from PETSc's own headers. Every call is collective unless it is about local values.

use crate::ranks::Group;
use crate::sparse::{add_times, dot};
use crate::stiffness::amg::RowsBelow;
use mpi::traits::AsRaw;
use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::ptr::{null, null_mut};

/// The interface as bindgen writes it.
#[allow(
    non_camel_case_types,
    non_snake_case,
    non_upper_case_globals,
    dead_code,
    missing_docs,
    clippy::all
)]
mod sys {
    include!(concat!(env!("OUT_DIR"), "/petsc.rs"));
}

use sys::PetscInt as Int;

/// PETSC_DECIDE: PETSc derives it from the sizes on all ranks.
const DECIDE: Int = -1;

/// PETSc has failed.
#[derive(Clone, Debug, thiserror::Error)]
#[error("PETSc: {0}")]
pub struct PetscError(String);

thread_local! {
    /// PETSc's message about the last error, from where it was detected first.
    static SAID: RefCell<String> = const { RefCell::new(String::new()) };
}

/// PETSc's flags, which are numbers in some versions.
trait Flag {
    fn of(on: bool) -> Self;
    fn is_on(&self) -> bool;
}

impl Flag for bool {
    fn of(on: bool) -> Self {
        on
    }
    fn is_on(&self) -> bool {
        *self
    }
}

impl Flag for u32 {
    fn of(on: bool) -> Self {
        on.into()
    }
    fn is_on(&self) -> bool {
        *self != 0
    }
}

/// Records the message of an error, and lets the call return it: nothing is printed.
unsafe extern "C" fn take_down(
    _: mpi::ffi::MPI_Comm,
    _: c_int,
    _: *const c_char,
    _: *const c_char,
    code: sys::PetscErrorCode,
    kind: sys::PetscErrorType,
    text: *const c_char,
    _: *mut c_void,
) -> sys::PetscErrorCode {
    if kind == sys::PetscErrorType_PETSC_ERROR_INITIAL && !text.is_null() {
        // SAFETY: PETSc returns a C string.
        let text = unsafe { CStr::from_ptr(text) }.to_string_lossy();
        SAID.with(|said| text.trim().clone_into(&mut said.borrow_mut()));
    }
    code
}

/// Its error, in words.
fn check(code: sys::PetscErrorCode) -> Result<(), PetscError> {
    if code == 0 {
        return Ok(());
    }
    let mut text = null();
    // SAFETY: `text` is set to a static string, or unchanged.
    let known =
        unsafe { sys::PetscErrorMessage(code, &mut text, null_mut()) } == 0 && !text.is_null();
    let mut message = format!("error {code}");
    if known {
        // SAFETY: as above.
        let text = unsafe { CStr::from_ptr(text) }.to_string_lossy();
        message += &format!(": {text}");
    }
    let said = SAID.with(|said| std::mem::take(&mut *said.borrow_mut()));
    if !said.is_empty() {
        message += &format!(" ({said})");
    }
    Err(PetscError(message))
}

/// A call, and its error if it has one.
macro_rules! petsc {
    ($name:ident($($argument:expr),* $(,)?)) => {
        // SAFETY: handles come from PETSc and live as long as their owners; arrays have the stated sizes, and result pointers
        // refer to variables of this function.
        check(unsafe { sys::$name($($argument),*) })?
    };
}

fn text(text: &str) -> CString {
    CString::new(text).expect("no zero bytes")
}

/// A size or an index as PETSc counts.
fn int(n: usize) -> Result<Int, PetscError> {
    Int::try_from(n).map_err(|_| {
        PetscError(format!(
            "{n} exceeds the indices of this PETSc: use one with 64-bit indices (--with-64-bit-indices; on Debian \
             libpetsc64-real-dev)"
        ))
    })
}

/// Starts PETSc unless it is running. Options in the variable PETSC_OPTIONS override all options stated here.
pub(super) fn start() -> Result<(), PetscError> {
    let mut is_on = Flag::of(false);
    petsc!(PetscInitialized(&mut is_on));
    if !is_on.is_on() {
        // Ctrl-C is the program's matter, and a fault shall show where it happens.
        let name = text("-no_signal_handler");
        petsc!(PetscOptionsSetValue(null_mut(), name.as_ptr(), null()));
        petsc!(PetscInitializeNoArguments());
    }
    petsc!(PetscPushErrorHandler(Some(take_down), null_mut()));
    Ok(())
}

/// Ends PETSc; nothing of it may be used any more.
pub(super) fn finish() {
    let mut is_on = Flag::of(false);
    // SAFETY: the pointer refers to a flag, and the caller holds nothing of PETSc any more. An error has no consequence
    // here.
    unsafe {
        sys::PetscInitialized(&mut is_on);
        if is_on.is_on() {
            sys::PetscFinalize();
        }
    }
}

/// Its version, and whether it counts in 64 bits.
fn version() -> String {
    let (mut major, mut minor, mut patch, mut release): (Int, Int, Int, Int) = (0, 0, 0, 0);
    // SAFETY: four places for numbers.
    unsafe { sys::PetscGetVersionNumber(&mut major, &mut minor, &mut patch, &mut release) };
    format!(
        "PETSc {major}.{minor}.{patch} with {}-bit indices",
        Int::BITS
    )
}

/// Sets options of PETSc, unless the user has set them in PETSC_OPTIONS.
pub(super) fn set_options(options: &[(&str, &str)]) -> Result<(), PetscError> {
    for (name, value) in options {
        let (name, value) = (text(name), text(value));
        let mut is_set = Flag::of(false);
        petsc!(PetscOptionsHasName(
            null_mut(),
            null(),
            name.as_ptr(),
            &mut is_set
        ));
        if !is_set.is_on() {
            petsc!(PetscOptionsSetValue(
                null_mut(),
                name.as_ptr(),
                value.as_ptr()
            ));
        }
    }
    Ok(())
}

/// A distributed vector with some blocks on each rank.
pub(super) struct Vector {
    raw: sys::Vec,
}

impl Drop for Vector {
    fn drop(&mut self) {
        // SAFETY: this is its owner. An error has no consequence here.
        unsafe { sys::VecDestroy(&mut self.raw) };
    }
}

impl Vector {
    /// The numbers of this rank.
    pub fn read<T>(&self, work: impl FnOnce(&[f64]) -> T) -> Result<T, PetscError> {
        with_array(self.raw, |values| work(values))
    }

    /// The same, to change them.
    pub fn write<T>(&mut self, work: impl FnOnce(&mut [f64]) -> T) -> Result<T, PetscError> {
        with_array(self.raw, work)
    }
}

/// The local numbers of a vector.
fn with_array<T>(raw: sys::Vec, work: impl FnOnce(&mut [f64]) -> T) -> Result<T, PetscError> {
    let (mut values, mut len) = (null_mut(), 0);
    petsc!(VecGetLocalSize(raw, &mut len));
    petsc!(VecGetArray(raw, &mut values));
    let made = if len == 0 {
        work(&mut [])
    } else {
        // SAFETY: PETSc guarantees so many numbers, and nobody else uses them until they are released.
        work(unsafe { std::slice::from_raw_parts_mut(values, len as usize) })
    };
    petsc!(VecRestoreArray(raw, &mut values));
    Ok(made)
}

/// A square matrix in blocks with some rows on each rank.
pub(super) struct Matrix {
    raw: sys::Mat,
}

impl Drop for Matrix {
    fn drop(&mut self) {
        // SAFETY: this is its owner. An error has no consequence here.
        unsafe { sys::MatDestroy(&mut self.raw) };
    }
}

impl Matrix {
    /// From the block rows of this rank, with their near-null space.
    pub fn new(group: &Group, rows: &RowsBelow) -> Result<Self, PetscError> {
        let (block, own, first) = (rows.block, rows.halo.own(), rows.halo.first() as usize);
        let mut raw = null_mut();
        petsc!(MatCreate(group.communicator().as_raw(), &mut raw));
        let matrix = Self { raw };
        let local = int(block * own)?;
        petsc!(MatSetSizes(raw, local, local, DECIDE, DECIDE));
        petsc!(MatSetBlockSize(raw, int(block)?));
        let kind = text("aij");
        petsc!(MatSetType(raw, kind.as_ptr()));
        let columns = |i: usize| &rows.col_idx[rows.row_ptr[i]..rows.row_ptr[i + 1]];
        let entries = |is_own: bool| {
            let each = (0..own).flat_map(|i| {
                let blocks = columns(i)
                    .iter()
                    .filter(|&&j| ((j as usize) < own) == is_own);
                let count = block * blocks.count();
                std::iter::repeat_n(int(count), block)
            });
            each.collect::<Result<Vec<Int>, _>>()
        };
        let (here, there) = (entries(true)?, entries(false)?);
        petsc!(MatSeqAIJSetPreallocation(raw, 0, here.as_ptr()));
        petsc!(MatMPIAIJSetPreallocation(
            raw,
            0,
            here.as_ptr(),
            0,
            there.as_ptr()
        ));
        let (mut numbers, mut values) = (Vec::new(), Vec::new());
        for i in 0..own {
            numbers.clear();
            for &j in columns(i) {
                numbers.push(int(rows.halo.number(j as usize) as usize)?);
            }
            let size = block * block;
            let blocks = &rows.entries[size * rows.row_ptr[i]..size * rows.row_ptr[i + 1]];
            values.clear();
            for row in 0..block {
                let of_row = blocks
                    .chunks(size)
                    .flat_map(|entries| &entries[block * row..][..block]);
                values.extend(of_row);
            }
            let row = int(first + i)?;
            petsc!(MatSetValuesBlocked(
                raw,
                1,
                &row,
                int(numbers.len())?,
                numbers.as_ptr(),
                values.as_ptr(),
                sys::InsertMode_INSERT_VALUES,
            ));
        }
        petsc!(MatAssemblyBegin(
            raw,
            sys::MatAssemblyType_MAT_FINAL_ASSEMBLY
        ));
        petsc!(MatAssemblyEnd(raw, sys::MatAssemblyType_MAT_FINAL_ASSEMBLY));
        petsc!(MatSetOption(raw, sys::MatOption_MAT_SPD, Flag::of(true)));
        matrix.set_near_null_space(group, orthonormal(rows))?;
        Ok(matrix)
    }

    /// A vector of zeros that it can be multiplied with.
    pub fn vector(&self) -> Result<Vector, PetscError> {
        let mut raw = null_mut();
        petsc!(MatCreateVecs(self.raw, &mut raw, null_mut()));
        let vector = Vector { raw };
        petsc!(VecSet(raw, 0.0));
        Ok(vector)
    }

    /// Sets orthonormal vectors that it hardly changes.
    fn set_near_null_space(&self, group: &Group, modes: Vec<Vec<f64>>) -> Result<(), PetscError> {
        let mut vectors = Vec::new();
        for mode in modes {
            let mut vector = self.vector()?;
            vector.write(|to| to.copy_from_slice(&mode))?;
            vectors.push(vector);
        }
        let raw: Vec<sys::Vec> = vectors.iter().map(|vector| vector.raw).collect();
        let mut space = null_mut();
        petsc!(MatNullSpaceCreate(
            group.communicator().as_raw(),
            Flag::of(false),
            int(raw.len())?,
            raw.as_ptr(),
            &mut space
        ));
        petsc!(MatSetNearNullSpace(self.raw, space));
        petsc!(MatNullSpaceDestroy(&mut space));
        Ok(())
    }
}

/// A mode whose part that is orthogonal to those before is below this part of it depends on them.
const DEPENDENT: f64 = 1e-8;

/// An orthonormal basis of the near-null space, by Gram–Schmidt, each vector twice.
fn orthonormal(rows: &RowsBelow) -> Vec<Vec<f64>> {
    let (count, ranks) = (rows.n_modes, rows.halo.ranks());
    let mut basis: Vec<Vec<f64>> = Vec::with_capacity(count);
    for k in 0..count {
        let mut mode: Vec<f64> = rows.modes.iter().skip(k).step_by(count).copied().collect();
        let full = ranks.norm(&mode);
        for _ in 0..2 {
            let mut parts: Vec<f64> = basis.iter().map(|v| dot(v, &mode)).collect();
            ranks.sum(&mut parts);
            (basis.iter().zip(parts)).for_each(|(v, part)| add_times(-part, v, &mut mode));
        }
        let left = ranks.norm(&mode);
        if left > DEPENDENT * full {
            mode.iter_mut().for_each(|v| *v /= left);
            basis.push(mode);
        }
    }
    basis
}

/// z ≈ A⁻¹r.
pub(super) struct Preconditioner {
    raw: sys::PC,
    /// It must not outlive its matrix.
    matrix: Matrix,
    r: Vector,
    z: Vector,
}

impl Drop for Preconditioner {
    fn drop(&mut self) {
        // SAFETY: this is its owner. An error has no consequence here.
        unsafe { sys::PCDestroy(&mut self.raw) };
    }
}

// SAFETY: PETSc makes its calls in whichever thread asks, and ranks make collective calls in one order, one at a time, as
// `crate::ranks::Group` has it.
unsafe impl Send for Preconditioner {}

impl Preconditioner {
    /// With the options of this prefix.
    pub fn new(group: &Group, matrix: Matrix, prefix: &str) -> Result<Self, PetscError> {
        let mut raw = null_mut();
        petsc!(PCCreate(group.communicator().as_raw(), &mut raw));
        let made = Self {
            raw,
            r: matrix.vector()?,
            z: matrix.vector()?,
            matrix,
        };
        let prefix = text(prefix);
        petsc!(PCSetOptionsPrefix(raw, prefix.as_ptr()));
        petsc!(PCSetOperators(raw, made.matrix.raw, made.matrix.raw));
        petsc!(PCSetFromOptions(raw));
        petsc!(PCSetUp(raw));
        let mut failed = 0;
        petsc!(PCGetFailedReason(raw, &mut failed));
        if failed != 0 {
            return Err(PetscError(format!(
                "the preconditioner could not be set up (reason {failed})"
            )));
        }
        Ok(made)
    }

    /// z ≈ A⁻¹r.
    pub fn apply(&mut self, r: &[f64], z: &mut [f64]) -> Result<(), PetscError> {
        self.r.write(|to| to.copy_from_slice(r))?;
        petsc!(PCApply(self.raw, self.r.raw, self.z.raw));
        self.z.read(|from| z.copy_from_slice(from))
    }

    /// PETSc's version, the kind in the words of the options, and the unknowns of its levels.
    pub fn about(&self) -> Result<String, PetscError> {
        let mut kind = null();
        petsc!(PCGetType(self.raw, &mut kind));
        // SAFETY: PETSc returns a C string.
        let kind = unsafe { CStr::from_ptr(kind) }.to_string_lossy();
        let mut about = format!("{}: {kind}", version());
        // Others that a user may have chosen have no levels to ask for.
        if kind == "gamg" {
            let levels = self.levels()?;
            let levels: Vec<String> = levels.iter().map(usize::to_string).collect();
            about += &format!(", levels of {} unknowns", levels.join(", "));
        }
        Ok(about)
    }

    /// Unknowns of the levels of GAMG, the finest first.
    fn levels(&self) -> Result<Vec<usize>, PetscError> {
        let mut count = 0;
        petsc!(PCMGGetLevels(self.raw, &mut count));
        let size = |level| {
            let (mut solver, mut matrix, mut rows) = (null_mut(), null_mut(), 0);
            petsc!(PCMGGetSmoother(self.raw, level, &mut solver));
            petsc!(KSPGetOperators(solver, &mut matrix, null_mut()));
            petsc!(MatGetSize(matrix, &mut rows, null_mut()));
            Ok(rows as usize)
        };
        (0..count).rev().map(size).collect()
    }
}
