#!/usr/bin/env bash
# Runs a command on one of the software drivers that scripts/drivers.sh fetched:
#   scripts/with-driver.sh mesa-22|mesa-25|swiftshader|system COMMAND [ARGUMENT]...
# `system` leaves the choice of the driver alone. SUNFLECK_TEST_DRIVER tells the command which one it was given.
set -euo pipefail

usage() {
    echo "usage: scripts/with-driver.sh mesa-22|mesa-25|swiftshader|system COMMAND [ARGUMENT]..." >&2
    exit 2
}

[ $# -ge 2 ] || usage
name=$1
shift
cache="${XDG_CACHE_HOME:-$HOME/.cache}/sunfleck"
folder="$cache/drivers/$name"

case "$name" in
system) ;;
mesa-22 | mesa-25 | swiftshader)
    if [ ! -e "$folder/complete" ]; then
        echo "with-driver: $name is not there yet; run scripts/drivers.sh" >&2
        exit 1
    fi
    # Loaders older than 1.3.207 know only the second name.
    export VK_DRIVER_FILES="$folder/icd.json" VK_ICD_FILENAMES="$folder/icd.json"
    export VK_LAYER_PATH="$cache/drivers/layers"
    libraries=$(find "$folder/root" -type d -name '*-linux-gnu' -printf '%p:' 2>/dev/null || true)
    if [ -n "$libraries" ]; then
        export LD_LIBRARY_PATH="$libraries${LD_LIBRARY_PATH:-}"
        LD_LIBRARY_PATH=${LD_LIBRARY_PATH%:}
    fi
    ;;
*) usage ;;
esac

# Mesa's shader cache knows neither the driver's build nor the width of the vectors it compiled for.
export MESA_SHADER_CACHE_DIR="$cache/shader-cache/$name-${LP_NATIVE_VECTOR_WIDTH:-default}"
mkdir -p "$MESA_SHADER_CACHE_DIR"
export SUNFLECK_TEST_DRIVER="$name"
exec "$@"
