#!/usr/bin/env bash
# Networks on a device beside the processor: differences and times. Without a card, Mesa's software
# Vulkan stands in for one; it shows what is computed, not how fast a card would be.
set -euo pipefail
cd "$(dirname "$0")/.."
device=${1:-wgpu}
if [ "$device" = wgpu ] && ! ls /usr/share/vulkan/icd.d/*.json > /dev/null 2>&1; then
  apt-get update -qq && apt-get install -y -qq --no-install-recommends mesa-vulkan-drivers > /dev/null
fi
cargo run --features "vpr-nets/${device%%:*}" --example devices -- "$device"
