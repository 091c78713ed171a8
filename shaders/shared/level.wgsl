// Included by the kernels of the multigrid levels: everything in f32, in blocks whose shape the host
// writes before this text (`ROWS`, `COLUMNS`, `In`, `Out`, `block_times`, `load_column`).

struct Params {
    /// Block rows of this part, and the first of them.
    count: u32,
    first: u32,
    /// Where the columns start in `structure`, behind the slices.
    columns: u32,
    flags: u32,
    /// Coefficients of the smoother.
    c1: f32,
    c2: f32,
}
