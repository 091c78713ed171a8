// Compiles every kernel in f32 with Tint and runs the kernels of the matrices and of CG on random data; references are made here in
// f64, without any code of the library.
//
//   node check.mjs FOLDER       with the modules, one file each

import { create, globals } from "webgpu";
import fs from "node:fs";

Object.assign(globalThis, globals);
const folder = process.argv[2];
// It has to outlive all that comes from it.
const gpu = create([]);
const adapter = await gpu.requestAdapter();
if (!adapter) throw new Error("no adapter: tests/run.sh installs a software one");
console.log(`adapter: ${adapter.info.description || adapter.info.device}`);
const device = await adapter.requestDevice();
let failures = 0;
const fail = (text) => {
    failures += 1;
    console.log(text);
};
device.addEventListener("uncapturederror", (event) => fail(event.error.message));

// Every module.
const pipelines = {};
const names = fs.readdirSync(folder).filter((name) => name.endsWith(".wgsl"));
for (const name of names) {
    const code = fs.readFileSync(`${folder}/${name}`, "utf8");
    device.pushErrorScope("validation");
    const module = device.createShaderModule({ code });
    const compute = { module, entryPoint: "main" };
    const made = device.createComputePipeline({ layout: "auto", compute });
    const error = await device.popErrorScope();
    if (error) fail(`${name}: ${error.message}`);
    else pipelines[name.replace(".wgsl", "")] = made;
}
console.log(`${Object.keys(pipelines).length} of ${names.length} modules compiled`);
if (names.length < 50) fail("modules are missing");

// Data.
let seed = 12345;
const uniform = () => {
    seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
    return seed / 2 ** 32;
};
const number = () => Math.fround(2 * uniform() - 1);
const numbers = (n) => Float32Array.from({ length: n }, number);

const FLAGS = { ADD: 1, NEGATE: 2, BASE: 4, DOT: 8, WRITES_STATE: 16, CONTINUES: 32, FIRST: 64 };
// In the order of shaders/shared/params.wgsl.
const WORDS = ["count", "first", "first_partial", "first_read", "n_read", "columns", "flags", "lanes"];

const buffer = (data, usage = GPUBufferUsage.STORAGE) => {
    const size = Math.max(16, Math.ceil(data.byteLength / 16) * 16);
    const all = usage | GPUBufferUsage.COPY_SRC | GPUBufferUsage.COPY_DST;
    const made = device.createBuffer({ size, usage: all });
    device.queue.writeBuffer(made, 0, data.buffer, data.byteOffset, data.byteLength);
    return made;
};
const run = (name, parameters, buffers, groups) => {
    const words = new Uint32Array(12);
    WORDS.forEach((word, i) => (words[i] = parameters[word] ?? 0));
    new Float32Array(words.buffer).set([parameters.c1 ?? 0, parameters.c2 ?? 0], WORDS.length);
    const all = [buffer(words, GPUBufferUsage.UNIFORM), ...buffers];
    const pipeline = pipelines[name];
    if (!pipeline) return fail(`${name}: not there`);
    const bindGroup = device.createBindGroup({
        layout: pipeline.getBindGroupLayout(0),
        entries: all.map((buffer, binding) => ({ binding, resource: { buffer } })),
    });
    const encoder = device.createCommandEncoder();
    const pass = encoder.beginComputePass();
    pass.setPipeline(pipeline);
    pass.setBindGroup(0, bindGroup);
    pass.dispatchWorkgroups(groups);
    pass.end();
    device.queue.submit([encoder.finish()]);
};
const read = async (from, Type = Float32Array) => {
    const usage = GPUBufferUsage.MAP_READ | GPUBufferUsage.COPY_DST;
    const staging = device.createBuffer({ size: from.size, usage });
    const encoder = device.createCommandEncoder();
    encoder.copyBufferToBuffer(from, 0, staging, 0, from.size);
    device.queue.submit([encoder.finish()]);
    await staging.mapAsync(GPUMapMode.READ);
    const found = new Type(staging.getMappedRange().slice(0));
    staging.unmap();
    return found;
};
let comparisons = 0;
// `sizes` are the sums of the absolute values of all terms.
const compare = (what, found, expected, sizes) => {
    comparisons += 1;
    for (let i = 0; i < expected.length; i++) {
        if (!(Math.abs(found[i] - expected[i]) <= 2e-6 * sizes[i])) {
            return fail(`${what}, entry ${i}: ${found[i]} instead of ${expected[i]}`);
        }
    }
};

// A sparse matrix of n block rows in slices of 32; `group` entries of a block are adjacent.
const matrix = (n, rows, columns, group, most) => {
    const block = rows * columns;
    const all = Array.from({ length: n }, () => {
        const places = new Set();
        const length = Math.min(n, 1 + Math.floor(uniform() * most));
        while (places.size < length) places.add(Math.floor(uniform() * n));
        return [...places].map((j) => [j, numbers(block)]);
    });
    const slices = Math.ceil(n / 32);
    const starts = [0];
    for (let s = 0; s < slices; s++) {
        const lengths = all.slice(32 * s, 32 * (s + 1)).map((row) => row.length);
        starts.push(starts[s] + 32 * Math.max(...lengths));
    }
    const structure = new Uint32Array(slices + 1 + starts[slices]);
    structure.set(starts);
    const values = new Float32Array(starts[slices] * block);
    all.forEach((row, i) => {
        const start = starts[i >> 5];
        const lane = i & 31;
        row.forEach(([j, entries], c) => {
            structure[slices + 1 + start + 32 * c + lane] = j;
            entries.forEach((v, e) => {
                const inside = (Math.floor(e / group) * 32 + lane) * group + (e % group);
                values[(start + 32 * c) * block + inside] = v;
            });
        });
    });
    const times = (x) => {
        const [sums, sizes] = [new Float64Array(n * rows), new Float64Array(n * rows)];
        all.forEach((row, i) =>
            row.forEach(([j, entries]) =>
                entries.forEach((v, e) => {
                    const term = v * x[j * columns + (e % columns)];
                    const at = i * rows + Math.floor(e / columns);
                    sums[at] += term;
                    sizes[at] += Math.abs(term);
                }),
            ),
        );
        return [sums, sizes];
    };
    return { structure: buffer(structure), values: buffer(values), columns: slices + 1, times };
};

// A state of CG that is not over.
const state = buffer(new Uint8Array(128));
const GROUPS = 7;

for (const [rows, columns] of [[2, 2], [2, 3], [3, 2], [3, 3], [3, 6], [6, 3], [6, 6]]) {
    for (const [n, lanes, most] of [[2003, 1, 12], [2003, 4, 12], [131, 32, 70], [5, 128, 5]]) {
        const of = (name) => `${name}_${rows}x${columns}${lanes > 1 ? "_shared" : ""}`;
        const m = matrix(n, rows, columns, rows * columns === 4 ? 4 : 1, most);
        const [x, b, y0] = [n * columns, n * rows, n * rows].map(numbers);
        const [product, sizes] = m.times(x);
        const parameters = { count: n, columns: m.columns, lanes };
        const [structure, values, xs, bs] = [m.structure, m.values, buffer(x), buffer(b)];
        const { ADD, NEGATE, BASE, DOT, FIRST } = FLAGS;
        for (const name of ["multiply_K", "multiply"].map(of)) {
            for (const flags of [0, ADD, NEGATE | BASE, ADD | NEGATE, DOT]) {
                const [y, partials] = [buffer(y0), buffer(new Float32Array(2 * GROUPS + 6))];
                const buffers = [state, structure, values, xs, bs, y, partials];
                run(name, { ...parameters, flags, first_partial: 3 }, buffers, GROUPS);
                const expected = product.map(
                    (v, i) =>
                        (flags & NEGATE ? -v : v) + (flags & BASE ? b[i] : 0) + (flags & ADD ? y0[i] : 0),
                );
                compare(`${name} ${flags}`, await read(y), expected, sizes.map((s) => s + 2));
                if (flags & DOT) {
                    const sums = (await read(partials)).slice(6);
                    const add = (terms) => terms.reduce((sum, v) => sum + v, 0);
                    const found = add(Array.from({ length: GROUPS }, (_, g) => sums[2 * g]));
                    const terms = [...product.map((v, i) => v * b[i])];
                    compare(`${name} dot`, [found], [add(terms)], [add(terms.map(Math.abs))]);
                }
            }
        }
        if (rows !== columns) continue;
        const [c1, c2] = [0.37, 1.21].map(Math.fround);
        const [inverse, d0] = [numbers(n * rows * rows), numbers(n * rows)];
        // D⁻¹ r, and the sizes of its terms.
        const times = (r) => {
            const terms = (i) =>
                Array.from({ length: rows }, (_, k) => inverse[i * rows + k] * r[i - (i % rows) + k]);
            const all = Array.from(r, (_, i) => terms(i));
            const add = (list) => list.reduce((a, v) => a + v, 0);
            return [all.map(add), all.map((list) => add(list.map(Math.abs)))];
        };
        {
            const [d, next] = [buffer(d0), buffer(new Float32Array(n * rows))];
            const buffers = [state, structure, values, buffer(inverse), bs, xs, d, next];
            run(of("smooth"), { ...parameters, c1, c2 }, buffers, GROUPS);
            const [z, more] = times(Float64Array.from(b, (v, i) => v - product[i]));
            const [, most] = times(sizes.map((s) => s + 1));
            const step = z.map((v, i) => c1 * d0[i] + c2 * v);
            const scale = more.map((s, i) => 3 * (s + most[i]) + 4);
            compare(`${of("smooth")} d`, await read(d), step, scale);
            compare(`${of("smooth")} x`, await read(next), step.map((v, i) => v + x[i]), scale);
        }
        for (const flags of [0, FIRST, ADD]) {
            const [d, y] = [buffer(d0), buffer(y0)];
            const buffers = [state, structure, values, xs, d, y];
            run(of("patches"), { ...parameters, flags, c1, c2 }, buffers, GROUPS);
            const before = flags & ADD ? 1 : flags & FIRST ? 0 : c1;
            const step = product.map((v, i) => before * d0[i] + c2 * v);
            const moved = product.map((v, i) =>
                flags & ADD ? y0[i] + c2 * v : flags & FIRST ? c2 * v : y0[i] + step[i],
            );
            const scale = sizes.map((s) => 2 * s + 4);
            compare(`${of("patches")} d ${flags}`, await read(d), step, scale);
            compare(`${of("patches")} y ${flags}`, await read(y), moved, scale);
        }
        if (lanes > 1) continue;
        for (const flags of [0, FIRST]) {
            const [d, r] = [buffer(d0), numbers(n * rows)];
            const next = buffer(r);
            const name = `diagonal_${rows}x${rows}`;
            run(name, { count: n, flags, c1, c2 }, [state, buffer(inverse), bs, xs, d, next], GROUPS);
            const [z, more] = times(flags & FIRST ? b : r);
            const step = z.map((v, i) => (flags & FIRST ? 0 : c1 * d0[i]) + c2 * v);
            const moved = step.map((v, i) => (flags & FIRST ? v : v + x[i]));
            const scale = more.map((s) => 2 * s + 4);
            compare(`${name} d ${flags}`, await read(d), step, scale);
            compare(`${name} x ${flags}`, await read(next), moved, scale);
        }
    }
}

// The inverse of the coarsest level.
{
    const n = 600;
    const [m, b, x] = [numbers(n * n), numbers(n), buffer(new Float32Array(n))];
    run("dense", { count: n }, [state, buffer(m), buffer(b), x], n);
    const expected = Array.from(b, (_, i) => b.reduce((sum, v, j) => sum + m[i * n + j] * v, 0));
    compare("dense", await read(x), expected, expected.map(() => n / 4));
}

// A run of CG with z = r, on tridiagonal blocks.
{
    const n = 3000;
    const slices = Math.ceil(n / 32);
    const structure = new Uint32Array(slices + 1 + 96 * slices);
    const values = new Float32Array(9 * 96 * slices);
    for (let s = 0; s <= slices; s++) structure[s] = 96 * s;
    const row = (i) => [[i, 4.1], [i - 1, -1], [i + 1, -1]].filter(([j]) => j >= 0 && j < n);
    for (let i = 0; i < n; i++) {
        row(i).forEach(([j, v], c) => {
            const at = 96 * (i >> 5) + 32 * c;
            structure[slices + 1 + at + (i & 31)] = j;
            for (const e of [0, 4, 8]) values[9 * at + 32 * e + (i & 31)] = v;
        });
    }
    const solution = numbers(3 * n);
    const load = solution.map((_, k) => {
        const [i, a] = [Math.floor(k / 3), k % 3];
        return row(i).reduce((sum, [j, v]) => sum + v * solution[3 * j + a], 0);
    });
    const zeros = () => buffer(new Float32Array(3 * n));
    const [x, rounded, p, q, r] = [zeros(), zeros(), zeros(), zeros(), buffer(load)];
    const [current, next] = [buffer(new Uint8Array(128)), buffer(new Uint8Array(128))];
    const goals = buffer(new Float32Array([1e-11, 0, 0, 0, 1]));
    const [vectors, rows] = [5, 6];
    const partials = buffer(new Float32Array(2 * (vectors + rows)));
    const [structures, entries] = [buffer(structure), buffer(values)];
    const { WRITES_STATE, DOT } = FLAGS;
    const pairs = (3 * n) / 2;
    const sums = { first_read: rows, n_read: vectors };
    run("start", { count: pairs, first_partial: rows }, [r, x, rounded, partials], vectors);
    run("begin", sums, [goals, partials, current, next], 1);
    const direction = () => {
        run("dot", { count: pairs, first_partial: rows }, [next, r, rounded, partials], vectors);
        const parameters = { count: pairs, ...sums, flags: WRITES_STATE };
        run("direction", parameters, [next, current, partials, rounded, p], vectors);
    };
    direction();
    for (let i = 0; i < 60; i++) {
        const product = { count: n, columns: slices + 1, flags: DOT, lanes: 1 };
        run("multiply_K_3x3", product, [current, structures, entries, p, p, q, partials], rows);
        const parameters = { count: pairs, first_partial: rows, n_read: rows, flags: WRITES_STATE };
        run("step", parameters, [current, next, partials, p, q, x, r, rounded], vectors);
        run("check", sums, [current, partials, next], 1);
        direction();
    }
    compare("x of CG", await read(x), solution, solution.map(() => 50));
    const words = await read(current, Uint32Array);
    // After ten real numbers: done, broken, iterations.
    const [done, broken, iterations] = words.slice(10);
    if (done !== 1 || broken !== 0 || !(iterations > 5 && iterations < 60)) {
        fail(`CG: done ${done}, broken ${broken}, iterations ${iterations}`);
    }
}

console.log(`${comparisons} comparisons, ${failures} failures`);
device.destroy();
process.exit(failures || !gpu ? 1 : 0);
