#!/usr/bin/env bash
# Takes the pictures of docs/report.md from a report, in headless Chromium; with a second report that of its replay alone,
# which is of an environment in Python.
#
#     docs/images/report_pictures.sh runs/free_throw/report.html docs/images '#demo=4&at=0.8' runs/HalfCheetah-v5/report.html
set -euo pipefail
page=$(realpath "$1")
out=$(realpath "$2")
moment=${3:-'#at=0.8'}
profile=$(mktemp -d)
trap 'rm -rf "$profile"' EXIT

# The same page with two of its sections alone, as a picture begins at the top of a page.
lower=$profile/lower.html
sed 's|</head>|<style>main > section:not(#judges):not(#replay), #top, #foot { display: none }</style></head>|' "$page" >"$lower"

# name, page, width, height, further switches
shoot() {
  chromium --headless --no-sandbox --disable-dev-shm-usage --disable-quic --no-first-run --disable-background-networking --disable-component-update \
    --disable-sync --user-data-dir="$profile/$1" --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader \
    --hide-scrollbars --virtual-time-budget=4000 --window-size="$3,$4" --screenshot="$out/report_$1.png" "${@:5}" \
    "file://$2$moment" >"$profile/log" 2>&1 || { cat "$profile/log"; exit 1; }
}

shoot light "$page" 1120 1390
shoot dark "$page" 1120 1390 --blink-settings=preferredColorScheme=0
shoot narrow "$page" 480 1900
shoot judges "$lower" 1120 990
if [ -n "${4:-}" ]; then
  sed 's|</head>|<style>main > section:not(#replay), #top, #foot { display: none }</style></head>|' "$(realpath "$4")" >"$lower"
  moment='#demo=4&at=20'
  shoot film "$lower" 1120 620
fi
