#!/usr/bin/env bash
# Takes the pictures of docs/report.md from a report, in headless Chromium.
#
#     docs/images/report_pictures.sh runs/free_throw/report.html docs/images '#demo=4&at=0.8'
set -euo pipefail
page=$(realpath "$1")
out=$(realpath "$2")
moment=${3:-'#at=0.8'}
profile=$(mktemp -d)
trap 'rm -rf "$profile"' EXIT

# name, width, height, further switches
shoot() {
  chromium --headless --no-sandbox --disable-dev-shm-usage --disable-quic --no-first-run --disable-background-networking --disable-component-update \
    --disable-sync --user-data-dir="$profile/$1" --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader \
    --hide-scrollbars --virtual-time-budget=4000 --window-size="$2,$3" --screenshot="$out/report_$1.png" "${@:4}" \
    "file://$page$moment" >"$profile/log" 2>&1 || { cat "$profile/log"; exit 1; }
}

shoot light 1120 1420
shoot dark 1120 1420 --blink-settings=preferredColorScheme=0
shoot narrow 480 1900
