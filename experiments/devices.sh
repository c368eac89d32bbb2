#!/usr/bin/env bash
# Networks on a device beside the processor: differences and times, and what a program says when a
# device is not there or has no memory. Without a card, Mesa's software Vulkan stands in for one; it
# shows what is computed, not how fast a card would be.
set -euo pipefail
cd "$(dirname "$0")/.."
device=${1:-wgpu}
kind=${device%%:*}
if [ "$kind" = wgpu ] && ! ls /usr/share/vulkan/icd.d/*.json > /dev/null 2>&1; then
  apt-get update -qq && apt-get install -y -qq --no-install-recommends mesa-vulkan-drivers > /dev/null
fi
cargo build --workspace --bin bench --example devices --features "vpr-bench/$kind"
built=${CARGO_TARGET_DIR:-target}/debug
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Without a desktop, libraries of Mesa's complain on stderr.
export XDG_RUNTIME_DIR=${XDG_RUNTIME_DIR:-$work} VPR_NO_PROGRESS=1

# Runs a command; its exit code is then in `code`, and whether it was 2 with one line decides.
refused() {
  code=0
  "$@" > /dev/null 2> "$work/stderr" || code=$?
  [ "$code" = 2 ] && [ "$(wc -l < "$work/stderr")" = 1 ]
}
encode=("$built/bench" encode data/fixture/places/ref --method default --out "$work/map.safetensors")

refused "${encode[@]}" --device "$kind:99" || { cat "$work/stderr"; echo "exit $code, not 2 and one line" >&2; exit 1; }
echo "a device that is not there: $(cat "$work/stderr")"

# Software Vulkan takes the memory of the process. With too little not even the driver starts, with a
# little more the program runs; between the two the device has none left.
if [ "$kind" = wgpu ]; then
  for megabytes in $(seq 550 50 1200); do
    if refused prlimit --as="${megabytes}000000" "${encode[@]}" --device "$device"; then
      echo "a device without memory ($megabytes MB): $(cat "$work/stderr")"
      break
    fi
    [ "$code" != 0 ] || { echo "no limit of memory was refused in one line" >&2; exit 1; }
  done
fi
"$built/examples/devices" "$device"
