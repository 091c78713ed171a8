//! The parts of PETSc in use, with owners that release them: the only place where its C interface is called.
//!
//! `build.rs` writes the interface from PETSc's own headers. Every call is collective unless it is about local values.

use crate::ranks::Group;
use mpi::traits::AsRaw;
use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::ptr::{null, null_mut};
use std::rc::Rc;

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
pub(super) fn version() -> String {
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

/// A distributed vector with some blocks on each rank; as `Ghosts`, with copies of some blocks of others.
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

/// Blocks of others that this rank has copies of.
pub(super) struct Ghosts {
    vector: Vector,
    own: usize,
}

impl Ghosts {
    /// Of so many own blocks and the blocks with these numbers, all counted rank by rank.
    pub fn new(
        group: &Group,
        block: usize,
        own: usize,
        ghosts: &[u64],
    ) -> Result<Self, PetscError> {
        let numbers = ghosts.iter().map(|&ghost| int(ghost as usize));
        let numbers = numbers.collect::<Result<Vec<Int>, _>>()?;
        let mut raw = null_mut();
        petsc!(VecCreateGhostBlock(
            group.communicator().as_raw(),
            int(block)?,
            int(block * own)?,
            DECIDE,
            int(ghosts.len())?,
            numbers.as_ptr(),
            &mut raw,
        ));
        Ok(Self {
            vector: Vector { raw },
            own: block * own,
        })
    }

    /// Updates the copies from their owners: the own values come first, the copies after them.
    pub fn update(&mut self, values: &mut [f64]) -> Result<(), PetscError> {
        let own = self.own;
        self.vector.write(|to| to.copy_from_slice(&values[..own]))?;
        let raw = self.vector.raw;
        let (insert, forward) = (
            sys::InsertMode_INSERT_VALUES,
            sys::ScatterMode_SCATTER_FORWARD,
        );
        petsc!(VecGhostUpdateBegin(raw, insert, forward));
        petsc!(VecGhostUpdateEnd(raw, insert, forward));
        let mut local = null_mut();
        petsc!(VecGhostGetLocalForm(raw, &mut local));
        with_array(local, |from| values.copy_from_slice(from))?;
        petsc!(VecGhostRestoreLocalForm(raw, &mut local));
        Ok(())
    }
}

/// A square matrix in blocks with some rows on each rank.
pub(super) struct Matrix {
    raw: sys::Mat,
    block: usize,
    /// The first of its block rows.
    first: usize,
    /// Its block rows.
    own: usize,
}

impl Drop for Matrix {
    fn drop(&mut self) {
        // SAFETY: this is its owner. An error has no consequence here.
        unsafe { sys::MatDestroy(&mut self.raw) };
    }
}

impl Matrix {
    /// From the block rows of this rank, each with the numbers of its columns and the blocks there, by rows. `counts` has, for
    /// each row, the number of its blocks in columns of own nodes and in others.
    pub fn new<'a, const D: usize>(
        group: &Group,
        first: usize,
        counts: &[[usize; 2]],
        rows: impl Iterator<Item = (&'a [u64], &'a [[[f64; D]; D]])>,
    ) -> Result<Self, PetscError> {
        let own = counts.len();
        let mut raw = null_mut();
        petsc!(MatCreate(group.communicator().as_raw(), &mut raw));
        let matrix = Self {
            raw,
            block: D,
            first,
            own,
        };
        let local = int(D * own)?;
        let decide = DECIDE;
        petsc!(MatSetSizes(raw, local, local, decide, decide));
        petsc!(MatSetBlockSize(raw, int(D)?));
        let kind = text("aij");
        petsc!(MatSetType(raw, kind.as_ptr()));
        let entries = |which: usize| {
            let each = counts.iter().flat_map(|count| [D * count[which]; D]);
            each.map(int).collect::<Result<Vec<Int>, _>>()
        };
        let (here, there) = (entries(0)?, entries(1)?);
        petsc!(MatSeqAIJSetPreallocation(raw, 0, here.as_ptr()));
        petsc!(MatMPIAIJSetPreallocation(
            raw,
            0,
            here.as_ptr(),
            0,
            there.as_ptr()
        ));
        let (mut columns, mut values) = (Vec::new(), Vec::new());
        for (row, (numbers, blocks)) in rows.enumerate() {
            columns.clear();
            for &number in numbers {
                columns.push(int(number as usize)?);
            }
            values.clear();
            for i in 0..D {
                values.extend(blocks.iter().flat_map(|block| block[i]));
            }
            let row = int(first + row)?;
            petsc!(MatSetValuesBlocked(
                raw,
                1,
                &row,
                int(columns.len())?,
                columns.as_ptr(),
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

    /// y = K x.
    pub fn multiply(&self, x: &Vector, y: &mut Vector) -> Result<(), PetscError> {
        petsc!(MatMult(self.raw, x.raw, y.raw));
        Ok(())
    }

    /// Passes the entries of each own row: its number among the own ones, the numbers of the columns, the values.
    pub fn for_rows(&self, mut take: impl FnMut(usize, &[Int], &[f64])) -> Result<(), PetscError> {
        for row in 0..self.block * self.own {
            let number = int(self.block * self.first + row)?;
            let (mut count, mut columns, mut values) = (0, null(), null());
            petsc!(MatGetRow(
                self.raw,
                number,
                &mut count,
                &mut columns,
                &mut values
            ));
            if count > 0 {
                // SAFETY: PETSc guarantees so many numbers, until they are released.
                let (columns, values) = unsafe {
                    (
                        std::slice::from_raw_parts(columns, count as usize),
                        std::slice::from_raw_parts(values, count as usize),
                    )
                };
                take(row, columns, values);
            }
            petsc!(MatRestoreRow(
                self.raw,
                number,
                &mut count,
                &mut columns,
                &mut values
            ));
        }
        Ok(())
    }

    /// Sets the points of its block rows, which define its rigid-body motions.
    pub fn set_points<const D: usize>(&mut self, points: &[[f64; D]]) -> Result<(), PetscError> {
        let mut places = self.vector()?;
        petsc!(VecSetBlockSize(places.raw, int(D)?));
        places.write(|to| to.copy_from_slice(points.as_flattened()))?;
        let mut modes = null_mut();
        petsc!(MatNullSpaceCreateRigidBody(places.raw, &mut modes));
        petsc!(MatSetNearNullSpace(self.raw, modes));
        petsc!(MatNullSpaceDestroy(&mut modes));
        Ok(())
    }
}

/// z ≈ K⁻¹r.
pub(super) struct Preconditioner {
    raw: sys::PC,
    /// It must not outlive its matrix.
    _matrix: Rc<Matrix>,
}

impl Drop for Preconditioner {
    fn drop(&mut self) {
        // SAFETY: this is its owner. An error has no consequence here.
        unsafe { sys::PCDestroy(&mut self.raw) };
    }
}

impl Preconditioner {
    /// With the options of this prefix.
    pub fn new(group: &Group, matrix: &Rc<Matrix>, prefix: &str) -> Result<Self, PetscError> {
        let mut raw = null_mut();
        petsc!(PCCreate(group.communicator().as_raw(), &mut raw));
        let made = Self {
            raw,
            _matrix: Rc::clone(matrix),
        };
        let prefix = text(prefix);
        petsc!(PCSetOptionsPrefix(raw, prefix.as_ptr()));
        petsc!(PCSetOperators(raw, matrix.raw, matrix.raw));
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

    /// z ≈ K⁻¹r.
    pub fn apply(&self, r: &Vector, z: &mut Vector) -> Result<(), PetscError> {
        petsc!(PCApply(self.raw, r.raw, z.raw));
        Ok(())
    }

    /// Its kind, in the words of the options.
    pub fn kind(&self) -> Result<String, PetscError> {
        let mut kind = null();
        petsc!(PCGetType(self.raw, &mut kind));
        // SAFETY: PETSc returns a C string.
        Ok(unsafe { CStr::from_ptr(kind) }
            .to_string_lossy()
            .into_owned())
    }

    /// Unknowns of the levels of multigrid, the finest first.
    pub fn levels(&self) -> Result<Vec<usize>, PetscError> {
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
