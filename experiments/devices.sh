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

# A command that must end with exit code 2 and one line on stderr.
refused() {
  local what=$1 code=0
  shift
  "$@" > /dev/null 2> "$work/stderr" || code=$?
  printf '%s: exit %s: %s\n' "$what" "$code" "$(cat "$work/stderr")"
  if [ "$code" != 2 ] || [ "$(wc -l < "$work/stderr")" != 1 ]; then
    echo "must be exit 2 and one line" >&2
    exit 1
  fi
}

encode=("$built/bench" encode data/fixture/places/ref --method default --out "$work/map.safetensors" --quiet)
refused "a device that is not there" "${encode[@]}" --device "$kind:99"
# Software Vulkan takes the memory of the process: what the program itself needs, and little more.
if [ "$kind" = wgpu ]; then
  refused "a device without memory" prlimit --as="${VPR_DEVICE_MEMORY:-1500000000}" \
    "${encode[@]}" --device "$device" --image-size 960 1280 --batch-size 6
fi
"$built/examples/devices" "$device"
