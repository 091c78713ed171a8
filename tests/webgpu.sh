#!/bin/sh
# The kernels in f32 with a second compiler and on a second driver: Tint, the WGSL compiler of Chromium, through Dawn's bindings for Node,
# and SwiftShader, its software driver for Vulkan. Every module is compiled; products, smoothing steps and a run of CG are compared with f64;
# three templates are solved with the forces of the CPU. Needs node, npm and x86-64 Linux.
set -eu
cd "$(dirname "$0")/.."
place="$(mktemp -d)"
trap 'rm -rf "$place"' EXIT
mkdir "$place/wgsl"
cp tests/webgpu/*.mjs "$place"
npm install --prefix "$place" --no-audit --no-fund --silent webgpu@0.6.2
(cd "$place" && npm pack --silent @sparticuz/chromium@147.0.0 && tar -xzf sparticuz-chromium-*.tgz package/bin/swiftshader.tar.br)
node -e 'process.stdout.write(require("zlib").brotliDecompressSync(require("fs").readFileSync(process.argv[1])))' \
    "$place/package/bin/swiftshader.tar.br" | tar -x -C "$place"

SIGNORINI_WGSL="$place/wgsl" cargo test --release --lib -- --ignored --exact backend::gpu::kernels::tests::write_modules
cargo build --release
# Both names of the variable: old loaders know the second one only.
export VK_DRIVER_FILES="$place/vk_swiftshader_icd.json" VK_ICD_FILENAMES="$place/vk_swiftshader_icd.json"

# The bindings sometimes end with a signal of their own; a failed check ends with 1.
for attempt in 1 2 3; do
    code=0
    node "$place/check.mjs" "$place/wgsl" || code=$?
    [ "$code" -lt 128 ] && break
    echo "node ended with $code: attempt $attempt of 3" >&2
done
[ "$code" -eq 0 ] || exit "$code"

for template in press collar roller; do
    for backend in cpu gpu; do
        target/release/signorini solve "examples/$template.toml" --stiffness pcg --backend "$backend" --adapter SwiftShader --quiet \
            --output "$place/$backend" >/dev/null
    done
    printf '%s: ' "$template"
    node "$place/forces.mjs" "$place/cpu/report.json" "$place/gpu/report.json"
done
