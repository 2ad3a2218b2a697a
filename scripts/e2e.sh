#!/usr/bin/env bash
# Drives the page of `sunfleck watch` in headless Chromium (tests/e2e/watch.mjs). Wants node, chromium, and playwright-core,
# which npm puts under ~/.cache/sunfleck/e2e.
#   scripts/e2e.sh [--skip] [SCREENSHOT_FOLDER]
# What is missing is an error; with --skip it is said, and nothing is done. SUNFLECK_E2E_INSTALL=1 installs it by apt-get.
set -euo pipefail

cd "$(dirname "$0")/.."
sunfleck="${CARGO_TARGET_DIR:-target}/release/sunfleck"
modules="${XDG_CACHE_HOME:-$HOME/.cache}/sunfleck/e2e"
# Runs with Debian 12's node, 18; later ones want 20.
playwright=playwright-core@1.57.0
skip=""
if [ "${1:-}" = --skip ]; then
    skip=yes
    shift
fi

missing() {
    if [ -n "$skip" ]; then
        echo "e2e: skipped: $*"
        exit 0
    fi
    echo "e2e: $*; SUNFLECK_E2E_INSTALL=1 make e2e installs it on Debian and Ubuntu" >&2
    exit 2
}

have() { command -v "$1" >/dev/null; }

find_chromium() { # prints the browser's path
    if [ -n "${CHROMIUM:-}" ]; then
        echo "$CHROMIUM"
        return
    fi
    local name
    for name in chromium chromium-browser google-chrome; do
        command -v "$name" && return
    done
    return 1
}

if [ -n "${SUNFLECK_E2E_INSTALL:-}" ]; then
    wanted=()
    have node || wanted+=(nodejs)
    have npm || wanted+=(npm)
    find_chromium >/dev/null || wanted+=(chromium)
    if [ ${#wanted[@]} -gt 0 ]; then
        echo "e2e: installing ${wanted[*]}"
        root=()
        [ "$(id -u)" = 0 ] || root=(sudo)
        "${root[@]}" apt-get update -q
        "${root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends "${wanted[@]}"
    fi
fi

have node || missing "there is no node"
CHROMIUM=$(find_chromium) || missing "there is no chromium"
export CHROMIUM
export NODE_PATH="$modules/node_modules${NODE_PATH:+:$NODE_PATH}"
find_playwright() { node -e 'require("playwright-core")' >/dev/null 2>&1; }
if ! find_playwright; then
    have npm || missing "there is no npm to install $playwright with"
    mkdir -p "$modules"
    npm install --silent --no-fund --no-audit --prefix "$modules" "$playwright" || missing "npm cannot install $playwright"
    find_playwright || missing "$playwright does not run where npm has put it"
fi
[ -x "$sunfleck" ] || missing "$sunfleck is not built"
exec node tests/e2e/watch.mjs "$sunfleck" "$@"
